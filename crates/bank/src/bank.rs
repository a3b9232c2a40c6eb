//! A bank of blocks: inputs in, CEPs out, by summing the weights of the excited cells.

use crate::BankError;
use crate::cells::{Axis, Grid, MOST_AXES};
use crate::compiled::Compiled;
use crate::sag::{Levers, SAG_NAME, Sag};

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
    /// Factors of the joint values (N,) whose sum is the only input, where that is not a joint's value but the reading of that
    /// number.
    pub reading: Option<Vec<f64>>,
}

/// All blocks of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Bank {
    /// Inputs of a configuration: joints in order, then features.
    pub input_count: usize,
    /// Parameters of the chain, 5 L.
    pub parameter_count: usize,
    /// The blocks over cells.
    pub blocks: Vec<Block>,
    /// What gives way under the arm's own weight.
    pub sag: Option<Sag>,
}

impl Bank {
    /// A field that is zero everywhere.
    pub fn empty(input_count: usize, parameter_count: usize) -> Self {
        Self { input_count, parameter_count, blocks: Vec::new(), sag: None }
    }

    /// A field of stored blocks, of which the one named [`SAG_NAME`] goes with the arm's levers.
    ///
    /// # Errors
    /// As [`Bank::check`].
    pub fn restored(
        input_count: usize,
        parameter_count: usize,
        mut blocks: Vec<Block>,
        levers: Levers,
    ) -> Result<Self, BankError> {
        let sag = blocks.iter().position(|block| block.name == SAG_NAME).map(|place| blocks.remove(place));
        if let Some(block) = &sag {
            let (own, payloads) =
                block.grid.inputs.split_at(levers.joint_count().min(block.grid.inputs.len()));
            let ordered = payloads.is_sorted_by(|a, b| a < b);
            let known = payloads.iter().all(|input| (levers.joint_count()..input_count).contains(input));
            if !(own.iter().copied().eq(0..levers.joint_count()) && ordered && known) {
                return Err(BankError::Block { what: "the sag does not go over all joints, then payloads" });
            }
        }
        let sag = sag.map(|block| {
            let payloads = block.grid.inputs.iter().skip(levers.joint_count()).map(|&input| (input, 1.0));
            Sag::restored(levers.carrying(payloads), block.outputs, block.weights)
        });
        let bank = Self { input_count, parameter_count, blocks, sag };
        bank.check()?;
        Ok(bank)
    }

    /// Checks that weights, grids and indices fit together, once, where a bank comes from outside.
    ///
    /// # Errors
    /// [`BankError::Length`], [`BankError::NotFinite`], [`BankError::Block`].
    pub fn check(&self) -> Result<(), BankError> {
        self.check_sag()?;
        for block in &self.blocks {
            let (axes, inputs) = (&block.grid.axes, &block.grid.inputs);
            if !(1..=MOST_AXES).contains(&axes.len()) || !axes.iter().all(Axis::is_sound) {
                return Err(BankError::NotFinite { what: "axes of a block" });
            }
            if inputs.len() != axes.len() {
                let (found, expected) = (inputs.len(), axes.len());
                return Err(BankError::Length { what: "inputs of a block", found, expected });
            }
            let expected = block.grid.cell_count() * block.outputs.len();
            if block.weights.len() != expected {
                return Err(BankError::Length {
                    what: "weights of a block",
                    found: block.weights.len(),
                    expected,
                });
            }
            check_weights(&block.weights, "weights of a block")?;
            if let Some(factors) = &block.reading {
                check_reading(factors, self.input_count, axes.len())?;
            }
            let input = inputs.iter().copied().max().unwrap_or(0);
            if input >= self.input_count {
                let expected = self.input_count;
                return Err(BankError::Length { what: "inputs of a block", found: input + 1, expected });
            }
            let mut outputs = block.outputs.clone();
            outputs.sort_unstable();
            if !outputs.is_sorted_by(|a, b| a < b) {
                return Err(BankError::Block { what: "a block drives a parameter twice" });
            }
            let output = block.outputs.iter().copied().max().unwrap_or(0);
            if output >= self.parameter_count {
                let expected = self.parameter_count;
                return Err(BankError::Length { what: "outputs of a block", found: output + 1, expected });
            }
        }
        Ok(())
    }

    fn check_sag(&self) -> Result<(), BankError> {
        let Some(sag) = &self.sag else { return Ok(()) };
        let inputs = sag.levers.input_count();
        let mut of_joint = vec![None; sag.levers.joint_count()];
        for (joint, output) in sag.levers.joints().zip(&sag.outputs) {
            if of_joint[joint].get_or_insert(*output) != output {
                return Err(BankError::Block { what: "the sag drives several parameters of one joint" });
            }
        }
        let output = sag.outputs.iter().copied().max().unwrap_or(0);
        let lengths = [
            ("weights of the sag", sag.weights.len(), sag.levers.len()),
            ("outputs of the sag", sag.outputs.len(), sag.levers.len()),
            ("inputs of the sag", self.input_count.min(inputs), inputs),
            ("outputs of the sag", (output + 1).max(self.parameter_count), self.parameter_count),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return Err(BankError::Length { what, found, expected });
            }
        }
        check_weights(&sag.weights, "weights of the sag")
    }

    /// Adds the CEPs of the given inputs (n, I) to `out` (n, 5 L).
    ///
    /// # Errors
    /// [`BankError::Length`].
    pub fn add(&self, values: &[f64], out: &mut [f64]) -> Result<(), BankError> {
        self.compiled().add(values, out)
    }

    /// The bank prepared for evaluation: made once, it is fast from then on.
    pub fn compiled(&self) -> Compiled {
        Compiled::new(self)
    }

    /// Association cells of all blocks.
    pub fn cell_count(&self) -> usize {
        self.blocks.iter().map(|block| block.grid.cell_count()).sum()
    }
}

/// Refuses a reading that is no sum of inputs, or that is not alone.
fn check_reading(factors: &[f64], inputs: usize, axes: usize) -> Result<(), BankError> {
    if !factors.iter().all(|factor| factor.is_finite()) {
        return Err(BankError::NotFinite { what: "factors of a reading" });
    }
    if axes != 1 || factors.is_empty() || factors.len() > inputs {
        return Err(BankError::Block { what: "a reading is not one sum of the arm's joint values" });
    }
    Ok(())
}

/// Refuses weights that are not finite, or that the tables' single precision does not hold.
fn check_weights(weights: &[f64], what: &'static str) -> Result<(), BankError> {
    let held = weights.iter().all(|weight| weight.abs() <= f64::from(f32::MAX));
    if held { Ok(()) } else { Err(BankError::NotFinite { what }) }
}
