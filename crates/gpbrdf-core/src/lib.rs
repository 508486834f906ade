//! Gaussian-process BRDFs.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::float_cmp, reason = "tests state exact expectations"))]

mod angles;
mod atomic_file;
mod brdf;
mod error;
mod formats;
mod samples;
mod spectrum;
mod table;
#[cfg(test)]
mod test_data;

pub use angles::{BoxPoint, HalfDiff, direction, fold_phi_d, theta_d_max};
pub use atomic_file::{AtomicFile, PendingRemoved, remove_pending};
pub use brdf::{Brdf, Reciprocal, Rgb};
pub use error::{Error, Result};
pub use formats::cornell::read_cornell;
pub use formats::merl::{MERL_BYTES, read_merl, write_merl, write_merl_to};
pub use formats::merl_sha256::merl_material_name;
pub use formats::rgl::{RglBrdf, read_rgl};
pub use formats::samples_csv::{
    Directions, read_directions_csv, read_samples_csv, write_samples_csv, write_samples_csv_to,
};
pub use formats::table_exr::{ExrChannels, ExrPart, read_table_exr, write_table_exr, write_table_exr_to};
pub use formats::{FileKind, recognise, sha256_file, sha256_hex};
pub use samples::{Sample, Samples};
pub use table::{
    BrdfTable, N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H, Trilinear, cell_center, cell_index, cell_indices,
};
