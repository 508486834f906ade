//! Arrays of `NumPy` as slices of rows, and back.

use std::borrow::Cow;

use gpbrdf_core::nalgebra::Vector3;
use gpbrdf_core::{HalfDiff, Rgb};
use numpy::ndarray::IxDyn;
use numpy::{
    AllowTypeChange, Element, IntoPyArray, PyArray1, PyArray2, PyArray4, PyArrayLike, PyArrayMethods,
    PyUntypedArrayMethods,
};
use pyo3::{Bound, PyResult, Python};

use crate::error::wrong;

/// An argument that is an array or can be made one. An array of numbers of this type is not copied.
pub(crate) type Like<'py, T> = PyArrayLike<'py, T, IxDyn, AllowTypeChange>;

/// The number of cells of a table along `theta_h`, `theta_d` and `phi_d`, and of its channels.
pub(crate) const TABLE_SHAPE: [usize; 4] = [90, 90, 180, 3];

/// How far from 1 the length of a direction may be: it may have been rounded.
const ROUNDING: f64 = 1e-3;

/// The shape of an array, as Python writes it.
fn shape_of<T: Element>(array: &Like<'_, T>) -> String {
    let shape: Vec<String> = array.shape().iter().map(ToString::to_string).collect();
    if shape.len() == 1 { format!("({},)", shape[0]) } else { format!("({})", shape.join(", ")) }
}

/// All numbers of an array in the order of C, copied only where they lie in another order.
pub(crate) fn numbers<'a, T: Element + Copy>(array: &'a Like<'_, T>) -> Cow<'a, [T]> {
    let view = array.as_array();
    match view.to_slice() {
        Some(slice) => Cow::Borrowed(slice),
        None => Cow::Owned(view.iter().copied().collect()),
    }
}

/// The rows of an array of shape `(n, N)`, or one row of shape `(N,)`.
pub(crate) fn rows<'a, T: Element + Copy, const N: usize>(
    what: &str,
    array: &'a Like<'_, T>,
) -> PyResult<Cow<'a, [[T; N]]>> {
    if !matches!(*array.shape(), [n] | [_, n] if n == N) {
        let expected = format!("an array of shape (n, {N}) or ({N},)");
        return Err(wrong(what, &expected, format_args!("shape {}", shape_of(array))));
    }
    Ok(match numbers(array) {
        Cow::Borrowed(numbers) => Cow::Borrowed(numbers.as_chunks().0),
        Cow::Owned(numbers) => Cow::Owned(numbers.as_chunks().0.to_vec()),
    })
}

/// The numbers of an array of shape `(n,)`, or a single number.
pub(crate) fn column<'a, T: Element + Copy>(what: &str, array: &'a Like<'_, T>) -> PyResult<Cow<'a, [T]>> {
    if array.shape().len() > 1 {
        return Err(wrong(what, "an array of shape (n,)", format_args!("shape {}", shape_of(array))));
    }
    Ok(numbers(array))
}

/// Two lists of the same length.
type Pair<'a, A, B> = (Cow<'a, [A]>, Cow<'a, [B]>);

/// Two lists of the same length: a list of one row stands for as many as the other has.
pub(crate) fn paired<'a, A: Copy, B: Copy>(
    names: &str,
    a: Cow<'a, [A]>,
    b: Cow<'a, [B]>,
) -> PyResult<Pair<'a, A, B>> {
    match (a.len(), b.len()) {
        (n, m) if n == m => Ok((a, b)),
        (1, m) => Ok((vec![a[0]; m].into(), b)),
        (n, 1) => {
            let b = vec![b[0]; n].into();
            Ok((a, b))
        }
        (n, m) => Err(wrong(names, "the same number of rows, or one row", format_args!("{n} and {m}"))),
    }
}

/// The values of samples from an array of shape `(n, 3)`, or `(n,)` for a single channel that stands for all.
pub(crate) fn colours(what: &str, array: &Like<'_, f64>) -> PyResult<Vec<Rgb>> {
    match *array.shape() {
        [_] => Ok(numbers(array).iter().map(|&value| [value; 3]).collect()),
        [_, 3] => Ok(rows(what, array)?.into_owned()),
        _ => Err(wrong(what, "an array of shape (n, 3) or (n,)", format_args!("shape {}", shape_of(array)))),
    }
}

/// Unit directions above the horizon.
pub(crate) fn directions(what: &str, array: &Like<'_, f64>) -> PyResult<Vec<Vector3<f64>>> {
    let rows = rows::<f64, 3>(what, array)?;
    let unit = |(row, direction): (usize, &[f64; 3])| {
        let direction = Vector3::from(*direction);
        let length = direction.norm();
        if !((length - 1.0).abs() <= ROUNDING) {
            return Err(wrong(
                &format!("{what}, row {row}"),
                "a unit vector",
                format_args!("length {length}"),
            ));
        }
        if !(direction.z > 0.0) {
            let found = format!("z = {}", direction.z);
            return Err(wrong(&format!("{what}, row {row}"), "a direction above the horizon, z > 0", found));
        }
        Ok(direction / length)
    };
    rows.iter().enumerate().map(unit).collect()
}

/// Pairs of unit directions above the horizon.
pub(crate) fn direction_pairs(wi: &Like<'_, f64>, wo: &Like<'_, f64>) -> PyResult<Vec<[Vector3<f64>; 2]>> {
    let (wi, wo) = paired("wi and wo", directions("wi", wi)?.into(), directions("wo", wo)?.into())?;
    Ok(wi.iter().zip(wo.iter()).map(|(&wi, &wo)| [wi, wo]).collect())
}

/// Half-difference angles from rows `(theta_h, theta_d, phi_d)`, radians.
pub(crate) fn half_differences(what: &str, array: &Like<'_, f64>) -> PyResult<Vec<HalfDiff>> {
    let rows = rows::<f64, 3>(what, array)?;
    let angles = |(row, &[theta_h, theta_d, phi_d]): (usize, &[f64; 3])| {
        let angles = HalfDiff { theta_h, theta_d, phi_d };
        if angles.is_finite() && theta_h >= 0.0 && theta_d >= 0.0 && angles.is_above_horizon() {
            return Ok(angles);
        }
        let expected = "theta_h and theta_d of directions above the horizon, in radians";
        Err(wrong(&format!("{what}, row {row}"), expected, format_args!("({theta_h}, {theta_d}, {phi_d})")))
    };
    rows.iter().enumerate().map(angles).collect()
}

/// Half-difference angles as rows.
pub(crate) fn angle_rows(angles: &[HalfDiff]) -> Vec<[f64; 3]> {
    angles.iter().map(|a| [a.theta_h, a.theta_d, a.phi_d]).collect()
}

/// A new array of shape `(n,)` that takes the numbers over.
pub(crate) fn array1<T: Element>(py: Python<'_>, numbers: Vec<T>) -> Bound<'_, PyArray1<T>> {
    numbers.into_pyarray(py)
}

/// A new array of shape `(n, N)` that takes the rows over.
pub(crate) fn array2<T: Element, const N: usize>(
    py: Python<'_>,
    rows: Vec<[T; N]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let shape = [rows.len(), N];
    rows.into_flattened().into_pyarray(py).reshape(shape)
}

/// A new array of the shape of a table that takes its values over.
pub(crate) fn table_array(py: Python<'_>, cells: Vec<[f32; 3]>) -> PyResult<Bound<'_, PyArray4<f32>>> {
    cells.into_flattened().into_pyarray(py).reshape(TABLE_SHAPE)
}

/// The cells of an array of the shape of a table.
pub(crate) fn table_cells(what: &str, array: &Like<'_, f32>) -> PyResult<Vec<[f32; 3]>> {
    if *array.shape() != TABLE_SHAPE {
        let found = format!("shape {}", shape_of(array));
        return Err(wrong(what, "an array of shape (90, 90, 180, 3)", found));
    }
    Ok(numbers(array).as_chunks().0.to_vec())
}
