//! Lays a figure out on a page: rows of panels with captions, axes, scales and legends between a title and a note.

use crate::figure::axis::Ruled;
use crate::figure::drawing::{Anchor, Drawing, Shape};
use crate::figure::font::Face;
use crate::figure::panel::{Body, Panel, Scale};
use crate::figure::plot::Plot;
use crate::figure::sheet::{Figure, Row};
use crate::figure::style::{FAINT, FRAME, HAIRLINE, INK, LEADING, SMALL, TEXT, TICK, TITLE, labels};
use crate::figure::text::{self, Line};

const MARGIN: f64 = 4.0;
/// Between columns of panels, and between rows.
const GAP: f64 = 9.0;
const ROW_GAP: f64 = 7.0;
/// Between a thing and what is written about it.
const CLOSE: f64 = 3.0;
/// Width of the column with the names of rows.
const ROW_NAME: f64 = LEADING * TEXT;
/// Width of a bar of colours.
const BAR: f64 = 6.0;
/// The smallest width of a panel, and the largest height of one, however wide the page.
const SMALLEST: f64 = 20.0;
const TALLEST: f64 = 250.0;
/// A page has room for a legend beside a plot from this width on.
const WIDE: f64 = 300.0;

/// What surrounds a panel.
#[derive(Clone, Debug, Default)]
struct Surroundings {
    /// The ruled axes along the bottom and the left.
    axes: Option<[Ruled; 2]>,
    has_y_labels: bool,
    left: f64,
    right: f64,
    legend: Legend,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Legend {
    #[default]
    None,
    Beside,
    Below,
}

/// Lays out a figure on a page of this width, or a narrower one where panels would become too tall.
pub(super) fn lay_out(figure: &Figure, width: f64) -> Drawing {
    let columns = figure.rows.iter().map(|row| row.panels.len()).max().unwrap_or(0).max(1);
    let has_names = figure.rows.iter().any(|row| !row.name.is_empty());
    let start = MARGIN + if has_names { ROW_NAME } else { 0.0 };
    let guess = (0.85 * (width - start) / columns as f64 - GAP).max(SMALLEST);
    let around: Vec<Vec<Surroundings>> =
        figure.rows.iter().map(|row| surroundings(row, guess, width)).collect();

    let extra = |column: usize, side: fn(&Surroundings) -> f64| {
        around.iter().filter_map(|row| row.get(column)).map(side).fold(0.0, f64::max)
    };
    let extras: Vec<[f64; 2]> = (0..columns).map(|c| [extra(c, |s| s.left), extra(c, |s| s.right)]).collect();
    let taken: f64 = extras.iter().flatten().sum::<f64>() + GAP * (columns - 1) as f64;
    let steepest = figure.rows.iter().flat_map(|row| &row.panels).map(|panel| panel.body.aspect());
    let highest = TALLEST / steepest.fold(0.2, f64::max);
    let size = ((width - start - MARGIN - taken) / columns as f64).clamp(SMALLEST, highest.max(SMALLEST));
    let width = start + taken + size * columns as f64 + MARGIN;
    let lefts: Vec<f64> = (0..columns)
        .map(|column| {
            let before: f64 = extras[..column].iter().flatten().sum();
            start + before + extras[column][0] + (size + GAP) * column as f64
        })
        .collect();

    let mut page = Drawing { title: plain(&figure.title), width, height: 0.0, shapes: Vec::new() };
    let mut y = MARGIN;
    for line in text::wrap(&figure.title, TITLE, Face::SemiBold, width - 2.0 * MARGIN) {
        page.text(line, [MARGIN, y + TITLE], Anchor::Start, INK);
        y += LEADING * TITLE;
    }
    if y > MARGIN {
        y += CLOSE;
    }
    for (i, (row, around)) in figure.rows.iter().zip(&around).enumerate() {
        if i > 0 {
            y += ROW_GAP;
        }
        y = draw_row(&mut page, row, around, &lefts, size, y);
    }
    let note = text::wrap(&figure.note, SMALL, Face::Regular, width - 2.0 * MARGIN);
    if !note.is_empty() {
        y += 2.0 * CLOSE;
    }
    for line in note {
        page.text(line, [MARGIN, y + SMALL], Anchor::Start, FAINT);
        y += LEADING * SMALL;
    }
    page.height = y + MARGIN;
    page
}

/// A text without the marks of greek letters and small ones.
fn plain(title: &str) -> String {
    text::line(title, 1.0, Face::Regular).runs.into_iter().map(|run| run.text).collect()
}

fn small(label: &str) -> Line {
    text::line(label, SMALL, Face::Regular)
}

/// What surrounds the panels of a row, whose width is about `guess`.
fn surroundings(row: &Row, guess: f64, page: f64) -> Vec<Surroundings> {
    let size = |body: &Body| [guess, guess * body.aspect()];
    let mut found: Vec<Surroundings> = Vec::new();
    for (column, panel) in row.panels.iter().enumerate() {
        let axes = match &panel.body {
            Body::Picture { axes, .. } => axes.as_ref().map(|[x, y]| {
                let [width, height] = size(&panel.body);
                let none = std::iter::empty;
                [x.ruled(none(), labels(width, 30.0)), y.ruled(none(), labels(height, 20.0))]
            }),
            Body::Plot { plot, .. } => Some(plot.ruled(size(&panel.body))),
        };
        let mut around = Surroundings { axes, ..Surroundings::default() };
        if let Some([x, y]) = &around.axes {
            // Labels of an axis that is that of the panel to the left are not repeated.
            let before = found.last().and_then(|before| before.axes.as_ref());
            around.has_y_labels = column == 0 || before.is_none_or(|[_, before]| before != y);
            if around.has_y_labels {
                let widest = y.ticks.iter().map(|(_, label)| small(label).width).fold(0.0, f64::max);
                around.left = LEADING * SMALL + CLOSE + widest + TICK + CLOSE;
            }
            // Labels of ticks at the ends reach beyond the panel.
            let beyond =
                |tick: Option<&(f64, String)>| tick.map_or(0.0, |(_, label)| 0.5 * small(label).width);
            around.left = around.left.max(beyond(x.ticks.first()));
            around.right = beyond(x.ticks.last());
        }
        match &panel.body {
            Body::Picture { scale: Some(scale), .. } => around.right = around.right.max(scale_width(scale)),
            Body::Plot { plot, .. } if plot.legend && !plot.curves.is_empty() => {
                let beside = GAP + plot.legend_width();
                if page >= WIDE && beside < 0.4 * page {
                    around.legend = Legend::Beside;
                    around.right = around.right.max(beside);
                } else {
                    around.legend = Legend::Below;
                }
            }
            _ => {}
        }
        found.push(around);
    }
    found
}

/// Draws a row from `top` on, and returns where it ends.
fn draw_row(
    page: &mut Drawing,
    row: &Row,
    around: &[Surroundings],
    lefts: &[f64],
    size: f64,
    top: f64,
) -> f64 {
    let has_captions = row.panels.iter().any(|panel| !panel.caption.is_empty());
    let body_top = top + if has_captions { LEADING * TEXT + 1.0 } else { 0.0 };
    let height = row.panels.iter().map(|panel| size * panel.body.aspect()).fold(0.0, f64::max);
    if !row.name.is_empty() {
        let name = text::line(&row.name, TEXT, Face::Regular);
        page.turned_text(name, [MARGIN + TEXT, body_top + 0.5 * height], Anchor::Middle, INK);
    }
    let mut end = body_top + height;
    for ((panel, around), &left) in row.panels.iter().zip(around).zip(lefts) {
        let corner = [left, body_top];
        let box_size = [size, size * panel.body.aspect()];
        draw_caption(page, &panel.caption, left + 0.5 * size, top + TEXT, size + GAP);
        draw_body(page, panel, around, corner, box_size);
        let mut bottom = body_top + box_size[1];
        if around.axes.is_some() {
            bottom += TICK + CLOSE + 2.0 * LEADING * SMALL;
        }
        if let (Body::Plot { plot, .. }, Legend::Below) = (&panel.body, around.legend) {
            let room = size + around.left;
            let [columns, rows] = plot.legend_shape(room);
            plot.draw_legend(page, [left - around.left, bottom + CLOSE], columns, room);
            bottom += CLOSE + LEADING * SMALL * rows as f64;
        }
        end = end.max(bottom);
    }
    end
}

/// Writes a caption about `middle`, smaller where it would be too wide.
fn draw_caption(page: &mut Drawing, caption: &str, middle: f64, base: f64, room: f64) {
    let wide = text::width(caption, TEXT, Face::Regular);
    let size = if wide > room { TEXT * room / wide } else { TEXT };
    if !caption.is_empty() {
        page.text(text::line(caption, size, Face::Regular), [middle, base], Anchor::Middle, INK);
    }
}

fn draw_body(page: &mut Drawing, panel: &Panel, around: &Surroundings, corner: [f64; 2], size: [f64; 2]) {
    match &panel.body {
        Body::Picture { picture, axes, scale } => {
            if picture.width() > 0 && picture.height() > 0 {
                page.shapes.push(Shape::Picture { corner, size, picture: picture.clone() });
            }
            if let (Some(ruled), Some([x, y])) = (&around.axes, axes) {
                draw_axes(page, ruled, [&x.name, &y.name], around, corner, size);
            }
            if let Some(scale) = scale {
                draw_scale(page, scale, [corner[0] + size[0] + 2.0 * CLOSE, corner[1]], size[1]);
            }
        }
        Body::Plot { plot, .. } => {
            let Some(ruled) = &around.axes else { return };
            plot.draw(page, corner, size, ruled);
            Plot::draw_minor(page, corner, size, ruled);
            draw_axes(page, ruled, [&plot.x.name, &plot.y.name], around, corner, size);
            if around.legend == Legend::Beside {
                plot.draw_legend(page, [corner[0] + size[0] + GAP, corner[1]], 1, plot.legend_width());
            }
        }
    }
}

/// Draws frame, ticks, labels and names. A label that would touch another one is left out.
fn draw_axes(
    page: &mut Drawing,
    [across, up]: &[Ruled; 2],
    [x_name, y_name]: [&str; 2],
    around: &Surroundings,
    [left, top]: [f64; 2],
    [width, height]: [f64; 2],
) {
    let bottom = top + height;
    page.frame([left, top], [width, height], FAINT, FRAME);
    let ticks: Vec<(f64, &str)> = across
        .ticks
        .iter()
        .filter_map(|(x, label)| Some((left + width * across.part(*x)?, label.as_str())))
        .collect();
    let centred = |x: f64, label: &str| {
        let half = 0.5 * small(label).width + 1.5;
        [x - half, x + half]
    };
    let last = ticks.last().map(|&(x, label)| centred(x, label));
    let mut free = f64::NEG_INFINITY;
    for (i, &(x, label)) in ticks.iter().enumerate() {
        page.line(vec![[x, bottom], [x, bottom + TICK]], FAINT, HAIRLINE);
        let [start, end] = centred(x, label);
        let touches_last = i + 1 < ticks.len() && last.is_some_and(|[first, _]| end > first);
        if start >= free && !touches_last {
            page.text(small(label), [x, bottom + TICK + CLOSE + 0.72 * SMALL], Anchor::Middle, FAINT);
            free = end;
        }
    }
    let name_base = bottom + TICK + CLOSE + LEADING * SMALL + SMALL;
    page.text(small(x_name), [left + 0.5 * width, name_base], Anchor::Middle, INK);

    for (y, label) in &up.ticks {
        let Some(t) = up.part(*y) else { continue };
        let y = bottom - height * t;
        page.line(vec![[left - TICK, y], [left, y]], FAINT, HAIRLINE);
        if around.has_y_labels {
            page.text(small(label), [left - TICK - CLOSE, y + 0.36 * SMALL], Anchor::End, FAINT);
        }
    }
    if around.has_y_labels {
        let at = [left - around.left + SMALL, top + 0.5 * height];
        page.turned_text(small(y_name), at, Anchor::Middle, INK);
    }
}

/// How many ticks a bar of colours has at most.
const BAR_TICKS: usize = 5;

fn scale_width(scale: &Scale) -> f64 {
    let widest = scale.labels(BAR_TICKS).iter().map(|label| small(label).width).fold(0.0, f64::max);
    2.0 * CLOSE + BAR + TICK + 0.5 * CLOSE + widest
}

/// Draws a bar of colours with labelled ticks, three where five would be too close together.
fn draw_scale(page: &mut Drawing, scale: &Scale, [left, top]: [f64; 2], height: f64) {
    const STEPS: usize = 128;
    let step = height / STEPS as f64;
    for i in 0..STEPS {
        let t = 1.0 - (i as f64 + 0.5) / STEPS as f64;
        // Each step reaches below the next one, so that no seam shines through.
        let tall = (2.0 * step).min(height - step * i as f64);
        page.fill([left, top + step * i as f64], [BAR, tall], scale.map.at(t));
    }
    page.frame([left, top], [BAR, height], FAINT, HAIRLINE);
    let count = if height < 6.5 * LEADING * SMALL { 3 } else { BAR_TICKS };
    for (i, label) in scale.labels(count).iter().enumerate() {
        let y = top + height * i as f64 / (count - 1) as f64;
        page.line(vec![[left + BAR, y], [left + BAR + TICK, y]], FAINT, HAIRLINE);
        page.text(small(label), [left + BAR + TICK + 0.5 * CLOSE, y + 0.36 * SMALL], Anchor::Start, FAINT);
    }
}
