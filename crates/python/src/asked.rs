//! What a posterior is asked with.

use std::ops::Range;

use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use truearm_field::Posterior;

use crate::arrays::{numbers, wrong_shape};

/// What a posterior is asked with, copied.
pub struct Copies {
    inputs: Vec<f64>,
    jacobian: Vec<f64>,
    setup: Option<Vec<f64>>,
    poses: usize,
}

impl Copies {
    /// Copies of inputs (n, I), Jacobians (n, m, P) and set-up columns (n, m, s).
    ///
    /// # Errors
    /// A shape is another.
    pub fn of(
        core: &Posterior,
        inputs: &PyReadonlyArray2<f64>,
        jacobian: &PyReadonlyArray3<f64>,
        setup: Option<&PyReadonlyArray3<f64>>,
    ) -> PyResult<Self> {
        let training = core.training();
        let (poses, rows) = (inputs.shape()[0], jacobian.shape()[1]);
        let fits = |name, got: &[usize], wanted: &[usize]| {
            if got == wanted { Ok(()) } else { Err(wrong_shape(name, got, wanted)) }
        };
        fits("inputs", inputs.shape(), &[poses, training.input_count()])?;
        fits("jacobian", jacobian.shape(), &[poses, rows, training.column_count()])?;
        if let Some(setup) = setup {
            fits("setup", setup.shape(), &[poses, rows, training.setup_width])?;
        }
        let setup = setup.map(numbers);
        Ok(Self { inputs: numbers(inputs), jacobian: numbers(jacobian), setup, poses })
    }

    /// What they ask.
    pub fn asked(&self) -> Asked<'_> {
        let Self { inputs, jacobian, setup, poses } = self;
        Asked { inputs, jacobian, setup: setup.as_deref(), poses: *poses }
    }
}

/// What is asked of a posterior: inputs (n, I), Jacobians (n, m, P), set-up columns (n, m, s).
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    pub inputs: &'a [f64],
    pub jacobian: &'a [f64],
    pub setup: Option<&'a [f64]>,
    /// Configurations, n.
    pub poses: usize,
}

impl<'a> Asked<'a> {
    /// Some of its configurations.
    pub fn part(&self, part: &Range<usize>) -> Asked<'a> {
        let of = |array: &'a [f64]| {
            let each = array.len() / self.poses.max(1);
            &array[part.start * each..part.end * each]
        };
        Asked {
            inputs: of(self.inputs),
            jacobian: of(self.jacobian),
            setup: self.setup.map(of),
            poses: part.len(),
        }
    }
}
