//! A standard deviation that costs next to nothing to evaluate and is never too small.
//!
//! Two numbers of a configuration: `s_p`, the root of the trace of the covariance of the position (m) of a point of the
//! flange's frame, the centre, and `s_r`, that of the rotation vector (rad). A point of the tool at the distance `r` from
//! the centre deviates by no more than `s_p + r s_r`: by Minkowski's inequality the root mean square of `p + w x r` is at
//! most that of `p` plus `r` times that of `w`. The centre is where was measured: of the flange itself positions alone tell
//! little. Each is `exp(level + sum of tables)`, that of the position times a [`Leverage`]: B-spline tables over every
//! input and one over a few inputs together, fitted to exact values and raised, where a calibration is made. Where an input leaves the range
//! that the tables were fitted in, and nowhere above, stands the largest value that the prior allows.

use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch, lane_room, load_lanes};

use crate::BankError;
use crate::bank::Bank;
use crate::compiled::{Compiled, FieldScratch};
use crate::leverage::{Leverage, LeverageScratch};

/// What is bounded: position (m) and rotation (rad).
pub const BOUNDED: usize = 2;

/// Everything that a [`Conservative`] is, as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct ConservativeParts {
    /// Tables of both logarithms: outputs 0 and 1 of a bank with two parameters.
    pub tables: Bank,
    /// What the position's is a multiple of; one where there is none.
    pub leverage: Option<Leverage>,
    /// Added to the tables.
    pub level: [f64; BOUNDED],
    /// Never exceeded, and the value outside the ranges; m and rad.
    pub largest: [f64; BOUNDED],
    /// The point whose position is meant, in the flange's frame, m.
    pub centre: [f64; 3],
    /// Where each input may lie, (I,); infinite for whole turns.
    pub ranges: Vec<[f64; 2]>,
    /// Median ratio to the exact values at configurations that took no part in the fit.
    pub looseness: [f64; BOUNDED],
}

/// Bounds of the standard deviation as a function of the inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Conservative {
    parts: ConservativeParts,
    compiled: Compiled,
}

/// What an evaluation writes to.
#[derive(Debug, Clone)]
pub struct ConservativeScratch {
    tables: FieldScratch,
    leverage: Option<LeverageScratch>,
}

impl Conservative {
    /// Prepares stored parts for evaluation.
    ///
    /// # Errors
    /// [`BankError::Length`] where the parts do not fit together, [`BankError::NotFinite`].
    pub fn new(parts: ConservativeParts) -> Result<Self, BankError> {
        let length = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(BankError::Length { what, found, expected }) }
        };
        length("tables of the standard deviation", parts.tables.parameter_count, BOUNDED)?;
        length("ranges of the standard deviation", parts.ranges.len(), parts.tables.input_count)?;
        parts.tables.check()?;
        if let Some(leverage) = &parts.leverage {
            leverage.check_inputs(parts.tables.input_count)?;
        }
        let mut values = parts.level.iter().chain(&parts.largest).chain(&parts.centre);
        if !values.all(|value| value.is_finite()) {
            return Err(BankError::NotFinite { what: "bounds of the standard deviation" });
        }
        let compiled = parts.tables.compiled();
        Ok(Self { parts, compiled })
    }

    /// What it is made of.
    pub fn parts(&self) -> &ConservativeParts {
        &self.parts
    }

    /// Distance of a point of the flange's frame from the centre, m.
    pub fn reach(&self, point: [f64; 3]) -> f64 {
        let apart = point.iter().zip(&self.parts.centre).map(|(a, b)| (a - b).powi(2));
        apart.sum::<f64>().sqrt()
    }

    /// Inputs of a configuration: joints in order, then features.
    pub fn input_count(&self) -> usize {
        self.parts.tables.input_count
    }

    /// Room for a group of eight configurations.
    pub fn scratch(&self) -> ConservativeScratch {
        ConservativeScratch {
            tables: self.compiled.scratch(),
            leverage: self.parts.leverage.as_ref().map(Leverage::scratch),
        }
    }

    /// Both numbers of a group's first `poses` configurations, at most eight; `inputs` are I lanes. The others get the
    /// largest value. Without checks or allocation.
    #[inline(always)]
    pub fn group<I: Isa>(
        &self,
        inputs: &[Lane],
        poses: usize,
        scratch: &mut ConservativeScratch,
    ) -> [Lane; BOUNDED] {
        let mut logs = [0.0; BOUNDED * LANES];
        self.compiled.excite_and_add::<I>(inputs, &mut scratch.tables, &mut logs[..BOUNDED * poses]);
        let mut units = [Lane::splat(1.0); BOUNDED];
        if let (Some(leverage), Some(room)) = (&self.parts.leverage, &mut scratch.leverage) {
            units[0] = leverage.group::<I>(inputs, poses, room);
        }
        let mut inside = [true; LANES];
        for (lane, range) in inputs.iter().zip(&self.parts.ranges) {
            for (inside, value) in inside.iter_mut().zip(&lane.0) {
                *inside &= range[0] <= *value && *value <= range[1];
            }
        }
        let mut out = [Lane::splat(self.parts.largest[0]), Lane::splat(self.parts.largest[1])];
        for (k, lane) in out.iter_mut().enumerate() {
            for (pose, value) in lane.0[..poses].iter_mut().enumerate() {
                if inside[pose] {
                    let tables = (logs[BOUNDED * pose + k] + self.parts.level[k]).exp();
                    *value = value.min(units[k].0[pose] * tables);
                }
            }
        }
        out
    }

    /// Both numbers of each configuration, inputs (n, I) to (n, 2).
    ///
    /// # Errors
    /// [`BankError::Length`].
    pub fn std(&self, inputs: &[f64]) -> Result<Vec<f64>, BankError> {
        let poses = inputs.len() / self.input_count().max(1);
        let expected = poses * self.input_count();
        if expected != inputs.len() {
            return Err(BankError::Length { what: "inputs", found: inputs.len(), expected });
        }
        let mut out = vec![0.0; BOUNDED * poses];
        dispatch(All { field: self, inputs, out: &mut out });
        Ok(out)
    }
}

struct All<'a> {
    field: &'a Conservative,
    inputs: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for All<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let count = self.field.input_count();
        let mut lanes = vec![Lane::ZERO; lane_room(count)];
        let mut scratch = self.field.scratch();
        for (group, out) in self.out.chunks_mut(BOUNDED * LANES).enumerate() {
            load_lanes::<I>(self.inputs, count, group * LANES, &mut lanes);
            let std = self.field.group::<I>(&lanes[..count], out.len() / BOUNDED, &mut scratch);
            for (pose, out) in out.chunks_exact_mut(BOUNDED).enumerate() {
                out[0] = std[0].0[pose];
                out[1] = std[1].0[pose];
            }
        }
    }
}
