//! Pearson's chi-square test.

/// The outcome of a chi-square test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// `sum (observed - expected)^2 / expected` over the bins.
    pub statistic: f64,
    /// Number of bins minus one.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least this large if the observations follow the expectation.
    pub p_value: f64,
}

/// Tests counts against expected counts. Bins in which fewer than `least` are expected are pooled with their
/// successors in the order of their expectations until `least` are; what is left at the end joins the last pool.
/// Expectations are scaled to the sum of the observations.
///
/// Source: K. Pearson (1900); the bound of 5 that is usual for `least` is W. G. Cochran's (1952).
#[must_use]
pub fn chi_square(observed: &[f64], expected: &[f64], least: f64) -> ChiSquare {
    let scale = observed.iter().sum::<f64>() / expected.iter().sum::<f64>();
    let mut bins: Vec<(f64, f64)> =
        expected.iter().map(|e| e * scale).zip(observed.iter().copied()).collect();
    bins.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pools: Vec<(f64, f64)> = Vec::new();
    let mut open = (0.0, 0.0);
    for (expected, observed) in bins {
        open = (open.0 + expected, open.1 + observed);
        if open.0 >= least {
            pools.push(open);
            open = (0.0, 0.0);
        }
    }
    if let Some(last) = pools.last_mut() {
        *last = (last.0 + open.0, last.1 + open.1);
    }
    let statistic = pools.iter().map(|(expected, observed)| (observed - expected).powi(2) / expected).sum();
    let degrees_of_freedom = pools.len().saturating_sub(1);
    let p_value = if degrees_of_freedom == 0 {
        1.0
    } else {
        upper_gamma(0.5 * degrees_of_freedom as f64, 0.5 * statistic)
    };
    ChiSquare { statistic, degrees_of_freedom, p_value }
}

/// The regularised upper incomplete gamma function `Q(a, x)`, by its series for `x < a + 1` and else by its continued
/// fraction, evaluated by the method of Lentz. Relative error: about 1e-10 for `a` up to 1e5.
///
/// Source: NIST DLMF 8.7.1 and 8.9.2.
fn upper_gamma(a: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    if !(x > 0.0) {
        return if x.is_nan() { f64::NAN } else { 1.0 };
    }
    if x == f64::INFINITY {
        return 0.0;
    }
    let scale = (a * x.ln() - x - libm::lgamma(a)).exp();
    // Both take about sqrt(a) steps near x = a.
    let most = 200 + 20 * most_steps(a);
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..most {
            term *= x / (a + f64::from(n));
            sum += term;
            if term < sum * 1e-16 {
                break;
            }
        }
        return (1.0 - scale * sum).clamp(0.0, 1.0);
    }
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..most {
        let n = f64::from(n);
        let numerator = -n * (n - a);
        b += 2.0;
        d = 1.0 / keep_from_zero(numerator * d + b, TINY);
        c = keep_from_zero(b + numerator / c, TINY);
        let step = d * c;
        fraction *= step;
        if (step - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (scale * fraction).clamp(0.0, 1.0)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a bound on a count, not negative"
)]
fn most_steps(a: f64) -> u32 {
    a.sqrt() as u32
}

fn keep_from_zero(x: f64, tiny: f64) -> f64 {
    if x.abs() < tiny { tiny } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix64;

    #[test]
    fn the_incomplete_gamma_function_has_the_published_values() {
        // scipy.special.gammaincc
        for (a, x, expected) in [
            (0.5, 0.5, 0.317_310_507_862_911_2),
            (0.5, 12.0, 9.633_570_086_430_95e-7),
            (3.0, 2.0, 0.676_676_416_183_063_5),
            (10.0, 20.0, 0.004_995_412_308_307_604),
            (50.0, 49.0, 0.537_895_606_399_059_8),
            (2000.0, 2050.0, 0.132_149_259_596_494_4),
            (6400.0, 6300.0, 0.894_787_612_642_470_9),
            (6400.0, 6800.0, 4.704_347_148_396_515e-7),
        ] {
            let found = upper_gamma(a, x);
            assert!((found / expected - 1.0).abs() < 1e-8, "Q({a}, {x}) = {found}, expected {expected}");
        }
    }

    #[test]
    fn fair_counts_pass_at_any_level_as_often_as_it_says_and_unfair_ones_do_not() {
        let mut random = SplitMix64::new(2);
        // Bins of unequal sizes, the smallest of which are pooled.
        let expected: Vec<f64> = (0..40).map(|i| 0.2 + f64::from(i * i)).collect();
        let total: f64 = expected.iter().sum();
        let mut below = [0; 3];
        let rounds = 400;
        for _ in 0..rounds {
            let mut observed = vec![0.0; expected.len()];
            for _ in 0..4000 {
                let mut left = random.next_unit() * total;
                let bin = expected.iter().position(|e| {
                    left -= e;
                    left < 0.0
                });
                observed[bin.unwrap_or(39)] += 1.0;
            }
            let test = chi_square(&observed, &expected, 5.0);
            for (count, level) in below.iter_mut().zip([0.1, 0.5, 0.9]) {
                *count += usize::from(test.p_value < level);
            }
            observed[30] += 130.0;
            assert!(chi_square(&observed, &expected, 5.0).p_value < 1e-3);
        }
        for (count, level) in below.iter().zip([0.1, 0.5, 0.9]) {
            let share = *count as f64 / f64::from(rounds);
            assert!(
                (share - level).abs() < 5.0 * f64::sqrt(level * (1.0 - level) / 400.0),
                "{level} {share}"
            );
        }
    }
}
