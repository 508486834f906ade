//! Covariance functions of points of any dimension: sums of ARD and product terms.

use serde::{Deserialize, Serialize};

use super::axis::{Kernel1d, ParameterKind, check_log_parameters, positive};
use super::shape::Shape;
use crate::base::error::{Error, Result};

/// The distance between two values of one coordinate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisMetric {
    /// `|x - x'|`.
    #[default]
    Linear,
    /// `|sin(x - x')|`, half the chord between the angles `2 x` and `2 x'`. It is meant for an angle of
    /// period pi.
    Chord,
}

impl AxisMetric {
    /// The distance between two values.
    #[must_use]
    pub fn distance(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Linear => (a - b).abs(),
            Self::Chord => chord(a, b),
        }
    }
}

/// Half the chord between `2 a` and `2 b`. Inlined, the sine would be computed for linear coordinates, too.
#[inline(never)]
fn chord(a: f64, b: f64) -> f64 {
    (a - b).sin().abs()
}

/// The dependence of one summand on the distances `d_k` along the axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelBody {
    /// One shape of the joint distance `r^2 = sum_k d_k^2 / l_k^2` (automatic relevance determination). With
    /// the rational quadratic, this is the paper's eq. 7.
    Ard {
        /// The radial shape.
        shape: Shape,
        /// Length scale of each axis, positive.
        length_scale: Vec<f64>,
    },
    /// `prod_k k_k(d_k)`, the form that the lattice needs. It is the same function as [`KernelBody::Ard`]
    /// only for the squared exponential.
    Product(
        /// The kernel of each axis.
        Vec<Kernel1d>,
    ),
}

/// One summand of a [`Kernel`]: `variance body(d)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KernelTerm {
    /// Variance, positive, in the squared unit of the targets.
    pub variance: f64,
    /// The dependence on the distances.
    pub body: KernelBody,
}

/// A covariance function of points of dimension `d`: `k(x, x') = sum_t variance_t body_t(d_1, ..., d_d)`,
/// with the distances `d_k` of [`AxisMetric`].
///
/// Each term contributes these log-parameters: `ln variance`; then for an ARD term `ln l_1 ... ln l_d`, and
/// `ln alpha` if the shape has one; for a product the log-parameters of each axis ([`Kernel1d`]) in turn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kernel {
    /// The summands; at least one.
    pub terms: Vec<KernelTerm>,
    /// The metric of each axis; its length is the dimension.
    pub metric: Vec<AxisMetric>,
}

impl KernelTerm {
    /// A name that distinguishes a shape of the joint distance from a product: `matern52_ard`,
    /// `product(rq, matern12 + matern52)`.
    #[must_use]
    pub fn name(&self) -> String {
        match &self.body {
            KernelBody::Ard { shape, .. } => format!("{}_ard", shape.name()),
            KernelBody::Product(axes) => {
                let sum = |axis: &Kernel1d| {
                    let names: Vec<&str> = axis.terms.iter().map(|term| term.shape.name()).collect();
                    names.join(" + ")
                };
                let factors: Vec<String> = axes.iter().map(sum).collect();
                format!("product({})", factors.join(", "))
            }
        }
    }

    fn n_parameters(&self) -> usize {
        1 + match &self.body {
            KernelBody::Ard { shape, length_scale } => length_scale.len() + usize::from(shape.has_alpha()),
            KernelBody::Product(axes) => axes.iter().map(Kernel1d::n_parameters).sum(),
        }
    }

    fn prior_variance(&self) -> f64 {
        match &self.body {
            KernelBody::Ard { .. } => self.variance,
            KernelBody::Product(axes) => {
                self.variance * axes.iter().map(|axis| axis.value(0.0)).product::<f64>()
            }
        }
    }
}

impl Kernel {
    /// A kernel of one ARD term with the linear metric.
    #[must_use]
    pub fn ard(variance: f64, shape: Shape, length_scale: &[f64]) -> Self {
        let body = KernelBody::Ard { shape, length_scale: length_scale.to_vec() };
        Self {
            terms: vec![KernelTerm { variance, body }],
            metric: vec![AxisMetric::Linear; length_scale.len()],
        }
    }

    /// A kernel of one product term, with the metric of each axis.
    #[must_use]
    pub fn product(variance: f64, axes: Vec<(Kernel1d, AxisMetric)>) -> Self {
        let (axes, metric) = axes.into_iter().unzip();
        Self { terms: vec![KernelTerm { variance, body: KernelBody::Product(axes) }], metric }
    }

    /// The dimension of the points.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.metric.len()
    }

    /// The names of the terms, joined by ` + `.
    #[must_use]
    pub fn name(&self) -> String {
        let names: Vec<String> = self.terms.iter().map(KernelTerm::name).collect();
        names.join(" + ")
    }

    /// `k(x, x)`, which is the same at every point.
    #[must_use]
    pub fn prior_variance(&self) -> f64 {
        self.terms.iter().map(KernelTerm::prior_variance).sum()
    }

    /// `k(x, y)`. Both points have [`Kernel::dimension`] elements.
    #[must_use]
    pub fn value(&self, x: &[f64], y: &[f64]) -> f64 {
        let distance = |k: usize| self.metric[k].distance(x[k], y[k]);
        let mut total = 0.0;
        for term in &self.terms {
            total += term.variance
                * match &term.body {
                    KernelBody::Ard { shape, length_scale } => shape
                        .value(length_scale.iter().enumerate().map(|(k, l)| (distance(k) / l).powi(2)).sum()),
                    KernelBody::Product(axes) => {
                        axes.iter().enumerate().map(|(k, axis)| axis.value(distance(k))).product()
                    }
                };
        }
        total
    }

    /// Returns `k(x, y)` and writes `dk/dp` for every log-parameter `p` into `out`, which has
    /// [`Kernel::n_parameters`] elements. Allocates nothing. Cost: quadratic in the dimension for a product.
    ///
    /// # Panics
    /// If `x`, `y` or `out` is too short.
    pub fn gradient(&self, x: &[f64], y: &[f64], out: &mut [f64]) -> f64 {
        let distance = |k: usize| self.metric[k].distance(x[k], y[k]);
        out.fill(0.0);
        let mut total = 0.0;
        let mut rest = out;
        for term in &self.terms {
            let (own, others) = rest.split_at_mut(term.n_parameters());
            rest = others;
            let variance = term.variance;
            match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    let scaled = |(k, l): (usize, &f64)| (distance(k) / l).powi(2);
                    let r2 = length_scale.iter().enumerate().map(scaled).sum();
                    let (k, slope) = shape.value_and_slope(r2);
                    own[0] = variance * k;
                    for (own, axis) in own[1..].iter_mut().zip(length_scale.iter().enumerate()) {
                        *own = if r2 > 0.0 { variance * slope * scaled(axis) } else { 0.0 };
                    }
                    if shape.has_alpha() {
                        own[1 + length_scale.len()] = variance * shape.d_log_alpha(r2);
                    }
                }
                KernelBody::Product(axes) => {
                    let mut first = 1;
                    own[0] = variance;
                    for (k, axis) in axes.iter().enumerate() {
                        let mut factor = variance;
                        for (j, other) in axes.iter().enumerate().filter(|(j, _)| *j != k) {
                            factor *= other.value(distance(j));
                        }
                        let count = axis.n_parameters();
                        own[0] *= axis.add_gradient(distance(k), factor, &mut own[first..first + count]);
                        first += count;
                    }
                }
            }
            total += own[0];
        }
        total
    }

    /// Checks that there is a term, that every term has the dimension of the metric and that every parameter
    /// is in its domain.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for the first condition that does not hold.
    pub fn validate(&self) -> Result<()> {
        if self.terms.is_empty() {
            return Err(Error::argument("kernel", "at least one term", "none"));
        }
        for term in &self.terms {
            positive("variance of a kernel term", term.variance)?;
            let axes = match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    shape.validate()?;
                    length_scale.iter().try_for_each(|l| positive("length scale", *l))?;
                    length_scale.len()
                }
                KernelBody::Product(axes) => {
                    axes.iter().try_for_each(Kernel1d::validate)?;
                    axes.len()
                }
            };
            if axes != self.dimension() {
                let expected = format!("{}, the number of metrics", self.dimension());
                return Err(Error::argument("number of axes of a kernel term", expected, axes));
            }
        }
        Ok(())
    }

    /// The number of log-parameters.
    #[must_use]
    pub fn n_parameters(&self) -> usize {
        self.terms.iter().map(KernelTerm::n_parameters).sum()
    }

    /// The log-parameters, in the order given for [`Kernel`].
    #[must_use]
    pub fn log_parameters(&self) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.n_parameters());
        for term in &self.terms {
            out.push(term.variance.ln());
            match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    out.extend(length_scale.iter().map(|l| l.ln()));
                    out.extend(shape.alpha().map(f64::ln));
                }
                KernelBody::Product(axes) => out.extend(axes.iter().flat_map(Kernel1d::log_parameters)),
            }
        }
        out
    }

    /// The kind of each log-parameter.
    #[must_use]
    pub fn parameter_kinds(&self) -> Vec<ParameterKind> {
        let mut out = Vec::with_capacity(self.n_parameters());
        for term in &self.terms {
            out.push(ParameterKind::Variance);
            match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    out.extend((0..length_scale.len()).map(ParameterKind::LengthScale));
                    out.extend(shape.has_alpha().then_some(ParameterKind::Alpha));
                }
                KernelBody::Product(axes) => {
                    out.extend(axes.iter().enumerate().flat_map(|(k, axis)| axis.parameter_kinds(k)));
                }
            }
        }
        out
    }

    /// The names of the log-parameters, for example `terms[0].log_length_scale[2]`.
    #[must_use]
    pub fn parameter_names(&self) -> Vec<String> {
        let mut out = Vec::with_capacity(self.n_parameters());
        for (t, term) in self.terms.iter().enumerate() {
            out.push(format!("terms[{t}].log_variance"));
            match &term.body {
                KernelBody::Ard { shape, length_scale } => {
                    out.extend((0..length_scale.len()).map(|k| format!("terms[{t}].log_length_scale[{k}]")));
                    if shape.has_alpha() {
                        out.push(format!("terms[{t}].log_alpha"));
                    }
                }
                KernelBody::Product(axes) => {
                    for (k, axis) in axes.iter().enumerate() {
                        out.extend(
                            axis.parameter_names().into_iter().map(|n| format!("terms[{t}].axes[{k}].{n}")),
                        );
                    }
                }
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
        let mut rest = log_parameters;
        for term in &mut self.terms {
            let (own, others) = rest.split_at(term.n_parameters());
            rest = others;
            term.variance = own[0].exp();
            match &mut term.body {
                KernelBody::Ard { shape, length_scale } => {
                    for (l, p) in length_scale.iter_mut().zip(&own[1..]) {
                        *l = p.exp();
                    }
                    if shape.has_alpha() {
                        *shape = shape.with_alpha(own[1 + length_scale.len()].exp());
                    }
                }
                KernelBody::Product(axes) => {
                    let mut first = 1;
                    for axis in axes {
                        let count = axis.n_parameters();
                        axis.set_log_parameters(&own[first..first + count])?;
                        first += count;
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::kernel::axis::Term1d;

    /// Kernels of every kind, in dimension 3: each shape with ARD, a sum, a product of sums, both metrics.
    pub(crate) fn kernels() -> Vec<Kernel> {
        let shapes = [
            Shape::SquaredExponential,
            Shape::RationalQuadratic { alpha: 0.8 },
            Shape::Matern12,
            Shape::Matern32,
            Shape::Matern52,
            Shape::Matern { nu: 0.7 },
            Shape::Matern { nu: 1.3 },
        ];
        let metric = [AxisMetric::Linear, AxisMetric::Linear, AxisMetric::Chord];
        let mut all: Vec<Kernel> = shapes.iter().map(|s| Kernel::ard(1.3, *s, &[0.6, 0.9, 1.7])).collect();
        all.extend(
            shapes
                .iter()
                .map(|s| Kernel { metric: metric.to_vec(), ..Kernel::ard(0.8, *s, &[0.5, 1.2, 0.7]) }),
        );
        all.extend(
            shapes.iter().map(|s| Kernel::product(1.1, metric.map(|m| (Kernel1d::new(*s, 0.9), m)).to_vec())),
        );
        let term = |weight, shape, length_scale| Term1d { weight, shape, length_scale };
        let sum_axis = Kernel1d {
            terms: vec![
                term(1.0, Shape::Matern52, 0.8),
                term(0.5, Shape::RationalQuadratic { alpha: 2.0 }, 0.3),
            ],
        };
        let mut sum = Kernel::product(
            0.9,
            vec![
                (sum_axis, AxisMetric::Linear),
                (Kernel1d::new(Shape::SquaredExponential, 1.1), AxisMetric::Linear),
                (Kernel1d::new(Shape::Matern32, 0.6), AxisMetric::Chord),
            ],
        );
        all.push(sum.clone());
        for kernel in [&all[3], &all[1]] {
            sum.terms.extend(kernel.terms.iter().cloned());
        }
        all.push(sum);
        all
    }

    #[test]
    fn gradients_match_central_differences_for_every_kernel() {
        let points = [[0.1, 0.5, 0.3], [0.7, 0.4, 2.9], [0.1, 0.5, 0.9]];
        for kernel in kernels() {
            kernel.validate().unwrap();
            let p = kernel.log_parameters();
            assert_eq!(kernel.parameter_names().len(), p.len());
            let mut gradient = vec![0.0; p.len()];
            for (x, y) in [(0, 1), (0, 2), (1, 1)].map(|(i, j)| (points[i], points[j])) {
                let value = kernel.gradient(&x, &y, &mut gradient);
                assert!((value - kernel.value(&x, &y)).abs() < 1e-14);
                for i in 0..p.len() {
                    let at = |step: f64| {
                        let (mut k, mut p) = (kernel.clone(), p.clone());
                        p[i] += step;
                        k.set_log_parameters(&p).unwrap();
                        k.value(&x, &y)
                    };
                    let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                    let name = &kernel.parameter_names()[i];
                    let close = (difference - gradient[i]).abs() < 1e-8;
                    assert!(close, "{} {name}: {difference} {}", kernel.name(), gradient[i]);
                }
            }
        }
    }

    #[test]
    fn a_product_of_squared_exponentials_is_the_ard_one_and_of_rational_quadratics_is_not() {
        let (x, y) = ([0.1, 0.5], [0.7, -0.4]);
        let pair = |shape| {
            let axes = [0.6, 0.9].map(|l| (Kernel1d::new(shape, l), AxisMetric::Linear)).to_vec();
            (Kernel::ard(1.3, shape, &[0.6, 0.9]), Kernel::product(1.3, axes))
        };
        let (ard, product) = pair(Shape::SquaredExponential);
        assert!((ard.value(&x, &y) - product.value(&x, &y)).abs() < 1e-15);
        let (ard, product) = pair(Shape::RationalQuadratic { alpha: 0.8 });
        assert!((ard.value(&x, &y) - product.value(&x, &y)).abs() > 0.01);
        assert_eq!(ard.name(), "rq_ard");
        assert_eq!(product.name(), "product(rq, rq)");
    }

    #[test]
    fn the_chord_metric_has_period_pi() {
        let kernel = Kernel { metric: vec![AxisMetric::Chord], ..Kernel::ard(1.0, Shape::Matern52, &[0.5]) };
        let pi = std::f64::consts::PI;
        assert!((kernel.value(&[0.2], &[0.2 + pi]) - 1.0).abs() < 1e-12);
        assert!((kernel.value(&[0.2], &[0.9]) - kernel.value(&[0.2 + pi], &[0.9])).abs() < 1e-12);
        assert!((AxisMetric::Chord.distance(0.0, pi / 2.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn kernels_survive_json() {
        for kernel in kernels() {
            let text = serde_json::to_string(&kernel).unwrap();
            assert_eq!(serde_json::from_str::<Kernel>(&text).unwrap(), kernel, "{text}");
        }
    }

    #[test]
    fn invalid_kernels_are_refused() {
        let good = Kernel::ard(1.0, Shape::Matern52, &[0.5, 0.5]);
        assert!(good.validate().is_ok());
        assert!(Kernel { metric: vec![AxisMetric::Linear], ..good.clone() }.validate().is_err());
        assert!(Kernel { terms: vec![], ..good }.validate().is_err());
        assert!(Kernel::ard(0.0, Shape::Matern52, &[0.5]).validate().is_err());
        assert!(Kernel::ard(1.0, Shape::Matern52, &[f64::NAN]).validate().is_err());
        assert!(Kernel::ard(1.0, Shape::Matern { nu: 99.0 }, &[0.5]).validate().is_err());
    }
}
