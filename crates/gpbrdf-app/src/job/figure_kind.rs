//! The kind of file of figures whose names are not given.

use clap::ValueEnum;
use gpbrdf_core::figure::FigureFormat;

/// A kind of file of figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum FigureKind {
    /// Pixels.
    #[default]
    Png,
    /// Scalable; text stays text.
    Svg,
    /// A page.
    Pdf,
}

impl FigureKind {
    pub(crate) fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Svg => "svg",
            Self::Pdf => "pdf",
        }
    }
}

impl From<FigureKind> for FigureFormat {
    fn from(kind: FigureKind) -> Self {
        match kind {
            FigureKind::Png => Self::Png,
            FigureKind::Svg => Self::Svg,
            FigureKind::Pdf => Self::Pdf,
        }
    }
}
