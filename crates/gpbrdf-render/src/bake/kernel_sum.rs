//! The bake of a process in the form of a kernel sum.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use gpbrdf_core::brdf::{N_PHI_D, N_THETA_D, N_THETA_H, cell_center};
use gpbrdf_core::gp::{KernelSum, TableGeometry};
use gpbrdf_core::kernel::AxisMetric;
use wgpu::BufferUsages;

use super::kernel_source::KernelSource;
use super::targets::{Targets, groups};
use super::{Progress, report};
use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu_types::{self, Sample, narrow, to_u32};
use crate::shader;

const WHAT: &str = "bake: kernel sum";
/// `TILE` of `bake/kernel_sum.wgsl`: invocations of a workgroup.
pub(crate) const TILE: usize = 64;
/// Relative error of one kernel value in single precision.
const SINGLE_ERROR: f64 = 3e-7;
/// The error of a target above which single precision is refused.
const LARGEST_ERROR: f64 = 1e-4;

/// Refuses weights that cancel too much for single precision: the error of a target is that of a kernel value
/// times `sqrt(sum weights^2)`.
fn check_single_precision(sum: &KernelSum<'_>) -> Result<()> {
    let squares = sum.weights.iter().map(|w| w * w).sum::<f64>() / sum.n_channels as f64;
    let error = SINGLE_ERROR * sum.kernel.prior_variance() * squares.sqrt();
    if error <= LARGEST_ERROR {
        return Ok(());
    }
    let what = format!(
        "this dense model on a device without f64: single precision would be off by {error:.0e} in target \
         units"
    );
    Err(Error::NoShader { what })
}

/// The compiled shaders, one for each kernel, by their source.
#[derive(Debug, Default)]
pub(super) struct Pipelines(Mutex<HashMap<String, wgpu::ComputePipeline>>);

impl Pipelines {
    /// Adds the mean of a process, whose channels are those of the model from `first_channel` on, to the
    /// targets. Takes one kernel value for each sample and distinct cell, in dispatches of about a tenth of a
    /// second.
    pub(super) fn add(
        &self,
        context: &Context,
        process: &KernelSum<'_>,
        first_channel: usize,
        targets: &Targets<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<()> {
        let double = context.f64_arithmetic();
        let kernel = KernelSource::new(process.kernel)?;
        if !double {
            check_single_precision(process)?;
        }
        let [AxisMetric::Linear, AxisMetric::Linear, metric] = process.kernel.metric[..] else {
            return Err(Error::NoShader { what: format!("the metrics {:?}", process.kernel.metric) });
        };
        let chord = metric == AxisMetric::Chord;
        let source = shader::kernel_sum(&kernel.text, kernel.parameters.len(), double);
        let pipeline = self.get(context, &source)?;
        let operands = Operands::new(context, process, &kernel, first_channel, targets.geometry(), chord)?;
        operands.run(context, &pipeline, targets, chord, progress)
    }

    fn get(&self, context: &Context, source: &str) -> Result<wgpu::ComputePipeline> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = known.get(source) {
            return Ok(pipeline.clone());
        }
        let pipeline = context.compute_pipeline(WHAT, source, "sum_kernels")?;
        known.insert(source.to_owned(), pipeline.clone());
        Ok(pipeline)
    }
}

/// A process on the device.
struct Operands {
    tables: wgpu::Buffer,
    samples: wgpu::Buffer,
    n_samples: usize,
    cells: wgpu::Buffer,
    n_cells: usize,
}

impl Operands {
    fn new(
        context: &Context,
        process: &KernelSum<'_>,
        kernel: &KernelSource,
        first_channel: usize,
        geometry: &TableGeometry,
        chord: bool,
    ) -> Result<Self> {
        let cells = distinct_cells(geometry);
        let tables = tables(kernel, process, geometry, &cells, chord);
        let samples = samples(process, first_channel, chord);
        let buffer = |label, bytes| context.buffer_of(label, bytes, BufferUsages::STORAGE);
        Ok(Self {
            tables: buffer("bake: tables", bytemuck::cast_slice(&tables))?,
            samples: buffer("bake: samples", bytemuck::cast_slice(&samples))?,
            n_samples: process.n_samples(),
            cells: buffer("bake: cells", bytemuck::cast_slice(&cells))?,
            n_cells: cells.len(),
        })
    }

    /// Sums over all samples for all cells, a block of cells and samples in each dispatch.
    fn run(
        &self,
        context: &Context,
        pipeline: &wgpu::ComputePipeline,
        targets: &Targets<'_>,
        chord: bool,
        progress: &mut Progress<'_>,
    ) -> Result<()> {
        let most_cells = TILE * context.device().limits().max_compute_workgroups_per_dimension as usize;
        let n = self.n_samples;
        let mut pace = Pace::default();
        let mut cell = 0;
        while cell < self.n_cells {
            let count = pace.cells(n).min(most_cells).min(self.n_cells - cell);
            let mut sample = 0;
            while sample < n {
                let rows_done = cell as f64 + count as f64 * sample as f64 / n as f64;
                report(progress, rows_done / self.n_cells as f64)?;
                let begin = Instant::now();
                let last_sample = (sample + pace.samples(count)).min(n);
                let uniform = context.uniform(&gpu_types::KernelSum {
                    first_cell: to_u32(cell),
                    last_cell: to_u32(cell + count),
                    first_sample: to_u32(sample),
                    last_sample: to_u32(last_sample),
                    chord: u32::from(chord),
                })?;
                context.guard(WHAT, || {
                    let bindings = [
                        (0, &uniform),
                        (1, &self.tables),
                        (2, &self.samples),
                        (3, &self.cells),
                        (4, &targets.buffer),
                    ];
                    let group = context.bind_buffers(pipeline, &bindings);
                    context.dispatch(pipeline, &group, [groups(count, TILE), 1, 1]);
                })?;
                context.wait(WHAT)?;
                pace.learn(count as f64 * (last_sample - sample) as f64, begin.elapsed().as_secs_f64());
                sample = last_sample;
            }
            cell += count;
        }
        Ok(())
    }
}

/// How many kernel values a dispatch computes. Drivers reset a device that is busy for seconds, so the number
/// is adapted until a dispatch takes [`Pace::SECONDS`].
struct Pace {
    /// Kernel values of the next dispatch.
    budget: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Self { budget: 4e6 }
    }
}

impl Pace {
    const SECONDS: f64 = 0.1;
    /// Fewer cells would not fill a device.
    const FEWEST_CELLS: usize = 4096;

    /// Cells of a dispatch over `n_samples` samples.
    fn cells(&self, n_samples: usize) -> usize {
        self.rows(n_samples).max(Self::FEWEST_CELLS)
    }

    /// Samples of a dispatch over `n_cells` cells.
    fn samples(&self, n_cells: usize) -> usize {
        self.rows(n_cells).max(TILE)
    }

    /// How many rows of `n` kernel values the budget allows.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and bounded by the caller"
    )]
    fn rows(&self, n: usize) -> usize {
        (self.budget / n.max(1) as f64).ceil() as usize
    }

    /// Adapts the budget, by a factor of at most 4, after `work` kernel values have taken `seconds`.
    fn learn(&mut self, work: f64, seconds: f64) {
        let next = work * Self::SECONDS / seconds.max(1e-4);
        self.budget = next.clamp(0.25 * self.budget, 4.0 * self.budget);
    }
}

/// `x` as two f32 whose sum is `x` to 48 bits.
fn split(x: f64) -> [f32; 2] {
    let high = narrow(x);
    [high, narrow(x - f64::from(high))]
}

/// The third coordinate as the shader reads it: an angle as sine and cosine.
fn third_coordinate(x: f64, chord: bool) -> [f64; 2] {
    if chord { [x.sin(), x.cos()] } else { [x, 0.0] }
}

/// The `tables` of the shader: the parameters of the kernel, then the coordinates of `cells`.
fn tables(
    kernel: &KernelSource,
    process: &KernelSum<'_>,
    geometry: &TableGeometry,
    cells: &[u32],
    chord: bool,
) -> Vec<[f32; 2]> {
    let rows = geometry.third().len();
    let coordinates = cells.iter().flat_map(|&cell| {
        let cell = cell as usize;
        let center = cell_center(cell / N_THETA_D / rows, cell % N_THETA_D, cell / N_THETA_D % rows);
        let [x0, x1, x2] = process.space.coordinates(center);
        let [x2, x3] = third_coordinate(x2, chord);
        [x0, x1, x2, x3]
    });
    kernel.parameters.iter().copied().chain(coordinates).map(split).collect()
}

/// Samples with their weights at the channels of the model from `first_channel` on.
fn samples(process: &KernelSum<'_>, first_channel: usize, chord: bool) -> Vec<Sample> {
    let rows = process.inputs.chunks(3).zip(process.weights.chunks(process.n_channels));
    rows.map(|(x, w)| {
        let [x2, x3] = third_coordinate(x[2], chord);
        let coordinates = [x[0], x[1], x2, x3].map(split);
        let mut weights = [[0.0; 2]; 4];
        weights[first_channel..].iter_mut().zip(w).for_each(|(out, &w)| *out = split(w));
        Sample {
            high: coordinates.map(|pair| pair[0]),
            low: coordinates.map(|pair| pair[1]),
            weight_high: weights.map(|pair| pair[0]),
            weight_low: weights.map(|pair| pair[1]),
        }
    })
    .collect()
}

/// Indices of the targets of cells whose coordinates differ.
fn distinct_cells(geometry: &TableGeometry) -> Vec<u32> {
    let rows = geometry.third().len();
    let mut cells = Vec::new();
    for i in 0..N_THETA_H {
        for row in 0..rows {
            let column = i * (N_PHI_D / 2) + row.min(N_PHI_D - 1 - row);
            let start = to_u32((i * rows + row) * N_THETA_D);
            cells.extend(start..start + to_u32(geometry.distinct()[column]));
        }
    }
    cells
}
