//! `_core.fit_field`, `_core.Field` and `_core.Posterior`: CEPs that vary.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use truearm_bank::{Bank, Compiled, Input, Levers, UPRIGHT};
use truearm_estimate::Point;
use truearm_field::{
    Begin, Drives, FieldError, FieldFit as CoreFit, FieldOptions, Posterior as CorePosterior,
    fit_field as fit, measurement_covariance, restore,
};
use truearm_kinematics::Cancel;

use crate::arrays::{array3, lent};
use crate::asked::{Asked, Copies};
use crate::blocks::{block_from, block_into, sag_into, up_of};
use crate::chain::Chain;
use crate::door::{CoreError, Failure, in_parts, long, quick, with_threads};
use crate::estimate::{ConstantFit, IdentificationProblem, PriorTuple, prior};
use crate::hyper::{hyper_from, hyper_into};
use crate::measured::{Setup, matrix, vector};

/// Options of [`fit_field`] by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options<'py> {
    determined: Vec<usize>,
    driven: Vec<usize>,
    features: PyReadonlyArray2<'py, f64>,
    feature_ranges: Vec<f64>,
    payloads: Vec<usize>,
    coupling: PyReadonlyArray2<'py, f64>,
    degree: usize,
    prior: PriorTuple,
    hyper: Option<HashMap<String, Vec<f64>>>,
    near: Option<PyRef<'py, FieldFit>>,
    contested: bool,
    rough: bool,
    threads: Option<usize>,
}

impl Options<'_> {
    fn core(&self, problem: &IdentificationProblem, cancel: Cancel) -> PyResult<FieldOptions> {
        let problem = problem.core();
        let (count, shape) = (problem.chain.joint_count(), self.coupling.as_array().dim());
        if shape != (count, count) {
            let (rows, columns) = shape;
            return Err(CoreError::new_err(format!(
                "the coupling has shape ({rows}, {columns}), it must be ({count}, {count}): a row of each joint, a column of each reading"
            )));
        }
        Ok(FieldOptions {
            degree: self.degree,
            prior: prior(self.prior)?,
            determined: self.determined.clone(),
            driven: self.driven.clone(),
            features: self.feature_ranges.iter().map(|&r| Input::line(r)).collect(),
            payloads: self.payloads.clone(),
            feature_values: self.features.as_array().iter().copied().collect(),
            drives: Drives::of(&lent(&self.coupling), |joint| problem.chain.slides(joint)),
            begin: self.begin()?,
            rough: self.rough,
            cancel,
        })
    }

    fn begin(&self) -> PyResult<Begin> {
        let near = self.near.as_ref().map(|fit| fit.core.start());
        match (&self.hyper, near, self.contested) {
            (None, None, false) => Ok(Begin::Anew),
            (Some(hyper), None, false) => Ok(Begin::Known(hyper_from(hyper)?)),
            (None, Some(start), false) => Ok(Begin::Near(start)),
            (None, Some(start), true) => Ok(Begin::Contested(start)),
            _ => Err(CoreError::new_err(
                "hyper, near and contested contradict each other: give hyper alone, near alone, or near and contested",
            )),
        }
    }
}

/// A variable calibration, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct FieldFit {
    core: Arc<CoreFit>,
    rows: usize,
}

/// Fits constants, field and set-up together.
#[pyfunction]
pub fn fit_field(
    py: Python<'_>,
    problem: &IdentificationProblem,
    constant: &ConstantFit,
    options: Options<'_>,
) -> PyResult<FieldFit> {
    let mut core = options.core(problem, Cancel::default())?;
    let threads = options.threads;
    let core = long(py, move |cancel| {
        core.cancel = cancel.clone();
        with_threads(threads, || fit(&problem.core(), constant.core(), &core))
    })?;
    let rows = problem.core().measurements.rows_per_pose();
    Ok(FieldFit { core: Arc::new(core), rows })
}

#[pymethods]
impl FieldFit {
    /// Constants: absolute link parameters, (L, 5).
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.core.parameters, 5)
    }

    #[getter]
    fn field(&self) -> Field {
        Field::wrap(self.core.bank.clone())
    }

    #[getter]
    fn setup(&self) -> Setup {
        Setup::wrap(self.core.setup.clone())
    }

    #[getter]
    fn hyper(&self) -> BTreeMap<String, Vec<f64>> {
        hyper_into(&self.core.hyper)
    }

    #[getter]
    fn evidence(&self) -> f64 {
        self.core.evidence
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.core.evaluations
    }

    /// Residuals of all rows, (n, m), base frame.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.core.residuals, self.rows)
    }

    /// Each pose's squared standardised leave-one-out residual over the squared limit, (n,).
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.judgement.score)
    }

    /// Length of each pose's leave-one-out residual, (n,), m.
    #[getter]
    fn distances<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.judgement.distance)
    }

    #[getter]
    fn inflation(&self) -> f64 {
        self.core.judgement.inflation
    }

    /// Weight of each pose in the fit, (n,).
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.weights)
    }

    /// Covariance (P, P) of the constants of the problem's columns alone.
    #[getter]
    fn constant_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let posterior = &self.core.posterior;
        let values = quick(py, || Ok::<_, FieldError>(posterior.constants()))?;
        Ok(matrix(py, &values, posterior.training().column_count()))
    }

    /// Poses that were judged but not fitted.
    #[getter]
    fn stood_aside(&self) -> usize {
        self.core.stood_aside
    }

    /// What the rows leave uncertain: the posterior under widened amplitudes.
    #[getter]
    fn posterior(&self) -> Posterior {
        Posterior { held: Held::Fitted(Arc::clone(&self.core)) }
    }

    /// Poses taken out of the fit.
    #[getter]
    fn outliers(&self) -> Vec<usize> {
        self.core.judgement.outliers.clone()
    }
}

/// A bank of blocks, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Field {
    core: Bank,
    compiled: Compiled,
}

impl Field {
    /// The field prepared for evaluation, for the other bindings.
    pub fn compiled(&self) -> &Compiled {
        &self.compiled
    }

    fn wrap(core: Bank) -> Self {
        let compiled = core.compiled();
        Self { core, compiled }
    }
}

#[pymethods]
impl Field {
    #[new]
    fn new(
        input_count: usize,
        parameter_count: usize,
        blocks: Vec<Bound<'_, PyDict>>,
        nominal: &Chain,
    ) -> PyResult<Self> {
        let up = blocks.iter().find_map(|block| up_of(block).transpose()).unwrap_or(Ok(UPRIGHT))?;
        let blocks = blocks.iter().map(block_from).collect::<PyResult<_>>()?;
        let levers = Levers::new(nominal.core()).along(up).map_err(Failure::into_exception)?;
        let core = Bank::restored(input_count, parameter_count, blocks, levers);
        Ok(Self::wrap(core.map_err(Failure::into_exception)?))
    }

    #[getter]
    fn input_count(&self) -> usize {
        self.core.input_count
    }

    #[getter]
    fn parameter_count(&self) -> usize {
        self.core.parameter_count
    }

    #[getter]
    fn cell_count(&self) -> usize {
        self.core.cell_count()
    }

    /// The blocks as dictionaries.
    fn blocks<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let mut stored = Vec::with_capacity(self.core.blocks.len() + 1);
        for block in &self.core.blocks {
            stored.push(block_into(py, block)?);
        }
        if let Some(sag) = &self.core.sag {
            stored.push(sag_into(py, sag)?);
        }
        Ok(stored)
    }

    /// Absolute parameters (n, L, 5): `constants` (L, 5) plus the CEPs of the inputs (n, I).
    fn parameters<'py>(
        &self,
        py: Python<'py>,
        inputs: PyReadonlyArray2<'py, f64>,
        constants: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let width = self.core.parameter_count;
        let (poses, count) = (inputs.shape()[0], inputs.shape()[1]);
        if count != self.core.input_count || constants.len() != width {
            return Err(CoreError::new_err(format!(
                "the field takes {} inputs and {} parameters, got {count} and {}",
                self.core.input_count,
                width,
                constants.len()
            )));
        }
        let (start, inputs) = (lent(&constants), lent(&inputs));
        let values = if poses < HELD_POSES {
            self.compiled.parameters(&start, &inputs).map_err(Failure::into_exception)
        } else {
            quick(py, || self.compiled.parameters(&start, &inputs))
        }?;
        array3(py, values, (poses, width / 5, 5))
    }
}

/// Below this many poses letting other Python threads run costs more than the work.
const HELD_POSES: usize = 64;

/// Standard deviations of a calibration, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Posterior {
    held: Held,
}

/// Who owns a posterior.
enum Held {
    Alone(Box<CorePosterior>),
    Fitted(Arc<CoreFit>),
}

impl Posterior {
    fn core(&self) -> &CorePosterior {
        match &self.held {
            Held::Alone(core) => core,
            Held::Fitted(fit) => fit.spread(),
        }
    }
}

/// Configurations whose covariances are found between two looks at the signals; a multiple of the core's own batches.
const AT_ONCE: usize = 512;

#[pymethods]
impl Posterior {
    #[new]
    fn new(
        py: Python<'_>,
        problem: &IdentificationProblem,
        parameters: PyReadonlyArray2<'_, f64>,
        setup: &Setup,
        options: Options<'_>,
    ) -> PyResult<Self> {
        let values: Vec<f64> = parameters.as_array().iter().copied().collect();
        let mut known = options.core(problem, Cancel::default())?;
        let Begin::Known(hyper) = known.begin.clone() else {
            return Err(CoreError::new_err("a posterior needs the fitted hyper-parameters"));
        };
        let threads = options.threads;
        let core = long(py, move |cancel| {
            known.cancel = cancel.clone();
            let point = Point { parameters: &values, setup: setup.core() };
            with_threads(threads, || restore(&problem.core(), point, &known, hyper))
        })?;
        Ok(Self { held: Held::Alone(Box::new(core)) })
    }

    /// Covariance (n, m, m) of the residuals of new measurements, base frame, see the stub.
    fn measurement_covariance<'py>(
        &self,
        py: Python<'py>,
        problem: &IdentificationProblem,
        parameters: PyReadonlyArrayDyn<'py, f64>,
        setup: &Setup,
        inputs: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let core = problem.core();
        let parameters: Vec<f64> = parameters.as_array().iter().copied().collect();
        let inputs: Vec<f64> = inputs.as_array().iter().copied().collect();
        let point = Point { parameters: &parameters, setup: setup.core() };
        let values = quick(py, || measurement_covariance(self.core(), &core, point, &inputs))?;
        let rows = core.measurements.rows_per_pose();
        array3(py, values, (core.measurements.pose_count(), rows, rows))
    }

    /// Variances (n, m) of `jacobian CEP` before any measurement, for inputs (n, I) and Jacobians (n, m, P).
    fn prior<'py>(
        &self,
        py: Python<'py>,
        inputs: PyReadonlyArray2<'py, f64>,
        jacobian: PyReadonlyArray3<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = jacobian.shape()[1];
        let copies = Copies::of(self.core(), &inputs, &jacobian, None)?;
        let asked = copies.asked();
        let values = in_parts(py, asked.poses, AT_ONCE, |part| {
            let Asked { inputs, jacobian, .. } = asked.part(&part);
            self.core().prior(inputs, jacobian, rows)
        })?;
        Ok(matrix(py, &values, rows))
    }

    /// Covariance (n, m, m) of `jacobian CEP` (+ `setup s` where set-up columns (n, m, s) are given) for inputs (n, I) and Jacobians (n, m, P) by the problem's columns.
    #[pyo3(signature = (inputs, jacobian, setup=None))]
    fn covariance<'py>(
        &self,
        py: Python<'py>,
        inputs: PyReadonlyArray2<'py, f64>,
        jacobian: PyReadonlyArray3<'py, f64>,
        setup: Option<PyReadonlyArray3<'py, f64>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (poses, rows) = (jacobian.shape()[0], jacobian.shape()[1]);
        let copies = Copies::of(self.core(), &inputs, &jacobian, setup.as_ref())?;
        let asked = copies.asked();
        let values = in_parts(py, asked.poses, AT_ONCE, |part| {
            let Asked { inputs, jacobian, setup, .. } = asked.part(&part);
            self.core().covariance(inputs, jacobian, setup, rows)
        })?;
        array3(py, values, (poses, rows, rows))
    }

    /// Covariance (n m, n m) of the rows of all configurations with one another; arguments as for `covariance`.
    #[pyo3(signature = (inputs, jacobian, setup=None))]
    fn joint_covariance<'py>(
        &self,
        py: Python<'py>,
        inputs: PyReadonlyArray2<'py, f64>,
        jacobian: PyReadonlyArray3<'py, f64>,
        setup: Option<PyReadonlyArray3<'py, f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (poses, rows) = (jacobian.shape()[0], jacobian.shape()[1]);
        let copies = Copies::of(self.core(), &inputs, &jacobian, setup.as_ref())?;
        let Asked { inputs, jacobian, setup, .. } = copies.asked();
        let values = quick(py, || self.core().joint_covariance(inputs, jacobian, setup, rows))?;
        Ok(matrix(py, &values, poses * rows))
    }

    /// Covariance (k m, (n - k) m) of the rows of the first k configurations with those of the others; arguments as for `covariance`.
    #[pyo3(signature = (first, inputs, jacobian, setup=None))]
    fn cross_covariance<'py>(
        &self,
        py: Python<'py>,
        first: usize,
        inputs: PyReadonlyArray2<'py, f64>,
        jacobian: PyReadonlyArray3<'py, f64>,
        setup: Option<PyReadonlyArray3<'py, f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (poses, rows) = (jacobian.shape()[0], jacobian.shape()[1]);
        let copies = Copies::of(self.core(), &inputs, &jacobian, setup.as_ref())?;
        let Asked { inputs, jacobian, setup, .. } = copies.asked();
        let found = quick(py, || self.core().cross_covariance(first, inputs, jacobian, setup, rows))?;
        Ok(matrix(py, &found, (poses - first) * rows))
    }

    /// Variance of what shots of a pose differ by beside what they state, of positions and of orientations, (2,).
    #[getter]
    fn shot_variance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core().training().shot)
    }

    /// For each of the first `count` residuals the place of the first one of its pose, see the stub.
    fn first_shots<'py>(&self, py: Python<'py>, count: usize) -> Bound<'py, PyArray1<usize>> {
        self.core().training().first_shots(count).into_pyarray(py)
    }

    /// Covariance (n, m, m) of what joints do not repeat, carried to rows of Jacobians (n, m, P).
    fn repeatability<'py>(
        &self,
        py: Python<'py>,
        jacobian: PyReadonlyArray3<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (poses, rows) = (jacobian.shape()[0], jacobian.shape()[1]);
        let entries: Vec<f64> = jacobian.as_array().iter().copied().collect();
        let columns = self.core().training().column_count();
        if jacobian.shape()[2] != columns {
            return Err(CoreError::new_err(format!(
                "jacobian has {} columns, the posterior {columns}",
                jacobian.shape()[2]
            )));
        }
        let values = quick(py, || self.core().repeatability(&entries, rows))?;
        array3(py, values, (poses, rows, rows))
    }
}
