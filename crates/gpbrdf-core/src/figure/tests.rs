//! Figures as a whole, in all formats.

use super::*;
use crate::brdf::Rgb;
use crate::brdf::angles::HalfDiff;
use crate::brdf::table::BrdfTable;
use crate::figure::drawing::{Drawing, Shape};
use crate::figure::page::lay_out;
use crate::judge::Environment;
use crate::judge::sphere::render_env;

fn glossy(a: HalfDiff) -> Rgb {
    let fresnel = 0.05 + 0.95 * (1.0 - a.theta_d.cos()).powi(5);
    let lobe = 12.0 * fresnel * a.theta_h.cos().powi(120);
    [0.16 + lobe, 0.018 + lobe, 0.014 + lobe]
}

/// Differs from [`glossy`] by a ripple of 4 percent.
fn rippled(a: HalfDiff) -> Rgb {
    let ripple = 1.0 + 0.04 * (9.0 * a.theta_h).sin() * (7.0 * a.theta_d).cos();
    glossy(a).map(|x| x * ripple)
}

fn plot(curves: usize) -> Plot {
    let curve = |i: usize| {
        let points =
            (0..12).map(|k| (10f64.powf(f64::from(k) / 4.0), (i + 1) as f64 / f64::from(k + 1))).collect();
        let band = (0..12).map(|k| (10f64.powf(f64::from(k) / 4.0), 0.1, 2.0)).collect();
        Curve { name: format!("curve {i} of α_x"), points, band, ..Curve::default() }
    };
    let curves = (0..curves).map(curve).collect();
    Plot { x: Axis::logarithmic("samples"), y: Axis::logarithmic("error (sr^{−1})"), curves, legend: true }
}

fn long_name() -> Plot {
    let mut plot = plot(2);
    plot.curves[1].name = "a name that is wider than the column of a paper ".repeat(2);
    plot
}

fn figures() -> Vec<Figure> {
    let (truth, prediction) = (BrdfTable::from_fn(glossy), BrdfTable::from_fn(rippled));
    let options = SliceOptions { size: 64, exposure: -1.0, square_theta_h: true, ..SliceOptions::default() };
    let images = render_env(&[&truth, &prediction], &Environment::studio(), 64);
    let title =
        "chm_mint from 234 samples, and a title that is longer than it should be, by far, for so few panels";
    vec![
        slice_figure(title, Some(&truth), &prediction, &options).unwrap(),
        sphere_figure("", Some(&images[0]), &images[1], None).unwrap(),
        sphere_figure("", None, &images[1], None).unwrap(),
        Figure::of_panels("Curves", vec![Panel::plot("", plot(3), 0.6)], "What they are."),
        Figure::of_panels("Many curves", vec![Panel::plot("", plot(19), 0.6)], ""),
        Figure::of_panels("A long name", vec![Panel::plot("", long_name(), 0.6)], ""),
        Figure {
            title: "Rows".to_owned(),
            rows: vec![
                Row {
                    name: "pictures".to_owned(),
                    panels: (0..4).map(|_| Panel::picture("a", Picture::filled(9, 9, [9; 3]))).collect(),
                },
                Row {
                    name: "plots".to_owned(),
                    panels: (0..4).map(|_| Panel::plot("", Plot { legend: false, ..plot(1) }, 1.0)).collect(),
                },
            ],
            note: String::new(),
        },
        Figure::default(),
        Figure::of_panels("No picture", vec![Panel::picture("nothing", Picture::filled(0, 0, [0; 3]))], ""),
    ]
}

/// The boxes of texts that are not turned: left, top, right, bottom.
fn text_boxes(page: &Drawing) -> Vec<([f64; 4], String)> {
    let of = |shape: &Shape| match shape {
        Shape::Text { at: [x, y], is_turned: false, line, .. } => {
            let size = line.runs.iter().map(|run| run.size).fold(0.0, f64::max);
            let text: String = line.runs.iter().map(|run| run.text.as_str()).collect();
            Some(([*x, y - 0.7 * size, x + line.width, *y], text))
        }
        _ => None,
    };
    page.shapes.iter().filter_map(of).collect()
}

#[test]
fn everything_is_on_the_page_and_no_text_touches_another() {
    for figure in figures() {
        for width in [241.0, 504.0] {
            let page = lay_out(&figure, width);
            assert!(page.width <= width + 1e-6 || width < 300.0, "{}", page.width);
            let boxes = text_boxes(&page);
            for (i, (a, text)) in boxes.iter().enumerate() {
                let [left, top, right, bottom] = *a;
                let inside = left >= 0.0 && top >= 0.0 && right <= page.width + 0.5 && bottom <= page.height;
                assert!(inside, "{text:?} at {a:?} of {} x {}", page.width, page.height);
                for (b, other) in &boxes[i + 1..] {
                    let apart = right <= b[0] || b[2] <= left || bottom <= b[1] || b[3] <= top;
                    assert!(apart, "{width}: {text:?} {a:?} and {other:?} {b:?} of {:?}", figure.title);
                }
            }
        }
    }
}

#[test]
fn every_format_repeats_to_the_byte_and_states_its_size() {
    let options = FigureOptions { width: 85.0, dots_per_inch: 150.0 };
    for figure in figures() {
        let written = |format| {
            let mut bytes = Vec::new();
            figure.write(&mut bytes, format, &options).unwrap();
            bytes
        };
        let [png, svg, pdf] = [FigureFormat::Png, FigureFormat::Svg, FigureFormat::Pdf].map(|format| {
            let bytes = written(format);
            assert!(bytes == written(format), "{format:?}");
            bytes
        });
        let page = lay_out(&figure, 85.0 / 25.4 * 72.0);
        let picture = image::load_from_memory(&png).unwrap().into_rgb8();
        assert_eq!(f64::from(picture.width()), (page.width * 150.0 / 72.0).round());
        let svg = String::from_utf8(svg).unwrap();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        for (name, text) in ["image", "path"].map(|name| (name, format!("<{name} "))) {
            let count = page.shapes.iter().filter(|shape| match shape {
                Shape::Picture { .. } => name == "image",
                Shape::Path { .. } => name == "path",
                _ => false,
            });
            assert_eq!(svg.matches(&text).count(), count.count(), "{name}");
        }
        assert!(pdf.starts_with(b"%PDF-1.7") && pdf.ends_with(b"%%EOF"));
        #[expect(clippy::cast_possible_truncation, reason = "PDF writers keep lengths in single precision")]
        let box_of_page = format!("/MediaBox [0 0 {}", page.width as f32);
        assert!(String::from_utf8_lossy(&pdf).contains(&box_of_page), "{box_of_page}");
    }
}

#[test]
fn pixels_of_a_picture_are_kept_and_letters_are_dark() {
    let picture = Picture::from_fn(4, 4, |x, y| if (x + y) % 2 == 0 { [200, 10, 10] } else { [10, 10, 200] });
    let figure = Figure::of_panels("H", vec![Panel::picture("", picture)], "");
    let page = figure.picture(&FigureOptions { width: 25.4, dots_per_inch: 288.0 }).unwrap();
    for colour in [[200, 10, 10], [10, 10, 200], [255; 3]] {
        assert!(page.pixels().iter().filter(|&&c| c == colour).count() > 500, "{colour:?}");
    }
    let dark = page.pixels().iter().filter(|c| c.iter().all(|&x| x < 60)).count();
    assert!((30..3000).contains(&dark), "{dark}");
}

#[test]
fn sizes_and_names_out_of_range_are_refused() {
    let figure = Figure::of_panels("t", vec![], "");
    let error = |width, dots_per_inch| {
        figure.picture(&FigureOptions { width, dots_per_inch }).unwrap_err().to_string()
    };
    assert_eq!(error(10.0, 300.0), "width of a figure: expected 20 to 2000 mm, found 10");
    assert!(error(f64::NAN, 300.0).contains("found NaN"));
    assert!(error(85.0, 0.0).starts_with("resolution of a figure: expected 20 to 2400 dots per inch"));
    let folder = tempfile::tempdir().unwrap();
    let refused =
        figure.save(folder.path().join("a.gif"), &FigureOptions::default()).unwrap_err().to_string();
    assert!(
        refused.starts_with("name of a figure: expected a name that ends in .png, .svg or .pdf"),
        "{refused}"
    );
    for end in ["png", "SVG", "pdf"] {
        let path = folder.path().join(format!("a.{end}"));
        figure.save(&path, &FigureOptions::default()).unwrap();
        assert!(path.metadata().unwrap().len() > 100);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn limits_are_round() {
    let limit = |x: f64| round_limit(&[-x, 0.0, f64::NAN, 100.0], &[true, true, true, false]);
    assert_eq!(limit(0.02), 0.02);
    assert!((limit(0.021) - 0.05).abs() < 1e-12);
    assert!((limit(7.0) - 10.0).abs() < 1e-12);
    assert_eq!(limit(0.0), 1e-6);
}
