//! `_core.same_poses`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use truearm_field::{FieldError, shots_of_poses};

use crate::chain::contiguous;
use crate::door::Failure;

/// Which rows were measured at the same pose, see the stub.
#[pyfunction]
pub fn same_poses<'py>(
    py: Python<'py>,
    joints: PyReadonlyArray2<'py, f64>,
    group: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let (rows, width) = (joints.shape()[0], joints.shape()[1]);
    let (joints, group) = (contiguous("joints", &joints)?, contiguous("group", &group)?);
    if group.len() != rows {
        let error = FieldError::Length { what: "groups of rows", found: group.len(), expected: rows };
        return Err(error.into_exception());
    }
    let readings: Vec<&[f64]> = (0..rows).map(|row| &joints[row * width..(row + 1) * width]).collect();
    let mut first = vec![0; rows];
    for shots in shots_of_poses(&readings, |a, b| group[a] == group[b]) {
        shots.iter().for_each(|&shot| first[shot] = shots[0] as i64);
    }
    Ok(first.into_pyarray(py))
}
