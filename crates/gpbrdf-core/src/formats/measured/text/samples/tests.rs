use super::*;
use crate::brdf::angles::direction;
use crate::formats::measured::ValueKind;
use crate::formats::mutate::{Random, mutations};
use crate::formats::{Source, write_samples_csv};
use crate::sample::Sample;
use crate::test_data::data_dir;

fn parse_with(bytes: &[u8], options: &ReadOptions) -> Result<SampleSet> {
    super::parse(Input { format: NAME, path: Path::new("x.csv"), bytes, options })
}

fn parse(text: &str) -> Result<SampleSet> {
    parse_with(text.as_bytes(), &ReadOptions::default())
}

fn error(text: &str) -> String {
    let message = parse(text).unwrap_err().to_string();
    message.strip_prefix("samples CSV file \"x.csv\": expected ").unwrap().to_owned()
}

#[test]
fn units_orders_comments_and_marks_are_understood() {
    let expected = direction(30f64.to_radians(), 45f64.to_radians());
    let texts = [
        "theta_i,phi_i,theta_o,phi_o,r,g,b\n30,45,10,0,1,2,3\n",
        "\u{FEFF}# a note\n\n b , g , r , phi_o , theta_o , phi_i , Theta_I , note\n3,2,1,0,10,45,30,x\n# end",
        "theta_i_deg,phi_i [deg],theta_o (degrees),phi_o_deg,r,g,b\r\n30,45,10,0,1,2,3\r\n",
        "theta_i_rad,phi_i [rad],theta_o_rad,phi_o_rad,R,G,B\n\
         0.5235987755982988,0.7853981633974483,0.17453292519943295,0,1,2,3",
        "theta_h,theta_i,phi_i,theta_o,phi_o,theta_d,phi_d,r,g,b\n9,30,45,10,0,9,9,1,2,3",
    ];
    for text in texts {
        let found = parse(text).unwrap();
        assert_eq!(found.len(), 1, "{text}");
        let sample = found.iter().next().unwrap();
        assert!((sample.wi - expected).norm() < 1e-15, "{text}");
        assert!((sample.wo - direction(10f64.to_radians(), 0.0)).norm() < 1e-15, "{text}");
        assert_eq!(sample.value, [1.0, 2.0, 3.0], "{text}");
    }
    assert_eq!(parse(texts[1]).unwrap().description, "a note");
    assert_eq!(parse(texts[1]).unwrap().lines, [4]);
}

/// One table in the spellings of many programs.
#[test]
fn tables_of_many_programs_are_the_same() {
    let expected = [
        Sample {
            wi: direction(0.5f64.to_radians(), 0.0),
            wo: direction(20f64.to_radians(), 3.0),
            value: [1.25; 3],
        },
        Sample { wi: direction(30f64.to_radians(), 0.0), wo: direction(-0.4, 0.0), value: [2.5; 3] },
    ];
    let (phi, theta) = (3f64.to_degrees(), (-0.4f64).to_degrees());
    let comma = |text: String| text.replace('.', ",");
    let rows = |by: &str| format!("0.5{by}0{by}20{by}{phi}{by}1.25\n30{by}0{by}{theta}{by}0{by}2.5\n");
    let texts = [
        format!("theta_i\tphi_i\ttheta_o\tphi_o\tf\n{}", comma(rows("\t"))),
        format!("\u{FEFF}theta_i;phi_i;theta_o;phi_o;f;\n{}", comma(rows(";"))),
        format!("theta_in phi_in theta_r phi_r brdf\n{}", comma(rows("  "))),
        format!("incidence [°] | x\n# no\ntheta_inc;phi_inc;theta_s;phi_s;fr\n{}", rows(";")).split_off(19),
        format!("theta_i,phi_i,theta_o,phi_o,f\r{}", rows(",").replace('\n', "\r")),
        format!(
            "\"theta_i\",\"phi_i\",\"theta_o\",\"phi_o\",\"f\"\n\"{}",
            rows("\",\"").replace('\n', "\"\n\"")
        ),
        format!("theta_i,phi_i,theta_o,phi_o,f,,\n\n{}\n\n", rows(",").replace('\n', ",,\n\n")),
        format!("theta_i;phi_i;theta_o;phi_o;BRDF\ndeg;[deg];°;degrees;1/sr\n{}", rows(";")),
        format!("# note\n# theta_i  phi_i  theta_o  phi_o  f\n{}", rows(" ")),
        format!("# theta_i, phi_i, theta_o, phi_o, f [1/sr]\n{}", rows("\t")),
        format!("theta_i [deg] phi_i [deg] theta_o [deg] phi_o [deg] f [1/sr]\n{}", rows(" ")),
        format!("theta_i phi_i theta_o phi_o f\n\"a\" {}", rows(" ").replacen('\n', "\n\"b\" ", 1)),
        format!("Sample;red paint\nDate;1.2.2024\n\ntheta_i;phi_i;theta_o;phi_o;f\n{}", rows(";")),
        format!("Incident zenith;Incident azimuth;Viewing zenith;Viewing azimuth;Value\n{}", rows(";")),
        format!("theta_i,theta_o,delta_phi,f\n0.5,20,{phi},1.25\n30,{theta},0,2.5\n"),
        format!(
            "theta_i,phi_i,theta_o,phi_o,f\n{}",
            rows(",").replace('-', "\u{2212}").replace("2.5", "25D-1")
        ),
        format!("name,theta_i,phi_i,theta_o,phi_o,f\n,{}", rows(",").replacen('\n', "\nb,", 1)),
    ];
    for text in &texts {
        let text = text.trim_end_matches('"');
        let found = parse(text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(found.len(), 2, "{text}");
        for (a, b) in found.iter().zip(&expected) {
            assert!((a.wi - b.wi).norm() < 1e-14 && (a.wo - b.wo).norm() < 1e-14, "{text}");
            assert_eq!(a.value, b.value, "{text}");
        }
    }
    // The same in other encodings.
    let text = &texts[7];
    let old: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let wide: Vec<u8> = format!("\u{FEFF}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [old, wide] {
        assert_eq!(parse_with(&bytes, &ReadOptions::default()).unwrap().values, [[1.25; 3], [2.5; 3]]);
        assert_eq!(Source::parse(&bytes, "x", &ReadOptions::default()).unwrap().kind, "samples CSV");
    }
}

#[test]
fn half_difference_and_grey_columns_are_understood() {
    let found = parse("f,theta_h,theta_d,phi_d\n0.25,20,30,200\n").unwrap();
    assert_eq!(found.values[0], [0.25; 3]);
    let angles = found.angles[0];
    assert!((angles.theta_h.to_degrees() - 20.0).abs() < 1e-12);
    assert!((angles.theta_d.to_degrees() - 30.0).abs() < 1e-12);
    assert!((angles.phi_d.to_degrees() - 20.0).abs() < 1e-12);
    assert!(parse("value,theta_h_rad,theta_d_rad,phi_d_rad\n1,1,0.1,1\n").is_ok());
}

#[test]
fn mistakes_are_named_with_line_and_column() {
    let header = "theta_i,phi_i,theta_o,phi_o,r,g,b\n";
    let row = |text: &str| error(&format!("# note\n{header}1,2,3,4,5,6,7\n{text}\n"));
    assert_eq!(row("1,2,3,4,5,x,7"), "a finite number in column `g` on line 4, found \"x\"");
    assert_eq!(row("1,2,3,4,5,NaN,7"), "a finite number in column `g` on line 4, found \"NaN\"");
    assert_eq!(row("1,2,3,4,,6,7"), "a finite number in column `r` on line 4, found nothing");
    assert_eq!(row("1,,3,4,5,6,7"), "a finite number in column `phi_i` on line 4, found nothing");
    assert_eq!(row("1,2,3"), "a finite number in column `phi_o` on line 4, found only 3 columns");
    assert_eq!(
        row("1,2,3,4,5,6,7e38"),
        "a value within the range of f32 in column `b` on line 4, found 7e38"
    );
    assert_eq!(
        row("1,2,3,4,-5,6,7"),
        "values of at least -0.007 (noise of a dark signal) on line 4, as 7 is the largest, found -5"
    );
    assert_eq!(
        row("1,2,95,4,5,6,7"),
        "an angle from -90 to 90 degrees (above the horizon) in column `theta_o` on line 4, found 95 degrees; \
         if `phi` is the angle from the normal, say --zenith phi"
    );
    assert!(row("1,400,3,4,5,6,7").contains("column `phi_i` on line 4, found 400 degrees"));
    assert_eq!(
        row("1,2,3,4,5,6,7,8"),
        "7 fields on line 4, as in the header on line 2, parted by commas, found 8; if they are decimal commas, \
         part the columns by semicolons or tabs"
    );
    assert_eq!(
        error("theta_h,theta_d,phi_d,f\n60,60,0,1\n"),
        "both directions above the horizon on line 2, found one below it"
    );
    assert_eq!(
        error("theta_i,phi_i,theta_o,r,g,b\n1,2,3,4,5,6\n"),
        "also the column `phi_o`, found the columns `theta_i`, `phi_i`, `theta_o`, `r`, `g`, `b` on line 1"
    );
    assert!(
        error("theta_h,theta_d,phi_d,r,g\n1,2,3,4,5\n")
            .starts_with("value columns `r`, `g`, `b`, or `f`, found")
    );
    assert!(error("theta_h,theta_h,theta_d,phi_d,f\n1,1,1,1,1\n").starts_with("one column `theta_h`, found"));
    assert_eq!(
        error("theta_h,theta_d_rad,phi_d,f\n1,1,1,1\n"),
        "one unit for all angles, found `theta_h` in degrees and `theta_d_rad` in radians"
    );
    assert!(error("1,2,3,4,5,6,7\n1,2,3,4,5,6,7\n").starts_with("a header with the columns theta_i"));
    assert!(error("x,y,z,f\n1,2,3,4\n").starts_with("a header with the columns theta_i"));
    assert_eq!(error(""), "a header line, found an empty file");
    assert_eq!(error("# a\n"), "a header line, found nothing but comments");
    assert_eq!(error(header), "at least one row, found a header only");
}

#[test]
fn what_is_not_certain_is_refused() {
    for (text, said) in [
        ("theta_i;phi_i;theta_o;phi_o;f\n10;0;20;180;1.234,5\n", "column `f` on line 2, found \"1.234,5\""),
        ("theta_i;phi_i;theta_o;phi_o;f\n10;0;20;180;1,234,567\n", "column `f` on line 2"),
        ("theta_i;phi_i;theta_o;phi_o;f\n10;0;20;180;1,234\n", "whose comma may part thousands"),
        ("theta_i;phi_i;theta_o;phi_o;f\n10,5;0;20.5;180;1\n", "one decimal mark in all numbers"),
        ("theta_i,phi_i,theta_o,phi_o,f\n10,000,0,000,5,000,0,000,1,237\n", "5 fields on line 2"),
        ("theta_i,phi_i,theta_o,phi_o,f\n1,10,0,5,0,1.2\n2,10,0,5,0,1.3\n", "5 fields on line 2"),
        ("theta_i,phi_i,theta_o,phi_o,f,note\n10,0,5,0,1.2\n", "6 fields on line 2"),
        ("theta_i,phi_i,theta_o,phi_o,f\n0.5,0,0.25,1.5,1.2\n", "--angles"),
        (
            "theta_i [mrad],phi_i,theta_o,phi_o,f\n1,2,3,4,5\n",
            "the unit deg or rad in column `theta_i [mrad]`",
        ),
        ("theta_s,phi_s,f\n1,2,3\n", "which direction is incident"),
        ("elevation_i,theta_i,phi_i,theta_o,phi_o,f\n1,2,3,4,5,6\n", "measured from the surface"),
        ("theta_i,phi_i,theta_o,phi_o,f,f\n1,2,3,4,5,6\n", "one set of value columns"),
        ("theta_i,phi_i,theta_o,phi_o,f,brdf\n1,2,3,4,5,6\n", "one set of value columns"),
        ("theta_i,phi_i,theta_o,phi_o,r,r,g,b\n1,2,3,4,5,6,7,8\n", "one column `r`"),
        ("theta_i,phi_i,theta_o,phi_o,reflectance\n1,2,3,4,5\n", "--values"),
        ("theta_i,phi_i,theta_o,phi_o,f [%]\n1,2,3,4,5\n", "the unit `%` of the column `f [%]`"),
        ("theta_i,phi_i,theta_o,phi_o,f [a.u.]\n1,2,3,4,5\n", "--values"),
        ("# phi: zenith\n# theta: zenith\ntheta_i,phi_i,theta_o,phi_o,f\n1,2,3,4,5\n", "--zenith"),
        (
            "theta_i,phi_i,theta_o,phi_o,f,sigma,sigma_rel\n1,2,3,4,5,6,7\n",
            "standard deviations in one column",
        ),
        ("theta_i,phi_i,theta_o,phi_o,f,sigma\n1,2,3,4,5,-1\n", "at least 0 on line 2"),
        ("theta_i,phi_i,theta_o,phi_o,f,sigma\n1,2,3,4,5,\n", "column `sigma` on line 2, found nothing"),
    ] {
        let found = error(text);
        assert!(found.contains(said), "{text}: {found}");
    }
}

#[test]
fn options_settle_what_is_not_certain() {
    let options = ReadOptions { angles: Some(AngleUnit::Radians), ..ReadOptions::default() };
    let text = "theta_i,phi_i,theta_o,phi_o,f\n0.5,0,0.25,1.5,1.2\n";
    let found = parse_with(text.as_bytes(), &options).unwrap();
    assert!((found.directions[0][0] - direction(0.5, 0.0)).norm() < 1e-15);
    let options = ReadOptions { zenith: Some(Zenith::Phi), ..ReadOptions::default() };
    let text = "theta_i,phi_i,theta_o,phi_o,f\n180,20,0,30,1.2\n";
    let found = parse_with(text.as_bytes(), &options).unwrap();
    let degrees = |theta: f64, phi: f64| direction(theta.to_radians(), phi.to_radians());
    assert!((found.directions[0][0] - degrees(20.0, 180.0)).norm() < 1e-15);
    assert!((found.directions[0][1] - degrees(30.0, 0.0)).norm() < 1e-15);
    let kinds =
        [(ValueKind::Factor, std::f64::consts::FRAC_1_PI), (ValueKind::Cosine, 2.0), (ValueKind::Brdf, 1.0)];
    for (kind, expected) in kinds {
        let options = ReadOptions { values: Some(kind), ..ReadOptions::default() };
        for column in ["f", "reflectance", "f [%]", "brf"] {
            let text = format!("theta_i,phi_i,theta_o,phi_o,{column}\n10,0,60,180,1\n");
            let found = parse_with(text.as_bytes(), &options).unwrap();
            assert!((found.values[0][0] - expected).abs() < 1e-12, "{column}");
        }
    }
    // A name that is certain needs no option; of several sets the BRDF is taken.
    let found = parse("theta_i,phi_i,theta_o,phi_o,brf\n10,0,60,180,1\n").unwrap();
    assert!((found.values[0][0] - std::f64::consts::FRAC_1_PI).abs() < 1e-15);
    let text = "theta_i,phi_i,theta_o,phi_o,fcos_r,fcos_g,fcos_b,f_r,f_g,f_b\n10,0,60,180,1,2,3,2,4,6\n";
    assert_eq!(parse(text).unwrap().values[0], [2.0, 4.0, 6.0]);
    let options = ReadOptions { values: Some(ValueKind::Cosine), ..ReadOptions::default() };
    let found = parse_with(text.as_bytes(), &options).unwrap();
    assert!((found.values[0][2] - 6.0).abs() < 1e-12);
}

#[test]
fn standard_deviations_are_read_in_every_form() {
    for (columns, row, expected) in [
        ("f,sigma", "2,0.25", [0.25; 3]),
        ("f,std", "2,0.5", [0.5; 3]),
        ("f,sigma_rel", "2,0.05", [0.1; 3]),
        ("f,sigma_rel [%]", "2,5", [0.1; 3]),
        ("r,g,b,sigma_r,sigma_g,sigma_b", "1,2,3,0.1,0.2,0.3", [0.1, 0.2, 0.3]),
        ("r,g,b,sigma_rel", "1,2,-0.001,0.5", [0.5, 1.0, 5e-4]),
    ] {
        let found = parse(&format!("theta_i,phi_i,theta_o,phi_o,{columns}\n10,0,20,180,{row}\n")).unwrap();
        (0..3).for_each(|c| assert!((found.sigma[0][c] - expected[c]).abs() < 1e-15, "{columns}"));
    }
    let found = parse("theta_i,phi_i,theta_o,phi_o,f,uncertainty\n10,0,20,180,2,1\n").unwrap();
    assert!(found.sigma.is_empty() && found.notices[0].contains("`uncertainty` is not used"));
}

#[test]
fn comments_say_which_angle_is_the_zenith() {
    let text = "# red\n# (phi_i, theta_i) are the zenith and azimuth angles\n# phi_i theta_i phi_o theta_o f\n\
        75.0 -180.0 -90.0 0.0 1e-4\n75.0 -180.0 -30.0 0.0 0.5\n";
    let found = parse(text).unwrap();
    assert_eq!((found.len(), found.description.as_str()), (1, "red"));
    let expected = direction(30f64.to_radians(), std::f64::consts::PI);
    assert!((found.directions[0][1] - expected).norm() < 1e-15);
    assert!(
        found.notices[0].starts_with("`phi` is taken as the angle from the normal"),
        "{:?}",
        found.notices
    );
    assert!(found.notices[1].starts_with("1 row has a direction at the horizon"), "{:?}", found.notices);
    // Beyond half a turn, `theta` cannot be measured from the normal.
    let found = parse("theta_i,phi_i,theta_o,phi_o,f\n180,30,337,60,1\n180,30,10,5,1\n").unwrap();
    let degrees = |theta: f64, phi: f64| direction(theta.to_radians(), phi.to_radians());
    assert!((found.directions[0][1] - degrees(60.0, 337.0)).norm() < 1e-15);
    assert!(found.notices[0].contains("beyond 180 degrees"), "{:?}", found.notices);
    for text in ["180,30,170,60", "180,30,337,100"] {
        let text = format!("theta_i,phi_i,theta_o,phi_o,f\n{text},1\n");
        assert!(error(&text).contains("--zenith phi"), "{text}");
        let options = ReadOptions { zenith: Some(Zenith::Theta), ..ReadOptions::default() };
        assert!(parse_with(text.as_bytes(), &options).is_err());
    }
}

#[test]
fn wavelengths_become_colours() {
    let head = "theta_i,phi_i,theta_o,phi_o";
    let found = parse(&format!("{head},650 nm,450 nm,550 nm\n10,0,20,180,0.1,0.3,0.2\n")).unwrap();
    assert!(found.values[0][2] > found.values[0][0], "{:?}", found.values);
    assert!(found.notices[0].contains("3 wavelengths from 450 to 650 nm"));
    let long = format!(
        "{head},lambda [um],f,sigma\n10,0,20,180,0.45,0.3,0\n10,0,20,180,0.55,0.2,0\n10,0,20,180,0.65,0.1,0\n"
    );
    let again = parse(&long).unwrap();
    assert_eq!((again.len(), again.lines[0]), (1, 4));
    (0..3).for_each(|c| assert!((again.values[0][c] - found.values[0][c]).abs() < 1e-12));
    assert_eq!(again.sigma, [[0.0; 3]]);
    // One wavelength is grey, also one that nobody sees.
    for text in
        [format!("{head},f_1064\n10,0,20,180,0.1\n"), format!("{head},wavelength,f\n10,0,20,180,1064,0.1\n")]
    {
        assert_eq!(parse(&text).unwrap().values, [[0.1; 3]]);
    }
    for (text, said) in [
        (long.replace("180,0.55", "170,0.55"), "550 nm of another direction"),
        (long.replace("10,0,20,180,0.65,0.1,0\n", "10,0,20,180,0.45,0.1,0\n"), "2 wavelengths"),
        (
            format!("{long}10,0,30,180,0.45,1,0\n"),
            "3 wavelengths of each direction, found 1 of the one on line 5",
        ),
        (long.replace("lambda [um]", "lambda"), "wavelengths in nm, or their unit"),
        (format!("{head},800nm,900nm\n10,0,20,180,1,1\n"), "reach into 380 to 780 nm"),
        (format!("{head},550,550 nm\n10,0,20,180,1,1\n"), "one column for 550 nm"),
    ] {
        let found = error(&text);
        assert!(found.contains(said), "{text}: {found}");
    }
}

#[test]
fn samples_round_trip() {
    let mut random = Random::new(2);
    let mut unit = || random.next() as f64 / u64::MAX as f64;
    let samples: SampleSet = (0..500)
        .map(|_| Sample {
            wi: direction(1.57 * unit(), 7.0 * unit()),
            wo: direction(1.57 * unit(), 7.0 * unit()),
            value: [unit() * 1e3, unit() * 1e-9, -1e-3 * unit()],
        })
        .collect();
    let sigma = samples.values.iter().map(|value| value.map(|x| 0.1 * x.abs())).collect();
    let written = SampleSet { description: "two\nlines".to_owned(), sigma, ..samples };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.csv");
    write_samples_csv(&path, &written).unwrap();
    let read = read_samples_csv(&path).unwrap();
    assert_eq!(read.description, written.description);
    assert_eq!(read.len(), written.len());
    assert_eq!((&read.sigma, read.lines[0], read.lines[499]), (&written.sigma, 4, 503));
    assert!(read.notices[0].starts_with("500 values are negative"), "{:?}", read.notices);
    for (a, b) in read.iter().zip(written.iter()) {
        assert_eq!(a.value, b.value);
        assert!((a.wi - b.wi).norm() < 1e-14 && (a.wo - b.wo).norm() < 1e-14);
    }
    assert_eq!(crate::formats::recognise(&path).unwrap(), &FORMAT);
}

#[test]
fn damaged_files_never_panic() {
    let texts = [
        "# note\n\"theta_i\",phi_i,theta_o,phi_o,r,g,b\n30,45,10,0,1,2,3\n1,2,3,4,5,6,7\n",
        "theta_i;phi_i;theta_o;phi_o;f;sigma\ndeg;deg;deg;deg;;\n30,5;45;10;0;1,25;0,1\n1;2;3;4;5;0\n",
        "# phi: zenith\n# phi_i theta_i phi_o theta_o 450nm 550nm\n30 45 10 0 1 2\n1 2 3 4 5 6\n",
        "theta_i\tphi_i\ttheta_o\tphi_o\twavelength\tf\n30\t0\t1\t2\t450\t1\n30\t0\t1\t2\t550\t1\n",
    ];
    for text in texts {
        let mut survivors = 0;
        for bytes in mutations(text.as_bytes(), text.len(), 9, 10_000) {
            if let Ok(samples) = parse_with(&bytes, &ReadOptions::default()) {
                survivors += 1;
                assert!(samples.iter().all(|s| s.wi.z > 0.0 && s.value.iter().all(|v| v.is_finite())));
                assert!([0, samples.len()].contains(&samples.sigma.len()));
                assert_eq!(samples.lines.len(), samples.len());
            }
            let _ = crate::formats::parse_directions_csv(&bytes, "x", &ReadOptions::default());
        }
        assert!(survivors > 100, "{survivors}");
    }
}

/// The values are those of rows that were picked by hand; the mirror direction is where the files are brightest.
#[test]
fn measured_tables_are_read() {
    let Some(data) = data_dir() else { return };
    let open = |name: &str| {
        let source = Source::open(data.join("gonio").join(name)).unwrap();
        source.samples().unwrap().clone()
    };
    let degrees = |theta: f64, phi: f64| direction(theta.to_radians(), phi.to_radians());
    let at = |set: &SampleSet, line: u64| {
        let index = set.lines.iter().position(|&l| l == line).unwrap();
        (set.directions[index], set.values[index][0])
    };
    let chassis = open("chassis_brdf.csv");
    // 724 rows, of which 8 are at the horizon.
    assert_eq!(chassis.len(), 716);
    let ([wi, wo], value) = at(&chassis, 16);
    assert!((wi - degrees(75.0, 180.0)).norm() < 1e-12 && (wo - degrees(89.0, 180.0)).norm() < 1e-12);
    assert_eq!(value, 1.56196e-4);
    let largest = chassis.values.iter().flatten().copied().fold(0.0, f64::max);
    let brightest = chassis.iter().find(|sample| sample.value[0] == largest).unwrap();
    assert!(brightest.wi.z.acos().to_degrees().round() == 75.0);
    let mirror = nalgebra::Vector3::new(-brightest.wi.x, -brightest.wi.y, brightest.wi.z);
    assert!((brightest.wo - mirror).norm() < 1e-12);
    let vegetation = open("vegetation_brdf_cars.csv");
    assert_eq!(vegetation.len(), 14_500 - 66);
    let ([wi, wo], value) = at(&vegetation, 12);
    assert!((wi - degrees(30.42, 180.0)).norm() < 1e-12 && (wo - degrees(64.5, 0.0)).norm() < 1e-12);
    assert_eq!(value, 0.414_445);
    let source = Source::open(data.join("rgl/reference_values.csv")).unwrap();
    let reference = source.samples().unwrap();
    assert!(reference.notices[0].starts_with("angles are taken as radians"), "{:?}", reference.notices);
    assert_eq!(reference.values[0], [0.05940903, 0.1002018, 0.01572966]);
    assert!((reference.directions[1][1] - direction(0.261799, std::f64::consts::PI)).norm() < 1e-6);
}
