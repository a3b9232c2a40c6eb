//! `_core.fit_constant` and its companions: constants, set-up, identifiability, residuals.

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use truearm_estimate::{
    ConstantFit as Core, ConstantOptions, FrameMode, Layout, Linearised, Noise, Point, Prior, Problem,
    Robust, fit_constant as fit, identifiability as identify, linearise as linear,
    non_negative_least_squares as non_negative, residuals as left_over,
};

use crate::arrays::array3;
use crate::chain::Chain;
use crate::door::{CoreError, Failure, quick, with_threads};
use crate::measured::{MeasurementSet, Setup, matrix, vector};

/// What is to be identified from what, see the stub.
#[pyclass(frozen, name = "Problem", module = "truearm._core")]
pub struct IdentificationProblem {
    chain: Py<Chain>,
    measurements: Py<MeasurementSet>,
    columns: Vec<usize>,
    frame: FrameMode,
}

impl IdentificationProblem {
    pub fn core(&self) -> Problem<'_> {
        Problem {
            chain: self.chain.get().core(),
            measurements: self.measurements.get().core(),
            columns: &self.columns,
            frame: self.frame,
        }
    }
}

#[pymethods]
impl IdentificationProblem {
    #[new]
    #[pyo3(signature = (chain, measurements, columns, world_is_known=false))]
    fn new(
        chain: Py<Chain>,
        measurements: Py<MeasurementSet>,
        columns: Vec<usize>,
        world_is_known: bool,
    ) -> PyResult<Self> {
        check_columns(&columns, chain.get().core().parameter_count())?;
        let joints = chain.get().core().joint_count();
        let given = measurements.get().core().joint_count;
        if joints != given {
            return Err(CoreError::new_err(format!(
                "the measurements have {given} joints, the chain has {joints}"
            )));
        }
        let frame = if world_is_known { FrameMode::World } else { FrameMode::Free };
        Ok(Self { chain, measurements, columns, frame })
    }
}

/// Refuses columns that are not ascending indices of so many parameters.
pub fn check_columns(columns: &[usize], count: usize) -> PyResult<()> {
    if columns.is_sorted_by(|a, b| a < b) && columns.iter().all(|&column| column < count) {
        return Ok(());
    }
    let text = format!("columns must be ascending parameter indices below {count}, got {columns:?}");
    Err(CoreError::new_err(text))
}

/// Prior of the corrections: standard deviations of lengths (m) and angles (rad), and whether the evidence scales
/// them.
pub type PriorTuple = (f64, f64, bool);

pub fn prior((length, angle, scaled): PriorTuple) -> PyResult<Prior> {
    if length > 0.0 && angle > 0.0 && length.is_finite() && angle.is_finite() {
        return Ok(Prior { length, angle, scaled });
    }
    Err(CoreError::new_err(format!("the prior is {length} m and {angle} rad, both must be positive numbers")))
}

/// Options of [`fit_constant`] by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options<'py> {
    prior: Option<PriorTuple>,
    noise: Option<(f64, f64)>,
    robust: Option<String>,
    start: Option<Bound<'py, Setup>>,
    parameters: Option<PyReadonlyArrayDyn<'py, f64>>,
    threads: Option<usize>,
}

/// Constants and set-up, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct ConstantFit {
    core: Core,
}

impl ConstantFit {
    pub fn core(&self) -> &Core {
        &self.core
    }
}

/// Fits constants and set-up.
#[pyfunction]
pub fn fit_constant(
    py: Python<'_>,
    problem: &IdentificationProblem,
    options: Options<'_>,
) -> PyResult<ConstantFit> {
    let robust = match options.robust.as_deref() {
        None | Some("none") => None,
        Some("huber") => Some(Robust::Huber),
        Some("cauchy") => Some(Robust::Cauchy),
        Some(other) => {
            return Err(CoreError::new_err(format!(
                "robust is '{other}', it must be 'none', 'huber' or 'cauchy'"
            )));
        }
    };
    let core = ConstantOptions {
        prior: options.prior.map(prior).transpose()?,
        noise: options.noise.map(|(position, orientation)| Noise { position, orientation }),
        robust,
        start: options.start.map(|setup| setup.get().core().clone()),
        parameters: options.parameters.map(|array| array.as_array().iter().copied().collect()),
        ..ConstantOptions::default()
    };
    let work = || with_threads(options.threads, || fit(&problem.core(), &core));
    let core = quick(py, work)?;
    Ok(ConstantFit { core })
}

#[pymethods]
impl ConstantFit {
    /// Absolute link parameters, (L, 5); (n L, 5) where they were given for each pose.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.core.parameters, 5)
    }

    #[getter]
    fn setup(&self) -> Setup {
        Setup::wrap(self.core.setup.clone())
    }

    /// Covariance of all unknowns, (u, u), SI.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let covariance = &self.core.covariance;
        let n = covariance.nrows();
        let values: Vec<f64> = (0..n * n).map(|k| covariance[(k / n, k % n)]).collect();
        matrix(py, &values, n)
    }

    /// Noise of positions (m) and of orientations (rad).
    #[getter]
    fn noise(&self) -> (f64, f64) {
        (self.core.noise.position, self.core.noise.orientation)
    }

    #[getter]
    fn prior_scale(&self) -> f64 {
        self.core.prior_scale
    }

    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.residuals)
    }

    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.weights)
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.core.iterations
    }

    #[getter]
    fn reason(&self) -> String {
        self.core.reason.to_string()
    }
}

/// Undetermined column, the columns it is confounded with and their parts, whether the set-up takes part.
type Confounded = (usize, Vec<(usize, f64)>, bool);

/// Which of the columns the poses determine: determined, undetermined, total rank, condition number.
#[pyfunction]
pub fn identifiability(
    py: Python<'_>,
    problem: &IdentificationProblem,
    parameters: PyReadonlyArrayDyn<'_, f64>,
    setup: &Setup,
) -> PyResult<(Vec<usize>, Vec<Confounded>, usize, f64)> {
    let parameters: Vec<f64> = parameters.as_array().iter().copied().collect();
    let found = quick(py, || identify(&problem.core(), &parameters, setup.core()))?;
    let undetermined = found.undetermined.into_iter();
    let undetermined = undetermined.map(|entry| (entry.column, entry.with, entry.with_setup)).collect();
    Ok((found.determined, undetermined, found.total_rank, found.condition))
}

/// Residuals of all rows, (n, m), or of distances (d, 1), base frame.
#[pyfunction]
pub fn residuals<'py>(
    py: Python<'py>,
    problem: &IdentificationProblem,
    parameters: PyReadonlyArrayDyn<'py, f64>,
    setup: &Setup,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values: Vec<f64> = parameters.as_array().iter().copied().collect();
    let core = problem.core();
    let size = core.chain.parameter_count();
    if values.len() != size && values.len() != size * core.measurements.pose_count() {
        return Err(CoreError::new_err(format!(
            "parameters has shape {:?}, it must hold {size} values, or as many for each pose",
            parameters.shape()
        )));
    }
    let point = Point { parameters: &values, setup: setup.core() };
    let rows = quick(py, || left_over(&core, point))?;
    let width = if core.measurements.is_distances() { 1 } else { core.measurements.rows_per_pose() };
    Ok(matrix(py, &rows, width))
}

/// Derivatives with respect to the problem's columns, (n, m, P), and residuals, (n, m), base frame; set-up held.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub fn linearise<'py>(
    py: Python<'py>,
    problem: &IdentificationProblem,
    parameters: PyReadonlyArrayDyn<'py, f64>,
    setup: &Setup,
) -> PyResult<(Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>)> {
    let rows = linearised(py, problem, &parameters, setup)?;
    let poses = problem.core().measurements.pose_count();
    let shape = (poses, rows.rows, problem.core().columns.len());
    Ok((array3(py, rows.arm, shape)?, matrix(py, &rows.residual, rows.rows)))
}

/// Derivatives with respect to the unknowns of each pose's own set-up, (n, m, W), base frame.
#[pyfunction]
pub fn setup_jacobian<'py>(
    py: Python<'py>,
    problem: &IdentificationProblem,
    parameters: PyReadonlyArrayDyn<'py, f64>,
    setup: &Setup,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let rows = linearised(py, problem, &parameters, setup)?;
    let width = Layout::new(&problem.core()).group_width();
    array3(py, rows.setup, (problem.core().measurements.pose_count(), rows.rows, width))
}

/// The set-up after a step (G, W) of its unknowns.
#[pyfunction]
pub fn step_setup(
    problem: &IdentificationProblem,
    setup: &Setup,
    step: PyReadonlyArray2<'_, f64>,
) -> PyResult<Setup> {
    let core = problem.core();
    let layout = Layout::new(&core);
    setup.core().check_steps(&layout).map_err(Failure::into_exception)?;
    let wanted = [layout.groups, layout.group_width()];
    if step.shape() != wanted {
        let shape = step.shape();
        return Err(CoreError::new_err(format!(
            "step has shape {shape:?}, it must be {wanted:?} for {} groups",
            layout.groups
        )));
    }
    let mut all = vec![0.0; layout.len()];
    step.as_array().iter().zip(&mut all[layout.arm..]).for_each(|(value, place)| *place = *value);
    Ok(Setup::wrap(layout.step_setup(setup.core(), &all)))
}

fn linearised(
    py: Python<'_>,
    problem: &IdentificationProblem,
    parameters: &PyReadonlyArrayDyn<'_, f64>,
    setup: &Setup,
) -> PyResult<Linearised> {
    let values: Vec<f64> = parameters.as_array().iter().copied().collect();
    let core = problem.core();
    let (size, poses) = (core.chain.parameter_count(), core.measurements.pose_count());
    if values.len() != size && values.len() != size * poses || core.measurements.is_distances() {
        return Err(CoreError::new_err(format!(
            "parameters has shape {:?}, it must hold {size} values, or as many for each pose, of points or poses",
            parameters.shape()
        )));
    }
    let point = Point { parameters: &values, setup: setup.core() };
    quick(py, || linear(&core, point))
}

/// Unknowns that are not negative, see the stub.
#[pyfunction]
pub fn non_negative_least_squares<'py>(
    py: Python<'py>,
    columns: PyReadonlyArray2<'py, f64>,
    target: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (count, target) = (columns.shape()[1], target.as_array().to_vec());
    let columns: Vec<f64> = columns.as_array().iter().copied().collect();
    Ok(quick(py, || non_negative(&columns, count, &target))?.into_pyarray(py))
}
