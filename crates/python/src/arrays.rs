//! NumPy arrays as the core takes and gives them, and words for those that do not fit.
//!
//! Work without the lock has copies of what it reads, since Python may change its arrays meanwhile. Kinematics and the
//! field's parameters alone read the arrays themselves, as NumPy's own functions do: a copy would cost as much as their
//! work, and what they are called with must not be changed until they return.

use std::borrow::Cow;

use numpy::ndarray::{Array3, Dimension};
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::chain::contiguous;
use crate::door::CoreError;

/// A copy of an array's numbers, row by row.
pub fn numbers<D: Dimension>(array: &PyReadonlyArray<'_, f64, D>) -> Vec<f64> {
    array.as_array().iter().copied().collect()
}

/// The numbers of an array row by row, copied only where they do not lie so.
pub fn lent<'a>(array: &'a PyReadonlyArray2<'_, f64>) -> Cow<'a, [f64]> {
    match contiguous("array", array) {
        Ok(slice) => Cow::Borrowed(slice),
        Err(_) => Cow::Owned(numbers(array)),
    }
}

/// Numbers as a new array of three axes.
pub fn array3<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: (usize, usize, usize),
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let array = Array3::from_shape_vec(shape, values);
    array.map(|array| array.into_pyarray(py)).map_err(|error| CoreError::new_err(error.to_string()))
}

/// An array is of another shape than it must be.
pub fn wrong_shape(name: &str, got: &[usize], wanted: &[usize]) -> PyErr {
    CoreError::new_err(format!("{name} has shape {got:?}, it must be {wanted:?}"))
}

/// A word is none of those that there are.
pub fn unknown(what: &str, got: &str, choices: &str) -> PyErr {
    CoreError::new_err(format!("{what} is '{got}', it must be {choices}"))
}
