//! The values that options take by name: on the command line, in sessions and in the viewer's lists.

use std::fmt;
use std::str::FromStr;

use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use gpbrdf_core::Noise;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Where to measure a source that can be evaluated at any direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum LayoutChoice {
    /// A product lattice in the warped box.
    #[default]
    Lattice,
    /// Random directions, uniform in the warped box.
    Random,
    /// Random cells of the table.
    Cells,
}

/// The symmetry in `phi_d` to rely on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum SymmetryChoice {
    /// Measured at the source; scattered samples are taken for bilateral.
    #[default]
    Auto,
    /// phi_d and 180 degrees - phi_d are alike.
    Bilateral,
    /// Only phi_d and phi_d + 180 degrees are alike.
    Reciprocal,
}

/// What is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum TransformChoice {
    /// ln(f + epsilon).
    #[default]
    Log,
    /// f itself.
    Identity,
    /// The cube root of f.
    CubeRoot,
}

#[cfg(feature = "viewer")]
impl LayoutChoice {
    pub(crate) const ALL: [Self; 3] = [Self::Lattice, Self::Random, Self::Cells];

    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Lattice => "Lattice",
            Self::Random => "Random directions",
            Self::Cells => "Table cells",
        }
    }
}

#[cfg(feature = "viewer")]
impl SymmetryChoice {
    pub(crate) const ALL: [Self; 3] = [Self::Auto, Self::Bilateral, Self::Reciprocal];

    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Auto => "Measured",
            Self::Bilateral => "Bilateral",
            Self::Reciprocal => "Reciprocal only",
        }
    }
}

#[cfg(feature = "viewer")]
impl TransformChoice {
    pub(crate) const ALL: [Self; 3] = [Self::Log, Self::Identity, Self::CubeRoot];

    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Log => "ln(f + ε)",
            Self::Identity => "f",
            Self::CubeRoot => "Cube root of f",
        }
    }
}

/// A fixed noise variance in squared target units, or none: `auto`, found with the other hyper-parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct NoiseChoice(pub(crate) Option<f64>);

impl NoiseChoice {
    pub(crate) fn noise(self) -> Noise {
        self.0.map_or(Noise::Optimized, Noise::Fixed)
    }
}

impl fmt::Display for NoiseChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(variance) => write!(f, "{variance}"),
            None => f.write_str("auto"),
        }
    }
}

impl FromStr for NoiseChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self(None));
        }
        match text.parse::<f64>() {
            Ok(variance) if variance > 0.0 && variance.is_finite() => Ok(Self(Some(variance))),
            _ => Err("expected auto or a positive number".into()),
        }
    }
}

/// Nodes of a lattice along each axis, as `48x32x24`.
pub(super) fn parse_lattice(text: &str) -> Result<[usize; 3], String> {
    let sides: Option<Vec<usize>> = text.split(['x', 'X']).map(|side| side.parse().ok()).collect();
    sides.and_then(|s| s.try_into().ok()).ok_or_else(|| "expected three numbers like 48x32x24".into())
}

/// Parses one of `names`, those that the core gives the values of an enumeration in files.
pub(super) fn named<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: Clone + DeserializeOwned + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).try_map(|name| serde_json::from_value::<T>(name.into()))
}
