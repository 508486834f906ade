//! Luminance of colours.

/// `shared/colour.wgsl` has the same.
pub(crate) use gpbrdf_core::brdf::LUMINANCE_WEIGHTS;

/// Luminance of linear sRGB.
pub(crate) fn luminance(rgb: &[f32; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    let [wr, wg, wb] = LUMINANCE_WEIGHTS;
    wr * r + wg * g + wb * b
}
