//! Scattered measurements of instruments, as text.
//!
//! Each format turns its rows into directions and values; what is the same for all of them is here: how a file
//! is to be read where it does not say so ([`ReadOptions`]), which values are accepted and what becomes of them
//! (`collector`), spectra as colours (`spectrum`) and units of angles (`unit`).

pub(crate) mod alta;
pub(crate) mod astm;
mod collector;
pub(crate) mod cornell;
mod input;
mod lines;
mod options;
pub(crate) mod spectrum;
pub(crate) mod text;
mod unit;
pub(crate) mod zemax;

pub(crate) use input::Input;
pub use options::{AngleUnit, ReadOptions, ValueKind, Zenith};
pub(crate) use spectrum::SRGB_FROM_XYZ;
