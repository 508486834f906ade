//! Conversion of spectra to linear sRGB.
//!
//! The CIE 1931 2-degree observer and illuminant D65 are tabulated at 380 to 780 nm in steps of 10 nm (CIE
//! 15:2004, tables T.1 and T.4): `X = X_n sum f S x_bar / sum S x_bar`, and the same for `Y` and `Z`, with
//! the white point `X_n = 0.95047`, `Y_n = 1`, `Z_n = 1.08883`. The matrix of IEC 61966-2-1 gives sRGB. A
//! perfect reflector becomes (1, 1, 1).

use crate::brdf::Rgb;

/// First wavelength of [`OBSERVER_D65`], nm.
const FIRST_NM: f64 = 380.0;
/// Spacing of [`OBSERVER_D65`], nm.
const STEP_NM: f64 = 10.0;

/// `x_bar, y_bar, z_bar` and the relative power of D65 at 380, 390, ..., 780 nm.
#[rustfmt::skip]
const OBSERVER_D65: [[f64; 4]; 41] = [
    [0.001368, 0.000039, 0.006450, 49.9755],
    [0.004243, 0.000120, 0.020050, 54.6482],
    [0.014310, 0.000396, 0.067850, 82.7549],
    [0.043510, 0.001210, 0.207400, 91.4860],
    [0.134380, 0.004000, 0.645600, 93.4318],
    [0.283900, 0.011600, 1.385600, 86.6823],
    [0.348280, 0.023000, 1.747060, 104.865],
    [0.336200, 0.038000, 1.772110, 117.008],
    [0.290800, 0.060000, 1.669200, 117.812],
    [0.195360, 0.090980, 1.287640, 114.861],
    [0.095640, 0.139020, 0.812950, 115.923],
    [0.032010, 0.208020, 0.465180, 108.811],
    [0.004900, 0.323000, 0.272000, 109.354],
    [0.009300, 0.503000, 0.158200, 107.802],
    [0.063270, 0.710000, 0.078250, 104.790],
    [0.165500, 0.862000, 0.042160, 107.689],
    [0.290400, 0.954000, 0.020300, 104.405],
    [0.433450, 0.994950, 0.008750, 104.046],
    [0.594500, 0.995000, 0.003900, 100.000],
    [0.762100, 0.952000, 0.002100, 96.3342],
    [0.916300, 0.870000, 0.001650, 95.7880],
    [1.026300, 0.757000, 0.001100, 88.6856],
    [1.062200, 0.631000, 0.000800, 90.0062],
    [1.002600, 0.503000, 0.000340, 89.5991],
    [0.854450, 0.381000, 0.000190, 87.6987],
    [0.642400, 0.265000, 0.000050, 83.2886],
    [0.447900, 0.175000, 0.000020, 83.6992],
    [0.283500, 0.107000, 0.000000, 80.0268],
    [0.164900, 0.061000, 0.000000, 80.2146],
    [0.087400, 0.032000, 0.000000, 82.2778],
    [0.046770, 0.017000, 0.000000, 78.2842],
    [0.022700, 0.008210, 0.000000, 69.7213],
    [0.011359, 0.004102, 0.000000, 71.6091],
    [0.005790, 0.002091, 0.000000, 74.3490],
    [0.002899, 0.001047, 0.000000, 61.6040],
    [0.001440, 0.000520, 0.000000, 69.8856],
    [0.000690, 0.000249, 0.000000, 75.0870],
    [0.000332, 0.000120, 0.000000, 63.5927],
    [0.000166, 0.000060, 0.000000, 46.4182],
    [0.000083, 0.000030, 0.000000, 66.8054],
    [0.000042, 0.000015, 0.000000, 63.3828],
];

/// XYZ of D65 (ASTM E308). Sums over steps of 10 nm meet it only to 1e-3.
const WHITE: [f64; 3] = [0.950_47, 1.0, 1.088_83];

/// The matrix from XYZ to linear sRGB (IEC 61966-2-1).
pub(crate) const SRGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// The inverse of [`SRGB_FROM_XYZ`].
const XYZ_FROM_SRGB: [[f64; 3]; 3] = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9, 0.119_192_0, 0.950_304_1],
];

/// The linear map from spectra at given wavelengths to linear sRGB.
#[derive(Clone, Debug)]
pub(crate) struct SpectrumToRgb {
    /// One weight per wavelength and channel.
    weights: Vec<Rgb>,
}

impl SpectrumToRgb {
    /// The map for spectra at `wavelengths`, nm. Spectra are linear between them and constant beyond them.
    /// `None` unless the wavelengths increase, are finite and reach into the range of 380 to 780 nm.
    pub(crate) fn new(wavelengths: &[f64]) -> Option<Self> {
        let (&first, &last) = (wavelengths.first()?, wavelengths.last()?);
        let increasing = wavelengths.windows(2).all(|pair| pair[0] < pair[1]);
        if !increasing || !first.is_finite() || !last.is_finite() || first > 780.0 || last < FIRST_NM {
            return None;
        }
        let scale: [f64; 3] =
            std::array::from_fn(|k| WHITE[k] / OBSERVER_D65.iter().map(|row| row[k] * row[3]).sum::<f64>());
        let mut weights = vec![[0.0; 3]; wavelengths.len()];
        for (index, [x, y, z, power]) in OBSERVER_D65.into_iter().enumerate() {
            let nm = FIRST_NM + STEP_NM * index as f64;
            let xyz = [x * power * scale[0], y * power * scale[1], z * power * scale[2]];
            let rgb = SRGB_FROM_XYZ.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]);
            let high = wavelengths.partition_point(|&w| w <= nm).min(wavelengths.len() - 1);
            let low = high.saturating_sub(1);
            let span = wavelengths[high] - wavelengths[low];
            let part = if span > 0.0 { ((nm - wavelengths[low]) / span).clamp(0.0, 1.0) } else { 0.0 };
            for c in 0..3 {
                weights[low][c] += (1.0 - part) * rgb[c];
                weights[high][c] += part * rgb[c];
            }
        }
        Some(Self { weights })
    }

    /// What a spectrum that is 1 at one of the wavelengths and 0 at the others adds to each channel.
    pub(crate) fn weights(&self) -> &[Rgb] {
        &self.weights
    }

    /// Linear sRGB of one spectrum; out-of-gamut (negative) channels are set to 0.
    pub(crate) fn rgb(&self, spectrum: impl IntoIterator<Item = f64>) -> Rgb {
        let mut sum = [0.0; 3];
        for (value, weights) in spectrum.into_iter().zip(&self.weights) {
            for c in 0..3 {
                sum[c] += value * weights[c];
            }
        }
        sum.map(|channel: f64| channel.max(0.0))
    }

    /// The standard deviation of each channel for independent ones of the wavelengths.
    pub(crate) fn sigma(&self, sigma: impl IntoIterator<Item = f64>) -> Rgb {
        let mut sum = [0.0; 3];
        for (sigma, weights) in sigma.into_iter().zip(&self.weights) {
            for c in 0..3 {
                sum[c] += (sigma * weights[c]).powi(2);
            }
        }
        sum.map(f64::sqrt)
    }
}

/// What is worth knowing about a conversion from `wavelengths`, nm: where it relies on values that were not
/// measured.
pub(crate) fn sparse(wavelengths: &[f64]) -> Option<String> {
    let (first, last) = (wavelengths.first()?, wavelengths.last()?);
    let gap = wavelengths.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    (gap > MOST_GAP_NM || *first > LEAST_FIRST_NM || *last < MOST_LAST_NM).then(|| {
        format!(
            "colours are made of {} wavelengths from {first} to {last} nm, between which values are linear and \
             beyond which they are constant",
            wavelengths.len()
        )
    })
}

/// Spectra are said to be sparse if neighbours are further apart, nm.
const MOST_GAP_NM: f64 = 30.0;
/// Or if they start later, nm: below, the observer sees less than 1 %.
const LEAST_FIRST_NM: f64 = 430.0;
/// Or if they end earlier, nm.
const MOST_LAST_NM: f64 = 650.0;

/// Linear sRGB of CIE XYZ of which a perfect diffuser has the luminance `Y = 1` and the white of D65;
/// out-of-gamut (negative) channels are set to 0.
pub(crate) fn srgb_from_xyz([x, y, z]: [f64; 3]) -> Rgb {
    SRGB_FROM_XYZ.map(|row| (row[0] * x + row[1] * y + row[2] * z).max(0.0))
}

/// The inverse of [`srgb_from_xyz`] within the gamut.
pub(crate) fn xyz_from_srgb([r, g, b]: Rgb) -> [f64; 3] {
    XYZ_FROM_SRGB.map(|row| row[0] * r + row[1] * g + row[2] * b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mistyped numbers would be found here.
    #[test]
    fn tables_have_the_published_sums() {
        let sum = |f: &dyn Fn(&[f64; 4]) -> f64| OBSERVER_D65.iter().map(f).sum::<f64>();
        // The equal-energy spectrum is white: (1/3, 1/3).
        let (x, y, z) = (sum(&|r| r[0]), sum(&|r| r[1]), sum(&|r| r[2]));
        assert!((x / y - 1.0).abs() < 1e-3 && (z / y - 1.0).abs() < 1e-3, "{x} {y} {z}");
        // Each function's integral is 106.857 (CIE 15).
        assert!((STEP_NM * y - 106.857).abs() < 0.05, "{y}");
        // The white point of D65: 95.047, 100, 108.883.
        let (x, y, z) = (sum(&|r| r[0] * r[3]), sum(&|r| r[1] * r[3]), sum(&|r| r[2] * r[3]));
        assert!((x / y - 0.950_47).abs() < 4e-4 && (z / y - 1.088_83).abs() < 8e-4, "{} {}", x / y, z / y);
        // All but D65 is smooth: no digit of the observer is mistyped.
        for k in 0..3 {
            for five in OBSERVER_D65.windows(5) {
                let fourth = five[0][k] - 4.0 * five[1][k] + 6.0 * five[2][k] - 4.0 * five[3][k] + five[4][k];
                assert!(fourth.abs() < 0.75, "{k} {five:?} {fourth}");
            }
        }
    }

    #[test]
    fn a_perfect_reflector_is_white_on_any_grid() {
        let grids: [Vec<f64>; 4] = [
            (0..31).map(|k| 400.0 + 10.0 * f64::from(k)).collect(),
            (0..81).map(|k| 380.0 + 5.0 * f64::from(k)).collect(),
            vec![500.0],
            vec![300.0, 555.5, 900.0],
        ];
        for grid in grids {
            let map = SpectrumToRgb::new(&grid).unwrap();
            for channel in map.rgb(grid.iter().map(|_| 1.0)) {
                assert!((channel - 1.0).abs() < 1e-6, "{channel}");
            }
        }
    }

    #[test]
    fn matrices_are_inverse_to_each_other() {
        let colour = [0.3, 0.7, 0.1];
        let again = srgb_from_xyz(xyz_from_srgb(colour));
        (0..3).for_each(|c| assert!((again[c] - colour[c]).abs() < 1e-6, "{again:?}"));
        assert_eq!(srgb_from_xyz([0.0, 1.0, 0.0])[0], 0.0);
        let white = srgb_from_xyz(WHITE);
        white.iter().for_each(|x| assert!((x - 1.0).abs() < 1e-4, "{white:?}"));
    }

    #[test]
    fn sparse_spectra_are_said() {
        let grid: Vec<f64> = (0..31).map(|k| 400.0 + 10.0 * f64::from(k)).collect();
        assert_eq!(sparse(&grid), None);
        assert!(sparse(&[450.0, 550.0, 650.0]).unwrap().contains("3 wavelengths from 450 to 650 nm"));
        let map = SpectrumToRgb::new(&grid).unwrap();
        let one = map.sigma(grid.iter().map(|&w| f64::from(w == 550.0)));
        let as_value = map.rgb(grid.iter().map(|&w| f64::from(w == 550.0)));
        assert!((one[1] - as_value[1]).abs() < 1e-12);
    }

    #[test]
    fn bands_have_their_colours_and_bad_grids_are_refused() {
        let grid: Vec<f64> = (0..31).map(|k| 400.0 + 10.0 * f64::from(k)).collect();
        let map = SpectrumToRgb::new(&grid).unwrap();
        let band = |from: f64, to: f64| map.rgb(grid.iter().map(|&w| f64::from((from..to).contains(&w))));
        let (red, green, blue) = (band(610.0, 701.0), band(510.0, 560.0), band(400.0, 480.0));
        assert!(red[0] > 5.0 * red[1] && red[0] > 5.0 * red[2], "{red:?}");
        assert!(green[1] > 5.0 * green[0] && green[1] > 3.0 * green[2], "{green:?}");
        assert!(blue[2] > 5.0 * blue[0] && blue[2] > 5.0 * blue[1], "{blue:?}");
        let bad: [&[f64]; 5] =
            [&[], &[500.0, 500.0], &[800.0, 900.0], &[400.0, f64::NAN], &[f64::NEG_INFINITY, 500.0]];
        for grid in bad {
            assert!(SpectrumToRgb::new(grid).is_none(), "{grid:?}");
        }
    }
}
