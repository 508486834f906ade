//! How the views show what is open: plain data that is kept in settings and sessions.

use std::path::PathBuf;

use gpbrdf_core::Rgb;
use gpbrdf_core::figure::SliceOptions;
use serde::{Deserialize, Serialize};

/// The channels that are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Channel {
    #[default]
    Rgb,
    Red,
    Green,
    Blue,
}

impl Channel {
    pub(crate) const ALL: [Self; 4] = [Self::Rgb, Self::Red, Self::Green, Self::Blue];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Rgb => "RGB",
            Self::Red => "Red",
            Self::Green => "Green",
            Self::Blue => "Blue",
        }
    }

    /// One number for a colour: the channel, or the mean of all three.
    pub(crate) fn of(self, rgb: Rgb) -> f64 {
        match self {
            Self::Rgb => (rgb[0] + rgb[1] + rgb[2]) / 3.0,
            Self::Red => rgb[0],
            Self::Green => rgb[1],
            Self::Blue => rgb[2],
        }
    }
}

/// Rows and columns of a slice.
pub(crate) const SLICE_SIZE: usize = 256;

/// How slices look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct SliceLook {
    /// Degrees.
    pub(crate) phi_d: f64,
    /// Stops.
    pub(crate) exposure: f64,
    pub(crate) gamma: f64,
    /// Whether the axis of `theta_h` has the warp of the table.
    pub(crate) square_theta_h: bool,
    /// Whether colours are divided by their largest channel.
    pub(crate) chroma: bool,
    pub(crate) channel: Channel,
}

impl Default for SliceLook {
    fn default() -> Self {
        Self {
            phi_d: 90.0,
            exposure: 0.0,
            gamma: 2.2,
            square_theta_h: false,
            chroma: false,
            channel: Channel::Rgb,
        }
    }
}

impl SliceLook {
    pub(crate) fn options(&self) -> SliceOptions {
        SliceOptions {
            phi_d: self.phi_d.to_radians(),
            exposure: self.exposure,
            gamma: self.gamma,
            square_theta_h: self.square_theta_h,
            size: SLICE_SIZE,
        }
    }
}

/// What is plotted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub(crate) enum CurveKind {
    /// Reflected light in the plane of incidence, as a polar plot.
    #[default]
    Lobe,
    ThetaH,
    ThetaD,
    PhiD,
    /// The fraction of the light from one direction that is reflected.
    Albedo,
}

impl CurveKind {
    pub(crate) const ALL: [Self; 5] = [Self::Lobe, Self::ThetaH, Self::ThetaD, Self::PhiD, Self::Albedo];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Lobe => "Lobe",
            Self::ThetaH => "Over θh",
            Self::ThetaD => "Over θd",
            Self::PhiD => "Over φd",
            Self::Albedo => "Albedo",
        }
    }
}

/// Which curves are plotted, and where they cut the BRDF.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct CurveLook {
    pub(crate) kind: CurveKind,
    /// Angle of incidence of the lobe, degrees.
    pub(crate) incidence: f64,
    /// `theta_h`, `theta_d` and `phi_d` in degrees: a curve along one of them holds the other two here.
    pub(crate) at: [f64; 3],
    pub(crate) log: bool,
    pub(crate) times_cosine: bool,
    pub(crate) samples: bool,
    pub(crate) channel: Channel,
}

impl Default for CurveLook {
    fn default() -> Self {
        Self {
            kind: CurveKind::Lobe,
            incidence: 45.0,
            at: [0.0, 30.0, 90.0],
            log: false,
            times_cosine: false,
            samples: true,
            channel: Channel::Rgb,
        }
    }
}

/// What the 3-D view shows of a sphere or an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum SphereShown {
    /// Truth and prediction in one picture, on either side of a line.
    #[default]
    Swipe,
    SideBySide,
    Difference,
    Sigma,
}

impl SphereShown {
    pub(crate) const ALL: [Self; 4] = [Self::Swipe, Self::SideBySide, Self::Difference, Self::Sigma];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Swipe => "Swipe",
            Self::SideBySide => "Side by side",
            Self::Difference => "Difference",
            Self::Sigma => "Sigma",
        }
    }
}

/// What lights the sphere and the objects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct SphereLight {
    /// Whether a point light replaces the environment.
    pub(crate) point: bool,
    /// Position of the point light over the disc, `x` to the right and `y` up.
    pub(crate) at: [f64; 2],
    /// Rotation of the environment about the vertical and the horizontal axis, radians.
    pub(crate) yaw: f64,
    pub(crate) pitch: f64,
    /// Stops.
    pub(crate) exposure: f64,
}

impl Default for SphereLight {
    fn default() -> Self {
        Self { point: false, at: [-0.45, 0.5], yaw: 0.0, pitch: 0.0, exposure: 0.0 }
    }
}

impl SphereLight {
    /// Whether another light differs in its exposure only.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        Self { exposure: other.exposure, ..*self } == *other
    }

    /// Moves the point light to a position over the disc, or to the rim where the position is outside.
    pub(crate) fn place(&mut self, [x, y]: [f64; 2]) {
        let scale = x.hypot(y).max(1.0);
        self.at = [x / scale, y / scale];
    }

    /// Moves the light to its default place. It stays of the same kind.
    pub(crate) fn reset(&mut self) {
        *self = Self { point: self.point, ..Self::default() };
    }
}

/// The object that is lit.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Shape {
    /// The unit sphere.
    #[default]
    Sphere,
    Knot,
    RoundedBox,
    /// A file that holds a mesh.
    File(PathBuf),
}

impl Shape {
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Sphere => "Sphere".to_owned(),
            Self::Knot => "Knot".to_owned(),
            Self::RoundedBox => "Rounded box".to_owned(),
            Self::File(path) => {
                path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
            }
        }
    }
}

/// Where the eye is relative to the object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Orbit {
    /// Radians.
    pub(crate) azimuth: f32,
    /// Radians.
    pub(crate) elevation: f32,
    pub(crate) zoom: f32,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { azimuth: 0.5, elevation: 0.35, zoom: 1.0 }
    }
}

impl Orbit {
    /// Moves the eye about the object, radians.
    pub(crate) fn turn(&mut self, azimuth: f32, elevation: f32) {
        self.azimuth += azimuth;
        self.elevation = (self.elevation + elevation).clamp(-1.5, 1.5);
    }

    /// Enlarges the object by a factor.
    pub(crate) fn enlarge(&mut self, factor: f32) {
        self.zoom = (self.zoom * factor).clamp(0.3, 6.0);
    }
}

/// How the 3-D view looks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct SceneLook {
    pub(crate) shown: SphereShown,
    pub(crate) light: SphereLight,
    /// The file of the environment; `None` for the built-in one.
    pub(crate) environment: Option<PathBuf>,
    pub(crate) shape: Shape,
    pub(crate) orbit: Orbit,
    /// Where truth and prediction meet in one picture, as a fraction of its width.
    pub(crate) swipe: f32,
}

impl Default for SceneLook {
    fn default() -> Self {
        Self {
            shown: SphereShown::Swipe,
            light: SphereLight::default(),
            environment: None,
            shape: Shape::Sphere,
            orbit: Orbit::default(),
            swipe: 0.5,
        }
    }
}
