//! The bake of a lattice process.

use gpbrdf_core::{InducingGp, LatticeGp, N_THETA_D, N_THETA_H, SeparableForm, TableGeometry};
use wgpu::BufferUsages;

use super::axis_table::AxisTable;
use super::uniforms::Lattice;
use super::{LATTICE_WGSL, Targets, narrow, to_u32};
use crate::context::Context;
use crate::error::Result;

const WHAT: &str = "bake: lattice";

/// The three steps, and what inducing lattices take in place of the last.
#[derive(Debug)]
pub(super) struct Pipelines {
    first: wgpu::ComputePipeline,
    third: wgpu::ComputePipeline,
    second: wgpu::ComputePipeline,
    component: wgpu::ComputePipeline,
    deviation: wgpu::ComputePipeline,
}

/// How a process adds to the targets.
enum Part {
    /// Its channels are those of the targets from this one on; sigma is the largest of all parts.
    Channels(usize),
    /// Its one channel is mixed into all three, so that variances add up.
    Component([f64; 3]),
}

/// Numbers of one buffer, and where each part starts.
#[derive(Default)]
struct Tables(Vec<f32>);

impl Tables {
    fn push(&mut self, part: impl IntoIterator<Item = f64>) -> u32 {
        let start = to_u32(self.0.len());
        self.0.extend(part.into_iter().map(narrow));
        start
    }
}

impl Pipelines {
    pub(super) fn new(context: &Context) -> Result<Self> {
        let pipeline = |entry| context.compute_pipeline("bake: lattice", LATTICE_WGSL, entry);
        Ok(Self {
            first: pipeline("contract_first")?,
            third: pipeline("contract_third")?,
            second: pipeline("evaluate_second")?,
            component: pipeline("evaluate_component")?,
            deviation: pipeline("largest_deviation")?,
        })
    }

    /// Adds the mean of `gp`, whose channels start at `first_channel`, to the targets, and raises sigma to its own.
    ///
    /// With the default lattice of 64 x 32 x 18 nodes that is 18 M + 15 M + 23 M multiply-adds of four components.
    pub(super) fn add(
        &self,
        context: &Context,
        gp: &LatticeGp,
        targets: &Targets,
        first_channel: usize,
    ) -> Result<()> {
        self.add_part(context, gp, &targets.geometry, targets, &Part::Channels(first_channel)).map(|_| ())
    }

    /// Adds component `k` of `gp` to the targets: the mean times its colour, and its variance times the squares of that to
    /// the variances of the channels. The last component turns those into sigma.
    pub(super) fn add_component(
        &self,
        context: &Context,
        gp: &InducingGp,
        k: usize,
        targets: &Targets,
    ) -> Result<()> {
        let Some(component) = gp.components.get(k) else { return Ok(()) };
        let geometry = TableGeometry::new(component.lattice().space);
        let part = Part::Component(gp.mix.map(|row| row[k]));
        let uniform = self.add_part(context, component.gp(), &geometry, targets, &part)?;
        if k + 1 < gp.components.len() {
            return Ok(());
        }
        context.guard(WHAT, || {
            let group = context.bind_buffers(&self.deviation, &[(0, &uniform), (4, &targets.buffer)]);
            context.dispatch(&self.deviation, &group, cells(geometry.third().len()));
        })
    }

    /// Adds one process; the answer is its uniform.
    fn add_part(
        &self,
        context: &Context,
        gp: &LatticeGp,
        geometry: &TableGeometry,
        targets: &Targets,
        part: &Part,
    ) -> Result<wgpu::Buffer> {
        let form = SeparableForm::new(gp);
        let [a, b, c] = form.shape();
        let rows = geometry.third().len();
        let axis = AxisTable::new(&form, &gp.data().coordinates[1]);

        let mut tables = Tables::default();
        let mut place = |k: usize, points: &[f64]| {
            let basis = form.basis(k, points);
            let variances = basis.prior.iter().zip(&basis.residual).flat_map(|(p, r)| [*p, *r]);
            [tables.push(basis.values.iter().copied()), tables.push(variances)]
        };
        let first = place(0, geometry.first());
        let third = place(2, geometry.third());
        let second = [
            tables.push(geometry.second().iter().copied()),
            tables.push(geometry.scale().iter().copied()),
            tables.push(geometry.distinct().iter().map(|&n| n as f64)),
            tables.push(axis.breaks.iter().map(|&x| f64::from(x))),
        ];
        let uniform = Lattice {
            shape: [a, b, c, rows].map(to_u32),
            first,
            third,
            second,
            pieces: [to_u32(axis.breaks.len() - 1), to_u32(axis.pieces)],
            signal_variance: narrow(gp.hyper().signal_variance),
            second_prior: narrow(axis.prior),
            limit: narrow(geometry.limit().min(f64::from(f32::MAX))),
            padding: [0.0; 3],
            share: match part {
                Part::Channels(_) => [0.0; 4],
                Part::Component([r, g, b]) => [r * r, g * g, b * b, 0.0].map(narrow),
            },
        };
        let nodes = a * b * c;
        let mut coefficients: Vec<[f32; 4]> =
            form.unexplained().iter().map(|&x| [0.0, 0.0, 0.0, narrow(x)]).collect();
        for (channel, tensor) in form.coefficients().chunks(nodes).enumerate() {
            for (out, &x) in coefficients.iter_mut().zip(tensor) {
                match part {
                    Part::Channels(first) => out[first + channel] = narrow(x),
                    Part::Component(colour) => (0..3).for_each(|c| out[c] = narrow(colour[c] * x)),
                }
            }
        }

        let storage = BufferUsages::STORAGE;
        let uniform = context.uniform(&uniform)?;
        let tables = context.buffer_of("bake: tables", bytemuck::cast_slice(&tables.0), storage)?;
        let cubics = context.buffer_of("bake: cubics", bytemuck::cast_slice(&axis.cubics), storage)?;
        let coefficients =
            context.buffer_of("bake: coefficients", bytemuck::cast_slice(&coefficients), storage)?;
        let vectors = |label, count: usize| context.empty_buffer(label, 16 * count as u64, storage);
        let along_first = vectors("bake: theta_h", N_THETA_H * b * c)?;
        let along_both = vectors("bake: theta_h and phi_d", N_THETA_H * rows * b)?;
        context.guard(WHAT, || {
            let step =
                |pipeline: &wgpu::ComputePipeline, operand: &wgpu::Buffer, result: &wgpu::Buffer, count| {
                    let bindings = [(0, &uniform), (1, &tables), (3, operand), (4, result)];
                    let group = context.bind_buffers(pipeline, &bindings);
                    context.dispatch(pipeline, &group, count);
                };
            let slabs = to_u32(N_THETA_H);
            step(&self.first, &coefficients, &along_first, [groups(b * c, 64), slabs, 1]);
            step(&self.third, &along_first, &along_both, [groups(b, 8), groups(rows, 8), slabs]);
            let bindings =
                [(0, &uniform), (1, &tables), (2, &cubics), (3, &along_both), (4, &targets.buffer)];
            let pipeline = match part {
                Part::Channels(_) => &self.second,
                Part::Component(_) => &self.component,
            };
            let group = context.bind_buffers(pipeline, &bindings);
            context.dispatch(pipeline, &group, cells(rows));
        })?;
        Ok(uniform)
    }
}

/// Workgroups for one invocation a target.
fn cells(rows: usize) -> [u32; 3] {
    [groups(N_THETA_D, 32), groups(rows, 2), to_u32(N_THETA_H)]
}

fn groups(count: usize, size: usize) -> u32 {
    to_u32(count.div_ceil(size))
}
