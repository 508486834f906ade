//! Kernels as text for the shader of kernel sums.

use std::fmt::Write as _;

use gpbrdf_core::Shape;
use gpbrdf_core::kernel::{Kernel, KernelBody};

use crate::error::{Error, Result};
use crate::shader;

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

/// A call of the function that has the name of the shape.
fn call(shape: Shape, r2: &str, parameter: &mut impl FnMut(f64) -> String) -> Result<String> {
    let name = shape.name();
    if !shader::has_shape(name) {
        return Err(Error::NoShader { what: format!("the kernel {name}") });
    }
    let alpha = shape.alpha().map_or_else(String::new, |alpha| format!(", {}", parameter(alpha)));
    Ok(format!("{name}({r2}{alpha})"))
}

/// A kernel with every shape that has a shader, for the test of shaders.
#[cfg(test)]
pub(crate) fn every_shape() -> (String, usize) {
    let shapes = Shape::ALL.into_iter().filter(|shape| shader::has_shape(shape.name()));
    let terms = shapes.flat_map(|shape| Kernel::ard(1.0, shape, &[1.0; 3]).terms).collect();
    let kernel = Kernel { terms, ..Kernel::ard(1.0, Shape::Matern52, &[1.0; 3]) };
    let source = KernelSource::new(&kernel).unwrap();
    (source.text, source.parameters.len())
}
