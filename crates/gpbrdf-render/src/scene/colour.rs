//! Luminance of colours.

/// Weights of red, green and blue in the luminance of linear sRGB (ITU-R BT.709). `shared/colour.wgsl` has
/// the same.
pub(crate) const LUMINANCE_WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance of linear sRGB.
pub(crate) fn luminance(rgb: &[f32; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    let [wr, wg, wb] = LUMINANCE_WEIGHTS;
    wr * r + wg * g + wb * b
}
