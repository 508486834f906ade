//! Pictures in linear light, with a mask of the pixels that metrics compare.

use crate::base::error::{Error, Result};

/// A picture of the sphere in linear RGB, black outside of it. Rows are ordered from top to bottom.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<[f32; 3]>,
    pub(super) mask: Vec<bool>,
}

impl Image {
    /// An image of `width * height` pixels; metrics compare those in `mask`.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless there are `width * height` pixels and as many entries in the mask.
    pub fn new(width: usize, height: usize, pixels: Vec<[f32; 3]>, mask: Vec<bool>) -> Result<Self> {
        let count = width.checked_mul(height);
        if count != Some(pixels.len()) || count != Some(mask.len()) {
            let found = format!("{} pixels and a mask of {}", pixels.len(), mask.len());
            return Err(Error::argument("image", format!("{width} x {height} pixels and mask"), found));
        }
        Ok(Self { width, height, pixels, mask })
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Linear RGB, rows from top to bottom.
    #[must_use]
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// The mask of the pixels that belong to the sphere.
    #[must_use]
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Only the pixels of the sphere.
    pub fn sphere_pixels(&self) -> impl Iterator<Item = &[f32; 3]> {
        self.pixels.iter().zip(&self.mask).filter_map(|(pixel, &inside)| inside.then_some(pixel))
    }
}
