//! The marginal likelihood of the measurements and its gradient by the hyper-parameters.
//!
//! Set-up unknowns have flat priors: the likelihood is the restricted one (REML, Patterson and Thompson 1971),
//! `-1/2 (log|K| + log|S^T K^-1 S| + r^T P r)` with `P = K^-1 - K^-1 S (S^T K^-1 S)^-1 S^T K^-1`. Its
//! gradient is `1/2 sum (alpha alpha^T - P) o dK` with `alpha = P r` (Rasmussen and Williams 2006, eq. 5.9). The
//! log-normal priors of the hyper-parameters are added.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef};
use rayon::prelude::*;
use truearm_estimate::Cancel;
use truearm_estimate::dense::{Cholesky, column, parallelism, to_vec};
use truearm_kinematics::{Isa, Kernel, dispatch};

use crate::FieldError;
use crate::hyper::{
    AT_CONSTANT, AT_MAJOR, AT_MAJOR_LENGTHS, AT_OWN, AT_OWN_LENGTH, AT_SMOOTH, AT_SMOOTH_LENGTH, Hyper,
};
use crate::kernel::{matern, squared_exponential};
use crate::pairs::{ByColumn, ClassSums, PairKernels, PairTable, covariance};
use crate::posterior::setup_precision;
use crate::training::Training;

/// The evidence of one training set under any hyper-parameters.
pub struct Evidence<'a> {
    training: &'a Training,
    by_column: ByColumn,
    cancel: &'a Cancel,
}

/// Logarithm of evidence and prior, and its gradient by the logarithms of the hyper-parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    pub value: f64,
    pub gradient: Vec<f64>,
}

/// The continuous kernels of given hyper-parameters.
struct Continuous<'a> {
    training: &'a Training,
    hyper: &'a Hyper,
}

impl PairKernels for Continuous<'_> {
    fn fill(&self, j: usize, table: &mut PairTable) {
        let count = self.training.pose_count() - j;
        let inputs = &self.training.inputs;
        table.clear(inputs.len(), count);
        let here = self.training.values_of(j);
        for i in 0..count {
            let there = self.training.values_of(j + i);
            for (k, input) in inputs.iter().enumerate() {
                let distance = input.distance(there[k], here[k]);
                table.own[k][i] = matern(distance, self.hyper.own_length).kernel;
                table.smooth[i] += squared_exponential(distance, self.hyper.smooth_length).kernel;
            }
            let exponent: f64 = self.major_exponents(there, here).sum();
            table.major[i] = if self.hyper.major_joints.is_empty() { 0.0 } else { (-exponent).exp() };
        }
    }
}

impl Continuous<'_> {
    fn major_exponents<'b>(&'b self, there: &'b [f64], here: &'b [f64]) -> impl Iterator<Item = f64> + 'b {
        let joints = self.hyper.major_joints.iter().zip(&self.hyper.major_lengths);
        joints.map(|(&k, length)| self.training.inputs[k].distance(there[k], here[k]) / (length * length))
    }
}

/// Quantities of the restricted likelihood at one point.
struct Restricted {
    /// P, both triangles unreliable above the diagonal: only the lower one is used.
    projected: Mat<f64>,
    alpha: Vec<f64>,
    value: f64,
}

impl<'a> Evidence<'a> {
    pub fn new(training: &'a Training, cancel: &'a Cancel) -> Self {
        Self { training, by_column: ByColumn::new(training), cancel }
    }

    /// Evidence and prior with their gradient at a point.
    pub fn score(&self, hyper: &Hyper) -> Result<Score, FieldError> {
        self.cancel.check()?;
        let kernels = Continuous { training: self.training, hyper };
        let matrix = covariance(self.training, &self.by_column, hyper, &kernels);
        let restricted = self.restricted(&matrix)?;
        let mut gradient = self.gradient(hyper, &restricted);
        let mut value = restricted.value;
        for (k, (range, log)) in hyper.ranges().iter().zip(hyper.to_logs()).enumerate() {
            if range.spread.is_finite() {
                let z = (log - range.start.ln()) / range.spread;
                value -= 0.5 * z * z;
                gradient[k] -= z / range.spread;
            }
        }
        Ok(Score { value, gradient })
    }

    fn restricted(&self, matrix: &[f64]) -> Result<Restricted, FieldError> {
        let rows = self.by_column.rows;
        let error = || FieldError::NotPositiveDefinite { rows };
        let par = parallelism();
        let factor =
            Cholesky::new(MatRef::from_column_major_slice(matrix, rows, rows).to_owned(), par).ok_or_else(error)?;
        let width = self.training.setup_width;
        let setup = MatRef::from_row_major_slice(&self.training.setup, rows, width);
        let mut projected = factor.inverse();
        let spread = &projected * setup; // (R, s)
        let inner = Cholesky::new(setup_precision(setup, &spread), faer::Par::Seq).ok_or_else(error)?;
        let mut root = spread.transpose().to_owned();
        inner.solve_lower(root.as_mut());
        matmul(projected.as_mut(), Accum::Add, root.transpose(), root.as_ref(), -1.0, par);
        let residual = column(&self.training.residual);
        let mut alpha = Mat::zeros(rows, 1);
        matmul(alpha.as_mut(), Accum::Replace, projected.as_ref(), residual.as_ref(), 1.0, faer::Par::Seq);
        let alpha = to_vec(alpha.as_ref());
        let fit: f64 = alpha.iter().zip(&self.training.residual).map(|(a, r)| a * r).sum();
        let value = -0.5 * (factor.log_determinant() + inner.log_determinant() + fit);
        Ok(Restricted { projected, alpha, value })
    }

    /// Sums over the poses in a fixed order, whatever the threads.
    fn gradient(&self, hyper: &Hyper, restricted: &Restricted) -> Vec<f64> {
        let parts: Vec<Vec<f64>> = (0..self.training.pose_count())
            .into_par_iter()
            .map(|pose| dispatch(PoseGradient { evidence: self, hyper, restricted, pose }))
            .collect();
        let mut gradient = vec![0.0; hyper.to_logs().len()];
        for part in &parts {
            gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        gradient
    }
}

/// The columns of one pose's share of the gradient.
struct PoseGradient<'a> {
    evidence: &'a Evidence<'a>,
    hyper: &'a Hyper,
    restricted: &'a Restricted,
    pose: usize,
}

impl Kernel for PoseGradient<'_> {
    type Output = Vec<f64>;

    fn run<I: Isa>(self) -> Vec<f64> {
        let shares = self.shares::<I>();
        self.contract(&shares)
    }
}

/// For each pose i: `sum over its rows r of (alpha alpha^T - P)[r, c] J[r, p] J[c, p]`, by what drives p.
struct Shares {
    constant: Vec<f64>,
    classes: [Vec<f64>; 3],
    own: Vec<Vec<f64>>,
    noise: [f64; 2],
}

impl PoseGradient<'_> {
    #[inline(always)]
    fn shares<I: Isa>(&self) -> Shares {
        let training = self.evidence.training;
        let by_column = &self.evidence.by_column;
        let rows = training.rows(self.pose);
        let first = rows.start;
        let count = training.pose_count() - self.pose;
        let zeros = || vec![0.0; count];
        let mut shares = Shares {
            constant: zeros(),
            classes: [zeros(), zeros(), zeros()],
            own: vec![zeros(); by_column.own.len()],
            noise: [0.0; 2],
        };
        let mut sums = ClassSums::default();
        let mut weights = vec![0.0; by_column.rows - first];
        for row in rows {
            sums.fill::<I>(by_column, row, first);
            self.weights(row, first, &mut weights);
            let own_variance = training.noise_variance(row, [0.0; 2]);
            let noise = training.noise_variance(row, self.hyper.noise) - own_variance;
            shares.noise[usize::from(training.is_orientation[row])] += weights[row - first] * noise;
            self.gather(&sums.constant, &weights, first, &mut shares.constant);
            for class in 0..3 {
                self.gather(&sums.classes[class], &weights, first, &mut shares.classes[class]);
            }
            for (own, share) in by_column.own.iter().zip(&mut shares.own) {
                let Some((p, lever)) = own else { continue };
                let factor = lever * lever * by_column.jacobian[p * by_column.rows + row];
                let column = by_column.column(*p, first);
                for (r, (entry, weight)) in column.iter().zip(&weights).enumerate() {
                    share[by_column.pose[first + r] - self.pose] += factor * entry * weight;
                }
            }
        }
        shares
    }

    /// `(alpha alpha^T - P)[r, row]` for rows r from `first` on, doubled for the poses after this one.
    fn weights(&self, row: usize, first: usize, out: &mut [f64]) {
        let alpha = &self.restricted.alpha;
        let last = self.evidence.training.rows(self.pose).end;
        for (r, weight) in out.iter_mut().enumerate() {
            let at = first + r;
            let (low, high) = (at.max(row), at.min(row));
            let value = alpha[row] * alpha[at] - self.restricted.projected[(low, high)];
            *weight = if at < last { value } else { 2.0 * value };
        }
    }

    #[inline(always)]
    fn gather(&self, sums: &[f64], weights: &[f64], first: usize, out: &mut [f64]) {
        let pose = &self.evidence.by_column.pose[first..];
        for ((sum, weight), pose) in sums.iter().zip(weights).zip(pose) {
            out[pose - self.pose] += sum * weight;
        }
    }

    /// Kernels and their derivatives against the shares: half of d log evidence / d log hyper-parameter.
    fn contract(&self, shares: &Shares) -> Vec<f64> {
        let (training, hyper) = (self.evidence.training, self.hyper);
        let kernels = Continuous { training, hyper };
        let mut gradient = vec![0.0; hyper.to_logs().len()];
        let here = training.values_of(self.pose);
        let lengths = hyper.major_joints.len();
        gradient[AT_CONSTANT] = hyper.constant.powi(2) * shares.constant.iter().sum::<f64>();
        for i in 0..shares.constant.len() {
            let there = training.values_of(self.pose + i);
            let (mut smooth, mut smooth_slope) = (0.0, 0.0);
            for (k, input) in training.inputs.iter().enumerate() {
                let distance = input.distance(there[k], here[k]);
                let value = squared_exponential(distance, hyper.smooth_length);
                smooth += value.kernel;
                smooth_slope += value.by_log_length;
                if self.evidence.by_column.own[k].is_some() {
                    let own = matern(distance, hyper.own_length);
                    let share = hyper.own.powi(2) * shares.own[k][i];
                    gradient[AT_OWN] += share * own.kernel;
                    gradient[AT_OWN_LENGTH] += 0.5 * share * own.by_log_length;
                }
            }
            let exponents: Vec<f64> = kernels.major_exponents(there, here).collect();
            let major = if lengths == 0 { 0.0 } else { (-exponents.iter().sum::<f64>()).exp() };
            let mut major_total = 0.0;
            for class in 0..3 {
                let smooth_share = hyper.smooth[class].powi(2) * shares.classes[class][i];
                let major_share = hyper.major[class].powi(2) * shares.classes[class][i] * major;
                gradient[AT_SMOOTH + class] += smooth_share * smooth;
                gradient[AT_SMOOTH_LENGTH] += 0.5 * smooth_share * smooth_slope;
                gradient[AT_MAJOR + class] += major_share;
                major_total += major_share;
            }
            for (k, exponent) in exponents.iter().enumerate() {
                gradient[AT_MAJOR_LENGTHS + k] += major_total * exponent;
            }
        }
        gradient[AT_MAJOR_LENGTHS + lengths] = shares.noise[0];
        gradient[AT_MAJOR_LENGTHS + lengths + 1] = shares.noise[1];
        gradient
    }
}
