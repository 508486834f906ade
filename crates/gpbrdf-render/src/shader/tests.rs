//! Every shader in every variant: it is valid, and what it declares is what Rust declares.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use gpbrdf_core::material::{COLUMNS, COSINE_SHARE, ROWS, VIEWS};
use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::*;
use crate::bake::{kernel_source, kernel_sum as kernel_sum_bake};
use crate::gpu_types::{
    Display, Finish, KernelSum, LightKind, PixelSums, Sample, Separable, Shade, ShowKind, TransformKind, View,
};
use crate::scene::colour::LUMINANCE_WEIGHTS;
use crate::scene::display::{Background, COLOUR_MAPS, Encoding, ToneCurve};
use crate::scene::shade::Sampling;

/// A composed shader: its name, its source and the module.
struct Variant {
    name: &'static str,
    source: String,
    module: naga::Module,
}

/// All shaders, parsed and validated.
fn variants() -> Vec<Variant> {
    let (kernel, parameters) = kernel_source::every_shape();
    let densities = "@group(0) @binding(1) var<storage, read> densities: array<f32>;
        fn gpbrdf_density(index: u32) -> f32 { return densities[index]; }\n";
    let sources = [
        ("material", format!("{densities}{MATERIAL_WGSL}")),
        ("evaluate", evaluate_wgsl()),
        ("gbuffer", gbuffer()),
        ("shade, exact", shade(Lookup::Exact)),
        ("shade, filtered", shade(Lookup::Filtered)),
        ("display", display()),
        ("separable", separable()),
        ("kernel sum, f32", kernel_sum(&kernel, parameters, false)),
        ("kernel sum, f64", kernel_sum(&kernel, parameters, true)),
        ("finish, half", finish(Precision::Half)),
        ("finish, single", finish(Precision::Single)),
    ];
    sources
        .into_iter()
        .map(|(name, source)| Variant { name, module: valid_module(name, &source), source })
        .collect()
}

fn valid_module(name: &str, source: &str) -> naga::Module {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    let capabilities = if name.ends_with("f64") { Capabilities::FLOAT64 } else { Capabilities::empty() };
    Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    module
}

#[test]
fn every_file_is_a_part_of_a_valid_shader() {
    let variants = variants();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    for folder in [folder.clone(), folder.join("shared"), folder.join("bake"), folder.join("scene")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(variants.iter().any(|v| v.source.contains(&text)), "{} is unused", path.display());
        }
    }
}

#[test]
fn the_lookup_stands_alone() {
    let module = valid_module("lookup", LOOKUP_WGSL);
    for name in ["gpbrdf_coordinates", "gpbrdf_lookup", "gpbrdf_lookup_exact"] {
        assert!(module.functions.iter().any(|(_, f)| f.name.as_deref() == Some(name)), "{name}");
    }
    // No name can clash with one of the shader that it is put in front of.
    let functions = module.functions.iter().filter_map(|(_, f)| f.name.as_deref());
    let constants = module.constants.iter().filter_map(|(_, c)| c.name.as_deref());
    for name in functions.chain(constants) {
        assert!(name.to_lowercase().starts_with("gpbrdf_"), "{name}");
    }
}

/// Name, offset and size of every member of a struct, and the size of the struct.
type Layout = (Vec<(String, usize, usize)>, usize);

/// The layout of a Rust struct without the members after the semicolon, which are padding.
macro_rules! layout {
    ($name:ident: $($field:ident),* $(,)? $(; $padding:ident)?) => {{
        fn size_of_field<T, F>(_: impl Fn(&T) -> &F) -> usize {
            size_of::<F>()
        }
        let members = vec![$((
            stringify!($field).to_owned(),
            std::mem::offset_of!($name, $field),
            size_of_field(|all: &$name| &all.$field),
        )),*];
        // No member is forgotten.
        let padding = 0 $(+ size_of_field(|all: &$name| &all.$padding))?;
        assert_eq!(members.iter().map(|m| m.2).sum::<usize>() + padding, size_of::<$name>());
        let layout: Layout = (members, size_of::<$name>());
        (stringify!($name), layout)
    }};
}

fn wgsl_layout(members: &[naga::StructMember], span: u32, module: &naga::Module) -> Layout {
    let size = |member: &naga::StructMember| module.types[member.ty].inner.size(module.to_ctx()) as usize;
    let members = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize, size(m)));
    (members.collect(), span as usize)
}

#[test]
fn structs_are_laid_out_as_in_wgsl() {
    let expected: BTreeMap<&str, Layout> = [
        layout!(View: clip_from_world, eye, right, up, forward, size, jitter),
        layout!(PixelSums: truth, hits, prediction, weighted_sigma),
        layout!(Shade: viewer, light, strength, size, environment_size, first_row, first_sample, sample_count,
            light_kind, sampling, single_material, min_cosine, padding),
        layout!(Display: size, environment_size, show, tone, encoding, background, samples, exposure, limit,
            split, ground_size, ground_half, ground_height, horizon),
        layout!(Separable: shape, first, third, second, pieces, signal_variance, second_prior, limit, share;
            padding),
        layout!(KernelSum: first_cell, last_cell, first_sample, last_sample, chord),
        layout!(Sample: high, low, weight_high, weight_low),
        layout!(Finish: offsets, transform, epsilon, rows, largest),
    ]
    .into();
    let mut seen = BTreeSet::new();
    for Variant { name, module, .. } in variants() {
        // Everything behind a uniform or a storage buffer, and the elements of arrays.
        for (_, variable) in module.global_variables.iter() {
            let host =
                matches!(variable.space, naga::AddressSpace::Uniform | naga::AddressSpace::Storage { .. });
            let mut inner = &module.types[variable.ty];
            if let naga::TypeInner::Array { base, .. } = inner.inner {
                inner = &module.types[base];
            }
            let naga::TypeInner::Struct { members, span } = &inner.inner else { continue };
            let ty = inner.name.as_deref().unwrap_or_default();
            // Written by callers of `evaluate` as two arrays of four numbers.
            if !host || ty == "GpbrdfDirections" {
                continue;
            }
            let found = wgsl_layout(members, *span, &module);
            assert_eq!(Some(&found), expected.get(ty), "{name}: {ty}");
            seen.insert(ty.to_owned());
        }
    }
    assert!(seen.iter().eq(expected.keys()), "{seen:?}");
}

/// The value of a constant expression as numbers.
fn numbers(module: &naga::Module, expression: naga::Handle<naga::Expression>) -> Vec<f64> {
    match &module.global_expressions[expression] {
        naga::Expression::Literal(naga::Literal::U32(x)) => vec![f64::from(*x)],
        naga::Expression::Literal(naga::Literal::I32(x)) => vec![f64::from(*x)],
        naga::Expression::Literal(naga::Literal::F32(x)) => vec![f64::from(*x)],
        naga::Expression::Compose { components, .. } => {
            components.iter().flat_map(|&component| numbers(module, component)).collect()
        }
        naga::Expression::Constant(constant) => numbers(module, module.constants[*constant].init),
        other => panic!("{other:?}"),
    }
}

/// The constants of WGSL that stand for something in Rust.
fn mirrored() -> BTreeMap<&'static str, Vec<f64>> {
    let single = |x: usize| vec![x as f64];
    let position = |map| COLOUR_MAPS.iter().position(|&other| other == map).unwrap();
    [
        ("GPBRDF_PI", vec![f64::from(std::f32::consts::PI)]),
        ("GPBRDF_VIEWS", single(VIEWS)),
        ("GPBRDF_ROWS", single(ROWS)),
        ("GPBRDF_COLUMNS", single(COLUMNS)),
        ("GPBRDF_COSINE_SHARE", vec![f64::from(COSINE_SHARE)]),
        ("N_THETA_H", single(gpbrdf_core::brdf::N_THETA_H)),
        ("N_THETA_D", single(gpbrdf_core::brdf::N_THETA_D)),
        ("N_PHI_D", single(gpbrdf_core::brdf::N_PHI_D)),
        ("N_COLUMNS", single(gpbrdf_core::brdf::N_PHI_D / 2)),
        ("TILE", single(kernel_sum_bake::TILE)),
        ("LUMINANCE_WEIGHTS", LUMINANCE_WEIGHTS.map(|x| f64::from(crate::gpu_types::narrow(x))).to_vec()),
        ("LIGHT_DIRECTIONAL", single(LightKind::Directional as usize)),
        ("LIGHT_POINT", single(LightKind::Point as usize)),
        ("LIGHT_ENVIRONMENT", single(LightKind::Environment as usize)),
        ("SAMPLE_LIGHT", single(Sampling::Light as usize)),
        ("SAMPLE_BRDF", single(Sampling::Brdf as usize)),
        ("SAMPLE_BOTH", single(Sampling::Both as usize)),
        ("SHOW_TRUTH", single(ShowKind::Truth as usize)),
        ("SHOW_PREDICTION", single(ShowKind::Prediction as usize)),
        ("SHOW_SIGMA", single(ShowKind::Sigma as usize)),
        ("SHOW_DIFFERENCE", single(ShowKind::Difference as usize)),
        ("SHOW_SPLIT", single(ShowKind::Split as usize)),
        ("TONE_CLIP", single(ToneCurve::Clip as usize)),
        ("TONE_REINHARD", single(ToneCurve::Reinhard as usize)),
        ("TONE_FILMIC", single(ToneCurve::Filmic as usize)),
        ("ENCODING_GAMMA_22", single(Encoding::Gamma22 as usize)),
        ("ENCODING_SRGB", single(Encoding::Srgb as usize)),
        ("BACKGROUND_ENVIRONMENT", single(Background::Environment as usize)),
        ("BACKGROUND_BLACK", single(Background::Black as usize)),
        ("BACKGROUND_TRANSPARENT", single(Background::Transparent as usize)),
        ("COLOURS_SEQUENTIAL", single(position(gpbrdf_core::figure::Colormap::Sequential))),
        ("COLOURS_DIVERGING", single(position(gpbrdf_core::figure::Colormap::Diverging))),
        ("TRANSFORM_IDENTITY", single(TransformKind::Identity as usize)),
        ("TRANSFORM_LOG", single(TransformKind::Log as usize)),
        ("TRANSFORM_CUBE_ROOT", single(TransformKind::CubeRoot as usize)),
    ]
    .into()
}

/// The constants that only WGSL knows, or that Rust composes.
const WGSL_ONLY: [&str; 10] = [
    "ENVIRONMENT_SHARES",
    "GPBRDF_CONDITIONAL",
    "GPBRDF_LEAST",
    "GPBRDF_MARGINAL",
    "LEAST_COSINE",
    "NEUTRAL",
    "PARAMETERS",
    "SECOND",
    "SCALE",
    "THIRD",
];

#[test]
fn constants_are_those_of_rust() {
    let mirrored = mirrored();
    let mut seen = BTreeSet::new();
    for Variant { name, module, .. } in variants() {
        for (_, constant) in module.constants.iter() {
            let Some(constant_name) = constant.name.as_deref() else { continue };
            if WGSL_ONLY.contains(&constant_name) {
                continue;
            }
            let found = numbers(&module, constant.init);
            assert_eq!(Some(&found), mirrored.get(constant_name), "{name}: {constant_name}");
            seen.insert(constant_name.to_owned());
        }
    }
    assert!(seen.iter().eq(mirrored.keys()), "{seen:?}");
}

#[test]
fn the_sampler_of_materials_has_its_binding() {
    for Variant { name, module, .. } in variants().iter().filter(|v| v.name.ends_with("filtered")) {
        let sampler =
            module.global_variables.iter().find(|v| v.1.name.as_deref() == Some("material_sampler"));
        let binding = sampler.and_then(|(_, variable)| variable.binding).unwrap();
        assert_eq!((binding.group, binding.binding), (0, MATERIAL_SAMPLER), "{name}");
    }
}
