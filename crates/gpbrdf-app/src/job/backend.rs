//! Where tables are baked.

use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::Result;
use clap::ValueEnum;
use gpbrdf_core::gp::DeviceForm;
use gpbrdf_core::model::bake_mean_observed;
use gpbrdf_core::{BrdfTable, Model, Progress, SigmaTable};
use gpbrdf_render::{AdapterChoice, Baker, Context, Error, Precision};
use serde::Serialize;

use super::run::{Baked, Observer, Run};
use super::stage::Stage;

/// What [`Baked::backend`] names the processor.
pub(super) const CPU: &str = "cpu";

/// Where to bake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Backend {
    /// A GPU for dense models, if there is one; a lattice model is baked on the CPU before a device is open.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// Any device, a software one too.
    Gpu,
}

impl Backend {
    /// Bakes the mean of a model; sigma comes with it where a device makes both at once.
    ///
    /// # Errors
    /// For [`Backend::Gpu`]: no device, or a model that its shaders cannot evaluate. A device that fails.
    pub(super) fn bake_mean(self, run: &mut Run, model: &Model) -> Result<Baked> {
        if let Some(context) = self.device(model, run)? {
            let observer = run.observer();
            let tables =
                run.stage(Stage::BakeOnDevice, || match bake_on_device(&context, model, &*observer) {
                    Ok(tables) => Ok(Some(tables)),
                    Err(error @ Error::NoShader { .. }) if self == Self::Auto => {
                        observer.warn(&format!("{error}; baking on the CPU"));
                        Ok(None)
                    }
                    Err(error @ Error::NoShader { .. }) => {
                        Err(anyhow::anyhow!("{error}; use --backend auto or cpu"))
                    }
                    Err(error) if error.is_cancelled() => Err(gpbrdf_core::Error::Cancelled.into()),
                    Err(error) => Err(anyhow::Error::from(error)),
                })?;
            if let Some((mean, sigma)) = tables {
                let sigma = sigma.map(Arc::new);
                return Ok(Baked { mean: Arc::new(mean), sigma, backend: context.describe() });
            }
        }
        let watch = run.watch();
        let mean = run.stage(Stage::BakeMean, || Ok(bake_mean_observed(model, &watch)?))?;
        Ok(Baked { mean: Arc::new(mean), sigma: None, backend: CPU.to_owned() })
    }

    /// The device to bake on, if it is not the processor.
    fn device(self, model: &Model, run: &Run) -> Result<Option<Context>> {
        match self {
            Self::Cpu => Ok(None),
            Self::Gpu => Ok(Some(Context::open(AdapterChoice::Any)?)),
            // Sums of products take tens of milliseconds on the processor, less than it takes to open a device.
            Self::Auto if !is_kernel_sum(model) => Ok(None),
            Self::Auto => match Context::open(AdapterChoice::Hardware) {
                Ok(context) => Ok(Some(context)),
                Err(error) => {
                    run.observer().detail(&format!("baking on the CPU: {error}"));
                    Ok(None)
                }
            },
        }
    }
}

/// Whether any part of a model is a sum over samples.
fn is_kernel_sum(model: &Model) -> bool {
    model.posteriors().any(|(_, posterior)| matches!(posterior.device_form(), DeviceForm::KernelSum(_)))
}

/// The mean and, of a model in products along the axes whose channels share it, sigma.
fn bake_on_device(
    context: &Context,
    model: &Model,
    observer: &dyn Observer,
) -> Result<(BrdfTable, Option<SigmaTable>), Error> {
    let mut progress = |share| {
        observer.progress(Progress::of_share(share));
        if observer.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let texture = Baker::new(context)?.bake(model, Precision::Single, &mut progress)?;
    let shares = model.posteriors().all(|(_, p)| p.n_channels() == 3 && p.n_variances() == 1);
    let shared = shares && !is_kernel_sum(model);
    let (mean, sigma) = texture.to_tables(context)?;
    Ok((mean, shared.then_some(sigma)))
}
