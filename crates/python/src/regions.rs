//! `_core.Regions`: the divided workspace, its division and the CEPs of its parts.

use std::collections::HashMap;

use numpy::{
    PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use truearm_estimate::EstimateError;
use truearm_field::regions::{
    Method, Parts, RegionalFit as CoreFit, Regions as Core, fill_without_data as fill, regional_ceps as fit,
};

use crate::arrays::numbers;
use crate::door::{CoreError, Failure, quick};
use crate::estimate::IdentificationProblem;
use crate::measured::{Setup, matrix, vector};

/// A tree of regions, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Regions {
    core: Core,
}

impl Regions {
    pub fn wrap(core: Core) -> Self {
        Self { core }
    }

    fn leaf(&self, leaf: usize) -> PyResult<usize> {
        if leaf < self.core.count() && self.core.is_leaf(leaf) {
            return Ok(leaf);
        }
        Err(CoreError::new_err(format!("region {leaf} is no leaf, leaves are {:?}", self.core.leaves())))
    }
}

fn integers<'py>(py: Python<'py>, values: impl Iterator<Item = i64>) -> Bound<'py, PyArray1<i64>> {
    PyArray1::from_iter(py, values)
}

#[pymethods]
impl Regions {
    #[new]
    fn new(low: PyReadonlyArray1<'_, f64>, high: PyReadonlyArray1<'_, f64>) -> PyResult<Self> {
        let core = Core::new(&numbers(&low), &numbers(&high)).map_err(Failure::into_exception)?;
        Ok(Self { core })
    }

    #[staticmethod]
    fn from_arrays(arrays: HashMap<String, Bound<'_, PyAny>>) -> PyResult<Self> {
        let get = |name: &str| {
            arrays.get(name).ok_or_else(|| PyKeyError::new_err(format!("the array '{name}' is missing")))
        };
        let floats = |name| -> PyResult<Vec<f64>> {
            Ok(get(name)?.extract::<PyReadonlyArray1<'_, f64>>()?.as_array().to_vec())
        };
        let integers = |name| -> PyResult<Vec<i64>> {
            Ok(get(name)?.extract::<PyReadonlyArray1<'_, i64>>()?.as_array().to_vec())
        };
        let parts = Parts {
            low: floats("low")?,
            high: floats("high")?,
            axis: integers("axis")?,
            child: integers("child")?,
        };
        let core = Core::from_parts(&parts).map_err(Failure::into_exception)?;
        Ok(Self { core })
    }

    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (parts, arrays) = (self.core.parts(), PyDict::new(py));
        arrays.set_item("low", vector(py, &parts.low))?;
        arrays.set_item("high", vector(py, &parts.high))?;
        arrays.set_item("axis", integers(py, parts.axis.into_iter()))?;
        arrays.set_item("child", integers(py, parts.child.into_iter()))?;
        Ok(arrays)
    }

    #[getter]
    fn count(&self) -> usize {
        self.core.count()
    }

    #[getter]
    fn leaves<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        integers(py, self.core.leaves().into_iter().map(|leaf| leaf as i64))
    }

    #[getter]
    fn parents<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let parent = |region| self.core.parent(region).map_or(-1, |parent| parent as i64);
        integers(py, (0..self.core.count()).map(parent))
    }

    #[getter]
    fn depths<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        integers(py, (0..self.core.count()).map(|region| self.core.depth(region) as i64))
    }

    #[getter]
    fn low<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let corner = |region| self.core.corners(region).0.to_vec();
        matrix(py, &(0..self.core.count()).flat_map(corner).collect::<Vec<_>>(), self.core.dimensions())
    }

    #[getter]
    fn high<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let corner = |region| self.core.corners(region).1.to_vec();
        matrix(py, &(0..self.core.count()).flat_map(corner).collect::<Vec<_>>(), self.core.dimensions())
    }

    fn find<'py>(
        &self,
        py: Python<'py>,
        features: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let shape = features.shape();
        if shape[1] != self.core.dimensions() {
            let text = format!("features has shape {shape:?}, it must be (n, {})", self.core.dimensions());
            return Err(CoreError::new_err(text));
        }
        let points = numbers(&features);
        let found = quick(py, || self.core.find_all(&points))?;
        Ok(integers(py, found.into_iter().map(|region| region as i64)))
    }

    fn neighbours(&self, leaf: usize) -> PyResult<Vec<usize>> {
        Ok(self.core.neighbours(self.leaf(leaf)?))
    }

    fn halve(&self, leaf: usize, axis: usize) -> PyResult<Self> {
        if axis >= self.core.dimensions() {
            let count = self.core.dimensions();
            return Err(CoreError::new_err(format!("axis is {axis}, there are {count}, counted from 0")));
        }
        let mut core = self.core.clone();
        core.halve(self.leaf(leaf)?, axis);
        Ok(Self { core })
    }

    fn evenly(&self, leaves: usize) -> Self {
        Self { core: self.core.clone().evenly(leaves) }
    }
}

/// CEPs of all regions, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct RegionalFit {
    core: CoreFit,
    width: usize,
}

/// Options of [`regional_ceps`] by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    method: String,
    prior: Option<f64>,
}

impl Options {
    fn core(&self) -> PyResult<Method> {
        match (self.method.as_str(), self.prior) {
            ("least_squares", _) => Ok(Method::LeastSquares),
            ("shrunk", Some(prior)) if !(prior > 0.0 && prior.is_finite()) => {
                Err(CoreError::new_err(format!("prior is {prior} m, it must be a positive length")))
            }
            ("shrunk", prior) => Ok(Method::Shrunk(prior)),
            (other, _) => Err(CoreError::new_err(format!(
                "method is '{other}', it must be 'least_squares' or 'shrunk'"
            ))),
        }
    }
}

/// Estimates the CEPs of every region.
#[pyfunction]
pub fn regional_ceps(
    py: Python<'_>,
    regions: &Regions,
    problem: &IdentificationProblem,
    parameters: PyReadonlyArrayDyn<'_, f64>,
    setup: &Setup,
    features: PyReadonlyArray2<'_, f64>,
    options: Options,
) -> PyResult<RegionalFit> {
    let (parameters, features) = (whole(problem, &parameters)?, numbers(&features));
    let method = options.core()?;
    let core = problem.core();
    let work = || fit(&regions.core, &core, (&parameters, setup.core()), &features, method);
    Ok(RegionalFit { core: quick(py, work)?, width: core.columns.len() })
}

/// One set of parameters for all poses, (5 L,).
pub fn whole(problem: &IdentificationProblem, given: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<f64>> {
    let (values, expected) = (numbers(given), problem.core().chain.parameter_count());
    if values.len() == expected {
        return Ok(values);
    }
    let error = EstimateError::Length { what: "parameters", found: values.len(), expected };
    Err(error.into_exception())
}

/// CEPs of all regions with the mean of the neighbours' where there are none.
#[pyfunction]
pub fn fill_without_data<'py>(
    py: Python<'py>,
    regions: &Regions,
    ceps: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (mut values, width) = (numbers(&ceps), ceps.shape()[1]);
    quick(py, || fill(&regions.core, &mut values))?;
    Ok(matrix(py, &values, width))
}

#[pymethods]
impl RegionalFit {
    #[getter]
    fn ceps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.core.ceps, self.width)
    }

    #[getter]
    fn kappa<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.kappa)
    }

    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        integers(py, self.core.poses.iter().map(|&count| count as i64))
    }

    #[getter]
    fn noise(&self) -> Option<f64> {
        self.core.noise
    }

    #[getter]
    fn prior<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.prior)
    }
}
