//! Figures, and their files.

use std::io::Write;
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::figure::bitmap::bitmap;
use crate::figure::page::lay_out;
use crate::figure::panel::Panel;
use crate::figure::pdf::pdf;
use crate::figure::picture::Picture;
use crate::figure::svg::svg;

/// A figure: rows of panels between a title and a note.
///
/// Texts may hold greek letters, which are set in italics. An underscore after one makes the next character a
/// subscript; `_{...}` and `^{...}` make subscripts and superscripts anywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// The line above it; none if it is empty.
    pub title: String,
    /// The rows, from top to bottom. Panels of one column are as wide as each other.
    pub rows: Vec<Row>,
    /// The text below it; none if it is empty.
    pub note: String,
}

/// Panels side by side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// What is written along its left side; nothing if it is empty.
    pub name: String,
    /// The panels, from left to right.
    pub panels: Vec<Panel>,
}

/// The size of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FigureOptions {
    /// Width in millimetres. A figure is narrower where its panels would become taller than 88 mm. A column of a paper
    /// is about 85 mm wide, and both with the room between them 178 mm.
    pub width: f64,
    /// Pixels of a PNG per inch, 25.4 mm.
    pub dots_per_inch: f64,
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self { width: 178.0, dots_per_inch: 300.0 }
    }
}

/// The kind of a figure's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureFormat {
    /// Pixels.
    Png,
    /// Scalable Vector Graphics: text stays text, in a typeface that is part of the file.
    Svg,
    /// A page of the size of the figure, with its typeface embedded.
    Pdf,
}

impl FigureFormat {
    /// The format that the end of a name stands for: `.png`, `.svg` or `.pdf`.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let is = |end: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(end));
        let formats = [("png", Self::Png), ("svg", Self::Svg), ("pdf", Self::Pdf)];
        formats.into_iter().find(|(end, _)| is(end)).map(|(_, format)| format)
    }
}

impl Figure {
    /// A figure of one row.
    #[must_use]
    pub fn of_panels(title: impl Into<String>, panels: Vec<Panel>, note: impl Into<String>) -> Self {
        Self { title: title.into(), rows: vec![Row { name: String::new(), panels }], note: note.into() }
    }

    /// Writes the figure. The same figure gives the same bytes.
    ///
    /// # Errors
    /// Any error of `out`; [`std::io::ErrorKind::Other`] with an [`Error::InvalidArgument`] for a width out of 20 to
    /// 2000 millimetres or a resolution out of 20 to 2400 dots per inch.
    pub fn write(
        &self,
        out: &mut impl Write,
        format: FigureFormat,
        options: &FigureOptions,
    ) -> std::io::Result<()> {
        let width = options.points().map_err(std::io::Error::other)?;
        match format {
            FigureFormat::Png => {
                let picture = self.picture(options).map_err(std::io::Error::other)?;
                return picture.write_png_at(out, options.dots_per_inch);
            }
            FigureFormat::Svg => out.write_all(svg(&lay_out(self, width))?.as_bytes())?,
            FigureFormat::Pdf => out.write_all(&pdf(&lay_out(self, width))?)?,
        }
        out.flush()
    }

    /// Writes the figure as a file, whose format is that of its name.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for another name than one that ends in .png, .svg or .pdf; [`Error::Io`] when the
    /// file cannot be written; otherwise as [`Figure::write`].
    pub fn save(&self, path: impl AsRef<Path>, options: &FigureOptions) -> Result<()> {
        let path = path.as_ref();
        let Some(format) = FigureFormat::of(path) else {
            let expected = "a name that ends in .png, .svg or .pdf";
            return Err(Error::argument("name of a figure", expected, path.display()));
        };
        options.points()?;
        let mut file = AtomicFile::create(path)?;
        self.write(&mut file, format, options).map_err(|source| Error::write(path, source))?;
        file.commit()
    }

    /// The figure as pixels.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a width out of 20 to 2000 millimetres, a resolution out of 20 to 2400 dots per
    /// inch, or more than 400 million pixels.
    pub fn picture(&self, options: &FigureOptions) -> Result<Picture> {
        bitmap(&lay_out(self, options.points()?), options.dots_per_inch / 72.0)
    }
}

impl FigureOptions {
    /// The width in points.
    fn points(&self) -> Result<f64> {
        if !(20.0..=2000.0).contains(&self.width) {
            return Err(Error::argument("width of a figure", "20 to 2000 mm", self.width));
        }
        if !(20.0..=2400.0).contains(&self.dots_per_inch) {
            let expected = "20 to 2400 dots per inch";
            return Err(Error::argument("resolution of a figure", expected, self.dots_per_inch));
        }
        Ok(self.width / 25.4 * 72.0)
    }
}
