//! The options of commands that draw figures.

use std::path::Path;

use clap::Args;
use gpbrdf_core::Model;
use gpbrdf_core::figure::{FigureFormat, FigureOptions};
use gpbrdf_core::sample::SampleLayout;

use super::parse::parse_number_in;

/// Size of figures.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Output")]
pub(super) struct FigureSize {
    /// Width of figures in mm; a column of a paper is about 85 wide, two are 178.
    #[arg(long, value_name = "MM", default_value_t = 178.0, value_parser = parse_width)]
    width: f64,
    /// Pixels per inch of figures as .png.
    #[arg(long, value_name = "N", default_value_t = 300.0, value_parser = parse_resolution)]
    dpi: f64,
}

fn parse_width(text: &str) -> Result<f64, String> {
    parse_number_in(text, 20.0, 2000.0)
}

fn parse_resolution(text: &str) -> Result<f64, String> {
    parse_number_in(text, 20.0, 2400.0)
}

impl From<FigureSize> for FigureOptions {
    fn from(size: FigureSize) -> Self {
        Self { width: size.width, dots_per_inch: size.dpi }
    }
}

/// What a file of a picture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PictureFile {
    /// Values, .exr.
    Exr,
    /// A figure.
    Figure(FigureFormat),
}

impl PictureFile {
    /// What the end of a name stands for.
    ///
    /// # Errors
    /// Another end than .png, .svg, .pdf or .exr.
    pub(super) fn of(path: &Path) -> anyhow::Result<Self> {
        match FigureFormat::of(path) {
            Some(format) => Ok(Self::Figure(format)),
            None if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("exr")) => Ok(Self::Exr),
            None => {
                anyhow::bail!("\"{}\": expected a name that ends in .png, .svg, .pdf or .exr", path.display())
            }
        }
    }
}

/// Of what material a figure is, and out of what its prediction was made.
pub(super) fn title(name: &str, model: &Model) -> String {
    match model.provenance.layout {
        SampleLayout::Table => format!("{name}, compressed to {} numbers", grouped(model.n_floats())),
        _ => format!("{name}, predicted from {} samples", grouped(model.n_samples())),
    }
}

/// A number with a comma before every three digits.
pub(super) fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_set_apart_and_names_choose_the_file() {
        assert_eq!(
            [0, 20, 234, 3045, 37_440, 1_458_000].map(grouped),
            ["0", "20", "234", "3,045", "37,440", "1,458,000"]
        );
        let of = |name: &str| PictureFile::of(Path::new(name)).ok();
        assert_eq!(of("a.b.PDF"), Some(PictureFile::Figure(FigureFormat::Pdf)));
        assert_eq!(of("a.Exr"), Some(PictureFile::Exr));
        assert_eq!(of("png"), None);
    }
}
