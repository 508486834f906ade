//! Half precision as a storage format.

use ::half::f16;

/// The nearest number of half precision; beyond 65,504 in size, the largest finite one.
#[must_use]
pub fn to_half(x: f64) -> f16 {
    f16::from_f64(x.clamp(f16::MIN.to_f64(), f16::MAX.to_f64()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_to_eleven_bits_and_stays_finite() {
        for x in [0.0, 1.0, -3.3, 7.123_456, 1e-3, 9e9, -9e9] {
            let rounded = to_half(x).to_f64();
            assert!(rounded.is_finite() && to_half(rounded).to_f64() == rounded);
            assert!((rounded - x).abs() <= x.abs() / 2048.0 || x.abs() > 65_504.0, "{x} {rounded}");
        }
    }
}
