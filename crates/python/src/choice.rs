//! `_core.choose_poses` and `_core.observability`.

use std::collections::BTreeMap;

use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use truearm_estimate::{
    Choice as Core, ChoiceOptions, Criterion, Observability, PoseRows, choose_poses as choose,
    independent_columns as independent, observability_of,
};

use crate::door::{CoreError, long, quick};

/// Options of [`choose_poses`] by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options<'py> {
    columns: Vec<usize>,
    criterion: String,
    limit: Option<f64>,
    given: Option<PyReadonlyArray3<'py, f64>>,
    start: Option<PyReadonlyArray1<'py, i64>>,
    passes: usize,
}

/// The criterion of a name.
pub fn criterion(name: &str) -> PyResult<Criterion> {
    Ok(match name {
        "kappa" => Criterion::Condition,
        "d" => Criterion::Determinant,
        "o1" => Criterion::O1,
        "o2" => Criterion::O2,
        "o3" => Criterion::O3,
        "o4" => Criterion::O4,
        "o5" => Criterion::O5,
        other => {
            return Err(CoreError::new_err(format!(
                "criterion is '{other}', it must be 'kappa', 'd' or 'o1' to 'o5'"
            )));
        }
    })
}

/// Chosen poses, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Choice {
    core: Core,
}

/// Chooses poses from a pool.
#[pyfunction]
pub fn choose_poses(
    py: Python<'_>,
    jacobian: PyReadonlyArray3<'_, f64>,
    count: usize,
    options: Options<'_>,
) -> PyResult<Choice> {
    let values = checked("jacobian", &jacobian, options.columns.len())?;
    let given = match &options.given {
        Some(given) => checked("given", given, options.columns.len())?,
        None => Vec::new(),
    };
    let start: Option<Vec<usize>> = options
        .start
        .map(|start| start.as_array().iter().map(|&pose| pose.try_into()).collect())
        .transpose()
        .map_err(|_| CoreError::new_err("start holds a negative index, candidates count from 0"))?;
    let by = criterion(&options.criterion)?;
    let rows = jacobian.shape()[1];
    let core = long(py, |cancel| {
        let how = ChoiceOptions {
            count,
            criterion: by,
            columns: &options.columns,
            given: &given,
            start: start.as_deref(),
            limit: options.limit,
            passes: options.passes,
            cancel: cancel.clone(),
        };
        choose(&values, rows, &how)
    })?;
    Ok(Choice { core })
}

/// Indices of a set of poses.
#[pyfunction]
#[pyo3(signature = (jacobian, columns, targets=1))]
pub fn observability(
    py: Python<'_>,
    jacobian: PyReadonlyArray3<'_, f64>,
    columns: Vec<usize>,
    targets: usize,
) -> PyResult<BTreeMap<&'static str, f64>> {
    let values = checked("jacobian", &jacobian, columns.len())?;
    let rows = PoseRows::new(jacobian.shape()[1], targets);
    let found = quick(py, || observability_of(&values, rows, &columns))?;
    Ok(by_name(&found))
}

/// Columns that none before them can stand for, in order.
#[pyfunction]
pub fn independent_columns(
    py: Python<'_>,
    jacobian: PyReadonlyArray3<'_, f64>,
    columns: Vec<usize>,
) -> PyResult<Vec<usize>> {
    let values = checked("jacobian", &jacobian, columns.len())?;
    let rows = PoseRows::new(jacobian.shape()[1], 1);
    quick(py, || independent(&values, rows, &columns))
}

fn checked(name: &str, jacobian: &PyReadonlyArray3<'_, f64>, width: usize) -> PyResult<Vec<f64>> {
    let shape = jacobian.shape();
    if shape[2] != width {
        let text = format!("{name} has shape {shape:?}, its last axis must be the {width} columns");
        return Err(CoreError::new_err(text));
    }
    Ok(jacobian.as_array().iter().copied().collect())
}

fn by_name(found: &Observability) -> BTreeMap<&'static str, f64> {
    BTreeMap::from([
        ("kappa", found.kappa),
        ("kappa_normal", found.kappa_normal),
        ("o1", found.o1),
        ("o2", found.o2),
        ("o3", found.o3),
        ("o4", found.o4),
        ("o5", found.o5),
        ("log_det", found.log_determinant),
    ])
}

#[pymethods]
impl Choice {
    #[getter]
    fn chosen(&self) -> Vec<usize> {
        self.core.chosen.clone()
    }

    #[getter]
    fn before(&self) -> BTreeMap<&'static str, f64> {
        by_name(&self.core.before)
    }

    #[getter]
    fn after(&self) -> BTreeMap<&'static str, f64> {
        by_name(&self.core.after)
    }

    #[getter]
    fn exchanges(&self) -> usize {
        self.core.exchanges
    }

    #[getter]
    fn well_conditioned(&self) -> bool {
        self.core.well_conditioned
    }
}
