//! The bake of a process in its separable form.

use std::sync::Arc;

use gpbrdf_core::brdf::N_THETA_H;
use gpbrdf_core::gp::{LatticeGp, SeparableForm, TableGeometry};
use gpbrdf_core::kernel::Kernel1d;
use gpbrdf_core::sample::InputSpace;
use wgpu::BufferUsages;

use super::axis_table::AxisTable;
use super::targets::{Targets, groups};
use crate::context::Context;
use crate::error::Result;
use crate::gpu_types::{self, narrow, to_u32};
use crate::shader;

const WHAT: &str = "bake: separable form";

/// A process in its separable form as the shader reads it.
#[derive(Debug)]
pub(super) struct Separable {
    functions: Arc<Functions>,
    uniform: gpu_types::Separable,
    coefficients: Vec<[f32; 4]>,
    pub(super) placement: Placement,
}

/// What the kernels of a lattice alone decide: the functions along its axes.
#[derive(Debug)]
pub(super) struct Functions {
    space: InputSpace,
    coordinates: [Vec<f64>; 3],
    kernels: [Kernel1d; 3],
    tables: Vec<f32>,
    cubics: Vec<[f32; 4]>,
    /// Functions along each axis.
    shape: [usize; 3],
    /// What the uniform of every process with these functions holds.
    uniform: gpu_types::Separable,
}

impl Functions {
    /// Whether a lattice in `space` has these functions.
    pub(super) fn are_of(&self, gp: &LatticeGp, space: InputSpace) -> bool {
        self.space == space && self.kernels == gp.hyper().kernels && self.coordinates == gp.data().coordinates
    }

    /// Tabulates the functions of every axis, those of `theta_h` and `phi_d` at the cells of `geometry`, those of
    /// `theta_d` as piecewise cubics.
    pub(super) fn new(
        gp: &LatticeGp,
        form: &SeparableForm<'_>,
        space: InputSpace,
        geometry: &TableGeometry,
    ) -> Self {
        let axis = AxisTable::new(form, &gp.data().coordinates[1]);
        let mut tables = Tables::default();
        let first = tables.push_basis(form, 0, geometry.first());
        let third = tables.push_basis(form, 2, geometry.third());
        let second = [
            tables.push(geometry.second().iter().copied()),
            tables.push(geometry.scale().iter().copied()),
            tables.push(geometry.distinct().iter().map(|&n| n as f64)),
            tables.push(axis.breaks.iter().map(|&x| f64::from(x))),
        ];
        let [a, b, c] = form.shape();
        let uniform = gpu_types::Separable {
            shape: [a, b, c, geometry.third().len()].map(to_u32),
            first,
            third,
            second,
            pieces: [to_u32(axis.breaks.len() - 1), to_u32(axis.pieces)],
            signal_variance: 0.0,
            second_prior: narrow(axis.prior),
            limit: narrow(geometry.limit().min(f64::from(f32::MAX))),
            padding: [0.0; 3],
            share: [0.0; 4],
        };
        Self {
            space,
            coordinates: gp.data().coordinates.clone(),
            kernels: gp.hyper().kernels.clone(),
            tables: tables.0,
            cubics: axis.cubics,
            shape: [a, b, c],
            uniform,
        }
    }
}

/// How the channels of a process contribute to those of the model.
#[derive(Clone, Copy, Debug)]
pub(super) enum Placement {
    /// They are the channels of the model from `first` on. Sigma is the largest one of all parts.
    Channels {
        /// A channel of the model.
        first: usize,
    },
    /// The only channel is mixed into all channels of the model by these factors, and variances add up.
    Mixed {
        /// A factor for each channel of the model.
        colour: [f64; 3],
    },
}

/// The steps of the bake.
#[derive(Debug)]
pub(super) struct Pipelines {
    contract_first: wgpu::ComputePipeline,
    contract_third: wgpu::ComputePipeline,
    evaluate_second: wgpu::ComputePipeline,
    /// In place of `evaluate_second` for [`Placement::Mixed`].
    evaluate_component: wgpu::ComputePipeline,
    /// After all parts of [`Placement::Mixed`].
    largest_deviation: wgpu::ComputePipeline,
}

impl Pipelines {
    pub(super) fn new(context: &Context) -> Result<Self> {
        let source = shader::separable();
        let pipeline = |entry| context.compute_pipeline(WHAT, &source, entry);
        Ok(Self {
            contract_first: pipeline("contract_first")?,
            contract_third: pipeline("contract_third")?,
            evaluate_second: pipeline("evaluate_second")?,
            evaluate_component: pipeline("evaluate_component")?,
            largest_deviation: pipeline("largest_deviation")?,
        })
    }

    /// Adds the mean and the variance of a process to the targets.
    ///
    /// With the default lattice of 64 x 32 x 18 nodes the three steps take 18 M, 15 M and 23 M multiply-adds
    /// of four components.
    pub(super) fn add(&self, context: &Context, process: &Separable, targets: &Targets<'_>) -> Result<()> {
        let operands = Operands::new(context, process)?;
        let [_, b, c] = process.functions.shape;
        let rows = targets.rows();
        let vectors =
            |label, count: usize| context.empty_buffer(label, 16 * count as u64, BufferUsages::STORAGE);
        let along_first = vectors("bake: theta_h", N_THETA_H * b * c)?;
        let along_both = vectors("bake: theta_h and phi_d", N_THETA_H * rows * b)?;
        let evaluate = match process.placement {
            Placement::Channels { .. } => &self.evaluate_second,
            Placement::Mixed { .. } => &self.evaluate_component,
        };
        context.guard(WHAT, || {
            let contract = |pipeline, operand, result, count| {
                let bindings = [(0, &operands.uniform), (1, &operands.tables), (3, operand), (4, result)];
                context.dispatch(pipeline, &context.bind_buffers(pipeline, &bindings), count);
            };
            let slabs = to_u32(N_THETA_H);
            let count = [groups(b * c, 64), slabs, 1];
            contract(&self.contract_first, &operands.coefficients, &along_first, count);
            let count = [groups(b, 8), groups(rows, 8), slabs];
            contract(&self.contract_third, &along_first, &along_both, count);
            let bindings = [
                (0, &operands.uniform),
                (1, &operands.tables),
                (2, &operands.cubics),
                (3, &along_both),
                (4, &targets.buffer),
            ];
            context.dispatch(evaluate, &context.bind_buffers(evaluate, &bindings), targets.workgroups());
        })
    }

    /// Turns the variances that parts of [`Placement::Mixed`] have added up into sigma.
    pub(super) fn finish_sigma(&self, context: &Context, targets: &Targets<'_>) -> Result<()> {
        let shape = [0, 0, 0, to_u32(targets.rows())];
        let uniform = context.uniform(&gpu_types::Separable { shape, ..Default::default() })?;
        context.guard(WHAT, || {
            let pipeline = &self.largest_deviation;
            let group = context.bind_buffers(pipeline, &[(0, &uniform), (4, &targets.buffer)]);
            context.dispatch(pipeline, &group, targets.workgroups());
        })
    }
}

/// A process on the device.
struct Operands {
    uniform: wgpu::Buffer,
    tables: wgpu::Buffer,
    cubics: wgpu::Buffer,
    coefficients: wgpu::Buffer,
}

impl Operands {
    fn new(context: &Context, process: &Separable) -> Result<Self> {
        let buffer = |label, bytes| context.buffer_of(label, bytes, BufferUsages::STORAGE);
        Ok(Self {
            uniform: context.uniform(&process.uniform)?,
            tables: buffer("bake: tables", bytemuck::cast_slice(&process.functions.tables))?,
            cubics: buffer("bake: cubics", bytemuck::cast_slice(&process.functions.cubics))?,
            coefficients: buffer("bake: coefficients", bytemuck::cast_slice(&process.coefficients))?,
        })
    }
}

impl Separable {
    /// A process whose functions are known.
    pub(super) fn new(
        gp: &LatticeGp,
        form: &SeparableForm<'_>,
        functions: Arc<Functions>,
        placement: Placement,
    ) -> Self {
        let uniform = gpu_types::Separable {
            signal_variance: narrow(gp.hyper().signal_variance),
            share: match placement {
                Placement::Channels { .. } => [0.0; 4],
                Placement::Mixed { colour: [r, g, b] } => [r * r, g * g, b * b, 0.0].map(narrow),
            },
            ..functions.uniform
        };
        Self { functions, uniform, coefficients: coefficients(form, placement), placement }
    }
}

/// The coefficients of all channels of the model and, in w, the share of the variance that noise hides.
fn coefficients(form: &SeparableForm<'_>, placement: Placement) -> Vec<[f32; 4]> {
    let mut coefficients: Vec<[f32; 4]> =
        form.unexplained().iter().map(|&x| [0.0, 0.0, 0.0, narrow(x)]).collect();
    for (channel, tensor) in form.coefficients().chunks(coefficients.len()).enumerate() {
        for (out, &x) in coefficients.iter_mut().zip(tensor) {
            match placement {
                Placement::Channels { first } => out[first + channel] = narrow(x),
                Placement::Mixed { colour } => (0..3).for_each(|c| out[c] = narrow(colour[c] * x)),
            }
        }
    }
    coefficients
}

/// Numbers of one buffer, which holds several tables.
#[derive(Default)]
struct Tables(Vec<f32>);

impl Tables {
    /// Adds a table and returns its offset.
    fn push(&mut self, table: impl IntoIterator<Item = f64>) -> u32 {
        let start = to_u32(self.0.len());
        self.0.extend(table.into_iter().map(narrow));
        start
    }

    /// Adds the functions of an axis at some points and the (prior, residual) variances there; returns both
    /// offsets.
    fn push_basis(&mut self, form: &SeparableForm<'_>, axis: usize, points: &[f64]) -> [u32; 2] {
        let basis = form.basis(axis, points);
        let variances = basis.prior.iter().zip(&basis.residual).flat_map(|(p, r)| [*p, *r]);
        [self.push(basis.values.iter().copied()), self.push(variances)]
    }
}
