//! Cameras.

use glam::camera::rh::{proj::directx, view};
use glam::{Mat3, Mat4, Vec3};

use crate::error::{Error, Result};

/// How a camera maps space to its frame. Extents are those of the shorter side of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Parallel rays.
    Orthographic {
        /// Half of the shorter side, in units of the world.
        half_extent: f32,
    },
    /// Rays out of the eye.
    Perspective {
        /// Angle of view across the shorter side, radians, in `(0, pi)`.
        fov: f32,
    },
}

/// A camera: right-handed, `+y` up; in view space it looks along `-z`.
///
/// Objects are in the unit sphere about the origin of the world. The default is orthographic, from `+z`, with
/// a half extent of 1: a unit sphere touches the frame, as in the pictures of the image metrics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the eye. With parallel rays, only its direction from the target matters.
    pub eye: Vec3,
    /// The point in the middle of the picture.
    pub target: Vec3,
    /// The direction that points up in the picture, roughly.
    pub up: Vec3,
    /// Projection.
    pub projection: Projection,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            eye: Vec3::new(0.0, 0.0, 4.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::Orthographic { half_extent: 1.0 },
        }
    }
}

/// The elevation that [`Camera::orbited`] keeps within, radians: just under 90 degrees.
const MAX_ELEVATION: f32 = 1.55;

impl Camera {
    /// A perspective camera on `+z` that sees the unit sphere with a margin: the outline of the sphere takes
    /// up the share `fill` of the shorter side. `fov` is in radians.
    #[must_use]
    pub fn perspective(fov: f32, fill: f32) -> Self {
        // The outline of the sphere at distance d is seen at asin(1 / d).
        let outline = ((0.5 * fov).tan() * fill).atan();
        let eye = Vec3::new(0.0, 0.0, 1.0 / outline.sin());
        Self { eye, projection: Projection::Perspective { fov }, ..Self::default() }
    }

    /// The camera turned about its target by angles in radians: to the right by a positive azimuth, up by a
    /// positive elevation. It stops short of the poles.
    #[must_use]
    pub fn orbited(self, azimuth: f32, elevation: f32) -> Self {
        let arm = self.eye - self.target;
        let length = arm.length();
        let now = (arm.y / length).clamp(-1.0, 1.0).asin();
        let heading = arm.x.atan2(arm.z) + azimuth;
        let height = (now + elevation).clamp(-MAX_ELEVATION, MAX_ELEVATION);
        let direction = Vec3::new(heading.sin() * height.cos(), height.sin(), heading.cos() * height.cos());
        Self { eye: self.target + length * direction, ..self }
    }

    /// The camera nearer, or with a smaller extent, so that objects in the middle of the picture are `factor`
    /// times as large.
    #[must_use]
    pub fn zoomed(self, factor: f32) -> Self {
        match self.projection {
            Projection::Orthographic { half_extent } => {
                Self { projection: Projection::Orthographic { half_extent: half_extent / factor }, ..self }
            }
            Projection::Perspective { .. } => {
                Self { eye: self.target + (self.eye - self.target) / factor, ..self }
            }
        }
    }

    /// The camera moved sideways: the target moves to the right and up by these shares of the shorter side.
    #[must_use]
    pub fn panned(self, right: f32, up: f32) -> Self {
        let side = 2.0
            * match self.projection {
                Projection::Orthographic { half_extent } => half_extent,
                Projection::Perspective { fov } => (0.5 * fov).tan() * self.eye.distance(self.target),
            };
        let axes = self.world_from_view();
        let step = side * (right * axes.x_axis + up * axes.y_axis);
        Self { eye: self.eye + step, target: self.target + step, ..self }
    }

    /// Checks that the camera can take a picture.
    ///
    /// # Errors
    /// [`gpbrdf_core::Error::InvalidArgument`] when a number is not finite, the eye is at the target, or an
    /// extent or angle is outside of its domain.
    pub fn check(&self) -> Result<()> {
        let wrong = |expected: &str, found: String| Err(Error::argument("camera", expected, found));
        if !(self.eye.is_finite() && self.target.is_finite() && self.up.is_finite()) {
            return wrong("finite vectors", format!("{self:?}"));
        }
        if !(self.eye.distance(self.target) > 1e-6 && self.eye.distance(self.target) < 1e6) {
            return wrong("the eye 1e-6 to 1e6 from the target", self.eye.distance(self.target).to_string());
        }
        match self.projection {
            Projection::Orthographic { half_extent } if !(half_extent > 1e-6 && half_extent < 1e6) => {
                wrong("a half extent of 1e-6 to 1e6", half_extent.to_string())
            }
            Projection::Perspective { fov } if !(fov > 1e-4 && fov < 3.1) => {
                wrong("an angle of view of 1e-4 to 3.1 radians", fov.to_string())
            }
            _ => Ok(()),
        }
    }

    /// The axes of view space in the world: right, up and backwards.
    #[must_use]
    pub fn world_from_view(&self) -> Mat3 {
        let back = (self.eye - self.target).try_normalize().unwrap_or(Vec3::Z);
        // Looking straight up or down, any other direction is as good.
        let sideways = self.up.cross(back).try_normalize();
        let right = sideways.unwrap_or_else(|| back.any_orthonormal_vector());
        Mat3::from_cols(right, back.cross(right), back)
    }

    /// Half of the frame along x and y: in units of the world, or at distance 1 from the eye. `aspect` is
    /// width / height.
    #[must_use]
    pub fn half_extents(&self, aspect: f32) -> (f32, f32) {
        let half = match self.projection {
            Projection::Orthographic { half_extent } => half_extent,
            Projection::Perspective { fov } => (0.5 * fov).tan(),
        };
        (half * aspect.max(1.0), half * (1.0 / aspect).max(1.0))
    }

    /// World to clip space, depth 0 at the near side of the unit sphere about the origin and 1 at its far
    /// side.
    #[must_use]
    pub fn clip_from_world(&self, aspect: f32) -> Mat4 {
        let axes = self.world_from_view();
        let view_from_world = view::look_to_mat4(self.eye, -axes.z_axis, axes.y_axis);
        let middle = self.eye.dot(axes.z_axis);
        let (x, y) = self.half_extents(aspect);
        let clip_from_view = match self.projection {
            Projection::Orthographic { .. } => {
                directx::orthographic(-x, x, -y, y, middle - 1.05, middle + 1.05)
            }
            Projection::Perspective { .. } => {
                let near = (middle - 1.05).max(0.005);
                let far = (middle + 1.05).max(near + 1.0);
                directx::frustum(-x * near, x * near, -y * near, y * near, near, far)
            }
        };
        clip_from_view * view_from_world
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_camera_of_the_image_metrics() {
        let clip = Camera::default().clip_from_world(1.0);
        for p in [Vec3::new(0.3, -0.7, 0.5), Vec3::new(-1.0, 1.0, -1.0), Vec3::Z] {
            let found = clip.project_point3(p);
            assert!((found.truncate() - p.truncate()).length() < 1e-6, "{found}");
            assert!((0.0..=1.0).contains(&found.z));
        }
        assert_eq!(Camera::default().world_from_view(), Mat3::IDENTITY);
    }

    #[test]
    fn a_perspective_camera_sees_the_outline_at_its_share_of_the_frame() {
        let camera = Camera::perspective(0.6, 0.8).orbited(0.7, 0.3);
        assert!(camera.check().is_ok());
        let distance = camera.eye.length();
        let axes = camera.world_from_view();
        // The topmost point of the outline.
        let sine = 1.0 / distance;
        let top = axes.z_axis * sine + axes.y_axis * (1.0 - sine * sine).sqrt();
        for aspect in [1.0, 1.7] {
            let found = camera.clip_from_world(aspect).project_point3(top);
            assert!((found.y - 0.8).abs() < 1e-4 && found.x.abs() < 1e-4, "{found}");
        }
        let wide = camera.clip_from_world(0.5).project_point3(top);
        assert!((wide.y - 0.4).abs() < 1e-4, "{wide}");
    }

    #[test]
    fn orbiting_keeps_the_distance_and_stops_at_the_poles() {
        let camera = Camera::default().orbited(std::f32::consts::FRAC_PI_2, 0.0);
        assert!((camera.eye - Vec3::new(4.0, 0.0, 0.0)).length() < 1e-5);
        let above = Camera::default().orbited(0.3, 9.0);
        assert!((above.eye.length() - 4.0).abs() < 1e-5 && above.eye.y < 4.0);
        assert!(above.clip_from_world(1.0).is_finite());
        let straight = Camera { eye: Vec3::Y, ..Camera::default() };
        assert!(straight.clip_from_world(1.0).is_finite());
        let near = Camera::perspective(0.6, 0.8).zoomed(2.0);
        assert!((near.eye.length() * 2.0 - Camera::perspective(0.6, 0.8).eye.length()).abs() < 1e-5);
        let moved = Camera::default().panned(0.5, 0.0);
        assert!((moved.target - Vec3::X).length() < 1e-6);
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let refused = |camera: Camera| camera.check().unwrap_err().to_string();
        let fov = Projection::Perspective { fov: 4.0 };
        assert!(refused(Camera { projection: fov, ..Camera::default() }).contains("found 4"));
        assert!(refused(Camera { eye: Vec3::ZERO, ..Camera::default() }).contains("found 0"));
        assert!(refused(Camera { up: Vec3::NAN, ..Camera::default() }).contains("finite"));
    }
}
