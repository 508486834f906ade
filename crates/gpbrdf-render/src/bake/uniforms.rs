//! The uniforms of the bake's shaders, laid out as in WGSL.

use bytemuck::{Pod, Zeroable};

/// `Lattice` of `lattice.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Lattice {
    pub(crate) shape: [u32; 4],
    pub(crate) first: [u32; 2],
    pub(crate) third: [u32; 2],
    pub(crate) second: [u32; 4],
    pub(crate) pieces: [u32; 2],
    pub(crate) signal_variance: f32,
    pub(crate) second_prior: f32,
    pub(crate) limit: f32,
    pub(crate) padding: [f32; 3],
}

/// `Finish` of `finish.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Finish {
    pub(crate) offsets: [f32; 4],
    pub(crate) transform: u32,
    pub(crate) epsilon: f32,
    pub(crate) rows: u32,
    pub(crate) largest: f32,
}

/// `Dense` of `dense.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Dense {
    pub(crate) first_cell: u32,
    pub(crate) last_cell: u32,
    pub(crate) first_sample: u32,
    pub(crate) last_sample: u32,
    pub(crate) rows: u32,
    pub(crate) chord: u32,
    pub(crate) limit: f32,
    pub(crate) unused: u32,
}
