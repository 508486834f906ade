//! The uniforms of the shaders of scenes, laid out as in WGSL.

use bytemuck::{Pod, Zeroable};

/// `View` of `gbuffer.wgsl` and `display.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct View {
    pub(crate) clip_from_world: [[f32; 4]; 4],
    /// 1 in the fourth component for rays out of the eye, 0 for parallel ones.
    pub(crate) eye: [f32; 4],
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) forward: [f32; 4],
    /// Columns and rows of the picture.
    pub(crate) size: [f32; 2],
    /// How far the picture moves, in clip space.
    pub(crate) jitter: [f32; 2],
}

/// `Shade` of `shade.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Shade {
    /// Perspective: the eye and 1. Orthographic: towards the viewer and 0.
    pub(crate) viewer: [f32; 4],
    /// Point light: its position. Directional light: towards it.
    pub(crate) light: [f32; 4],
    /// Intensity or irradiance.
    pub(crate) strength: [f32; 4],
    pub(crate) size: [u32; 2],
    pub(crate) environment_size: [u32; 2],
    pub(crate) first_row: u32,
    pub(crate) first_sample: u32,
    pub(crate) sample_count: u32,
    pub(crate) light_kind: u32,
    pub(crate) strategy: u32,
    pub(crate) single_material: u32,
    pub(crate) min_cosine: f32,
    pub(crate) cosine_share: f32,
}

/// `Display` of `display.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Display {
    pub(crate) size: [u32; 2],
    pub(crate) environment_size: [u32; 2],
    pub(crate) show: u32,
    pub(crate) tone: u32,
    pub(crate) encoding: u32,
    pub(crate) background: u32,
    pub(crate) samples: f32,
    pub(crate) exposure: f32,
    pub(crate) limit: f32,
    pub(crate) split: f32,
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;

    /// Name, offset and size of every field of a struct.
    macro_rules! fields {
        ($name:ident: $($field:ident),* $(,)?) => {{
            let zero = $name::zeroed();
            (
                stringify!($name),
                vec![$((
                    stringify!($field),
                    std::mem::offset_of!($name, $field),
                    std::mem::size_of_val(&zero.$field),
                )),*],
                size_of::<$name>(),
            )
        }};
    }

    #[test]
    fn shaders_are_valid_and_see_the_uniforms_as_they_are_laid_out() {
        let view = fields!(View: clip_from_world, eye, right, up, forward, size, jitter);
        let shade = fields!(Shade: viewer, light, strength, size, environment_size, first_row, first_sample,
            sample_count, light_kind, strategy, single_material, min_cosine, cosine_share);
        let display = fields!(Display: size, environment_size, show, tone, encoding, background, samples, exposure,
            limit, split);
        let sources = [
            (crate::gbuffer::GBUFFER_WGSL.to_owned(), vec![&view]),
            (crate::half_vector::source(true), vec![]),
            (crate::half_vector::source(false), vec![]),
            (crate::shade::source(true), vec![&shade]),
            (crate::shade::source(false), vec![&shade]),
            (crate::display::source(), vec![&display, &view]),
        ];
        for (source, structs) in sources {
            let module = naga::front::wgsl::parse_str(&source)
                .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
            Validator::new(ValidationFlags::all(), Capabilities::empty())
                .validate(&module)
                .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
            for (name, fields, size) in structs {
                let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
                let Some((_, naga::Type { inner: naga::TypeInner::Struct { members, span }, .. })) = found
                else {
                    panic!("no struct {name}")
                };
                assert_eq!(*span as usize, *size, "{name}");
                assert_eq!(members.len(), fields.len(), "{name}");
                for (member, (field, offset, size)) in members.iter().zip(fields) {
                    assert_eq!(member.name.as_deref(), Some(*field), "{name}");
                    assert_eq!(member.offset as usize, *offset, "{name}.{field}");
                    let wgsl = module.types[member.ty].inner.size(module.to_ctx());
                    assert_eq!(wgsl as usize, *size, "{name}.{field}");
                }
            }
        }
    }
}
