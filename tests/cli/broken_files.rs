//! Damaged, foreign and absent files: exit code 1, one line that names the file, what was expected and what
//! was found, and no file written.

use std::sync::OnceLock;

use gpbrdf_core::BrdfTable;
use gpbrdf_core::formats::write_merl_to;

use crate::harness::{Cli, data_dir};

/// `bake` and `info` refuse a file with this message.
fn refused(cli: &Cli, name: &str, message: &str) {
    assert_eq!(cli.fails(&["bake", name, "-o", "new/out"]), message);
    assert_eq!(cli.fails(&["info", name]), message);
}

/// The bytes of a good MERL file.
fn merl() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let mut bytes = Vec::new();
        write_merl_to(&mut bytes, &BrdfTable::from_fn(|a| [0.1, 0.2, a.theta_d])).unwrap();
        bytes
    })
}

const KINDS: &str = "one of RGL .bsdf, table EXR, gpbrdf model, Zemax .bsdf, ALTA text, ASTM E1392, samples CSV, \
    Cornell .brdf, MERL .binary";

#[test]
fn what_is_no_measurement() {
    let cli = Cli::new();
    refused(
        &cli,
        "absent.binary",
        "\"absent.binary\": expected a file or a built-in material (`gpbrdf-cli materials` lists them), found neither",
    );
    cli.write("empty.binary", "");
    refused(&cli, "empty.binary", &format!("\"empty.binary\": expected {KINDS}, found an empty file"));
    std::fs::create_dir(cli.path("folder")).unwrap();
    refused(&cli, "folder", "cannot read \"folder\": is a directory");
    cli.write("picture.bsdf", b"\x89PNG\r\n\x1A\n\0\0\0\rIHDR");
    refused(&cli, "picture.bsdf", &format!("\"picture.bsdf\": expected {KINDS}, found a PNG image"));
    cli.write("letter.csv", "Dear reader,\n");
    refused(
        &cli,
        "letter.csv",
        &format!("\"letter.csv\": expected {KINDS}, found text starting \"Dear reader,\""),
    );
    cli.write("dump", [0x80, 0x90, 0xA0, 0xB0, 0xC0, 0xD0, 0xE0, 0xF0, 1, 2, 3, 4]);
    refused(
        &cli,
        "dump",
        &format!("\"dump\": expected {KINDS}, found binary data starting 0x8090a0b0c0d0e0f0"),
    );
}

#[cfg(unix)]
#[test]
fn what_cannot_be_opened() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let cli = Cli::new();
    symlink("nowhere", cli.path("dangling")).unwrap();
    refused(&cli, "dangling", "cannot read \"dangling\": No such file or directory (os error 2)");
    refused(
        &cli,
        "/dev/null",
        "\"/dev/null\": expected a regular file, or - for standard input, found a pipe or a device",
    );
    cli.write("locked.csv", "theta_i,phi_i,theta_o,phi_o,f\n1,2,3,4,5\n");
    std::fs::set_permissions(cli.path("locked.csv"), std::fs::Permissions::from_mode(0o000)).unwrap();
    if std::fs::File::open(cli.path("locked.csv")).is_ok() {
        eprintln!("skipped: this user may read everything");
        return;
    }
    refused(&cli, "locked.csv", "cannot read \"locked.csv\": Permission denied (os error 13)");
}

#[test]
fn damaged_merl_files() {
    let cli = Cli::new();
    let file = |what: &str| format!("MERL file \"a.binary\": expected {what}");
    cli.write("a.binary", &merl()[..1000]);
    refused(&cli, "a.binary", &file("34992012 bytes, found 1000 bytes"));
    cli.write("a.binary", &merl()[..34_992_011]);
    refused(&cli, "a.binary", &file("34992012 bytes, found 34992011 bytes"));
    cli.write("a.binary", [merl(), b"\n"].concat());
    refused(&cli, "a.binary", &file("34992012 bytes, found 34992013 bytes"));

    let dimensions: Vec<u8> = [90i32, 90, 90].iter().flat_map(|d| d.to_le_bytes()).collect();
    cli.write("a.binary", [&dimensions, &merl()[12..]].concat());
    refused(&cli, "a.binary", &file("dimensions 90 x 90 x 180, found dimensions 90 x 90 x 90"));
    cli.write("a.binary", [&dimensions, &merl()[12..12 + 24 * 90 * 90 * 90]].concat());
    refused(&cli, "a.binary", &file("dimensions 90 x 90 x 180, found dimensions 90 x 90 x 90"));

    let filled = |value: f64| [&merl()[..12], &value.to_le_bytes().repeat(3 * 1_458_000)].concat();
    cli.write("a.binary", filled(f64::NAN));
    refused(
        &cli,
        "a.binary",
        &file(
            "finite numbers within the range of f32, found 4374000 values that are not, the first in channel \
             R, theta_h 0, theta_d 0, phi_d 0",
        ),
    );
    cli.write("a.binary", filled(-1.0));
    assert_eq!(
        cli.fails(&["bake", "a.binary", "-o", "new", "--no-metrics"]),
        "a.binary: expected data in at least one cell, found none"
    );
}

#[test]
fn damaged_models() {
    let cli = Cli::new();
    cli.ok(&["fit", "lambert", "--lattice", "4x4x4", "-o", "good.safetensors"]);
    let good = cli.read("good.safetensors");
    let file = |what: &str| format!("model file \"m.safetensors\": expected {what}");
    cli.write("m.safetensors", &good[..good.len() - 1]);
    refused(
        &cli,
        "m.safetensors",
        &file("a safetensors file, found incomplete metadata, file not fully covered"),
    );

    let header_bytes = usize::try_from(u64::from_le_bytes(*good.first_chunk().unwrap())).unwrap();
    let (header, tensors) = good[8..].split_at(header_bytes);
    let header = std::str::from_utf8(header).unwrap();
    let with = |header: &str, tensors: &[u8]| {
        [&(header.len() as u64).to_le_bytes(), header.as_bytes(), tensors].concat()
    };
    cli.write("m.safetensors", with(&header.replace("\"gpbrdf\"", "\"format\""), tensors));
    refused(&cli, "m.safetensors", &file("the metadata entry \"gpbrdf\", found none"));
    cli.write("m.safetensors", with(&header.replacen("\\\"version\\\":2", "\\\"version\\\":7", 1), tensors));
    refused(&cli, "m.safetensors", &file("version 2, found version 7"));

    // The second number of the first tensor.
    let mut broken = tensors.to_vec();
    broken[8..16].copy_from_slice(&f64::NAN.to_le_bytes());
    cli.write("m.safetensors", with(header, &broken));
    let message = cli.fails(&["bake", "m.safetensors", "-o", "new"]);
    assert!(message.starts_with(&file("finite numbers in tensor \"0.")), "{message}");
    assert!(message.ends_with(", found NaN at 1"), "{message}");
    // Numbers that make no process.
    cli.write(
        "m.safetensors",
        with(&header.replacen("\\\"noise_variance\\\":", "\\\"noise_variance\\\":-", 1), tensors),
    );
    let message = cli.fails(&["bake", "m.safetensors", "-o", "new"]);
    assert!(message.starts_with(&file("a consistent model, found ")), "{message}");

    cli.write("d.csv", "theta_h,theta_d,phi_d\n1,2,3\n");
    assert_eq!(
        cli.fails(&["predict", "m.safetensors", "d.csv"]),
        cli.fails(&["info", "m.safetensors"]),
        "every command says the same"
    );
    assert_eq!(
        cli.fails(&["predict", "good.safetensors", "absent.csv", "-o", "p.csv"]),
        "cannot read \"absent.csv\": No such file or directory (os error 2)"
    );
}

#[test]
fn damaged_exr_files() {
    let cli = Cli::new();
    cli.ok(&["bake", "lambert", "--lattice", "4x4x4", "--no-images", "-o", "good"]);
    let good = cli.read("good/table.exr");
    // Cut in the header, in the first part, and in the last, which is not the table.
    for length in [100, 1_000_000, good.len() / 2, good.len() - 1] {
        cli.write("t.exr", &good[..length]);
        let message = cli.fails(&["bake", "t.exr", "-o", "new"]);
        assert!(message.starts_with("OpenEXR file \"t.exr\": expected a whole OpenEXR file"), "{message}");
    }
    cli.ok(&["slice", "lambert", "-o", "slice.exr", "--size", "16"]);
    refused(
        &cli,
        "slice.exr",
        "OpenEXR file \"slice.exr\": expected an image of 180 x 8100 pixels, found 16 x 16",
    );
    // Channels of the same length, other names.
    let mut renamed = good.clone();
    for at in 0..4096 {
        if &renamed[at..at + 2] == b"R\0" && renamed[at + 2] == 2 {
            renamed[at] = b'X';
        }
    }
    cli.write("t.exr", renamed);
    let message = cli.fails(&["bake", "t.exr", "-o", "new"]);
    assert!(
        message.starts_with(
            "OpenEXR file \"t.exr\": expected a part with the floating-point channels R, G and B, \
             found channels B, G, X"
        ),
        "{message}"
    );
}

#[test]
fn damaged_samples() {
    let cli = Cli::new();
    let header = "theta_i,phi_i,theta_o,phi_o,r,g,b\n";
    for (text, message) in [
        ("1,2,3,4,5,x,7\n", "a finite number in column `g` on line 2, found \"x\""),
        ("1,2,3,4,5,1e400,7\n", "a finite number in column `g` on line 2, found \"1e400\""),
        ("1,2,90,4,5,6,7\n", "at least one sample above the horizon, found rows at the horizon only"),
        (
            "1,2,3,4,-5,6,7\n",
            "values of at least -0.007 (noise of a dark signal) on line 2, as 7 is the largest, found -5",
        ),
        ("1,2,3\n", "a finite number in column `phi_o` on line 2, found only 3 columns"),
        ("", "at least one row, found a header only"),
    ] {
        cli.write("s.csv", format!("{header}{text}"));
        refused(&cli, "s.csv", &format!("samples CSV file \"s.csv\": expected {message}"));
    }
    cli.write("c.brdf", "2\n400 500\n0 0 0 0 1\n");
    refused(
        &cli,
        "c.brdf",
        "Cornell file \"c.brdf\": expected 4 angles and 2 values on line 3, found 5 numbers",
    );
}

#[test]
fn damaged_rgl_files() {
    let cli = Cli::new();
    cli.write("r.bsdf", b"tensor_file\0\x01\0");
    refused(
        &cli,
        "r.bsdf",
        "RGL file \"r.bsdf\": expected a whole header, found 14 bytes that end within it",
    );
    let Some(data) = data_dir() else { return };
    let good = std::fs::read(data.join("rgl/paper_blue_rgb.bsdf")).unwrap();
    for length in [40, 5000, good.len() / 2, good.len() - 1] {
        cli.write("r.bsdf", &good[..length]);
        let message = cli.fails(&["bake", "r.bsdf", "-o", "new"]);
        assert!(message.starts_with("RGL file \"r.bsdf\": expected "), "{message}");
        assert!(message.contains(&length.to_string()), "{message}");
    }
}
