//! Directions about the specular direction.

use nalgebra::Vector3;

/// The frame in which scattered directions are given, for light in the plane of x and z.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// To the light.
    pub(super) wi: Vector3<f64>,
    /// The specular direction.
    specular: Vector3<f64>,
    /// From the specular direction towards the normal.
    up: Vector3<f64>,
}

impl Frame {
    /// For an angle of incidence in radians.
    pub(super) fn new(theta: f64) -> Self {
        let (s, c) = theta.sin_cos();
        Self { wi: Vector3::new(s, 0.0, c), specular: Vector3::new(-s, 0.0, c), up: Vector3::new(c, 0.0, s) }
    }

    /// The direction at a radial and an azimuthal angle, in radians: `cos r s + sin r (cos a u + sin a s x u)`.
    pub(super) fn direction(&self, radial: f64, azimuth: f64) -> Vector3<f64> {
        let (sr, cr) = radial.sin_cos();
        let (sa, ca) = azimuth.sin_cos();
        cr * self.specular + sr * (ca * self.up + sa * Vector3::y())
    }

    /// The radial and the azimuthal angle of a direction, in radians; the latter from `-pi` to `pi`.
    pub(super) fn angles(&self, direction: &Vector3<f64>) -> (f64, f64) {
        let radial = self.specular.cross(direction).norm().atan2(self.specular.dot(direction));
        (radial, direction.y.atan2(self.up.dot(direction)))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::brdf::angles::direction;

    #[test]
    fn angles_are_about_the_specular_direction() {
        let frame = Frame::new(0.3);
        let near = |a: Vector3<f64>, b: Vector3<f64>| assert!((a - b).norm() < 1e-15, "{a} {b}");
        near(frame.wi, direction(0.3, 0.0));
        near(frame.direction(0.0, 1.0), direction(0.3, PI));
        near(frame.direction(0.3, 0.0), Vector3::z());
        near(frame.direction(0.6, 0.0), frame.wi);
        near(frame.direction(0.2, PI), direction(0.5, PI));
        near(frame.direction(FRAC_PI_2, FRAC_PI_2), Vector3::y());
        for (radial, azimuth) in [(0.4, 1.0), (1.2, -2.0)] {
            let (r, a) = frame.angles(&frame.direction(radial, azimuth));
            assert!((r - radial).abs() < 1e-14 && (a - azimuth).abs() < 1e-14);
        }
    }
}
