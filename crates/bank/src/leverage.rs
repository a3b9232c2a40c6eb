//! How far uncertain constants move a point of the flange's frame: what its standard deviation mostly follows over the
//! configurations.
//!
//! With the covariance F F^T of the constants, and of base and tool, a point deviates by |J F|, where J is its motion by
//! them. Of a variable model no covariance of constants says all; but a factor F of few columns, found by least squares
//! of the logarithms, follows the exact standard deviation where single joints cannot tell it: close to what was measured,
//! where other combinations of joints are.

use rayon::prelude::*;
use truearm_kinematics::{
    Chain, Isa, Kernel, KinematicsError, LANES, Lane, LaneFrame, LaneParameters, OnePose, Screw,
    SharedParameters, Transform, dispatch, lane_room, load_lanes,
};

use crate::BankError;

/// Columns of a factor, as files hold it: one to a lane.
pub const FACTOR_COLUMNS: usize = 8;
const _: () = assert!(FACTOR_COLUMNS == LANES);
/// Unknowns of base and tool.
pub const MOVED: usize = 9;

/// Columns whose products are summed at once: sums of one would wait for one another.
const TOGETHER: usize = 2;

/// Deviations |J F| of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Leverage {
    chain: Chain,
    shared: SharedParameters,
    columns: Vec<usize>,
    /// A row for each constant, then for base and tool.
    factor: Vec<Lane>,
}

/// What an evaluation writes to.
#[derive(Debug, Clone)]
pub struct LeverageScratch {
    one: OnePose,
    screws: Vec<Screw>,
}

/// How the end moves with translations and rotations of the base, and with translations of the tool in the flange's frame,
/// from which the tool is turned.
#[inline(always)]
pub fn moved_with_setup<I: Isa>(end: &LaneFrame, flange_from_tool: &[f64; 9]) -> [[Lane; 3]; MOVED] {
    let (zero, one, [x, y, z]) = (Lane::ZERO, Lane::splat(1.0), end.position);
    // A closure would be compiled without the instruction set of this function.
    let mut along = [[zero; 3]; 3];
    for axis in 0..3 {
        for i in 0..3 {
            for k in 0..3 {
                let turned = Lane::splat(flange_from_tool[3 * axis + k]);
                along[axis][i] = I::mul_add(end.rotation[3 * i + k], turned, along[axis][i]);
            }
        }
    }
    [
        [one, zero, zero],
        [zero, one, zero],
        [zero, zero, one],
        [zero, -z, y],
        [z, zero, -x],
        [-y, x, zero],
        along[0],
        along[1],
        along[2],
    ]
}

impl Leverage {
    /// From a factor (5 L + 9, 8), row-major, of a chain to the flange, for a point of the flange's frame, m.
    ///
    /// # Errors
    /// [`BankError::Length`], [`BankError::NotFinite`], or if the point is not finite.
    pub fn new(to_flange: &Chain, point: [f64; 3], factor: &[f64]) -> Result<Self, BankError> {
        let (chain, rows) = (ended(to_flange, point)?, to_flange.parameter_count() + MOVED);
        if factor.len() != rows * FACTOR_COLUMNS {
            let (what, found) = ("the factor of the standard deviation", factor.len());
            return Err(BankError::Length { what, found, expected: rows * FACTOR_COLUMNS });
        }
        if !factor.iter().all(|value| value.is_finite()) {
            return Err(BankError::NotFinite { what: "factor of the standard deviation" });
        }
        let row = |row: &[f64]| Lane::from_fn(|column| row[column]);
        Ok(Self {
            shared: SharedParameters::new(&chain.nominal()),
            columns: (0..chain.parameter_count()).collect(),
            factor: factor.chunks_exact(FACTOR_COLUMNS).map(row).collect(),
            chain,
        })
    }

    /// Checks that configurations of so many inputs hold all joint values.
    ///
    /// # Errors
    /// [`BankError::Length`].
    pub fn check_inputs(&self, width: usize) -> Result<(), BankError> {
        let expected = self.chain.joint_count();
        if width < expected {
            return Err(BankError::Length { what: "a configuration", found: width, expected });
        }
        Ok(())
    }

    /// The factor (5 L + 9, 8), row-major.
    pub fn factor(&self) -> Vec<f64> {
        self.factor.iter().flat_map(|row| row.0).collect()
    }

    /// Room for a group of eight configurations.
    pub fn scratch(&self) -> LeverageScratch {
        LeverageScratch { one: OnePose::new(&self.shared), screws: vec![Screw::ZERO; self.columns.len()] }
    }

    /// Deviations of the point, m, at the joint values of a group of which the first `poses` count.
    #[inline(always)]
    pub fn group<I: Isa>(&self, inputs: &[Lane], poses: usize, scratch: &mut LeverageScratch) -> Lane {
        I::call(Group { leverage: self, inputs, poses, scratch })
    }

    #[inline(always)]
    fn deviations<I: Isa>(&self, inputs: &[Lane], poses: usize, scratch: &mut LeverageScratch) -> Lane {
        let moved = self.sweep::<I>(inputs, poses == 1, scratch);
        let count = self.columns.len();
        let motion = |row: usize| if row < count { &scratch.screws[row].linear } else { &moved[row - count] };
        if poses == 1 {
            // Columns of the factor stand side by side in place of poses.
            let mut motions = [Lane::ZERO; 3];
            for (row, factor) in self.factor.iter().enumerate() {
                let linear = motion(row);
                for i in 0..3 {
                    motions[i] = I::mul_add(Lane::splat(linear[i].0[0]), *factor, motions[i]);
                }
            }
            return Lane::splat(squared::<I>(&motions).sum()).sqrt();
        }
        let mut squares = [Lane::ZERO; FACTOR_COLUMNS];
        for first in (0..FACTOR_COLUMNS).step_by(TOGETHER) {
            let mut motions = [[Lane::ZERO; 3]; TOGETHER];
            for (row, factor) in self.factor.iter().enumerate() {
                let linear = motion(row);
                for column in 0..TOGETHER {
                    let factor = Lane::splat(factor.0[first + column]);
                    for i in 0..3 {
                        motions[column][i] = I::mul_add(linear[i], factor, motions[column][i]);
                    }
                }
            }
            for column in 0..TOGETHER {
                squares[first + column] = squared::<I>(&motions[column]);
            }
        }
        // In the order of Lane::sum, so that a pose alone gets the same bits.
        let [a, b, c, d, e, f, g, h] = squares;
        (((a + e) + (b + f)) + ((c + g) + (d + h))).sqrt()
    }

    /// Deviations (n,) of the point at inputs (n, I), m.
    pub fn at(&self, inputs: &[f64], width: usize) -> Vec<f64> {
        let mut out = vec![0.0; inputs.len() / width.max(1)];
        dispatch(Deviations { leverage: self, inputs, width, out: &mut out });
        out
    }

    /// Motions of the point by the constants, in the scratch, and by base and tool.
    #[inline(always)]
    fn sweep<I: Isa>(
        &self,
        inputs: &[Lane],
        alone: bool,
        scratch: &mut LeverageScratch,
    ) -> [[Lane; 3]; MOVED] {
        let LeverageScratch { one, screws } = scratch;
        let joints = &inputs[..self.chain.joint_count()];
        let parameters = if alone {
            one.move_to::<I>(&self.chain, joints);
            LaneParameters::One(one)
        } else {
            LaneParameters::Shared(&self.shared)
        };
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        self.chain.sweep::<I>(joints, parameters, &self.columns, &mut frame, screws);
        moved_with_setup::<I>(&frame, &Transform::IDENTITY.rotation)
    }

    /// Motions (n, 5 L + 9) of the point at inputs (n, I), m for each unit of a constant, and of base and tool.
    pub fn motions(&self, inputs: &[f64], width: usize) -> Vec<[f64; 3]> {
        let rows = self.factor.len();
        let mut motions = vec![[0.0; 3]; inputs.len() / width.max(1) * rows];
        motions.par_chunks_mut(LANES * rows).enumerate().for_each(|(group, out)| {
            dispatch(Motions { leverage: self, inputs, width, group, out });
        });
        motions
    }
}

struct Group<'a> {
    leverage: &'a Leverage,
    inputs: &'a [Lane],
    poses: usize,
    scratch: &'a mut LeverageScratch,
}

impl Kernel for Group<'_> {
    type Output = Lane;

    #[inline(always)]
    fn run<I: Isa>(self) -> Lane {
        self.leverage.deviations::<I>(self.inputs, self.poses, self.scratch)
    }
}

struct Deviations<'a> {
    leverage: &'a Leverage,
    inputs: &'a [f64],
    width: usize,
    out: &'a mut [f64],
}

impl Kernel for Deviations<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let mut lanes = vec![Lane::ZERO; lane_room(self.width)];
        let mut scratch = self.leverage.scratch();
        for (group, out) in self.out.chunks_mut(LANES).enumerate() {
            load_lanes::<I>(self.inputs, self.width, group * LANES, &mut lanes);
            let deviations = self.leverage.group::<I>(&lanes, out.len(), &mut scratch);
            out.copy_from_slice(&deviations.0[..out.len()]);
        }
    }
}

/// The chain to a point of the flange's frame.
fn ended(to_flange: &Chain, point: [f64; 3]) -> Result<Chain, KinematicsError> {
    let at = Transform { translation: point, ..Transform::IDENTITY };
    to_flange.with_end(to_flange.end().compose(&at))
}

/// Squared lengths of eight motions.
#[inline(always)]
pub fn squared<I: Isa>(motion: &[Lane; 3]) -> Lane {
    let mut sum = Lane::ZERO;
    for value in motion {
        sum = I::mul_add(*value, *value, sum);
    }
    sum
}

struct Motions<'a> {
    leverage: &'a Leverage,
    inputs: &'a [f64],
    width: usize,
    group: usize,
    out: &'a mut [[f64; 3]],
}

impl Kernel for Motions<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { leverage, inputs, width, group, out } = self;
        let mut lanes = vec![Lane::ZERO; lane_room(width)];
        load_lanes::<I>(inputs, width, group * LANES, &mut lanes);
        let mut scratch = leverage.scratch();
        let moved = leverage.sweep::<I>(&lanes, false, &mut scratch);
        let rows = leverage.factor.len();
        let by_all = scratch.screws.iter().map(|screw| &screw.linear).chain(&moved);
        for (row, motion) in by_all.enumerate() {
            for (pose, out) in out.chunks_exact_mut(rows).enumerate() {
                out[row] = motion.map(|lane| lane.0[pose]);
            }
        }
    }
}
