//! A drawing as SVG. Text stays text; the typeface is in the file.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::figure::drawing::{Drawing, Shape, Stroke};
use crate::figure::font::{FAMILY, Face};
use crate::figure::picture::{Picture, Rgb8};
use crate::figure::text::{Line, Run};

/// Millimetres of a point.
const MILLIMETRES: f64 = 25.4 / 72.0;

/// The drawing as an SVG document.
///
/// # Errors
/// A picture without pixels.
pub(super) fn svg(drawing: &Drawing) -> std::io::Result<String> {
    let [width, height] = [drawing.width, drawing.height].map(number);
    let [wide, high] = [drawing.width, drawing.height].map(|x| number(MILLIMETRES * x));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{wide}mm\" height=\"{high}mm\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"{FAMILY}, 'Helvetica Neue', Arial, sans-serif\" \
         font-kerning=\"none\">\n<title>{}</title>\n<style>\n",
        escaped(&drawing.title)
    );
    for face in drawing.faces() {
        font_face(&mut out, face);
    }
    out.push_str("</style>\n");
    for shape in &drawing.shapes {
        write_shape(&mut out, shape)?;
    }
    out.push_str("</svg>\n");
    Ok(out)
}

/// Adds a line to a text, which takes any.
fn add(out: &mut String, line: std::fmt::Arguments<'_>) {
    // Writing to a string does not fail.
    let _ = writeln!(out, "{line}");
}

fn font_face(out: &mut String, face: Face) {
    let style = if face.is_italic() { "italic" } else { "normal" };
    add(
        out,
        format_args!(
            "@font-face{{font-family:{FAMILY};font-style:{style};font-weight:{};src:url(data:font/otf;base64,{})}}",
            face.weight(),
            STANDARD.encode(face.file())
        ),
    );
}

fn write_shape(out: &mut String, shape: &Shape) -> std::io::Result<()> {
    match shape {
        Shape::Path { points, is_closed, fill, stroke } => {
            let mut path = String::new();
            for (i, [x, y]) in points.iter().enumerate() {
                path.push(if i == 0 { 'M' } else { 'L' });
                path.push_str(&format!("{} {}", number(*x), number(*y)));
            }
            if *is_closed {
                path.push('Z');
            }
            let fill = fill.map_or_else(|| "none".to_owned(), colour);
            add(out, format_args!("<path d=\"{path}\" fill=\"{fill}\"{}/>", stroked(*stroke)));
        }
        Shape::Circle { centre: [x, y], radius, fill } => {
            let [x, y, radius] = [*x, *y, *radius].map(number);
            add(
                out,
                format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{}\"/>", colour(*fill)),
            );
        }
        Shape::Picture { corner: [x, y], size: [width, height], picture } => {
            let data = png_data(picture)?;
            let [x, y, width, height] = [*x, *y, *width, *height].map(number);
            add(
                out,
                format_args!(
                    "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
                     href=\"data:image/png;base64,{data}\"/>"
                ),
            );
        }
        Shape::Text { at: [x, y], is_turned, colour: ink, line } => {
            let [x, y] = [*x, *y].map(number);
            let turn = if *is_turned { " rotate(-90)" } else { "" };
            let head = format!("<text transform=\"translate({x} {y}){turn}\" fill=\"{}\">", colour(*ink));
            add(out, format_args!("{head}{}</text>", spans(line)));
        }
    }
    Ok(())
}

fn spans(line: &Line) -> String {
    let span = |run: &Run| {
        let style = if run.face.is_italic() { " font-style=\"italic\"" } else { "" };
        let weight = if run.face == Face::SemiBold { " font-weight=\"600\"" } else { "" };
        format!(
            "<tspan x=\"{}\" y=\"{}\" font-size=\"{}\"{style}{weight} xml:space=\"preserve\">{}</tspan>",
            number(run.x),
            number(-run.rise),
            number(run.size),
            escaped(&run.text)
        )
    };
    line.runs.iter().map(span).collect()
}

fn png_data(picture: &Picture) -> std::io::Result<String> {
    let mut bytes = Vec::new();
    picture.write_png(&mut bytes)?;
    Ok(STANDARD.encode(bytes))
}

fn stroked(stroke: Option<Stroke>) -> String {
    stroke.map_or_else(String::new, |stroke| {
        let (ink, width) = (colour(stroke.colour), number(stroke.width));
        format!(" stroke=\"{ink}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"")
    })
}

fn colour([r, g, b]: Rgb8) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A length with three decimals at most.
fn number(x: f64) -> String {
    let text = format!("{x:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_text_cannot_break_out() {
        assert_eq!([0.0, -0.0001, 1.25, 100.0, 0.12345].map(number), ["0", "0", "1.25", "100", "0.123"]);
        assert_eq!(escaped("a<b & \"c\">"), "a&lt;b &amp; &quot;c&quot;&gt;");
    }
}
