//! Curves in a frame, with a legend.

use crate::figure::axis::{Axis, Ruled};
use crate::figure::drawing::{Anchor, Drawing, Shape};
use crate::figure::font::Face;
use crate::figure::picture::Rgb8;
use crate::figure::style::{FAINT, GRID, HAIRLINE, INK, LEADING, SMALL, labels};
use crate::figure::text;

/// Points joined by a line, with an interval about them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// What the legend says.
    pub name: String,
    /// The points `(x, y)`, in the order in which they are joined. Up to 40 are marked.
    pub points: Vec<(f64, f64)>,
    /// Intervals `(x, low, high)`, shown as a band behind the curve.
    pub band: Vec<(f64, f64, f64)>,
    /// Its colour; one of a set of seven if there is none.
    pub colour: Option<Rgb8>,
}

/// Curves in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// The axis along the bottom.
    pub x: Axis,
    /// The axis along the left.
    pub y: Axis,
    /// The curves, from the back to the front.
    pub curves: Vec<Curve>,
    /// Whether the names of the curves are shown.
    pub legend: bool,
}

/// "Bright" by P. Tol, "Colour Schemes", SRON technical note SRON/EPS/TN/09-002 (2021): seven colours that people with
/// colour blindness can tell apart.
const COLOURS: [Rgb8; 7] = [
    [0x44, 0x77, 0xaa],
    [0xee, 0x66, 0x77],
    [0x22, 0x88, 0x33],
    [0xcc, 0xbb, 0x44],
    [0x66, 0xcc, 0xee],
    [0xaa, 0x33, 0x77],
    [0x88, 0x88, 0x88],
];
/// Curves with more points are not marked.
const MOST_MARKS: usize = 40;
const MARK: f64 = 1.7;
const LINE: f64 = 1.1;
/// Length of a line in the legend, and the room between it and its name.
const SAMPLE: f64 = 16.0;
const SAMPLE_GAP: f64 = 4.0;

impl Plot {
    fn colour(&self, i: usize) -> Rgb8 {
        self.curves[i].colour.unwrap_or(COLOURS[i % COLOURS.len()])
    }

    /// Both axes, ruled for a frame of this size.
    pub(super) fn ruled(&self, [width, height]: [f64; 2]) -> [Ruled; 2] {
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let bands = || self.curves.iter().flat_map(|curve| &curve.band);
        let xs = points().map(|p| p.0).chain(bands().map(|b| b.0));
        let ys = points().map(|p| p.1).chain(bands().flat_map(|b| [b.1, b.2]));
        [self.x.ruled(xs, labels(width, 34.0)), self.y.ruled(ys, labels(height, 22.0))]
    }

    /// Draws bands, grid and curves into a box.
    pub(super) fn draw(&self, page: &mut Drawing, [left, top]: [f64; 2], size: [f64; 2], axes: &[Ruled; 2]) {
        let at = |x: f64, y: f64| {
            let (across, up) = (axes[0].part(x)?, axes[1].part(y)?);
            Some([left + size[0] * across, top + size[1] * (1.0 - up)])
        };
        let frame = [[left, left + size[0]], [top, top + size[1]]];
        // A band that leaves the frame ends at its edge.
        let held = |point: Option<[f64; 2]>| {
            point.map(|p| std::array::from_fn(|axis| p[axis].clamp(frame[axis][0], frame[axis][1])))
        };
        for (value, _) in &axes[0].ticks {
            let Some(t) = axes[0].part(*value) else { continue };
            let x = left + size[0] * t;
            page.line(vec![[x, top], [x, top + size[1]]], GRID, HAIRLINE);
        }
        for (value, _) in &axes[1].ticks {
            let Some(t) = axes[1].part(*value) else { continue };
            let y = top + size[1] * (1.0 - t);
            page.line(vec![[left, y], [left + size[0], y]], GRID, HAIRLINE);
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let low = curve.band.iter().filter_map(|b| held(at(b.0, b.1)));
            let high = curve.band.iter().rev().filter_map(|b| held(at(b.0, b.2)));
            let ring: Vec<[f64; 2]> = low.chain(high).collect();
            if ring.len() > 2 {
                page.area(ring, lightened(self.colour(i)));
            }
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let points: Vec<[f64; 2]> = curve.points.iter().filter_map(|&(x, y)| at(x, y)).collect();
            for line in clipped(&points, &frame) {
                page.line(line, self.colour(i), LINE);
            }
            if points.len() <= MOST_MARKS {
                let inside =
                    |p: &&[f64; 2]| (0..2).all(|axis| held(Some(**p)).is_some_and(|h| h[axis] == p[axis]));
                points.iter().filter(inside).for_each(|&at| self.mark(page, i, at));
            }
        }
    }

    /// Draws the mark of a curve. Marks change their shape once colours begin again.
    fn mark(&self, page: &mut Drawing, i: usize, [x, y]: [f64; 2]) {
        let (colour, r) = (self.colour(i), MARK);
        match i / COLOURS.len() % 3 {
            0 => page.shapes.push(Shape::Circle { centre: [x, y], radius: r, fill: colour }),
            1 => page.fill([x - 0.9 * r, y - 0.9 * r], [1.8 * r; 2], colour),
            _ => page.area(vec![[x, y - 1.4 * r], [x + 1.3 * r, y + r], [x - 1.3 * r, y + r]], colour),
        }
    }

    /// The width of the legend in one column.
    pub(super) fn legend_width(&self) -> f64 {
        let names = self.curves.iter().map(|curve| text::width(&curve.name, SMALL, Face::Regular));
        SAMPLE + SAMPLE_GAP + names.fold(0.0, f64::max)
    }

    /// How many columns of the legend fit into a width, and the rows that are left.
    pub(super) fn legend_shape(&self, width: f64) -> [usize; 2] {
        let one = self.legend_width() + 2.0 * SAMPLE_GAP;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few columns")]
        let columns = ((width / one).floor().max(1.0) as usize).min(self.curves.len().max(1));
        [columns, self.curves.len().div_ceil(columns)]
    }

    /// Draws the legend from its upper left corner on. A column that is wider than `room` has smaller text.
    pub(super) fn draw_legend(&self, page: &mut Drawing, [left, top]: [f64; 2], columns: usize, room: f64) {
        let rows = self.curves.len().div_ceil(columns.max(1)).max(1);
        let before = SAMPLE + SAMPLE_GAP;
        let shrunk = ((room - before) / (self.legend_width() - before).max(1e-9)).clamp(0.1, 1.0);
        let one = self.legend_width() + 2.0 * SAMPLE_GAP;
        for (i, curve) in self.curves.iter().enumerate() {
            let (column, row) = (i / rows, i % rows);
            let (x, y) = (left + one * column as f64, top + LEADING * SMALL * (row as f64 + 0.5));
            if !curve.band.is_empty() {
                page.fill([x, y - 2.5], [SAMPLE, 5.0], lightened(self.colour(i)));
            }
            page.line(vec![[x, y], [x + SAMPLE, y]], self.colour(i), LINE);
            if curve.points.len() <= MOST_MARKS {
                self.mark(page, i, [x + 0.5 * SAMPLE, y]);
            }
            let name = text::line(&curve.name, shrunk * SMALL, Face::Regular);
            page.text(name, [x + before, y + 0.36 * SMALL], Anchor::Start, INK);
        }
    }

    /// Draws the ticks between those with labels.
    pub(super) fn draw_minor(page: &mut Drawing, [left, top]: [f64; 2], size: [f64; 2], axes: &[Ruled; 2]) {
        let bottom = top + size[1];
        for t in axes[0].minor.iter().filter_map(|&x| axes[0].part(x)) {
            let x = left + size[0] * t;
            page.line(vec![[x, bottom], [x, bottom - 2.0]], FAINT, HAIRLINE);
        }
        for t in axes[1].minor.iter().filter_map(|&y| axes[1].part(y)) {
            let y = bottom - size[1] * t;
            page.line(vec![[left, y], [left + 2.0, y]], FAINT, HAIRLINE);
        }
    }
}

/// The parts of a line that are in a box, which is given by its ends along each axis. Y. Liang and B. Barsky, "A New
/// Concept and Method for Line Clipping" (1984).
fn clipped(points: &[[f64; 2]], frame: &[[f64; 2]; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    for pair in points.windows(2) {
        let step: [f64; 2] = std::array::from_fn(|axis| pair[1][axis] - pair[0][axis]);
        let (mut enters, mut leaves) = (0.0f64, 1.0f64);
        for (axis, [low, high]) in frame.iter().enumerate() {
            let [a, b] = [low, high].map(|end| (end - pair[0][axis]) / step[axis]);
            if step[axis] != 0.0 {
                (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
            } else if !(*low..=*high).contains(&pair[0][axis]) {
                leaves = -1.0;
            }
        }
        if enters > leaves {
            continue;
        }
        // Ends stay as they are, so that lines are known to go on.
        let on = |t: f64| match t {
            0.0 => pair[0],
            1.0 => pair[1],
            _ => std::array::from_fn(|axis| pair[0][axis] + t * step[axis]),
        };
        match lines.last_mut() {
            Some(line) if enters == 0.0 && line.last() == Some(&pair[0]) => line.push(on(leaves)),
            _ => lines.push(vec![on(enters), on(leaves)]),
        }
    }
    lines
}

/// A colour mixed with white.
fn lightened(colour: Rgb8) -> Rgb8 {
    colour.map(|c| u8::try_from((u16::from(c) + 3 * 255) / 4).unwrap_or(u8::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_frame_and_go_on_where_they_come_back() {
        let frame = [[0.0, 10.0], [0.0, 4.0]];
        let inside = [[0.0, 1.0], [5.0, 4.0], [10.0, 0.0]];
        assert_eq!(clipped(&inside, &frame), [inside.to_vec()]);
        let peak = [[0.0, 0.0], [2.0, 8.0], [4.0, 0.0], [6.0, 2.0]];
        let expected = [vec![[0.0, 0.0], [1.0, 4.0]], vec![[3.0, 4.0], [4.0, 0.0], [6.0, 2.0]]];
        assert_eq!(clipped(&peak, &frame), expected);
        assert!(clipped(&[[0.0, 5.0], [10.0, 5.0]], &frame).is_empty());
        assert!(clipped(&[[1.0, 1.0]], &frame).is_empty());
    }
}
