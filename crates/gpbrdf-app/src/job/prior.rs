//! The name of a learned prior, as an option and in sessions.

use std::convert::Infallible;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use anyhow::Result;
use gpbrdf_core::model::PriorChoice;
use gpbrdf_core::prior::Prior;
use serde::{Deserialize, Serialize};

/// What is known of other materials.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub(crate) enum PriorName {
    /// The prior that comes with the program.
    #[default]
    BuiltIn,
    /// Nothing.
    None,
    /// A file of `gpbrdf-cli learn`.
    File(PathBuf),
}

impl PriorName {
    /// Reads the file.
    ///
    /// # Errors
    /// A file that cannot be read or holds no prior.
    pub(crate) fn open(&self) -> Result<PriorChoice> {
        Ok(match self {
            Self::BuiltIn => PriorChoice::BuiltIn,
            Self::None => PriorChoice::None,
            Self::File(path) => PriorChoice::Learned(Arc::new(Prior::load(path)?)),
        })
    }
}

impl FromStr for PriorName {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            "built-in" => Self::BuiltIn,
            "none" => Self::None,
            path => Self::File(path.into()),
        })
    }
}

impl fmt::Display for PriorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn => f.write_str("built-in"),
            Self::None => f.write_str("none"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl From<String> for PriorName {
    fn from(text: String) -> Self {
        text.parse().unwrap_or_else(|never: Infallible| match never {})
    }
}

impl From<PriorName> for String {
    fn from(name: PriorName) -> Self {
        name.to_string()
    }
}
