//! What a figure consists of: pictures with axes or a scale, and plots.

use crate::base::number::short;
use crate::figure::axis::{Axis, minus};
use crate::figure::colormap::Colormap;
use crate::figure::picture::Picture;
use crate::figure::plot::Plot;

/// The meaning of false colours, drawn as a bar beside the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The colours.
    pub map: Colormap,
    /// The value of the lowest colour.
    pub low: f64,
    /// The value of the highest colour.
    pub high: f64,
}

/// One part of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The text above it.
    pub caption: String,
    /// What it shows.
    pub body: Body,
}

/// What a panel shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// A picture.
    Picture {
        /// Its pixels.
        picture: Picture,
        /// The axes along its bottom and its left, if its sides are quantities.
        axes: Option<[Axis; 2]>,
        /// The meaning of its colours if they are false ones.
        scale: Option<Scale>,
    },
    /// Curves.
    Plot {
        /// The curves and their axes.
        plot: Plot,
        /// Height of the frame as a part of its width.
        aspect: f64,
    },
}

impl Panel {
    /// A picture as it is.
    #[must_use]
    pub fn picture(caption: impl Into<String>, picture: Picture) -> Self {
        Self { caption: caption.into(), body: Body::Picture { picture, axes: None, scale: None } }
    }

    /// A picture in false colours.
    #[must_use]
    pub fn scaled(caption: impl Into<String>, picture: Picture, scale: Scale) -> Self {
        Self { caption: caption.into(), body: Body::Picture { picture, axes: None, scale: Some(scale) } }
    }

    /// Curves in a frame, `aspect` times as high as wide.
    #[must_use]
    pub fn plot(caption: impl Into<String>, plot: Plot, aspect: f64) -> Self {
        Self { caption: caption.into(), body: Body::Plot { plot, aspect } }
    }

    /// The same panel with axes, if it shows a picture.
    pub(super) fn with_axes(mut self, of: [Axis; 2]) -> Self {
        if let Body::Picture { axes, .. } = &mut self.body {
            *axes = Some(of);
        }
        self
    }
}

impl Body {
    /// Height as a part of the width.
    pub(super) fn aspect(&self) -> f64 {
        match self {
            Self::Picture { picture, .. } => picture.height() as f64 / picture.width().max(1) as f64,
            Self::Plot { aspect, .. } => *aspect,
        }
    }
}

impl Scale {
    /// A scale of signed values, red where they are positive.
    #[must_use]
    pub fn signed(limit: f64) -> Self {
        Self { map: Colormap::Diverging, low: -limit, high: limit }
    }

    /// The labels of `count` ticks, from the top down.
    pub(super) fn labels(&self, count: usize) -> Vec<String> {
        let steps = count.saturating_sub(1).max(1) as f64;
        let label = |i: usize| {
            let value = self.high + (self.low - self.high) * i as f64 / steps;
            let sign = if self.low < 0.0 && value > 0.0 { "+" } else { "" };
            format!("{sign}{}", minus(short(value, 3)))
        };
        (0..count).map(label).collect()
    }
}
