//! Values on a grid of pixels.

use crate::base::error::{Error, Result};

/// A grid of `width * height` pixels, rows from top to bottom and each row from left to right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster<P> {
    width: usize,
    height: usize,
    pixels: Vec<P>,
}

impl<P> Raster<P> {
    /// A raster of these pixels.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] unless there are `width * height` pixels.
    pub fn new(width: usize, height: usize, pixels: Vec<P>) -> Result<Self> {
        if width.checked_mul(height) != Some(pixels.len()) {
            return Err(Error::argument("raster", format!("{width} x {height} pixels"), pixels.len()));
        }
        Ok(Self { width, height, pixels })
    }

    /// A raster of `pixel(column, row)`.
    pub fn from_fn(width: usize, height: usize, pixel: impl Fn(usize, usize) -> P) -> Self {
        let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
        Self { width, height, pixels }
    }

    /// A raster whose pixels are all the same.
    pub fn filled(width: usize, height: usize, pixel: P) -> Self
    where
        P: Clone,
    {
        Self { width, height, pixels: vec![pixel; width * height] }
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

    /// All pixels, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[P] {
        &self.pixels
    }

    /// All pixels, row by row, to be changed.
    pub fn pixels_mut(&mut self) -> &mut [P] {
        &mut self.pixels
    }

    /// The pixel at `(column, row)`. It panics outside of the raster.
    #[must_use]
    pub fn at(&self, column: usize, row: usize) -> &P {
        &self.pixels[row * self.width..][..self.width][column]
    }

    /// A raster of the same size, in which each pixel is replaced by `f(pixel)`.
    pub fn map<Q>(&self, f: impl FnMut(&P) -> Q) -> Raster<Q> {
        Raster { width: self.width, height: self.height, pixels: self.pixels.iter().map(f).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_in_rows_and_their_number_is_checked() {
        let raster = Raster::from_fn(3, 2, |column, row| 10 * row + column);
        assert_eq!((raster.width(), raster.height()), (3, 2));
        assert_eq!(raster.pixels(), [0, 1, 2, 10, 11, 12]);
        assert_eq!(*raster.at(2, 1), 12);
        assert_eq!(raster.map(|x| x + 1), Raster::new(3, 2, vec![1, 2, 3, 11, 12, 13]).unwrap());
        assert_eq!(Raster::filled(0, 4, 1), Raster::new(0, 4, vec![]).unwrap());
        let message = Raster::new(3, 2, vec![0; 5]).unwrap_err().to_string();
        assert_eq!(message, "raster: expected 3 x 2 pixels, found 5");
        assert!(Raster::new(usize::MAX, 2, vec![0]).is_err());
    }

    #[test]
    #[should_panic(expected = "index out of bounds")]
    fn a_column_outside_is_not_taken_from_the_next_row() {
        let _ = Raster::filled(3, 2, 0).at(3, 0);
    }
}
