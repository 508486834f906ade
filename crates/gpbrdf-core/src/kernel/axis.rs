//! Covariance functions of one coordinate.

use serde::{Deserialize, Serialize};

use super::shape::Shape;
use crate::base::error::{Error, Result};
use crate::base::simd::{add_scaled, scale_in_place};

/// One summand of a [`Kernel1d`]: `weight shape(d / length_scale)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Term1d {
    /// Share of the variance, positive.
    pub weight: f64,
    /// The radial shape.
    pub shape: Shape,
    /// Length scale, positive, in the coordinate's unit.
    pub length_scale: f64,
}

/// A covariance function of the distance along one axis, `k(d) = sum_m weight_m shape_m(d / l_m)`.
///
/// Each term contributes these log-parameters: `ln weight`, `ln length_scale`, and `ln alpha` if the shape
/// has one. The weight of the first term is no parameter: it stays fixed, usually at 1, since the variance of
/// the whole kernel scales all weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kernel1d {
    /// The summands; at least one.
    pub terms: Vec<Term1d>,
}

/// The quantity of which a log-parameter is the logarithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// The variance of a kernel's term, in the squared unit of the targets.
    Variance,
    /// The weight of a term.
    Weight,
    /// The length scale along the axis of this index.
    LengthScale(usize),
    /// The mixture parameter of a rational quadratic.
    Alpha,
}

impl Kernel1d {
    /// A kernel of one shape with a weight of 1.
    #[must_use]
    pub fn new(shape: Shape, length_scale: f64) -> Self {
        Self { terms: vec![Term1d { weight: 1.0, shape, length_scale }] }
    }

    /// `k(d)` at the distance `d`.
    #[must_use]
    pub fn value(&self, d: f64) -> f64 {
        self.terms.iter().map(|t| t.weight * t.shape.value((d / t.length_scale).powi(2))).sum()
    }

    /// Returns `k(d)` and adds `factor dk/dp` to `out` for every log-parameter `p`.
    ///
    /// `out` has [`Kernel1d::n_parameters`] elements. If it is shorter, the derivatives that do not fit are
    /// left out.
    pub fn add_gradient(&self, d: f64, factor: f64, out: &mut [f64]) -> f64 {
        let mut out = out.iter_mut();
        let mut add = |amount: f64| {
            if let Some(o) = out.next() {
                *o += factor * amount;
            }
        };
        let mut total = 0.0;
        for (m, term) in self.terms.iter().enumerate() {
            let r2 = (d / term.length_scale).powi(2);
            let (k, slope) = term.shape.value_and_slope(r2);
            if m > 0 {
                add(term.weight * k);
            }
            add(if r2 > 0.0 { term.weight * slope * r2 } else { 0.0 });
            if term.shape.has_alpha() {
                add(term.weight * term.shape.d_log_alpha(r2));
            }
            total += term.weight * k;
        }
        total
    }

    /// Checks that there is a term and that every parameter is in its domain.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for the first parameter that is not in its domain, or if there is no term.
    pub fn validate(&self) -> Result<()> {
        if self.terms.is_empty() {
            return Err(Error::argument("kernel of one axis", "at least one term", "none"));
        }
        for term in &self.terms {
            positive("weight of a kernel term", term.weight)?;
            positive("length scale", term.length_scale)?;
            term.shape.validate()?;
        }
        Ok(())
    }

    /// The number of log-parameters.
    #[must_use]
    pub fn n_parameters(&self) -> usize {
        self.terms
            .iter()
            .enumerate()
            .map(|(m, t)| usize::from(m > 0) + 1 + usize::from(t.shape.has_alpha()))
            .sum()
    }

    /// The log-parameters, in the order given for [`Kernel1d`].
    #[must_use]
    pub fn log_parameters(&self) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.n_parameters());
        for (m, term) in self.terms.iter().enumerate() {
            if m > 0 {
                out.push(term.weight.ln());
            }
            out.push(term.length_scale.ln());
            out.extend(term.shape.alpha().map(f64::ln));
        }
        out
    }

    /// The kind of each log-parameter. Length scales are those of the axis with index `axis`.
    #[must_use]
    pub fn parameter_kinds(&self, axis: usize) -> Vec<ParameterKind> {
        let mut out = Vec::with_capacity(self.n_parameters());
        for (m, term) in self.terms.iter().enumerate() {
            out.extend((m > 0).then_some(ParameterKind::Weight));
            out.push(ParameterKind::LengthScale(axis));
            out.extend(term.shape.has_alpha().then_some(ParameterKind::Alpha));
        }
        out
    }

    /// Replaces squared distances by kernel values; in vector instructions for shapes with a closed form.
    pub(crate) fn fill(&self, squared_distances: &mut [f64]) {
        let fill_term = |term: &Term1d, values: &mut [f64]| {
            scale_in_place((term.length_scale * term.length_scale).recip(), values);
            term.shape.fill(values);
            if term.weight != 1.0 {
                scale_in_place(term.weight, values);
            }
        };
        if let [term] = self.terms.as_slice() {
            fill_term(term, squared_distances);
            return;
        }
        let input = squared_distances.to_vec();
        squared_distances.fill(0.0);
        let mut values = Vec::with_capacity(input.len());
        for term in &self.terms {
            values.clone_from(&input);
            fill_term(term, &mut values);
            add_scaled(1.0, &values, squared_distances);
        }
    }

    /// The names of the log-parameters, for example `terms[1].log_weight`.
    #[must_use]
    pub fn parameter_names(&self) -> Vec<String> {
        let mut out = Vec::with_capacity(self.n_parameters());
        for (m, term) in self.terms.iter().enumerate() {
            if m > 0 {
                out.push(format!("terms[{m}].log_weight"));
            }
            out.push(format!("terms[{m}].log_length_scale"));
            if term.shape.has_alpha() {
                out.push(format!("terms[{m}].log_alpha"));
            }
        }
        out
    }

    /// Sets the parameters from their logarithms.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a wrong number of values, or one whose exponential is zero or not
    /// finite; the kernel is then unchanged.
    pub fn set_log_parameters(&mut self, log_parameters: &[f64]) -> Result<()> {
        check_log_parameters(log_parameters, self.n_parameters())?;
        let mut values = log_parameters.iter().map(|p| p.exp());
        for (m, term) in self.terms.iter_mut().enumerate() {
            if m > 0 {
                term.weight = values.next().unwrap_or(term.weight);
            }
            term.length_scale = values.next().unwrap_or(term.length_scale);
            if term.shape.has_alpha() {
                term.shape = values.next().map_or(term.shape, |alpha| term.shape.with_alpha(alpha));
            }
        }
        Ok(())
    }
}

/// Refuses a value that is not positive and finite.
pub(super) fn positive(what: &'static str, value: f64) -> Result<()> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(Error::argument(what, "a positive number", value))
    }
}

/// Refuses a wrong number of log-parameters, and one whose exponential is not a positive finite number.
pub(super) fn check_log_parameters(log_parameters: &[f64], expected: usize) -> Result<()> {
    if log_parameters.len() != expected {
        let expected = format!("{expected} values");
        return Err(Error::argument("log-parameters of a kernel", expected, log_parameters.len()));
    }
    log_parameters.iter().try_for_each(|p| positive("exponential of a log-parameter", p.exp()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum_of_three() -> Kernel1d {
        let term = |weight, shape, length_scale| Term1d { weight, shape, length_scale };
        Kernel1d {
            terms: vec![
                term(1.0, Shape::Matern52, 0.7),
                term(0.4, Shape::RationalQuadratic { alpha: 1.4 }, 0.2),
                term(2.5, Shape::SquaredExponential, 3.0),
            ],
        }
    }

    #[test]
    fn a_sum_is_the_sum_of_its_terms() {
        let kernel = sum_of_three();
        let expected = Shape::Matern52.value(0.25 / 0.49)
            + 0.4 * (1.0 + 0.25 / 0.04 / 2.8f64).powf(-1.4)
            + 2.5 * (-0.125f64 / 9.0).exp();
        assert!((kernel.value(0.5) - expected).abs() < 1e-14);
        assert!((kernel.value(0.0) - 3.9).abs() < 1e-15);
    }

    #[test]
    fn log_parameters_round_trip_and_drive_the_gradient() {
        let kernel = sum_of_three();
        let p = kernel.log_parameters();
        assert_eq!(p.len(), kernel.n_parameters());
        assert_eq!(kernel.parameter_names().len(), p.len());
        assert_eq!(kernel.parameter_names()[1], "terms[1].log_weight");
        let mut gradient = vec![0.0; p.len()];
        let value = kernel.add_gradient(0.6, 2.0, &mut gradient);
        assert!((value - kernel.value(0.6)).abs() < 1e-14);
        for i in 0..p.len() {
            let at = |step: f64| {
                let (mut k, mut p) = (kernel.clone(), p.clone());
                p[i] += step;
                k.set_log_parameters(&p).unwrap();
                k.value(0.6)
            };
            let difference = 2.0 * (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((difference - gradient[i]).abs() < 1e-9, "{i}: {difference} {}", gradient[i]);
        }
    }

    #[test]
    fn filled_slices_agree_with_single_values() {
        for kernel in [sum_of_three(), Kernel1d::new(Shape::Matern52, 0.3)] {
            let distances: Vec<f64> = (0..600).map(|i| f64::from(i) * 0.004).collect();
            let mut row: Vec<f64> = distances.iter().map(|d| d * d).collect();
            kernel.fill(&mut row);
            for (d, k) in distances.iter().zip(&row) {
                assert!((k - kernel.value(*d)).abs() < 1e-14, "{kernel:?} {d}");
            }
        }
    }

    #[test]
    fn wrong_parameters_are_refused() {
        let mut kernel = sum_of_three();
        assert!(kernel.set_log_parameters(&[0.0; 3]).is_err());
        assert!(kernel.set_log_parameters(&[0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0]).is_err());
        assert!(kernel.set_log_parameters(&[0.0, 0.0, 0.0, 800.0, 0.0, 0.0]).is_err());
        assert_eq!(kernel, sum_of_three());
        assert!(Kernel1d { terms: vec![] }.validate().is_err());
        assert!(Kernel1d::new(Shape::Matern12, -1.0).validate().is_err());
        assert!(sum_of_three().validate().is_ok());
    }
}
