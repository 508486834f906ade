//! The header of a DirectDraw surface with a volume.
//!
//! Source: Microsoft, "Programming Guide for DDS": the magic number, `DDS_HEADER` and `DDS_HEADER_DXT10`, all of
//! little-endian 32-bit words.

use crate::formats::texture::{SIZE, TEXEL_BYTES};

/// `DDSD_CAPS | DDSD_HEIGHT | DDSD_WIDTH | DDSD_PITCH | DDSD_PIXELFORMAT | DDSD_DEPTH`.
const FLAGS: u32 = 0x1 | 0x2 | 0x4 | 0x8 | 0x1000 | 0x80_0000;
/// `DDPF_FOURCC`.
const FOUR_CC: u32 = 0x4;
/// `DDSCAPS_TEXTURE`: one level.
const TEXTURE: u32 = 0x1000;
/// `DDSCAPS2_VOLUME`.
const VOLUME: u32 = 0x20_0000;
/// `DXGI_FORMAT_R16G16B16A16_FLOAT`.
const FORMAT: u32 = 10;
/// `D3D10_RESOURCE_DIMENSION_TEXTURE3D`.
const DIMENSION_3D: u32 = 4;
/// `DDS_ALPHA_MODE_CUSTOM`: alpha is no opacity.
const ALPHA_CUSTOM: u32 = 4;

/// The 148 bytes before the texels.
pub(super) fn header() -> Vec<u8> {
    let [width, height, depth] = SIZE;
    let mut words = vec![124, FLAGS, height, width, width * TEXEL_BYTES, depth, 1];
    words.extend([0; 11]);
    words.extend([32, FOUR_CC, u32::from_le_bytes(*b"DX10"), 0, 0, 0, 0, 0]);
    words.extend([TEXTURE, VOLUME, 0, 0, 0]);
    words.extend([FORMAT, DIMENSION_3D, 0, 1, ALPHA_CUSTOM]);
    let mut bytes = b"DDS ".to_vec();
    bytes.extend(words.into_iter().flat_map(u32::to_le_bytes));
    bytes
}
