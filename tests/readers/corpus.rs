//! Small whole files of every kind.

use gpbrdf_core::brdf::analytic::NEURAL_FLOATS;
use gpbrdf_core::formats::{ExrChannels, ExrPart, write_image_exr, write_merl_to, write_table_exr_to};
use gpbrdf_core::prior::Prior;
use gpbrdf_core::{BrdfTable, FitOptions, LatticeLayout, Layout, Source, Symmetry, fit};

/// Samples in the dialects of instruments and of other programs, one file each.
const MEASURED: [&[u8]; 11] = [
    b"theta_i,phi_i,theta_o,phi_o,r,g,b\n10,0,20,180,0.1,0.2,0.3\n30,0,40,90,0.3,0.2,0.1\n",
    b"\xEF\xBB\xBFtheta_i;phi_i;theta_o;phi_o;f\r\n10,5;0;20;180;0,1\r\n30;0;40;90;0,25\r\n",
    b"\xFF\xFEt\0h\0e\0t\0a\0_\0h\0\t\0t\0h\0e\0t\0a\0_\0d\0\t\0p\0h\0i\0_\0d\0\t\0f\0\n\0\
      1\x000\0\t\x002\0\t\x003\x000\0\t\x001\0\n\0",
    b"# Wood (caf\xE9)\n# theta_i phi_i theta_o phi_o f sigma\n10 0 20 180 0.1 0.01\n30 0 40 90 0.3 0.02\n",
    b"theta_i,phi_i,theta_o,phi_o,400nm,500nm,600nm,700nm\n10,0,20,180,0.1,0.2,0.3,0.4\n",
    b"theta_h,theta_d,phi_d,r,g,b\n10,20,30,0.1,0.2,0.3\n0,0,0,1,1,1\n",
    b"# Grey\n\n# num wls\n3\n# wls\n400 550\n700 # nm\n# rows\n0.5 0 0.25 -2.5 0.2 0.2 0.2\n",
    b"# Vinyl\nSource  Measured\nSymmetry PlaneSymmetrical\nSpectralContent Monochrome\nScatterType BRDF\n\
      SampleRotation 1\n0\nAngleOfIncidence 2\n10 30\nScatterAzimuth 3\n0 90 180\nScatterRadial 3\n0 30 70\n\n\
      Monochrome\nDataBegin\nTIS 0.5\n1 2 3\n1 4 5\n1 6 0\nTIS 0.6\n7 8 9\n7 10 11\n7 12 0\nDataEnd\n",
    b"#SAMPLE \"Tape\"\n#DIM 4 3\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n0.1 0 1 0 1 2 3\n0.2 0 0.5 1 1 1 1\n",
    b"FORM 1\nSAMPLE red paint\nNUM_POINTS 2\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n\
      0.5,0.0,0.25,3.141593,0.3,0.2,0.1\n0.5,0.0,0.5,3.141593,0.6,0.4,0.2\n",
    b"THETA_I 45\nPHI_I 0\nVARS theta_s,phi_s,BRDF\n10.5,180,0.5\n45.5,180,2\n",
];

const MESHES: [&[u8]; 2] = [
    b"# squares\nmtllib a.mtl\no low\nv 0 0 0\nv 2 0 0 1 0.5 0.5\nv 2 2 0\nv 0 2 0\nvn 0 0 1\nvt 0 0\n\
      f 1/1/1 2/1/1 3/1/1 4/1/1\no high\nv 0 0 2\nv 2 0 2\nv 1 0.5 2\nv 0 2 2\nf -4 -3 \\\n -2 -1\nl 1 2\n",
    b"\xFE\xFF\0v\0 \x000\0 \x000\0 \x000\0\n\0v\0 \x001\0 \x000\0 \x000\0\n\
      \0v\0 \x000\0 \x001\0 \x000\0\n\0f\0 \x001\0 \x002\0 \x003\0\n",
];

const SESSION: &str = r#"{"format": "gpbrdf session", "version": 2, "settings": {"zoom": 1.5, "panes": {"3d": {}}},
    "files": [{"path": "/a/b.csv", "relative": "../b.csv"}], "documents": [{"path": "/a/b.csv", "built_in": null,
    "name": "b", "colour": [1, 2, 3], "visible": true, "spec": {}}]}"#;

/// The files of a reader.
pub(crate) fn files(reader: &str) -> Vec<Vec<u8>> {
    let texts = |texts: &[&[u8]]| texts.iter().map(|text| text.to_vec()).collect::<Vec<_>>();
    match reader {
        "merl" => vec![merl()],
        "rgl" => vec![rgl()],
        "table_exr" => vec![table_exr()],
        "neural" => vec![neural()],
        "measured" => texts(&MEASURED),
        "directions" => texts(&[
            b"theta_i,phi_i,theta_o,phi_o\n10,0,20,180\n30,0,40,90\n",
            b"theta_h,theta_d,phi_d\n10,20,30\n40,5,90\n",
        ]),
        "model" => vec![model()],
        "prior" => vec![Prior::built_in().to_bytes().unwrap()],
        "mesh" => texts(&MESHES),
        "gltf" => vec![gltf(), glb()],
        "environment" => environments(),
        "session" => vec![SESSION.as_bytes().to_vec()],
        "any" => [texts(&MEASURED[..2]), vec![model(), rgl()]].concat(),
        _ => Vec::new(),
    }
}

fn grey() -> BrdfTable {
    BrdfTable::from_fn(|a| [0.1, 0.2, a.theta_d])
}

fn merl() -> Vec<u8> {
    let mut bytes = Vec::new();
    write_merl_to(&mut bytes, &grey()).unwrap();
    bytes
}

fn table_exr() -> Vec<u8> {
    let table = grey();
    let channels = ExrChannels::Rgb(table.values());
    let part = ExrPart { name: "mean", description: "a test", unit: "sr^-1", channels };
    let mut bytes = std::io::Cursor::new(Vec::new());
    write_table_exr_to(&mut bytes, &[part]).unwrap();
    bytes.into_inner()
}

fn model() -> Vec<u8> {
    let source = Source::built_in("ward").unwrap();
    let layout = LatticeLayout::with_samples(100, Symmetry::Bilateral).unwrap();
    let samples = source.measure(&Layout::Lattice(layout)).unwrap();
    fit(&samples, &FitOptions::default()).unwrap().model.to_bytes().unwrap()
}

fn neural() -> Vec<u8> {
    let mut names = vec!["material".to_owned()];
    let matrix = |name: &str, rows: usize, columns: usize| {
        let name = name.to_owned();
        (0..rows * columns)
            .map(move |k| format!("{name}_{}_{}", k / columns, k % columns))
            .collect::<Vec<_>>()
    };
    let offsets = |name: &str, count: usize| (0..count).map(|k| format!("{name}_{k}")).collect::<Vec<_>>();
    names.extend([matrix("w1", 6, 21), offsets("b1", 21), matrix("w2", 21, 21), offsets("b2", 21)].concat());
    names.extend([matrix("w3", 21, 3), offsets("b3", 3)].concat());
    assert_eq!(names.len(), 1 + NEURAL_FLOATS);
    format!("{}\ngrey{}\n", names.join(","), ",0.01".repeat(NEURAL_FLOATS)).into_bytes()
}

/// A measurement with constant maps.
fn rgl() -> Vec<u8> {
    const U8: u8 = 1;
    const F32: u8 = 10;
    let constant = |value: f32, count: usize| value.to_le_bytes().repeat(count);
    let angles = [0.0f32, 1.5].map(f32::to_le_bytes).concat();
    let fields: [(&str, u8, &[u64], Vec<u8>); 8] = [
        ("description", U8, &[5], b"Plain".to_vec()),
        ("phi_i", F32, &[1], constant(0.0, 1)),
        ("theta_i", F32, &[2], angles),
        ("sigma", F32, &[2, 2], constant(0.5, 4)),
        ("ndf", F32, &[2, 2], constant(3.0, 4)),
        ("vndf", F32, &[1, 2, 3, 3], constant(7.0, 18)),
        ("rgb", F32, &[1, 2, 3, 2, 2], constant(0.5, 24)),
        ("jacobian", U8, &[1], vec![1]),
    ];
    let mut offset = 18 + fields.iter().map(|f| 13 + f.0.len() + 8 * f.2.len()).sum::<usize>();
    let mut bytes = b"tensor_file\0\x01\0\x08\0\0\0".to_vec();
    for (name, kind, shape, payload) in &fields {
        bytes.extend(u16::try_from(name.len()).unwrap().to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.extend(u16::try_from(shape.len()).unwrap().to_le_bytes());
        bytes.push(*kind);
        bytes.extend((offset as u64).to_le_bytes());
        bytes.extend(shape.iter().flat_map(|length| length.to_le_bytes()));
        offset += payload.len();
    }
    fields.into_iter().for_each(|field| bytes.extend(field.3));
    bytes
}

/// Members of a glTF file of one triangle, whose buffer of 42 bytes is described by `buffer`.
fn gltf_with(buffer: &str) -> String {
    let scene = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0, "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],"#;
    format!("{scene} \"buffers\": [{buffer}]}}")
}

fn gltf() -> Vec<u8> {
    // Three corners, and the indices 0, 1, 2.
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA";
    let uri = format!("data:application/octet-stream;base64,{data}");
    gltf_with(&format!(r#"{{"byteLength": 42, "uri": "{uri}"}}"#)).into_bytes()
}

fn glb() -> Vec<u8> {
    let mut json = gltf_with(r#"{"byteLength": 42}"#).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut data: Vec<u8> = corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    data.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    let word = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut bytes = [&b"glTF\x02\0\0\0"[..], &word(28 + json.len() + data.len())].concat();
    for (kind, part) in [(b"JSON", &json), (b"BIN\0", &data)] {
        bytes.extend([&word(part.len())[..], kind, part].concat());
    }
    bytes
}

/// Radiance files of all encodings and orientations, and OpenEXR.
fn environments() -> Vec<Vec<u8>> {
    let head = |lines: &str, size: &str| {
        format!("#?RADIANCE\n{lines}FORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes()
    };
    let flat = [head("EXPOSURE=2\nCOLORCORR=1 2 3\n", "+X 8 -Y 4"), [9, 8, 7, 130].repeat(32)].concat();
    // Of each channel a run of ten pixels and six single ones.
    let line = [&[2, 2, 0, 16][..], &[138, 5, 6, 1, 2, 3, 4, 5, 6].repeat(4)].concat();
    let runs = [head("", "-Y 8 +X 16"), line.repeat(8)].concat();
    let old = [
        head("PRIMARIES=0.64 0.33 0.29 0.6 0.15 0.06 0.33 0.33\n", "-Y 2 +X 30"),
        [&[9, 8, 7, 130][..], &[1, 1, 1, 29]].concat().repeat(2),
    ]
    .concat();
    let mut exr = std::io::Cursor::new(Vec::new());
    write_image_exr(&mut exr, 16, 8, &[[0.4, 0.5, 0.6]; 128]).unwrap();
    vec![flat, runs, old, exr.into_inner()]
}
