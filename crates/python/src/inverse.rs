//! `_core.Inverse`: all inverse kinematics of a plain arm.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use truearm_inverse::{Arm, Inverse as Core, Method, Readings};
use truearm_kinematics::{Joint, Transform};

use crate::chain::Chain;
use crate::door::{CoreError, Failure, in_parts, quick};

type Rows<'py> = PyReadonlyArray2<'py, f64>;
/// Whether the wrist is in front, the elbow up, and the wrist flipped.
type Sides = (bool, bool, Option<bool>);

/// Inverse kinematics, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Inverse {
    core: Core,
    joints: usize,
}

#[pymethods]
impl Inverse {
    #[new]
    fn new(chain: &Chain, coupling: Rows<'_>, back: Rows<'_>, limits: Rows<'_>) -> PyResult<Self> {
        let chain = chain.core().clone();
        let links = chain.links().iter().filter(|link| link.joint != Joint::Fixed);
        let revolute: Vec<bool> = links.map(|link| link.joint == Joint::Revolute).collect();
        let limits = values(&limits).as_chunks::<2>().0.to_vec();
        let readings = Readings::new(values(&coupling), values(&back), limits, &revolute);
        let core = readings.and_then(|readings| Core::new(Arm { chain, readings }));
        Ok(Self { core: core.map_err(Failure::into_exception)?, joints: revolute.len() })
    }

    #[getter]
    fn method(&self) -> &'static str {
        match self.core.method() {
            Method::SphericalWrist => "spherical wrist",
            Method::ThreeParallel => "three parallel axes",
            Method::Numeric => "numeric",
        }
    }

    #[pyo3(signature = (target, turns=false))]
    fn solutions<'py>(
        &self,
        py: Python<'py>,
        target: Rows<'py>,
        turns: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let target = one_transform(&values(&target))?;
        let found = quick(py, || self.core.solutions(&target, turns))?;
        array(py, &found, self.joints)
    }

    fn all<'py>(
        &self,
        py: Python<'py>,
        targets: PyReadonlyArray3<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Vec<usize>)> {
        let targets = transforms(&targets)?;
        let found = in_parts(py, targets.len(), AT_ONCE, |part| self.core.all(&targets[part]))?;
        let counts = found.iter().map(Vec::len).collect();
        Ok((array(py, &found.concat(), self.joints)?, counts))
    }

    fn near<'py>(
        &self,
        py: Python<'py>,
        targets: PyReadonlyArray3<'py, f64>,
        seeds: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let targets = transforms(&targets)?;
        let seeds = values(&seeds);
        let whole = targets.len();
        let found = if seeds.len() == whole * self.joints {
            in_parts(py, whole, AT_ONCE, |part| {
                let seeds = &seeds[part.start * self.joints..part.end * self.joints];
                self.core.near(&targets[part], seeds)
            })
        } else {
            quick(py, || self.core.near(&targets, &seeds))
        }?;
        let none = vec![f64::NAN; self.joints];
        let rows: Vec<Vec<f64>> = found.into_iter().map(|row| row.unwrap_or_else(|| none.clone())).collect();
        array(py, &rows, self.joints)
    }

    fn branches(&self, readings: Rows<'_>) -> PyResult<Vec<Option<Sides>>> {
        let shape = readings.shape();
        if shape[1] != self.joints {
            let text = format!("readings have shape {shape:?}, it must be (n, {})", self.joints);
            return Err(CoreError::new_err(text));
        }
        let rows = values(&readings);
        let sides = |row: &[f64]| self.core.branch(row).map(|branch| (branch.front, branch.up, branch.flip));
        Ok(rows.chunks_exact(self.joints).map(sides).collect())
    }
}

/// Targets that are solved between two looks at the signals.
const AT_ONCE: usize = 256;

fn values(rows: &Rows<'_>) -> Vec<f64> {
    rows.as_array().iter().copied().collect()
}

fn transforms(targets: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Transform>> {
    let shape = targets.shape();
    if shape[1..] != [4, 4] {
        return Err(CoreError::new_err(format!("targets has shape {shape:?}, it must be (n, 4, 4)")));
    }
    let numbers: Vec<f64> = targets.as_array().iter().copied().collect();
    numbers.chunks(16).map(one_transform).collect()
}

fn one_transform(numbers: &[f64]) -> PyResult<Transform> {
    let matrix: &[f64; 16] = numbers.try_into().map_err(|_| {
        CoreError::new_err(format!("a target has {} numbers, it must be (4, 4)", numbers.len()))
    })?;
    let target = Transform::from_matrix(matrix);
    target.check("target").map_err(Failure::into_exception)?;
    Ok(target)
}

fn array<'py>(py: Python<'py>, rows: &[Vec<f64>], joints: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let out = PyArray2::zeros(py, [rows.len(), joints], false);
    {
        let mut borrowed = out.try_readwrite().map_err(|error| CoreError::new_err(error.to_string()))?;
        for (mut to, from) in borrowed.as_array_mut().rows_mut().into_iter().zip(rows) {
            for (place, value) in to.iter_mut().zip(from) {
                *place = *value;
            }
        }
    }
    Ok(out)
}
