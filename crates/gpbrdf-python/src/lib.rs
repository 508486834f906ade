//! The Python package `gpbrdf`: Gaussian-process BRDFs with arrays of `NumPy` in and out.
//!
//! Classes hold what the core holds; functions take and return arrays. Directions are unit vectors in the local frame,
//! whose normal is `+z`, as rows of an array of shape `(n, 3)`. The interpreter's lock is released during work. What
//! users read is in the doc comments of the Python items and in `gpbrdf.pyi`.
#![allow(
    clippy::doc_markdown,
    clippy::missing_errors_doc,
    reason = "doc comments of Python items are plain text"
)]
#![allow(clippy::needless_pass_by_value, reason = "arguments of Python items are owned")]

mod arrays;
mod baked;
mod error;
mod functions;
mod material;
mod model;
mod names;
mod planned;
mod samples;
mod source;
mod work;

/// A complete, render-ready material from few reflectance measurements, with an honest error bar.
///
/// Directions are unit vectors with the surface normal along +z: wi points to the light, wo to the viewer. Many of them
/// are the rows of an array of shape (n, 3). Values are the BRDF f in 1/sr, without the cosine. Half-difference angles
/// are rows (theta_h, theta_d, phi_d) in radians; the angles of instruments are in degrees.
#[pyo3::pymodule]
mod gpbrdf {
    #[pymodule_export]
    use super::baked::Baked;
    #[pymodule_export]
    use super::functions::{built_in_materials, direction, fit, half_difference, plan};
    #[pymodule_export]
    use super::material::Material;
    #[pymodule_export]
    use super::model::{Model, Prediction};
    #[pymodule_export]
    use super::planned::Plan;
    #[pymodule_export]
    use super::samples::Samples;
    #[pymodule_export]
    use super::source::Source;

    /// The version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "the name that Python gives it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
