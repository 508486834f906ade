//! Pictures for people.

mod colormap;
mod panel;
mod picture;
mod slice;

pub use colormap::Colormap;
pub use panel::{Panel, Scale, panel_figure, round_limit, slice_figure, sphere_figure};
pub use picture::{Picture, Rgb8, write_rgba_png};
pub use slice::{Slice, SliceOptions};
