//! From a model to a texture, on the device.

mod axis_table;
mod dense;
mod lattice;
mod uniforms;

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Mutex;

use gpbrdf_core::{InputSpace, Model, N_THETA_D, N_THETA_H, Process, TableGeometry, Transform};

use crate::context::Context;
use crate::error::{Error, Result};
use crate::texture::{BrdfTexture, Precision};
use uniforms::Finish;

const LATTICE_WGSL: &str = include_str!("../../shaders/bake/lattice.wgsl");
const FINISH_WGSL: &str = include_str!("../../shaders/bake/finish.wgsl");

/// Bakes models on a device. Compiles its shaders once; keep it.
///
/// - A lattice model is contracted along `theta_h` and `phi_d`, then evaluated along `theta_d` from cubics
///   ([`gpbrdf_core::SeparableForm`]): every kernel, in single precision, and sigma with the mean. Inducing lattices are
///   three of them, mixed into colours.
/// - A dense model is a sum of kernel values over all samples, in f64 where the device computes in it. In single precision
///   the sum cancels; models that would lose more than four digits are refused ([`Error::NoShader`]), as is the Matern
///   kernel of general order, a Bessel function. Sigma is left at 0.
#[derive(Debug)]
pub struct Baker {
    context: Context,
    lattice: lattice::Pipelines,
    /// By precision of the texels.
    finish: [wgpu::ComputePipeline; 2],
    /// By source.
    dense: Mutex<HashMap<String, wgpu::ComputePipeline>>,
}

/// Asked between dispatches with the share of the work that is done, in `[0, 1]`; [`ControlFlow::Break`] cancels.
pub type Progress<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// A model on its way to a texture: one target a distinct cell.
struct Targets {
    geometry: TableGeometry,
    /// As `geometry.distinct()`, but the least of all components of the process: each has a space of its own, and a cell at
    /// the horizon may round to either side of it.
    distinct: Vec<usize>,
    /// `[i_theta_h][row][i_theta_d]`: target without its prior mean, and sigma. Of inducing lattices as many again hold the
    /// variances of the channels.
    buffer: wgpu::Buffer,
}

impl Targets {
    fn new(context: &Context, model: &Model) -> Result<Self> {
        let (space, others, copies) = match &model.process {
            Process::Inducing(gp) => {
                let spaces: Vec<InputSpace> = gp.components.iter().map(|c| c.lattice().space).collect();
                (spaces.first().copied().unwrap_or(model.space), spaces, 2)
            }
            _ => (model.space, Vec::new(), 1),
        };
        let geometry = TableGeometry::new(space);
        let mut distinct = geometry.distinct().to_vec();
        for other in others {
            let found = TableGeometry::new(other);
            distinct.iter_mut().zip(found.distinct()).for_each(|(least, &n)| *least = n.min(*least));
        }
        let cells = copies * N_THETA_H * geometry.third().len() * N_THETA_D;
        let buffer = context.empty_buffer("targets", 16 * cells as u64, wgpu::BufferUsages::STORAGE)?;
        Ok(Self { geometry, distinct, buffer })
    }
}

impl Baker {
    /// Compiles the shaders.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn new(context: &Context) -> Result<Self> {
        let finish = |precision: Precision| {
            context.compute_pipeline("bake: texels", &finish_wgsl(precision), "write_table")
        };
        Ok(Self {
            lattice: lattice::Pipelines::new(context)?,
            finish: [finish(Precision::Half)?, finish(Precision::Single)?],
            dense: Mutex::default(),
            context: context.clone(),
        })
    }

    /// Bakes the predictive mean, and sigma of lattices, into a new texture.
    ///
    /// # Errors
    /// [`Error::NoShader`] for a model the device cannot bake, [`Error::Cancelled`], and those of [`Context::guard`].
    pub fn bake(
        &self,
        model: &Model,
        precision: Precision,
        progress: &mut Progress<'_>,
    ) -> Result<BrdfTexture> {
        let texture = BrdfTexture::empty(&self.context, precision)?;
        self.bake_into(model, &texture, progress)?;
        Ok(texture)
    }

    /// Bakes into a texture that is there already. After an error it holds what it held before.
    ///
    /// # Errors
    /// Those of [`Baker::bake`].
    pub fn bake_into(&self, model: &Model, texture: &BrdfTexture, progress: &mut Progress<'_>) -> Result<()> {
        // Its layers stay black there, with no error.
        if self.context.info().backend == wgpu::Backend::Gl {
            return Err(Error::NoShader { what: "3-D textures written on OpenGL".to_owned() });
        }
        let targets = Targets::new(&self.context, model)?;
        let mut first_channel = 0;
        match &model.process {
            Process::Lattice(groups) => {
                for (i, gp) in groups.iter().enumerate() {
                    ask(progress, i as f64 / groups.len() as f64)?;
                    self.lattice.add(&self.context, gp, &targets, first_channel)?;
                    first_channel += gp.data().channels;
                }
            }
            Process::Dense(groups) => {
                for (i, gp) in groups.iter().enumerate() {
                    let share = |done: f64| (i as f64 + done) / groups.len() as f64;
                    let mut within = |done: f64| progress(share(done));
                    self.add_dense(gp, &targets, first_channel, &mut within)?;
                    first_channel += gp.channels();
                }
            }
            Process::Inducing(gp) => {
                for k in 0..gp.components.len() {
                    ask(progress, k as f64 / gp.components.len() as f64)?;
                    self.lattice.add_component(&self.context, gp, k, &targets)?;
                }
            }
            _ => return Err(Error::NoShader { what: "this kind of process".to_owned() }),
        }
        self.finish(model, &targets, texture)?;
        ask(progress, 1.0)
    }

    /// Carries targets back to sr^-1 and writes the texels.
    fn finish(&self, model: &Model, targets: &Targets, texture: &BrdfTexture) -> Result<()> {
        const WHAT: &str = "bake: texels";
        let (transform, epsilon) = match model.transform {
            Transform::Identity => (0, 0.0),
            Transform::Log { epsilon } => (1, epsilon),
            Transform::CubeRoot => (2, 0.0),
            _ => return Err(Error::NoShader { what: format!("the transform {:?}", model.transform) }),
        };
        let [r, g, b] = model.offsets.map(narrow);
        let uniform = Finish {
            offsets: [r, g, b, 0.0],
            transform,
            epsilon: narrow(epsilon),
            rows: to_u32(targets.geometry.third().len()),
            largest: if texture.precision() == Precision::Half { 65_504.0 } else { f32::MAX },
        };
        let distinct: Vec<u32> = targets.distinct.iter().map(|&n| to_u32(n)).collect();
        let context = &self.context;
        let uniform = context.uniform(&uniform)?;
        let distinct = context.buffer_of(
            "distinct cells",
            bytemuck::cast_slice(&distinct),
            wgpu::BufferUsages::STORAGE,
        )?;
        let pipeline = &self.finish[usize::from(texture.precision() == Precision::Single)];
        context.guard(WHAT, || {
            let group = context.bind_group(
                pipeline,
                [
                    uniform.as_entire_binding(),
                    targets.buffer.as_entire_binding(),
                    distinct.as_entire_binding(),
                    wgpu::BindingResource::TextureView(texture.view()),
                ],
            );
            context.dispatch(pipeline, &group, [3, 45, 180]);
        })
    }
}

fn finish_wgsl(precision: Precision) -> String {
    let format = match precision {
        Precision::Half => "rgba16float",
        Precision::Single => "rgba32float",
    };
    FINISH_WGSL.replace("TEXEL_FORMAT,", &format!("{format},"))
}

fn ask(progress: &mut Progress<'_>, done: f64) -> Result<()> {
    match progress(done) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Cancelled),
    }
}

/// Rounds to the device's precision.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the device's precision")]
fn narrow(x: f64) -> f32 {
    x as f32
}

/// `x` as two f32 whose sum is `x` to 48 bits.
fn split(x: f64) -> [f32; 2] {
    let high = narrow(x);
    [high, narrow(x - f64::from(high))]
}

/// A count of cells, functions or samples.
fn to_u32(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests;
