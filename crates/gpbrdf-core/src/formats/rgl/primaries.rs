//! Smooth spectra of linear sRGB colours.
//!
//! A colour `(r, g, b)` becomes `r s_r + g s_g + b s_b` with three fixed spectra: positive, as smooth as possible,
//! with the sum 1, so that white is the same at all wavelengths, and with the linear sRGB values (1, 0, 0), (0, 1, 0)
//! and (0, 0, 1) under D65. Spectra are linear in the colour, so interpolated spectra are those of interpolated
//! colours, and no energy is gained. Source: I. Mallett and C. Yuksel, "Spectral Primary Decomposition for Rendering
//! with sRGB Reflectance" (2019).
//!
//! The spectra minimise the sum of their squared slopes by the alternating direction method of multipliers (S. Boyd
//! et al., "Distributed Optimization and Statistical Learning via the Alternating Direction Method of Multipliers"
//! (2011), section 5.2): one step meets the equations, the other the bound.

use nalgebra::{DMatrix, DVector};

use crate::brdf::Rgb;
use crate::formats::measured::spectrum::SpectrumToRgb;

/// Number of wavelengths.
pub(super) const COUNT: usize = 19;
/// The first one, nm. Spectra are constant below it, where hardly anything is seen.
const FIRST_NM: f64 = 410.0;
/// Distance of neighbours, nm. Sums over steps of 5 nm, which other programs take, agree with those over 10 nm here to
/// 1e-3; with distances of 10 or 12.5 nm only to 3e-3.
const STEP_NM: f64 = 15.0;

/// Weight of the agreement of both steps, in units of a squared slope.
const PENALTY: f64 = 1.0;
/// Number of iterations: at the end both steps agree to 1e-10.
const ITERATIONS: usize = 2000;

/// The wavelengths, nm.
pub(super) fn wavelengths() -> [f64; COUNT] {
    std::array::from_fn(|k| FIRST_NM + STEP_NM * k as f64)
}

/// Red, green and blue of the spectra at each of the [`wavelengths`], in `[0, 1]`. Takes some milliseconds. `None`
/// if the equations have no solution.
pub(super) fn primaries() -> Option<[Rgb; COUNT]> {
    const UNKNOWNS: usize = 3 * COUNT;
    // The colours of red and green, and the sum at each wavelength. Those of blue follow.
    const EQUATIONS: usize = 6 + COUNT;
    let map = SpectrumToRgb::new(&wavelengths())?;
    let mut system = DMatrix::<f64>::zeros(UNKNOWNS + EQUATIONS, UNKNOWNS + EQUATIONS);
    let mut right = DVector::<f64>::zeros(UNKNOWNS + EQUATIONS);
    for c in 0..3 {
        for k in 0..COUNT {
            let at = c * COUNT + k;
            let neighbours = usize::from(k > 0) + usize::from(k + 1 < COUNT);
            system[(at, at)] = neighbours as f64 + PENALTY;
            if k + 1 < COUNT {
                system[(at, at + 1)] = -1.0;
                system[(at + 1, at)] = -1.0;
            }
        }
    }
    let mut equation = |row: usize, at: usize, factor: f64| {
        system[(UNKNOWNS + row, at)] = factor;
        system[(at, UNKNOWNS + row)] = factor;
    };
    for (k, weights) in map.weights().iter().enumerate() {
        for c in 0..2 {
            for (channel, weight) in weights.iter().enumerate() {
                equation(3 * c + channel, c * COUNT + k, *weight);
            }
        }
        (0..3).for_each(|c| equation(6 + k, c * COUNT + k, 1.0));
    }
    for c in 0..2 {
        right[UNKNOWNS + 4 * c] = 1.0;
    }
    (0..COUNT).for_each(|k| right[UNKNOWNS + 6 + k] = 1.0);

    let factor = system.lu();
    let mut bounded = vec![1.0 / 3.0; UNKNOWNS];
    let mut multipliers = vec![0.0; UNKNOWNS];
    for _ in 0..ITERATIONS {
        for k in 0..UNKNOWNS {
            right[k] = PENALTY * (bounded[k] - multipliers[k]);
        }
        let exact = factor.solve(&right)?;
        for k in 0..UNKNOWNS {
            let sum = exact[k] + multipliers[k];
            bounded[k] = sum.max(0.0);
            multipliers[k] = sum - bounded[k];
        }
    }
    Some(std::array::from_fn(|k| std::array::from_fn(|c| bounded[c * COUNT + k])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectra_are_positive_smooth_and_have_their_colours() {
        let spectra = primaries().unwrap();
        let map = SpectrumToRgb::new(&wavelengths()).unwrap();
        for c in 0..3 {
            let found = map.rgb(spectra.iter().map(|rgb| rgb[c]));
            for (channel, value) in found.iter().enumerate() {
                let expected = f64::from(u8::from(channel == c));
                assert!((value - expected).abs() < 1e-6, "{c}: {found:?}");
            }
        }
        for (rgb, nm) in spectra.iter().zip(wavelengths()) {
            assert!(rgb.iter().all(|x| (0.0..1.0 + 1e-6).contains(x)), "{nm}: {rgb:?}");
            assert!((rgb.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{nm}: {rgb:?}");
        }
        // The least sum of squared slopes, found by another program (SLSQP of SciPy).
        let slopes: f64 = spectra
            .windows(2)
            .map(|pair| (0..3).map(|c| (pair[1][c] - pair[0][c]).powi(2)).sum::<f64>())
            .sum();
        assert!((slopes - 1.172_666_75).abs() < 1e-6, "{slopes}");
    }
}
