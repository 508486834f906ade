//! What other materials tell about a material that is measured: the mean and the principal functions of a library
//! of reflectances.

mod calibration;
mod colour;
#[cfg(feature = "fit")]
mod cross_validation;
mod file;
#[cfg(feature = "fit")]
mod learn;
mod span;

pub(crate) use calibration::Calibration;
#[cfg(feature = "fit")]
pub(crate) use calibration::of_variance_by_bands;
pub use colour::Colour;
#[cfg(feature = "fit")]
pub(crate) use colour::to_opponent;
pub(crate) use colour::{OPPONENT, from_opponent, variance_of_channels};
pub(crate) use file::PriorHeader;
#[cfg(feature = "fit")]
pub use learn::{LearnOptions, Library, family, learn};
pub(crate) use span::{SPACE, Span};

use std::sync::{Arc, OnceLock};

use crate::base::error::{Error, Result};
use crate::base::linalg::factorize;
use crate::base::simd::add_scaled;
use crate::brdf::angles::HalfDiff;
use crate::sample::LOG_EPSILON;
use crate::sample::Transform;

/// The share of the library's materials in the covariance of an adapted prior; the rest is that of the prior itself.
const KEPT: f64 = 0.9;

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
    /// The coefficients `z` of the achromatic colour of each material of the library, one row per material.
    scores: Vec<f64>,
    /// How much wider intervals are than the process says.
    calibration: Calibration,
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
    pub const BUILT_IN_SHA256: &str = "28c5d97058798a414ada0e34a5551d604d44e518f4778015d3e4d32e98328374";

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
        scores: Vec<f64>,
        calibration: Calibration,
    ) -> Result<Self> {
        let n = span.len();
        let fits = |f: &Functions| f.coefficients.len() == n * f.count();
        if !(mean.count() == 1 && fits(&mean) && functions.iter().all(fits)) {
            let found = format!("{} of the mean", mean.coefficients.len());
            return Err(Error::argument("coefficients of a prior", format!("{n} per function"), found));
        }
        if scores.len() != materials.len() * functions[0].count() {
            let expected = format!("{} for each of {} materials", functions[0].count(), materials.len());
            return Err(Error::argument("scores of a prior", expected, scores.len()));
        }
        if let Some(bad) = left.iter().find(|left| !(**left > 0.0 && left.is_finite())) {
            return Err(Error::argument("rest of a prior", "a positive number", bad));
        }
        Ok(Self { name, materials, span, mean, functions, left, scores, calibration })
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

    /// The coefficients `z` of the achromatic colour of the materials of the library, one row per material.
    #[cfg(feature = "fit")]
    pub(crate) fn scores(&self) -> impl Iterator<Item = &[f64]> {
        self.scores.chunks(self.n_functions(Colour::Achromatic).max(1))
    }

    /// The prior of materials that are like those with large weights: for the achromatic colour `z ~ N(mu, S)` with the
    /// weighted mean `mu` of the coefficients of the library's materials and `S = 0.9 C + 0.1 I`, where `C` is their
    /// weighted covariance. The functions are changed so that their coefficients are standard normal again.
    ///
    /// # Errors
    /// A number of weights that is not that of the materials, or weights that are negative, not finite or all zero.
    pub fn adapted(&self, weights: &[f64]) -> Result<Self> {
        let count = self.n_functions(Colour::Achromatic);
        let sum: f64 = weights.iter().sum();
        let is_usable = weights.iter().all(|w| *w >= 0.0) && sum > 0.0 && sum.is_finite();
        if weights.len() != self.materials.len() || !is_usable || count == 0 {
            let expected = format!("{}, of at least 0 and not all zero", self.materials.len());
            return Err(Error::argument("weights of materials", expected, format!("{weights:?}")));
        }
        let rows = || self.scores.chunks(count).zip(weights).map(|(row, w)| (row, w / sum));
        let mut mean = vec![0.0; count];
        rows().for_each(|(row, w)| add_scaled(w, row, &mut mean));
        let mut covariance = vec![0.0; count * count];
        for (row, w) in rows() {
            for (j, column) in covariance.chunks_mut(count).enumerate() {
                let own = KEPT * w * (row[j] - mean[j]);
                column.iter_mut().zip(row).zip(&mean).for_each(|((out, z), m)| *out += own * (z - m));
            }
        }
        covariance.iter_mut().step_by(count + 1).for_each(|diagonal| *diagonal += 1.0 - KEPT);
        if !factorize(&mut covariance, count) {
            return Err(Error::NotPositiveDefinite { size: count, largest_jitter: 1.0 - KEPT });
        }
        let n = self.span.len();
        let Functions { constants, coefficients } = &self.functions[Colour::Achromatic as usize];
        let mut changed = Functions { constants: vec![0.0; count], coefficients: vec![0.0; n * count] };
        for (k, column) in changed.coefficients.chunks_mut(n).enumerate() {
            // Column k of the Cholesky factor.
            for j in k..count {
                let l = covariance[k * count + j];
                changed.constants[k] += l * constants[j];
                add_scaled(l, &coefficients[j * n..(j + 1) * n], column);
            }
        }
        let (constant, coefficients) = self.combined(Colour::Achromatic, &mean);
        Ok(Self {
            mean: Functions { constants: vec![constant], coefficients },
            functions: [changed, self.functions[Colour::Chromatic as usize].clone()],
            ..self.clone()
        })
    }

    /// This prior with weights of its materials as [`Prior::adapted`]; as it is where there are none.
    pub(crate) fn weighted(self: &Arc<Self>, weights: &[f64]) -> Result<Arc<Self>> {
        Ok(if weights.is_empty() { Arc::clone(self) } else { Arc::new(self.adapted(weights)?) })
    }

    /// How much wider intervals are than the process says.
    pub(crate) fn calibration(&self) -> &Calibration {
        &self.calibration
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
