//! What a posterior is asked with.

use std::ops::Range;

use numpy::{PyReadonlyArray2, PyReadonlyArray3};
use truearm_field::Posterior;

/// What a posterior is asked with, copied: Python may change its arrays meanwhile.
pub struct Copies {
    inputs: Vec<f64>,
    jacobian: Vec<f64>,
    setup: Option<Vec<f64>>,
}

impl Copies {
    /// Copies of inputs (n, I), Jacobians (n, m, P) and set-up columns (n, m, s).
    pub fn of(
        inputs: &PyReadonlyArray2<f64>,
        jacobian: &PyReadonlyArray3<f64>,
        setup: Option<&PyReadonlyArray3<f64>>,
    ) -> Self {
        Self {
            inputs: inputs.as_array().iter().copied().collect(),
            jacobian: jacobian.as_array().iter().copied().collect(),
            setup: setup.map(|array| array.as_array().iter().copied().collect()),
        }
    }

    /// What they ask.
    pub fn asked(&self) -> Asked<'_> {
        Asked { inputs: &self.inputs, jacobian: &self.jacobian, setup: self.setup.as_deref() }
    }
}

/// What is asked of a posterior: inputs (n, I), Jacobians (n, m, P), set-up columns (n, m, s).
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    pub inputs: &'a [f64],
    pub jacobian: &'a [f64],
    pub setup: Option<&'a [f64]>,
}

impl<'a> Asked<'a> {
    /// Configurations, n; one where the arrays are not of as many, so that the core sees them whole and refuses them.
    pub fn poses(&self, core: &Posterior) -> usize {
        let count = self.inputs.len() / core.training().input_count();
        let even = |array: &[f64]| array.len().is_multiple_of(count) && count > 0;
        if even(self.inputs) && even(self.jacobian) && self.setup.is_none_or(even) { count } else { 1 }
    }

    /// Some of so many configurations.
    pub fn part(&self, part: &Range<usize>, whole: usize) -> Asked<'a> {
        let of = |array: &'a [f64]| {
            let each = array.len() / whole;
            &array[part.start * each..part.end * each]
        };
        Asked { inputs: of(self.inputs), jacobian: of(self.jacobian), setup: self.setup.map(of) }
    }
}
