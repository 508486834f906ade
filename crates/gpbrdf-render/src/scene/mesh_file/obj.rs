//! Wavefront OBJ files, by their specification of version 3.0 as far as polygons go.

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;

use super::super::mesh::Mesh;
use super::assembly::{Assembly, Corner};
use super::polygon::Cutter;
use super::refused;
use crate::error::{Error, Result};

/// The format's name in messages.
const FORMAT: &str = "OBJ";

/// Characters of a line that a message quotes.
const QUOTED: usize = 60;

/// The index of a normal that a corner does not have.
const NO_NORMAL: u32 = u32::MAX;

/// What stands in a file, before faces are cut.
#[derive(Debug, Default)]
struct Contents {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// Position and normal of each corner of all faces, one face after the other.
    corners: Vec<[u32; 2]>,
    /// Line of each face, and where its corners end.
    faces: Vec<(usize, usize)>,
}

/// A statement: a line, or several that a backslash joins, without its comment.
struct Statement<'a> {
    /// The number of its first line, from 1.
    line: usize,
    text: Cow<'a, [u8]>,
}

impl Statement<'_> {
    fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.text.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty())
    }

    /// The statement as a message quotes it.
    fn quoted(&self) -> String {
        let text = String::from_utf8_lossy(self.text.trim_ascii());
        let mut start: String = text.chars().filter(|c| !c.is_control()).take(QUOTED).collect();
        if text.chars().nth(QUOTED).is_some() {
            start.push_str("...");
        }
        format!("\"{start}\" on line {}", self.line)
    }
}

/// Whether content that starts like this is an OBJ file: whether its first statement is one that such files begin
/// with, followed by something.
pub(super) fn is_obj(head: &[u8]) -> bool {
    let text = as_bytes_of_text(head);
    let Some(first) = statements(&text).find(|statement| statement.words().next().is_some()) else {
        return false;
    };
    let mut words = first.words();
    let number = |word: Option<&[u8]>| word.and_then(number).is_some();
    match words.next() {
        Some(b"v" | b"vn" | b"vt" | b"vp") => number(words.next()),
        Some(b"o" | b"g" | b"mtllib" | b"usemtl" | b"s") => words.next().is_some(),
        _ => false,
    }
}

/// Reads the content of an OBJ file.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Mesh> {
    let text = as_bytes_of_text(bytes);
    let contents = Contents::of(&text, path)?;
    let mut assembly = Assembly::default();
    let (mut cutter, mut face, mut begin) = (Cutter::default(), Vec::new(), 0);
    for &(line, end) in &contents.faces {
        let corners = &contents.corners[begin..end];
        begin = end;
        face.clear();
        for &key in corners {
            face.push(contents.corner(key, line, path)?);
        }
        let positions: Vec<DVec3> = face.iter().map(|corner| corner.position).collect();
        for triangle in cutter.cut(&positions).as_chunks::<3>().0 {
            assembly.triangle(triangle.map(|i| face[i as usize])).map_err(refused(FORMAT, path))?;
        }
    }
    assembly.finish().map_err(refused(FORMAT, path))
}

impl Contents {
    fn of(text: &[u8], path: &Path) -> Result<Self> {
        let mut contents = Self::default();
        let mut unknown = None;
        for statement in statements(text) {
            let wrong = |expected: &str| Error::format(FORMAT, path, expected, statement.quoted());
            let mut words = statement.words();
            match words.next() {
                // More numbers are a weight or a colour.
                Some(b"v") => {
                    let position = vector(words).ok_or_else(|| wrong("three finite coordinates after v"))?;
                    contents.positions.push(position);
                }
                Some(b"vn") => {
                    let normal = vector(words).ok_or_else(|| wrong("three finite numbers after vn"))?;
                    contents.normals.push(normal);
                }
                Some(b"f" | b"fo") => contents.face(words, statement.line).map_err(wrong)?,
                Some(word) if !KEYWORDS.contains(&word) && unknown.is_none() => {
                    unknown = Some(statement.quoted())
                }
                _ => {}
            }
        }
        match unknown {
            Some(found) if contents.faces.is_empty() => {
                Err(Error::format(FORMAT, path, "vertices and faces", found))
            }
            _ => Ok(contents),
        }
    }

    /// Takes in a face. Points and lines, which have fewer than three corners, are left out.
    fn face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>, line: usize) -> Result<(), &'static str> {
        let begin = self.corners.len();
        for word in words {
            let mut parts = word.split(|&byte| byte == b'/');
            let counts = [self.positions.len(), self.normals.len()];
            let position = parts.next().and_then(|text| index(text, counts[0]));
            let _texture = parts.next();
            let normal = match parts.next() {
                None | Some(b"") => Some(NO_NORMAL),
                Some(text) => index(text, counts[1]),
            };
            let (Some(position), Some(normal), None) = (position, normal, parts.next()) else {
                return Err(
                    "corners as POSITION, POSITION/TEXTURE or POSITION/TEXTURE/NORMAL after f, with \
                            indices from 1, or from -1 backwards",
                );
            };
            self.corners.push([position, normal]);
        }
        if self.corners.len() - begin < 3 {
            self.corners.truncate(begin);
        } else {
            self.faces.push((line, self.corners.len()));
        }
        Ok(())
    }

    /// A corner of a face, which may stand before the vertices that it names.
    fn corner(&self, key: [u32; 2], line: usize, path: &Path) -> Result<Corner> {
        let [position, normal] = key.map(|i| i as usize);
        let missing = |what: &str, count: usize, i: usize| {
            let expected = format!("at most {count} {what}");
            Error::format(FORMAT, path, expected, format!("number {} in a face on line {line}", i + 1))
        };
        let normal = match (key[1], self.normals.get(normal)) {
            (NO_NORMAL, _) => DVec3::ZERO,
            (_, Some(normal)) => *normal,
            (_, None) => return Err(missing("normals", self.normals.len(), normal)),
        };
        let Some(&position) = self.positions.get(position) else {
            return Err(missing("vertices", self.positions.len(), position));
        };
        Ok(Corner { key, position, normal })
    }
}

/// Statements of the format that hold nothing that is read.
const KEYWORDS: [&[u8]; 37] = [
    b"vt",
    b"vp",
    b"p",
    b"l",
    b"o",
    b"g",
    b"s",
    b"mg",
    b"mtllib",
    b"usemtl",
    b"usemap",
    b"maplib",
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"call",
    b"csh",
    b"vc",
];

/// Content as text without a byte order mark, one byte for each ASCII character; names and comments may have any
/// encoding.
fn as_bytes_of_text(bytes: &[u8]) -> Cow<'_, [u8]> {
    let wide = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = bytes.as_chunks::<2>().0.iter().map(|pair| unit(*pair));
        let text: String =
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => Cow::Borrowed(rest),
        [0xFF, 0xFE, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => wide(rest, u16::from_be_bytes),
        _ => Cow::Borrowed(bytes),
    }
}

/// The statements of a text whose lines end with `\n`, `\r\n` or `\r`.
fn statements(text: &[u8]) -> impl Iterator<Item = Statement<'_>> {
    let (mut rest, mut next) = (text, 1);
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let line = next;
        let mut joined = Cow::Borrowed(&[][..]);
        while !rest.is_empty() {
            let part = take_line(&mut rest);
            next += 1;
            // A joined comment would hide the line after it.
            let is_comment = joined.is_empty() && part.trim_ascii_start().starts_with(b"#");
            let (part, goes_on) = match continued(part) {
                Some(part) if !is_comment => (part, true),
                _ => (part, false),
            };
            if joined.is_empty() && !goes_on {
                joined = Cow::Borrowed(part);
            } else {
                joined.to_mut().extend_from_slice(part);
                joined.to_mut().push(b' ');
            }
            if !goes_on {
                break;
            }
        }
        let end = joined.iter().position(|&byte| byte == b'#').unwrap_or(joined.len());
        let text = match joined {
            Cow::Borrowed(text) => Cow::Borrowed(&text[..end]),
            Cow::Owned(mut text) => {
                text.truncate(end);
                Cow::Owned(text)
            }
        };
        Some(Statement { line, text })
    })
}

/// Takes a line off a text.
fn take_line<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let end = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
    let (line, mut after) = rest.split_at(end);
    after = after.strip_prefix(b"\r\n").or_else(|| after.get(1..)).unwrap_or_default();
    *rest = after;
    line
}

/// The part before the backslash of a line that goes on in the next one. After a byte that is not ASCII the backslash
/// is the second half of a Japanese letter.
fn continued(line: &[u8]) -> Option<&[u8]> {
    let part = line.trim_ascii_end().strip_suffix(b"\\")?;
    part.last().is_none_or(u8::is_ascii).then_some(part)
}

/// A finite number that single precision can hold; a comma may stand for the point.
fn number(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    let value = match text.parse::<f64>() {
        Ok(value) => value,
        Err(_) if text.matches(',').count() == 1 && !text.contains('.') => {
            text.replace(',', ".").parse().ok()?
        }
        Err(_) => return None,
    };
    (value.abs() <= f64::from(f32::MAX)).then_some(value)
}

/// The first three words as numbers.
fn vector<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Option<DVec3> {
    let mut next = || number(words.next()?);
    Some(DVec3::new(next()?, next()?, next()?))
}

/// An index from 0, of one from 1 or from -1 backwards among `count`.
fn index(word: &[u8], count: usize) -> Option<u32> {
    let given: i64 = std::str::from_utf8(word).ok()?.parse().ok()?;
    let index = match given {
        1.. => given - 1,
        0 => return None,
        _ => i64::try_from(count).ok()?.checked_add(given)?,
    };
    u32::try_from(index).ok().filter(|&index| index != NO_NORMAL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const TWO_OBJECTS: &str = "# two squares\nmtllib missing.mtl\no low\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n\
        vn 0 0 1\nusemtl none\nf 1//1 2//1 3//1 4//1\no high\nv 0 0 2\nv 2 0 2\nv 2 2 2\nv 0 2 2\n\
        f -4//1 -3//1 -2//1 -1//1\nl 1 2\np 1\n";
    const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";

    fn read(text: &[u8]) -> Result<Mesh> {
        parse(text, Path::new("a.obj"))
    }

    #[test]
    fn several_objects_with_normals_become_one_mesh_in_the_unit_sphere() {
        let mesh = read(TWO_OBJECTS.as_bytes()).unwrap();
        assert_eq!((mesh.triangles(), mesh.positions.len()), (4, 8));
        assert!(mesh.normals.iter().all(|n| *n == Vec3::Z));
        assert!(mesh.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn without_normals_smooth_ones_are_made_across_seams() {
        // A roof; texture coordinates differ along the ridge.
        let roof = "v 0 1 0\nv 0 1 1\nv 1 0 0\nv 1 0 1\nv -1 0 0\nv -1 0 1\nvt 0 0\nvt 1 1\n\
            f 1/1 2/1 4/1 3/1\nf 2/2 1/2 5/2 6/2\n";
        let mesh = read(roof.as_bytes()).unwrap();
        assert_eq!(mesh.positions.len(), 6);
        let ridge = mesh.normals.iter().filter(|n| n.x.abs() < 1e-6 && n.y > 0.99).count();
        assert_eq!(ridge, 2, "{:?}", mesh.normals);
    }

    #[test]
    fn corners_without_a_normal_get_one_and_the_others_keep_theirs() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 -3\nf 1//1 2//1 3//1\nf 1 2 4\n";
        let mesh = read(text.as_bytes()).unwrap();
        assert_eq!(mesh.normals.iter().filter(|n| **n == Vec3::NEG_Z).count(), 3);
        assert_eq!(mesh.positions.len(), 6);
        assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn what_exporters_write_is_the_same_square() {
        let expected = read(SQUARE.as_bytes()).unwrap();
        let utf16 = |text: &str| {
            let units = std::iter::once(0xFEFF).chain(text.encode_utf16());
            units.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()
        };
        for text in [
            SQUARE.replace('\n', "\r\n").into_bytes(),
            SQUARE.replace('\n', "\r").into_bytes(),
            format!("\u{FEFF}{SQUARE}").into_bytes(),
            utf16(SQUARE),
            SQUARE.replace("1 2 3 4", "1 2 \\\n  3 \\ \r\n4").into_bytes(),
            SQUARE.replace("1 2 3 4", "-4 -3 -2 -1 # the only face").into_bytes(),
            SQUARE.replace("1 2 3 4", "1/1 2/ 3/3/ 4").into_bytes(),
            SQUARE.replace("v 1 1 0", "v 1 1 0 0.5 0.25 1").into_bytes(),
            SQUARE.replace("v 1 1 0", "v\t1.0e0\t1,000 0 1").into_bytes(),
            // Latin-1 and Shift-JIS, whose last letter here ends with the byte of a backslash.
            [b"o Stra\xDFe\n# \x95\x5C\n# caf\xE9 \\\ng \x95\x5C\n", SQUARE.as_bytes()].concat(),
            format!("{SQUARE}f 1 1 2\nf 1 2 1 2\nf 1 2\n").into_bytes(),
            format!("f 1 2 3 4\n{}", SQUARE.replace("f 1 2 3 4\n", "hairline 3\n")).into_bytes(),
        ] {
            assert_eq!(read(&text).unwrap(), expected, "{}", String::from_utf8_lossy(&text));
        }
    }

    #[test]
    fn coordinates_far_from_the_origin_lose_nothing() {
        // A millimetre at the coordinates of a map, in metres.
        let text = "v 4500000.000 5400000.000 120\nv 4500000.001 5400000.000 120\nv 4500000.001 5400000.001 120\n\
            f 1 2 3\n";
        let mesh = read(text.as_bytes()).unwrap();
        let sides = [0, 1, 2].map(|i| mesh.positions[i].distance(mesh.positions[(i + 1) % 3]));
        assert!((sides[0] / sides[1] - 1.0).abs() < 1e-5, "{sides:?}");
        assert!((sides[2] - 2.0).abs() < 1e-5, "{sides:?}");
    }

    #[test]
    fn broken_files_are_refused_with_the_line() {
        for (text, part) in [
            (&b"v 0 0 0\nf 1 2 3\n"[..], "at most 1 vertices, found number 2 in a face on line 2"),
            (b"v 0 0 x\n", "three finite coordinates after v, found \"v 0 0 x\" on line 1"),
            (b"hello\nv 1 2 3\n", "vertices and faces, found \"hello\" on line 1"),
            (b"# nothing\n", "faces with an area, found none"),
            (b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "found \"v nan 0 0\" on line 1"),
            (b"v 0 0 0\nv 1e39 0 0\n", "found \"v 1e39 0 0\" on line 2"),
            (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "found none"),
            (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "none among 1 triangles"),
            (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "found \"f 0 1 2\" on line 4"),
            (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 \\\n -5\n", "found \"f 1 2   -5\" on line 5"),
            (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1//1 2//1 3//1\n", "at most 0 normals, found number 1"),
            (b"v 0 0 0\nf 99999999999999999999 1 1\n", "on line 2"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(part) && message.starts_with("OBJ file \"a.obj\""), "{message}");
        }
    }

    #[test]
    fn mutated_files_never_panic() {
        let mut state = 1u32;
        let mut next = |n: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as usize % n
        };
        let palette = b"0123456789/-.e vfnlopu\n#\\\r,";
        for _ in 0..2000 {
            let mut text = TWO_OBJECTS.as_bytes().to_vec();
            for _ in 0..1 + next(6) {
                let at = next(text.len());
                text[at] = palette[next(palette.len())];
            }
            let _either = read(&text);
        }
    }
}
