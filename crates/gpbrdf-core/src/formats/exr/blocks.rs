//! The sizes of blocks that headers of `OpenEXR` files ask for.

use exr::math::Vec2;
use exr::meta::header::Header;

/// The decompressed size of the largest block of all parts, in bytes. A reader of blocks takes as much memory as soon
/// as a block says that it is so large, whatever the size of the file.
pub(crate) fn largest_block(headers: &[Header]) -> usize {
    let bytes = |header: &Header| {
        let Vec2(width, height) = header.max_block_pixel_size();
        width.saturating_mul(height).saturating_mul(header.channels.bytes_per_pixel)
    };
    headers.iter().map(bytes).max().unwrap_or(0)
}

/// A tiled file with another width of its tiles in the header.
#[cfg(test)]
pub(crate) fn with_tile_width(file: &[u8], width: u32) -> Vec<u8> {
    let mut bytes = file.to_vec();
    let name = b"tiles\0tiledesc\0";
    // Name and kind of the attribute are followed by its length.
    let at = bytes.windows(name.len()).position(|window| window == name).unwrap() + name.len() + 4;
    bytes[at..at + 4].copy_from_slice(&width.to_le_bytes());
    bytes
}
