//! What a user can say about a file of measurements that does not say it itself.

use std::f64::consts::PI;

/// How to read a file of measurements. What is `None` is taken from the file; where the file does not say it
/// and it is no convention of the format, the file is refused with a message that names the option.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// What the values are; the BRDF unless the file says otherwise.
    pub values: Option<ValueKind>,
    /// The unit of the angles; degrees unless the file says otherwise.
    pub angles: Option<AngleUnit>,
    /// Which of the names `theta` and `phi` is the angle from the normal; `theta` unless the file says
    /// otherwise.
    pub zenith: Option<Zenith>,
}

/// The quantity that the values of a file are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ValueKind {
    /// The BRDF `f`, in sr^-1.
    Brdf,
    /// `f cos(theta_o)`, in sr^-1: the BRDF times the cosine of the outgoing angle.
    Cosine,
    /// The reflectance factor `pi f`, without a unit: 1 for a perfect diffuser.
    Factor,
}

impl ValueKind {
    /// By what a value is multiplied to become the BRDF in sr^-1. `cos_o` is the cosine of the outgoing angle.
    pub(crate) fn to_brdf(self, cos_o: f64) -> f64 {
        match self {
            Self::Brdf => 1.0,
            Self::Cosine => 1.0 / cos_o,
            Self::Factor => 1.0 / PI,
        }
    }
}

/// The unit of angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AngleUnit {
    /// 360 for a full turn.
    Degrees,
    /// `2 pi` for a full turn.
    Radians,
}

impl AngleUnit {
    /// The name, for messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Degrees => "degrees",
            Self::Radians => "radians",
        }
    }

    pub(crate) fn to_radians(self, angle: f64) -> f64 {
        match self {
            Self::Degrees => angle.to_radians(),
            Self::Radians => angle,
        }
    }
}

/// The name of the angle from the normal. The other name is then that of the azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zenith {
    /// `theta` is measured from the normal and `phi` about it, as in optics.
    Theta,
    /// `phi` is measured from the normal and `theta` about it, as in some data of satellites.
    Phi,
}
