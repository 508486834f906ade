//! Kernels by name: a sum of shapes along each axis.

use std::fmt;
use std::str::FromStr;

use anyhow::{Result, bail};
use gpbrdf_core::Shape;
use serde::{Deserialize, Serialize};

/// The kernel along `theta_h`, `theta_d` and `phi_d`, each a sum of names joined by `+`. As text it is one
/// sum for all axes, or three joined by commas. Off a lattice the first is the kernel of all axes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(crate) struct Kernels([String; 3]);

impl Kernels {
    /// What the command line says about kernels.
    pub(super) fn help() -> String {
        let names = Shape::ALL.map(Shape::name).join(", ");
        format!(
            "Kernel shapes, summed: {names} (with --nu). On a lattice there may be three such sums joined by \
             commas, for theta_h, theta_d and phi_d"
        )
    }

    /// Whether all axes have the same kernel.
    pub(crate) fn are_alike(&self) -> bool {
        let [first, rest @ ..] = &self.0;
        rest.iter().all(|kernel| kernel == first)
    }

    /// The shapes along each axis.
    ///
    /// # Errors
    /// A name that no shape has.
    pub(crate) fn shapes(&self, nu: f64) -> Result<[Vec<Shape>; 3]> {
        let sum = |kernel: &String| {
            kernel.split('+').map(|name| shape(name.trim(), nu)).collect::<Result<Vec<_>>>()
        };
        let [a, b, c] = self.0.each_ref().map(sum);
        Ok([a?, b?, c?])
    }
}

/// The shape of this name; `nu` is the smoothness of `matern`.
fn shape(name: &str, nu: f64) -> Result<Shape> {
    match Shape::from_name(name) {
        Ok(Shape::Matern { .. }) => Ok(Shape::Matern { nu }),
        Ok(shape) => Ok(shape),
        Err(_) => bail!(
            "--kernel: expected shapes out of {} joined by +, found \"{name}\"",
            Shape::ALL.map(Shape::name).join(", ")
        ),
    }
}

impl Default for Kernels {
    fn default() -> Self {
        Self(std::array::from_fn(|_| Shape::Matern52.name().to_owned()))
    }
}

impl FromStr for Kernels {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let axes: Vec<String> = text.split(',').map(|kernel| kernel.trim().to_owned()).collect();
        match <[String; 3]>::try_from(axes) {
            Ok(axes) => Ok(Self(axes)),
            Err(one) if one.len() == 1 => Ok(Self(std::array::from_fn(|_| one[0].clone()))),
            Err(others) => {
                Err(format!("expected one kernel or three joined by commas, found {}", others.len()))
            }
        }
    }
}

impl TryFrom<String> for Kernels {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Kernels> for String {
    fn from(kernels: Kernels) -> Self {
        kernels.to_string()
    }
}

impl fmt::Display for Kernels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.are_alike() { f.write_str(&self.0[0]) } else { f.write_str(&self.0.join(",")) }
    }
}

/// One shape along each axis, as the viewer's lists show and set it.
#[cfg(feature = "viewer")]
impl Kernels {
    /// The shapes to choose from.
    pub(crate) const CHOICES: [Shape; 5] = [
        Shape::Matern52,
        Shape::Matern32,
        Shape::Matern12,
        Shape::SquaredExponential,
        Shape::RationalQuadratic { alpha: 1.0 },
    ];

    /// The kernel along `axis`, if it is one of [`Self::CHOICES`].
    pub(crate) fn choice(&self, axis: usize) -> Option<Shape> {
        let kernel = self.0.get(axis)?;
        Self::CHOICES.into_iter().find(|shape| shape.name() == kernel)
    }

    /// Sets the kernel along `axis`.
    pub(crate) fn set(&mut self, axis: usize, shape: Shape) {
        if let Some(kernel) = self.0.get_mut(axis) {
            shape.name().clone_into(kernel);
        }
    }

    /// Sets the kernel of all axes.
    pub(crate) fn set_all(&mut self, shape: Shape) {
        (0..3).for_each(|axis| self.set(axis, shape));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_kernel_or_three_come_back_as_they_went() {
        for (text, shapes) in [
            ("matern52", [vec![Shape::Matern52], vec![Shape::Matern52], vec![Shape::Matern52]]),
            (
                "se+matern12,rq,matern",
                [
                    vec![Shape::SquaredExponential, Shape::Matern12],
                    vec![Shape::RationalQuadratic { alpha: 1.0 }],
                    vec![Shape::Matern { nu: 2.2 }],
                ],
            ),
        ] {
            let kernels: Kernels = text.parse().unwrap();
            assert_eq!(kernels.to_string(), text);
            assert_eq!(kernels.shapes(2.2).unwrap(), shapes);
            let json = serde_json::to_string(&kernels).unwrap();
            assert_eq!(serde_json::from_str::<Kernels>(&json).unwrap(), kernels);
        }
        assert_eq!(
            "se,rq".parse::<Kernels>().unwrap_err(),
            "expected one kernel or three joined by commas, found 2"
        );
        assert!("se+cubic".parse::<Kernels>().unwrap().shapes(1.0).is_err());
        assert_eq!(Kernels::default().shapes(1.0).unwrap()[0], gpbrdf_core::FitOptions::default().kernel[0]);
    }
}
