//! The container of RGL `.bsdf` files: named arrays.
//!
//! Little-endian: `"tensor_file\0"`, `u8` major 1, `u8` minor 0, `u32` number of fields; then for each field
//! `u16` length of the name, the name, `u16` number of dimensions, `u8` type, `u64` offset from the start of
//! the file, `u64` length of each dimension. Arrays are in C order. Source: the reader published with J.
//! Dupuy and W. Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering"
//! (2018).

use std::io::{self, Write};
use std::path::Path;

use crate::base::error::{Error, Result};

/// Bytes at the start of a tensor file.
pub(super) const MAGIC: &[u8] = b"tensor_file\0";

/// The `dtype` of `f32` arrays.
pub(super) const F32: u8 = 10;
/// The `dtype` of `u8` arrays.
pub(super) const U8: u8 = 1;

/// Names and sizes in bytes of the element types, by `dtype - 1`.
const TYPES: [(&str, usize); 11] = [
    ("u8", 1),
    ("i8", 1),
    ("u16", 2),
    ("i16", 2),
    ("u32", 4),
    ("i32", 4),
    ("u64", 8),
    ("i64", 8),
    ("f16", 2),
    ("f32", 4),
    ("f64", 8),
];

/// One array. [`TensorFile::parse`] has checked that its bytes lie within the file and match its shape.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    name: &'a [u8],
    dtype: u8,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: &'a [u8],
}

/// One array to be written.
#[derive(Clone, Debug)]
pub(super) struct NewField {
    name: &'static str,
    dtype: u8,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl NewField {
    /// A field of single-precision numbers.
    pub(super) fn floats(name: &'static str, shape: &[usize], values: impl IntoIterator<Item = f32>) -> Self {
        let bytes = values.into_iter().flat_map(f32::to_le_bytes).collect();
        Self { name, dtype: F32, shape: shape.to_vec(), bytes }
    }

    /// A field of bytes.
    pub(super) fn bytes(name: &'static str, bytes: Vec<u8>) -> Self {
        Self { name, dtype: U8, shape: vec![bytes.len()], bytes }
    }
}

/// Distance between the starts of arrays is a multiple of this, so that a program may use them in place.
const ALIGNMENT: usize = 8;

/// Writes a tensor file with these arrays.
pub(super) fn write(mut to: impl Write, fields: &[NewField]) -> io::Result<()> {
    let header: usize =
        MAGIC.len() + 2 + 4 + fields.iter().map(|f| 13 + f.name.len() + 8 * f.shape.len()).sum::<usize>();
    to.write_all(MAGIC)?;
    to.write_all(&[1, 0])?;
    to.write_all(&u32::try_from(fields.len()).map_err(io::Error::other)?.to_le_bytes())?;
    let mut offset = header.next_multiple_of(ALIGNMENT);
    for field in fields {
        let length = |n: usize| u16::try_from(n).map_err(io::Error::other);
        to.write_all(&length(field.name.len())?.to_le_bytes())?;
        to.write_all(field.name.as_bytes())?;
        to.write_all(&length(field.shape.len())?.to_le_bytes())?;
        to.write_all(&[field.dtype])?;
        to.write_all(&(offset as u64).to_le_bytes())?;
        for &length in &field.shape {
            to.write_all(&(length as u64).to_le_bytes())?;
        }
        offset = (offset + field.bytes.len()).next_multiple_of(ALIGNMENT);
    }
    let mut end = header;
    for field in fields {
        let start = end.next_multiple_of(ALIGNMENT);
        to.write_all(&[0; ALIGNMENT][..start - end])?;
        to.write_all(&field.bytes)?;
        end = start + field.bytes.len();
    }
    to.flush()
}

/// The arrays of a tensor file, borrowed from its bytes.
#[derive(Debug)]
pub(super) struct TensorFile<'a> {
    fields: Vec<Field<'a>>,
    path: &'a Path,
}

/// Reads numbers from the front of the file.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }
}

impl<'a> TensorFile<'a> {
    /// Parses the header and checks the place of every array against the length of the file. Allocates memory
    /// in proportion to the real length of the header, whatever sizes it claims.
    pub(super) fn parse(bytes: &'a [u8], path: &'a Path) -> Result<Self> {
        let file = Self { fields: Vec::new(), path };
        if bytes.is_empty() {
            return Err(file.wrong("a tensor file", "an empty file"));
        }
        if !bytes.starts_with(MAGIC) {
            return Err(file.wrong("\"tensor_file\" at the start", "something else"));
        }
        let mut cursor = Cursor { bytes, at: MAGIC.len() };
        let cut = || file.wrong("a whole header", format!("{} bytes that end within it", bytes.len()));
        let version = cursor.array::<2>().ok_or_else(cut)?;
        if version != [1, 0] {
            return Err(
                file.wrong("tensor file version 1.0", format!("version {}.{}", version[0], version[1]))
            );
        }
        let count = u32::from_le_bytes(cursor.array().ok_or_else(cut)?);
        let mut fields = Vec::new();
        for _ in 0..count {
            let name_length = u16::from_le_bytes(cursor.array().ok_or_else(cut)?);
            let name = cursor.take(name_length.into()).ok_or_else(cut)?;
            let dimensions = u16::from_le_bytes(cursor.array().ok_or_else(cut)?);
            let [dtype] = cursor.array().ok_or_else(cut)?;
            let offset = u64::from_le_bytes(cursor.array().ok_or_else(cut)?);
            let lengths = cursor.take(usize::from(dimensions) * 8).ok_or_else(cut)?;
            let lengths: Vec<u64> =
                lengths.as_chunks::<8>().0.iter().map(|raw| u64::from_le_bytes(*raw)).collect();

            let label = format!("field `{}`", name.escape_ascii());
            let Some(&(_, size)) = TYPES.get(usize::from(dtype).wrapping_sub(1)) else {
                return Err(file.wrong(format!("a type from 1 to 11 in {label}"), format!("type {dtype}")));
            };
            let range = lengths
                .iter()
                .try_fold(size as u64, |product, &length| product.checked_mul(length))
                .and_then(|length| Some((offset, offset.checked_add(length)?)))
                .and_then(|(start, end)| Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?));
            let payload = range.and_then(|range| bytes.get(range)).ok_or_else(|| {
                file.wrong(
                    format!("{label} within the {} bytes of the file", bytes.len()),
                    format!("shape {lengths:?} of {size}-byte elements at offset {offset}"),
                )
            })?;
            // A length fits usize, unless another one is 0.
            let shape = lengths.iter().map(|&length| usize::try_from(length).unwrap_or(usize::MAX)).collect();
            fields.push(Field { name, dtype, shape, bytes: payload });
        }
        Ok(Self { fields, path })
    }

    /// The field called `name`, if there is one.
    pub(super) fn get(&self, name: &str) -> Option<&Field<'a>> {
        self.fields.iter().find(|field| field.name == name.as_bytes())
    }

    /// The field called `name`; an error unless it has type `dtype` and `dimensions` dimensions.
    pub(super) fn field(&self, name: &str, dtype: u8, dimensions: usize) -> Result<&Field<'a>> {
        let Some(field) = self.get(name) else {
            let names: Vec<_> = self.fields.iter().map(|f| f.name.escape_ascii().to_string()).collect();
            return Err(self.wrong(format!("a field `{name}`"), format!("only {}", names.join(", "))));
        };
        let type_name = |dtype: u8| TYPES[usize::from(dtype) - 1].0;
        if field.dtype != dtype || field.shape.len() != dimensions {
            return Err(self.wrong(
                format!("{} with {dimensions} dimensions in field `{name}`", type_name(dtype)),
                format!("{} with shape {:?}", type_name(field.dtype), field.shape),
            ));
        }
        Ok(field)
    }

    /// Shape and values of the `f32` field called `name`; an error unless all values are finite.
    pub(super) fn floats(&self, name: &str, dimensions: usize) -> Result<(Vec<usize>, Vec<f32>)> {
        let field = self.field(name, F32, dimensions)?;
        let values: Vec<f32> =
            field.bytes.as_chunks::<4>().0.iter().map(|raw| f32::from_le_bytes(*raw)).collect();
        if let Some(first) = values.iter().position(|value| !value.is_finite()) {
            let count = values.iter().filter(|value| !value.is_finite()).count();
            return Err(self.wrong(
                format!("finite numbers in field `{name}`"),
                format!("{count} that are not, the first at index {first}"),
            ));
        }
        Ok((field.shape.clone(), values))
    }

    /// An [`Error::Format`] about this file.
    pub(super) fn wrong(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        Error::Format {
            format: "RGL",
            path: self.path.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }
}
