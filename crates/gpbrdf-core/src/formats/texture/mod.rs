//! A table as a 3-D texture, in the order in which the lookup shader samples it.
//!
//! 90 x 90 x 180 texels of four half-precision floats: x is `theta_h` by its square root, y is `theta_d`, z is
//! `phi_d`, x runs fastest, and each texel is the value at its centre. Red, green and blue are the BRDF in sr^-1,
//! alpha is the standard deviation of the target, the largest one where those of the channels differ, or 0. The
//! sampler has to filter linearly, to clamp x and y and to repeat z.

mod dds;
mod ktx2;
mod raw;

use std::io::{self, Write};
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::base::f16::to_halves;
use crate::brdf::SigmaTable;
use crate::brdf::table::{BrdfTable, N_PHI_D, N_THETA_D, N_THETA_H, cell_index};

/// Texels along x, y and z.
const SIZE: [u32; 3] = [90, 90, 180];
const _: () =
    assert!(SIZE[0] as usize == N_THETA_H && SIZE[1] as usize == N_THETA_D && SIZE[2] as usize == N_PHI_D);
/// Bytes of a texel.
const TEXEL_BYTES: u32 = 8;

/// A format of textures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureFormat {
    /// DirectDraw surface with the header of DirectX 10, `R16G16B16A16_FLOAT`.
    Dds,
    /// Khronos texture, version 2, `VK_FORMAT_R16G16B16A16_SFLOAT`.
    Ktx2,
    /// Array of NumPy with the shape (180, 90, 90, 4), `float16`.
    Npy,
    /// The numbers alone, little-endian, and a second file with `.json` behind the name that describes them.
    Raw,
}

impl TextureFormat {
    /// The format that the name of a file says: `.dds`, `.ktx2`, `.npy` or `.bin`.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_lowercase().as_str() {
            "dds" => Some(Self::Dds),
            "ktx2" => Some(Self::Ktx2),
            "npy" => Some(Self::Npy),
            "bin" => Some(Self::Raw),
            _ => None,
        }
    }
}

/// Writes a texture of a table and, if given, of its sigma. Cells without data take the value of their neighbours
/// along `theta_d` ([`BrdfTable::filled`]); values above 65,504, the largest one of half precision, become that.
///
/// # Errors
/// [`Error::Io`] when a file cannot be written; no part of any is left then.
pub fn write_texture(
    path: impl AsRef<Path>,
    format: TextureFormat,
    table: &BrdfTable,
    sigma: Option<&SigmaTable>,
) -> Result<()> {
    AtomicFile::commit_all(texture_files(path, format, table, sigma)?)
}

/// Like [`write_texture`], but the files get their names only once they are committed.
///
/// # Errors
/// [`Error::Io`] when a file cannot be written.
pub fn texture_files(
    path: impl AsRef<Path>,
    format: TextureFormat,
    table: &BrdfTable,
    sigma: Option<&SigmaTable>,
) -> Result<Vec<AtomicFile>> {
    let path = path.as_ref();
    let header = match format {
        TextureFormat::Dds => dds::header(),
        TextureFormat::Ktx2 => ktx2::header(),
        TextureFormat::Npy => raw::npy_header(),
        TextureFormat::Raw => Vec::new(),
    };
    let mut files = vec![written(path, |file| {
        file.write_all(&header)?;
        write_texels(file, table, sigma)
    })?];
    if format == TextureFormat::Raw {
        let mut name = path.as_os_str().to_owned();
        name.push(".json");
        files.push(written(Path::new(&name), |file| file.write_all(raw::layout(path).as_bytes()))?);
    }
    Ok(files)
}

/// A file that `write` has filled.
fn written(path: &Path, write: impl FnOnce(&mut AtomicFile) -> io::Result<()>) -> Result<AtomicFile> {
    let mut file = AtomicFile::create(path)?;
    write(&mut file).map_err(|source| Error::write(path, source))?;
    Ok(file)
}

/// The texels of a texture in its order: red, green and blue of a table, and sigma, the largest one of the channels, or
/// 0. Cells are taken as they are: [`BrdfTable::filled`] has none without data.
pub fn texels<'a>(
    table: &'a BrdfTable,
    sigma: Option<&'a SigmaTable>,
) -> impl Iterator<Item = [f32; 4]> + use<'a> {
    let layer = |p| (0..N_THETA_D).flat_map(move |d| (0..N_THETA_H).map(move |h| cell_index(h, d, p)));
    (0..N_PHI_D).flat_map(layer).map(move |cell| {
        let [r, g, b] = table.values()[cell];
        [r, g, b, sigma.map_or(0.0, |sigma| sigma.largest(cell))]
    })
}

/// Writes the texels.
fn write_texels(to: &mut impl Write, table: &BrdfTable, sigma: Option<&SigmaTable>) -> io::Result<()> {
    let values: Vec<[f32; 4]> = texels(&table.filled(), sigma).collect();
    let bytes: Vec<u8> =
        to_halves(values.as_flattened()).into_iter().flat_map(|half| half.to_le_bytes()).collect();
    to.write_all(&bytes)
}

#[cfg(test)]
mod tests {
    use half::f16;

    use super::*;
    use crate::brdf::{HalfDiff, N_CELLS, Rgb};

    fn table() -> BrdfTable {
        BrdfTable::from_fn(|a: HalfDiff| -> Rgb { [1.0 + a.phi_d, 5.0 - a.theta_h, 0.1 + a.theta_d] })
    }

    fn sigma() -> SigmaTable {
        SigmaTable::from_planes(vec![(0..N_CELLS).map(|cell| (cell % 1000) as f32 / 1000.0).collect()])
            .unwrap()
    }

    /// Whether texels are those of the table to half precision.
    fn compare(texels: &[u8]) {
        let (table, sigma) = (table(), sigma());
        assert_eq!(texels.len(), N_CELLS * 8);
        let number = |index: usize| f16::from_le_bytes([texels[2 * index], texels[2 * index + 1]]).to_f32();
        for (h, d, p) in
            [(0, 0, 0), (89, 0, 0), (0, 89, 0), (0, 0, 179), (12, 34, 56), (89, 89, 179), (45, 3, 120)]
        {
            let cell = cell_index(h, d, p);
            let [r, g, b] = table.values()[cell];
            for (channel, expected) in [r, g, b, sigma.largest(cell)].into_iter().enumerate() {
                let found = number(((p * 90 + d) * 90 + h) * 4 + channel);
                assert!((found - expected).abs() <= expected * 4.9e-4, "{h} {d} {p}: {found} {expected}");
            }
        }
    }

    fn files(name: &str) -> (tempfile::TempDir, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let format = TextureFormat::of(&path).unwrap();
        write_texture(&path, format, &table(), Some(&sigma())).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        (folder, bytes)
    }

    /// Read by the crate `ddsfile`.
    #[test]
    fn dds_files_are_volumes_of_half_floats() {
        let (_folder, bytes) = files("x.dds");
        let dds = ddsfile::Dds::read(bytes.as_slice()).unwrap();
        assert_eq!((dds.get_width(), dds.get_height(), dds.get_depth()), (90, 90, 180));
        assert_eq!(dds.get_dxgi_format(), Some(ddsfile::DxgiFormat::R16G16B16A16_Float));
        assert_eq!((dds.get_num_mipmap_levels(), dds.get_num_array_layers()), (1, 1));
        assert_eq!(dds.header.pitch, Some(720));
        assert!(dds.header.caps2.contains(ddsfile::Caps2::VOLUME));
        let header = dds.header10.as_ref().unwrap();
        assert_eq!(header.resource_dimension, ddsfile::D3D10ResourceDimension::Texture3D);
        compare(dds.get_data(0).unwrap());
    }

    /// Read by the crate `ktx2`.
    #[test]
    fn ktx2_files_are_volumes_of_half_floats() {
        let (_folder, bytes) = files("x.ktx2");
        let reader = ::ktx2::Reader::new(&bytes).unwrap();
        let header = reader.header();
        assert_eq!(header.format, Some(::ktx2::Format::R16G16B16A16_SFLOAT));
        assert_eq!((header.pixel_width, header.pixel_height, header.pixel_depth), (90, 90, 180));
        assert_eq!(
            (header.type_size, header.layer_count, header.face_count, header.level_count),
            (2, 0, 1, 1)
        );
        assert_eq!(header.supercompression_scheme, None);
        let descriptor = reader.basic_dfd().unwrap();
        assert_eq!(reader.dfd_blocks().len(), 1);
        let expected = ::ktx2::dfd::Basic::from_format(::ktx2::Format::R16G16B16A16_SFLOAT).unwrap();
        assert_eq!((descriptor, header.type_size), (&expected.0, expected.1));
        let levels: Vec<_> = reader.levels().collect();
        assert_eq!(levels.len(), 1);
        compare(levels[0].data);
        assert!(reader.writer().unwrap().starts_with("gpbrdf"));
    }

    #[test]
    fn npy_files_have_a_header_and_raw_ones_a_description() {
        let (_folder, bytes) = files("x.npy");
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert!(header.starts_with("{'descr': '<f2', 'fortran_order': False, 'shape': (180, 90, 90, 4), }"));
        assert!(header.ends_with('\n'));
        compare(&bytes[10 + length..]);

        let (folder, bytes) = files("x.bin");
        compare(&bytes);
        let text = std::fs::read_to_string(folder.path().join("x.bin.json")).unwrap();
        let layout: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(layout["file"], "x.bin");
        assert_eq!(layout["shape"], serde_json::json!([180, 90, 90, 4]));
        assert_eq!(layout["bytes"], N_CELLS * 8);
    }

    #[test]
    fn gaps_are_filled_large_values_stay_finite_and_nothing_is_left_of_failures() {
        let mut values = table().values().to_vec();
        values[cell_index(3, 80, 7)] = [-1.0; 3];
        values[cell_index(0, 0, 0)] = [1e6; 3];
        let torn = BrdfTable::from_values(values).unwrap();
        let mut bytes = Vec::new();
        write_texels(&mut bytes, &torn, None).unwrap();
        let texel = |h: usize, d: usize, p: usize| bytes[((p * 90 + d) * 90 + h) * 8..][..8].to_vec();
        assert_eq!(texel(3, 80, 7), texel(3, 79, 7));
        assert_eq!(texel(0, 0, 0)[..2], f16::MAX.to_le_bytes());
        assert_eq!(texel(5, 5, 5)[6..], [0, 0]);

        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("x.bin.json")).unwrap();
        assert!(write_texture(folder.path().join("x.bin"), TextureFormat::Raw, &torn, None).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert_eq!(TextureFormat::of(Path::new("a.PNG")), None);
        assert_eq!(TextureFormat::of(Path::new("a.DDS")), Some(TextureFormat::Dds));
    }
}
