//! A drawing as pixels.

use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Paint, PathBuilder, Pixmap, PixmapPaint, PixmapRef,
    Stroke, Transform,
};
use ttf_parser::OutlineBuilder;

use crate::base::error::{Error, Result};
use crate::figure::drawing::{Drawing, Shape};
use crate::figure::picture::{Picture, Rgb8};
use crate::figure::text::Line;

/// The largest number of pixels of a bitmap.
const MOST_PIXELS: f64 = 4e8;

/// The drawing on white, `scale` pixels a point.
///
/// # Errors
/// [`Error::InvalidArgument`] for less than one pixel or more than 400 million.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sizes are checked")]
pub(super) fn bitmap(drawing: &Drawing, scale: f64) -> Result<Picture> {
    let [width, height] = [drawing.width, drawing.height].map(|x| (scale * x).round());
    let refused = || {
        Error::argument(
            "size of a figure",
            "1 to 400 million pixels",
            format!("{width:.0} x {height:.0} pixels"),
        )
    };
    if !(width >= 1.0 && height >= 1.0 && width * height <= MOST_PIXELS) {
        return Err(refused());
    }
    let mut canvas = Pixmap::new(width as u32, height as u32).ok_or_else(refused)?;
    canvas.fill(Color::WHITE);
    for shape in &drawing.shapes {
        draw(&mut canvas, shape, scale);
    }
    // The canvas is opaque everywhere.
    let pixels = canvas.pixels().iter().map(|p| [p.red(), p.green(), p.blue()]).collect();
    Picture::new(width as usize, height as usize, pixels)
}

fn draw(canvas: &mut Pixmap, shape: &Shape, scale: f64) {
    let to_pixels = Transform::from_scale(single(scale), single(scale));
    match shape {
        Shape::Path { points, is_closed, fill, stroke } => {
            let mut builder = PathBuilder::new();
            for (i, &[x, y]) in points.iter().enumerate() {
                let (x, y) = (single(x), single(y));
                if i == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
            }
            if *is_closed {
                builder.close();
            }
            let Some(path) = builder.finish() else { return };
            if let Some(fill) = fill {
                canvas.fill_path(&path, &paint(*fill), FillRule::Winding, to_pixels, None);
            }
            if let Some(stroke) = stroke {
                let line = Stroke {
                    width: single(stroke.width),
                    line_cap: LineCap::Butt,
                    line_join: LineJoin::Round,
                    ..Stroke::default()
                };
                canvas.stroke_path(&path, &paint(stroke.colour), &line, to_pixels, None);
            }
        }
        Shape::Circle { centre: [x, y], radius, fill } => {
            if let Some(path) = PathBuilder::from_circle(single(*x), single(*y), single(*radius)) {
                canvas.fill_path(&path, &paint(*fill), FillRule::Winding, to_pixels, None);
            }
        }
        Shape::Picture { corner, size, picture } => {
            let corner = corner.map(|x| (scale * x).round());
            let size = size.map(|x| (scale * x).round().max(1.0));
            draw_picture(canvas, picture, corner, size);
        }
        Shape::Text { at: [x, y], is_turned, colour, line } => {
            let turn = if *is_turned { -90.0 } else { 0.0 };
            let place = to_pixels.pre_translate(single(*x), single(*y)).pre_rotate(turn);
            draw_text(canvas, line, *colour, place);
        }
    }
}

fn draw_text(canvas: &mut Pixmap, line: &Line, colour: Rgb8, place: Transform) {
    for run in &line.runs {
        let mut outline = Outline(PathBuilder::new());
        let unit = run.size / run.face.units_per_em();
        let mut pen = run.x;
        for character in run.text.chars() {
            let glyph = run.face.glyph(character);
            let mut builder = Placed { outline: &mut outline, pen, rise: run.rise, unit };
            run.face.outline(glyph, &mut builder);
            pen += run.size * run.face.advance(glyph);
        }
        if let Some(path) = outline.0.finish() {
            canvas.fill_path(&path, &paint(colour), FillRule::Winding, place, None);
        }
    }
}

/// A path that glyphs are added to.
struct Outline(PathBuilder);

/// Where a glyph is added.
struct Placed<'a> {
    outline: &'a mut Outline,
    pen: f64,
    rise: f64,
    /// Points of one unit of the glyph.
    unit: f64,
}

impl Placed<'_> {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        let (x, y) = (f64::from(x), f64::from(y));
        (single(self.pen + self.unit * x), single(-self.rise - self.unit * y))
    }
}

impl OutlineBuilder for Placed<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.outline.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.outline.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.outline.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.outline.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.outline.0.close();
    }
}

/// Draws a picture into a box of whole pixels. It is halved as often as it is at least twice as large, so that no pixel
/// of it is lost.
fn draw_picture(canvas: &mut Pixmap, picture: &Picture, [x, y]: [f64; 2], [width, height]: [f64; 2]) {
    let mut source = picture.clone();
    while source.width() as f64 >= 2.0 * width && source.height() as f64 >= 2.0 * height {
        source = halved(&source);
    }
    let bytes: Vec<u8> = source.pixels().iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let Some(pixels) = PixmapRef::from_bytes(&bytes, side(source.width()), side(source.height())) else {
        return;
    };
    let scale = [width / source.width() as f64, height / source.height() as f64].map(single);
    let place = Transform::from_row(scale[0], 0.0, 0.0, scale[1], single(x), single(y));
    let paint = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
    canvas.draw_pixmap(0, 0, pixels, &paint, place, None);
}

/// A picture of half the size: means of four pixels.
fn halved(picture: &Picture) -> Picture {
    let (width, height) = (picture.width() / 2, picture.height() / 2);
    Picture::from_fn(width, height, |x, y| {
        std::array::from_fn(|c| {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| picture.at(2 * x + i, 2 * y + j)[c]);
            let sum: u16 = four.map(u16::from).iter().sum();
            u8::try_from((sum + 2) / 4).unwrap_or(u8::MAX)
        })
    })
}

fn paint([r, g, b]: Rgb8) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint.anti_alias = true;
    paint
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a page in single precision is exact to a thousandth of a pixel"
)]
fn single(x: f64) -> f32 {
    x as f32
}
