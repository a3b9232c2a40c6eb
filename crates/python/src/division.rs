//! `_core.divide` and `_core.divide_rows`: the recursive workspace division.

use numpy::{
    PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use truearm_estimate::MeasurementSet as CoreSet;
use truearm_field::FieldError;
use truearm_field::regions::{
    Active, Arm, Candidates, Division as Core, DivisionOptions, Halving, Order, PoseOptions, Recorded,
    Workspace, divide as divide_source,
};

use crate::arrays::{numbers, unknown};
use crate::chain::Chain;
use crate::choice::criterion;
use crate::door::{CoreError, Failure, quick};
use crate::estimate::{IdentificationProblem, check_columns};
use crate::measured::{MeasurementSet, Setup, matrix, vector};
use crate::regions::{Regions, whole};

/// Options of a division by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options<'py> {
    low: PyReadonlyArray1<'py, f64>,
    high: PyReadonlyArray1<'py, f64>,
    accuracy: f64,
    regions: usize,
    halving: String,
    order: String,
    poses: usize,
    limit: f64,
    seed: u64,
}

impl Options<'_> {
    fn core(&self) -> PyResult<DivisionOptions> {
        let halving = match self.halving.as_str() {
            "longest" => Halving::Longest,
            "best" => Halving::Best,
            other => return Err(unknown("halving", other, "'longest' or 'best'")),
        };
        let order = match self.order.as_str() {
            "worst" => Order::Worst,
            "breadth" => Order::Breadth,
            other => return Err(unknown("order", other, "'worst' or 'breadth'")),
        };
        if self.accuracy.is_nan() || self.accuracy < 0.0 || self.regions == 0 || self.poses == 0 {
            return Err(CoreError::new_err(format!(
                "accuracy is {} m with {} regions of {} poses: an accuracy is zero or more, counts are 1 or more",
                self.accuracy, self.regions, self.poses
            )));
        }
        let (accuracy, regions, seed) = (self.accuracy, self.regions, self.seed);
        Ok(DivisionOptions { accuracy, regions, halving, order, seed })
    }
}

/// Options of active mode alone.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Measuring {
    candidates: usize,
    tests: usize,
    criterion: String,
    passes: usize,
    orientation: bool,
}

/// What stops a division: the core, or what a callable raised.
pub enum Stopped {
    Python(PyErr),
    Field(FieldError),
}

impl From<FieldError> for Stopped {
    fn from(error: FieldError) -> Self {
        Stopped::Field(error)
    }
}

impl From<PyErr> for Stopped {
    fn from(error: PyErr) -> Self {
        Stopped::Python(error)
    }
}

impl Failure for Stopped {
    fn into_exception(self) -> PyErr {
        match self {
            Stopped::Python(raised) => raised,
            Stopped::Field(error) => error.into_exception(),
        }
    }
}

/// A Python object with the methods `candidates` and `measure`, called on the thread that called us.
struct Callable<'a> {
    object: &'a Py<PyAny>,
    joints: usize,
}

impl Workspace for Callable<'_> {
    type Error = Stopped;

    fn candidates(
        &mut self,
        low: &[f64],
        high: &[f64],
        count: usize,
        seed: u64,
    ) -> Result<Candidates, Stopped> {
        Python::attach(|py| {
            let arguments = (PyArray1::from_slice(py, low), PyArray1::from_slice(py, high), count, seed);
            let found = self.object.bind(py).call_method1("candidates", arguments)?;
            let (q, features): (PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, f64>) = found.extract()?;
            let fits = q.shape()[1] == self.joints && features.shape() == [q.shape()[0], low.len()];
            if !fits {
                return Err(Stopped::Python(CoreError::new_err(format!(
                    "candidates gave shapes {:?} and {:?}, they must be (k, {}) and (k, {})",
                    q.shape(),
                    features.shape(),
                    self.joints,
                    low.len()
                ))));
            }
            Ok(Candidates { joints: numbers(&q), features: numbers(&features) })
        })
    }

    fn measure(&mut self, joints: &[f64]) -> Result<CoreSet, Stopped> {
        Python::attach(|py| {
            py.check_signals()?;
            let q = matrix(py, joints, self.joints);
            let set = self.object.bind(py).call_method1("measure", (q,))?;
            let set: Bound<'_, MeasurementSet> = set.extract().map_err(PyErr::from)?;
            Ok(set.get().core().clone())
        })
    }
}

/// A divided workspace, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Division {
    core: Core,
    width: usize,
}

/// Divides a workspace that is measured on demand.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the arm, its set-up, where it is measured, and how")]
pub fn divide(
    py: Python<'_>,
    chain: &Chain,
    columns: Vec<usize>,
    parameters: PyReadonlyArrayDyn<'_, f64>,
    setup: &Setup,
    workspace: Py<PyAny>,
    options: Options<'_>,
    measuring: Measuring,
) -> PyResult<Division> {
    let how = options.core()?;
    let parameters = numbers(&parameters);
    let all = chain.core().parameter_count();
    check_columns(&columns, all)?;
    if parameters.len() != all {
        let text = format!("parameters must hold {all} values, got {}", parameters.len());
        return Err(CoreError::new_err(text));
    }
    let (low, high, poses, limit) =
        (numbers(&options.low), numbers(&options.high), options.poses, options.limit);
    let by = criterion(&measuring.criterion)?;
    let arm = Arm { chain: chain.core(), columns: &columns, parameters: &parameters, setup: setup.core() };
    let mut source = Active {
        chain: arm.chain,
        columns: arm.columns,
        parameters: arm.parameters,
        setup: arm.setup,
        workspace: Callable { object: &workspace, joints: chain.core().joint_count() },
        options: PoseOptions {
            poses,
            candidates: measuring.candidates,
            tests: measuring.tests,
            limit,
            criterion: by,
            passes: measuring.passes,
            orientation: measuring.orientation,
        },
    };
    let core = quick(py, || divide_source(&arm, &mut source, (&low, &high), &how))?;
    Ok(Division { core, width: columns.len() })
}

/// Divides a workspace by measurements that were made already.
#[pyfunction]
pub fn divide_rows(
    py: Python<'_>,
    problem: &IdentificationProblem,
    parameters: PyReadonlyArrayDyn<'_, f64>,
    setup: &Setup,
    features: PyReadonlyArray2<'_, f64>,
    judges: PyReadonlyArray1<'_, bool>,
    options: Options<'_>,
) -> PyResult<Division> {
    let how = options.core()?;
    let (parameters, features) = (whole(problem, &parameters)?, numbers(&features));
    let (low, high, judges) = (numbers(&options.low), numbers(&options.high), judges.as_array().to_vec());
    let problem = problem.core();
    let poses = problem.measurements.pose_count();
    if judges.len() != poses || features.len() != poses * low.len() {
        return Err(CoreError::new_err(format!(
            "features must be ({poses}, {}) and judges ({poses},), got {} and {} values",
            low.len(),
            features.len(),
            judges.len()
        )));
    }
    if let Some(at) = features.iter().position(|value| !value.is_finite()) {
        let text = format!("a feature of row {} (counted from 0) is not finite", at / low.len());
        return Err(CoreError::new_err(text));
    }
    let arm =
        Arm { chain: problem.chain, columns: problem.columns, parameters: &parameters, setup: setup.core() };
    let mut source = Recorded {
        problem,
        parameters: &parameters,
        setup: setup.core(),
        features: &features,
        judges: &judges,
        poses: options.poses,
        limit: options.limit,
        corners: (&low, &high),
    };
    let core = quick(py, || divide_source(&arm, &mut source, (&low, &high), &how))?;
    Ok(Division { core, width: problem.columns.len() })
}

#[pymethods]
impl Division {
    #[getter]
    fn regions(&self) -> Regions {
        Regions::wrap(self.core.regions.clone())
    }

    #[getter]
    fn ceps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        matrix(py, &self.core.ceps, self.width)
    }

    #[getter]
    fn kappa<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.kappa)
    }

    #[getter]
    fn error<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, &self.core.error)
    }

    /// Why each region is a leaf; nothing for those that are halved.
    #[getter]
    fn ended(&self) -> Vec<Option<String>> {
        self.core.ended.iter().map(|ended| ended.map(|reason| reason.to_string())).collect()
    }

    /// Region, number of poses and whether they are test points, in the order of measuring.
    #[getter]
    fn batches(&self) -> Vec<(usize, usize, bool)> {
        self.core.batches.clone()
    }

    #[getter]
    fn measurements(&self) -> usize {
        self.core.measurements()
    }
}
