//! Axes: which numbers they have ticks at, and where a value is along them.

use super::scale::round_step;
use crate::base::number::short;

/// How values are spaced along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisScale {
    /// Evenly.
    Linear,
    /// By their logarithms; values that are not positive cannot be shown.
    Logarithmic,
    /// By their square roots, as tables space `theta_h`; negative values cannot be shown.
    SquareRoot,
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What is written along it, with its unit.
    pub name: String,
    /// How values are spaced.
    pub scale: AxisScale,
    /// Its ends; chosen by the values if there are none.
    pub limits: Option<[f64; 2]>,
    /// Where its ticks are; round numbers (1, 2, 5 times a power of ten) if none are given.
    pub ticks: Vec<f64>,
}

impl Axis {
    /// An evenly spaced axis with ends and ticks by the values.
    #[must_use]
    pub fn linear(name: impl Into<String>) -> Self {
        Self { name: name.into(), scale: AxisScale::Linear, limits: None, ticks: Vec::new() }
    }

    /// A logarithmic axis with ends and ticks by the values.
    #[must_use]
    pub fn logarithmic(name: impl Into<String>) -> Self {
        Self { scale: AxisScale::Logarithmic, ..Self::linear(name) }
    }

    /// Degrees from 0 to 90, with ticks every thirty.
    #[must_use]
    pub fn degrees(name: impl Into<String>, scale: AxisScale) -> Self {
        Self { name: name.into(), scale, limits: Some([0.0, 90.0]), ticks: vec![0.0, 30.0, 60.0, 90.0] }
    }

    /// The axis with ends and ticks, at most about `most` of them.
    pub(super) fn ruled(&self, values: impl Iterator<Item = f64>, most: usize) -> Ruled {
        let shown = |x: f64| self.scale.place(x).is_finite();
        let given = self.limits.filter(|&[low, high]| shown(low) && shown(high) && low < high);
        let [low, high] = given.unwrap_or_else(|| {
            let values = values.filter(|&x| shown(x));
            let [low, high] =
                values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(x), h.max(x)]);
            self.scale.widened(low, high)
        });
        let (mut ends, mut ticks, minor) = match self.scale {
            AxisScale::Logarithmic => logarithmic_ticks(low, high, most),
            AxisScale::Linear | AxisScale::SquareRoot => linear_ticks(low, high, most),
        };
        if given.is_some() {
            ends = [low, high];
        }
        if !self.ticks.is_empty() {
            ticks = self.ticks.iter().map(|&x| (x, minus(short(x, 6)))).collect();
        }
        let inside = |x: f64| {
            let slack = 1e-9 * (ends[1] - ends[0]);
            (ends[0] - slack..=ends[1] + slack).contains(&x)
        };
        ticks.retain(|&(x, _)| inside(x));
        let minor = minor.into_iter().filter(|&x| inside(x)).collect();
        Ruled { scale: self.scale, ends, ticks, minor }
    }
}

impl AxisScale {
    /// A number that grows evenly along the axis; not finite for a value that cannot be shown.
    fn place(self, x: f64) -> f64 {
        match self {
            Self::Linear => x,
            Self::Logarithmic if x > 0.0 => x.log10(),
            Self::SquareRoot if x >= 0.0 => x.sqrt(),
            Self::Logarithmic | Self::SquareRoot => f64::NAN,
        }
    }

    /// Ends with some room between them, whatever the values were.
    fn widened(self, low: f64, high: f64) -> [f64; 2] {
        if low > high {
            return if self == Self::Logarithmic { [0.1, 10.0] } else { [0.0, 1.0] };
        }
        match self {
            Self::Logarithmic if high / low < 1.01 => [low / 2.0, high * 2.0],
            Self::Linear if high - low <= 1e-9 * high.abs().max(low.abs()) => {
                let room = if high == 0.0 { 1.0 } else { 0.5 * high.abs() };
                [low - room, high + room]
            }
            Self::SquareRoot if high <= low => [0.0, high.max(1.0)],
            _ => [low, high],
        }
    }
}

/// An axis with ends and ticks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ruled {
    scale: AxisScale,
    pub(super) ends: [f64; 2],
    /// Values with what is written at them.
    pub(super) ticks: Vec<(f64, String)>,
    /// Values between them.
    pub(super) minor: Vec<f64>,
}

impl Ruled {
    /// The part of the axis before a value; `None` for one that cannot be shown.
    pub(super) fn part(&self, x: f64) -> Option<f64> {
        let [low, high] = self.ends.map(|end| self.scale.place(end));
        let t = (self.scale.place(x) - low) / (high - low);
        t.is_finite().then_some(t)
    }
}

type Ticks = ([f64; 2], Vec<(f64, String)>, Vec<f64>);

/// Ends and ticks at multiples of a round step.
fn linear_ticks(low: f64, high: f64, most: usize) -> Ticks {
    let step = round_step((high - low) / most.max(1) as f64);
    if !step.is_finite() || step <= 0.0 {
        return ([low, high], Vec::new(), Vec::new());
    }
    let (first, last) = ((low / step + 1e-9).floor(), (high / step - 1e-9).ceil());
    let ticks = (0..=most + 2).map(|i| first + i as f64).take_while(|&n| n <= last).map(|n| {
        let x = n * step;
        (x, linear_label(x, step))
    });
    ([first * step, last * step], ticks.collect(), Vec::new())
}

/// A number with the decimals of the step between ticks.
fn linear_label(x: f64, step: f64) -> String {
    if !(1e-5..1e6).contains(&step) || x.abs() >= 1e7 {
        return with_power(x);
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 5")]
    let decimals = (-step.log10().floor()).clamp(0.0, 5.0) as usize;
    minus(format!("{:.decimals$}", if x == 0.0 { 0.0 } else { x }))
}

/// Ends and ticks at powers of ten; at twice and five times them, too, where there are few.
fn logarithmic_ticks(low: f64, high: f64, most: usize) -> Ticks {
    let power = 10f64.powf(low.log10().floor());
    let below = [10.0, 5.0, 2.0].into_iter().find(|step| step * power <= low * (1.0 + 1e-9)).unwrap_or(1.0);
    let ends = [below * power, round_step(high)];
    #[expect(clippy::cast_possible_truncation, reason = "exponents of doubles")]
    let decade = |x: f64| x.log10().round() as i32;
    let [first, last] =
        [decade(10f64.powf(ends[0].log10().floor())), decade(10f64.powf(ends[1].log10().ceil()))];
    let decades = f64::from(last - first);
    let stride = round_stride(decades / most.max(1) as f64);
    let (mut marks, mut minor) = (Vec::new(), Vec::new());
    let few = (ends[1] / ends[0]).log10() < 2.0;
    for exponent in first..=last {
        let power = 10f64.powi(exponent);
        let labelled = exponent.rem_euclid(stride) == 0;
        for mantissa in 1..10u8 {
            let x = power * f64::from(mantissa);
            match mantissa {
                1 if labelled => marks.push(x),
                2 | 5 if few => marks.push(x),
                _ if stride == 1 || mantissa == 1 => minor.push(x),
                _ => {}
            }
        }
    }
    let powers = marks.iter().any(|&x| !(0.99e-3..1.01e4).contains(&x));
    let label = |x: f64| if powers { with_power(x) } else { short(x, 3) };
    (ends, marks.into_iter().map(|x| (x, label(x))).collect(), minor)
}

fn round_stride(x: f64) -> i32 {
    [1, 2, 5, 10, 20, 50, 100].into_iter().find(|&stride| f64::from(stride) >= x).unwrap_or(200)
}

/// A number as one to three digits times a power of ten, with the marks of a superscript.
fn with_power(x: f64) -> String {
    let text = format!("{x:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    let exponent = minus(exponent.to_owned());
    match mantissa {
        "0" => "0".to_owned(),
        "1" => format!("10^{{{exponent}}}"),
        _ => format!("{}·10^{{{exponent}}}", minus(mantissa.to_owned())),
    }
}

/// A number with a minus sign in place of a hyphen.
pub(super) fn minus(number: String) -> String {
    match number.strip_prefix('-') {
        Some(size) => format!("\u{2212}{size}"),
        None => number,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, values: &[f64], most: usize) -> Vec<String> {
        axis.ruled(values.iter().copied(), most).ticks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn ticks_are_round_numbers() {
        let linear = Axis::linear("x");
        assert_eq!(labels(&linear, &[0.0, 61.0], 6), ["0", "20", "40", "60", "80"]);
        assert_eq!(labels(&linear, &[-0.3, 0.3], 4), ["\u{2212}0.4", "\u{2212}0.2", "0.0", "0.2", "0.4"]);
        assert_eq!(labels(&linear, &[0.0, 3e9], 3), ["0", "10^{9}", "2·10^{9}", "3·10^{9}"]);
        let logarithmic = Axis::logarithmic("x");
        assert_eq!(labels(&logarithmic, &[0.02, 3000.0], 8), ["0.1", "1", "10", "100", "1000"]);
        assert_eq!(labels(&logarithmic, &[12.0, 90.0], 8), ["10", "20", "50", "100"]);
        let wide = ["10^{\u{2212}8}", "10^{\u{2212}6}", "10^{\u{2212}4}", "10^{\u{2212}2}", "10^{0}"];
        assert_eq!(labels(&logarithmic, &[1e-9, 1.0], 5), wide);
        let degrees = Axis::degrees("x", AxisScale::SquareRoot).ruled([].into_iter(), 9);
        assert!((degrees.part(30.0).unwrap() - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn all_values_are_between_the_ends_and_odd_ones_do_no_harm() {
        for axis in [Axis::linear("x"), Axis::logarithmic("x")] {
            for values in [
                &[][..],
                &[f64::NAN],
                &[2.0],
                &[0.0],
                &[1.0, 1.0 + 1e-15],
                &[-3.0, 5e7],
                &[1e-300, 1e300],
                &[f64::INFINITY, 1.0],
                &[0.37, 0.38],
            ] {
                let ruled = axis.ruled(values.iter().copied(), 5);
                assert!(
                    ruled.ends[0] < ruled.ends[1] && ruled.ticks.len() <= 12,
                    "{axis:?} {values:?} {ruled:?}"
                );
                for part in values.iter().filter(|x| x.is_finite()).filter_map(|&x| ruled.part(x)) {
                    assert!((-1e-9..=1.0 + 1e-9).contains(&part), "{values:?} {ruled:?}");
                }
            }
        }
    }
}
