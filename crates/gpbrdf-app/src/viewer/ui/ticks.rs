//! Marks of axes at round values, as many as there is room for.

use eframe::egui::Visuals;
use egui_plot::{AxisHints, GridInput, GridMark};
use gpbrdf_core::figure::round_step;

/// Points of the window between two marks of the finest grid that egui draws, which [`GridInput::base_step_size`] is.
const FINEST: f64 = 8.0;
/// Points between two marks that have labels one above the other.
const APART: f64 = 26.0;
/// The most marks of an axis.
const MOST: usize = 60;

/// Points of the window for one unit of the axis.
fn points_per_unit(input: &GridInput) -> f64 {
    FINEST / input.base_step_size.max(f64::MIN_POSITIVE)
}

/// Marks of an axis at 1, 2 and 5 times powers of ten. `apart` is the least number of points between two of them.
pub(crate) fn linear_marks(input: &GridInput, apart: f64) -> Vec<GridMark> {
    stepped(input, round_step(apart / points_per_unit(input)))
}

/// Marks of an axis of degrees at steps that divide a right angle.
pub(crate) fn degree_marks(input: &GridInput, apart: f64) -> Vec<GridMark> {
    let least = apart / points_per_unit(input);
    match [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0].into_iter().find(|step| *step >= least) {
        Some(step) if least > 0.5 => stepped(input, step),
        _ => linear_marks(input, apart),
    }
}

fn stepped(input: &GridInput, step: f64) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    if !(step > 0.0 && step.is_finite() && low.is_finite() && high.is_finite()) {
        return Vec::new();
    }
    let first = (low / step).ceil();
    let marks = (0..MOST).map(|i| (first + i as f64) * step).take_while(|value| *value <= high);
    marks.map(|value| GridMark { value, step_size: step }).collect()
}

/// Marks of an axis that shows logarithms to base 10, at round values: powers of ten, or 1, 2 and 5 times these, or
/// more where the axis shows a part of a decade.
pub(crate) fn log_marks(input: &GridInput) -> Vec<GridMark> {
    let points = points_per_unit(input);
    let (low, high) = input.bounds;
    if !(low.is_finite() && high.is_finite() && high > low && high - low < 600.0) {
        return Vec::new();
    }
    let multiples =
        |step: f64| (0..).map(move |i| 1.0 + step * f64::from(i)).take_while(|m| *m < 10.0 - 1e-9);
    let finer = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0].map(|step| multiples(step).collect::<Vec<_>>());
    for factors in finer.iter().chain([&vec![1.0, 2.0, 5.0], &vec![1.0]]) {
        let places = log_places(low, high, factors);
        let gap = places.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        if places.len() <= MOST && gap * points >= APART {
            let step_size = if gap.is_finite() { gap } else { APART / points };
            return places.into_iter().map(|value| GridMark { value, step_size }).collect();
        }
    }
    // Every second, third, ... power of ten.
    linear_marks(input, APART)
        .into_iter()
        .filter(|mark| (mark.value - mark.value.round()).abs() < 1e-9)
        .collect()
}

/// The logarithms of `factors` times powers of ten within an interval, in order.
fn log_places(low: f64, high: f64, factors: &[f64]) -> Vec<f64> {
    #[expect(clippy::cast_possible_truncation, reason = "within a few hundred")]
    let (first, last) = (low.floor() as i32, high.ceil() as i32);
    let decades = (first..=last).flat_map(|power| factors.iter().map(move |f| f64::from(power) + f.log10()));
    decades.filter(|place| (low..=high).contains(place)).take(MOST + 1).collect()
}

/// An axis whose labels are all as dark as text.
pub(crate) fn axis<'a>(hints: AxisHints<'a>, visuals: &Visuals) -> AxisHints<'a> {
    hints.label_spacing(eframe::egui::Rangef::new(1.0, 2.0)).tick_label_color(visuals.text_color())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The input of an axis that is `size` points long.
    fn input(low: f64, high: f64, size: f64) -> GridInput {
        GridInput { bounds: (low, high), base_step_size: FINEST * (high - low) / size }
    }

    #[test]
    fn logarithmic_marks_are_round_and_apart() {
        let values = |low: f64, high: f64, size: f64| -> Vec<f64> {
            let marks = log_marks(&input(low.log10(), high.log10(), size));
            for pair in marks.windows(2) {
                let gap = (pair[1].value - pair[0].value) * size / (high / low).log10();
                assert!(gap >= APART - 1e-9, "{gap} points between {pair:?}");
            }
            marks.iter().map(|mark| 10f64.powf(mark.value)).collect()
        };
        let same = |found: &[f64], expected: &[f64]| {
            let close = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() < 1e-9;
            assert!(found.len() == expected.len() && found.iter().zip(expected).all(close), "{found:?}");
        };
        same(&values(0.007, 0.09, 300.0), &[0.01, 0.02, 0.05]);
        same(&values(1e-4, 1e2, 300.0), &[1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0]);
        same(&values(0.2, 0.41, 150.0), &[0.2, 0.25, 0.3, 0.35, 0.4]);
        // A part of a decade between powers of ten has labels, too.
        assert!(values(0.31, 0.36, 400.0).len() >= 4);
        assert!(values(1e-12, 1e12, 100.0).len() >= 2);
    }

    #[test]
    fn linear_marks_are_round_and_apart() {
        for (low, high, size) in
            [(-0.13, 0.17, 500.0), (0.0, 90.0, 120.0), (3.0, 3.001, 80.0), (-1e6, 1e7, 900.0)]
        {
            for marks in
                [linear_marks(&input(low, high, size), 40.0), degree_marks(&input(low, high, size), 40.0)]
            {
                assert!(marks.len() > 1, "{marks:?}");
                for pair in marks.windows(2) {
                    let gap = (pair[1].value - pair[0].value) * size / (high - low);
                    assert!(gap >= 40.0 - 1e-6, "{gap}");
                }
                assert!(marks.iter().all(|mark| mark.value >= low - 1e-9 && mark.value <= high + 1e-9));
            }
        }
        let degrees = degree_marks(&input(0.0, 90.0, 200.0), 44.0);
        let degrees: Vec<f64> = degrees.iter().map(|mark| mark.value).collect();
        assert_eq!(degrees, [0.0, 30.0, 60.0, 90.0]);
        assert!(stepped(&input(0.0, f64::NAN, 10.0), 1.0).is_empty());
    }
}
