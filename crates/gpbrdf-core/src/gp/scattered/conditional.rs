//! The distribution of one sample given a few others: the building block of the nearest-neighbour likelihood,
//! of the preconditioner, of variances and of leave-one-out predictions.

use crate::kernel::Kernel;

/// A process at given hyper-parameters, and its samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Process<'a> {
    pub(super) kernel: &'a Kernel,
    /// Coordinates of the samples, `n` rows.
    pub(super) x: &'a [f64],
    /// Noise variance of each sample.
    pub(super) noise: &'a [f64],
    /// The part of it that is proportional to the hyper-parameter: its derivative with respect to the
    /// logarithm of that.
    pub(super) noise_slope: &'a [f64],
}

/// Added to the diagonal of covariances, relative to the prior variance, so that samples at the same place
/// without noise do not make them singular.
pub(super) const JITTER: f64 = 1e-10;

impl Process<'_> {
    /// Coordinates of sample `i`.
    pub(super) fn point(&self, i: usize) -> &[f64] {
        let dimension = self.kernel.dimension();
        &self.x[i * dimension..(i + 1) * dimension]
    }

    /// Variance of a measurement of sample `i` before anything is known.
    pub(super) fn diagonal(&self, i: usize) -> f64 {
        self.kernel.prior_variance() * (1.0 + JITTER) + self.noise[i]
    }
}

/// Work arrays of one thread for conditionals on up to `count` samples.
#[derive(Debug)]
pub(super) struct Scratch {
    count: usize,
    /// Lower triangle of the covariance of the samples, then its Cholesky factor, in rows of `count`.
    factor: Vec<f64>,
    /// Covariances with the point, then the coefficients of the samples in its conditional mean.
    coefficients: Vec<f64>,
    /// Derivatives of kernel values: of each pair of samples, and of each sample with the point.
    pairs: Vec<f64>,
    point: Vec<f64>,
    /// Derivatives of the prior variance.
    own: Vec<f64>,
    /// `K^-1 y` of one channel, and one derivative's right-hand side.
    weights: Vec<f64>,
    side: Vec<f64>,
}

impl Scratch {
    pub(super) fn new(count: usize, kernel: &Kernel) -> Self {
        let parameters = kernel.n_parameters();
        Self {
            count,
            factor: vec![0.0; count * count],
            coefficients: vec![0.0; count],
            pairs: vec![0.0; count * (count + 1) / 2 * parameters],
            point: vec![0.0; count * parameters],
            own: vec![0.0; parameters],
            weights: vec![0.0; count],
            side: vec![0.0; count],
        }
    }

    /// Conditions a point on the samples `given`: the coefficients of the samples in its mean, and the
    /// variance of its noise-free value. Cost: `m^3 / 6` multiply-adds and `m^2 / 2` kernel evaluations.
    pub(super) fn condition(&mut self, process: &Process<'_>, point: &[f64], given: &[u32]) -> (&[f64], f64) {
        let m = given.len();
        for (a, &i) in given.iter().enumerate() {
            let at = process.point(i as usize);
            for (b, &j) in given[..a].iter().enumerate() {
                self.factor[a * self.count + b] = process.kernel.value(at, process.point(j as usize));
            }
            self.factor[a * self.count + a] = process.diagonal(i as usize);
            self.coefficients[a] = process.kernel.value(at, point);
        }
        let variance = (process.kernel.prior_variance() - self.solve(m)).max(0.0);
        (&self.coefficients[..m], variance)
    }

    /// Factorises the covariance and replaces the covariances with the point by coefficients; the variance
    /// that the samples explain.
    fn solve(&mut self, m: usize) -> f64 {
        factorize(&mut self.factor, self.count, m);
        let coefficients = &mut self.coefficients[..m];
        forward(&self.factor, self.count, coefficients);
        let explained = coefficients.iter().map(|x| x * x).sum();
        backward(&self.factor, self.count, coefficients);
        explained
    }

    /// The log density of the targets of sample `i` given those of the samples `given`, summed over the
    /// channels, and its derivatives, which are added to `gradient`: with respect to the log-parameters of the
    /// kernel and, last, to the logarithm of the noise variance that all samples share.
    ///
    /// With coefficients `b = K^-1 k`, variance `v` and residual `r = y - b^T y_given`, for a parameter `p`
    /// and `q = dk - dK b`: `dr = -q^T K^-1 y_given` and `dv = dk_ii - b^T dk - b^T q`.
    pub(super) fn log_density(
        &mut self,
        process: &Process<'_>,
        y: &[Vec<f64>],
        i: usize,
        given: &[u32],
        gradient: &mut [f64],
    ) -> f64 {
        let (m, count) = (given.len(), self.count);
        let parameters = process.kernel.n_parameters();
        let point = process.point(i);
        let mut pair = 0;
        for (a, &j) in given.iter().enumerate() {
            let at = process.point(j as usize);
            for (b, &l) in given[..=a].iter().enumerate() {
                let out = &mut self.pairs[pair..pair + parameters];
                self.factor[a * count + b] = process.kernel.gradient(at, process.point(l as usize), out);
                pair += parameters;
            }
            self.factor[a * count + a] = process.diagonal(j as usize);
            let out = &mut self.point[a * parameters..(a + 1) * parameters];
            self.coefficients[a] = process.kernel.gradient(at, point, out);
        }
        let noise = process.noise[i];
        let variance = process.diagonal(i) - self.solve(m);
        let variance = variance.max(noise).max(JITTER * process.kernel.prior_variance());
        let b = &self.coefficients[..m];
        // d(residual) and d(variance) of every parameter; the residual has one derivative per channel.
        let channels = y.len() as f64;
        let mut density = -0.5 * channels * (std::f64::consts::TAU * variance).ln();
        let mut slope_of_variance = -0.5 * channels / variance;
        // sum over channels of -r / v (K^-1 y): what multiplies -q.
        self.side[..m].fill(0.0);
        for y in y {
            for (w, &j) in self.weights.iter_mut().zip(given) {
                *w = y[j as usize];
            }
            let known: f64 = b.iter().zip(&self.weights).map(|(b, y)| b * y).sum();
            let residual = y[i] - known;
            density -= 0.5 * residual * residual / variance;
            slope_of_variance += 0.5 * (residual / variance).powi(2);
            let weights = &mut self.weights[..m];
            forward(&self.factor, count, weights);
            backward(&self.factor, count, weights);
            for (side, w) in self.side.iter_mut().zip(weights) {
                *side += residual / variance * *w;
            }
        }
        // What multiplies q in the derivative of the density, and what multiplies dk besides.
        let q_factor = |a: usize| self.side[a] - slope_of_variance * b[a];
        let Some((of_noise, of_kernel)) = gradient.split_last_mut() else { return density };
        let mut pair = 0;
        process.kernel.gradient(point, point, &mut self.own);
        for (out, own) in of_kernel.iter_mut().zip(&self.own) {
            *out += slope_of_variance * own;
        }
        *of_noise += slope_of_variance * process.noise_slope[i];
        for (a, &j) in given.iter().enumerate() {
            let (qa, ba) = (q_factor(a), b[a]);
            for l in 0..=a {
                // -dK_al enters q_a times b_l, and q_l times b_a.
                let weight = if l == a { qa * ba } else { qa * b[l] + q_factor(l) * ba };
                for (out, d) in of_kernel.iter_mut().zip(&self.pairs[pair..pair + parameters]) {
                    *out -= weight * d;
                }
                pair += parameters;
            }
            let weight = qa - slope_of_variance * ba;
            for (out, d) in of_kernel.iter_mut().zip(&self.point[a * parameters..(a + 1) * parameters]) {
                *out += weight * d;
            }
            *of_noise -= qa * ba * process.noise_slope[j as usize];
        }
        density
    }
}

/// The Cholesky factor of the leading `m x m` block of a matrix in rows of `stride`, in place; only the lower
/// triangle is used. A pivot that rounding has made negative becomes a small positive one.
fn factorize(matrix: &mut [f64], stride: usize, m: usize) {
    for a in 0..m {
        let (above, row) = matrix.split_at_mut(a * stride);
        let diagonal = row[a];
        for b in 0..a {
            let other = &above[b * stride..b * stride + b + 1];
            let known: f64 = row[..b].iter().zip(other).map(|(x, y)| x * y).sum();
            row[b] = (row[b] - known) / other[b];
        }
        let known: f64 = row[..a].iter().map(|x| x * x).sum();
        row[a] = (diagonal - known).max(1e-14 * diagonal).sqrt();
    }
}

/// Solves `L x = y` in place for the factor of [`factorize`].
fn forward(factor: &[f64], stride: usize, y: &mut [f64]) {
    for a in 0..y.len() {
        let row = &factor[a * stride..=a * stride + a];
        let known: f64 = row[..a].iter().zip(&*y).map(|(l, y)| l * y).sum();
        y[a] = (y[a] - known) / row[a];
    }
}

/// Solves `L^T x = y` in place.
fn backward(factor: &[f64], stride: usize, y: &mut [f64]) {
    for a in (0..y.len()).rev() {
        let row = &factor[a * stride..=a * stride + a];
        y[a] /= row[a];
        let value = y[a];
        y[..a].iter_mut().zip(row).for_each(|(y, l)| *y -= l * value);
    }
}
