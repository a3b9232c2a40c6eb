//! `_core.Conservative`: a standard deviation that is quick to evaluate and never too small.

use numpy::{PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use truearm_bank::{
    BOUNDED, Bank, Conservative as Core, ConservativeParts, FACTOR_COLUMNS, InputKind, Leverage,
};
use truearm_field::{ConservativePlan, Samples};

use crate::arrays::lent;
use crate::blocks::{block_from, block_into};
use crate::chain::Chain;
use crate::door::{CoreError, Failure, long, quick};
use crate::measured::matrix;

/// Bounds of the standard deviation, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Conservative {
    core: Core,
}

impl Conservative {
    /// The bounds themselves, for the other bindings.
    pub fn core(&self) -> &Core {
        &self.core
    }
}

/// Lowest and highest value of an input; None for any.
type StoredRange = Option<[f64; 2]>;
/// Inputs (n, I) and exact standard deviations (n, 2).
type StoredSamples<'py> = (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>);

/// What is not in the tables, by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Stored {
    level: [f64; BOUNDED],
    largest: [f64; BOUNDED],
    ranges: Vec<StoredRange>,
    looseness: [f64; BOUNDED],
    centre: [f64; 3],
}

/// What the tables are over, by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Plan {
    angles: Vec<bool>,
    ranges: Vec<(f64, f64)>,
    together: Vec<usize>,
    largest: [f64; BOUNDED],
    centre: [f64; 3],
}

#[pymethods]
impl Conservative {
    #[new]
    #[pyo3(signature = (content, blocks, leverage=None))]
    fn new(
        content: &Bound<'_, PyDict>,
        blocks: Vec<Bound<'_, PyDict>>,
        leverage: Option<(PyRef<'_, Chain>, PyReadonlyArray2<'_, f64>)>,
    ) -> PyResult<Self> {
        let stored: Stored = content.extract()?;
        let blocks = blocks.iter().map(block_from).collect::<PyResult<_>>()?;
        let any = [f64::NEG_INFINITY, f64::INFINITY];
        let ranges: Vec<[f64; 2]> = stored.ranges.into_iter().map(|range| range.unwrap_or(any)).collect();
        let leverage = leverage
            .map(|(chain, factor)| Leverage::new(chain.core(), stored.centre, &lent(&factor)))
            .transpose()
            .map_err(Failure::into_exception)?;
        let parts = ConservativeParts {
            leverage,
            tables: Bank { input_count: ranges.len(), parameter_count: BOUNDED, blocks, sag: None },
            level: stored.level,
            largest: stored.largest,
            ranges,
            looseness: stored.looseness,
            centre: stored.centre,
        };
        Ok(Self { core: Core::new(parts).map_err(Failure::into_exception)? })
    }

    /// Fits to exact values, and raises the fit by what fresh ones show.
    #[staticmethod]
    #[pyo3(signature = (plan, fitted, fresh, chain=None))]
    fn fit(
        py: Python<'_>,
        plan: Plan,
        fitted: StoredSamples<'_>,
        fresh: StoredSamples<'_>,
        chain: Option<&Chain>,
    ) -> PyResult<Self> {
        let kind = |&angle: &bool| if angle { InputKind::Angle } else { InputKind::Line };
        let plan = ConservativePlan {
            kinds: plan.angles.iter().map(kind).collect(),
            ranges: plan.ranges.iter().map(|&range| range.into()).collect(),
            together: plan.together,
            largest: plan.largest,
            centre: plan.centre,
            chain: chain.map(|chain| chain.core().clone()),
        };
        let arrays = [&fitted.0, &fitted.1, &fresh.0, &fresh.1].map(lent);
        let core = long(py, |cancel| {
            let samples = |k: usize| Samples { inputs: &arrays[k], std: &arrays[k + 1] };
            plan.fit(samples(0), samples(2), cancel)
        })?;
        Ok(Self { core })
    }

    /// All but the tables.
    fn content<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let parts = self.core.parts();
        let range = |range: &[f64; 2]| range[0].is_finite().then_some(*range);
        let stored = PyDict::new(py);
        stored.set_item("level", parts.level)?;
        stored.set_item("largest", parts.largest)?;
        stored.set_item("ranges", parts.ranges.iter().map(range).collect::<Vec<_>>())?;
        stored.set_item("looseness", parts.looseness)?;
        stored.set_item("centre", parts.centre)?;
        Ok(stored)
    }

    /// The factor of the leverage, (5 L + 9, 8); None where there is no leverage.
    fn factor<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.core.parts().leverage.as_ref().map(|leverage| matrix(py, &leverage.factor(), FACTOR_COLUMNS))
    }

    /// The tables as dictionaries.
    fn blocks<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        self.core.parts().tables.blocks.iter().map(|block| block_into(py, block)).collect()
    }

    /// Position (m) and rotation (rad) at inputs (n, I): (n, 2).
    fn std<'py>(
        &self,
        py: Python<'py>,
        inputs: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (found, expected) = (inputs.shape()[1], self.core.input_count());
        if found != expected {
            return Err(CoreError::new_err(format!("there are {found} inputs, {expected} are needed")));
        }
        let inputs = lent(&inputs);
        let values = quick(py, || self.core.std(&inputs))?;
        Ok(matrix(py, &values, BOUNDED))
    }
}
