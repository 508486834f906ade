//! What a figure is drawn of, whatever the file: lines, areas, dots, pictures and text.

use crate::figure::font::Face;
use crate::figure::picture::{Picture, Rgb8};
use crate::figure::text::Line;

/// A line around or along a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stroke {
    pub(super) colour: Rgb8,
    pub(super) width: f64,
}

/// What is drawn. Lengths are points, 1/72 inch; `x` runs to the right and `y` down.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// Straight lines between points, joined to a ring if it is closed.
    Path { points: Vec<[f64; 2]>, is_closed: bool, fill: Option<Rgb8>, stroke: Option<Stroke> },
    /// A dot.
    Circle { centre: [f64; 2], radius: f64, fill: Rgb8 },
    /// A picture in a box.
    Picture { corner: [f64; 2], size: [f64; 2], picture: Picture },
    /// A line of text whose base line starts at `at`; it runs upwards if it is turned.
    Text { at: [f64; 2], is_turned: bool, colour: Rgb8, line: Line },
}

/// Where a text is in relation to the point that is given for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A page: its size in points, and what is on it, from the back to the front.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drawing {
    pub(super) title: String,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) shapes: Vec<Shape>,
}

impl Drawing {
    /// Draws a line.
    pub(super) fn line(&mut self, points: Vec<[f64; 2]>, colour: Rgb8, width: f64) {
        let stroke = Some(Stroke { colour, width });
        self.shapes.push(Shape::Path { points, is_closed: false, fill: None, stroke });
    }

    /// Fills an area.
    pub(super) fn area(&mut self, points: Vec<[f64; 2]>, colour: Rgb8) {
        self.shapes.push(Shape::Path { points, is_closed: true, fill: Some(colour), stroke: None });
    }

    /// Fills a box.
    pub(super) fn fill(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], colour: Rgb8) {
        self.area(vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]], colour);
    }

    /// Draws the edges of a box.
    pub(super) fn frame(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], colour: Rgb8, line: f64) {
        let points = vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
        let stroke = Some(Stroke { colour, width: line });
        self.shapes.push(Shape::Path { points, is_closed: true, fill: None, stroke });
    }

    /// Writes a line of text, whose base line is at the height of `at`.
    pub(super) fn text(&mut self, line: Line, at: [f64; 2], anchor: Anchor, colour: Rgb8) {
        let x = at[0] - before(anchor, line.width);
        self.shapes.push(Shape::Text { at: [x, at[1]], is_turned: false, colour, line });
    }

    /// Writes a line of text upwards.
    pub(super) fn turned_text(&mut self, line: Line, at: [f64; 2], anchor: Anchor, colour: Rgb8) {
        let y = at[1] + before(anchor, line.width);
        self.shapes.push(Shape::Text { at: [at[0], y], is_turned: true, colour, line });
    }

    /// The cuts of the typeface that its texts need.
    pub(super) fn faces(&self) -> Vec<Face> {
        let mut faces: Vec<Face> = self.shapes.iter().flat_map(Shape::faces).collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    }
}

impl Shape {
    fn faces(&self) -> impl Iterator<Item = Face> {
        let runs = if let Self::Text { line, .. } = self { line.runs.as_slice() } else { &[] };
        runs.iter().map(|run| run.face)
    }
}

fn before(anchor: Anchor, width: f64) -> f64 {
    match anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => 0.5 * width,
        Anchor::End => width,
    }
}
