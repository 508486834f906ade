//! The error type of this crate.

use std::fmt::Display;
use std::path::Path;

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of the renderer. Errors that have nothing to do with the device, such as those about files and
/// arguments, are those of `gpbrdf-core`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no adapter that can do the work.
    #[error(
        "no graphics adapter: expected one for Vulkan, Metal, DX12 or GL with compute shaders, found {found} \
         (on a machine without a GPU a software adapter serves, on Debian the package mesa-vulkan-drivers)"
    )]
    NoAdapter {
        /// The adapters that are there.
        found: String,
    },
    /// An adapter was found but does not open a device.
    #[error("cannot open \"{adapter}\": {message}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// The answer of the adapter.
        message: String,
    },
    /// The memory of the device does not suffice.
    #[error("{what}: out of graphics memory")]
    OutOfMemory {
        /// The work that needed it.
        what: String,
    },
    /// The device is gone: unplugged, reset by the driver, or stuck.
    #[error("{what}: the graphics device was lost: {message}")]
    Lost {
        /// The work that was interrupted.
        what: String,
        /// The reason that the driver gives.
        message: String,
    },
    /// The device rejects the work: an error of this crate or of the driver.
    #[error("{what}: {message}")]
    Gpu {
        /// The work.
        what: String,
        /// The answer of the device.
        message: String,
    },
    /// Something is larger than the device supports.
    #[error("{what}: expected {expected}, found {found}")]
    Limit {
        /// What is too large.
        what: &'static str,
        /// The limit of the device.
        expected: String,
        /// The size that was requested.
        found: String,
    },
    /// No shader can bake this model on this device.
    #[error("no shader for {what}")]
    NoShader {
        /// The part of the model that has none.
        what: String,
    },
    /// An error of `gpbrdf-core`: about an argument, a file or a model, or that the work was cancelled.
    #[error(transparent)]
    Core(#[from] gpbrdf_core::Error),
}

impl Error {
    /// An argument outside of its domain.
    pub(crate) fn argument(what: &'static str, expected: impl Into<String>, found: impl Display) -> Self {
        let (expected, found) = (expected.into(), found.to_string());
        gpbrdf_core::Error::InvalidArgument { what, expected, found }.into()
    }

    /// A file that cannot be read.
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        gpbrdf_core::Error::Io { action: "cannot read", path: path.to_owned(), source }.into()
    }

    /// A file that is not of its format.
    pub(crate) fn format(
        format: &'static str,
        path: &Path,
        expected: impl Into<String>,
        found: impl Display,
    ) -> Self {
        let (path, expected, found) = (path.to_owned(), expected.into(), found.to_string());
        gpbrdf_core::Error::Format { format, path, expected, found }.into()
    }

    /// Work that was cancelled on request.
    pub(crate) fn cancelled() -> Self {
        gpbrdf_core::Error::Cancelled.into()
    }

    /// Whether this says that the work was cancelled on request.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Core(gpbrdf_core::Error::Cancelled))
    }
}
