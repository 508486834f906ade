//! Figures and pictures for people.
//!
//! A [`Figure`] is laid out once for its width and then written as PNG, SVG or PDF by the same shapes.

mod axis;
mod bitmap;
mod colormap;
mod comparison;
mod drawing;
mod font;
mod page;
mod panel;
mod pdf;
mod picture;
mod plot;
mod scale;
mod sheet;
mod slice;
mod style;
mod svg;
#[cfg(test)]
mod tests;
mod text;

pub use axis::{Axis, AxisScale};
pub use colormap::Colormap;
pub use comparison::{slice_figure, sphere_figure};
pub use panel::{Body, Panel, Scale};
pub use picture::{Picture, Rgb8, write_moving_png, write_rgba_png};
pub use plot::{Curve, Plot};
pub use scale::{round_limit, round_step};
pub use sheet::{Figure, FigureFormat, FigureOptions, Row};
pub use slice::{Slice, SliceOptions};
