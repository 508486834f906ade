//! Kernels by name: a sum of shapes along each axis.

use std::fmt;
use std::str::FromStr;

use anyhow::{Result, bail};
use gpbrdf_core::Shape;
use serde::{Deserialize, Serialize};

/// The shapes and their names; `matern` has the smoothness of `--nu`.
const SHAPES: [(&str, Shape); 6] = [
    ("se", Shape::SquaredExponential),
    ("rq", Shape::RationalQuadratic { alpha: 1.0 }),
    ("matern12", Shape::Matern12),
    ("matern32", Shape::Matern32),
    ("matern52", Shape::Matern52),
    ("matern", Shape::Matern { nu: 1.5 }),
];

/// The kernel along `theta_h`, `theta_d` and `phi_d`, each a sum of names joined by `+`. As text it is one
/// sum for all axes, or three joined by commas. Off a lattice the first is the kernel of all axes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(crate) struct Kernels([String; 3]);

impl Kernels {
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

fn shape(name: &str, nu: f64) -> Result<Shape> {
    match SHAPES.iter().find(|(of, _)| *of == name) {
        Some((_, Shape::Matern { .. })) => Ok(Shape::Matern { nu }),
        Some((_, shape)) => Ok(*shape),
        None => bail!(
            "--kernel: expected shapes out of {} joined by +, found \"{name}\"",
            SHAPES.map(|(name, _)| name).join(", ")
        ),
    }
}

impl Default for Kernels {
    fn default() -> Self {
        Self(std::array::from_fn(|_| "matern52".to_owned()))
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

/// What the viewer's lists show and set: one shape along each axis.
#[cfg(feature = "viewer")]
impl Kernels {
    /// The names to choose from.
    pub(crate) const NAMES: [&'static str; 5] = ["matern52", "matern32", "matern12", "se", "rq"];

    /// The name of a shape for people.
    pub(crate) fn label(name: &str) -> &'static str {
        match name {
            "se" => "Squared exponential",
            "rq" => "Rational quadratic",
            "matern12" => "Matérn 1/2",
            "matern32" => "Matérn 3/2",
            "matern52" => "Matérn 5/2",
            _ => "A sum",
        }
    }

    /// The name of the kernel along `axis`, if it is one of [`Self::NAMES`].
    pub(crate) fn name(&self, axis: usize) -> Option<&'static str> {
        let kernel = self.0.get(axis)?;
        Self::NAMES.into_iter().find(|name| name == kernel)
    }

    /// Sets the kernel along `axis`.
    pub(crate) fn set(&mut self, axis: usize, name: &str) {
        if let Some(kernel) = self.0.get_mut(axis) {
            name.clone_into(kernel);
        }
    }

    /// Sets the kernel of all axes.
    pub(crate) fn set_all(&mut self, name: &str) {
        (0..3).for_each(|axis| self.set(axis, name));
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
        assert_eq!(Kernels::default().shapes(1.0).unwrap()[0], gpbrdf_core::FitOptions::default().kernel);
    }
}
