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
    pub(crate) share: [f32; 4],
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::{LATTICE_WGSL, dense::dense_wgsl_for_tests, finish_wgsl};
    use crate::reflect::assert_layout;
    use crate::texture::Precision;

    #[test]
    fn uniforms_are_laid_out_as_in_wgsl() {
        assert_layout!(
            LATTICE_WGSL,
            "Lattice",
            Lattice,
            [shape, first, third, second, pieces, signal_variance, second_prior, limit, share]
        );
        for precision in [Precision::Half, Precision::Single] {
            assert_layout!(
                &finish_wgsl(precision),
                "Finish",
                Finish,
                [offsets, transform, epsilon, rows, largest]
            );
        }
        for double in [false, true] {
            let source = dense_wgsl_for_tests(double);
            assert_layout!(
                &source,
                "Dense",
                Dense,
                [first_cell, last_cell, first_sample, last_sample, rows, chord, limit, unused]
            );
            let (members, size) = crate::reflect::layout(&source, "Sample");
            let offsets: Vec<usize> = members.iter().map(|m| m.1).collect();
            // Written as four arrays of four numbers.
            assert_eq!((offsets, size), (vec![0, 16, 32, 48], 64));
        }
    }
}
