//! `gpbrdf-cli info`: describes a file or a built-in material.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use gpbrdf_core::formats::merl_material_name;
use gpbrdf_core::{Content, detect_symmetry};
use serde_json::{Value, json};

use super::input::open_quietly;
use super::json::to_json;
use super::reading::Reading;
use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli info model.safetensors --json",
))]
pub(crate) struct Info {
    /// A file, the name of a built-in material, or - for measured samples from standard input.
    input: PathBuf,
    #[command(flatten)]
    reading: Reading,
    /// Print JSON.
    #[arg(help_heading = "Output", long)]
    json: bool,
}

impl Info {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let source = open_quietly(&self.input, self.reading)?;
        let details = match &source.content {
            Content::Table(table) => {
                let data = |v: &&[f32; 3]| v.iter().all(|&x| x >= 0.0);
                let filled = table.values().iter().filter(data);
                let largest = filled.clone().flatten().fold(0.0f32, |a, &b| a.max(b));
                json!({
                    "cells": table.values().len(),
                    "cells_with_data": filled.count(),
                    "largest_value": largest,
                    "merl_material": merl_material_name(&source.sha256),
                })
            }
            Content::Samples(samples) => {
                let largest = samples.values.as_flattened().iter().copied().fold(0.0, f64::max);
                json!({
                    "samples": samples.len(),
                    "largest_value": largest,
                    "standard_deviation": (!samples.sigma.is_empty()).then_some("given"),
                    "notices": (!samples.notices.is_empty()).then_some(&samples.notices),
                })
            }
            Content::Function { brdf, .. } => {
                let symmetry = detect_symmetry(brdf.as_ref());
                json!({ "symmetry": symmetry })
            }
            Content::Model(model) => {
                json!({
                    "samples": model.n_samples(),
                    "floats": model.n_floats(),
                    "solver": model.solver(),
                    "kernel": model.kernel_name(),
                    "transform": model.transform,
                    "provenance": model.provenance,
                    "hyperparameters": model.hyper_report(),
                })
            }
        };
        if self.json {
            let all = json!({ "name": source.name, "kind": source.kind, "description": source.description,
                "sha256": source.sha256, "details": details });
            return terminal.print(&to_json(&all)?);
        }
        let mut text = format!("{}: {}\n", source.name, source.kind);
        if !source.description.is_empty() {
            text.push_str(&format!("  {}\n", source.description.replace('\n', "\n  ")));
        }
        if let Some(details) = details.as_object() {
            let is_shown = |(name, value): &(&String, &Value)| !value.is_null() && name.as_str() != "notices";
            for (name, value) in details.iter().filter(is_shown) {
                let shown = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                text.push_str(&format!("  {}: {shown}\n", name.replace('_', " ")));
            }
        }
        for notice in source.notices() {
            text.push_str(&format!("  note: {notice}\n"));
        }
        if !source.sha256.is_empty() {
            text.push_str(&format!("  sha256: {}\n", source.sha256));
        }
        terminal.print(&text)
    }
}
