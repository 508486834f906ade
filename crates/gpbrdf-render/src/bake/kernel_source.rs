//! Kernels as text for the shader of kernel sums.

use std::fmt::Write as _;

use gpbrdf_core::Shape;
use gpbrdf_core::kernel::{Kernel, KernelBody};

use crate::error::{Error, Result};

/// A kernel as a WGSL function, and the parameters that it reads.
pub(super) struct KernelSource {
    /// `fn kernel(d: vec3<real>) -> real`, which reads `parameters`.
    pub(super) text: String,
    pub(super) parameters: Vec<f64>,
}

impl KernelSource {
    /// # Errors
    /// [`Error::NoShader`] for a shape that the shader does not have.
    pub(super) fn new(kernel: &Kernel) -> Result<Self> {
        let mut parameters = Vec::new();
        let mut parameter = |value: f64| {
            parameters.push(value);
            format!("parameters[{}]", parameters.len() - 1)
        };
        let mut body = String::new();
        for term in &kernel.terms {
            let mut product = parameter(term.variance);
            match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    let scaled: Vec<String> = ["d.x", "d.y", "d.z"]
                        .iter()
                        .zip(length_scale)
                        .map(|(d, l)| format!("{d} * {}", parameter(l.powi(-2))))
                        .collect();
                    let value = call(*shape, &scaled.join(" + "), &mut parameter)?;
                    let _infallible = write!(product, " * {value}");
                }
                KernelBody::Product(axes) => {
                    for (d, axis) in ["d.x", "d.y", "d.z"].iter().zip(axes) {
                        let mut sum = Vec::new();
                        for term in &axis.terms {
                            let weight = parameter(term.weight);
                            let r2 = format!("{d} * {}", parameter(term.length_scale.powi(-2)));
                            sum.push(format!("{weight} * {}", call(term.shape, &r2, &mut parameter)?));
                        }
                        let _infallible = write!(product, " * ({})", sum.join(" + "));
                    }
                }
            }
            let _infallible = writeln!(body, "    k += {product};");
        }
        let text =
            format!("fn kernel(d: vec3<real>) -> real {{\n    var k = real(0.0);\n{body}    return k;\n}}\n");
        Ok(Self { text, parameters })
    }
}

/// A call of the function of a shape in `bake/shapes.wgsl`.
fn call(shape: Shape, r2: &str, parameter: &mut impl FnMut(f64) -> String) -> Result<String> {
    Ok(match shape {
        Shape::SquaredExponential => format!("squared_exponential({r2})"),
        Shape::Matern12 => format!("matern_1_2({r2})"),
        Shape::Matern32 => format!("matern_3_2({r2})"),
        Shape::Matern52 => format!("matern_5_2({r2})"),
        Shape::RationalQuadratic { alpha } => format!("rational_quadratic({r2}, {})", parameter(alpha)),
        other => return Err(Error::NoShader { what: format!("the kernel {}", other.name()) }),
    })
}

/// A kernel with every shape that has a shader, for the test of shaders.
#[cfg(test)]
pub(crate) fn every_shape() -> (String, usize) {
    let shapes = [
        Shape::SquaredExponential,
        Shape::RationalQuadratic { alpha: 1.0 },
        Shape::Matern12,
        Shape::Matern32,
        Shape::Matern52,
    ];
    let mut kernel = Kernel::ard(1.0, shapes[0], &[1.0; 3]);
    kernel.terms.extend(shapes[1..].iter().flat_map(|&shape| Kernel::ard(1.0, shape, &[1.0; 3]).terms));
    let source = KernelSource::new(&kernel).unwrap();
    (source.text, source.parameters.len())
}
