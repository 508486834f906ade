//! Options for files of measurements that do not say themselves how they are to be read.

use clap::{Args, ValueEnum};
use gpbrdf_core::formats::{AngleUnit, ReadOptions, ValueKind, Zenith};
use serde::Serialize;

/// How to read measurements that are text.
#[derive(Args, Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Reading {
    /// What the values of measured samples are [default: what their file says, else brdf]
    #[arg(long, value_enum, value_name = "KIND", help_heading = "Input")]
    values: Option<Values>,
    /// The unit of their angles [default: what their file says, else degrees]
    #[arg(long, value_enum, value_name = "UNIT", help_heading = "Input")]
    angles: Option<Angles>,
    /// The name of the angle from the normal [default: what their file says, else theta]
    #[arg(long, value_enum, value_name = "NAME", help_heading = "Input")]
    zenith: Option<ZenithName>,
}

#[derive(Clone, Copy, Debug, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Values {
    /// The BRDF f, in 1/sr.
    Brdf,
    /// f times the cosine of the outgoing angle, in 1/sr.
    Cosine,
    /// The reflectance factor pi f, without a unit: 1 for a perfect diffuser.
    Factor,
}

#[derive(Clone, Copy, Debug, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Angles {
    /// 360 for a full turn.
    Degrees,
    /// 2 pi for a full turn.
    Radians,
}

#[derive(Clone, Copy, Debug, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum ZenithName {
    /// theta is measured from the normal and phi about it.
    Theta,
    /// phi is measured from the normal and theta about it, as in some data of satellites.
    Phi,
}

impl Reading {
    pub(crate) fn options(self) -> ReadOptions {
        ReadOptions {
            values: self.values.map(|values| match values {
                Values::Brdf => ValueKind::Brdf,
                Values::Cosine => ValueKind::Cosine,
                Values::Factor => ValueKind::Factor,
            }),
            angles: self.angles.map(|angles| match angles {
                Angles::Degrees => AngleUnit::Degrees,
                Angles::Radians => AngleUnit::Radians,
            }),
            zenith: self.zenith.map(|zenith| match zenith {
                ZenithName::Theta => Zenith::Theta,
                ZenithName::Phi => Zenith::Phi,
            }),
        }
    }
}
