//! Where tables are baked.

use std::ops::ControlFlow;

use anyhow::Result;
use clap::{Args, ValueEnum};
use gpbrdf_core::{BrdfTable, Model, Process, SigmaTable, bake_mean, bake_sigma};
use gpbrdf_render::{AdapterChoice, Baker, Context, Error, Precision};

use super::report::Seconds;
use super::terminal::Terminal;

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct BackendArgs {
    /// Where to bake. auto takes a GPU for dense models, if there is one; a lattice model is baked before a device is open.
    /// gpu takes any device, a software one too.
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum BackendName {
    Auto,
    Cpu,
    Gpu,
}

/// Tables of a model, and who made them: `cpu`, or the adapter.
pub(crate) struct Baked {
    pub(crate) mean: BrdfTable,
    pub(crate) sigma: Option<SigmaTable>,
    pub(crate) backend: String,
}

impl BackendArgs {
    /// Bakes the mean and, if asked for, sigma.
    pub(crate) fn bake(
        self,
        model: &Model,
        sigma: bool,
        seconds: &mut Seconds,
        terminal: &Terminal,
    ) -> Result<Baked> {
        if let Some(context) = self.device(model, terminal)? {
            let baked = seconds.measure("bake_mean", || {
                terminal.stage("baking on the device", || bake_on_device(&context, model))
            });
            match baked {
                Ok((mean, own_sigma)) => {
                    let sigma = sigma
                        .then(|| own_sigma.unwrap_or_else(|| bake_sigma_on_cpu(model, seconds, terminal)));
                    return Ok(Baked { mean, sigma, backend: context.describe() });
                }
                Err(error @ Error::NoShader { .. }) => terminal.warn(&format!("{error}; baking on the CPU")),
                Err(error) => return Err(error.into()),
            }
        }
        let mean = seconds.measure("bake_mean", || terminal.stage("baking the mean", || bake_mean(model)));
        let sigma = sigma.then(|| bake_sigma_on_cpu(model, seconds, terminal));
        Ok(Baked { mean, sigma, backend: "cpu".to_owned() })
    }

    /// The device to bake on, if it is not the processor.
    fn device(self, model: &Model, terminal: &Terminal) -> Result<Option<Context>> {
        match self.backend {
            BackendName::Cpu => Ok(None),
            BackendName::Gpu => Ok(Some(Context::open(AdapterChoice::Any)?)),
            // Tens of milliseconds on a processor, less than it takes to open a device.
            BackendName::Auto if !matches!(model.process, Process::Dense(_)) => Ok(None),
            BackendName::Auto => match Context::open(AdapterChoice::Hardware) {
                Ok(context) => Ok(Some(context)),
                Err(error) => {
                    terminal.detail(&format!("baking on the CPU: {error}"));
                    Ok(None)
                }
            },
        }
    }
}

fn bake_sigma_on_cpu(model: &Model, seconds: &mut Seconds, terminal: &Terminal) -> SigmaTable {
    seconds.measure("bake_sigma", || terminal.stage("baking sigma", || bake_sigma(model)))
}

/// The mean and, of a lattice model whose channels share it, sigma.
fn bake_on_device(context: &Context, model: &Model) -> Result<(BrdfTable, Option<SigmaTable>), Error> {
    let mut keep_going = |_| ControlFlow::Continue(());
    let texture = Baker::new(context)?.bake(model, Precision::Single, &mut keep_going)?;
    let shared = matches!(&model.process, Process::Lattice(groups) if groups.len() == 1);
    let (mean, sigma) = texture.to_tables(context)?;
    Ok((mean, shared.then_some(sigma)))
}
