//! Loops over slices in the widest vector instructions that the processor has, chosen at run time.
//!
//! No fused multiply-add is used, so the results are the same on every processor.

use pulp::Arch;

/// Runs `op` compiled for the best instruction set that the processor has. Only code that is inlined into
/// `op` becomes faster.
#[inline]
pub(crate) fn vectorized<R>(op: impl FnOnce() -> R) -> R {
    Arch::new().dispatch(op)
}

/// 1.5 * 2^52: adding it rounds a number to an integer, which is then found in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// `ln 2` in two parts. The high part has 32 trailing zero bits, so that `n * LN_2_HIGH` is exact.
const LN_2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// `2^n` for an integer `n` in -1022..=1023.
#[inline(always)]
fn exp2_integer(n: f64) -> f64 {
    f64::from_bits((n + (ROUND + 1023.0)).to_bits() << 52)
}

/// `exp(x)` without a branch, within 2 units in the last place; 0 below -745.14, infinite above 709.79, NaN
/// for NaN.
///
/// Method: `x = n ln 2 + r` with `|r| <= ln(2) / 2`, a Taylor polynomial of degree 13 in `r`, and a scaling
/// by `2^n` in two steps, so that results below the normal range are rounded only once.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    let x = if x < -746.0 { -746.0 } else { x };
    let x = if x > 710.0 { 710.0 } else { x };
    let n = (x * std::f64::consts::LOG2_E + ROUND) - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let mut p = 1.0 / 6_227_020_800.0;
    p = p * r + 1.0 / 479_001_600.0;
    p = p * r + 1.0 / 39_916_800.0;
    p = p * r + 1.0 / 3_628_800.0;
    p = p * r + 1.0 / 362_880.0;
    p = p * r + 1.0 / 40_320.0;
    p = p * r + 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    let e = 1.0 + (r + r * r * p);
    let half = (0.5 * n + ROUND) - ROUND;
    e * exp2_integer(half) * exp2_integer(n - half)
}

/// Replaces every element by its exponential, to the accuracy of [`exp`].
pub(crate) fn exp_slice(x: &mut [f64]) {
    vectorized(|| {
        for v in x.iter_mut() {
            *v = exp(*v);
        }
    });
}

/// Number of partial sums of a reduction. They run side by side, in an order that does not depend on the
/// processor.
const LANES: usize = 8;

/// `sum_i a_i b_i` over slices of the same length.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let lanes = vectorized(|| {
        let mut lanes = [0.0; LANES];
        for (a, b) in a_chunks.iter().zip(b_chunks) {
            for l in 0..LANES {
                lanes[l] += a[l] * b[l];
            }
        }
        lanes
    });
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f64>() + rest
}

/// `sum_i a_i b_i c_i` over slices of the same length.
#[cfg(feature = "fit")]
pub(crate) fn dot3(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let (c_chunks, c_rest) = c.as_chunks::<LANES>();
    let lanes = vectorized(|| {
        let mut lanes = [0.0; LANES];
        for ((a, b), c) in a_chunks.iter().zip(b_chunks).zip(c_chunks) {
            for l in 0..LANES {
                lanes[l] += a[l] * b[l] * c[l];
            }
        }
        lanes
    });
    let rest: f64 = a_rest.iter().zip(b_rest).zip(c_rest).map(|((a, b), c)| a * b * c).sum();
    lanes.iter().sum::<f64>() + rest
}

/// `out_i += a x_i`.
pub(crate) fn add_scaled(a: f64, x: &[f64], out: &mut [f64]) {
    vectorized(|| {
        for (o, x) in out.iter_mut().zip(x) {
            *o += a * x;
        }
    });
}

/// `x_i = a x_i`.
pub(crate) fn scale_in_place(a: f64, x: &mut [f64]) {
    vectorized(|| {
        for x in x.iter_mut() {
            *x *= a;
        }
    });
}

/// `out_i = a x_i`.
pub(crate) fn scale_into(a: f64, x: &[f64], out: &mut [f64]) {
    vectorized(|| {
        for (o, x) in out.iter_mut().zip(x) {
            *o = a * x;
        }
    });
}

/// `out_i *= x_i`.
pub(crate) fn multiply(x: &[f64], out: &mut [f64]) {
    vectorized(|| {
        for (o, x) in out.iter_mut().zip(x) {
            *o *= x;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_slice_is_within_two_units_in_the_last_place() {
        let inputs: Vec<f64> = (0..=400_000).map(|i| -708.0 + 1417.0 * f64::from(i) / 400_000.0).collect();
        let near_zero = (-60..=0).flat_map(|e| [2f64.powi(e), -2f64.powi(e), 0.7 * 2f64.powi(e)]);
        let inputs: Vec<f64> = inputs.into_iter().chain(near_zero).collect();
        let mut values = inputs.clone();
        exp_slice(&mut values);
        for (x, value) in inputs.iter().zip(values) {
            let ulps = value.to_bits().abs_diff(x.exp().to_bits());
            assert!(ulps <= 2, "exp({x}): {value:e}, {ulps} units in the last place");
        }
    }

    #[test]
    fn exp_slice_at_the_ends_of_the_range() {
        let inputs =
            [0.0, -0.0, f64::NEG_INFINITY, -1e300, -746.0, -745.2, 709.78, 709.79, 1e300, f64::INFINITY];
        let mut values = inputs;
        exp_slice(&mut values);
        assert_eq!(values[..2], [1.0, 1.0]);
        assert_eq!(values[2..6], [0.0; 4]);
        assert!((values[6] / 709.78f64.exp() - 1.0).abs() < 1e-15);
        assert_eq!(values[7..], [f64::INFINITY; 3]);
        for x in [-745.0f64, -740.0, -720.0, -709.0] {
            let mut value = [x];
            exp_slice(&mut value);
            assert!(value[0].to_bits().abs_diff(x.exp().to_bits()) <= 2, "{x}: {:e} {:e}", value[0], x.exp());
        }
        let mut nan = [f64::NAN];
        exp_slice(&mut nan);
        assert!(nan[0].is_nan());
    }

    #[test]
    fn dot_products_match_plain_sums() {
        for n in [0u32, 1, 7, 8, 9, 61] {
            let a: Vec<f64> = (0..n).map(|i| f64::from(i) - 3.0).collect();
            let b: Vec<f64> = (0..n).map(|i| f64::from(i * i) + 1.0).collect();
            let plain: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert_eq!(dot(&a, &b), plain);
            #[cfg(feature = "fit")]
            assert_eq!(dot3(&a, &a, &b), a.iter().zip(&b).map(|(a, b)| a * a * b).sum::<f64>());
        }
    }
}
