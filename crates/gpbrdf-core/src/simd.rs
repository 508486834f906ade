//! Elementary functions over slices, vectorised for the processor at hand.

/// Replaces every element by its exponential.
///
/// Cody-Waite reduction by `ln 2` in two parts and the Taylor polynomial of degree 13 on
/// `[-ln 2 / 2, ln 2 / 2]`: within 2 units in the last place from -708 to 709, zero below, infinity above.
pub(crate) fn exp_slice(x: &mut [f64]) {
    pulp::Arch::new().dispatch(|| {
        for x in x {
            *x = exp(*x);
        }
    });
}

/// Branch-free, so that a loop of it vectorises.
#[inline(always)]
fn exp(x: f64) -> f64 {
    const LN2_HIGH: f64 = f64::from_bits(0x3FE6_2E42_FEE0_0000);
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    // Adding this rounds to an integer and leaves it in the low bits.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    let clamped = x.clamp(-745.0, 710.0);
    let shifted = clamped * std::f64::consts::LOG2_E + SHIFT;
    let n = shifted - SHIFT;
    let r = (clamped - n * LN2_HIGH) - n * LN2_LOW;
    let mut p = 1.0 / 6_227_020_800.0;
    for c in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        p = p * r + c;
    }
    let value = p * f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    let value = if x < -708.0 { 0.0 } else { value };
    if x > 709.0 { f64::INFINITY } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_agrees_with_the_standard_library() {
        let x: Vec<f64> = (0..2_000_000).map(|i| -707.9 + f64::from(i) * 7.084e-4).collect();
        let mut y = x.clone();
        exp_slice(&mut y);
        for (x, y) in x.iter().zip(&y) {
            assert!((y / x.exp() - 1.0).abs() < 4.5e-16, "{x} {y} {}", x.exp());
        }
        let mut ends = [f64::NEG_INFINITY, -1e300, -709.0, -0.0, 0.0, 1e-300, 709.5, f64::INFINITY, f64::NAN];
        exp_slice(&mut ends);
        assert_eq!(ends[..8], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, f64::INFINITY, f64::INFINITY]);
        assert!(ends[8].is_nan());
    }
}
