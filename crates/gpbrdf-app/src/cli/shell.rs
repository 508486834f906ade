//! `gpbrdf-cli completions` and `gpbrdf-cli man`: what a shell and its user look up.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, CommandFactory as _};
use clap_complete::Shell;
use gpbrdf_core::base::AtomicFile;

use super::Arguments;
use super::terminal::Terminal;
use crate::output::OutputFolder;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli completions bash > ~/.local/share/bash-completion/completions/gpbrdf-cli",
    "\n  gpbrdf-cli completions fish > ~/.config/fish/completions/gpbrdf-cli.fish",
))]
pub(crate) struct Completions {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let mut command = Arguments::command();
        let name = command.get_name().to_owned();
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, name, &mut script);
        terminal.print_bytes(&script)
    }
}

#[derive(Args, Debug)]
#[command(after_help = concat!("Examples:", "\n  gpbrdf-cli man -o ~/.local/share/man/man1"))]
pub(crate) struct Man {
    /// Folder for the pages, one of the program and one of each command; made if need be.
    #[arg(short, long, value_name = "DIR", default_value = "man1", help_heading = "Output")]
    output: PathBuf,
}

impl Man {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let mut program = Arguments::command();
        program.build();
        let folder = OutputFolder::create(&self.output)?;
        let own = program.get_name().to_owned();
        let mut files = vec![page(&folder, &own, program.clone())?];
        for command in program.get_subcommands().filter(|command| command.get_name() != "help") {
            let name = format!("{own}-{}", command.get_name());
            files.push(page(&folder, &name, command.clone())?);
        }
        let count = files.len();
        AtomicFile::commit_all(files)?;
        terminal.summary(&format!("wrote {count} pages to {}", self.output.display()))
    }
}

fn page(folder: &OutputFolder, name: &str, command: clap::Command) -> Result<AtomicFile> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command).title(name.to_uppercase()).render(&mut text)?;
    let mut file = AtomicFile::create(folder.join(&format!("{name}.1")))?;
    file.write_all(&text).with_context(|| format!("cannot write \"{}\"", file.target().display()))?;
    Ok(file)
}
