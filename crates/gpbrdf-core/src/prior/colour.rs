//! Colours in which the channels of reflectances vary almost independently.

/// A kind of colour of the logarithms `(r, g, b)` of three channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Colour {
    /// `(r + g + b) / sqrt(3)`: how bright.
    Achromatic = 0,
    /// `(r - b) / sqrt(2)` and `(r - 2 g + b) / sqrt(6)`: which colour.
    Chromatic = 1,
}

impl Colour {
    /// Both kinds.
    pub const ALL: [Self; 2] = [Self::Achromatic, Self::Chromatic];

    /// Which of the three colours are of this kind, the achromatic one being the first.
    #[must_use]
    pub fn rows(self) -> std::ops::Range<usize> {
        match self {
            Self::Achromatic => 0..1,
            Self::Chromatic => 1..3,
        }
    }
}

/// The orthonormal rotation from the logarithms of the channels: the achromatic colour, then both chromatic ones.
#[rustfmt::skip]
pub(crate) const OPPONENT: [[f64; 3]; 3] = [
    [0.577_350_269_189_625_8, 0.577_350_269_189_625_8, 0.577_350_269_189_625_8],
    [std::f64::consts::FRAC_1_SQRT_2, 0.0, -std::f64::consts::FRAC_1_SQRT_2],
    [0.408_248_290_463_863_1, -0.816_496_580_927_726_1, 0.408_248_290_463_863_1],
];

/// The three colours of the logarithms of three channels.
#[cfg(any(feature = "fit", test))]
pub(crate) fn to_opponent(channels: [f64; 3]) -> [f64; 3] {
    OPPONENT.map(|row| row.iter().zip(channels).map(|(m, x)| m * x).sum())
}

/// The inverse of [`to_opponent`].
pub(crate) fn from_opponent(colours: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| OPPONENT.iter().zip(colours).map(|(row, x)| row[c] * x).sum())
}

/// The variance of any channel from those of the achromatic and of each chromatic colour, which are independent: every
/// column of [`OPPONENT`] has the squares `1/3` and, together, `2/3`.
pub(crate) fn variance_of_channels(achromatic: f64, chromatic: f64) -> f64 {
    (achromatic + 2.0 * chromatic) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotation_is_orthonormal() {
        for (i, a) in OPPONENT.iter().enumerate() {
            for (j, b) in OPPONENT.iter().enumerate() {
                let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-15, "{i} {j} {dot}");
            }
        }
        let x = [0.3, -1.7, 2.2];
        assert!(from_opponent(to_opponent(x)).iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-15));
        for c in 0..3 {
            let [a, b, d] = OPPONENT.map(|row| row[c] * row[c]);
            assert!((variance_of_channels(0.3, 0.7) - (a * 0.3 + (b + d) * 0.7)).abs() < 1e-15);
        }
    }
}
