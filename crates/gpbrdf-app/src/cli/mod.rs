//! The command line: parses the arguments, runs a command, prints its error and chooses the exit code.

mod address_space;
mod bake;
mod batch;
mod check;
mod convert;
mod eval;
mod figure_args;
mod fit;
mod gallery;
mod info;
mod input;
mod json;
mod learn;
mod library;
mod making;
mod materials;
mod parse;
mod plan;
mod predict;
mod reading;
mod render;
mod reproduce;
mod sample;
mod shader;
mod shell;
mod slice;
mod terminal;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::job::Observer;
use crate::message::said_once;
use crate::output;
use terminal::Terminal;

/// Complete, render-ready BRDFs out of few measurements, with an error bar.
#[derive(Debug, Parser)]
#[command(name = "gpbrdf-cli", version, about, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Print only errors and the result itself.
    #[arg(help_heading = "General", short, long, global = true)]
    quiet: bool,
    /// Print more about the run; given twice, its results as they come.
    #[arg(help_heading = "General", short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Worker threads; all processors by default. Results do not depend on it.
    #[arg(help_heading = "General", long, global = true, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Sample, fit, bake and compare: the main job.
    Bake(bake::Bake),
    /// The same for many materials, a folder for each; goes on where it was stopped.
    Batch(Box<batch::Batch>),
    /// Sample and fit; write the model only.
    Fit(fit::Fit),
    /// What an instrument would measure: scattered samples with noise and outliers, as a CSV file.
    Sample(sample::Sample),
    /// Which directions to measure next, as a CSV file.
    Plan(Box<plan::Plan>),
    /// Values with 95 % intervals at the directions of a CSV file.
    Predict(predict::Predict),
    /// Compare a prediction with a truth.
    Eval(eval::Eval),
    /// Whether a renderer can rely on a material: reciprocity, energy, gaps, sampling.
    Check(check::Check),
    /// A picture of a BRDF at one phi_d.
    Slice(slice::SliceCommand),
    /// A figure of several materials, each predicted from few planned measurements.
    Gallery(gallery::Gallery),
    /// Pictures of a sphere, a knot, a box or a mesh, on the GPU.
    Render(Box<render::Render>),
    /// Learn a prior from other materials, with which fewer measurements are enough.
    Learn(learn::Learn),
    /// Write any source as a table, samples, a texture, or a file for other renderers.
    Convert(convert::Convert),
    /// The paper's experiments, as tables and pictures.
    Reproduce(reproduce::Reproduce),
    /// The lookup of a baked texture as shader code for other renderers.
    Shader(shader::Shader),
    /// What a file or a built-in material is.
    Info(info::Info),
    /// The built-in materials.
    Materials(materials::Materials),
    /// A script for a shell that completes commands, options and their values.
    Completions(shell::Completions),
    /// Pages for man.
    Man(shell::Man),
}

impl Command {
    /// Whether the command computes with matrices or tables, which takes buffers for each thread.
    fn computes(&self) -> bool {
        !matches!(
            self,
            Self::Shader(_) | Self::Info(_) | Self::Materials(_) | Self::Completions(_) | Self::Man(_)
        )
    }
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let terminal = Terminal::new(arguments.quiet, arguments.verbose);
    // Ctrl-C: no partial file stays behind, nor an empty folder.
    let handler = ctrlc::set_handler(|| {
        let _held = (gpbrdf_core::base::remove_pending(), output::remove_empty_folders());
        std::process::exit(130);
    });
    if let Err(error) = handler {
        terminal.warn(&format!("Ctrl-C may leave temporary files behind: {error}"));
    }
    let available = || std::thread::available_parallelism().map_or(1, usize::from);
    let wanted = arguments.threads.map_or_else(available, usize::from);
    match address_space::threads_within_limit(wanted) {
        Ok(threads) if arguments.threads.is_some() || threads < wanted => {
            // This fails only if a pool exists already, and none does yet.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        }
        Err(error) if arguments.command.computes() => {
            terminal.error(&said_once(&error));
            return ExitCode::FAILURE;
        }
        Ok(_) | Err(_) => {}
    }
    let result = match arguments.command {
        Command::Bake(command) => command.run(&terminal),
        Command::Batch(command) => command.run(&terminal),
        Command::Fit(command) => command.run(&terminal),
        Command::Sample(command) => command.run(&terminal),
        Command::Plan(command) => command.run(&terminal),
        Command::Predict(command) => command.run(&terminal),
        Command::Eval(command) => command.run(&terminal),
        Command::Check(command) => command.run(&terminal),
        Command::Slice(command) => command.run(&terminal),
        Command::Gallery(command) => command.run(&terminal),
        Command::Render(command) => command.run(&terminal),
        Command::Learn(command) => command.run(&terminal),
        Command::Convert(command) => command.run(&terminal),
        Command::Reproduce(command) => command.run(&terminal),
        Command::Shader(command) => command.run(&terminal),
        Command::Info(command) => command.run(&terminal),
        Command::Materials(command) => command.run(&terminal),
        Command::Completions(command) => command.run(&terminal),
        Command::Man(command) => command.run(&terminal),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if terminal::is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            terminal.error(&said_once(&error));
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_argument_definitions_are_consistent() {
        super::Arguments::command().debug_assert();
    }
}
