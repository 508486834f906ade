//! Round numbers: steps of axes and limits of colour scales.

use crate::judge::image_metrics::percentile;

/// The smallest of 1, 2 and 5 times a power of ten that is at least `x`, which is positive.
#[must_use]
pub fn round_step(x: f64) -> f64 {
    let power = 10f64.powf(x.log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().find(|step| step * power >= x * (1.0 - 1e-9));
    step.unwrap_or(10.0) * power
}

/// The limit of a colour scale: the smallest number of the form 1, 2 or 5 times a power of ten that is at
/// least the 99th percentile of the finite absolute values in `mask`, and at least 1e-6.
#[must_use]
pub fn round_limit(values: &[f64], mask: &[bool]) -> f64 {
    let finite = values.iter().zip(mask).filter(|&(x, &inside)| inside && x.is_finite());
    let mut sizes: Vec<f64> = finite.map(|(x, _)| x.abs()).collect();
    if let Some(last) = sizes.len().checked_sub(1) {
        // Only the largest values need an order: sorting all of them would delay the frames of the viewer.
        let cut = last * 98 / 100;
        sizes.select_nth_unstable_by(cut, f64::total_cmp);
        sizes[cut..].sort_unstable_by(f64::total_cmp);
    }
    round_step(percentile(&sizes, 0.99).max(1e-6))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_round_and_cover_the_values() {
        let limit = |values: &[f64]| round_limit(values, &vec![true; values.len()]);
        for (x, expected) in [(0.013, 0.02), (0.02, 0.02), (0.4, 0.5), (7.0, 10.0), (0.0, 1e-6)] {
            assert!((limit(&[x]) / expected - 1.0).abs() < 1e-9, "{x}");
        }
        assert!(limit(&[]) > 0.0 && limit(&[f64::NAN, 0.4]) > 0.0);
        // One value in a hundred may be beyond the limit, in whatever order they come.
        let ramp: Vec<f64> = (0..1000).map(|i| f64::from(i * 7 % 1000)).collect();
        assert_eq!(limit(&ramp), 1000.0);
        let spikes: Vec<f64> = (0..1000).map(|i| if i % 200 == 0 { 1e6 } else { 0.3 }).collect();
        assert_eq!(limit(&spikes), 0.5);
    }
}
