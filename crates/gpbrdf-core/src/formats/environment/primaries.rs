//! Colours of other primaries as linear sRGB.

use nalgebra::{Matrix3, Vector3};

use crate::formats::measured::SRGB_FROM_XYZ;

/// Chromaticities that are this near those of sRGB are taken for them.
const NEAR: f64 = 2e-3;

/// The `x, y` of red, green, blue and white of sRGB: IEC 61966-2-1.
const SRGB: [[f64; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

/// Primaries whose numbers are CIE XYZ themselves.
const XYZ: [[f64; 2]; 3] = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];

/// From XYZ to the sharpened responses of cones: K. M. Lam, "Metamerism and Colour Constancy", thesis, University of
/// Bradford (1985).
const BRADFORD: Matrix3<f64> =
    Matrix3::new(0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296);

/// A matrix that turns colours into linear sRGB.
pub(super) type ToSrgb = Matrix3<f64>;

/// From CIE XYZ, in which the white of D65 stays as it is.
pub(super) fn from_xyz() -> ToSrgb {
    Matrix3::from_fn(|row, column| SRGB_FROM_XYZ[row][column])
}

/// From the chromaticities of red, green, blue and white; none for those of sRGB. The white becomes that of D65.
///
/// # Errors
/// A description of primaries that span no colours.
pub(super) fn from_chromaticities(given: [[f64; 2]; 4]) -> Result<Option<ToSrgb>, String> {
    let near = |a: &[[f64; 2]], b: &[[f64; 2]]| {
        a.as_flattened().iter().zip(b.as_flattened()).all(|(x, y)| (x - y).abs() <= NEAR)
    };
    if near(&given, &SRGB) {
        return Ok(None);
    }
    if near(&given[..3], &XYZ) {
        return Ok(Some(from_xyz()));
    }
    let unfit = || format!("chromaticities {given:?}");
    let to_xyz = xyz_from(given).ok_or_else(unfit)?;
    let srgb_from_xyz = xyz_from(SRGB).and_then(|matrix| matrix.try_inverse()).ok_or_else(unfit)?;
    let cones = |white: [f64; 2]| Some(BRADFORD * tristimulus(white)?);
    let (from, to) = cones(given[3]).zip(cones(SRGB[3])).ok_or_else(unfit)?;
    let adapted =
        BRADFORD.try_inverse().map(|back| back * Matrix3::from_diagonal(&to.component_div(&from)) * BRADFORD);
    let matrix = srgb_from_xyz * adapted.ok_or_else(unfit)? * to_xyz;
    if matrix.iter().all(|x| x.is_finite()) { Ok(Some(matrix)) } else { Err(unfit()) }
}

/// XYZ of a colour of luminance 1.
fn tristimulus([x, y]: [f64; 2]) -> Option<Vector3<f64>> {
    (y > 0.0).then(|| Vector3::new(x / y, 1.0, (1.0 - x - y) / y))
}

/// The matrix from RGB to XYZ in which the white, of luminance 1, has equal numbers. SMPTE RP 177.
fn xyz_from([red, green, blue, white]: [[f64; 2]; 4]) -> Option<Matrix3<f64>> {
    // A primary may have no luminance, so its scale is left open.
    let column = |[x, y]: [f64; 2]| Vector3::new(x, y, 1.0 - x - y);
    let primaries = Matrix3::from_columns(&[column(red), column(green), column(blue)]);
    let scales = primaries.try_inverse()? * tristimulus(white)?;
    Some(primaries * Matrix3::from_diagonal(&scales))
}

/// Turns pixels into linear sRGB.
#[expect(clippy::cast_possible_truncation, reason = "f32 is the precision of a map")]
pub(super) fn convert(pixels: &mut [[f32; 3]], matrix: &ToSrgb) {
    for pixel in pixels {
        let colour = matrix * Vector3::from_array_storage(nalgebra::ArrayStorage([pixel.map(f64::from)]));
        *pixel = [colour.x as f32, colour.y as f32, colour.z as f32];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ACES 2065-1 (AP0): SMPTE ST 2065-1.
    const AP0: [[f64; 2]; 4] = [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]];

    #[test]
    fn colours_of_aces_are_those_of_published_matrices() {
        // From AP0 to linear sRGB by Bradford: the ACES project, "ACES to Rec.709".
        let published = Matrix3::new(
            2.521686, -1.134131, -0.387555, -0.276480, 1.372719, -0.096239, -0.015378, -0.152975, 1.168353,
        );
        let found = from_chromaticities(AP0).unwrap().unwrap();
        assert!((found - published).abs().max() < 2e-3, "{found}");
    }

    #[test]
    fn white_stays_white_and_srgb_and_xyz_are_as_they_are() {
        let found = from_chromaticities(AP0).unwrap().unwrap() * Vector3::repeat(1.0);
        assert!((found - Vector3::repeat(1.0)).abs().max() < 1e-9, "{found}");
        assert_eq!(from_chromaticities(SRGB), Ok(None));
        let xyz = from_chromaticities([XYZ[0], XYZ[1], XYZ[2], [1.0 / 3.0, 1.0 / 3.0]]).unwrap().unwrap();
        let d65 = xyz * tristimulus(SRGB[3]).unwrap();
        assert!((d65 - Vector3::repeat(1.0)).abs().max() < 1e-3, "{d65}");
        assert!(
            from_chromaticities([[0.3, 0.3]; 4]).is_err() && from_chromaticities([[f64::NAN; 2]; 4]).is_err()
        );
    }
}
