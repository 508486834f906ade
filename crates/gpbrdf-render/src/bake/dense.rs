//! The bake of a dense process.

use std::fmt::Write as _;
use std::sync::PoisonError;
use std::time::Instant;

use gpbrdf_core::{AxisMetric, DenseGp, Kernel, KernelBody, N_PHI_D, N_THETA_D, N_THETA_H, Shape};
use wgpu::BufferUsages;

use super::uniforms::Dense;
use super::{Baker, Progress, Targets, ask, narrow, split, to_u32};
use crate::error::{Error, Result};

const DENSE_WGSL: &str = include_str!("../../shaders/bake/dense.wgsl");
/// Invocations of a workgroup.
const TILE: usize = 64;
/// Cells of the first dispatch at least, to fill a device.
const FEWEST_CELLS: usize = 4096;
/// Kernel values of the first dispatch, and how long one should take: drivers reset a device that is busy for seconds.
const FIRST_BUDGET: f64 = 4e6;
const SECONDS: f64 = 0.1;
/// Relative error of one kernel value in single precision.
const SINGLE_ERROR: f64 = 3e-7;
/// The error of a target above which single precision is refused.
const LARGEST_ERROR: f64 = 1e-4;

/// A kernel as a WGSL function, and its parameters.
struct KernelSource {
    text: String,
    parameters: Vec<f64>,
}

impl Baker {
    /// Adds the mean of `gp`, whose channels start at `first_channel`, to the targets: `n` kernel values a distinct
    /// cell, in dispatches of about a tenth of a second.
    pub(super) fn add_dense(
        &self,
        gp: &DenseGp,
        targets: &Targets,
        first_channel: usize,
        progress: &mut Progress<'_>,
    ) -> Result<()> {
        const WHAT: &str = "bake: dense";
        let context = &self.context;
        let double = context.f64_arithmetic();
        let kernel = KernelSource::new(gp.kernel())?;
        if !double {
            check_single_precision(gp)?;
        }
        let [AxisMetric::Linear, AxisMetric::Linear, metric] = gp.kernel().metric[..] else {
            return Err(Error::NoShader { what: format!("the metrics {:?}", gp.kernel().metric) });
        };
        let chord = metric == AxisMetric::Chord;
        let pipeline = self.dense_pipeline(&dense_wgsl(&kernel, double))?;

        let geometry = &targets.geometry;
        let rows = geometry.third().len();
        let third = |x: f64| if chord { [x.sin(), x.cos()] } else { [x, 0.0] };
        let numbers = geometry.first().iter().chain(geometry.second()).chain(geometry.scale()).copied();
        let numbers = numbers.chain(geometry.third().iter().flat_map(|&x| third(x)));
        let tables: Vec<[f32; 2]> = numbers.chain(kernel.parameters.iter().copied()).map(split).collect();
        let n = gp.n_samples();
        let weights = gp.weights();
        let samples: Vec<[[f32; 4]; 4]> = gp
            .inputs()
            .chunks(3)
            .zip(weights.chunks(gp.channels()))
            .map(|(x, w)| {
                let [x2, x3] = third(x[2]);
                let coordinates = [x[0], x[1], x2, x3].map(split);
                let mut weights = [[0.0; 2]; 4];
                weights[first_channel..].iter_mut().zip(w).for_each(|(out, &w)| *out = split(w));
                let half = |pairs: [[f32; 2]; 4], k: usize| pairs.map(|pair| pair[k]);
                [half(coordinates, 0), half(coordinates, 1), half(weights, 0), half(weights, 1)]
            })
            .collect();
        let mut cells: Vec<u32> = Vec::new();
        for i in 0..N_THETA_H {
            for row in 0..rows {
                let column = i * (N_PHI_D / 2) + row.min(N_PHI_D - 1 - row);
                let start = to_u32((i * rows + row) * N_THETA_D);
                cells.extend(start..start + to_u32(geometry.distinct()[column]));
            }
        }
        let storage = BufferUsages::STORAGE;
        let tables = context.buffer_of("bake: tables", bytemuck::cast_slice(&tables), storage)?;
        let samples = context.buffer_of("bake: samples", bytemuck::cast_slice(&samples), storage)?;
        let list = context.buffer_of("bake: cells", bytemuck::cast_slice(&cells), storage)?;

        let most_cells = TILE * context.device().limits().max_compute_workgroups_per_dimension as usize;
        let mut budget = FIRST_BUDGET;
        let mut cell = 0;
        while cell < cells.len() {
            let count = rows_within(budget, n).clamp(FEWEST_CELLS, most_cells).min(cells.len() - cell);
            let mut sample = 0;
            while sample < n {
                let done = (cell as f64 + count as f64 * sample as f64 / n as f64) / cells.len() as f64;
                ask(progress, done)?;
                let begin = Instant::now();
                let last_sample = (sample + rows_within(budget, count).max(TILE)).min(n);
                let uniform = context.uniform(&Dense {
                    first_cell: to_u32(cell),
                    last_cell: to_u32(cell + count),
                    first_sample: to_u32(sample),
                    last_sample: to_u32(last_sample),
                    rows: to_u32(rows),
                    chord: u32::from(chord),
                    limit: narrow(geometry.limit().min(f64::from(f32::MAX))),
                    unused: 0,
                })?;
                context.guard(WHAT, || {
                    let bindings =
                        [(0, &uniform), (1, &tables), (2, &samples), (3, &list), (4, &targets.buffer)];
                    let group = context.bind_buffers(&pipeline, &bindings);
                    context.dispatch(&pipeline, &group, [to_u32(count.div_ceil(TILE)), 1, 1]);
                })?;
                context.wait(WHAT)?;
                let took = begin.elapsed().as_secs_f64().max(1e-4);
                let work = count as f64 * (last_sample - sample) as f64;
                budget = (work * SECONDS / took).clamp(0.25 * budget, 4.0 * budget);
                sample = last_sample;
            }
            cell += count;
        }
        Ok(())
    }

    fn dense_pipeline(&self, source: &str) -> Result<wgpu::ComputePipeline> {
        let mut known = self.dense.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = known.get(source) {
            return Ok(pipeline.clone());
        }
        let pipeline = self.context.compute_pipeline("bake: dense", source, "sum_kernels")?;
        known.insert(source.to_owned(), pipeline.clone());
        Ok(pipeline)
    }
}

/// How many rows of `n` kernel values a budget pays for.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "positive, and bounded by the caller"
)]
fn rows_within(budget: f64, n: usize) -> usize {
    (budget / n.max(1) as f64).ceil() as usize
}

/// Refuses a process whose weights cancel too much for single precision: the error of a target is that of a kernel value
/// times `sqrt(sum weights^2)`.
fn check_single_precision(gp: &DenseGp) -> Result<()> {
    let squares = gp.weights().iter().map(|w| w * w).sum::<f64>() / gp.channels() as f64;
    let error = SINGLE_ERROR * gp.kernel().prior_variance() * squares.sqrt();
    if error <= LARGEST_ERROR {
        return Ok(());
    }
    let what = format!(
        "this dense model on a device without f64: single precision would be off by {error:.0e} in target units"
    );
    Err(Error::NoShader { what })
}

fn dense_wgsl(kernel: &KernelSource, double: bool) -> String {
    let real = if double { "f64" } else { "f32" };
    let count = kernel.parameters.len();
    format!("alias real = {real};\nconst PARAMETERS: u32 = {count}u;\n\n{DENSE_WGSL}\n{}", kernel.text)
}

impl KernelSource {
    fn new(kernel: &Kernel) -> Result<Self> {
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

/// A call of a shape's function.
fn call(shape: Shape, r2: &str, parameter: &mut impl FnMut(f64) -> String) -> Result<String> {
    Ok(match shape {
        Shape::SquaredExponential => format!("squared_exponential({r2})"),
        Shape::Matern12 => format!("matern_1_2({r2})"),
        Shape::Matern32 => format!("matern_3_2({r2})"),
        Shape::Matern52 => format!("matern_5_2({r2})"),
        Shape::RationalQuadratic { alpha } => format!("rational_quadratic({r2}, {})", parameter(alpha)),
        other => return Err(Error::NoShader { what: format!("the kernel {}", other.name()) }),
    })
}

/// The shader of a kernel with every shape.
#[cfg(test)]
pub(super) fn dense_wgsl_for_tests(double: bool) -> String {
    let shapes = [
        Shape::SquaredExponential,
        Shape::RationalQuadratic { alpha: 1.0 },
        Shape::Matern12,
        Shape::Matern32,
        Shape::Matern52,
    ];
    let mut kernel = Kernel::ard(1.0, shapes[0], &[1.0; 3]);
    kernel.terms.extend(shapes[1..].iter().flat_map(|&shape| Kernel::ard(1.0, shape, &[1.0; 3]).terms));
    dense_wgsl(&KernelSource::new(&kernel).unwrap(), double)
}
