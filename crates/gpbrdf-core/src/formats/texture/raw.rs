//! Texels as a NumPy array, and a description of texels alone.

use std::path::Path;

use serde_json::json;

use crate::formats::texture::{SIZE, TEXEL_BYTES};

/// The header of a NumPy array, version 1.0, whose length is a multiple of 64 bytes. Source: the module
/// `numpy.lib.format`.
pub(super) fn npy_header() -> Vec<u8> {
    let [width, height, depth] = SIZE;
    let mut text =
        format!("{{'descr': '<f2', 'fortran_order': False, 'shape': ({depth}, {height}, {width}, 4), }}");
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes());
    bytes.extend(text.into_bytes());
    bytes
}

/// What is in the file `path` of texels alone, as JSON.
pub(super) fn layout(path: &Path) -> String {
    let [width, height, depth] = SIZE;
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let layout = json!({
        "file": name,
        "bytes": width * height * depth * TEXEL_BYTES,
        "type": "float16",
        "byte_order": "little",
        "shape": [depth, height, width, 4],
        "axes": [
            { "name": "phi_d", "texture": "z", "coordinate": "phi_d / pi", "address": "repeat" },
            { "name": "theta_d", "texture": "y", "coordinate": "theta_d / (pi/2)", "address": "clamp" },
            { "name": "theta_h", "texture": "x", "coordinate": "sqrt(theta_h / (pi/2))", "address": "clamp" },
            { "name": "channel", "order": ["red", "green", "blue", "sigma"] },
        ],
        "values": "BRDF in 1/sr without the cosine, linear sRGB; sigma is the standard deviation of the target or 0",
        "sampling": "linear; the coordinate of texel i of n is (i + 1/2) / n",
    });
    format!("{layout:#}\n")
}
