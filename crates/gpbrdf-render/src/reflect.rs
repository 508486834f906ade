//! Layouts of structs as naga sees them, for tests.

use naga::TypeInner;
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Parses and validates a whole shader.
///
/// # Panics
/// If naga has anything against it.
pub(crate) fn module(source: &str) -> naga::Module {
    let module =
        naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(&module)
        .unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    module
}

/// Offset of every member of a WGSL struct, and its size.
pub(crate) fn layout(source: &str, name: &str) -> (Vec<(String, usize)>, usize) {
    let module = module(source);
    let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
    let Some((_, naga::Type { inner: TypeInner::Struct { members, span }, .. })) = found else {
        panic!("no struct {name}");
    };
    let members = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize));
    (members.collect(), *span as usize)
}

/// Checks that a Rust struct has the members of a WGSL one at the same offsets, and its size; members of the Rust struct
/// that are not named are padding.
macro_rules! assert_layout {
    ($source:expr, $name:literal, $rust:ty, [$($field:ident),* $(,)?]) => {{
        let (members, size) = $crate::reflect::layout($source, $name);
        let expected = vec![$((stringify!($field).to_owned(), std::mem::offset_of!($rust, $field))),*];
        assert_eq!(members, expected, "{}", $name);
        assert_eq!(size, std::mem::size_of::<$rust>(), "{}", $name);
    }};
}
pub(crate) use assert_layout;
