//! Pictures in linear light, with a mask of the pixels that metrics compare.

use crate::base::error::{Error, Result};
use crate::base::raster::Raster;

/// A picture of the sphere in linear RGB, black outside of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    pub(super) raster: Raster<[f32; 3]>,
    pub(super) mask: Vec<bool>,
}

impl Image {
    /// An image in linear RGB; metrics compare the pixels in `mask`.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless the mask has as many entries as the image has pixels.
    pub fn new(raster: Raster<[f32; 3]>, mask: Vec<bool>) -> Result<Self> {
        if mask.len() != raster.pixels().len() {
            let expected = format!("{} x {} entries", raster.width(), raster.height());
            return Err(Error::argument("mask of an image", expected, mask.len()));
        }
        Ok(Self { raster, mask })
    }

    /// Linear RGB.
    #[must_use]
    pub fn raster(&self) -> &Raster<[f32; 3]> {
        &self.raster
    }

    /// The mask of the pixels that belong to the sphere.
    #[must_use]
    pub fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// Only the pixels of the sphere.
    pub fn sphere_pixels(&self) -> impl Iterator<Item = &[f32; 3]> {
        self.raster.pixels().iter().zip(&self.mask).filter_map(|(pixel, &inside)| inside.then_some(pixel))
    }
}
