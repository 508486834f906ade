//! `gpbrdf-cli shader`: the lookup of a baked texture for other renderers.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use gpbrdf_core::base::AtomicFile;
use gpbrdf_render::{ShaderLanguage, include, translate};

use super::terminal::Terminal;

#[derive(Args, Debug)]
#[command(after_help = concat!(
    "Examples:",
    "\n  gpbrdf-cli shader --lang glsl -o lookup.glsl",
))]
pub(crate) struct Shader {
    /// Shading language.
    #[arg(long, value_enum, default_value = "wgsl")]
    lang: Language,
    /// Write a whole compute shader, which evaluates pairs of directions in a buffer, instead of functions to
    /// include. SPIR-V is always one.
    #[arg(long)]
    compute: bool,
    /// File to write; standard output by default.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Language {
    /// WebGPU.
    Wgsl,
    /// OpenGL 4.5.
    Glsl,
    /// DirectX, shader model 6.
    Hlsl,
    /// Metal.
    Msl,
    /// Vulkan, binary.
    Spirv,
}

impl Shader {
    pub(crate) fn run(&self, terminal: &Terminal) -> Result<()> {
        let language = match self.lang {
            Language::Wgsl => ShaderLanguage::Wgsl,
            Language::Glsl => ShaderLanguage::Glsl,
            Language::Hlsl => ShaderLanguage::Hlsl,
            Language::Msl => ShaderLanguage::Msl,
            Language::Spirv => ShaderLanguage::Spirv,
        };
        let binary = language == ShaderLanguage::Spirv;
        let code =
            if self.compute || binary { translate(language)? } else { include(language)?.into_bytes() };
        let Some(path) = &self.output else {
            if binary && terminal.is_terminal() {
                bail!("SPIR-V is binary: expected --output FILE, found a terminal");
            }
            return terminal.print_bytes(&code);
        };
        let mut file = AtomicFile::create(path)?;
        file.write_all(&code).with_context(|| format!("cannot write \"{}\"", path.display()))?;
        file.commit()?;
        terminal.summary(&format!("wrote {}", path.display()))
    }
}
