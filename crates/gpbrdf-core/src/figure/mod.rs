//! Figures and pictures for people.

mod colormap;
mod panel;
mod picture;
mod scale;
mod slice;

pub use colormap::Colormap;
pub use panel::{Panel, Scale, panel_figure, slice_figure, sphere_figure};
pub use picture::{Picture, Rgb8, write_rgba_png};
pub use scale::round_limit;
pub use slice::{Slice, SliceOptions};
