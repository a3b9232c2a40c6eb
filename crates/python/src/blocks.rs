//! Blocks of a field as dictionaries, and back.

use numpy::PyReadonlyArrayDyn;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use truearm_bank::{Axis, Block, Grid, Sag, StoredAxis};

use crate::measured::matrix;

/// Key of the direction that a `sag` block takes for up, in the base frame.
const UP: &str = "up";
/// Key of the factors of joint values whose sum is the reading that a block is over.
const READING: &str = "reading";

pub(crate) fn block_into<'py>(py: Python<'py>, block: &Block) -> PyResult<Bound<'py, PyDict>> {
    let axes: Vec<StoredAxis> = block.grid.axes.iter().map(Axis::stored).collect();
    let stored = PyDict::new(py);
    stored.set_item("name", &block.name)?;
    stored.set_item("inputs", &block.grid.inputs)?;
    stored.set_item("axes", axes)?;
    stored.set_item("outputs", &block.outputs)?;
    stored.set_item("weights", matrix(py, &block.weights, block.outputs.len()))?;
    if let Some(factors) = &block.reading {
        stored.set_item(READING, factors)?;
    }
    Ok(stored)
}

/// The sag as a block over all joints and payloads without cells, and which way is up in it.
pub(crate) fn sag_into<'py>(py: Python<'py>, sag: &Sag) -> PyResult<Bound<'py, PyDict>> {
    let stored = block_into(py, &sag.stored())?;
    stored.set_item(UP, sag.levers.up().to_vec())?;
    Ok(stored)
}

/// Which way a stored block says is up; None where it does not.
pub(crate) fn up_of(stored: &Bound<'_, PyDict>) -> PyResult<Option<[f64; 3]>> {
    stored.get_item(UP)?.map(|up| up.extract()).transpose()
}

pub(crate) fn block_from(stored: &Bound<'_, PyDict>) -> PyResult<Block> {
    let item = |name: &str| {
        let message = || PyKeyError::new_err(format!("a block of the field has no '{name}'"));
        stored.get_item(name)?.ok_or_else(message)
    };
    let axes: Vec<StoredAxis> = item("axes")?.extract()?;
    let weights: PyReadonlyArrayDyn<'_, f64> = item("weights")?.extract()?;
    Ok(Block {
        name: item("name")?.extract()?,
        grid: Grid {
            inputs: item("inputs")?.extract()?,
            axes: axes.into_iter().map(Axis::restored).collect(),
        },
        outputs: item("outputs")?.extract()?,
        weights: weights.as_array().iter().copied().collect(),
        reading: stored.get_item(READING)?.map(|factors| factors.extract()).transpose()?,
    })
}
