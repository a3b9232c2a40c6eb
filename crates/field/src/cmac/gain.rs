//! Linearised measurements as patterns: a residual asks for the smallest change of CEPs that explains it.

use faer::{Mat, Par};
use truearm_estimate::{EstimateError, PoseRows, column_unit, dense::Cholesky, scaled_jacobian};
use truearm_kinematics::{Isa, LANES, Lane};

use crate::cmac::network::Network;
use crate::cmac::training::{Measure, Patterns, Trained, TrainingOptions, check_length};

/// Linearised measurements of n poses: `residual = jacobian CEP + noise`.
#[derive(Debug, Clone, Copy)]
pub struct LinearRows<'a> {
    /// Inputs of the network, (n, I).
    pub inputs: &'a [f64],
    /// (n, m, P): three rows of each target's position, then three of the orientation if it was measured.
    pub jacobian: &'a [f64],
    /// (n, m), m and rad.
    pub residual: &'a [f64],
    /// Driven parameters, (P,): 5 * link + (theta, d, a, alpha, beta).
    pub columns: &'a [usize],
    /// Targets of a pose.
    pub targets: usize,
}

impl LinearRows<'_> {
    /// Rows of a pose, m.
    pub fn rows_per_pose(&self, poses: usize) -> usize {
        self.residual.len() / poses.max(1)
    }

    /// Poses n and rows of a pose m, if all lengths fit and all values are finite.
    ///
    /// # Errors
    /// [`EstimateError::Length`], [`EstimateError::NotFinite`].
    pub fn check(&self, network: &Network) -> Result<(usize, usize), EstimateError> {
        let poses = network.check_inputs(self.inputs)?;
        let rows = self.rows_per_pose(poses);
        let positions = 3 * self.targets;
        if rows == 0 || (rows != positions && rows != positions + 3) {
            let rule = "a pose has three for each target, and three more where orientation was measured: give the \
                        number of targets";
            return Err(EstimateError::Option {
                what: "the number of rows of a pose",
                value: rows as f64,
                rule,
            });
        }
        check_length("the driven parameters", self.columns.len(), network.output_count())?;
        check_length("the residuals", self.residual.len(), poses * rows)?;
        check_length("the Jacobian", self.jacobian.len(), poses * rows * self.columns.len())?;
        let finite = |what, values: &[f64], width: usize| match values.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(EstimateError::NotFinite { what, pose: at / width.max(1) }),
            None => Ok(()),
        };
        finite("a residual", self.residual, rows)?;
        finite("a Jacobian's entry", self.jacobian, rows * self.columns.len())?;
        Ok((poses, rows))
    }

    /// Rows and columns in metres and in units of a millimetre's worth: (n, m, P) and (n, m).
    pub fn scaled(&self, rows: usize) -> (Vec<f64>, Vec<f64>) {
        let kinds = PoseRows::new(rows, self.targets);
        let residual = self.residual.iter().enumerate().map(|(at, r)| r * kinds.unit(at)).collect();
        (scaled_jacobian(self.jacobian, kinds, self.columns), residual)
    }
}

impl Network {
    /// Train on measurements by (A5): what stands for CEP - CEP' is the smallest change of CEPs, lengths in mm and
    /// angles in 1/300 rad, that explains what is left of the residual. Weights start at zero, the mean of the CEPs
    /// that are added to constants fitted to the same rows.
    ///
    /// # Errors
    /// As [`Network::train`].
    pub fn train_on_rows(
        &self,
        rows: &LinearRows<'_>,
        options: &TrainingOptions,
    ) -> Result<Trained, EstimateError> {
        let (poses, per_pose) = rows.check(self)?;
        let mut start = self.clone();
        start.fill(&vec![0.0; self.output_count()]);
        start.train_from(&Explained::new(rows, poses, per_pose)?, options)
    }
}

/// A share of the largest diagonal entry that keeps rows of no information from dividing by zero.
const RIDGE: f64 = 1e-12;

struct Explained<'a> {
    inputs: &'a [f64],
    /// Scaled Jacobians as lanes, (n, m, lanes); zero where padded.
    jacobian: Vec<Lane>,
    /// Scaled residuals, (n, m).
    residual: Vec<f64>,
    /// Units of the CEPs per scaled unit, (lanes,).
    units: Vec<Lane>,
    /// Scaled changes per scaled residual, (n, m, lanes).
    gain: Vec<Lane>,
    rows: usize,
}

impl<'a> Explained<'a> {
    fn new(rows: &LinearRows<'a>, poses: usize, per_pose: usize) -> Result<Self, EstimateError> {
        let (jacobian, residual) = rows.scaled(per_pose);
        let width = rows.columns.len();
        let mut gain = Vec::with_capacity(jacobian.len());
        for pose in 0..poses {
            let block = &jacobian[pose * per_pose * width..(pose + 1) * per_pose * width];
            gain.extend(
                pseudo_inverse(block, per_pose, width)
                    .ok_or(EstimateError::NotFinite { what: "the Jacobian's inverse", pose })?,
            );
        }
        let units: Vec<f64> = rows.columns.iter().map(|&column| column_unit(column)).collect();
        Ok(Self {
            inputs: rows.inputs,
            jacobian: lanes(&jacobian, width),
            residual,
            units: lanes(&units, width),
            gain: lanes(&gain, width),
            rows: per_pose,
        })
    }
}

/// J^T (J J^T)^-1 transposed, (m, P).
fn pseudo_inverse(block: &[f64], rows: usize, width: usize) -> Option<Vec<f64>> {
    let jacobian = Mat::from_fn(rows, width, |i, j| block[i * width + j]);
    let mut square = &jacobian * jacobian.transpose();
    let ridge = RIDGE * (0..rows).map(|i| square[(i, i)]).fold(f64::MIN_POSITIVE, f64::max);
    (0..rows).for_each(|i| square[(i, i)] += ridge);
    let mut gain = jacobian;
    Cholesky::new(square, Par::Seq)?.solve(gain.as_mut());
    Some((0..rows * width).map(|at| gain[(at / width, at % width)]).collect())
}

/// Rows of `width` numbers as lanes, padded with zeros.
fn lanes(values: &[f64], width: usize) -> Vec<Lane> {
    let lane = |part: &[f64]| Lane(std::array::from_fn(|i| part.get(i).copied().unwrap_or_default()));
    values.chunks_exact(width).flat_map(|row| row.chunks(LANES)).map(lane).collect()
}

impl Patterns for Explained<'_> {
    #[inline(always)]
    fn inputs(&self) -> &[f64] {
        self.inputs
    }

    #[inline(always)]
    fn error<I: Isa>(&self, pattern: usize, output: &[Lane], error: &mut [Lane], measure: &mut Measure) {
        let lanes = self.units.len();
        error.fill(Lane::ZERO);
        for row in pattern * self.rows..(pattern + 1) * self.rows {
            let jacobian = &self.jacobian[row * lanes..(row + 1) * lanes];
            let mut predicted = Lane::ZERO;
            for k in 0..lanes {
                predicted = I::mul_add(jacobian[k] * self.units[k], output[k], predicted);
            }
            let left = self.residual[row] - predicted.sum();
            let gain = &self.gain[row * lanes..(row + 1) * lanes];
            for k in 0..lanes {
                error[k] = I::mul_add(gain[k], Lane::splat(left), error[k]);
            }
            let mut alone = Lane::ZERO;
            alone.0[0] = left;
            measure.add(alone);
        }
        for k in 0..lanes {
            let mut inverse = Lane::ZERO;
            for i in 0..LANES {
                inverse.0[i] =
                    if self.units[k].0[i] > 0.0 { error[k].0[i] / self.units[k].0[i] } else { 0.0 };
            }
            error[k] = inverse;
        }
        measure.count(self.rows);
    }
}
