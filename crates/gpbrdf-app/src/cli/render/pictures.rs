//! The files of `render`: pictures as shown, figures with a scale, and linear values.

use std::io::Write;

use anyhow::Result;
use gpbrdf_core::base::AtomicFile;
use gpbrdf_core::figure::{Colormap, Panel, Picture, Scale, panel_figure, round_limit, write_rgba_png};
use gpbrdf_core::formats::write_image_exr;
use gpbrdf_render::{Background, Display, LinearPicture, LinearPixel, Renderer};

use super::choices::ShowName;

/// The formula of the difference, as figures state it.
const DIFFERENCE: &str = "prediction - truth, linear, mean of R, G, B; 1 = white";

/// A rendered picture and how to show it.
pub(super) struct Pictures<'a> {
    pub(super) renderer: &'a mut Renderer,
    pub(super) linear: &'a LinearPicture,
    pub(super) display: Display,
    /// End of the scale of false colours, if it is not chosen by the values.
    pub(super) limit: Option<f32>,
    pub(super) title: &'a str,
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
    pub(super) fn write_comparison(&mut self, file: &mut AtomicFile) -> Result<()> {
        let shown = [ShowName::Truth, ShowName::Prediction, ShowName::Difference];
        let panels = shown.into_iter().map(|show| self.panel(show)).collect::<Result<Vec<_>>>()?;
        Ok(panel_figure(self.title, &panels, &format!("difference: {DIFFERENCE}")).write_png(file)?)
    }

    /// Writes a picture as shown; one in false colours as a figure with its scale.
    pub(super) fn write_png(&mut self, file: &mut AtomicFile, show: ShowName) -> Result<()> {
        let note = match show {
            ShowName::Sigma => "weighted by reflected light",
            ShowName::Difference => DIFFERENCE,
            ShowName::Truth | ShowName::Prediction => return self.write_plain(file, show),
        };
        let panel = self.panel(show)?;
        Ok(panel_figure(self.title, &[panel], note).write_png(file)?)
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
                ("sigma", Some(Scale { map: Colormap::Sequential, low: 0.0, high }))
            }
            ShowName::Difference => {
                let high = self.limit_of(&self.linear.difference(self.display.exposure));
                ("difference", Some(Scale { map: Colormap::Diverging, low: -high, high }))
            }
        };
        #[expect(clippy::cast_possible_truncation, reason = "shaders compute in single precision")]
        let limit = scale.map(|scale| scale.high as f32);
        let pixels = self.renderer.read_display(&Display { show: show.into(), limit, ..self.display })?;
        Ok(Panel { picture: self.picture(&pixels), caption, scale })
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
