//! The one error type of this crate.

use std::path::PathBuf;

/// What can go wrong in `gpbrdf-core`. Variants say what was expected and what was found; those about a file
/// also name the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be opened, read or written.
    #[error("{action} \"{}\": {source}", path.display())]
    Io {
        /// What was tried, for example `cannot read`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The operating system's answer.
        source: std::io::Error,
    },
    /// The content of a file is not what its format requires.
    #[error("{format} file \"{}\": expected {expected}, found {found}", path.display())]
    Format {
        /// The format, for example `MERL`.
        format: &'static str,
        /// The file.
        path: PathBuf,
        /// What the format requires.
        expected: String,
        /// What the file holds.
        found: String,
    },
    /// A file has none of the formats that this crate reads.
    #[error("\"{}\": expected {expected}, found {found}", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The formats that can be read.
        expected: String,
        /// A description of the content.
        found: String,
    },
    /// A name belongs to nothing that is built in.
    #[error("no {kind} is called \"{name}\": expected one of {known}")]
    UnknownName {
        /// The kind of thing that was named, for example `built-in material`.
        kind: &'static str,
        /// The name that was given.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A source holds something other than what an operation needs.
    #[error("{what}: expected {expected}, found {found}")]
    Unsuitable {
        /// The source.
        what: String,
        /// What the operation needs.
        expected: &'static str,
        /// What the source holds, and what can be done with it.
        found: &'static str,
    },
    /// An argument is outside its domain.
    #[error("{what}: expected {expected}, found {found}")]
    InvalidArgument {
        /// The argument.
        what: &'static str,
        /// Its domain.
        expected: String,
        /// The value that was given.
        found: String,
    },
    /// A covariance matrix stayed indefinite with every jitter that was tried.
    #[error(
        "covariance matrix of {size} samples: expected positive definite with a jitter of at most \
         {largest_jitter:e}, found a non-positive pivot"
    )]
    NotPositiveDefinite {
        /// Number of rows.
        size: usize,
        /// The last jitter tried, relative to the mean of the diagonal.
        largest_jitter: f64,
    },
    /// A Gaussian process would not fit into memory.
    #[error(
        "a {solver} Gaussian process on {samples} samples: expected at most {limit_gib:.1} GiB, found a need of \
         {need_gib:.1} GiB and about {need_seconds:.0} s; take fewer samples or another solver"
    )]
    TooLarge {
        /// Name of the solver.
        solver: &'static str,
        /// Number of samples.
        samples: usize,
        /// Memory it would take, in GiB.
        need_gib: f64,
        /// Memory it may take, in GiB.
        limit_gib: f64,
        /// Time it would take, in seconds.
        need_seconds: f64,
    },
    /// The work was cancelled by the caller.
    #[error("cancelled")]
    Cancelled,
}

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An [`Error::Io`] about reading `path`.
    pub(crate) fn read(path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io { action: "cannot read", path: path.to_owned(), source }
    }

    /// An [`Error::Io`] about writing `path`.
    pub(crate) fn write(path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io { action: "cannot write", path: path.to_owned(), source }
    }

    /// An [`Error::InvalidArgument`].
    pub(crate) fn argument(
        what: &'static str,
        expected: impl Into<String>,
        found: impl std::fmt::Display,
    ) -> Self {
        Self::InvalidArgument { what, expected: expected.into(), found: found.to_string() }
    }
}
