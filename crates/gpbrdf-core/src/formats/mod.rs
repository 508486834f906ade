//! File formats: readers and writers for what the other modules hold.
//!
//! A new format is one file with a reader and a constant [`Format`], and an entry of [`FORMATS`].

mod checksum;
mod cornell;
mod csv;
mod environment;
mod exr;
mod format;
mod merl;
mod model;
#[cfg(test)]
pub(crate) mod mutate;
pub(crate) mod read;
mod rgl;
pub(crate) mod source;

pub use checksum::{sha256_file, sha256_hex};
pub use cornell::read_cornell;
pub use csv::neural::read_neural_csv;
pub use csv::samples::{
    Directions, read_directions_csv, read_samples_csv, write_samples_csv, write_samples_csv_to,
};
pub use environment::read_environment;
pub use exr::image::write_image_exr;
pub use exr::table::{ExrChannels, ExrPart, read_table_exr, write_table_exr, write_table_exr_to};
pub use format::{Format, recognise};
pub use merl::{MERL_BYTES, merl_material_name, read_merl, write_merl, write_merl_to};
pub use rgl::{RglBrdf, read_rgl};
pub use source::{Content, Source};

/// The formats that can be read, in the order in which they are tried.
pub const FORMATS: [&Format; 6] = [
    &rgl::FORMAT,
    &exr::table::FORMAT,
    &model::FORMAT,
    &csv::samples::FORMAT,
    &cornell::FORMAT,
    &merl::FORMAT,
];
