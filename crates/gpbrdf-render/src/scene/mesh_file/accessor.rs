//! The numbers of a glTF accessor, read where they stand.

use std::collections::HashMap;

use ::gltf::json;
use json::accessor::{ComponentType, Type};
use json::validation::Checked;

/// Numbers of one accessor: element after element in the bytes of a buffer, or zeros where there are none, and
/// elements that are replaced. Nothing is copied, and nothing is reserved for the number of elements that the file
/// claims.
#[derive(Debug)]
pub(super) struct Elements<'a> {
    count: usize,
    components: usize,
    kind: ComponentType,
    normalized: bool,
    /// Where elements stand, and how many bytes they are apart; none for zeros.
    data: Option<(&'a [u8], usize)>,
    /// Where the values of replaced elements stand.
    replaced: HashMap<usize, &'a [u8]>,
}

/// What is wrong with an accessor.
pub(super) type Wrong = String;

impl<'a> Elements<'a> {
    /// Finds the elements of accessor `index`; `bytes_of` gives the content of a buffer.
    pub(super) fn new(
        root: &json::Root,
        index: usize,
        bytes_of: &dyn Fn(usize) -> &'a [u8],
    ) -> Result<Self, Wrong> {
        let here = |what: String| format!("accessor {index}: {what}");
        let accessor = root.accessors.get(index).ok_or_else(|| format!("no accessor {index}"))?;
        let (Checked::Valid(component), Checked::Valid(shape)) = (accessor.component_type, accessor.type_)
        else {
            return Err(here("an unknown type of components".to_owned()));
        };
        let (kind, components) = (component.0, components(shape));
        let size = bytes_each(kind) * components;
        let count = usize::try_from(accessor.count.0).map_err(|_| here("too many elements".to_owned()))?;
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        let data = match accessor.buffer_view {
            Some(view) => {
                let (bytes, stride) = view_bytes(root, view.value(), bytes_of).map_err(here)?;
                let stride = stride.unwrap_or(size);
                Some((part(bytes, offset, count, stride, size).map_err(here)?, stride))
            }
            None => None,
        };
        let mut elements =
            Self { count, components, kind, normalized: accessor.normalized, data, replaced: HashMap::new() };
        if let Some(sparse) = &accessor.sparse {
            elements.replace(root, sparse, bytes_of).map_err(here)?;
        }
        Ok(elements)
    }

    /// Takes in the replaced elements.
    fn replace(
        &mut self,
        root: &json::Root,
        sparse: &json::accessor::sparse::Sparse,
        bytes_of: &dyn Fn(usize) -> &'a [u8],
    ) -> Result<(), Wrong> {
        let count = usize::try_from(sparse.count.0).map_err(|_| "too many replaced elements".to_owned())?;
        let Checked::Valid(kind) = sparse.indices.component_type else {
            return Err("an unknown type of indices".to_owned());
        };
        let at = |view: usize, offset: u64, size: usize| {
            let (bytes, _) = view_bytes(root, view, bytes_of)?;
            part(bytes, offset, count, size, size)
        };
        let each = bytes_each(kind.0);
        let indices = at(sparse.indices.buffer_view.value(), sparse.indices.byte_offset.0, each)?;
        let size = bytes_each(self.kind) * self.components;
        let values = at(sparse.values.buffer_view.value(), sparse.values.byte_offset.0, size)?;
        for (index, value) in indices.chunks_exact(each).zip(values.chunks_exact(size)).take(count) {
            self.replaced.insert(whole(kind.0, index) as usize, value);
        }
        Ok(())
    }

    /// Number of elements.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The first three numbers of an element; none beyond the last element or for fewer components.
    pub(super) fn vector(&self, index: usize) -> Option<[f64; 3]> {
        if index >= self.count || self.components < 3 {
            return None;
        }
        let Some(bytes) = self.bytes(index) else { return Some([0.0; 3]) };
        let each = bytes_each(self.kind);
        let mut numbers = bytes.chunks_exact(each).map(|bytes| self.number(bytes));
        Some([numbers.next()?, numbers.next()?, numbers.next()?])
    }

    /// The element as an index; none beyond the last element or where it is no whole number.
    pub(super) fn index(&self, index: usize) -> Option<u32> {
        if index >= self.count || self.components != 1 || self.kind == ComponentType::F32 {
            return None;
        }
        Some(self.bytes(index).map_or(0, |bytes| whole(self.kind, bytes)))
    }

    /// The bytes of an element; none for zeros.
    fn bytes(&self, index: usize) -> Option<&'a [u8]> {
        let size = bytes_each(self.kind) * self.components;
        if let Some(bytes) = self.replaced.get(&index) {
            return Some(bytes);
        }
        let (data, stride) = self.data?;
        data.get(index.checked_mul(stride)?..)?.get(..size)
    }

    /// One number, in `[-1, 1]` if whole numbers stand for that. glTF 2.0, section 3.11.
    fn number(&self, bytes: &[u8]) -> f64 {
        let (value, most) = match (self.kind, bytes) {
            (ComponentType::I8, [a, ..]) => (f64::from(a.cast_signed()), 127.0),
            (ComponentType::U8, [a, ..]) => (f64::from(*a), 255.0),
            (ComponentType::I16, [a, b, ..]) => (f64::from(i16::from_le_bytes([*a, *b])), 32_767.0),
            (ComponentType::U16, [a, b, ..]) => (f64::from(u16::from_le_bytes([*a, *b])), 65_535.0),
            (ComponentType::U32, _) => (f64::from(whole(self.kind, bytes)), f64::from(u32::MAX)),
            (ComponentType::F32, [a, b, c, d, ..]) => {
                return f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
            }
            _ => (0.0, 1.0),
        };
        if self.normalized { (value / most).max(-1.0) } else { value }
    }
}

/// Numbers of one element.
fn components(shape: Type) -> usize {
    match shape {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    }
}

/// Bytes of one number.
fn bytes_each(kind: ComponentType) -> usize {
    match kind {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

/// A whole number without a sign.
fn whole(kind: ComponentType, bytes: &[u8]) -> u32 {
    match (kind, bytes) {
        (ComponentType::U8, [a, ..]) => u32::from(*a),
        (ComponentType::U16, [a, b, ..]) => u32::from(u16::from_le_bytes([*a, *b])),
        (ComponentType::U32, [a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
        _ => u32::MAX,
    }
}

/// The bytes of a buffer view, and the distance of its elements where the view says it.
fn view_bytes<'a>(
    root: &json::Root,
    index: usize,
    bytes_of: &dyn Fn(usize) -> &'a [u8],
) -> Result<(&'a [u8], Option<usize>), Wrong> {
    let view = root.buffer_views.get(index).ok_or_else(|| format!("no buffer view {index}"))?;
    let bytes = bytes_of(view.buffer.value());
    let begin = view.byte_offset.map_or(0, |offset| offset.0);
    let inside = usize::try_from(begin).ok().zip(usize::try_from(view.byte_length.0).ok());
    let found = inside.and_then(|(begin, length)| bytes.get(begin..)?.get(..length));
    let found = found.ok_or_else(|| {
        let buffer = view.buffer.value();
        let length = view.byte_length.0;
        format!("buffer view {index}: {length} bytes from {begin} of the {} of buffer {buffer}", bytes.len())
    })?;
    Ok((found, view.byte_stride.map(|stride| stride.0)))
}

/// The bytes from the first of `count` elements on, all of which are inside.
fn part(bytes: &[u8], offset: u64, count: usize, stride: usize, size: usize) -> Result<&[u8], Wrong> {
    let outside = || format!("{count} elements of {size} bytes in a view of {} bytes", bytes.len());
    let rest = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)).ok_or_else(outside)?;
    let need = match count.checked_sub(1) {
        None => Some(0),
        Some(steps) => steps.checked_mul(stride).and_then(|before| before.checked_add(size)),
    };
    need.filter(|&need| need <= rest.len()).map(|_| rest).ok_or_else(outside)
}
