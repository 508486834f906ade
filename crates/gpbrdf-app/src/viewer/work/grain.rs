//! Takes the grain of few samples out of a picture.

use eframe::egui::{Color32, ColorImage};
use rayon::prelude::*;

/// Pixels around each one, on each side.
const RADIUS: usize = 3;
/// Standard deviation of the weights over pixels.
const NEAR: f32 = 1.7;
/// Standard deviation of the weights over colours, of 255 levels: well above the grain and below an edge.
const ALIKE: f32 = 26.0;

/// A picture without grain: each pixel inside of the object becomes the mean of those around it, with larger weights
/// where they are near and of a similar colour, so that edges and highlights stay (C. Tomasi and R. Manduchi,
/// "Bilateral Filtering for Gray and Color Images", 1998). Pixels outside neither change nor take part. Cost: 49
/// weights for each pixel.
pub(crate) fn without_grain(picture: &ColorImage, inside: &[bool]) -> ColorImage {
    let [width, height] = picture.size;
    let pixels = (0..width * height).into_par_iter().map(|at| {
        if !inside.get(at).is_some_and(|inside| *inside) {
            return picture.pixels[at];
        }
        let own = channels(picture.pixels[at]);
        let (column, row) = (at % width, at / width);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for y in row.saturating_sub(RADIUS)..(row + RADIUS + 1).min(height) {
            for x in column.saturating_sub(RADIUS)..(column + RADIUS + 1).min(width) {
                let other = y * width + x;
                if !inside[other] {
                    continue;
                }
                let colour = channels(picture.pixels[other]);
                let gap: f32 = std::iter::zip(own, colour).map(|(a, b)| (a - b) * (a - b)).sum::<f32>() / 3.0;
                let way = squared(x.abs_diff(column)) + squared(y.abs_diff(row));
                let weight = (-0.5 * (way / (NEAR * NEAR) + gap / (ALIKE * ALIKE))).exp();
                for c in 0..3 {
                    sum[c] += weight * colour[c];
                }
                total += weight;
            }
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of bytes")]
        let [r, g, b] = sum.map(|x: f32| (x / total).round() as u8);
        Color32::from_rgb(r, g, b)
    });
    ColorImage::new(picture.size, pixels.collect())
}

fn channels(colour: Color32) -> [f32; 3] {
    [colour.r(), colour.g(), colour.b()].map(f32::from)
}

#[expect(clippy::cast_precision_loss, reason = "a few pixels")]
fn squared(pixels: usize) -> f32 {
    (pixels * pixels) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpbrdf_core::base::SplitMix64;

    #[test]
    fn grain_goes_and_edges_and_what_is_outside_stay() {
        let mut dice = SplitMix64::new(3);
        let (width, height) = (40, 30);
        // Two halves with grain, and a frame outside.
        let is_outside = |i: usize| i < width;
        let level = |i: usize| if i % width < 20 { 60.0 } else { 180.0 };
        let grain: Vec<f64> = (0..width * height).map(|_| 30.0 * (dice.next_unit() - 0.5)).collect();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bytes")]
        let pixel = |i: usize| Color32::from_gray((level(i) + grain[i]) as u8);
        let noisy = ColorImage::new([width, height], (0..width * height).map(pixel).collect());
        let inside: Vec<bool> = (0..width * height).map(|i| !is_outside(i)).collect();
        let clean = without_grain(&noisy, &inside);
        let deviation = |picture: &ColorImage| {
            let pixels = picture.pixels.iter().enumerate().filter(|(i, _)| !is_outside(*i));
            let squares: Vec<f64> = pixels.map(|(i, p)| (f64::from(p.r()) - level(i)).powi(2)).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        // An edge that moved or blurred would alone make more than that.
        assert!(deviation(&clean) < 0.4 * deviation(&noisy), "{} {}", deviation(&clean), deviation(&noisy));
        assert_eq!(clean.pixels[..width], noisy.pixels[..width]);
    }
}
