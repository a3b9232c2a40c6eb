//! A bank of blocks: inputs in, CEPs out, by summing the weights of the excited cells.

use rayon::prelude::*;
use truearm_kinematics::{Isa, Kernel, dispatch};

use crate::FieldError;
use crate::cells::Grid;

/// One FCMAC: a grid of cells, each with a weight for every parameter that the block drives.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// `own`, `smooth` or `major`.
    pub name: String,
    /// The cells.
    pub grid: Grid,
    /// Driven parameters: indices 5 * link + (theta, d, a, alpha, beta).
    pub outputs: Vec<usize>,
    /// Weights (cells, outputs), rad or m.
    pub weights: Vec<f64>,
}

/// All blocks of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Bank {
    /// Inputs of a configuration: joints in order, then features.
    pub input_count: usize,
    /// Parameters of the chain, 5 L.
    pub parameter_count: usize,
    /// The blocks.
    pub blocks: Vec<Block>,
}

/// Below this many poses threads cost more than they bring.
const THREADED_POSES: usize = 4096;
const POSES_PER_TASK: usize = 256;

struct Evaluate<'a> {
    bank: &'a Bank,
    values: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { bank, values, out } = self;
        let mut sums = vec![0.0; bank.parameter_count];
        let poses = values.chunks_exact(bank.input_count).zip(out.chunks_exact_mut(bank.parameter_count));
        for (values, parameters) in poses {
            for block in &bank.blocks {
                let width = block.outputs.len();
                let sums = &mut sums[..width];
                sums.fill(0.0);
                block.grid.visit(values, |cell, grade| {
                    let weights = &block.weights[cell * width..(cell + 1) * width];
                    for (sum, weight) in sums.iter_mut().zip(weights) {
                        *sum += grade * weight;
                    }
                });
                for (&output, sum) in block.outputs.iter().zip(&*sums) {
                    parameters[output] += sum;
                }
            }
        }
    }
}

impl Bank {
    /// A field that is zero everywhere.
    pub fn empty(input_count: usize, parameter_count: usize) -> Self {
        Self { input_count, parameter_count, blocks: Vec::new() }
    }

    /// Checks that weights, grids and indices fit together, once, where a bank comes from outside.
    ///
    /// # Errors
    /// [`FieldError::Length`].
    pub fn check(&self) -> Result<(), FieldError> {
        for block in &self.blocks {
            let expected = block.grid.cell_count() * block.outputs.len();
            if block.weights.len() != expected {
                return Err(FieldError::Length {
                    what: "weights of a block",
                    found: block.weights.len(),
                    expected,
                });
            }
            let input = block.grid.inputs.iter().copied().max().unwrap_or(0);
            if input >= self.input_count || block.grid.inputs.len() != block.grid.axes.len() {
                let expected = self.input_count;
                return Err(FieldError::Length { what: "inputs of a block", found: input + 1, expected });
            }
            let output = block.outputs.iter().copied().max().unwrap_or(0);
            if output >= self.parameter_count {
                let expected = self.parameter_count;
                return Err(FieldError::Length { what: "outputs of a block", found: output + 1, expected });
            }
        }
        Ok(())
    }

    /// Adds the CEPs of the given inputs (n, I) to `out` (n, 5 L).
    ///
    /// # Errors
    /// [`FieldError::Length`].
    pub fn add(&self, values: &[f64], out: &mut [f64]) -> Result<(), FieldError> {
        let poses = values.len() / self.input_count.max(1);
        if poses * self.input_count != values.len() {
            let expected = poses * self.input_count;
            return Err(FieldError::Length { what: "inputs", found: values.len(), expected });
        }
        if out.len() != poses * self.parameter_count {
            let expected = poses * self.parameter_count;
            return Err(FieldError::Length { what: "parameters", found: out.len(), expected });
        }
        if poses < THREADED_POSES || rayon::current_num_threads() == 1 {
            dispatch(Evaluate { bank: self, values, out });
        } else {
            let tasks = values.par_chunks(POSES_PER_TASK * self.input_count);
            tasks
                .zip(out.par_chunks_mut(POSES_PER_TASK * self.parameter_count))
                .for_each(|(values, out)| dispatch(Evaluate { bank: self, values, out }));
        }
        Ok(())
    }

    /// Association cells of all blocks.
    pub fn cell_count(&self) -> usize {
        self.blocks.iter().map(|block| block.grid.cell_count()).sum()
    }
}
