//! The lookup of a baked BRDF in other shading languages, and on the device.

use std::fmt;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::shader::{LOOKUP_WGSL, evaluate_wgsl};
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

/// [`LOOKUP_WGSL`] in another language, to be included in any shader: the same functions with the same comments, in an
/// include guard, without an entry point, bindings or a version. They take the texture as arguments: a `sampler3D` in
/// GLSL, a texture and a sampler in HLSL and MSL. WGSL is returned as it is. SPIR-V has no files to include.
///
/// # Errors
/// [`Error::Gpu`] for SPIR-V, and when naga cannot translate it.
pub fn include(language: ShaderLanguage) -> Result<String> {
    let translated = |source: &str| {
        let bytes = translate_source(language, source)?;
        Ok::<_, Error>(String::from_utf8_lossy(&bytes).into_owned())
    };
    let text = match language {
        ShaderLanguage::Wgsl => return Ok(LOOKUP_WGSL.to_owned()),
        ShaderLanguage::Spirv => {
            let what = format!("lookup shader in {language}");
            return Err(Error::Gpu { what, message: "expected a language with files to include".to_owned() });
        }
        // The functions stand between the declarations of a shader and its entry point.
        ShaderLanguage::Glsl => declarations(&translated(&evaluate_wgsl())?),
        ShaderLanguage::Hlsl | ShaderLanguage::Msl => translated(LOOKUP_WGSL)?,
    };
    let head: Vec<&str> = LOOKUP_WGSL.lines().take_while(|line| line.starts_with("//")).collect();
    Ok(format!(
        "{}\n\n#ifndef {GUARD}\n#define {GUARD}\n\n{}\n\n#endif\n",
        head.join("\n"),
        commented(text.trim())
    ))
}

/// The include guard.
const GUARD: &str = "GPBRDF_LOOKUP_INCLUDED";

/// The constants and functions of a shader in GLSL.
fn declarations(text: &str) -> String {
    let mut kept = Vec::new();
    let mut is_function = false;
    for line in text.lines() {
        is_function |= line.contains(" gpbrdf_") && line.ends_with(") {");
        if line.starts_with("void main()") {
            break;
        }
        if is_function || line.starts_with("const ") {
            kept.push(line);
            // A blank line between the constants and the functions.
            kept.extend((!is_function).then_some(""));
        }
    }
    kept.join("\n")
}

/// A translation with the comments that stand before the functions in WGSL.
fn commented(text: &str) -> String {
    let mut lines = Vec::new();
    for line in text.lines() {
        if !line.starts_with(char::is_whitespace) {
            lines.extend(comment_of(line));
        }
        lines.push(line);
    }
    lines.join("\n")
}

/// The comment before the function in WGSL that a line begins to define.
fn comment_of(line: &str) -> Vec<&'static str> {
    let Some((before, _)) = line.split_once('(') else { return Vec::new() };
    // Translations end some names with an underscore.
    let name = before.rsplit(' ').next().unwrap_or_default().trim_end_matches('_');
    let definition = format!("fn {name}(");
    let source: Vec<&str> = LOOKUP_WGSL.lines().collect();
    let Some(end) = source.iter().position(|line| line.starts_with(&definition)) else { return Vec::new() };
    let length = source[..end].iter().rev().take_while(|line| line.starts_with("//")).count();
    source[end - length..end].to_vec()
}

/// [`evaluate_wgsl`] in another language, translated by naga. WGSL is returned as it is.
///
/// # Errors
/// [`Error::Gpu`] when naga cannot translate it.
pub fn translate(language: ShaderLanguage) -> Result<Vec<u8>> {
    translate_source(language, &evaluate_wgsl())
}

fn translate_source(language: ShaderLanguage, source: &str) -> Result<Vec<u8>> {
    use naga::back::{glsl, hlsl, msl, spv};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    let failed = |message: String| Error::Gpu { what: format!("lookup shader in {language}"), message };
    let module = naga::front::wgsl::parse_str(source).map_err(|e| failed(e.emit_to_string(source)))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| failed(e.emit_to_string(source)))?;
    let stage = naga::ShaderStage::Compute;
    Ok(match language {
        ShaderLanguage::Wgsl => source.as_bytes().to_vec(),
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

    /// A shader in GLSL that includes the lookup, twice, under the names of its own.
    const GLSL_HOST: &str = "
layout(location = 0) in vec3 light;
layout(location = 1) in vec3 viewer;
layout(location = 0) out vec4 colour;
layout(binding = 3) uniform sampler3D material;

void main() {
    colour = gpbrdf_lookup(material, light, viewer) * light.z;
    colour += gpbrdf_lookup_exact(material, light, viewer);
    colour += vec4(gpbrdf_coordinates(light, viewer), 0.0);
}
";

    const HLSL_HOST: &str = "
Texture3D<float4> material : register(t3);
SamplerState linear_sampler : register(s5);

float4 shade(float3 light : TEXCOORD0, float3 viewer : TEXCOORD1) : SV_Target {
    return gpbrdf_lookup(material, linear_sampler, light, viewer) * light.z
        + gpbrdf_lookup_exact(material, light, viewer) + float4(gpbrdf_coordinates(light, viewer), 0.0);
}
";

    #[test]
    fn the_lookup_can_be_included_in_shaders_of_others() {
        let glsl = include(ShaderLanguage::Glsl).unwrap();
        for version in [
            "330 core\n#extension GL_ARB_separate_shader_objects : require\n#extension \
             GL_ARB_shading_language_420pack : require",
            "450 core",
            "460 core",
        ] {
            let host = format!("#version {version}\n{glsl}\n{glsl}\n{GLSL_HOST}");
            validate(host.as_bytes(), ".frag", "glslangValidator", &[]);
        }
        let hlsl = include(ShaderLanguage::Hlsl).unwrap();
        let host = format!("{hlsl}\n{hlsl}\n{HLSL_HOST}");
        let arguments = ["-D", "-V", "-S", "frag", "-e", "shade", "-o", "/dev/null"];
        validate(host.as_bytes(), ".hlsl", "glslangValidator", &arguments);
        let msl = include(ShaderLanguage::Msl).unwrap();
        assert!(msl.contains("metal::texture3d<float, metal::access::sample> table"), "{msl}");
        assert!(include(ShaderLanguage::Spirv).is_err());
        for text in [&glsl, &hlsl, &msl, &include(ShaderLanguage::Wgsl).unwrap()] {
            assert!(
                !text.contains("main") && !text.contains("binding") && !text.contains("register"),
                "{text}"
            );
            assert!(!text.contains("kernel void") && !text.contains("numthreads"), "{text}");
            // Each function stands behind its comment, and the conventions before all.
            assert!(text.starts_with("// Measured materials in any renderer"), "{text}");
            let before = "// Texture coordinates of two directions, each in [0, 1].\n";
            let after = text.split_once(before).unwrap().1;
            assert!(after.lines().next().unwrap().contains("gpbrdf_coordinates("), "{text}");
        }
    }
}
