// Running sums of the samples of a pixel.

struct PixelSums {
    // Radiance of the truth.
    truth: vec3f,
    // Samples that hit an object.
    hits: f32,
    // Radiance of the prediction.
    prediction: vec3f,
    // Luminance of the prediction times sigma.
    weighted_sigma: f32,
}
