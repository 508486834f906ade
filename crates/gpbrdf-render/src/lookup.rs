//! The lookup of a baked BRDF in other shading languages, and on the device.

use std::fmt;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::shader::evaluate_wgsl;
use crate::texture::BrdfTexture;

const ENTRY: &str = "gpbrdf_evaluate";

/// A language of shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShaderLanguage {
    /// The language of WebGPU.
    Wgsl,
    /// The language of OpenGL, version 4.50 core.
    Glsl,
    /// The language of DirectX, shader model 6.0.
    Hlsl,
    /// The language of Metal, version 2.0.
    Msl,
    /// The binary language of Vulkan, version 1.3, as little-endian words.
    Spirv,
}

impl fmt::Display for ShaderLanguage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wgsl => "WGSL",
            Self::Glsl => "GLSL",
            Self::Hlsl => "HLSL",
            Self::Msl => "MSL",
            Self::Spirv => "SPIR-V",
        })
    }
}

/// [`evaluate_wgsl`] in another language, translated by naga. WGSL is returned as it is.
///
/// # Errors
/// [`Error::Gpu`] when naga cannot translate it.
pub fn translate(language: ShaderLanguage) -> Result<Vec<u8>> {
    use naga::back::{glsl, hlsl, msl, spv};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    let source = evaluate_wgsl();
    let failed = |message: String| Error::Gpu { what: format!("lookup shader in {language}"), message };
    let module = naga::front::wgsl::parse_str(&source).map_err(|e| failed(e.emit_to_string(&source)))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| failed(e.emit_to_string(&source)))?;
    let stage = naga::ShaderStage::Compute;
    Ok(match language {
        ShaderLanguage::Wgsl => source.into_bytes(),
        ShaderLanguage::Glsl => {
            let options = glsl::Options { version: glsl::Version::Desktop(450), ..glsl::Options::default() };
            let pipeline =
                glsl::PipelineOptions { shader_stage: stage, entry_point: ENTRY.to_owned(), multiview: None };
            let mut text = String::new();
            glsl::Writer::new(
                &mut text,
                &module,
                &info,
                &options,
                &pipeline,
                naga::proc::BoundsCheckPolicies::default(),
            )
            .and_then(|mut writer| writer.write())
            .map_err(|e| failed(e.to_string()))?;
            text.into_bytes()
        }
        ShaderLanguage::Hlsl => {
            let options = hlsl::Options { shader_model: hlsl::ShaderModel::V6_0, ..hlsl::Options::default() };
            let pipeline = hlsl::PipelineOptions::default();
            let mut text = String::new();
            hlsl::Writer::new(&mut text, &options, &pipeline)
                .write(&module, &info, None)
                .map_err(|e| failed(e.to_string()))?;
            text.into_bytes()
        }
        ShaderLanguage::Msl => {
            let options = msl::Options { lang_version: (2, 0), ..msl::Options::default() };
            let pipeline = msl::PipelineOptions::default();
            let (text, _) =
                msl::write_string(&module, &info, &options, &pipeline).map_err(|e| failed(e.to_string()))?;
            text.into_bytes()
        }
        ShaderLanguage::Spirv => {
            let options = spv::Options { lang_version: (1, 3), ..spv::Options::default() };
            let pipeline = spv::PipelineOptions { shader_stage: stage, entry_point: ENTRY.to_owned() };
            let words = spv::write_vec(&module, &info, &options, Some(&pipeline))
                .map_err(|e| failed(e.to_string()))?;
            words.into_iter().flat_map(u32::to_le_bytes).collect()
        }
    })
}

/// Evaluates a filterable texture at pairs `[wi, wo]` of directions in the local frame, whose fourth
/// components are unused: the BRDF in sr^-1 and sigma. Waits for the device.
///
/// # Errors
/// Those of [`Context::guard`].
pub fn evaluate(context: &Context, texture: &BrdfTexture, pairs: &[[[f32; 4]; 2]]) -> Result<Vec<[f32; 4]>> {
    const WHAT: &str = "BRDF lookup";
    let pipeline = context.compute_pipeline(WHAT, &evaluate_wgsl(), ENTRY)?;
    let directions =
        context.buffer_of("directions", bytemuck::cast_slice(pairs), wgpu::BufferUsages::STORAGE)?;
    let values = context.empty_buffer(
        "values",
        16 * pairs.len() as u64,
        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
    )?;
    let sampler = BrdfTexture::sampler(context);
    let groups = u32::try_from(pairs.len().div_ceil(64)).unwrap_or(u32::MAX);
    let most = context.device().limits().max_compute_workgroups_per_dimension;
    if groups > most {
        return Err(Error::Limit {
            what: "pairs of directions",
            expected: format!("at most {}", 64 * most),
            found: pairs.len().to_string(),
        });
    }
    context.guard(WHAT, || {
        let resources = [
            (0, wgpu::BindingResource::TextureView(texture.view())),
            (1, wgpu::BindingResource::Sampler(&sampler)),
            (2, directions.as_entire_binding()),
            (3, values.as_entire_binding()),
        ];
        let group = context.bind_group(&pipeline, resources);
        context.dispatch(&pipeline, &group, [groups, 1, 1]);
    })?;
    let bytes = context.read_buffer(&values)?;
    let out: Vec<[f32; 4]> = bytes.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect();
    Ok(out.into_iter().take(pairs.len()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shader::LOOKUP_WGSL;

    /// Runs a validator on a file. Says on standard error that it is skipped if it is not installed.
    fn validate(bytes: &[u8], suffix: &str, program: &str, arguments: &[&str]) {
        let mut file = tempfile::Builder::new().suffix(suffix).tempfile().unwrap();
        std::io::Write::write_all(&mut file, bytes).unwrap();
        match std::process::Command::new(program).args(arguments).arg(file.path()).output() {
            Ok(output) => assert!(
                output.status.success(),
                "{program}: {}{}",
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr)
            ),
            Err(error) => eprintln!("skipped: {program}: {error}"),
        }
    }

    #[test]
    fn every_language_passes_its_validator() {
        validate(
            &translate(ShaderLanguage::Spirv).unwrap(),
            ".spv",
            "spirv-val",
            &["--target-env", "vulkan1.1"],
        );
        validate(&translate(ShaderLanguage::Glsl).unwrap(), ".comp", "glslangValidator", &[]);
        let hlsl = translate(ShaderLanguage::Hlsl).unwrap();
        validate(
            &hlsl,
            ".hlsl",
            "glslangValidator",
            &["-D", "-V", "-S", "comp", "-e", ENTRY, "-o", "/dev/null"],
        );
        let msl = String::from_utf8(translate(ShaderLanguage::Msl).unwrap()).unwrap();
        assert!(msl.contains("metal::texture3d<float") && msl.contains("gpbrdf_evaluate("), "{msl}");
        let wgsl = String::from_utf8(translate(ShaderLanguage::Wgsl).unwrap()).unwrap();
        assert!(wgsl.starts_with(LOOKUP_WGSL));
    }
}
