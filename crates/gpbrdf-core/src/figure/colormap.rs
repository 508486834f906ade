//! Two colour maps that people with colour blindness can read.

use crate::figure::picture::Rgb8;

/// A map from `[0, 1]` to colours, linear in sRGB between published colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colormap {
    /// Dark to bright, for magnitudes: viridis by S. van der Walt and N. Smith (2015, CC0), given at ninths.
    Sequential,
    /// Blue over pale yellow to red, for signed differences: "sunset" by P. Tol, "Colour Schemes", SRON
    /// technical note SRON/EPS/TN/09-002 (2021), given at tenths.
    Diverging,
}

const VIRIDIS: [u32; 10] = [
    0x44_01_54, 0x48_28_78, 0x3e_4a_89, 0x31_68_8e, 0x26_82_8e, 0x1f_9e_89, 0x35_b7_79, 0x6d_cd_59,
    0xb4_de_2c, 0xfd_e7_25,
];
const SUNSET: [u32; 11] = [
    0x36_4b_9a, 0x4a_7b_b7, 0x6e_a6_cd, 0x98_ca_e1, 0xc2_e4_ef, 0xea_ec_cc, 0xfe_da_8b, 0xfd_b3_66,
    0xf6_7e_4b, 0xdd_3d_2d, 0xa5_00_26,
];

impl Colormap {
    /// The colour at `t`, clamped to `[0, 1]`; grey for NaN.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "both are within range")]
    pub fn at(self, t: f64) -> Rgb8 {
        if t.is_nan() {
            return [128; 3];
        }
        let nodes: &[u32] = match self {
            Self::Sequential => &VIRIDIS,
            Self::Diverging => &SUNSET,
        };
        let x = t.clamp(0.0, 1.0) * (nodes.len() - 1) as f64;
        let low = (x as usize).min(nodes.len() - 2);
        let [_, a @ ..] = nodes[low].to_be_bytes();
        let [_, b @ ..] = nodes[low + 1].to_be_bytes();
        let weight = x - low as f64;
        std::array::from_fn(|c| {
            let mixed = f64::from(a[c]) * (1.0 - weight) + f64::from(b[c]) * weight;
            (mixed + 0.5) as u8
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_ends_and_middles_are_the_published_colours() {
        assert_eq!(Colormap::Sequential.at(-1.0), [0x44, 0x01, 0x54]);
        assert_eq!(Colormap::Sequential.at(2.0), [0xfd, 0xe7, 0x25]);
        assert_eq!(Colormap::Diverging.at(0.5), [0xea, 0xec, 0xcc]);
        assert_eq!(Colormap::Diverging.at(0.05), [0x40, 0x63, 0xa9]);
        assert_eq!(Colormap::Diverging.at(f64::NAN), [128; 3]);
    }

    #[test]
    fn lightness_rises_or_peaks_in_the_middle() {
        let luma = |c: Rgb8| 0.299 * f64::from(c[0]) + 0.587 * f64::from(c[1]) + 0.114 * f64::from(c[2]);
        for i in 0..100 {
            let (t, next) = (f64::from(i) / 100.0, f64::from(i + 1) / 100.0);
            assert!(luma(Colormap::Sequential.at(next)) > luma(Colormap::Sequential.at(t)) - 0.5);
            let rises = luma(Colormap::Diverging.at(next)) - luma(Colormap::Diverging.at(t));
            assert!(if i < 50 { rises > -0.5 } else { rises < 0.5 }, "{t} {rises}");
        }
    }
}
