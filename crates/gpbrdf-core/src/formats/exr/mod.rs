//! `OpenEXR`: baked tables, and pictures.

pub(crate) mod blocks;
pub(crate) mod image;
pub(crate) mod table;

/// Bytes at the start of an `OpenEXR` file.
pub(crate) const MAGIC: &[u8] = &[0x76, 0x2F, 0x31, 0x01];
