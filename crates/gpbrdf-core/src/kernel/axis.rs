//! Covariance functions of one coordinate.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::kernel::Shape;
use crate::simd::exp_slice;

/// How the distance between two coordinates is measured along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisMetric {
    /// `|x - x'|`.
    #[default]
    Linear,
    /// `|sin(x - x')|`: the chord of an angle of period `pi`.
    Chord,
}

impl AxisMetric {
    /// The distance.
    #[inline]
    #[must_use]
    pub fn distance(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Linear => (a - b).abs(),
            Self::Chord => (a - b).sin().abs(),
        }
    }
}

/// One term of a [`Kernel1d`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Term1d {
    /// Factor; that of the first term stays fixed, as the signal variance carries the scale.
    pub weight: f64,
    /// Shape.
    pub shape: Shape,
    /// Length scale, in units of the coordinate.
    pub length_scale: f64,
}

/// A covariance function of one coordinate: `k(d) = sum_m weight_m shape_m(d / length_scale_m)`.
///
/// Its log-parameters are, term by term: `ln weight` (from the second term on), `ln length_scale`, and `ln alpha`
/// where the shape has one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kernel1d {
    /// The terms, at least one.
    pub terms: Vec<Term1d>,
}

/// What a log-parameter is the logarithm of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// A length scale, in units of the coordinate.
    LengthScale,
    /// The mixture parameter of a rational quadratic.
    Alpha,
    /// The weight of a term, or the variance of a kernel.
    Weight,
}

/// A log-parameter of a kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterInfo {
    /// Name for reports, for example `length_scale` or `weight[1]`.
    pub name: String,
    /// What it is.
    pub kind: ParameterKind,
    /// Its present natural logarithm.
    pub log_value: f64,
}

impl Kernel1d {
    /// A kernel of one term.
    #[must_use]
    pub fn single(shape: Shape, length_scale: f64) -> Self {
        Self { terms: vec![Term1d { weight: 1.0, shape, length_scale }] }
    }

    /// Checks every parameter.
    ///
    /// # Errors
    /// No terms, or a parameter that is not positive and finite.
    pub fn validate(&self) -> Result<()> {
        if self.terms.is_empty() {
            return Err(Error::argument("kernel of an axis", "at least one term", "none"));
        }
        for term in &self.terms {
            term.shape.validate()?;
            for (what, value) in [("kernel weight", term.weight), ("length scale", term.length_scale)] {
                if !(value > 0.0 && value.is_finite()) {
                    return Err(Error::argument(what, "a positive number", value));
                }
            }
        }
        Ok(())
    }

    /// `k(d)`.
    #[must_use]
    pub fn value(&self, distance: f64) -> f64 {
        self.terms.iter().map(|t| t.weight * t.shape.value((distance / t.length_scale).powi(2))).sum()
    }

    /// `k(d)` and its derivatives in the log-parameters, written to `gradient`.
    pub(crate) fn value_and_gradient(&self, distance: f64, gradient: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        let mut slots = gradient.iter_mut();
        for (i, term) in self.terms.iter().enumerate() {
            let r2 = (distance / term.length_scale).powi(2);
            let (value, d_log_r) = term.shape.value_and_log_slope(r2);
            sum += term.weight * value;
            let weight = (i > 0).then_some(term.weight * value);
            let alpha = term.shape.alpha().map(|_| term.weight * term.shape.d_log_alpha(r2));
            let own = weight.into_iter().chain([-term.weight * d_log_r]).chain(alpha);
            slots.by_ref().zip(own).for_each(|(slot, d)| *slot = d);
        }
        sum
    }

    /// Replaces distances by kernel values; vectorised for shapes in closed form.
    pub(crate) fn values_in_place(&self, distances: &mut [f64]) {
        if let [term] = self.terms.as_slice() {
            term.values_in_place(distances);
            return;
        }
        let input = distances.to_vec();
        distances.fill(0.0);
        let mut values = Vec::with_capacity(input.len());
        for term in &self.terms {
            values.clone_from(&input);
            term.values_in_place(&mut values);
            distances.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
        }
    }

    /// Number of log-parameters.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.terms.iter().map(|t| 1 + usize::from(t.shape.alpha().is_some())).sum::<usize>()
            + self.terms.len().saturating_sub(1)
    }

    /// Names, kinds and present values of the log-parameters.
    #[must_use]
    pub fn parameters(&self) -> Vec<ParameterInfo> {
        let mut out = Vec::with_capacity(self.parameter_count());
        for (i, term) in self.terms.iter().enumerate() {
            let suffix = if self.terms.len() > 1 { format!("[{i}]") } else { String::new() };
            let mut push = |name: &str, kind, value: f64| {
                out.push(ParameterInfo { name: format!("{name}{suffix}"), kind, log_value: value.ln() });
            };
            if i > 0 {
                push("weight", ParameterKind::Weight, term.weight);
            }
            push("length_scale", ParameterKind::LengthScale, term.length_scale);
            if let Some(alpha) = term.shape.alpha() {
                push("alpha", ParameterKind::Alpha, alpha);
            }
        }
        out
    }

    /// Sets the log-parameters, in the order of [`Kernel1d::parameters`].
    pub fn set_log_parameters(&mut self, log_parameters: &[f64]) {
        let mut values = log_parameters.iter().map(|x| x.exp());
        for (i, term) in self.terms.iter_mut().enumerate() {
            if i > 0
                && let Some(weight) = values.next()
            {
                term.weight = weight;
            }
            if let Some(length_scale) = values.next() {
                term.length_scale = length_scale;
            }
            if term.shape.alpha().is_some()
                && let Some(alpha) = values.next()
            {
                term.shape = term.shape.with_alpha(alpha);
            }
        }
    }
}

impl Term1d {
    /// Replaces distances by `weight shape(d / length_scale)`.
    fn values_in_place(&self, distances: &mut [f64]) {
        let weight = self.weight;
        match self.shape {
            Shape::SquaredExponential => {
                let scale = -0.5 / (self.length_scale * self.length_scale);
                distances.iter_mut().for_each(|d| *d *= *d * scale);
                exp_slice(distances);
                distances.iter_mut().for_each(|k| *k *= weight);
            }
            Shape::Matern12 => polynomial_times_exp(distances, 1.0 / self.length_scale, [weight, 0.0, 0.0]),
            Shape::Matern32 => {
                polynomial_times_exp(distances, 3f64.sqrt() / self.length_scale, [weight, weight, 0.0]);
            }
            Shape::Matern52 => {
                polynomial_times_exp(
                    distances,
                    5f64.sqrt() / self.length_scale,
                    [weight, weight, weight / 3.0],
                );
            }
            shape => {
                distances.iter_mut().for_each(|d| *d = weight * shape.value((*d / self.length_scale).powi(2)))
            }
        }
    }
}

/// Replaces `d` by `(c0 + c1 s + c2 s^2) exp(-s)` with `s = scale d`, in blocks that stay in cache.
fn polynomial_times_exp(distances: &mut [f64], scale: f64, c: [f64; 3]) {
    let mut exponential = [0.0; 256];
    for block in distances.chunks_mut(256) {
        let exponential = &mut exponential[..block.len()];
        for (e, d) in exponential.iter_mut().zip(&*block) {
            *e = -scale * d;
        }
        exp_slice(exponential);
        for (d, e) in block.iter_mut().zip(&*exponential) {
            let s = scale * *d;
            *d = (c[0] + s * (c[1] + s * c[2])) * e;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernels() -> Vec<Kernel1d> {
        let shapes = [
            Shape::SquaredExponential,
            Shape::RationalQuadratic { alpha: 0.7 },
            Shape::Matern12,
            Shape::Matern32,
            Shape::Matern52,
            Shape::Matern { nu: 1.3 },
        ];
        let mut all: Vec<Kernel1d> = shapes.map(|s| Kernel1d::single(s, 0.4)).into();
        let term = |weight, shape, length_scale| Term1d { weight, shape, length_scale };
        all.push(Kernel1d {
            terms: vec![
                term(1.0, Shape::Matern52, 0.9),
                term(0.3, Shape::RationalQuadratic { alpha: 2.0 }, 0.2),
                term(0.1, Shape::Matern12, 0.1),
            ],
        });
        all
    }

    #[test]
    fn rows_agree_with_single_values() {
        for kernel in kernels() {
            let distances: Vec<f64> = (0..600).map(|i| f64::from(i) * 0.004).collect();
            let mut row = distances.clone();
            kernel.values_in_place(&mut row);
            for (d, k) in distances.iter().zip(&row) {
                assert!((k - kernel.value(*d)).abs() < 1e-14, "{kernel:?} {d}");
            }
        }
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        for kernel in kernels() {
            let start: Vec<f64> = kernel.parameters().iter().map(|p| p.log_value).collect();
            assert_eq!(start.len(), kernel.parameter_count());
            for distance in [0.0, 0.05, 0.4, 1.3] {
                let mut gradient = vec![0.0; start.len()];
                let value = kernel.value_and_gradient(distance, &mut gradient);
                assert!((value - kernel.value(distance)).abs() < 1e-15);
                for (i, slope) in gradient.iter().enumerate() {
                    let at = |step: f64| {
                        let mut p = start.clone();
                        p[i] += step;
                        let mut moved = kernel.clone();
                        moved.set_log_parameters(&p);
                        moved.value(distance)
                    };
                    let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!((slope - numeric).abs() < 1e-9, "{kernel:?} {distance} {i} {slope} {numeric}");
                }
            }
        }
    }

    #[test]
    fn broken_kernels_are_refused() {
        assert!(Kernel1d { terms: vec![] }.validate().is_err());
        assert!(Kernel1d::single(Shape::Matern52, 0.0).validate().is_err());
        assert!(Kernel1d::single(Shape::RationalQuadratic { alpha: f64::NAN }, 1.0).validate().is_err());
    }
}
