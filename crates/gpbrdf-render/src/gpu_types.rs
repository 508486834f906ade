//! Everything that crosses the border to the shaders: structs laid out as in WGSL, and enums that WGSL names
//! by constants.
//!
//! A test compares each struct with the WGSL struct of its name, member by member, and each enum with the
//! constants.

use bytemuck::{NoUninit, Pod, Zeroable};

use crate::scene::display::{Background, Encoding, ToneCurve};
use crate::scene::shade::Sampling;

/// `View` of `shared/view.wgsl`: a camera and the picture it takes.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct View {
    pub(crate) clip_from_world: [[f32; 4]; 4],
    /// 1 in the fourth component for rays out of the eye, 0 for parallel ones.
    pub(crate) eye: [f32; 4],
    /// Half of the frame: in units of the world, or at distance 1 from the eye.
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) forward: [f32; 4],
    /// Columns and rows of the picture.
    pub(crate) size: [f32; 2],
    /// How far the picture is moved, in clip space.
    pub(crate) jitter: [f32; 2],
}

/// A corner of a triangle, as `mesh_corner` of `scene/gbuffer.wgsl` reads it.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct Vertex {
    pub(crate) position: [f32; 3],
    pub(crate) normal: [f32; 3],
}

/// `PixelSums` of `shared/sums.wgsl`: running sums of the samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PixelSums {
    /// Radiance of the truth.
    pub(crate) truth: [f32; 3],
    /// Samples that hit an object.
    pub(crate) hits: f32,
    /// Radiance of the prediction.
    pub(crate) prediction: [f32; 3],
    /// Luminance of the prediction times sigma.
    pub(crate) weighted_sigma: f32,
}

/// The `LIGHT_*` of `scene/shade.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(u32)]
pub(crate) enum LightKind {
    Directional,
    Point,
    Environment,
}

/// `Shade` of `scene/shade.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct Shade {
    /// Perspective camera: the eye, and 1. Orthographic camera: the direction to the viewer, and 0.
    pub(crate) viewer: [f32; 4],
    /// Point light: its position. Directional light: the unit vector to it.
    pub(crate) light: [f32; 4],
    /// Intensity of a point light; irradiance of a directional one on a surface that faces it.
    pub(crate) strength: [f32; 4],
    pub(crate) size: [u32; 2],
    pub(crate) environment_size: [u32; 2],
    pub(crate) first_row: u32,
    pub(crate) first_sample: u32,
    pub(crate) sample_count: u32,
    pub(crate) light_kind: LightKind,
    pub(crate) sampling: Sampling,
    /// 1 where the prediction is the only material, else 0.
    pub(crate) single_material: u32,
    /// Nothing is reflected where either cosine is smaller.
    pub(crate) min_cosine: f32,
    /// The share of the directions drawn from the BRDF that are drawn by the cosine instead.
    pub(crate) padding: u32,
}

/// The `SHOW_*` of `scene/display.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(u32)]
pub(crate) enum ShowKind {
    Truth,
    Prediction,
    Sigma,
    Difference,
    Split,
}

/// `Display` of `scene/display.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct Display {
    pub(crate) size: [u32; 2],
    pub(crate) environment_size: [u32; 2],
    pub(crate) show: ShowKind,
    pub(crate) tone: ToneCurve,
    pub(crate) encoding: Encoding,
    pub(crate) background: Background,
    /// Samples in the sums of each pixel.
    pub(crate) samples: f32,
    /// Factor of the radiance.
    pub(crate) exposure: f32,
    /// End of the colour scale of sigma or of the difference.
    pub(crate) limit: f32,
    /// [`ShowKind::Split`]: the column where the prediction begins, as a share of the width.
    pub(crate) split: f32,
    /// Texels along each side of the ground; 0 where there is none.
    pub(crate) ground_size: u32,
    /// Half of a side of the ground, and its height.
    pub(crate) ground_half: f32,
    pub(crate) ground_height: f32,
    /// Up to which height of a unit direction the map is mirrored at the horizon behind the ground.
    pub(crate) horizon: f32,
}

/// `Separable` of `bake/separable.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct Separable {
    /// Functions along `theta_h`, `theta_d` and `phi_d`, and rows of the targets along `phi_d`.
    pub(crate) shape: [u32; 4],
    /// Offsets of the functions and of the variances along `theta_h`.
    pub(crate) first: [u32; 2],
    /// The same along `phi_d`.
    pub(crate) third: [u32; 2],
    /// Offsets for `theta_d`: its factors of the second coordinate, the factors of columns, the numbers of
    /// distinct cells of columns, and breaks.
    pub(crate) second: [u32; 4],
    /// Intervals between breaks, and pieces of each interval.
    pub(crate) pieces: [u32; 2],
    pub(crate) signal_variance: f32,
    /// Prior variance along `theta_d`.
    pub(crate) second_prior: f32,
    /// The largest second coordinate.
    pub(crate) limit: f32,
    pub(crate) padding: [f32; 3],
    /// Where the form is mixed into all channels: the factor by which its variance adds to that of each.
    pub(crate) share: [f32; 4],
}

/// `KernelSum` of `bake/kernel_sum.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct KernelSum {
    /// The cells and the samples of one dispatch.
    pub(crate) first_cell: u32,
    pub(crate) last_cell: u32,
    pub(crate) first_sample: u32,
    pub(crate) last_sample: u32,
    /// 1 where the third coordinate is an angle, else 0.
    pub(crate) chord: u32,
}

/// `Sample` of `bake/kernel_sum.wgsl`: numbers as sums of two f32.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct Sample {
    /// Coordinates. The third and fourth are the sine and cosine of the third one where that is an angle.
    pub(crate) high: [f32; 4],
    pub(crate) low: [f32; 4],
    /// The weight of each channel.
    pub(crate) weight_high: [f32; 4],
    pub(crate) weight_low: [f32; 4],
}

/// The `TRANSFORM_*` of `bake/finish.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(u32)]
pub(crate) enum TransformKind {
    Identity,
    Log,
    CubeRoot,
}

/// `Finish` of `bake/finish.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, NoUninit)]
#[repr(C)]
pub(crate) struct Finish {
    /// Prior mean of each channel.
    pub(crate) offsets: [f32; 4],
    pub(crate) transform: TransformKind,
    pub(crate) epsilon: f32,
    /// Rows of the targets along `phi_d`.
    pub(crate) rows: u32,
    /// The largest number that the texels hold.
    pub(crate) largest: f32,
}

/// Rounds to the precision of the device.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of the device")]
pub(crate) fn narrow(x: f64) -> f32 {
    x as f32
}

/// A count of cells, functions or samples, all of which are far below 2^32.
pub(crate) fn to_u32(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}
