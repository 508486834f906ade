//! `gpbrdf-cli materials`: lists the built-in materials.

use anyhow::Result;
use clap::Args;
use gpbrdf_core::brdf::materials;
use serde_json::json;

use super::json::to_json;
use super::terminal::Terminal;

#[derive(Args, Debug)]
pub(crate) struct Materials {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Materials {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        if self.json {
            let all: Vec<_> = materials()
                .iter()
                .map(|m| {
                    let (name, title) = (m.name, m.title);
                    json!({ "name": name, "title": title, "description": m.description, "source": m.source })
                })
                .collect();
            return terminal.print(&to_json(&all)?);
        }
        let width = materials().iter().map(|m| m.name.len()).max().unwrap_or(0);
        let lines = materials().iter().map(|m| format!("{:width$}  {}\n", m.name, m.description));
        terminal.print(&lines.collect::<String>())
    }
}
