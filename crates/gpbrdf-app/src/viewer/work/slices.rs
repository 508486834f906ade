//! Slices of truth, prediction, difference and sigma in colour, made on a thread of their own.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use eframe::egui::{Color32, ColorImage};
use gpbrdf_core::brdf::GRAZING_COSINE;
use gpbrdf_core::figure::round_limit;
use gpbrdf_core::figure::{Colormap, Slice, SliceOptions};
use gpbrdf_core::sample::log_value;
use gpbrdf_core::{Brdf, BrdfTable, HalfDiff, Rgb, Source};

use crate::viewer::state::document::{Document, DocumentId};
use crate::viewer::state::look::{Channel, SliceLook};

use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;

/// The colour of directions below the horizon.
const BELOW_HORIZON: Color32 = Color32::from_rgb(58, 58, 64);

impl SliceLook {
    /// The colour that shows a value.
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
pub(crate) enum Truth {
    Table(Arc<BrdfTable>),
    /// The source itself, until it has been tabulated.
    Source(Arc<Source>),
}

impl Truth {
    /// The truth of a material; `None` where its source cannot be evaluated.
    pub(crate) fn of(document: &Document) -> Option<Self> {
        match (&document.truth, document.source_is_truth()) {
            (Some(table), _) => Some(Self::Table(Arc::clone(table))),
            (None, true) => Some(Self::Source(Arc::clone(&document.source))),
            (None, false) => None,
        }
    }

    /// What can be evaluated.
    pub(crate) fn brdf(&self) -> Option<&dyn Brdf> {
        match self {
            Self::Table(table) => Some(table.as_ref()),
            Self::Source(source) => source.brdf().ok(),
        }
    }
}

/// What slices depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SliceKey {
    pub(crate) document: DocumentId,
    pub(crate) version: u64,
    pub(crate) look: SliceLook,
    pub(crate) truth_is_tabulated: bool,
    pub(crate) has_sigma: bool,
}

/// Slices to make.
#[derive(Clone, Debug)]
pub(crate) struct SliceRequest {
    pub(crate) key: SliceKey,
    pub(crate) truth: Option<Truth>,
    pub(crate) mean: Arc<BrdfTable>,
    pub(crate) sigma: Option<Arc<BrdfTable>>,
}

/// One slice in colour.
#[derive(Clone, Debug)]
pub(crate) struct SliceImage {
    pub(crate) image: ColorImage,
    /// The value at the end of the scale, where the colours are false colours.
    pub(crate) limit: Option<f64>,
}

/// Truth, prediction, difference, sigma.
#[derive(Clone, Debug)]
pub(crate) struct SliceImages {
    pub(crate) key: SliceKey,
    pub(crate) slices: [Option<SliceImage>; 4],
}

/// Starts the thread that makes slices. It has a thread pool of its own, because the shared one may be busy
/// with a fit for seconds.
pub(crate) fn spawn(outbox: Outbox<Box<SliceImages>>) -> std::io::Result<Sender<SliceRequest>> {
    let pool = rayon::ThreadPoolBuilder::new().build().map_err(std::io::Error::other)?;
    Mailbox::spawn("slices", move |request: SliceRequest, stale| {
        let images = pool.install(|| make(&request));
        if !stale() {
            outbox.send(Box::new(images));
        }
    })
}

/// Makes slices, in some 20 ms. The difference is prediction minus truth in logarithms, averaged over the
/// shown channels: `ln(prediction + 0.001) - ln(truth + 0.001)`, with negative values taken as 0.
pub(crate) fn make(request: &SliceRequest) -> SliceImages {
    let look = request.key.look;
    let options = look.options();
    let (truth, (mean, sigma)) = rayon::join(
        || request.truth.as_ref().and_then(Truth::brdf).map(|brdf| Slice::new(brdf, &options)),
        || {
            rayon::join(
                || Slice::new(request.mean.as_ref(), &options),
                || request.sigma.as_ref().map(|table| Slice::new(table.as_ref(), &options)),
            )
        },
    );
    let counted = counted(&options);
    let plain =
        |slice: &Slice| SliceImage { image: image(slice, |i| look.colour(slice.values()[i])), limit: None };
    let difference = truth.as_ref().map(|truth| {
        let gap: Vec<f64> = std::iter::zip(mean.values(), truth.values())
            .map(|(a, b)| look.channel.of(std::array::from_fn(|c| log_value(a[c]) - log_value(b[c]))))
            .collect();
        let limit = round_limit(&gap, &counted);
        let image = image(truth, |i| colour(Colormap::Diverging, 0.5 + 0.5 * gap[i] / limit));
        SliceImage { image, limit: Some(limit) }
    });
    let sigma = sigma.map(|slice| {
        let values: Vec<f64> = slice.values().iter().map(|&v| look.channel.of(v)).collect();
        let limit = round_limit(&values, &counted);
        let image = image(&slice, |i| colour(Colormap::Sequential, values[i] / limit));
        SliceImage { image, limit: Some(limit) }
    });
    SliceImages {
        key: request.key,
        slices: [truth.as_ref().map(plain), Some(plain(&mean)), difference, sigma],
    }
}

/// Whether each pixel of a slice counts for the ends of scales: those of the image metrics do, where both cosines are
/// at least [`GRAZING_COSINE`]. A row of cells beyond them would make all others look alike.
fn counted(options: &SliceOptions) -> Vec<bool> {
    let size = options.size;
    let share = |i: usize| (i as f64 + 0.5) / size as f64;
    let is_counted = |i: usize| {
        let x = share(i % size);
        let theta_h = FRAC_PI_2 * if options.square_theta_h { x * x } else { x };
        let theta_d = FRAC_PI_2 * (1.0 - share(i / size));
        let (cos_i, cos_o) = HalfDiff { theta_h, theta_d, phi_d: options.phi_d }.cosines();
        cos_i.min(cos_o) >= GRAZING_COSINE
    };
    (0..size * size).map(is_counted).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grazing_row_does_not_set_the_scale() {
        let table = |odd: f64| {
            BrdfTable::from_fn(|a: HalfDiff| if a.theta_h > 1.5 { [0.1 * odd; 3] } else { [0.1; 3] })
        };
        let key = SliceKey {
            document: DocumentId(0),
            version: 0,
            look: SliceLook::default(),
            truth_is_tabulated: true,
            has_sigma: false,
        };
        let truth = Some(Truth::Table(Arc::new(table(1.0))));
        let request = SliceRequest { key, truth, mean: Arc::new(table(2e4)), sigma: None };
        let difference = make(&request).slices[2].clone().unwrap();
        assert!(difference.limit.unwrap() < 0.01, "{:?}", difference.limit);
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
