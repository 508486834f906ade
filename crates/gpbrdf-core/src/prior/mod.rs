//! What other materials tell about a material that is measured: the mean and the principal functions of a library
//! of reflectances.

mod colour;
mod file;
#[cfg(feature = "fit")]
mod learn;
mod span;

pub use colour::Colour;
#[cfg(feature = "fit")]
pub(crate) use colour::to_opponent;
pub(crate) use colour::{OPPONENT, from_opponent, variance_of_channels};
pub(crate) use file::PriorHeader;
#[cfg(feature = "fit")]
pub use learn::{LearnOptions, Library, learn};
pub(crate) use span::{SPACE, Span};

use std::sync::{Arc, OnceLock};

use crate::base::error::{Error, Result};
use crate::base::simd::add_scaled;
use crate::brdf::angles::HalfDiff;
use crate::sample::LOG_EPSILON;
use crate::sample::Transform;

/// A prior of `ln(f + 1e-3)`, learned from a library of materials.
///
/// The logarithms of the three channels are rotated into one achromatic and two chromatic colours ([`Colour`]).
/// The achromatic one is `m(x) + sum_k z_k B_k(x) + r(x)` with `z_k ~ N(0, 1)`: the library's mean `m`, its
/// principal functions `B_k`, each times its standard deviation over the library, and a rest `r`. The chromatic
/// ones have functions of their own and no mean. With a stationary process as the rest, every colour is a Gaussian
/// process with the covariance `B(x)^T B(x') + k(x, x')`.
///
/// Functions are sums of kernels about a thousand directions. They are smooth and, like every isotropic, reciprocal
/// and bilateral reflectance, do not depend on `phi_d` where it has no meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// The name by which reports call it.
    pub name: String,
    /// Names of the materials of the library.
    pub materials: Vec<String>,
    span: Span,
    /// `m`.
    mean: Functions,
    /// The functions of the achromatic and of the chromatic colours.
    functions: [Functions; 2],
    /// Standard deviation of what they leave of a material that is not in the library.
    left: [f64; 2],
}

/// Functions of a span.
#[derive(Clone, Debug, PartialEq)]
struct Functions {
    /// The constant of each function.
    constants: Vec<f64>,
    /// The coefficients of the centres, one column per function.
    coefficients: Vec<f64>,
}

impl Functions {
    fn count(&self) -> usize {
        self.constants.len()
    }

    /// Values at directions, one row per direction.
    fn values(&self, span: &Span, angles: &[HalfDiff]) -> Vec<f64> {
        if self.count() == 0 {
            return Vec::new();
        }
        let mut values = span.values(&self.coefficients, angles);
        for row in values.chunks_mut(self.count()) {
            row.iter_mut().zip(&self.constants).for_each(|(value, constant)| *value += constant);
        }
        values
    }
}

impl Prior {
    /// The transform of its targets.
    pub const TRANSFORM: Transform = Transform::Log { epsilon: LOG_EPSILON };

    /// SHA-256 sum of the file of [`Prior::built_in`].
    pub const BUILT_IN_SHA256: &str = "0";

    /// The prior that comes with this crate. `assets/README.md` names its sources.
    #[must_use]
    pub fn built_in() -> Arc<Self> {
        static BUILT_IN: OnceLock<Arc<Prior>> = OnceLock::new();
        Arc::clone(BUILT_IN.get_or_init(|| Arc::new(file::built_in())))
    }

    fn new(
        (name, materials): (String, Vec<String>),
        span: Span,
        mean: Functions,
        functions: [Functions; 2],
        left: [f64; 2],
    ) -> Result<Self> {
        let n = span.len();
        let fits = |f: &Functions| f.coefficients.len() == n * f.count();
        if !(mean.count() == 1 && fits(&mean) && functions.iter().all(fits)) {
            let found = format!("{} of the mean", mean.coefficients.len());
            return Err(Error::argument("coefficients of a prior", format!("{n} per function"), found));
        }
        if let Some(bad) = left.iter().find(|left| !(**left > 0.0 && left.is_finite())) {
            return Err(Error::argument("rest of a prior", "a positive number", bad));
        }
        Ok(Self { name, materials, span, mean, functions, left })
    }

    /// The number of principal functions of a kind of colour.
    #[must_use]
    pub fn n_functions(&self, colour: Colour) -> usize {
        self.functions[colour as usize].count()
    }

    /// Standard deviation of what the functions leave, root mean square over the warped box, of a material that is
    /// not in the library.
    #[must_use]
    pub fn left(&self, colour: Colour) -> f64 {
        self.left[colour as usize]
    }

    /// The principal functions at directions, one row per direction. Cost: a kernel value for each centre, and a
    /// multiply-add for each centre and function.
    #[must_use]
    pub fn features(&self, colour: Colour, angles: &[HalfDiff]) -> Vec<f64> {
        self.functions[colour as usize].values(&self.span, angles)
    }

    /// The library's mean of a colour at directions; zero for chromatic ones.
    #[must_use]
    pub fn mean(&self, colour: Colour, angles: &[HalfDiff]) -> Vec<f64> {
        match colour {
            Colour::Achromatic => self.mean.values(&self.span, angles),
            Colour::Chromatic => vec![0.0; angles.len()],
        }
    }

    /// The space of which its functions are part.
    pub(crate) fn span(&self) -> &Span {
        &self.span
    }

    /// `m + sum_k z_k B_k` for the coefficients `z` of one colour: its constant, and the coefficients of the centres.
    pub(crate) fn combined(&self, colour: Colour, coefficients: &[f64]) -> (f64, Vec<f64>) {
        let mut sum = (0.0, vec![0.0; self.span.len()]);
        if colour == Colour::Achromatic {
            sum = (self.mean.constants[0], self.mean.coefficients.clone());
        }
        let Functions { constants, coefficients: columns } = &self.functions[colour as usize];
        for ((z, constant), column) in coefficients.iter().zip(constants).zip(columns.chunks(self.span.len()))
        {
            sum.0 += z * constant;
            add_scaled(*z, column, &mut sum.1);
        }
        sum
    }
}

#[cfg(test)]
mod tests;
