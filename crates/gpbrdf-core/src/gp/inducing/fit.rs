//! The search for shapes, densities and length scales of inducing lattices, and the fit of their values.
//!
//! The whole table is known, with thousands of cells for each stored number, so nothing can be overfitted:
//! the search minimises the weighted squared residual of the closed-form regression itself. Shapes grow
//! greedily: each step extends the axis of the component that lowers the residual most per additional node.
//! Few numbers cannot follow every peak, which leaves residuals with heavy tails, so robust weights are
//! computed anew as the lattices grow; see [`heavy_tailed_weights`].

use rayon::prelude::*;

use super::heavy_tails::heavy_tailed_weights;
use super::regression::{CardinalAxis, Regression, regress};
use super::{COLOUR_CONSTANTS, COMPONENT_CONSTANTS, InducingShape, check_shape};
use crate::base::error::{Error, Result};
use crate::base::linalg::view;
use crate::kernel::{Kernel1d, Shape};
use crate::sample::lattice::PHI_DENSITY;
use crate::sample::space::WarpedBox;
use crate::sample::symmetry::Symmetry;

/// Ratio of noise to signal variance in the regression. It is too small to matter where there are thousands
/// of cells per node, and large enough to keep the values of nodes without data from running away.
const REGRESSION_RATIO: f64 = 1e-5;

/// Shapes are searched up to this number of nodes in all; larger lattices keep the proportions found there.
const LARGEST_SEARCH: usize = 1400;

/// The robust weights are computed anew whenever the number of nodes has grown by this factor.
const RENEWAL: f64 = 1.6;

/// Number of times that the robust weights of the full grid are computed anew.
const WEIGHT_STEPS: usize = 3;

/// Largest number of nodes along `u`, `v` and `phi`. For comparison, the table has 90 cells along `theta_h`,
/// 90 along `theta_d` and 180 along `phi_d`.
const LARGEST_SIDES: [usize; 3] = [90, 60, 30];

/// Data of three components on a grid, `[u][v][phi]`.
#[derive(Clone, Debug)]
pub(crate) struct GridData {
    pub(crate) u: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) phi: Vec<f64>,
    pub(crate) weights: Vec<f64>,
    /// The part of each weight that outliers keep; see [`heavy_tailed_weights`].
    pub(crate) shown: Vec<f64>,
    pub(crate) components: [Vec<f64>; 3],
}

/// The result of a fit for one component.
#[derive(Clone, Debug)]
pub(crate) struct InducingFit {
    pub(crate) lattice: InducingShape,
    /// Values at the nodes.
    pub(crate) values: Vec<f64>,
    /// The variational bound on the log marginal likelihood.
    pub(crate) bound: f64,
    /// Number of regressions that were solved, over all components.
    pub(crate) evaluations: usize,
}

/// The logarithms of the parameters of the search: length scales along `u`, `v`, `phi`, then `density`,
/// `v_density` and `tail`.
type Logs = [f64; 6];

/// Bounds of these parameters, not of their logarithms.
const BOUNDS: [(f64, f64); 6] = [(0.05, 4.0), (0.05, 4.0), (0.1, 4.0), (0.3, 5.0), (0.2, 3.0), (0.35, 4.0)];

/// Starts of the search, not as logarithms: the first has nodes that crowd at grazing half vectors, the
/// second has nodes that crowd at the specular peak.
const STARTS: [[f64; 6]; 2] = [[0.3, 0.5, 0.7, 0.7, 0.6, 0.8], [0.35, 0.5, 0.7, 2.0, 0.4, 1.2]];

/// The lattice of one component during the search.
#[derive(Clone, Debug)]
struct Candidate {
    component: usize,
    shape: [usize; 3],
    logs: Logs,
    residual: f64,
    /// Number of nodes when the parameters were last searched.
    searched_at: usize,
}

impl Candidate {
    fn nodes(&self) -> usize {
        self.shape.iter().product()
    }

    fn lattice(&self, symmetry: Symmetry, kernel: Shape) -> InducingShape {
        let p = self.logs.map(f64::exp);
        InducingShape {
            shape: self.shape,
            space: WarpedBox {
                density: p[3],
                v_density: p[4],
                tail: p[5],
                symmetry,
                phi_density: PHI_DENSITY,
            },
            kernels: [p[0], p[1], p[2]].map(|length| Kernel1d::new(kernel, length)),
            signal_variance: 1.0,
            noise_variance: 1.0,
        }
    }
}

/// The search on one grid.
struct Search<'a> {
    data: &'a GridData,
    /// The robust weights: those of the grid, reduced where residuals were large.
    weights: Vec<f64>,
    symmetry: Symmetry,
    kernel: Shape,
}

impl Search<'_> {
    fn regress(&self, candidate: &Candidate) -> Result<Regression> {
        let lattice = candidate.lattice(self.symmetry, self.kernel);
        regress_on(&lattice, self.data, &self.weights, candidate.component, REGRESSION_RATIO)
    }

    /// Computes the robust weights anew from the candidates' residuals. This invalidates
    /// [`Candidate::residual`], which must be recomputed before candidates are compared.
    fn renew_weights(&mut self, candidates: &[Candidate]) -> Result<()> {
        let lattices: Vec<InducingShape> =
            candidates.iter().map(|candidate| candidate.lattice(self.symmetry, self.kernel)).collect();
        self.weights = renewed(&self.weights, &lattices, self.data)?;
        Ok(())
    }

    /// The penalised squared residual of a candidate; infinity where the regression fails.
    fn residual(&self, candidate: &Candidate) -> f64 {
        self.regress(candidate).map_or(f64::INFINITY, |r| r.penalised)
    }

    /// Moves along one parameter at a time and keeps every move that lowers the residual; the step is halved
    /// where neither direction does. Deterministic. Returns the number of regressions.
    fn refine(&self, candidate: &mut Candidate, first_step: f64, sweeps: usize) -> usize {
        let mut evaluations = 1;
        candidate.residual = self.residual(candidate);
        candidate.searched_at = candidate.nodes();
        let mut steps = [first_step; 6];
        for _ in 0..sweeps {
            for k in 0..6 {
                let (low, high) = (BOUNDS[k].0.ln(), BOUNDS[k].1.ln());
                let tries: Vec<Step> = [steps[k], -steps[k]]
                    .into_par_iter()
                    .map(|step| {
                        let mut moved = candidate.clone();
                        moved.logs[k] = (moved.logs[k] + step).clamp(low, high);
                        moved.residual = self.residual(&moved);
                        (moved, step)
                    })
                    .collect();
                evaluations += 2;
                let best = tries.into_iter().min_by(|a, b| a.0.residual.total_cmp(&b.0.residual));
                match best {
                    Some((moved, step)) if moved.residual < candidate.residual => {
                        *candidate = moved;
                        // The next step along this parameter goes a little further, in this direction first.
                        steps[k] = 1.3 * step;
                    }
                    _ => steps[k] *= 0.5,
                }
            }
            if steps.iter().all(|step| step.abs() < 0.04) {
                break;
            }
        }
        evaluations
    }

    /// Refines the candidate from every start and keeps the best result. Returns the number of regressions.
    fn best_logs(&self, candidate: &mut Candidate, sweeps: usize) -> usize {
        let mut evaluations = 0;
        for start in STARTS {
            let mut other = Candidate { logs: start.map(f64::ln), ..candidate.clone() };
            evaluations += self.refine(&mut other, 0.4, sweeps);
            if other.residual < candidate.residual {
                *candidate = other;
            }
        }
        evaluations
    }

    /// Searches the best shape with about as many nodes, and then its parameters, from the current ones and
    /// from every start. Keeps the best result and returns the number of regressions.
    fn settle(&self, candidate: &mut Candidate, sweeps: usize) -> usize {
        let shapes = shapes_of(candidate.nodes());
        let logs = STARTS.map(|start| start.map(f64::ln));
        let mut evaluations = 0;
        let mut tried = Vec::new();
        for logs in std::iter::once(candidate.logs).chain(logs) {
            let residuals: Vec<Candidate> = shapes
                .par_iter()
                .chain([candidate.shape].par_iter())
                .map(|&shape| {
                    let mut other = Candidate { shape, logs, ..candidate.clone() };
                    other.residual = self.residual(&other);
                    other
                })
                .collect();
            evaluations += residuals.len();
            tried.extend(residuals.into_iter().min_by(|a, b| a.residual.total_cmp(&b.residual)));
        }
        for mut other in tried {
            evaluations += self.refine(&mut other, 0.3, sweeps);
            if other.residual < candidate.residual {
                *candidate = other;
            }
        }
        candidate.searched_at = candidate.nodes();
        evaluations
    }
}

/// Shapes with between 85 % and 100 % of `nodes` nodes.
fn shapes_of(nodes: usize) -> Vec<[usize; 3]> {
    let mut shapes = Vec::new();
    for b in [2, 3, 4, 5, 6, 7, 8, 10, 12, 15] {
        for c in [1, 2, 3, 4, 5, 6, 8, 10, 13] {
            let a = nodes / (b * c);
            if (3..=LARGEST_SIDES[0]).contains(&a) && a * b * c * 20 >= nodes * 17 {
                shapes.push([a, b, c]);
            }
        }
    }
    shapes
}

/// A candidate and the step that led to it.
type Step = (Candidate, f64);

/// Solves the regression of one component on a lattice.
fn regress_on(
    lattice: &InducingShape,
    data: &GridData,
    weights: &[f64],
    component: usize,
    ratio: f64,
) -> Result<Regression> {
    let axes = cardinal_on(lattice, data)?;
    regress(axes.each_ref(), weights, &data.components[component], ratio)
}

/// The cardinal functions of a lattice at the points of the grid.
fn cardinal_on(lattice: &InducingShape, data: &GridData) -> Result<[CardinalAxis; 3]> {
    let u: Vec<f64> = data.u.iter().map(|&u| lattice.space.warp_u(u)).collect();
    let v: Vec<f64> = data.v.iter().map(|&v| lattice.space.warp_v(v)).collect();
    let phi: Vec<f64> = data.phi.iter().map(|&phi| lattice.space.warp_phi(phi)).collect();
    let (points, nodes) = ([u, v, phi], lattice.nodes());
    let (metrics, mirrored) = (lattice.space.lattice_metrics(), lattice.space.mirrored());
    let axis =
        |k: usize| CardinalAxis::new(&lattice.kernels[k], metrics[k], mirrored[k], &points[k], &nodes[k]);
    Ok([axis(0)?, axis(1)?, axis(2)?])
}

/// Adds the squared residuals of one component to `squares`. Colours are mixed by an orthogonal matrix, so
/// the sum over all three components equals the sum over the channels.
fn add_squares(
    lattice: &InducingShape,
    values: &[f64],
    data: &GridData,
    component: usize,
    squares: &mut [f64],
) -> Result<()> {
    let axes = cardinal_on(lattice, data)?;
    let found = crate::gp::contract(axes.each_ref().map(|axis| axis.functions.as_ref()), values, 1);
    for ((sum, found), target) in squares.iter_mut().zip(&found).zip(&data.components[component]) {
        *sum += (found - target).powi(2);
    }
    Ok(())
}

/// The size of the lattices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Budget {
    /// One shape for all three components.
    Shape([usize; 3]),
    /// At most this many stored numbers in all, constants included.
    Floats(usize),
}

/// The count of prior means, which every model stores.
const PRIOR_MEANS: usize = 3;

/// The smallest budget of floats: it pays for three lattices of the smallest shape.
pub(crate) const SMALLEST_FLOATS: usize =
    (COLOUR_CONSTANTS + PRIOR_MEANS) + 3 * (COMPONENT_CONSTANTS + SMALLEST[0] * SMALLEST[1] * SMALLEST[2]);

/// The shape from which every lattice grows.
const SMALLEST: [usize; 3] = [4, 3, 1];

/// Finds shapes, densities and length scales on the grid `coarse`, and then the values on the grid `fine`.
///
/// # Errors
/// A shape or number of floats out of range, or regressions that cannot be solved.
pub(crate) fn fit_inducing(
    fine: &GridData,
    coarse: &GridData,
    symmetry: Symmetry,
    kernel: Shape,
    budget: Budget,
) -> Result<Vec<InducingFit>> {
    kernel.validate()?;
    let mut search = Search { data: coarse, weights: coarse.weights.clone(), symmetry, kernel };
    let first = |component| Candidate {
        component,
        shape: SMALLEST,
        logs: STARTS[0].map(f64::ln),
        residual: f64::INFINITY,
        searched_at: 0,
    };
    let mut candidates: Vec<Candidate> = (0..3).map(first).collect();
    let mut evaluations = 0;
    match budget {
        Budget::Shape(shape) => {
            check_shape(shape)?;
            for candidate in &mut candidates {
                // The parameters of a large lattice are searched on a smaller one of the same proportions.
                let searched = shrink(shape, LARGEST_SEARCH / 3);
                candidate.shape = searched;
                evaluations += search.best_logs(candidate, 8);
            }
            search.renew_weights(&candidates)?;
            for candidate in &mut candidates {
                evaluations += search.refine(candidate, 0.2, 8);
                candidate.shape = shape;
            }
        }
        Budget::Floats(floats) => {
            if floats < SMALLEST_FLOATS {
                let expected = format!("at least {SMALLEST_FLOATS}");
                return Err(Error::argument("number of floats", expected, floats));
            }
            let nodes = floats - (COLOUR_CONSTANTS + PRIOR_MEANS) - 3 * COMPONENT_CONSTANTS;
            evaluations += grow(&mut search, &mut candidates, nodes.min(LARGEST_SEARCH))?;
            if nodes > LARGEST_SEARCH {
                enlarge(&mut candidates, nodes);
            }
            for candidate in &candidates {
                check_shape(candidate.shape)?;
            }
        }
    }
    let lattices: Vec<InducingShape> =
        candidates.iter().map(|candidate| candidate.lattice(symmetry, kernel)).collect();
    let weights = renewed_weights(&lattices, fine)?;
    let components = lattices.into_iter().enumerate();
    components.map(|(k, lattice)| finish(lattice, fine, &weights, k, evaluations)).collect()
}

/// Robust weights of the full grid, by [`WEIGHT_STEPS`] reweighting steps from its own weights.
fn renewed_weights(lattices: &[InducingShape], data: &GridData) -> Result<Vec<f64>> {
    let mut weights = data.weights.clone();
    for _ in 0..WEIGHT_STEPS {
        weights = renewed(&weights, lattices, data)?;
    }
    Ok(weights)
}

/// One reweighting step: solves each component's regression with `weights`, and returns the grid's own
/// weights reduced where the squared residuals are large (see [`heavy_tailed_weights`]).
fn renewed(weights: &[f64], lattices: &[InducingShape], data: &GridData) -> Result<Vec<f64>> {
    let mut squares = vec![0.0; weights.len()];
    for (component, lattice) in lattices.iter().enumerate() {
        let values = regress_on(lattice, data, weights, component, REGRESSION_RATIO)?.values;
        add_squares(lattice, &values, data, component, &mut squares)?;
    }
    Ok(heavy_tailed_weights(&data.weights, &data.shown, &squares))
}

/// Grows the lattices until no further step fits within `nodes` nodes in all. Returns the number of
/// regressions.
///
/// # Errors
/// Regressions that cannot be solved.
fn grow(search: &mut Search<'_>, candidates: &mut [Candidate], nodes: usize) -> Result<usize> {
    let mut evaluations = 0;
    for candidate in candidates.iter_mut() {
        evaluations += search.settle(candidate, 3);
    }
    let mut renewed_at = 0;
    // The possible next steps of each component. They stay valid until the component or the weights change.
    let mut options: Vec<Vec<Candidate>> = candidates.iter().map(|_| Vec::new()).collect();
    loop {
        let used: usize = candidates.iter().map(Candidate::nodes).sum();
        if used as f64 >= RENEWAL * renewed_at as f64 {
            search.renew_weights(candidates)?;
            renewed_at = used;
            candidates.iter_mut().for_each(|candidate| candidate.residual = search.residual(candidate));
            options.iter_mut().for_each(Vec::clear);
        }
        for (k, candidate) in candidates.iter_mut().enumerate() {
            if candidate.nodes() as f64 >= 1.6 * candidate.searched_at as f64 {
                evaluations += search.settle(candidate, 2);
                options[k].clear();
            }
            if options[k].is_empty() {
                // An axis grows by one node or by half of its nodes: a narrow peak may not gain anything
                // before nodes are dense enough to resolve it.
                options[k] = (0..6)
                    .into_par_iter()
                    .filter(|option| candidate.shape[option / 2] < LARGEST_SIDES[option / 2])
                    .map(|option| {
                        let (mut larger, axis) = (candidate.clone(), option / 2);
                        larger.shape[axis] += if option % 2 == 0 { 1 } else { 1 + larger.shape[axis] / 2 };
                        larger.residual = search.residual(&larger);
                        larger
                    })
                    .collect();
                evaluations += options[k].len();
            }
        }
        let mut best: Option<(f64, usize, usize)> = None;
        for (k, candidate) in candidates.iter().enumerate() {
            for (o, option) in options[k].iter().enumerate() {
                let more = option.nodes() - candidate.nodes();
                let gain = (candidate.residual - option.residual) / more as f64;
                if used + more <= nodes && best.is_none_or(|(known, ..)| gain > known) {
                    best = Some((gain, k, o));
                }
            }
        }
        let Some((_, k, o)) = best else { break };
        candidates[k] = options[k].swap_remove(o);
        options[k].clear();
    }
    search.renew_weights(candidates)?;
    for candidate in candidates.iter_mut() {
        evaluations += search.settle(candidate, 6);
    }
    Ok(evaluations)
}

/// Enlarges the lattices in proportion to at most `nodes` nodes in all, then adds one node along one axis
/// after another while there is room.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sides are small and positive")]
fn enlarge(candidates: &mut [Candidate], nodes: usize) {
    let used: usize = candidates.iter().map(Candidate::nodes).sum();
    let scale = (nodes as f64 / used as f64).cbrt();
    for candidate in candidates.iter_mut() {
        for (axis, side) in candidate.shape.iter_mut().enumerate() {
            *side = ((*side as f64 * scale).floor() as usize).clamp(1, LARGEST_SIDES[axis]);
        }
    }
    for axis in (0..3).cycle().take(60) {
        for k in 0..candidates.len() {
            let used: usize = candidates.iter().map(Candidate::nodes).sum();
            let candidate = &mut candidates[k];
            let more = candidate.nodes() / candidate.shape[axis];
            if used + more <= nodes && candidate.shape[axis] < LARGEST_SIDES[axis] {
                candidate.shape[axis] += 1;
            }
        }
    }
}

/// A shape with the same proportions and about `nodes` nodes; the given shape if it has fewer.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sides are small and positive")]
fn shrink(shape: [usize; 3], nodes: usize) -> [usize; 3] {
    let scale = (nodes as f64 / shape.iter().product::<usize>() as f64).cbrt().min(1.0);
    shape.map(|side| ((side as f64 * scale).round() as usize).max(1))
}

/// Fits the values on the full grid, and the variances that go with them.
///
/// The signal variance `s^2` is the scale of the `M` values under their prior, `m^T K_ZZ^-1 m / M`, but no
/// larger than what would explain half of the mean squared residual as variance between the nodes. The noise
/// variance is the remainder of that residual. The bound is that of M. Titsias, "Variational Learning of
/// Inducing Variables in Sparse Gaussian Processes" (2009), with noise variance `noise / weight` for each
/// point.
fn finish(
    mut lattice: InducingShape,
    data: &GridData,
    weights: &[f64],
    component: usize,
    evaluations: usize,
) -> Result<InducingFit> {
    let Regression { values, explained, .. } =
        regress_on(&lattice, data, weights, component, REGRESSION_RATIO)?;
    let n: f64 = data.weights.iter().sum();
    let mut squares = vec![0.0; weights.len()];
    add_squares(&lattice, &values, data, component, &mut squares)?;
    // The noise variance is estimated with the grid's own weights, so outliers contribute to it in full.
    let residual = (squares.iter().zip(&data.weights).map(|(r, w)| r * w).sum::<f64>() / n).max(1e-12);
    let inverses = lattice.inverses()?;
    let solved = crate::gp::contract(inverses.each_ref().map(view), &values, 1);
    let energy: f64 = solved.iter().zip(&values).map(|(a, b)| a * b).sum();
    let unexplained = ((prior_trace(&lattice, data, weights) - explained) / n).max(1e-15);
    let likely = (energy / values.len() as f64).max(1e-12);
    lattice.signal_variance = likely.min(0.5 * residual / unexplained);
    lattice.noise_variance = residual - lattice.signal_variance * unexplained;
    let bound = bound(&lattice, data, weights, component)?;
    Ok(InducingFit { lattice, values, bound, evaluations })
}

/// `sum w(x) k(x, x)` without the signal variance.
fn prior_trace(lattice: &InducingShape, data: &GridData, weights: &[f64]) -> f64 {
    let (metrics, mirrored) = (lattice.space.lattice_metrics(), lattice.space.mirrored());
    let variance = |k: usize, x: f64| {
        let kernel = &lattice.kernels[k];
        let image = if mirrored[k] { kernel.value(metrics[k].distance(x, -x)) } else { 0.0 };
        kernel.value(0.0) + image
    };
    let along_phi: Vec<f64> = data.phi.iter().map(|&phi| variance(2, lattice.space.warp_phi(phi))).collect();
    let rest = variance(0, 0.0) * variance(1, 0.0);
    weights
        .chunks(along_phi.len())
        .map(|row| row.iter().zip(&along_phi).map(|(w, k)| w * k).sum::<f64>())
        .sum::<f64>()
        * rest
}

/// The variational bound on the log marginal likelihood at the lattice's own hyper-parameters.
///
/// # Errors
/// A regression that cannot be solved.
fn bound(lattice: &InducingShape, data: &GridData, weights: &[f64], component: usize) -> Result<f64> {
    let (signal, noise) = (lattice.signal_variance, lattice.noise_variance);
    let solved = regress_on(lattice, data, weights, component, noise / signal)?;
    let counted = weights.iter().filter(|w| **w > 0.0);
    let (mut n, mut log_noise) = (0.0, 0.0);
    for weight in counted {
        n += 1.0;
        log_noise += (noise / weight).ln();
    }
    let likelihood = -0.5
        * (n * (2.0 * std::f64::consts::PI).ln() + log_noise + solved.log_det + solved.penalised / noise);
    Ok(likelihood - 0.5 * signal / noise * (prior_trace(lattice, data, weights) - solved.explained))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gp::inducing::node_covariance::axis_kernel;
    use nalgebra::{DMatrix, DVector};

    /// A smooth function of the box on a small grid.
    fn data(sides: [usize; 3]) -> GridData {
        let axis =
            |n: usize, end: f64| (0..n).map(|i| (i as f64 + 0.5) / n as f64 * end).collect::<Vec<f64>>();
        let [u, v, phi] =
            [axis(sides[0], 1.0), axis(sides[1], 1.0), axis(sides[2], std::f64::consts::FRAC_PI_2)];
        let mut components = [const { Vec::new() }; 3];
        let mut weights = Vec::new();
        for &u in &u {
            for &v in &v {
                for &phi in &phi {
                    components[0].push((-8.0 * u * u).exp() * (1.0 + v * v) + 0.3 * (2.0 * phi).cos() * v);
                    components[1].push(0.1 * u * v);
                    components[2].push(0.01 * v);
                    weights.push(0.5 + u * v);
                }
            }
        }
        GridData { u, v, phi, shown: vec![0.0; weights.len()], weights, components }
    }

    fn lattice(shape: [usize; 3]) -> InducingShape {
        let space = WarpedBox {
            density: 1.4,
            v_density: 0.8,
            tail: 1.3,
            symmetry: Symmetry::Bilateral,
            phi_density: 1.2,
        };
        let kernels = [0.4, 0.6, 0.8].map(|length| Kernel1d::new(Shape::Matern52, length));
        InducingShape { shape, space, kernels, signal_variance: 0.7, noise_variance: 0.02 }
    }

    #[test]
    fn the_bound_is_the_dense_one_and_stays_below_the_exact_likelihood() {
        let (data, lattice) = (data([6, 5, 4]), lattice([3, 2, 2]));
        let found = bound(&lattice, &data, &data.weights, 0).unwrap();
        // The same bound with dense matrices, from its definition.
        let points = [
            data.u.iter().map(|&u| lattice.space.warp_u(u)).collect::<Vec<_>>(),
            data.v.iter().map(|&v| lattice.space.warp_v(v)).collect(),
            data.phi.iter().map(|&phi| lattice.space.warp_phi(phi)).collect(),
        ];
        let nodes = lattice.nodes();
        let (metrics, mirrored) = (lattice.space.lattice_metrics(), lattice.space.mirrored());
        let matrix = |x: &[Vec<f64>; 3], z: &[Vec<f64>; 3]| {
            let [a, b, c] = std::array::from_fn(|k| {
                let m = axis_kernel(&lattice.kernels[k], metrics[k], mirrored[k], &x[k], &z[k]);
                DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
            });
            a.kronecker(&b).kronecker(&c) * lattice.signal_variance
        };
        let (k_xx, k_zx, k_zz) = (matrix(&points, &points), matrix(&nodes, &points), matrix(&nodes, &nodes));
        let q = k_zx.transpose() * k_zz.lu().solve(&k_zx).unwrap();
        let noise: Vec<f64> = data.weights.iter().map(|w| lattice.noise_variance / w).collect();
        let noise = DMatrix::from_diagonal(&DVector::from_vec(noise));
        let y = DVector::from_vec(data.components[0].clone());
        let likelihood = |covariance: DMatrix<f64>| {
            let factor = covariance.cholesky().unwrap();
            let log_det = 2.0 * factor.l().diagonal().map(f64::ln).sum();
            -0.5 * (y.dot(&factor.solve(&y)) + log_det + y.len() as f64 * (2.0 * std::f64::consts::PI).ln())
        };
        let gap: f64 = (0..y.len()).map(|i| (k_xx[(i, i)] - q[(i, i)]) / noise[(i, i)]).sum();
        let expected = likelihood(&q + &noise) - 0.5 * gap;
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        let exact = likelihood(&k_xx + &noise);
        assert!(found < exact, "{found} {exact}");
        // With more nodes the bound comes closer to the exact likelihood.
        let more =
            bound(&InducingShape { shape: [5, 4, 3], ..lattice.clone() }, &data, &data.weights, 0).unwrap();
        assert!(found < more && more < exact, "{found} {more} {exact}");
    }

    #[test]
    fn floats_go_where_they_matter_and_never_beyond_the_budget() {
        let data = data([30, 10, 6]);
        let fit = |floats| {
            let budget = Budget::Floats(floats);
            fit_inducing(&data, &data, Symmetry::Bilateral, Shape::Matern52, budget).unwrap()
        };
        let mut residuals = Vec::new();
        for floats in [80, 150] {
            let fits = fit(floats);
            let nodes: Vec<usize> = fits.iter().map(|f| f.values.len()).collect();
            let stored =
                (COLOUR_CONSTANTS + PRIOR_MEANS) + 3 * COMPONENT_CONSTANTS + nodes.iter().sum::<usize>();
            assert!(stored <= floats && stored + 15 > floats, "{floats} {nodes:?}");
            assert!(nodes[0] > nodes[2], "{nodes:?}");
            residuals.push(fits[0].lattice.noise_variance);
        }
        assert!(residuals[1] < residuals[0], "{residuals:?}");
        const { assert!(SMALLEST_FLOATS <= 80) };
        let tiny = Budget::Floats(SMALLEST_FLOATS - 1);
        assert!(fit_inducing(&data, &data, Symmetry::Bilateral, Shape::Matern52, tiny).is_err());
    }

    #[test]
    fn points_far_off_hardly_pull_the_values() {
        // Robust weights are compared with plain squared residuals.
        let clean = data([12, 8, 6]);
        let mut spoilt = clean.clone();
        spoilt.components[0].iter_mut().step_by(41).for_each(|y| *y += 5.0);
        let lattices = [lattice([5, 4, 3]); 1];
        let values = |data: &GridData, weights: &[f64]| {
            regress_on(&lattices[0], data, weights, 0, REGRESSION_RATIO).unwrap().values
        };
        let truth = values(&clean, &clean.weights);
        let far = |found: &[f64]| found.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let renewed = renewed_weights(&lattices, &spoilt).unwrap();
        let (robust, plain) = (far(&values(&spoilt, &renewed)), far(&values(&spoilt, &spoilt.weights)));
        assert!(robust < 0.01 * plain, "{robust} {plain}");
    }

    #[test]
    fn large_budgets_keep_proportions_and_are_used() {
        let candidate =
            |component, shape| Candidate { component, shape, logs: [0.0; 6], residual: 0.0, searched_at: 1 };
        let mut candidates = vec![candidate(0, [20, 8, 5]), candidate(1, [9, 5, 3]), candidate(2, [5, 4, 2])];
        enlarge(&mut candidates, 9000);
        let used: usize = candidates.iter().map(Candidate::nodes).sum();
        assert!(used <= 9000 && used > 8600, "{used}");
        assert_eq!(shrink([40, 20, 10], 1000), [20, 10, 5]);
        assert_eq!(shrink([4, 2, 1], 1000), [4, 2, 1]);
    }
}
