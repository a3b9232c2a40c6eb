//! Outputs of a network, and the cells that take part in them.

use rayon::prelude::*;
use truearm_estimate::EstimateError;
use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch};

use crate::cmac::excited::Excited;
use crate::cmac::network::Network;
use crate::cmac::table::Table;

/// Below this many inputs threads cost more than they bring.
const THREADED_FROM: usize = 4096;
/// Inputs of a task.
const PER_TASK: usize = 512;
/// Lanes of outputs that are summed at once, in registers.
const MOST_LANES: usize = 4;

impl Network {
    /// Outputs (n, P) for inputs (n, I), equation (A4), into `out`. Does not depend on the number of threads.
    ///
    /// # Errors
    /// [`EstimateError`] where an input is not finite or a length does not fit.
    pub fn output(&self, inputs: &[f64], out: &mut [f64]) -> Result<(), EstimateError> {
        let rows = self.check_inputs(inputs)?;
        let expected = rows * self.output_count();
        if out.len() != expected {
            return Err(EstimateError::Length { what: "the outputs", found: out.len(), expected });
        }
        if rows >= THREADED_FROM && rayon::current_num_threads() > 1 {
            let tasks = inputs.par_chunks(PER_TASK * self.input_count());
            tasks
                .zip(out.par_chunks_mut(PER_TASK * self.output_count()))
                .for_each(|(inputs, out)| dispatch(Evaluate { network: self, inputs, out }));
        } else {
            dispatch(Evaluate { network: self, inputs, out });
        }
        Ok(())
    }

    /// Active association cells (n, A) and their excitation (n, A) for inputs (n, I).
    ///
    /// # Errors
    /// [`EstimateError`] where an input is not finite or a length does not fit.
    pub fn active(&self, inputs: &[f64]) -> Result<(Vec<u64>, Vec<f64>), EstimateError> {
        let rows = self.check_inputs(inputs)?;
        let size = rows * self.active_count();
        let (mut cells, mut grades) = (vec![0; size], vec![0.0; size]);
        dispatch(Activate { network: self, inputs, cells: &mut cells, grades: &mut grades });
        Ok((cells, grades))
    }
}

struct Activate<'a> {
    network: &'a Network,
    inputs: &'a [f64],
    cells: &'a mut [u64],
    grades: &'a mut [f64],
}

impl Kernel for Activate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let (network, active) = (self.network, self.network.active_count());
        let mut excited = Excited::new(network);
        let groups = self.inputs.chunks(LANES * network.input_count());
        let out = self.cells.chunks_mut(LANES * active).zip(self.grades.chunks_mut(LANES * active));
        for (inputs, (cells, grades)) in groups.zip(out) {
            excited.by::<I>(network, inputs);
            for (i, (cells, grades)) in
                cells.chunks_exact_mut(active).zip(grades.chunks_exact_mut(active)).enumerate()
            {
                for k in 0..active {
                    cells[k] = excited.first[i] + network.pattern()[k];
                    grades[k] = excited.grades[k].0[i];
                }
            }
        }
    }
}

struct Evaluate<'a> {
    network: &'a Network,
    inputs: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { network, inputs, out } = self;
        let outputs = network.output_count();
        let mut excited = Excited::new(network);
        let groups = inputs.chunks(LANES * network.input_count());
        for (inputs, out) in groups.zip(out.chunks_mut(LANES * outputs)) {
            excited.by::<I>(network, inputs);
            for (lane, out) in out.chunks_exact_mut(outputs).enumerate() {
                let inverse = excited.sum.0[lane].recip();
                for first in (0..network.lanes()).step_by(MOST_LANES) {
                    let out = &mut out[first * LANES..];
                    match network.lanes() - first {
                        1 => sum::<I, 1>(network, &excited, (lane, first), inverse, out),
                        2 => sum::<I, 2>(network, &excited, (lane, first), inverse, out),
                        3 => sum::<I, 3>(network, &excited, (lane, first), inverse, out),
                        _ => sum::<I, MOST_LANES>(network, &excited, (lane, first), inverse, out),
                    }
                }
            }
        }
    }
}

/// The centroid of L lanes of outputs from the lane `first` on, for one of the eight inputs.
#[inline(always)]
fn sum<I: Isa, const L: usize>(
    network: &Network,
    excited: &Excited,
    (lane, first): (usize, usize),
    inverse: f64,
    out: &mut [f64],
) {
    let (weights, lanes) = (network.lane_weights(), network.lanes());
    let (start, table) = (excited.first[lane], network.table());
    let mut sums = [Lane::ZERO; L];
    for (step, grade) in network.pattern().iter().zip(&excited.grades) {
        let row = match table {
            Table::Dense => (start + step) as usize,
            Table::Hashed { .. } => table.row(start + step),
        };
        let from = &weights[row * lanes + first..][..L];
        let grade = Lane::splat(grade.0[lane]);
        for k in 0..L {
            sums[k] = I::mul_add(grade, from[k], sums[k]);
        }
    }
    for (sum, out) in sums.iter().zip(out.chunks_mut(LANES)) {
        for (value, to) in sum.0.iter().zip(out) {
            *to = value * inverse;
        }
    }
}
