//! The files of `render`: pictures as shown, figures with a scale, and linear values.

use std::io::Write;

use anyhow::Result;
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::figure::{
    Colormap, Figure, FigureFormat, FigureOptions, Panel, Picture, Scale, round_limit, write_rgba_png,
};
use gpbrdf_core::formats::write_image_exr;
use gpbrdf_render::{Background, Display, LinearPicture, LinearPixel, Renderer};

use super::choices::ShowName;

/// The formula of the difference, as figures state it.
const DIFFERENCE: &str = "prediction − truth in linear light, mean of R, G and B; 1 is white";

/// A rendered picture and how to show it.
pub(super) struct Pictures<'a> {
    pub(super) renderer: &'a mut Renderer,
    pub(super) linear: &'a LinearPicture,
    pub(super) display: Display,
    /// End of the scale of false colours, if it is not chosen by the values.
    pub(super) limit: Option<f32>,
    pub(super) title: &'a str,
    pub(super) figures: FigureOptions,
}

impl Pictures<'_> {
    /// Writes values as linear RGB.
    pub(super) fn write_exr(&self, file: &mut AtomicFile, show: ShowName) -> Result<()> {
        let raster = self.linear.raster();
        let each = |rgb: fn(&LinearPixel) -> [f32; 3]| {
            raster.pixels().iter().map(|pixel| rgb(pixel).map(f64::from)).collect()
        };
        let pixels: Vec<[f64; 3]> = match show {
            ShowName::Truth => each(|pixel| pixel.truth),
            ShowName::Prediction => each(|pixel| pixel.prediction),
            ShowName::Sigma => each(|pixel| [pixel.sigma; 3]),
            ShowName::Difference => {
                self.linear.difference(1.0).into_iter().map(|x| [f64::from(x); 3]).collect()
            }
        };
        Ok(write_image_exr(file, raster.width(), raster.height(), &pixels)?)
    }

    /// Writes a figure of truth, prediction and difference.
    pub(super) fn write_comparison(&mut self, file: &mut AtomicFile, format: FigureFormat) -> Result<()> {
        let shown = [ShowName::Truth, ShowName::Prediction, ShowName::Difference];
        let panels = shown.into_iter().map(|show| self.panel(show)).collect::<Result<Vec<_>>>()?;
        let figure = Figure::of_panels(self.title, panels, format!("Difference: {DIFFERENCE}."));
        Ok(figure.write(file, format, &self.figures)?)
    }

    /// Writes a picture as shown; one in false colours, or as vectors, as a figure.
    pub(super) fn write_figure(
        &mut self,
        file: &mut AtomicFile,
        show: ShowName,
        format: FigureFormat,
    ) -> Result<()> {
        let note = match show {
            ShowName::Sigma => "Standard deviation of the logarithm, weighted by reflected light.".to_owned(),
            ShowName::Difference => format!("Difference: {DIFFERENCE}."),
            ShowName::Truth | ShowName::Prediction if format == FigureFormat::Png => {
                return self.write_plain(file, show);
            }
            ShowName::Truth | ShowName::Prediction => String::new(),
        };
        let panel = self.panel(show)?;
        Ok(Figure::of_panels(self.title, vec![panel], note).write(file, format, &self.figures)?)
    }

    fn write_plain(&mut self, file: &mut AtomicFile, show: ShowName) -> Result<()> {
        let pixels = self.renderer.read_display(&Display { show: show.into(), ..self.display })?;
        if self.display.background == Background::Transparent {
            let raster = self.linear.raster();
            write_rgba_png(file, raster.width(), raster.height(), &pixels)?;
        } else {
            self.picture(&pixels).write_png(file)?;
        }
        Ok(file.flush()?)
    }

    /// What is shown, with its scale where colours are false.
    fn panel(&mut self, show: ShowName) -> Result<Panel> {
        let (caption, scale) = match show {
            ShowName::Truth => ("truth", None),
            ShowName::Prediction => ("prediction", None),
            ShowName::Sigma => {
                let high = self.limit_of(self.linear.raster().map(|pixel| pixel.sigma).pixels());
                ("standard deviation", Some(Scale { map: Colormap::Sequential, low: 0.0, high }))
            }
            ShowName::Difference => {
                let high = self.limit_of(&self.linear.difference(self.display.exposure));
                ("difference", Some(Scale { map: Colormap::Diverging, low: -high, high }))
            }
        };
        #[expect(clippy::cast_possible_truncation, reason = "shaders compute in single precision")]
        let limit = scale.map(|scale| scale.high as f32);
        let pixels = self.renderer.read_display(&Display { show: show.into(), limit, ..self.display })?;
        let picture = self.picture(&pixels);
        Ok(match scale {
            Some(scale) => Panel::scaled(caption, picture, scale),
            None => Panel::picture(caption, picture),
        })
    }

    /// The end of the scale of these values.
    fn limit_of(&self, values: &[f32]) -> f64 {
        let chosen = || {
            let mask: Vec<bool> =
                self.linear.raster().pixels().iter().map(|pixel| pixel.coverage == 1.0).collect();
            let wide: Vec<f64> = values.iter().copied().map(f64::from).collect();
            round_limit(&wide, &mask)
        };
        self.limit.map_or_else(chosen, f64::from)
    }

    fn picture(&self, pixels: &[[u8; 4]]) -> Picture {
        let (width, height) = (self.linear.raster().width(), self.linear.raster().height());
        Picture::from_fn(width, height, |x, y| {
            let [r, g, b, _] = pixels[y * width + x];
            [r, g, b]
        })
    }
}
