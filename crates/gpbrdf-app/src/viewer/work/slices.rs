//! Slices of truth, prediction, difference and sigma in colour, made off the window's thread.

use std::sync::Arc;

use eframe::egui::{Color32, ColorImage};
use gpbrdf_core::{BrdfTable, Colormap, Rgb, Slice, SliceOptions, Source};
use serde::{Deserialize, Serialize};

use crate::viewer::state::document::DocumentId;
use crate::viewer::work::fitter::{Event, Outbox};
use crate::viewer::work::mailbox::{Mailbox, Sender};

/// Rows and columns of a slice.
pub(crate) const SLICE_SIZE: usize = 256;

/// Below the horizon.
const BELOW_HORIZON: Color32 = Color32::from_rgb(58, 58, 64);

/// The channels that are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Channel {
    #[default]
    Rgb,
    Red,
    Green,
    Blue,
}

impl Channel {
    pub(crate) const ALL: [Self; 4] = [Self::Rgb, Self::Red, Self::Green, Self::Blue];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Rgb => "RGB",
            Self::Red => "Red",
            Self::Green => "Green",
            Self::Blue => "Blue",
        }
    }

    /// One number for a colour: the channel, or the mean of all.
    pub(crate) fn of(self, rgb: Rgb) -> f64 {
        match self {
            Self::Rgb => (rgb[0] + rgb[1] + rgb[2]) / 3.0,
            Self::Red => rgb[0],
            Self::Green => rgb[1],
            Self::Blue => rgb[2],
        }
    }
}

/// How slices look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct SliceLook {
    /// Degrees.
    pub(crate) phi_d: f64,
    /// Stops.
    pub(crate) exposure: f64,
    pub(crate) gamma: f64,
    pub(crate) square_theta_h: bool,
    /// Colours divided by their largest channel.
    pub(crate) chroma: bool,
    pub(crate) channel: Channel,
}

impl Default for SliceLook {
    fn default() -> Self {
        Self {
            phi_d: 90.0,
            exposure: 0.0,
            gamma: 2.2,
            square_theta_h: false,
            chroma: false,
            channel: Channel::Rgb,
        }
    }
}

impl SliceLook {
    pub(crate) fn options(&self) -> SliceOptions {
        SliceOptions {
            phi_d: self.phi_d.to_radians(),
            exposure: self.exposure,
            gamma: self.gamma,
            square_theta_h: self.square_theta_h,
            size: SLICE_SIZE,
        }
    }

    /// A value as shown.
    fn colour(&self, value: Rgb) -> Color32 {
        let mut value = value;
        if self.chroma {
            let largest = value.into_iter().fold(0.0, f64::max);
            value = value.map(|x| if largest > 0.0 { x / largest } else { 0.0 });
        }
        if self.channel != Channel::Rgb {
            value = [self.channel.of(value); 3];
        }
        let scale = if self.chroma { 1.0 } else { self.exposure.exp2() };
        let [r, g, b] = value.map(|x| shown(x * scale, self.gamma));
        Color32::from_rgb(r, g, b)
    }
}

/// A linear value as eight bits.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the value is within [0, 255.5]")]
pub(crate) fn shown(x: f64, gamma: f64) -> u8 {
    (x.clamp(0.0, 1.0).powf(1.0 / gamma) * 255.0 + 0.5) as u8
}

/// Where the truth is looked up.
#[derive(Clone, Debug)]
pub(crate) enum Surface {
    Table(Arc<BrdfTable>),
    /// Until its table is there.
    Source(Arc<Source>),
}

impl Surface {
    fn slice(&self, options: &SliceOptions) -> Option<Slice> {
        match self {
            Self::Table(table) => Some(Slice::new(table.as_ref(), options)),
            Self::Source(source) => source.brdf().map(|brdf| Slice::new(brdf, options)),
        }
    }
}

/// What slices depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SliceKey {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) look: SliceLook,
    pub(crate) truth_is_table: bool,
    pub(crate) has_sigma: bool,
}

/// Slices to make.
#[derive(Clone, Debug)]
pub(crate) struct SliceRequest {
    pub(crate) key: SliceKey,
    pub(crate) truth: Option<Surface>,
    pub(crate) mean: Arc<BrdfTable>,
    pub(crate) sigma: Option<Arc<BrdfTable>>,
}

/// One slice in colour; of false colours, the value at the end of the scale.
#[derive(Clone, Debug)]
pub(crate) struct SlicePanel {
    pub(crate) image: ColorImage,
    pub(crate) limit: Option<f64>,
}

/// Truth, prediction, difference, sigma.
#[derive(Clone, Debug)]
pub(crate) struct SliceImages {
    pub(crate) key: SliceKey,
    pub(crate) panels: [Option<SlicePanel>; 4],
}

/// Starts the thread that makes slices, with workers of its own: those of the fitter may be busy for seconds.
pub(crate) fn spawn(outbox: Outbox) -> std::io::Result<Sender<SliceRequest>> {
    let pool = rayon::ThreadPoolBuilder::new().build().map_err(std::io::Error::other)?;
    Mailbox::spawn("slices", move |request: SliceRequest, stale| {
        let images = pool.install(|| make(&request));
        if !stale() {
            outbox.send(Event::Slices(Box::new(images)));
        }
    })
}

/// Makes slices; some 20 ms.
pub(crate) fn make(request: &SliceRequest) -> SliceImages {
    let look = request.key.look;
    let options = look.options();
    let (truth, (mean, sigma)) = rayon::join(
        || request.truth.as_ref().and_then(|surface| surface.slice(&options)),
        || {
            rayon::join(
                || Slice::new(request.mean.as_ref(), &options),
                || request.sigma.as_ref().map(|table| Slice::new(table.as_ref(), &options)),
            )
        },
    );
    let plain =
        |slice: &Slice| SlicePanel { image: image(slice, |i| look.colour(slice.values()[i])), limit: None };
    let difference = truth.as_ref().map(|truth| {
        let log = |x: f64| (x.max(0.0) + 1e-3).ln();
        let gap: Vec<f64> = std::iter::zip(mean.values(), truth.values())
            .map(|(a, b)| look.channel.of(std::array::from_fn(|c| log(a[c]) - log(b[c]))))
            .collect();
        let limit = round_limit(&gap, mean.above_horizon());
        let image = image(truth, |i| colour(Colormap::Diverging, 0.5 + 0.5 * gap[i] / limit));
        SlicePanel { image, limit: Some(limit) }
    });
    let sigma = sigma.map(|slice| {
        let values: Vec<f64> = slice.values().iter().map(|&v| look.channel.of(v)).collect();
        let limit = round_limit(&values, slice.above_horizon());
        let image = image(&slice, |i| colour(Colormap::Sequential, values[i] / limit));
        SlicePanel { image, limit: Some(limit) }
    });
    SliceImages {
        key: request.key,
        panels: [truth.as_ref().map(plain), Some(plain(&mean)), difference, sigma],
    }
}

/// A colour of a map.
pub(crate) fn colour(map: Colormap, t: f64) -> Color32 {
    let [r, g, b] = map.at(t);
    Color32::from_rgb(r, g, b)
}

fn image(slice: &Slice, colour: impl Fn(usize) -> Color32) -> ColorImage {
    let pixels = slice.above_horizon().iter().enumerate();
    let pixels = pixels.map(|(i, &above)| if above { colour(i) } else { BELOW_HORIZON }).collect();
    ColorImage::new([slice.size(); 2], pixels)
}

/// 1, 2 or 5 times a power of ten, at or above the 99th percentile of the absolute values in `mask`; at least 1e-6.
pub(crate) fn round_limit(values: &[f64], mask: &[bool]) -> f64 {
    let finite = values.iter().zip(mask).filter(|&(x, &inside)| inside && x.is_finite());
    let mut sizes: Vec<f64> = finite.map(|(x, _)| x.abs()).collect();
    let at = sizes.len() * 99 / 100;
    let level = if at < sizes.len() { *sizes.select_nth_unstable_by(at, f64::total_cmp).1 } else { 0.0 };
    let level = level.max(1e-6);
    let power = 10.0f64.powf(level.log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().find(|step| step * power >= level * (1.0 - 1e-9)).unwrap_or(10.0);
    step * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_round_and_cover_the_values() {
        let limit = |values: &[f64]| round_limit(values, &vec![true; values.len()]);
        for (x, expected) in [(0.013, 0.02), (0.02, 0.02), (0.4, 0.5), (7.0, 10.0), (0.0, 1e-6)] {
            assert!((limit(&[x]) / expected - 1.0).abs() < 1e-9, "{x}");
        }
        assert!(limit(&[]) > 0.0 && limit(&[f64::NAN, 0.4]) > 0.0);
    }

    #[test]
    fn channels_and_chroma_change_the_colour() {
        let look = SliceLook { gamma: 1.0, ..SliceLook::default() };
        assert_eq!(look.colour([1.0, 0.5, 0.0]), Color32::from_rgb(255, 128, 0));
        let chroma = SliceLook { chroma: true, exposure: -5.0, ..look };
        assert_eq!(chroma.colour([0.2, 0.1, 0.0]), Color32::from_rgb(255, 128, 0));
        let green = SliceLook { channel: Channel::Green, exposure: -1.0, ..look };
        assert_eq!(green.colour([1.0, 0.5, 0.0]), Color32::from_rgb(64, 64, 64));
    }
}
