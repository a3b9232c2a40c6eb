//! A bank prepared for evaluation: eight poses at once for the memberships, eight outputs at once for the weights.
//!
//! Blocks that see an input through the same cells share its memberships, and blocks with the same outputs share
//! their sums, which stay in registers.

use std::cmp::Reverse;

use rayon::prelude::*;
use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch, lane_room, load_lanes};

use crate::BankError;
use crate::bank::{Bank, Block};
use crate::cells::MOST_ACTIVE;
use crate::compiled_axis::{Abreast, CompiledAxis, Excited};
use crate::compiled_table::{Line, MOST_LANES, Numbered, Row, Sheet};
use crate::sag::{Loads, SagScratch};

/// Below this many poses threads cost more than they bring.
const THREADED_POSES: usize = 4096;
/// Their inputs and outputs stay in the nearest caches.
const POSES_PER_TASK: usize = 128;

/// A bank prepared for evaluation, see [`Bank::compiled`].
#[derive(Debug, Clone, PartialEq)]
pub struct Compiled {
    input_count: usize,
    parameter_count: usize,
    /// Cells that a value excites, 3 or 4.
    active: usize,
    /// Factors of the joint values whose sums are further inputs.
    readings: Vec<Vec<f64>>,
    axes: Vec<CompiledAxis>,
    /// The same for a single pose.
    abreast: Vec<Abreast>,
    lines: Vec<Line>,
    sheets: Vec<Sheet>,
    sag: Option<Loads>,
    /// Of each joint's loads the single sum that takes them, (J,).
    sag_singles: Vec<usize>,
    /// Parameters that lines and sag drive, each with one sum.
    singles: Vec<usize>,
    /// Whether the first sheet begins with the single sums.
    joined: bool,
}

impl Compiled {
    /// Prepares a bank for evaluation.
    pub fn new(bank: &Bank) -> Self {
        let degrees = bank.blocks.iter().flat_map(|block| &block.grid.axes).map(|axis| axis.degree);
        let mut compiled = Self {
            input_count: bank.input_count,
            parameter_count: bank.parameter_count,
            active: degrees.max().map_or(MOST_ACTIVE, |degree| degree + 1),
            readings: Vec::new(),
            axes: Vec::new(),
            abreast: Vec::new(),
            lines: Vec::new(),
            sheets: Vec::new(),
            sag: bank.sag.as_ref().map(Loads::new),
            sag_singles: Vec::new(),
            singles: Vec::new(),
            joined: false,
        };
        let mut blocks: Vec<&Block> = bank.blocks.iter().collect();
        blocks.sort_by_key(|block| Reverse(block.grid.axes.len()));
        blocks.into_iter().for_each(|block| compiled.push(block));
        compiled.abreast = Abreast::of(&compiled.axes);
        let loaded = compiled.sag.as_ref().map_or(Vec::new(), |sag| sag.outputs.clone());
        compiled.sag_singles = loaded.into_iter().map(|output| compiled.single(output)).collect();
        let Self { sheets, singles, .. } = &mut compiled;
        compiled.joined = sheets.first_mut().is_some_and(|sheet| sheet.begin_with(singles));
        compiled
    }

    fn push(&mut self, block: &Block) {
        let reading = block.reading.as_ref().map(|factors| self.reading(factors));
        let inputs = block.grid.inputs.iter().zip(&block.grid.axes);
        let axes: Vec<usize> = inputs
            .map(|(&input, axis)| self.axis(CompiledAxis::new(reading.unwrap_or(input), axis)))
            .collect();
        if let (&[axis], &[output]) = (&axes[..], &block.outputs[..]) {
            let single = self.single(output);
            self.lines.push(Line::new(block, (axis, &self.axes[axis]), single));
            return;
        }
        let axes: Vec<Numbered<'_>> = axes.into_iter().map(|axis| (axis, &self.axes[axis])).collect();
        for first in (0..block.outputs.len()).step_by(MOST_LANES * LANES) {
            let outputs = &block.outputs[first..block.outputs.len().min(first + MOST_LANES * LANES)];
            let place = self.sheets.iter().position(|sheet| sheet.outputs == outputs).unwrap_or_else(|| {
                self.sheets.push(Sheet::new(outputs));
                self.sheets.len() - 1
            });
            self.sheets[place].push(block, first, &axes);
        }
    }

    fn axis(&mut self, axis: CompiledAxis) -> usize {
        self.axes.iter().position(|known| *known == axis).unwrap_or_else(|| {
            self.axes.push(axis);
            self.axes.len() - 1
        })
    }

    /// The input that a reading is.
    fn reading(&mut self, factors: &[f64]) -> usize {
        let known = self.readings.iter().position(|known| known == factors);
        self.input_count
            + known.unwrap_or_else(|| {
                self.readings.push(factors.to_vec());
                self.readings.len() - 1
            })
    }

    fn single(&mut self, output: usize) -> usize {
        self.singles.iter().position(|known| *known == output).unwrap_or_else(|| {
            self.singles.push(output);
            self.singles.len() - 1
        })
    }

    /// Adds the CEPs of the given inputs (n, I) to `out` (n, 5 L).
    ///
    /// # Errors
    /// [`BankError::Length`].
    pub fn add(&self, values: &[f64], out: &mut [f64]) -> Result<(), BankError> {
        let expected = self.poses(values)? * self.parameter_count;
        if out.len() != expected {
            return Err(BankError::Length { what: "parameters", found: out.len(), expected });
        }
        if self.threaded(values) {
            let tasks = values.par_chunks(POSES_PER_TASK * self.input_count);
            tasks
                .zip(out.par_chunks_mut(POSES_PER_TASK * self.parameter_count))
                .for_each_init(|| self.room(), |room, (values, out)| self.add_to(values, room, out));
        } else {
            self.add_to(values, &mut self.room(), out);
        }
        Ok(())
    }

    fn add_to(&self, values: &[f64], room: &mut Room, out: &mut [f64]) {
        dispatch(Evaluate { bank: self, values, room, out });
    }

    fn room(&self) -> Room {
        Room { inputs: vec![Lane::ZERO; lane_room(self.input_count)], field: self.scratch() }
    }

    /// Constants (5 L) plus the CEPs of the given inputs (n, I): (n, 5 L).
    ///
    /// # Errors
    /// [`BankError::Length`].
    pub fn parameters(&self, constants: &[f64], values: &[f64]) -> Result<Vec<f64>, BankError> {
        let poses = self.poses(values)?;
        if constants.len() != self.parameter_count {
            let (found, expected) = (constants.len(), self.parameter_count);
            return Err(BankError::Length { what: "constants", found, expected });
        }
        let mut out = Vec::with_capacity(poses * self.parameter_count);
        let group = constants.repeat(LANES);
        let begin = |poses: usize, out: &mut Vec<f64>| {
            let length = out.len() + poses * self.parameter_count;
            (0..poses / LANES).for_each(|_| out.extend_from_slice(&group));
            out.extend_from_slice(&group[..length - out.len()]);
        };
        if self.threaded(values) {
            begin(poses, &mut out);
            self.add(values, &mut out)?;
            return Ok(out);
        }
        let mut room = self.room();
        for values in values.chunks((POSES_PER_TASK * self.input_count).max(1)) {
            let from = out.len();
            begin(values.len() / self.input_count, &mut out);
            self.add_to(values, &mut room, &mut out[from..]);
        }
        Ok(out)
    }

    fn poses(&self, values: &[f64]) -> Result<usize, BankError> {
        let poses = values.len() / self.input_count.max(1);
        let expected = poses * self.input_count;
        if expected != values.len() {
            return Err(BankError::Length { what: "inputs", found: values.len(), expected });
        }
        Ok(poses)
    }

    fn threaded(&self, values: &[f64]) -> bool {
        values.len() >= THREADED_POSES * self.input_count.max(1) && rayon::current_num_threads() > 1
    }
}

/// What an evaluation writes to.
struct Room {
    inputs: Vec<Lane>,
    field: FieldScratch,
}

/// What [`Compiled::excite_and_add`] writes to, made once for many groups of poses.
#[derive(Debug, Clone)]
pub struct FieldScratch {
    three: Vec<Excited<3>>,
    four: Vec<Excited<MOST_ACTIVE>>,
    sums: SumScratch,
}

#[derive(Debug, Clone)]
struct SumScratch {
    rows: Vec<Row>,
    singles: Vec<Lane>,
    sag: Option<SagScratch>,
}

impl Compiled {
    /// Inputs of a configuration: joints in order, then features.
    pub fn input_count(&self) -> usize {
        self.input_count
    }

    /// Parameters of the chain, 5 L.
    pub fn parameter_count(&self) -> usize {
        self.parameter_count
    }

    /// Room for the memberships of a group.
    pub fn scratch(&self) -> FieldScratch {
        let count = |active: usize| if self.active == active { self.axes.len() } else { 0 };
        FieldScratch {
            three: vec![Excited::NONE; self.axes.len() - count(MOST_ACTIVE)],
            four: vec![Excited::NONE; count(MOST_ACTIVE)],
            sums: self.sum_scratch(),
        }
    }

    fn sum_scratch(&self) -> SumScratch {
        let rows = self.sheets.iter().map(|sheet| sheet.row_count(self.active));
        SumScratch {
            rows: vec![Row::NONE; rows.max().unwrap_or(0)],
            singles: vec![Lane::ZERO; self.singles.len().max(LANES)],
            sag: self.sag.as_ref().map(Loads::scratch),
        }
    }

    /// Adds the CEPs of a group to `rows` (up to 8, 5 L): for kernels, without checks or allocation.
    ///
    /// `inputs` are I lanes; `scratch` is this bank's own.
    #[inline(always)]
    pub fn excite_and_add<I: Isa>(&self, inputs: &[Lane], scratch: &mut FieldScratch, rows: &mut [f64]) {
        I::call(ExciteAndAdd { bank: self, inputs, scratch, rows });
    }

    /// A joint's value, a feature or a reading.
    #[inline(always)]
    fn input<I: Isa>(&self, inputs: &[Lane], input: usize) -> Lane {
        let Some(reading) = input.checked_sub(self.input_count) else { return inputs[input] };
        let mut sum = Lane::ZERO;
        for (joint, factor) in inputs.iter().zip(&self.readings[reading]) {
            sum = I::mul_add(*joint, Lane::splat(*factor), sum);
        }
        sum
    }

    /// How fast the joints' own lines turn or shift them: for each joint j the derivative by its value of what lines over it
    /// add to the parameter `columns[j]`, at the group that [`Self::excite_and_add`] took last.
    #[inline(always)]
    pub fn own_slopes<I: Isa>(
        &self,
        columns: &[usize],
        poses: usize,
        scratch: &FieldScratch,
        slopes: &mut [Lane],
    ) {
        if self.active == MOST_ACTIVE {
            self.slopes::<I, MOST_ACTIVE>(columns, poses, &scratch.four, slopes);
        } else {
            self.slopes::<I, 3>(columns, poses, &scratch.three, slopes);
        }
    }

    #[inline(always)]
    fn slopes<I: Isa, const K: usize>(
        &self,
        columns: &[usize],
        poses: usize,
        excited: &[Excited<K>],
        slopes: &mut [Lane],
    ) {
        slopes.fill(Lane::ZERO);
        for line in &self.lines {
            let axis = &self.axes[line.axis];
            if columns.get(axis.input) == Some(&self.singles[line.single]) {
                let excited = &excited[line.axis];
                let slope = &mut slopes[axis.input];
                *slope = line.sum::<I, K>(excited, &axis.slopes::<I, K>(excited), poses, *slope);
            }
        }
    }

    #[inline(always)]
    fn group<I: Isa, const K: usize>(
        &self,
        input: impl Fn(usize) -> Lane,
        excited: &mut [Excited<K>],
        sums: &mut SumScratch,
        out: &mut [f64],
    ) {
        let (width, SumScratch { rows, singles, sag: room }) = (self.parameter_count, sums);
        let poses = LANES.min(out.len() / width);
        if poses == 1 {
            for axes in &self.abreast {
                axes.excite::<I, K>(&input, excited);
            }
        } else {
            for (axis, excited) in self.axes.iter().zip(excited.iter_mut()) {
                axis.excite::<I, K>(input(axis.input), excited);
            }
        }
        singles.fill(Lane::ZERO);
        for line in &self.lines {
            line.add::<I, K>(excited, poses, singles);
        }
        if let (Some(sag), Some(room)) = (&self.sag, room) {
            for (load, &single) in sag.at::<I>(input, poses == 1, room).iter().zip(&self.sag_singles) {
                singles[single] += *load;
            }
        }
        let mut begin = [Lane::ZERO; LANES];
        if self.joined {
            begin.copy_from_slice(&singles[..LANES]);
            I::transpose(&mut begin);
        } else {
            for (sum, &output) in singles.iter().zip(&self.singles) {
                for (out, value) in out.chunks_exact_mut(width).zip(&sum.0) {
                    out[output] += value;
                }
            }
        }
        for sheet in &self.sheets {
            sheet.add::<I, K>(excited, &begin, rows, out, width);
        }
    }
}

struct ExciteAndAdd<'a> {
    bank: &'a Compiled,
    inputs: &'a [Lane],
    scratch: &'a mut FieldScratch,
    rows: &'a mut [f64],
}

impl Kernel for ExciteAndAdd<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { bank, inputs, scratch: FieldScratch { three, four, sums }, rows } = self;
        if bank.active == MOST_ACTIVE {
            bank.group::<I, MOST_ACTIVE>(|input| bank.input::<I>(inputs, input), four, sums, rows);
        } else {
            bank.group::<I, 3>(|input| bank.input::<I>(inputs, input), three, sums, rows);
        }
    }
}

struct Evaluate<'a> {
    bank: &'a Compiled,
    values: &'a [f64],
    room: &'a mut Room,
    out: &'a mut [f64],
}

impl Kernel for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { bank, values, room: Room { inputs, field }, out } = self;
        if bank.axes.is_empty() && bank.sag.is_none() {
            return;
        }
        for (group, out) in out.chunks_mut(bank.parameter_count * LANES).enumerate() {
            load_lanes::<I>(values, bank.input_count, group * LANES, inputs);
            bank.excite_and_add::<I>(inputs, field, out);
        }
    }
}
