//! The values that options of `render` take by name.

use clap::ValueEnum;
use gpbrdf_render::{Background, Sampling, Show, ToneCurve};

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum LightName {
    Directional,
    Point,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum SamplingName {
    Light,
    Brdf,
    Mis,
}

impl From<SamplingName> for Sampling {
    fn from(name: SamplingName) -> Self {
        match name {
            SamplingName::Light => Self::Light,
            SamplingName::Brdf => Self::Brdf,
            SamplingName::Mis => Self::Both,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum ToneName {
    Clip,
    Reinhard,
    Filmic,
}

impl From<ToneName> for ToneCurve {
    fn from(name: ToneName) -> Self {
        match name {
            ToneName::Clip => Self::Clip,
            ToneName::Reinhard => Self::Reinhard,
            ToneName::Filmic => Self::Filmic,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ShowName {
    Truth,
    Prediction,
    Sigma,
    Difference,
}

impl From<ShowName> for Show {
    fn from(name: ShowName) -> Self {
        match name {
            ShowName::Truth => Self::Truth,
            ShowName::Prediction => Self::Prediction,
            ShowName::Sigma => Self::Sigma,
            ShowName::Difference => Self::Difference,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum BackgroundName {
    Environment,
    Black,
    Transparent,
}

impl From<BackgroundName> for Background {
    fn from(name: BackgroundName) -> Self {
        match name {
            BackgroundName::Environment => Self::Environment,
            BackgroundName::Black => Self::Black,
            BackgroundName::Transparent => Self::Transparent,
        }
    }
}
