//! Curves as SVG files. Their text stays text, so no font is needed to write them.

use anyhow::{Result, anyhow};
use plotters::prelude::{
    ChartBuilder, Circle, Cross, IntoDrawingArea, IntoFont, LineSeries, PathElement, RGBColor, SVGBackend,
    Text, TriangleMarker, WHITE,
};
use plotters::style::Color;

use gpbrdf_core::base::number::short;

/// Named points, joined by a line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    pub(super) name: String,
    pub(super) points: Vec<(f64, f64)>,
}

/// One axis: its name and whether its scale is logarithmic.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis<'a> {
    pub(super) name: &'a str,
    pub(super) logarithmic: bool,
}

impl Axis<'_> {
    fn place(&self, x: f64) -> f64 {
        if self.logarithmic { x.log10() } else { x }
    }

    /// The number at a mark. Two digits are enough to tell the marks of a logarithmic scale apart.
    fn label(&self, at: f64) -> String {
        if self.logarithmic {
            let x = 10f64.powf(at);
            if !(1e-4..1e5).contains(&x) {
                return format!("{x:.0e}");
            }
            let rounded: f64 = format!("{x:.1e}").parse().unwrap_or(x);
            return format!("{rounded}");
        }
        short(if at.abs() < 1e-12 { 0.0 } else { at }, 4)
    }
}

/// Colours that can be told apart in grey, too.
const COLOURS: [RGBColor; 8] = [
    RGBColor(31, 78, 160),
    RGBColor(214, 96, 30),
    RGBColor(40, 140, 70),
    RGBColor(150, 40, 120),
    RGBColor(200, 160, 20),
    RGBColor(60, 170, 190),
    RGBColor(120, 80, 50),
    RGBColor(110, 110, 110),
];

const SIZE: (u32, u32) = (1080, 540);
/// Width of the legend, to the right of the frame.
const LEGEND: i32 = 230;
/// Height of a line of the legend.
const LINE: i32 = 22;

/// Draws the curves in one frame with a legend beside it. Points that a scale cannot show are left out.
///
/// # Errors
/// If the drawing backend fails.
pub(super) fn curves(title: &str, x: Axis<'_>, y: Axis<'_>, curves: &[Curve]) -> Result<String> {
    let placed: Vec<Vec<(f64, f64)>> = curves
        .iter()
        .map(|curve| {
            let points = curve.points.iter().map(|&(a, b)| (x.place(a), y.place(b)));
            points.filter(|(a, b)| a.is_finite() && b.is_finite()).collect()
        })
        .collect();
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            return 0.0..1.0;
        }
        let margin = (0.05 * (high - low)).max(1e-6 * (1.0 + high.abs()));
        low - margin..high + margin
    };
    let xs = range(&mut placed.iter().flatten().map(|p| p.0));
    let ys = range(&mut placed.iter().flatten().map(|p| p.1));
    let mut svg = String::new();
    let failed = |error: &dyn std::fmt::Display| anyhow!("cannot draw \"{title}\": {error}");
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE).map_err(|e| failed(&e))?;
        let (area, legend) = area.split_horizontally(SIZE.0.cast_signed() - LEGEND);
        let mut chart = ChartBuilder::on(&area)
            .caption(title, ("sans-serif", 22).into_font())
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(78)
            .build_cartesian_2d(xs, ys)
            .map_err(|e| failed(&e))?;
        chart
            .configure_mesh()
            .x_desc(x.name)
            .y_desc(y.name)
            .x_label_formatter(&|v| x.label(*v))
            .y_label_formatter(&|v| y.label(*v))
            .label_style(("sans-serif", 14))
            .light_line_style(RGBColor(240, 240, 240))
            .draw()
            .map_err(|e| failed(&e))?;
        for (i, (curve, points)) in curves.iter().zip(&placed).enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
            chart.draw_series(line).map_err(|e| failed(&e))?;
            let y = 60 + LINE * i32::try_from(i).unwrap_or(0);
            let sample = PathElement::new([(4, y), (30, y)], colour.stroke_width(2));
            legend.draw(&sample).map_err(|e| failed(&e))?;
            let name = Text::new(curve.name.clone(), (38, y - 7), ("sans-serif", 14).into_font());
            legend.draw(&name).map_err(|e| failed(&e))?;
            if points.len() > 40 {
                continue;
            }
            // The points change their shape once colours begin again.
            let (at, points) = ((17, y), points.iter().copied());
            match i / COLOURS.len() % 3 {
                0 => chart
                    .draw_series(points.map(|p| Circle::new(p, 3, colour.filled())))
                    .map(drop)
                    .and_then(|()| legend.draw(&Circle::new(at, 3, colour.filled()))),
                1 => chart
                    .draw_series(points.map(|p| TriangleMarker::new(p, 5, colour.filled())))
                    .map(drop)
                    .and_then(|()| legend.draw(&TriangleMarker::new(at, 5, colour.filled()))),
                _ => chart
                    .draw_series(points.map(|p| Cross::new(p, 4, colour.stroke_width(2))))
                    .map(drop)
                    .and_then(|()| legend.draw(&Cross::new(at, 4, colour.stroke_width(2)))),
            }
            .map_err(|e| failed(&e))?;
        }
        area.present().map_err(|e| failed(&e))?;
    }
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_curves_are_in_the_file_whatever_the_values() {
        let axis = |name, logarithmic| Axis { name, logarithmic };
        let curve = |points: &[(f64, f64)]| Curve { name: "a curve".into(), points: points.to_vec() };
        let many = [curve(&[(1.0, 0.1), (10.0, 0.01), (100.0, 0.0)])];
        let svg = curves("A title", axis("samples", true), axis("error", true), &many).unwrap();
        for text in ["A title", "samples", "error", "a curve", "<circle", "polyline"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        // Two points, as a logarithm of zero is left out, and one in the legend.
        assert_eq!(svg.matches("<circle").count(), 3);
        for text in [">1<", ">10<", ">0.1<", ">0.01<"] {
            assert!(svg.split_whitespace().collect::<String>().contains(text), "{text}: {svg}");
        }
        for points in [&[][..], &[(f64::NAN, 1.0)], &[(2.0, 2.0)]] {
            let svg = curves("t", axis("x", false), axis("y", false), &[curve(points)]).unwrap();
            assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        }
    }
}
