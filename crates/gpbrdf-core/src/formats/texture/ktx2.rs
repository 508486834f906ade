//! The header of a Khronos texture with a volume.
//!
//! Source: The Khronos Group, "KTX File Format Specification", version 2.0, and "Khronos Data Format Specification",
//! version 1.3, for the data format descriptor. Numbers are little-endian.

use crate::formats::texture::{SIZE, TEXEL_BYTES};

const IDENTIFIER: [u8; 12] = *b"\xABKTX 20\xBB\r\n\x1A\n";
/// `VK_FORMAT_R16G16B16A16_SFLOAT`.
const FORMAT: u32 = 97;
/// Bytes of a number.
const TYPE_SIZE: u32 = 2;
/// Bytes of the identifier, the header, the index and the entry of one level.
const INDEX_END: u32 = 12 + 36 + 32 + 24;
/// `KHR_DF_MODEL_RGBSDA`.
const MODEL: u8 = 1;
/// `KHR_DF_PRIMARIES_BT709`.
const PRIMARIES: u8 = 1;
/// `KHR_DF_TRANSFER_LINEAR`.
const LINEAR: u8 = 1;
/// Red, green, blue and alpha of that model.
const CHANNELS: [u8; 4] = [0, 1, 2, 15];
/// `KHR_DF_SAMPLE_DATATYPE_FLOAT | KHR_DF_SAMPLE_DATATYPE_SIGNED`.
const SIGNED_FLOAT: u8 = 0x80 | 0x40;

/// Everything before the texels.
pub(super) fn header() -> Vec<u8> {
    let descriptor = descriptor();
    let values = key_and_value("KTXwriter", concat!("gpbrdf ", env!("CARGO_PKG_VERSION")));
    let length = |bytes: &[u8]| u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    let [width, height, depth] = SIZE;
    let values_start = INDEX_END + length(&descriptor);
    // Texels start at a multiple of their size.
    let texels_start = (values_start + length(&values)).next_multiple_of(TEXEL_BYTES);
    let texels_length = u64::from(width * height * depth) * u64::from(TEXEL_BYTES);

    let mut bytes = IDENTIFIER.to_vec();
    // Layers 0: no array. Faces 1: no cube. One level, no supercompression.
    for word in [FORMAT, TYPE_SIZE, width, height, depth, 0, 1, 1, 0] {
        bytes.extend(word.to_le_bytes());
    }
    for word in [INDEX_END, length(&descriptor), values_start, length(&values)] {
        bytes.extend(word.to_le_bytes());
    }
    for long in [0, 0, u64::from(texels_start), texels_length, texels_length] {
        bytes.extend(long.to_le_bytes());
    }
    bytes.extend(descriptor);
    bytes.extend(values);
    bytes.resize(texels_start as usize, 0);
    bytes
}

/// The data format descriptor: one basic block with a sample for each channel.
fn descriptor() -> Vec<u8> {
    let block: u16 = 24 + 16 * 4;
    let mut bytes = (u32::from(block) + 4).to_le_bytes().to_vec();
    // Khronos, basic descriptor.
    bytes.extend([0; 4]);
    // KHR_DF_VERSIONNUMBER_1_3.
    bytes.extend(2u16.to_le_bytes());
    bytes.extend(block.to_le_bytes());
    bytes.extend([MODEL, PRIMARIES, LINEAR, 0]);
    // Blocks of one texel, which is in one plane.
    bytes.extend([0; 4]);
    bytes.extend([8, 0, 0, 0, 0, 0, 0, 0]);
    for (channel, offset) in CHANNELS.into_iter().zip([0u16, 16, 32, 48]) {
        bytes.extend(offset.to_le_bytes());
        bytes.extend([15, channel | SIGNED_FLOAT]);
        bytes.extend([0; 4]);
        bytes.extend((-1f32).to_le_bytes());
        bytes.extend(1f32.to_le_bytes());
    }
    bytes
}

/// One entry of the key and value data, padded to a multiple of 4 bytes.
fn key_and_value(key: &str, value: &str) -> Vec<u8> {
    let text = format!("{key}\0{value}\0");
    let mut bytes = u32::try_from(text.len()).unwrap_or(u32::MAX).to_le_bytes().to_vec();
    bytes.extend(text.into_bytes());
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}
