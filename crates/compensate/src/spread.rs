//! How uncertain a model is of where it puts the tool.

use truearm_bank::{Conservative, ConservativeScratch, MOVED, moved_with_setup};
use truearm_kinematics::{Isa, LANES, Lane};

use crate::aimed::{Aimed, AimedScratch};
use crate::error::{CompensateError, check_finite, check_length};
use crate::model::Model;

/// What is left of a variance by less than this part is rounding.
const ROUNDING: f64 = 1e-12;
/// Columns of a factor whose products are summed at once: sums of one would wait for one another.
const TOGETHER: usize = 2;

/// Standard deviation of the tool's position: the root of the sum of the variances of x, y and z.
#[derive(Debug, Clone)]
pub enum Spread {
    /// The covariance of some parameters: exact for a model with constants alone.
    Constant(ConstantSpread),
    /// Bounds of it over the configurations, for any model.
    Field(Box<Conservative>),
}

/// Covariance of some of the parameters, as a factor whose product with itself it is.
///
/// Behind them may stand where a device saw base and tool: a translation and a rotation vector of the base, and a
/// translation of the tool in the flange's frame. What they can take over from parameters is then uncertain together only.
#[derive(Debug, Clone)]
pub struct ConstantSpread {
    columns: Vec<usize>,
    /// Unknowns of base and tool, 9 or none.
    moved: usize,
    /// F, of which the covariance is F F^T: its columns from the diagonal down, [`TOGETHER`] beside one another.
    factor: Vec<[f64; TOGETHER]>,
}

impl ConstantSpread {
    /// From the covariance (P, P) or (P + 9, P + 9), row-major, of the parameters `columns` (P ascending indices,
    /// 5 link + k) and of base and tool.
    ///
    /// # Errors
    /// [`CompensateError::Length`] and [`CompensateError::NotFinite`].
    pub fn new(columns: Vec<usize>, covariance: &[f64]) -> Result<ConstantSpread, CompensateError> {
        let with_setup = columns.len() + MOVED;
        let moved = if covariance.len() == with_setup * with_setup { MOVED } else { 0 };
        let count = columns.len() + moved;
        check_length("the covariance", covariance.len(), count * count)?;
        check_finite("the covariance", covariance)?;
        let factor = side_by_side(&semidefinite_factor(covariance, count), count);
        Ok(ConstantSpread { factor, columns, moved })
    }

    fn check(&self, model: &Model) -> Result<(), CompensateError> {
        let (last, all) = (self.columns.last().map_or(0, |last| last + 1), model.chain.parameter_count());
        if last > all || !self.columns.is_sorted_by(|a, b| a < b) {
            return Err(CompensateError::Length {
                what: "the covariance's parameters",
                found: last,
                expected: all,
            });
        }
        Ok(())
    }

    /// Variance of the end's position: |J F|^2.
    #[inline(always)]
    fn variance<I: Isa>(&self, moved: &[[Lane; 3]; MOVED], scratch: &AimedScratch) -> Lane {
        let count = self.columns.len();
        let mut sum = Lane::ZERO;
        let mut place = 0;
        for first in (0..count + self.moved).step_by(TOGETHER) {
            let mut motions = [[Lane::ZERO; 3]; TOGETHER];
            for row in first..count + self.moved {
                let linear = if row < count { &scratch.screws[row].linear } else { &moved[row - count] };
                for column in 0..TOGETHER {
                    let factor = Lane::splat(self.factor[place][column]);
                    for i in 0..3 {
                        motions[column][i] = I::mul_add(linear[i], factor, motions[column][i]);
                    }
                }
                place += 1;
            }
            for motion in motions {
                for value in motion {
                    sum = I::mul_add(value, value, sum);
                }
            }
        }
        sum
    }
}

impl Spread {
    pub(crate) fn check(&self, model: &Model) -> Result<(), CompensateError> {
        match self {
            Self::Constant(spread) => spread.check(model),
            Self::Field(bounds) => {
                let inputs = model.joint_count() + model.feature_count;
                check_length("the standard deviation's inputs", bounds.input_count(), inputs)
            }
        }
    }

    /// Columns of the Jacobian that it needs.
    pub(crate) fn column_count(&self) -> usize {
        match self {
            Self::Constant(spread) => spread.columns.len(),
            Self::Field(_) => 0,
        }
    }

    /// Distance of a tool from the point whose standard deviation is bounded, m; zero where that of the tool itself is known.
    pub(crate) fn reach(&self, flange_from_tool: [f64; 3]) -> f64 {
        match self {
            Self::Constant(_) => 0.0,
            Self::Field(bounds) => bounds.reach(flange_from_tool),
        }
    }

    /// Memory for bounds.
    pub(crate) fn scratch(&self) -> Option<ConservativeScratch> {
        match self {
            Self::Constant(_) => None,
            Self::Field(bounds) => Some(bounds.scratch()),
        }
    }

    /// Standard deviation of the tool's position, m, at N readings.
    #[inline(always)]
    pub(crate) fn at<I: Isa>(
        &self,
        aimed: &Aimed,
        readings: &[Lane],
        alone: bool,
        scratch: &mut AimedScratch,
    ) -> Lane {
        match self {
            Self::Constant(spread) => {
                let end = aimed.sweep_columns::<I>(readings, alone, &spread.columns, scratch);
                spread.variance::<I>(&moved_with_setup::<I>(&end, &aimed.turned), scratch).sqrt()
            }
            Self::Field(bounds) => {
                let poses = if alone { 1 } else { LANES };
                aimed.set_joints::<I>(readings, scratch);
                let AimedScratch { inputs, bounds: Some(room), .. } = scratch else {
                    return Lane::splat(f64::NAN);
                };
                let [position, rotation] = bounds.group::<I>(inputs, poses, room);
                I::mul_add(rotation, Lane::splat(aimed.reach), position)
            }
        }
    }
}

/// Cholesky's factor, with zeros where a parameter adds nothing to those before it.
fn semidefinite_factor(covariance: &[f64], count: usize) -> Vec<f64> {
    let mut factor = vec![0.0_f64; count * (count + 1) / 2];
    let at = |i: usize, j: usize| i * (i + 1) / 2 + j;
    for j in 0..count {
        let known: f64 = (0..j).map(|k| factor[at(j, k)].powi(2)).sum();
        let left = covariance[j * count + j] - known;
        let pivot = if left > ROUNDING * covariance[j * count + j] { left.sqrt() } else { 0.0 };
        factor[at(j, j)] = pivot;
        for i in j + 1..count {
            let known: f64 = (0..j).map(|k| factor[at(i, k)] * factor[at(j, k)]).sum();
            let left = covariance[i * count + j] - known;
            factor[at(i, j)] = if pivot > 0.0 { left / pivot } else { 0.0 };
        }
    }
    factor
}

/// A lower triangle, row by row, as columns from the diagonal down, [`TOGETHER`] beside one another; zeros above it.
fn side_by_side(factor: &[f64], count: usize) -> Vec<[f64; TOGETHER]> {
    let mut columns = Vec::new();
    for first in (0..count).step_by(TOGETHER) {
        for row in first..count {
            let below =
                |column: usize| if column <= row { factor[row * (row + 1) / 2 + column] } else { 0.0 };
            columns.push(std::array::from_fn(|k| below(first + k)));
        }
    }
    columns
}
