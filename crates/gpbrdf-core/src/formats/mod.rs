//! File formats: readers and writers for what the other modules hold.
//!
//! A new format is one file with a reader and a constant [`Format`], and an entry of [`FORMATS`].

mod checksum;
mod environment;
mod exr;
mod format;
mod measured;
mod merl;
mod model;
#[cfg(test)]
pub(crate) mod mutate;
mod neural;
mod output;
pub(crate) mod read;
mod rgl;
pub(crate) mod source;
mod texture;

pub use checksum::{sha256_file, sha256_hex};
pub use environment::{is_environment, parse_environment, read_environment, read_linear_image};
pub use exr::image::write_image_exr;
pub use exr::table::{
    ExrChannels, ExrPart, is_table_exr, read_table_exr, write_table_exr, write_table_exr_to,
};
pub use format::{Format, recognise};
pub use measured::cornell::read_cornell;
pub use measured::text::directions::{Directions, parse_directions_csv, read_directions_csv};
pub use measured::text::samples::read_samples_csv;
pub use measured::text::write::{write_samples_csv, write_samples_csv_to};
pub use measured::zemax::{SpecularGrid, SpecularTable, write_zemax, write_zemax_to};
pub use measured::{AngleUnit, ReadOptions, ValueKind, Zenith};
pub use merl::{MERL_BYTES, merl_material_name, read_merl, write_merl, write_merl_to};
pub use neural::{is_neural_csv, read_neural_csv};
pub use output::{OutputFormat, OutputOptions};
pub use rgl::{RglBrdf, RglColours, RglGrid, read_rgl, write_rgl, write_rgl_to};
pub use source::{Content, Source};
pub use texture::{TextureFormat, texels, texture_files, write_texture};

/// The formats that can be read, in the order in which they are tried.
pub const FORMATS: [&Format; 9] = [
    &rgl::FORMAT,
    &exr::table::FORMAT,
    &model::FORMAT,
    &measured::zemax::FORMAT,
    &measured::alta::FORMAT,
    &measured::astm::FORMAT,
    &measured::text::samples::FORMAT,
    &measured::cornell::FORMAT,
    &merl::FORMAT,
];
