//! The panes of the window, one file or folder each.
//!
//! To add a pane, write `x.rs` with a type that implements [`Pane`], and name it twice here: in a `mod` line
//! and in [`all`]. Menu, shortcuts, layout, settings and sessions follow from this list.

mod data;
mod directions;
mod materials;
mod model;
mod plots;
mod slices;
mod three_d;

use super::pane::{Pane, Start};

/// All panes: those at the side from top to bottom, and the views in the order of their keys.
///
/// # Errors
/// The system gives no threads.
pub(crate) fn all(start: &Start) -> std::io::Result<Vec<Box<dyn Pane>>> {
    Ok(vec![
        Box::new(materials::Materials),
        Box::new(model::ModelPane::new(start)),
        Box::new(slices::Slices::new(start)?),
        Box::new(plots::Plots::new(start)?),
        Box::new(three_d::ThreeD::new(start)?),
        Box::new(directions::Directions::new(start)?),
        Box::new(data::Data::default()),
    ])
}
