//! Structural similarity of two images.

/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;
/// Half of the window's 11 pixels.
const RADIUS: usize = 5;
/// `(K1 L)^2` with `K1 = 0.01` and a range `L` of 1.
const C1: f64 = 0.01 * 0.01;
/// `(K2 L)^2` with `K2 = 0.03`.
const C2: f64 = 0.03 * 0.03;

/// Mean structural similarity of two planes of values in `[0, 1]` over the pixels in `mask`:
/// `(2 mx my + C1) (2 sxy + C2) / ((mx^2 + my^2 + C1) (sx^2 + sy^2 + C2))` with means, variances and
/// covariance under an 11 x 11 Gaussian window of standard deviation 1.5.
///
/// Source: Z. Wang, A. C. Bovik, H. R. Sheikh and E. P. Simoncelli, "Image Quality Assessment: From Error
/// Visibility to Structural Similarity" (2004), eq. 13, with `K1 = 0.01` and `K2 = 0.03`. Parts of a window
/// beyond the frame are taken as 0. The result is 1 if the mask is empty. The lengths of `a`, `b` and `mask`
/// are the same multiple of `width`.
pub(crate) fn mean_ssim(a: &[f64], b: &[f64], mask: &[bool], width: usize) -> f64 {
    let product = |x: &[f64], y: &[f64]| -> Vec<f64> { x.iter().zip(y).map(|(x, y)| x * y).collect() };
    let mean_a = blur(a, width);
    let mean_b = blur(b, width);
    let square_a = blur(&product(a, a), width);
    let square_b = blur(&product(b, b), width);
    let cross = blur(&product(a, b), width);
    let (mut sum, mut count) = (0.0, 0usize);
    for i in 0..mask.len().min(a.len()).min(b.len()) {
        if mask[i] {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let variances = square_a[i] - ma * ma + square_b[i] - mb * mb;
            let covariance = cross[i] - ma * mb;
            sum += (2.0 * ma * mb + C1) * (2.0 * covariance + C2)
                / ((ma * ma + mb * mb + C1) * (variances + C2));
            count += 1;
        }
    }
    if count == 0 { 1.0 } else { sum / count as f64 }
}

/// Convolution with the window; the plane is zero outside of the frame.
fn blur(plane: &[f64], width: usize) -> Vec<f64> {
    let mut window: [f64; 2 * RADIUS + 1] = std::array::from_fn(|i| {
        let x = i as f64 - RADIUS as f64;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp()
    });
    let total: f64 = window.iter().sum();
    window = window.map(|w| w / total);
    let height = plane.len().checked_div(width).unwrap_or(0);
    let pass = |source: &[f64], along_x: bool| -> Vec<f64> {
        let (limit, step) = if along_x { (width, 1) } else { (height, width) };
        (0..source.len())
            .map(|i| {
                let here = if along_x { i % width } else { i / width };
                let first = here.saturating_sub(RADIUS);
                let last = (here + RADIUS).min(limit - 1);
                (first..=last).map(|j| window[j + RADIUS - here] * source[i + j * step - here * step]).sum()
            })
            .collect()
    };
    pass(&pass(plane, true), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mask of the pixels whose window is within a frame of 24 x 24 pixels.
    fn interior() -> Vec<bool> {
        (0..24 * 24).map(|i| (5..19).contains(&(i % 24)) && (5..19).contains(&(i / 24))).collect()
    }

    #[test]
    fn identical_planes_have_one_and_constant_ones_the_luminance_term() {
        let a: Vec<f64> = (0..576).map(|i| (f64::from(i) * 0.618_034).fract()).collect();
        assert!((mean_ssim(&a, &a, &[true; 576], 24) - 1.0).abs() < 1e-12);
        let (x, y) = (0.5, 0.6);
        let found = mean_ssim(&[x; 576], &[y; 576], &interior(), 24);
        // Computed by hand: (2 * 0.5 * 0.6 + 1e-4) / (0.25 + 0.36 + 1e-4).
        assert!((found - 0.600_1 / 0.610_1).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_texture_against_its_mirror_image_about_the_mean_is_dissimilar() {
        // Window and pattern are symmetric: the blurred means are 1/2 in both, up to the ripple of the
        // window.
        let a: Vec<f64> = (0..576).map(|i| if (i % 24 + i / 24) % 2 == 0 { 0.7 } else { 0.3 }).collect();
        let b: Vec<f64> = a.iter().map(|x| 1.0 - x).collect();
        let found = mean_ssim(&a, &b, &interior(), 24);
        // Variances 0.04 each and covariance -0.04: (C2 - 0.08) / (C2 + 0.08).
        assert!((found - (9e-4 - 0.08) / (9e-4 + 0.08)).abs() < 1e-3, "{found}");
    }

    #[test]
    fn the_window_is_the_two_dimensional_gaussian() {
        let mut dot = vec![0.0; 576];
        dot[12 * 24 + 12] = 1.0;
        let spread = blur(&dot, 24);
        let ratio = spread[13 * 24 + 14] / spread[12 * 24 + 12];
        assert!((ratio - (-5.0f64 / 4.5).exp()).abs() < 1e-12);
        assert!((spread.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(spread[12 * 24 + 18], 0.0);
    }
}
