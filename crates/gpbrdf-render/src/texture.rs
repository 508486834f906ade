//! A BRDF as a 3-D texture.

use gpbrdf_core::base::to_halves;
use gpbrdf_core::brdf::{N_CELLS, N_PHI_D, N_THETA_D, N_THETA_H};
use gpbrdf_core::formats::texels;
use gpbrdf_core::{BrdfTable, SigmaTable};
use half::f16;
use half::slice::HalfFloatSliceExt as _;
use rayon::prelude::*;

use crate::context::Context;
use crate::error::Result;

/// How a texture stores its numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats, `rgba16float`: 11.7 MB. Values are at most 65,504, and those above 6e-5 have a relative
    /// error of at most 2^-11. Every device filters this format.
    #[default]
    Half,
    /// 32-bit floats, `rgba32float`: 23.3 MB. Devices that are not [`Context::float32_filterable`] support
    /// loads only.
    Single,
}

impl Precision {
    /// The texture format.
    #[must_use]
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Half => wgpu::TextureFormat::Rgba16Float,
            Self::Single => wgpu::TextureFormat::Rgba32Float,
        }
    }

    /// Bytes per texel.
    #[must_use]
    pub fn texel_bytes(self) -> u32 {
        match self {
            Self::Half => 8,
            Self::Single => 16,
        }
    }
}

/// 90 x 90 x 180 texels along `theta_h` (by its square root), `theta_d` and `phi_d`: the BRDF in sr^-1, and
/// in alpha the standard deviation of the target, the largest one where those of the channels differ. Shaders
/// read it by [`LOOKUP_WGSL`](crate::LOOKUP_WGSL).
#[derive(Clone, Debug)]
pub struct BrdfTexture {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    precision: Precision,
}

#[expect(clippy::cast_possible_truncation, reason = "90 and 180")]
const SIZE: wgpu::Extent3d = wgpu::Extent3d {
    width: N_THETA_H as u32,
    height: N_THETA_D as u32,
    depth_or_array_layers: N_PHI_D as u32,
};

impl BrdfTexture {
    /// A texture of zeros, to be written by a compute shader.
    ///
    /// # Errors
    /// Those of [`Context::guard`], such as [`Error::OutOfMemory`](crate::Error::OutOfMemory).
    pub fn empty(context: &Context, precision: Precision) -> Result<Self> {
        let texture = context.guard("BRDF texture", || {
            context.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("BRDF"),
                size: SIZE,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D3,
                format: precision.format(),
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        })?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { texture, view, precision })
    }

    /// A texture of a table and, if given, of its sigma. Cells without data take the value of their
    /// neighbours along `theta_d` ([`BrdfTable::filled`]).
    ///
    /// # Errors
    /// Those of [`BrdfTexture::empty`].
    pub fn upload(
        context: &Context,
        table: &BrdfTable,
        sigma: Option<&SigmaTable>,
        precision: Precision,
    ) -> Result<Self> {
        let out = Self::empty(context, precision)?;
        let values: Vec<[f32; 4]> = texels(&table.filled(), sigma).collect();
        let halves: Vec<f16>;
        let bytes: &[u8] = match precision {
            Precision::Half => {
                halves = to_halves(values.as_flattened());
                bytemuck::cast_slice(&halves)
            }
            Precision::Single => bytemuck::cast_slice(&values),
        };
        context.guard("upload of a BRDF", || {
            context.queue().write_texture(
                out.texture.as_image_copy(),
                bytes,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(SIZE.width * precision.texel_bytes()),
                    rows_per_image: Some(SIZE.height),
                },
                SIZE,
            );
        })?;
        Ok(out)
    }

    /// The texels in the order of a table's cells ([`gpbrdf_core::brdf::cell_index`]): red, green, blue, sigma. Waits
    /// for the device.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn download(&self, context: &Context) -> Result<Vec<[f32; 4]>> {
        let texels: Vec<[f32; 4]> = match self.precision {
            Precision::Half => {
                let halves: Vec<[f16; 4]> = context.read_texture(&self.texture)?;
                let mut texels = vec![[0.0; 4]; halves.len()];
                halves.as_flattened().convert_to_f32_slice(texels.as_flattened_mut());
                texels
            }
            Precision::Single => context.read_texture(&self.texture)?,
        };
        let mut cells = vec![[0.0; 4]; N_CELLS];
        cells.par_chunks_mut(N_THETA_D * N_PHI_D).enumerate().for_each(|(h, slab)| {
            for (d, line) in slab.chunks_mut(N_PHI_D).enumerate() {
                for (p, cell) in line.iter_mut().enumerate() {
                    *cell = texels[(p * N_THETA_D + d) * N_THETA_H + h];
                }
            }
        });
        Ok(cells)
    }

    /// [`BrdfTexture::download`] as a table of the mean and one of sigma.
    ///
    /// # Errors
    /// Those of [`BrdfTexture::download`].
    pub fn to_tables(&self, context: &Context) -> Result<(BrdfTable, SigmaTable)> {
        let (mean, sigma): (Vec<[f32; 3]>, Vec<f32>) =
            self.download(context)?.into_iter().map(|[r, g, b, sigma]| ([r, g, b], sigma)).unzip();
        Ok((BrdfTable::from_values(mean)?, SigmaTable::from_planes(vec![sigma])?))
    }

    /// The view that shaders bind.
    #[must_use]
    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// The precision of its numbers.
    #[must_use]
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Whether a sampler of this device can filter the texture. Otherwise use `gpbrdf_lookup_exact`.
    #[must_use]
    pub fn is_filterable(&self, context: &Context) -> bool {
        self.precision == Precision::Half || context.float32_filterable()
    }

    /// The sampler that `gpbrdf_lookup` expects: linear, clamp, clamp, repeat.
    #[must_use]
    pub fn sampler(context: &Context) -> wgpu::Sampler {
        context.device().create_sampler(&wgpu::SamplerDescriptor {
            label: Some("BRDF"),
            address_mode_u: wgpu::AddressMode::ClampToEdge,
            address_mode_v: wgpu::AddressMode::ClampToEdge,
            address_mode_w: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpbrdf_core::brdf::{cell_index, direction};
    use gpbrdf_core::{Brdf as _, HalfDiff};

    crate::support::gpu_tests![
        textures_come_back_as_they_were_sent,
        cells_without_data_are_filled_before_upload,
        shaders_look_up_what_the_table_holds,
    ];

    fn table() -> BrdfTable {
        BrdfTable::from_fn(|a: HalfDiff| {
            [1.0 + a.phi_d.sin(), (-a.theta_h).exp(), 0.05 + a.theta_d * (2.0 * a.phi_d).cos().powi(2)]
        })
    }

    fn textures_come_back_as_they_were_sent(context: &Context) {
        let table = table();
        let single = BrdfTexture::upload(context, &table, None, Precision::Single).unwrap();
        assert_eq!(single.to_tables(context).unwrap().0, table);
        let half = BrdfTexture::upload(context, &table, None, Precision::Half).unwrap();
        for (found, expected) in half.download(context).unwrap().iter().zip(table.values()) {
            assert!((0..3).all(|c| (found[c] / expected[c] - 1.0).abs() < 4.9e-4), "{found:?} {expected:?}");
        }
    }

    fn cells_without_data_are_filled_before_upload(context: &Context) {
        let mut values = table().values().to_vec();
        values[cell_index(3, 80, 7)] = [-1.0; 3];
        let torn = BrdfTable::from_values(values).unwrap();
        let found = BrdfTexture::upload(context, &torn, None, Precision::Single).unwrap();
        let found = found.to_tables(context).unwrap().0;
        assert_eq!(found.cell(3, 80, 7), torn.cell(3, 79, 7));
    }

    fn shaders_look_up_what_the_table_holds(context: &Context) {
        let table = table();
        let texture = BrdfTexture::upload(context, &table, None, Precision::Half).unwrap();
        let mut pairs: Vec<[[f32; 4]; 2]> = Vec::new();
        let mut expected = Vec::new();
        for i in 0..4000 {
            let [a, b, c, d] =
                [0.819_172_5, 0.671_043_6, 0.549_700_5, 0.450_307_5].map(|g| (f64::from(i) * g).fract());
            // Near the mirror direction, at grazing angles, and everywhere.
            let (wi, wo) = match i % 3 {
                0 => (
                    direction(a * 1.5, 1.0),
                    direction(a * 1.5 + 0.02 * (b - 0.5), 1.0 + std::f64::consts::PI),
                ),
                1 => (direction(1.5 + 0.05 * a, 6.2 * b), direction(1.5 + 0.05 * c, 6.2 * d)),
                _ => (direction(a * 1.55, b * 6.2), direction(c * 1.55, d * 6.2)),
            };
            #[expect(clippy::cast_possible_truncation, reason = "the shader's precision")]
            let narrow = |w: &nalgebra::Vector3<f64>| [w.x as f32, w.y as f32, w.z as f32, 0.0];
            pairs.push([narrow(&wi), narrow(&wo)]);
            expected.push(table.eval(&wi, &wo));
        }
        let found = crate::lookup::evaluate(context, &texture, &pairs).unwrap();
        for (found, expected) in found.iter().zip(&expected) {
            for c in 0..3 {
                let gap = (f64::from(found[c]) - expected[c]).abs();
                assert!(gap < 1e-3 * expected[c] + 1e-3, "{found:?} {expected:?}");
            }
        }
    }
}
