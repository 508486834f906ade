//! Cube maps as latitude-longitude maps.

use std::f64::consts::{PI, TAU};

use super::Refused;
use crate::base::raster::Raster;

/// Samples along each side of a pixel.
const SAMPLES: usize = 2;

/// The latitude-longitude map of a cube map whose faces +x, -x, +y, -y, +z and -z stand below each other. The map has
/// four times as many columns as a face. The mapping is that of `OpenEXR` ("`CubeMap::faceAndPixelPosition`" in
/// `ImfEnvmap.cpp` of its library), in which the middle of a latitude-longitude map is at +z: seen from
/// [`Environment`](crate::Environment), turned by half a turn about the vertical axis.
pub(super) fn to_lat_long(cube: &Raster<[f32; 3]>) -> Result<Raster<[f32; 3]>, Refused> {
    let side = cube.width();
    if side == 0 || cube.height() != 6 * side {
        let found = format!("{} x {}", side, cube.height());
        return Err(Refused::new("a cube map, six squares below each other", found));
    }
    let (width, height) = (4 * side, 2 * side);
    super::check_size(width, height)?;
    Ok(Raster::from_fn(width, height, |x, y| {
        let mut sum = [0.0; 3];
        for k in 0..SAMPLES * SAMPLES {
            let within =
                |i: usize, j: usize, n: usize| (i as f64 + (j as f64 + 0.5) / SAMPLES as f64) / n as f64;
            let (u, v) = (within(x, k % SAMPLES, width), within(y, k / SAMPLES, height));
            let (sin_t, cos_t) = (PI * v).sin_cos();
            let (sin_p, cos_p) = (TAU * (0.5 - u)).sin_cos();
            let sample = look_up(cube, [sin_t * sin_p, cos_t, sin_t * cos_p]);
            sum = std::array::from_fn(|c| sum[c] + sample[c]);
        }
        #[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of a map")]
        sum.map(|x| (x / (SAMPLES * SAMPLES) as f64) as f32)
    }))
}

/// The value in a direction of the cube's own frame, interpolated within a face.
fn look_up(cube: &Raster<[f32; 3]>, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let side = cube.width();
    let [ax, ay, az] = [x, y, z].map(f64::abs);
    // The face, and the place on it along the columns and rows of the file, from -1 to 1.
    let (face, along, down) = if ax >= ay && ax >= az {
        if x > 0.0 { (0, z / ax, -y / ax) } else { (1, -z / ax, -y / ax) }
    } else if ay >= az {
        if y > 0.0 { (2, x / ay, -z / ay) } else { (3, x / ay, z / ay) }
    } else if z > 0.0 {
        (4, -x / az, -y / az)
    } else {
        (5, x / az, -y / az)
    };
    let place = |t: f64| {
        let at = (0.5 * (t + 1.0) * (side - 1) as f64).clamp(0.0, (side - 1) as f64);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the side")]
        let low = at as usize;
        (low, (low + 1).min(side - 1), at - low as f64)
    };
    let ((x0, x1, s), (y0, y1, t)) = (place(along), place(down));
    let value = |x: usize, y: usize| cube.at(x, face * side + y).map(f64::from);
    let corners = [value(x0, y0), value(x1, y0), value(x0, y1), value(x1, y1)];
    let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
    std::array::from_fn(|c| (0..4).map(|k| weights[k] * corners[k][c]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube map of a function of the direction, by the inverse mapping: `CubeMap::direction` of the same file.
    fn cube_of(side: usize, value: impl Fn([f64; 3]) -> [f32; 3]) -> Raster<[f32; 3]> {
        Raster::from_fn(side, 6 * side, |x, y| {
            let at = |i: usize| 2.0 * i as f64 / (side - 1) as f64 - 1.0;
            let (right, up) = (at(x), -at(y % side));
            value(match y / side {
                0 => [1.0, up, right],
                1 => [-1.0, up, -right],
                2 => [right, 1.0, up],
                3 => [right, -1.0, -up],
                4 => [-right, up, 1.0],
                _ => [right, up, -1.0],
            })
        })
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "colours")]
    fn directions_of_the_cube_are_those_of_the_map_half_turned() {
        let cube = cube_of(33, |[x, y, z]| {
            let length = (x * x + y * y + z * z).sqrt();
            [x, y, z].map(|v| (1.0 + v / length) as f32)
        });
        let map = to_lat_long(&cube).map_err(|refused| refused.found).unwrap();
        assert_eq!((map.width(), map.height()), (132, 66));
        for row in 0..66 {
            for column in 0..132 {
                let (u, v) = ((column as f64 + 0.5) / 132.0, (row as f64 + 0.5) / 66.0);
                let (t, p) = (PI * v, TAU * (u - 0.5));
                // The convention of `Environment`, about the vertical axis.
                let expected = [-t.sin() * p.sin(), t.cos(), t.sin() * p.cos()];
                let found = map.at(column, row).map(|x| f64::from(x) - 1.0);
                for c in 0..3 {
                    assert!((found[c] - expected[c]).abs() < 3e-3, "{column} {row} {found:?} {expected:?}");
                }
            }
        }
        assert!(to_lat_long(&Raster::filled(4, 8, [0.0; 3])).is_err());
        let one = to_lat_long(&Raster::filled(1, 6, [2.0; 3])).map_err(|refused| refused.found).unwrap();
        assert!(one.pixels().iter().all(|p| *p == [2.0; 3]));
    }
}
