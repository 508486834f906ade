//! The shaders of this crate, each composed from the files of `shaders/`.
//!
//! A file of `shaders/` declares a few things and says in its first lines which other files it needs.
//! Declarations of WGSL may come in any order, so composing is joining. What differs between the variants of
//! a shader is a choice of parts, or a definition in front of them.

use crate::texture::Precision;

/// The files of `shaders/`.
mod part {
    pub(super) const ANGLES: &str = include_str!("../shaders/shared/angles.wgsl");
    pub(super) const COLOUR: &str = include_str!("../shaders/shared/colour.wgsl");
    pub(super) const ENVIRONMENT: &str = include_str!("../shaders/shared/environment.wgsl");
    pub(super) const GRID: &str = include_str!("../shaders/shared/grid.wgsl");
    pub(super) const MATERIAL_EXACT: &str = include_str!("../shaders/shared/material_exact.wgsl");
    pub(super) const MATERIAL_FILTERED: &str = include_str!("../shaders/shared/material_filtered.wgsl");
    pub(super) const RANDOM: &str = include_str!("../shaders/shared/random.wgsl");
    pub(super) const SEARCH: &str = include_str!("../shaders/shared/search.wgsl");
    pub(super) const SUMS: &str = include_str!("../shaders/shared/sums.wgsl");
    pub(super) const VIEW: &str = include_str!("../shaders/shared/view.wgsl");
    pub(super) const EVALUATE: &str = include_str!("../shaders/evaluate.wgsl");
    pub(super) const FINISH: &str = include_str!("../shaders/bake/finish.wgsl");
    pub(super) const KERNEL_SUM: &str = include_str!("../shaders/bake/kernel_sum.wgsl");
    pub(super) const REAL: &str = include_str!("../shaders/bake/real.wgsl");
    pub(super) const SEPARABLE: &str = include_str!("../shaders/bake/separable.wgsl");
    pub(super) const SHAPES: &str = include_str!("../shaders/bake/shapes.wgsl");
    pub(super) const DISPLAY: &str = include_str!("../shaders/scene/display.wgsl");
    pub(super) const GBUFFER: &str = include_str!("../shaders/scene/gbuffer.wgsl");
    pub(super) const SHADE: &str = include_str!("../shaders/scene/shade.wgsl");
}

/// The text of the lookup, which `concat!` takes only as a literal.
macro_rules! lookup {
    () => {
        concat!(
            include_str!("../shaders/shared/table.wgsl"),
            "\n",
            include_str!("../shaders/shared/angles.wgsl")
        )
    };
}

/// The functions `gpbrdf_coordinates`, `gpbrdf_lookup` and `gpbrdf_lookup_exact` in WGSL, which turn two
/// directions into a value of a [`BrdfTexture`](crate::BrdfTexture). The text needs nothing else, and all its
/// names begin with `gpbrdf_` or `GPBRDF_`: put it in front of any shader.
pub const LOOKUP_WGSL: &str = lookup!();

/// [`LOOKUP_WGSL`] and the functions `gpbrdf_eval(table, wi, wo)`, `gpbrdf_sample(table, wo, u)` and
/// `gpbrdf_pdf(wi, wo)`, which do what [`Material`](gpbrdf_core::Material) does, and `gpbrdf_direction(wo, u)`, which
/// draws without a lookup. The text needs one more function, which reads the buffer of
/// [`density_buffer`](crate::density_buffer):
///
/// ```wgsl
/// @group(0) @binding(1) var<storage, read> densities: array<f32>;
///
/// fn gpbrdf_density(index: u32) -> f32 {
///     return densities[index];
/// }
/// ```
///
/// All its names begin with `gpbrdf_`, `Gpbrdf` or `GPBRDF_`. An energy-conserving material is one whose table is baked
/// so: its factors are not applied.
pub const MATERIAL_WGSL: &str = concat!(lookup!(), "\n", include_str!("../shaders/shared/directions.wgsl"));

/// How the shaders of scenes read materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lookup {
    /// By loads, with weights in full precision.
    Exact,
    /// By the texture unit, with a sampler at [`MATERIAL_SAMPLER`].
    Filtered,
}

/// Whether `bake/shapes.wgsl` has the shape of this name.
pub(crate) fn has_shape(name: &str) -> bool {
    part::SHAPES.contains(&format!("fn {name}("))
}

/// The binding of the sampler for [`Lookup::Filtered`], in `material_filtered.wgsl`.
pub(crate) const MATERIAL_SAMPLER: u32 = 10;

impl Lookup {
    fn part(self) -> &'static str {
        match self {
            Self::Exact => part::MATERIAL_EXACT,
            Self::Filtered => part::MATERIAL_FILTERED,
        }
    }
}

/// A definition that some variant of a shader has in front of its parts.
#[derive(Clone, Copy, Debug)]
enum Definition {
    /// `alias name = type;`
    Alias(&'static str, &'static str),
    /// `const name: u32 = value;`
    Constant(&'static str, usize),
}

/// Joins definitions and parts to the source of one shader.
fn compose(parts: &[&str], definitions: &[Definition]) -> String {
    let definitions = definitions.iter().map(|definition| match definition {
        Definition::Alias(name, ty) => format!("alias {name} = {ty};\n"),
        Definition::Constant(name, value) => format!("const {name}: u32 = {value}u;\n"),
    });
    definitions.chain(parts.iter().map(|&part| format!("{part}\n"))).collect()
}

/// [`LOOKUP_WGSL`] and the compute entry point `gpbrdf_evaluate`, which evaluates pairs of directions in a
/// buffer.
#[must_use]
pub fn evaluate_wgsl() -> String {
    compose(&[LOOKUP_WGSL, part::EVALUATE], &[])
}

/// Entry points `mesh_corner`, `mesh_texels`, `whole_frame` and `sphere_texels`.
pub(crate) fn gbuffer() -> String {
    compose(&[part::VIEW, part::GBUFFER], &[])
}

/// Entry point `shade_pixels`.
pub(crate) fn shade(lookup: Lookup) -> String {
    let shared = [part::SEARCH, part::RANDOM, part::COLOUR, part::ENVIRONMENT, part::SUMS];
    compose(&[&[MATERIAL_WGSL, lookup.part()], &shared[..], &[part::SHADE]].concat(), &[])
}

/// Entry point `display_pixels`.
pub(crate) fn display() -> String {
    let shared = [part::ANGLES, part::VIEW, part::COLOUR, part::ENVIRONMENT, part::SUMS];
    compose(&[&shared[..], &[part::DISPLAY]].concat(), &[])
}

/// Entry points `contract_first`, `contract_third`, `evaluate_second`, `evaluate_component` and
/// `largest_deviation`.
pub(crate) fn separable() -> String {
    compose(&[part::GRID, part::SEARCH, part::SEPARABLE], &[])
}

/// Entry point `sum_kernels`. `kernel` is the text of a function `kernel` of `parameters` numbers; `double`
/// selects arithmetic in f64.
pub(crate) fn kernel_sum(kernel: &str, parameters: usize, double: bool) -> String {
    let real = if double { "f64" } else { "f32" };
    compose(
        &[part::REAL, part::SHAPES, part::KERNEL_SUM, kernel],
        &[Definition::Alias("real", real), Definition::Constant("PARAMETERS", parameters)],
    )
}

/// Entry point `write_table`.
pub(crate) fn finish(precision: Precision) -> String {
    let texels = match precision {
        Precision::Half => "texture_storage_3d<rgba16float, write>",
        Precision::Single => "texture_storage_3d<rgba32float, write>",
    };
    compose(&[part::GRID, part::FINISH], &[Definition::Alias("Texels", texels)])
}

#[cfg(test)]
mod tests;
