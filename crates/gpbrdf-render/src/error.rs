//! What can go wrong.

use std::path::PathBuf;

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of the renderer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no adapter that can do the work.
    #[error(
        "no graphics adapter: expected one for Vulkan, Metal, DX12 or GL with compute shaders, found {found} \
         (on a machine without a GPU a software adapter serves, on Debian the package mesa-vulkan-drivers)"
    )]
    NoAdapter {
        /// What there is instead.
        found: String,
    },
    /// The adapter is there and gives no device.
    #[error("cannot open \"{adapter}\": {message}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// What it answers.
        message: String,
    },
    /// The memory of the device does not suffice.
    #[error("{what}: out of graphics memory")]
    OutOfMemory {
        /// The work that asked for it.
        what: String,
    },
    /// The device is gone: unplugged, reset by the driver, or stuck.
    #[error("{what}: the graphics device was lost: {message}")]
    Lost {
        /// The work that met it.
        what: String,
        /// What the driver says.
        message: String,
    },
    /// The device rejects the work: an error of this crate or of the driver.
    #[error("{what}: {message}")]
    Gpu {
        /// The work.
        what: String,
        /// What the device answers.
        message: String,
    },
    /// Something is larger than the device takes.
    #[error("{what}: expected {expected}, found {found}")]
    Limit {
        /// What is too large.
        what: &'static str,
        /// What the device takes.
        expected: String,
        /// What was asked for.
        found: String,
    },
    /// A value that makes no sense.
    #[error("{what}: expected {expected}, found {found}")]
    InvalidArgument {
        /// What has the value.
        what: &'static str,
        /// What it has to be.
        expected: String,
        /// What it is.
        found: String,
    },
    /// A file that cannot be read.
    #[error("cannot read \"{}\": {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A file that holds something else.
    #[error("{format} file \"{}\": expected {expected}, found {found}", path.display())]
    Format {
        /// The kind of file.
        format: &'static str,
        /// The file.
        path: PathBuf,
        /// What it should hold.
        expected: String,
        /// What it holds.
        found: String,
    },
    /// The work was cancelled on request.
    #[error("cancelled")]
    Cancelled,
    /// There is no shader for this model.
    #[error("no shader for {what}")]
    NoShader {
        /// What has none.
        what: String,
    },
    /// An error of the models and tables.
    #[error(transparent)]
    Core(#[from] gpbrdf_core::Error),
}
