//! Half vectors in place of directions: a square in which the lobes of a material are smooth and stay where they are
//! while the view changes.

use crate::base::trigonometry::{acos, atan2_upper, sin_cos_upper};

/// The map between a unit square, taken twice, and all incident directions above the horizon, for one outgoing
/// direction.
///
/// A direction `wi` stands for its half vector `h` with the polar angle `theta_h` and the azimuth `p` against `wo`;
/// both sides of the plane of incidence, `p` and `-p`, share one square. With `z = 1 - cos theta_h`, the row
/// coordinate is `y = z / (1 - c z)` with `c = 1 / z_max - 1`, where `z_max` belongs to the largest `theta_h = pi/4 +
/// theta_o / 2` at which any `wi` is above the horizon. So `y` is nearly `z` in the lobe about the normal at every
/// view, and fills `[0, 1]`. The column coordinate is `b = |p| / p_max` in `[0, 1]`: `wi` is above the horizon while
/// `cos p > -cot theta_o cot 2 theta_h`, which gives `p_max` in closed form.
///
/// A density `rho` on the square means the density over solid angle
/// `rho / (2 p_max (dz/dy) 4 wo.h) = rho (1 + c y)^2 / (8 p_max wo.h)`: half of it on either side of the plane, a solid
/// angle `dz dp` of half vectors, and `4 wo.h` sr of incident directions for each sr of half vectors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfVectorSquare {
    /// Unit horizontal vector towards the viewer.
    toward: [f32; 2],
    sine: f32,
    cosine: f32,
    /// `cot theta_o`.
    cotangent: f32,
    /// `c`.
    squeeze: f32,
}

/// A point of the square with what turns its density into one over solid angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SquarePoint {
    /// `y`.
    pub(crate) row: f32,
    /// `b`.
    pub(crate) column: f32,
    /// sr^-1 for each unit of density on the square.
    pub(crate) per_steradian: f32,
}

/// Below this sine the viewer is at the normal, and its azimuth is taken as 0.
const MIN_SINE: f32 = 1e-6;

impl HalfVectorSquare {
    /// The map for the unit direction `wo` above the horizon.
    #[inline]
    pub(crate) fn new(wo: [f32; 3]) -> Self {
        let sine = (wo[0] * wo[0] + wo[1] * wo[1]).sqrt();
        let (toward, sine) =
            if sine > MIN_SINE { ([wo[0] / sine, wo[1] / sine], sine) } else { ([1.0, 0.0], MIN_SINE) };
        let cosine = wo[2];
        // cos(pi/4 + theta/2) = sqrt((1 - sin theta) / 2), without its cancellation.
        let top = cosine / (2.0 * (1.0 + sine)).sqrt();
        Self { toward, sine, cosine, cotangent: cosine / sine, squeeze: top / (1.0 - top) }
    }

    /// `p_max`, radians, at `z` and the sine of `theta_h`.
    #[inline(always)]
    fn half_range(&self, z: f32, sine_h: f32) -> f32 {
        let double_cosine = 1.0 - 2.0 * sine_h * sine_h;
        let double_sine = 2.0 * sine_h * (1.0 - z);
        let limit = -self.cotangent * double_cosine / double_sine.max(f32::MIN_POSITIVE);
        acos(limit.clamp(-1.0, 1.0))
    }

    /// sr^-1 for each unit of density on the square.
    #[inline(always)]
    fn per_steradian(&self, row: f32, half_range: f32, wo_dot_h: f32) -> f32 {
        let stretch = 1.0 + self.squeeze * row;
        // The bound keeps a quotient of two vanishing numbers finite.
        stretch * stretch / (8.0 * half_range * wo_dot_h).max(1e-30)
    }

    /// The direction at a point of the square, on the side of the plane of incidence that the sign of `side` says, and
    /// sr^-1 for each unit of density there. Rounding can leave it at or below the horizon.
    #[inline(always)]
    pub(crate) fn direction(&self, row: f32, column: f32, side: f32) -> ([f32; 3], f32) {
        let z = row / (1.0 + self.squeeze * row);
        let sine_h = (z * (2.0 - z)).sqrt();
        let cosine_h = 1.0 - z;
        let half_range = self.half_range(z, sine_h);
        let (sin_p, cos_p) = sin_cos_upper(column * half_range);
        let (along, across) = (sine_h * cos_p, side * (sine_h * sin_p));
        let wo_dot_h = self.sine * along + self.cosine * cosine_h;
        let x = 2.0 * wo_dot_h * along - self.sine;
        let y = 2.0 * wo_dot_h * across;
        let wi = [
            x * self.toward[0] - y * self.toward[1],
            x * self.toward[1] + y * self.toward[0],
            2.0 * wo_dot_h * cosine_h - self.cosine,
        ];
        (wi, self.per_steradian(row, half_range, wo_dot_h))
    }

    /// The point of the square that stands for a direction above the horizon: the inverse of
    /// [`HalfVectorSquare::direction`], for the same outgoing direction.
    #[inline(always)]
    pub(crate) fn point(&self, wi: [f32; 3], wo: [f32; 3]) -> SquarePoint {
        let sum = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
        let across2 = sum[0] * sum[0] + sum[1] * sum[1];
        let length = (across2 + sum[2] * sum[2]).sqrt();
        // 1 - cos theta_h without its cancellation.
        let z = across2 / (length * (length + sum[2]));
        let row = (z / (1.0 - self.squeeze * z).max(f32::MIN_POSITIVE)).min(1.0);
        let half_range = self.half_range(z, across2.sqrt() / length);
        let along = sum[0] * self.toward[0] + sum[1] * self.toward[1];
        let across = sum[1] * self.toward[0] - sum[0] * self.toward[1];
        let azimuth = atan2_upper(across.abs(), along);
        let column = if azimuth < half_range { azimuth / half_range } else { 1.0 };
        SquarePoint { row, column, per_steradian: self.per_steradian(row, half_range, 0.5 * length) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::quasi_random;
    use crate::brdf::direction;

    #[expect(clippy::cast_possible_truncation, reason = "single precision is what is tested")]
    fn view(degrees: f64, azimuth: f64) -> [f32; 3] {
        let wo = direction(degrees.to_radians(), azimuth);
        [wo.x as f32, wo.y as f32, wo.z as f32]
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "single precision is what is tested")]
    fn directions_round_trip_and_fill_the_hemisphere() {
        for degrees in [0.0, 1e-5, 3.0, 30.0, 60.0, 80.0, 88.0, 89.9] {
            let wo = view(degrees, 0.7);
            let square = HalfVectorSquare::new(wo);
            let mut solid_angle = 0.0;
            let count = 200_000;
            for i in 0..count {
                let [a, b, c] = quasi_random(i);
                // Rows crowd towards zero, as the nodes of densities do.
                let row = (a as f32).powi(4);
                let side = if c < 0.5 { -1.0 } else { 1.0 };
                let (wi, per_steradian) = square.direction(row, b as f32, side);
                let length = wi.iter().map(|x| x * x).sum::<f32>().sqrt();
                assert!((length - 1.0).abs() < 1e-5 && wi[2] > -1e-5, "{degrees} {row} {b} {wi:?}");
                solid_angle += 4.0 * a.powi(3) / f64::from(per_steradian);
                if wi[2] > 1e-4 && row > 1e-9 {
                    let back = square.point(wi, wo);
                    assert!((back.row / row - 1.0).abs() < 5e-3 + 1e-7 / row, "{degrees} {row} {b} {back:?}");
                }
            }
            // Half of the square belongs to either side, so the density 1 is 1 over the whole hemisphere.
            let found = solid_angle / f64::from(count as u32);
            assert!((found / std::f64::consts::TAU - 1.0).abs() < 2e-3, "{degrees}: {found}");
        }
    }

    #[test]
    fn columns_reach_the_horizon() {
        for degrees in [20.0, 50.0, 85.0] {
            let square = HalfVectorSquare::new(view(degrees, 0.0));
            let mut at_horizon = 0;
            for i in 1..1000 {
                let row = i as f32 / 1000.0;
                let (wi, _) = square.direction(row, 1.0, 1.0);
                let z = row / (1.0 + square.squeeze * row);
                let limit = (90.0 - degrees) / 2.0;
                if f64::from(1.0 - z).acos().to_degrees() > limit + 0.1 {
                    assert!(wi[2].abs() < 1e-5, "{degrees} {row} {wi:?}");
                    at_horizon += 1;
                }
            }
            assert!(at_horizon > 300, "{degrees} {at_horizon}");
        }
    }
}
