//! `_core.find_drift`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use truearm_field::{Left, find_drift as found_drift};

use crate::chain::contiguous;
use crate::door::quick;

/// Displacements (t, 3), the noise that is left, the progress of steps (s,), and the gain in evidence.
type Found<'py> = (Bound<'py, PyArray2<f64>>, f64, Vec<f64>, f64);

/// How a set-up moved, see the stub.
#[pyfunction]
pub fn find_drift<'py>(
    py: Python<'py>,
    progress: PyReadonlyArray1<'py, f64>,
    residual: PyReadonlyArray2<'py, f64>,
    weight: PyReadonlyArray1<'py, f64>,
    wanted: PyReadonlyArray1<'py, f64>,
    most_steps: usize,
) -> PyResult<Found<'py>> {
    let (weight, wanted) = (contiguous("weight", &weight)?, contiguous("wanted", &wanted)?);
    let (progress, residual) = (contiguous("progress", &progress)?, contiguous("residual", &residual)?);
    let left = Left { progress, residual, weight };
    let found = quick(py, || found_drift(left, wanted, most_steps))?;
    let moved: Bound<'py, PyArray1<f64>> = found.moved.into_pyarray(py);
    Ok((moved.reshape([wanted.len(), 3])?, found.noise, found.steps, found.gain))
}
