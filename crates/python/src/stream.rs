//! `_core.Stream`: corrections of a stream of set-points.

use std::sync::{Arc, Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use truearm_compensate::{Fault, Phase, Stream as Core, StreamOptions};

use crate::chain::contiguous;
use crate::compensate::Corrector;
use crate::door::Failure;

/// Options by keyword; SI.
#[derive(FromPyObject, IntoPyObject)]
#[pyo3(from_item_all)]
pub struct Keywords {
    rate: [f64; 2],
    acceleration: [f64; 2],
    ramp: f64,
    hold: f64,
    deadline: f64,
}

/// Corrects set-points one after the other, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Stream {
    core: Mutex<Core>,
}

/// What to command, or None; phase, gain, lag; and why the correction is an older one.
type Stepped<'py> = (Option<Bound<'py, PyArray1<f64>>>, &'static str, f64, f64, Option<String>);

#[pymethods]
impl Stream {
    #[new]
    fn new(corrector: &Corrector, options: Keywords) -> PyResult<Self> {
        let options = StreamOptions {
            rate: options.rate,
            acceleration: options.acceleration,
            ramp: options.ramp,
            hold: options.hold,
            deadline: options.deadline,
        };
        let core = Core::new(Arc::new(corrector.core().clone()), options);
        Ok(Self { core: Mutex::new(core.map_err(Failure::into_exception)?) })
    }

    /// The options where nothing is stated.
    #[staticmethod]
    fn usual() -> Keywords {
        let StreamOptions { rate, acceleration, ramp, hold, deadline } = StreamOptions::default();
        Keywords { rate, acceleration, ramp, hold, deadline }
    }

    fn switch(&self, on: bool) {
        self.core.lock().unwrap_or_else(PoisonError::into_inner).switch(on);
    }

    fn step<'py>(
        &self,
        py: Python<'py>,
        readings: Option<PyReadonlyArray1<'py, f64>>,
        features: Vec<f64>,
        elapsed: f64,
    ) -> PyResult<Stepped<'py>> {
        let mut core = self.core.lock().unwrap_or_else(PoisonError::into_inner);
        let mut out = vec![0.0; core.joint_count()];
        let values = readings.as_ref().map(|readings| contiguous("readings", readings)).transpose()?;
        let step = core.step(values, &features, elapsed, &mut out);
        let command = (step.fault != Some(Fault::NotStarted)).then(|| out.into_pyarray(py));
        Ok((command, phase(step.phase), step.gain, step.lag, step.fault.map(words)))
    }
}

fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Off => "off",
        Phase::Rising => "rising",
        Phase::On => "on",
        Phase::Holding => "holding",
        Phase::Falling => "falling",
    }
}

fn words(fault: Fault) -> String {
    match fault {
        Fault::NotStarted => "there was no set-point yet".to_owned(),
        Fault::NotFinite => "the set-point or a feature is missing or not finite".to_owned(),
        Fault::Late => "the set-point came after the deadline".to_owned(),
        Fault::Refused(refusal) => refusal.to_string(),
    }
}
