//! From a model to a texture, on the device.
//!
//! The shaders know two forms of a process: a separable form and a kernel sum, as [`DeviceForm`] tells.

mod axis_table;
pub(crate) mod kernel_source;
pub(crate) mod kernel_sum;
mod prepared;
mod separable;
mod targets;

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use gpbrdf_core::{Model, Transform};

use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu_types::{Finish, TransformKind, narrow, to_u32};
use crate::shader;
use crate::texture::{BrdfTexture, Precision};
pub use prepared::Prepared;
use prepared::{Known, Part};
use targets::Targets;

/// Bakes models on a device. The constructor compiles shaders, so keep the baker.
///
/// - A lattice model is baked in its separable form ([`gpbrdf_core::gp::SeparableForm`]): contracted along
///   `theta_h` and `phi_d`, then evaluated along `theta_d` from cubics. This works with every kernel, in
///   single precision, and gives sigma with the mean. A model of inducing lattices is the sum of three such
///   forms, each mixed into all channels.
/// - A dense model is baked as a sum of kernel values over all samples, in f64 where the device has it. In
///   single precision the sum cancels, so models that would lose more than four digits are refused
///   ([`Error::NoShader`]). The Matern kernel of general order, a Bessel function, is refused too. Sigma is
///   left at 0.
#[derive(Debug)]
pub struct Baker {
    context: Context,
    separable: separable::Pipelines,
    kernel_sum: kernel_sum::Pipelines,
    /// For texels in half and in single precision.
    finish: [wgpu::ComputePipeline; 2],
    /// What was prepared before.
    known: Mutex<Known>,
}

/// A function that is called between dispatches with the share of the work that is done, in `[0, 1]`. It
/// cancels the work by [`ControlFlow::Break`].
pub type Progress<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

impl Baker {
    /// Compiles the shaders.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn new(context: &Context) -> Result<Self> {
        let finish = |precision: Precision| {
            context.compute_pipeline("bake: texels", &shader::finish(precision), "write_table")
        };
        Ok(Self {
            separable: separable::Pipelines::new(context)?,
            kernel_sum: kernel_sum::Pipelines::default(),
            finish: [finish(Precision::Half)?, finish(Precision::Single)?],
            context: context.clone(),
            known: Mutex::default(),
        })
    }

    /// Bakes the predictive mean, and sigma of lattices, into a new texture.
    ///
    /// # Errors
    /// [`Error::NoShader`] for a model that the device cannot bake, [`gpbrdf_core::Error::Cancelled`] on
    /// request of `progress` ([`Error::is_cancelled`]), and those of [`Context::guard`].
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

    /// Bakes into an existing texture. After an error it holds what it held before.
    ///
    /// # Errors
    /// Those of [`Baker::bake`].
    pub fn bake_into(&self, model: &Model, texture: &BrdfTexture, progress: &mut Progress<'_>) -> Result<()> {
        self.bake_prepared(&self.prepare(model)?, texture, progress)
    }

    /// [`Prepared::new`], which computes no functions anew for lattices whose kernels are those of a model that this
    /// baker has prepared before.
    ///
    /// # Errors
    /// Those of [`Prepared::new`].
    pub fn prepare<'a>(&self, model: &'a Model) -> Result<Prepared<'a>> {
        Prepared::with(model, &mut self.known.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// [`Baker::bake_into`] of a model that was prepared before.
    ///
    /// # Errors
    /// Those of [`Baker::bake`].
    pub fn bake_prepared(
        &self,
        prepared: &Prepared<'_>,
        texture: &BrdfTexture,
        progress: &mut Progress<'_>,
    ) -> Result<()> {
        // On OpenGL the layers would stay black, without an error.
        if self.context.info().backend == wgpu::Backend::Gl {
            return Err(Error::NoShader { what: "3-D textures written on OpenGL".to_owned() });
        }
        let (context, parts) = (&self.context, &prepared.parts);
        let targets = Targets::new(context, prepared)?;
        for (i, part) in parts.iter().enumerate() {
            let share = |done: f64| (i as f64 + done) / parts.len() as f64;
            match part {
                Part::Separable(process) => {
                    report(progress, share(0.0))?;
                    self.separable.add(context, process, &targets)?;
                }
                Part::KernelSum(process, first_channel) => {
                    let mut within = |done: f64| progress(share(done));
                    self.kernel_sum.add(context, process, *first_channel, &targets, &mut within)?;
                }
            }
        }
        if prepared.is_mixed() {
            self.separable.finish_sigma(context, &targets)?;
        }
        self.finish(prepared, &targets, texture)?;
        report(progress, 1.0)
    }

    /// Transforms targets back to sr^-1 and writes the texels.
    fn finish(&self, prepared: &Prepared<'_>, targets: &Targets<'_>, texture: &BrdfTexture) -> Result<()> {
        const WHAT: &str = "bake: texels";
        let Prepared { model, constants, .. } = prepared;
        let (transform, epsilon) = match model.transform {
            Transform::Identity => (TransformKind::Identity, 0.0),
            Transform::Log { epsilon } => (TransformKind::Log, epsilon),
            Transform::CubeRoot => (TransformKind::CubeRoot, 0.0),
            _ => return Err(Error::NoShader { what: format!("the transform {:?}", model.transform) }),
        };
        let [r, g, b] = std::array::from_fn(|c| narrow(model.offsets[c] + constants[c]));
        let uniform = Finish {
            offsets: [r, g, b, 0.0],
            transform,
            epsilon: narrow(epsilon),
            rows: to_u32(targets.rows()),
            largest: if texture.precision() == Precision::Half { 65_504.0 } else { f32::MAX },
        };
        let distinct: Vec<u32> = prepared.distinct.iter().map(|&n| to_u32(n)).collect();
        let context = &self.context;
        let uniform = context.uniform(&uniform)?;
        let storage = wgpu::BufferUsages::STORAGE;
        let distinct = context.buffer_of("distinct cells", bytemuck::cast_slice(&distinct), storage)?;
        let pipeline = &self.finish[usize::from(texture.precision() == Precision::Single)];
        context.guard(WHAT, || {
            let resources = [
                (0, uniform.as_entire_binding()),
                (1, targets.buffer.as_entire_binding()),
                (2, distinct.as_entire_binding()),
                (3, wgpu::BindingResource::TextureView(texture.view())),
            ];
            let group = context.bind_group(pipeline, resources);
            context.dispatch(pipeline, &group, targets::whole_table());
        })
    }
}

/// Reports the share of the work that is done; an error if that cancels the work.
fn report(progress: &mut Progress<'_>, done: f64) -> Result<()> {
    match progress(done) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::cancelled()),
    }
}
