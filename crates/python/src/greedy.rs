//! `_core.choose_informative` and `_core.choose_telling`.

use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use truearm_field::{Candidates as Core, choose_informative as informative, choose_telling as telling};

use crate::door::{CoreError, long};

/// Candidates by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Candidates<'py> {
    noise: PyReadonlyArray3<'py, f64>,
    points: PyReadonlyArray2<'py, f64>,
    apart: f64,
}

/// Chosen candidates, and the criterion before the first and after each.
type Found = (Vec<usize>, Vec<f64>);

/// Candidates that leave the targets the least variance.
#[pyfunction]
pub fn choose_informative(
    py: Python<'_>,
    covariance: PyReadonlyArray2<'_, f64>,
    candidates: Candidates<'_>,
    count: usize,
) -> PyResult<Found> {
    let covariance = square(&covariance)?;
    let owned = Owned::of(&candidates)?;
    let found = long(py, |cancel| informative(&covariance, &owned.core(), count, cancel))?;
    Ok((found.chosen, found.values))
}

/// Candidates that tell most about what may have changed.
#[pyfunction]
pub fn choose_telling(
    py: Python<'_>,
    changed: PyReadonlyArray2<'_, f64>,
    unchanged: PyReadonlyArray2<'_, f64>,
    candidates: Candidates<'_>,
    count: usize,
) -> PyResult<Found> {
    let (changed, unchanged) = (square(&changed)?, square(&unchanged)?);
    let owned = Owned::of(&candidates)?;
    let found = long(py, |cancel| telling(&changed, &unchanged, &owned.core(), count, cancel))?;
    Ok((found.chosen, found.values))
}

/// The candidates' numbers.
struct Owned {
    noise: Vec<f64>,
    points: Vec<f64>,
    rows: usize,
    apart: f64,
}

impl Owned {
    fn of(given: &Candidates<'_>) -> PyResult<Self> {
        let (noise, points) = (given.noise.shape(), given.points.shape());
        if noise[1] != noise[2] || points[1] != 3 || noise[0] != points[0] {
            return Err(CoreError::new_err(format!(
                "noise has shape {noise:?} and points {points:?}, they must be (c, m, m) and (c, 3)"
            )));
        }
        Ok(Self {
            noise: given.noise.as_array().iter().copied().collect(),
            points: given.points.as_array().iter().copied().collect(),
            rows: noise[1],
            apart: given.apart,
        })
    }

    fn core(&self) -> Core<'_> {
        Core { noise: &self.noise, rows: self.rows, points: &self.points, apart: self.apart }
    }
}

/// The numbers of a square matrix.
fn square(array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<f64>> {
    let shape = array.shape();
    if shape[0] != shape[1] {
        return Err(CoreError::new_err(format!("a covariance has shape {shape:?}, it must be square")));
    }
    Ok(array.as_array().iter().copied().collect())
}
