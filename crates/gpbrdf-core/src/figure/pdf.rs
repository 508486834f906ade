//! A drawing as a PDF of one page, with its typeface embedded, so that text can be searched and copied.

use std::collections::BTreeMap;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use crate::figure::drawing::{Drawing, Shape};
use crate::figure::font::Face;
use crate::figure::picture::{Picture, Rgb8};
use crate::figure::text::Line;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const INFORMATION: Ref = Ref::new(5);
/// The first number of what there are several of.
const OTHERS: i32 = 6;
/// Numbers that the objects of one cut of the typeface take.
const FONT_OBJECTS: i32 = 5;

/// Glyphs are told by their number in the font.
const SYSTEM: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// How far a quarter of a circle's control points are along its tangents, for a radius of 1.
const QUARTER: f64 = 0.552_284_75;

/// The drawing as the bytes of a PDF file.
///
/// # Errors
/// A picture with a side of more than 2^31 - 1 pixels.
pub(super) fn pdf(drawing: &Drawing) -> std::io::Result<Vec<u8>> {
    let faces = drawing.faces();
    let count = |n: usize| i32::try_from(n).map_err(std::io::Error::other);
    let pictures: Vec<&Picture> = drawing.shapes.iter().filter_map(picture_of).collect();
    let first_picture = OTHERS + FONT_OBJECTS * count(faces.len())?;
    let picture_ref = |i: usize| Ok::<_, std::io::Error>(Ref::new(first_picture + count(i)?));

    let mut pdf = Pdf::new();
    pdf.catalog(CATALOG).pages(PAGES);
    pdf.pages(PAGES).kids([PAGE]).count(1);
    let mut page = pdf.page(PAGE);
    page.media_box(Rect::new(0.0, 0.0, single(drawing.width), single(drawing.height)));
    page.parent(PAGES).contents(CONTENT);
    let mut resources = page.resources();
    let mut fonts = resources.fonts();
    for (i, face) in (0..).zip(&faces) {
        fonts.pair(Name(face.post_script_name().as_bytes()), Ref::new(OTHERS + FONT_OBJECTS * i));
    }
    fonts.finish();
    let mut objects = resources.x_objects();
    for i in 0..pictures.len() {
        objects.pair(Name(picture_name(i).as_bytes()), picture_ref(i)?);
    }
    objects.finish();
    resources.finish();
    page.finish();
    pdf.document_info(INFORMATION).title(TextStr(&drawing.title)).creator(TextStr("gpbrdf"));

    for (i, &face) in (0..).zip(&faces) {
        write_font(&mut pdf, face, OTHERS + FONT_OBJECTS * i, &letters(drawing, face))?;
    }
    for (i, picture) in pictures.iter().enumerate() {
        let bytes = deflated(picture.pixels().as_flattened())?;
        let mut object = pdf.image_xobject(picture_ref(i)?, &bytes);
        object.filter(Filter::FlateDecode);
        object.width(count(picture.width())?).height(count(picture.height())?);
        object.color_space().device_rgb();
        object.bits_per_component(8);
    }
    let content = deflated(content(drawing).as_slice())?;
    pdf.stream(CONTENT, &content).filter(Filter::FlateDecode);
    Ok(pdf.finish())
}

fn picture_of(shape: &Shape) -> Option<&Picture> {
    if let Shape::Picture { picture, .. } = shape { Some(picture) } else { None }
}

fn picture_name(i: usize) -> String {
    format!("P{i}")
}

/// What draws the page.
fn content(drawing: &Drawing) -> Vec<u8> {
    let mut out = Content::new();
    let mut pictures = 0;
    // Heights of a PDF run upwards.
    let up = |y: f64| drawing.height - y;
    for shape in &drawing.shapes {
        match shape {
            Shape::Path { points, is_closed, fill, stroke } => {
                set_fill(&mut out, fill.unwrap_or_default());
                if let Some(stroke) = stroke {
                    let [r, g, b] = parts(stroke.colour);
                    out.set_stroke_rgb(r, g, b).set_line_width(single(stroke.width));
                    out.set_line_join(pdf_writer::types::LineJoinStyle::RoundJoin);
                }
                for (i, &[x, y]) in points.iter().enumerate() {
                    let (x, y) = (single(x), single(up(y)));
                    if i == 0 {
                        out.move_to(x, y)
                    } else {
                        out.line_to(x, y)
                    };
                }
                if *is_closed {
                    out.close_path();
                }
                match (fill, stroke) {
                    (Some(_), Some(_)) => out.fill_nonzero_and_stroke(),
                    (Some(_), None) => out.fill_nonzero(),
                    (None, Some(_)) => out.stroke(),
                    (None, None) => out.end_path(),
                };
            }
            Shape::Circle { centre: [x, y], radius, fill } => {
                set_fill(&mut out, *fill);
                circle(&mut out, [*x, up(*y)], *radius);
                out.fill_nonzero();
            }
            Shape::Picture { corner: [x, y], size: [width, height], .. } => {
                out.save_state();
                let [width, height, left, bottom] = [*width, *height, *x, up(y + height)].map(single);
                out.transform([width, 0.0, 0.0, height, left, bottom]);
                out.x_object(Name(picture_name(pictures).as_bytes()));
                out.restore_state();
                pictures += 1;
            }
            Shape::Text { at: [x, y], is_turned, colour, line } => {
                set_fill(&mut out, *colour);
                text(&mut out, line, [*x, up(*y)], *is_turned);
            }
        }
    }
    out.finish().into_vec()
}

fn text(out: &mut Content, line: &Line, [x, y]: [f64; 2], is_turned: bool) {
    out.begin_text();
    for run in &line.runs {
        out.set_font(Name(run.face.post_script_name().as_bytes()), single(run.size));
        let matrix = if is_turned {
            [0.0, 1.0, -1.0, 0.0, single(x - run.rise), single(y + run.x)]
        } else {
            [1.0, 0.0, 0.0, 1.0, single(x + run.x), single(y + run.rise)]
        };
        out.set_text_matrix(matrix);
        let glyphs: Vec<u8> = run.text.chars().flat_map(|c| run.face.glyph(c).to_be_bytes()).collect();
        out.show(Str(&glyphs));
    }
    out.end_text();
}

fn circle(out: &mut Content, [x, y]: [f64; 2], radius: f64) {
    let at = |dx: f64, dy: f64| (single(x + radius * dx), single(y + radius * dy));
    let (start_x, start_y) = at(1.0, 0.0);
    out.move_to(start_x, start_y);
    let mut direction = [1.0, 0.0];
    for _ in 0..4 {
        let [c, s] = direction;
        let next = [-s, c];
        let (x1, y1) = at(c - QUARTER * s, s + QUARTER * c);
        let (x2, y2) = at(next[0] + QUARTER * c, next[1] + QUARTER * s);
        let (x3, y3) = at(next[0], next[1]);
        out.cubic_to(x1, y1, x2, y2, x3, y3);
        direction = next;
    }
    out.close_path();
}

/// The characters that are written in one cut, by their glyphs.
fn letters(drawing: &Drawing, face: Face) -> BTreeMap<u16, char> {
    let mut found = BTreeMap::new();
    for shape in &drawing.shapes {
        let Shape::Text { line, .. } = shape else { continue };
        for run in line.runs.iter().filter(|run| run.face == face) {
            found.extend(run.text.chars().map(|c| (face.glyph(c), c)));
        }
    }
    found
}

/// Embeds one cut of the typeface.
fn write_font(pdf: &mut Pdf, face: Face, first: i32, letters: &BTreeMap<u16, char>) -> std::io::Result<()> {
    let [font, descendant, descriptor, outlines, unicode] =
        std::array::from_fn(|i| Ref::new(first + [0, 1, 2, 3, 4][i]));
    let name = Name(face.post_script_name().as_bytes());
    pdf.type0_font(font)
        .base_font(name)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(descendant)
        .to_unicode(unicode);
    let mut cid = pdf.cid_font(descendant);
    cid.subtype(CidFontType::Type0).base_font(name).system_info(SYSTEM).font_descriptor(descriptor);
    cid.default_width(0.0);
    let widths = (0..face.glyphs()).map(|glyph| single(1000.0 * face.advance(glyph)));
    cid.widths().consecutive(0, widths);
    cid.finish();

    let [ascent, descent, capital] = face.heights().map(|x| single(1000.0 * x));
    let [left, bottom, right, top] = face.bounds().map(|x| single(1000.0 * x));
    let flags = if face.is_italic() { FontFlags::SYMBOLIC | FontFlags::ITALIC } else { FontFlags::SYMBOLIC };
    pdf.font_descriptor(descriptor)
        .name(name)
        .flags(flags)
        .bbox(Rect::new(left, bottom, right, top))
        .italic_angle(single(face.italic_angle()))
        .ascent(ascent)
        .descent(descent)
        .cap_height(capital)
        .stem_v(if face == Face::SemiBold { 120.0 } else { 80.0 })
        .font_file3(outlines);
    let bytes = deflated(face.compact_outlines())?;
    pdf.stream(outlines, &bytes).filter(Filter::FlateDecode).pair(Name(b"Subtype"), Name(b"CIDFontType0C"));

    let mut map = UnicodeCmap::<u16>::new(Name(b"Custom"), SYSTEM);
    letters.iter().for_each(|(&glyph, &letter)| map.pair(glyph, letter));
    let bytes = deflated(map.finish().as_slice())?;
    pdf.cmap(unicode, &bytes).filter(Filter::FlateDecode);
    Ok(())
}

fn set_fill(out: &mut Content, colour: Rgb8) {
    let [r, g, b] = parts(colour);
    out.set_fill_rgb(r, g, b);
}

fn parts(colour: Rgb8) -> [f32; 3] {
    colour.map(|c| f32::from(c) / 255.0)
}

fn deflated(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    encoder.finish()
}

#[expect(clippy::cast_possible_truncation, reason = "PDF readers keep lengths in single precision")]
fn single(x: f64) -> f32 {
    x as f32
}
