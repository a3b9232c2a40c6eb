//! `_core.ArmModel`, `_core.Corrector` and `_core.Solver`: joints to command.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::ndarray::{Array2, ArrayView2};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use truearm_compensate::{
    CompensateError, ConstantSpread, Corrector as Core, Inverse, Limits, Model, NUMBERS, Options, Path,
    Refusal, Run, Solved, Spread, Task, Workspace,
};

use crate::chain::{Chain, contiguous, transform};
use crate::conservative::Conservative;
use crate::door::{CoreError, Failure, long, quick};
use crate::field::Field;

/// So many waypoints are done before anybody thinks of Ctrl-C.
const QUICK: usize = 20_000;

/// An arm as somebody believes it to be, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct ArmModel {
    core: Arc<Model>,
}

#[pymethods]
impl ArmModel {
    #[new]
    #[pyo3(signature = (chain, constants, coupling, field=None, feature_count=0, covariance=None, bounds=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of a Python call")]
    fn new(
        chain: &Chain,
        constants: PyReadonlyArray2<'_, f64>,
        coupling: PyReadonlyArray2<'_, f64>,
        field: Option<&Field>,
        feature_count: usize,
        covariance: Option<(Vec<usize>, PyReadonlyArray2<'_, f64>)>,
        bounds: Option<&Conservative>,
    ) -> PyResult<Self> {
        let numbers = |array: ArrayView2<'_, f64>| array.iter().copied().collect::<Vec<f64>>();
        let (constants, coupling) = (numbers(constants.as_array()), numbers(coupling.as_array()));
        let made = Model::new(chain.core().clone(), &constants, &coupling).and_then(|model| match field {
            Some(field) => model.with_field(field.compiled().clone(), feature_count),
            None => Ok(model),
        });
        let made = made.and_then(|model| match covariance {
            Some((columns, values)) => {
                let spread = ConstantSpread::new(columns, &numbers(values.as_array()))?;
                model.with_spread(Spread::Constant(spread))
            }
            None => Ok(model),
        });
        let made = made.and_then(|model| match bounds {
            Some(bounds) => model.with_spread(Spread::Field(Box::new(bounds.core().clone()))),
            None => Ok(model),
        });
        Ok(Self { core: Arc::new(made.map_err(Failure::into_exception)?) })
    }
}

/// Options by keyword; SI, infinity for no bound.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Keywords<'py> {
    task: String,
    moving: Option<Vec<usize>>,
    joints: PyReadonlyArray2<'py, f64>,
    largest_angle: f64,
    largest_slide: f64,
    largest_shift: f64,
    largest_turn: f64,
    largest_std: f64,
    shift_change: f64,
    turn_change: f64,
    residual: f64,
    residual_turn: f64,
}

impl Keywords<'_> {
    fn core(&self) -> PyResult<Options> {
        let task = match self.task.as_str() {
            "pose" => Task::Pose,
            "axis" => Task::Axis,
            "position" => Task::Position,
            other => {
                let text = format!("task is '{other}', it must be 'pose', 'axis' or 'position'");
                return Err(CoreError::new_err(text));
            }
        };
        let shape = self.joints.shape();
        if shape[1] != 2 {
            let text = format!("joints has shape {shape:?}, it must be (N, 2): lowest and highest readings");
            return Err(CoreError::new_err(text));
        }
        let limits = Limits {
            joints: self.joints.as_array().outer_iter().map(|row| [row[0], row[1]]).collect(),
            largest_angle: self.largest_angle,
            largest_slide: self.largest_slide,
            largest_shift: self.largest_shift,
            largest_turn: self.largest_turn,
            largest_std: self.largest_std,
            shift_change: self.shift_change,
            turn_change: self.turn_change,
            residual: self.residual,
            residual_turn: self.residual_turn,
        };
        Ok(Options { task, moving: self.moving.clone(), limits })
    }
}

type Array<'py> = Bound<'py, PyArray2<f64>>;
/// Number of a reason, and the sentence.
type Told = (u32, String);
/// Index from 0, number of the reason, and the sentence.
type Refused = (usize, u32, String);

fn told((place, refusal): (usize, Refusal)) -> Refused {
    (place, refusal.reason as u32, refusal.to_string())
}

/// Corrects readings, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Corrector {
    core: Core,
    /// For single waypoints, which take less time than the memory for them.
    workspace: Mutex<Workspace>,
}

impl Corrector {
    fn wrap(core: Core) -> Self {
        Self { workspace: Mutex::new(core.workspace()), core }
    }

    /// The corrector itself, for the other bindings.
    pub fn core(&self) -> &Core {
        &self.core
    }
}

#[pymethods]
impl Corrector {
    #[new]
    fn new(
        calibrated: &ArmModel,
        programming: &ArmModel,
        tool: PyReadonlyArray2<'_, f64>,
        options: Keywords<'_>,
    ) -> PyResult<Self> {
        let tool = transform("tool", &tool)?;
        let (calibrated, programming) = (Arc::clone(&calibrated.core), Arc::clone(&programming.core));
        let core = Core::new(calibrated, programming, &tool, options.core()?);
        Ok(Self::wrap(core.map_err(Failure::into_exception)?))
    }

    /// The bounds where nothing is stated, but for those of joints.
    #[staticmethod]
    fn usual() -> BTreeMap<&'static str, f64> {
        let usual = Limits::default();
        BTreeMap::from([
            ("largest_angle", usual.largest_angle),
            ("largest_slide", usual.largest_slide),
            ("largest_shift", usual.largest_shift),
            ("largest_turn", usual.largest_turn),
            ("largest_std", Limits::LARGEST_STD),
            ("shift_change", usual.shift_change),
            ("turn_change", usual.turn_change),
            ("residual", usual.residual),
            ("residual_turn", usual.residual_turn),
        ])
    }

    /// Corrected readings (n, N), numbers (n, 5), refusals.
    #[pyo3(signature = (readings, features, threads=None))]
    fn path<'py>(
        &self,
        py: Python<'py>,
        readings: PyReadonlyArray2<'py, f64>,
        features: Vec<f64>,
        threads: Option<NonZeroUsize>,
    ) -> PyResult<(Array<'py>, Array<'py>, Vec<Refused>)> {
        let (rows, width) = (readings.shape()[0], readings.shape()[1]);
        let values = contiguous("readings", &readings)?;
        let corrected = PyArray2::<f64>::zeros(py, (rows, width), false);
        let numbers = PyArray2::<f64>::zeros(py, (rows, NUMBERS), false);
        let refused = {
            let (mut corrected, mut numbers) = (corrected.readwrite(), numbers.readwrite());
            let out = Path { readings: corrected.as_slice_mut()?, numbers: numbers.as_slice_mut()? };
            interruptible(py, rows, threads, move |run| self.core.correct_path(values, &features, out, run))?
        };
        Ok((corrected, numbers, refused.into_iter().map(told).collect()))
    }

    /// Corrected readings (N,) and None, or the number and the sentence of a refusal.
    fn one<'py>(
        &self,
        py: Python<'py>,
        readings: PyReadonlyArray1<'py, f64>,
        features: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Option<Told>)> {
        let values = contiguous("readings", &readings)?;
        if values.len() != self.core.joint_count() || features.len() != self.core.feature_count() {
            let (joints, wanted) = (self.core.joint_count(), self.core.feature_count());
            return Err(CoreError::new_err(format!(
                "{} readings and {} features given, {joints} and {wanted} are needed",
                values.len(),
                features.len()
            )));
        }
        let out = PyArray1::<f64>::zeros(py, values.len(), false);
        let correction = {
            let mut out = out.readwrite();
            // A workspace holds nothing from one waypoint to the next, so that of a thread that failed can be used.
            let mut workspace = self.workspace.lock().unwrap_or_else(PoisonError::into_inner);
            self.core.correct(values, &features, false, out.as_slice_mut()?, &mut workspace)
        };
        let refusal = correction.refusal.map(|refusal| (refusal.reason as u32, refusal.to_string()));
        Ok((out, refusal))
    }
}

/// Solves for readings, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Solver {
    core: Inverse,
}

#[pymethods]
impl Solver {
    #[new]
    fn new(model: &ArmModel, tool: PyReadonlyArray2<'_, f64>, options: Keywords<'_>) -> PyResult<Self> {
        let core = Inverse::new(Arc::clone(&model.core), &transform("tool", &tool)?, options.core()?);
        Ok(Self { core: core.map_err(Failure::into_exception)? })
    }

    /// Readings (n, N), residuals (n, 2), refusals.
    #[pyo3(signature = (poses, seed, features, threads=None))]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'py, f64>,
        seed: PyReadonlyArrayDyn<'py, f64>,
        features: Vec<f64>,
        threads: Option<NonZeroUsize>,
    ) -> PyResult<(Array<'py>, Array<'py>, Vec<Refused>)> {
        let rows = poses.shape()[0];
        let (poses, seeds) = (contiguous("poses", &poses)?, contiguous("seed", &seed)?);
        let along = seed.ndim() == 1;
        let mut readings = Array2::zeros((rows, self.core.joint_count()));
        let mut residuals = Array2::zeros((rows, 2));
        let (Some(found), Some(left)) = (readings.as_slice_mut(), residuals.as_slice_mut()) else {
            return Err(CoreError::new_err("the results are not contiguous"));
        };
        let out = Solved { readings: found, residuals: left };
        let refused = interruptible(py, rows, threads, move |run| {
            if along {
                self.core.follow(poses, seeds, &features, out, run)
            } else {
                self.core.each(poses, seeds, &features, out, run)
            }
        })?;
        let refused = refused.into_iter().map(told).collect();
        Ok((readings.into_pyarray(py), residuals.into_pyarray(py), refused))
    }
}

/// Short paths on this thread, long ones while somebody looks for Ctrl-C.
fn interruptible<T: Send>(
    py: Python<'_>,
    rows: usize,
    threads: Option<NonZeroUsize>,
    work: impl FnOnce(&Run) -> Result<T, CompensateError> + Send,
) -> PyResult<T> {
    if rows < QUICK {
        return quick(py, || work(&Run { threads, ..Run::default() }));
    }
    long(py, |cancel| work(&Run { threads, cancel: cancel.clone() }))
}
