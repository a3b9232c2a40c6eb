//! The marginal likelihood of the measurements and its gradient by the hyper-parameters.
//!
//! Set-up unknowns have wide priors: the likelihood is the restricted one (REML, Patterson and Thompson 1971),
//! `-1/2 (log|K| + log|S^T K^-1 S| + r^T P r)` with `P = K^-1 - K^-1 S (S^T K^-1 S)^-1 S^T K^-1`. Its
//! gradient is `1/2 sum (alpha alpha^T - P) o dK` with `alpha = P r` (Rasmussen and Williams 2006, eq. 5.9). The
//! log-normal priors of the hyper-parameters are added.

use std::borrow::Cow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use faer::Mat;
use rayon::prelude::*;
use truearm_estimate::dense::{Cholesky, add_to_lower, parallelism, times};
use truearm_kinematics::{Cancel, Isa, Kernel, dispatch};

use crate::FieldError;
use crate::columns::Columns;
use crate::condensed::Condensed;
use crate::continuous::{Continuous, Pairing, PoseKernels, dot, exponent_factors, padded, pairings};
use crate::hyper::{
    AT_CONSTANT, AT_OWN, AT_OWN_CYCLES, AT_OWN_LENGTH, AT_REPEATABILITY, AT_SAG, AT_SMOOTH, AT_SMOOTH_LENGTH,
    AT_SMOOTH_LINE_LENGTH, Hyper, Product,
};
use crate::hyper_prior::HyperPrior;
use crate::information::Slopes;
use crate::pairs::{ByColumn, STEP, Step, add_products, step_at, write_covariance, write_step};
use crate::projection::Projection;
use crate::training::Training;

/// The evidence of one training set under any hyper-parameters.
pub struct Evidence<'a> {
    training: Cow<'a, Training>,
    /// Rows of zeros, as [`Condensed`] has them, and what it gained.
    silent: Vec<(usize, usize)>,
    gained: f64,
    by_column: ByColumn,
    pairings: Vec<Pairing>,
    room: Mutex<Option<Room>>,
    cancel: &'a Cancel,
}

/// Logarithm of evidence and prior, and its gradient by the logarithms of the hyper-parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    pub value: f64,
    pub gradient: Vec<f64>,
}

impl AsRef<Score> for Score {
    fn as_ref(&self) -> &Score {
        self
    }
}

/// The same with how sharply it bends.
#[derive(Debug, Clone)]
pub struct Informed {
    pub score: Score,
    /// What stands for the negative second derivatives, (H, H): never indefinite.
    pub information: Mat<f64>,
}

impl AsRef<Score> for Informed {
    fn as_ref(&self) -> &Score {
        &self.score
    }
}

/// Two matrices (R, R) that are written anew at every point.
type Room = [Mat<f64>; 2];

/// Quantities of the restricted likelihood at one point.
struct Restricted {
    factor: Cholesky,
    /// P, its lower triangle.
    projected: Mat<f64>,
    /// Q with `P = K^-1 - Q^T Q`.
    root: Mat<f64>,
    alpha: Vec<f64>,
    value: f64,
}

impl<'a> Evidence<'a> {
    /// Of a training set; looks at `cancel` before each point.
    pub fn new(training: &'a Training, cancel: &'a Cancel) -> Self {
        let Some(Condensed { training, silent, gained }) = Condensed::of(training) else {
            return Self::by_row(training, cancel);
        };
        let (by_column, pairings) = (ByColumn::new(&training), pairings(&training));
        let training = Cow::Owned(training);
        Self { training, silent, gained, by_column, pairings, room: Mutex::new(None), cancel }
    }

    /// The same of the rows as they are, for what is told of each.
    pub fn by_row(training: &'a Training, cancel: &'a Cancel) -> Self {
        let (by_column, pairings) = (ByColumn::new(training), pairings(training));
        let (training, silent) = (Cow::Borrowed(training), Vec::new());
        Self { training, silent, gained: 0.0, by_column, pairings, room: Mutex::new(None), cancel }
    }

    /// Evidence and prior with their gradient at a point.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn score(&self, hyper: &Hyper) -> Result<Score, FieldError> {
        let (score, ()) = self.scored(hyper, |_, _| ())?;
        Ok(score)
    }

    /// The same with how sharply it bends: the average information and the prior's precision.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn informed(&self, hyper: &Hyper) -> Result<Informed, FieldError> {
        let (score, mut information) = self.scored(hyper, |kernels, restricted| {
            let Self { training, by_column, pairings, .. } = self;
            let slopes = Slopes { training, by_column, pairings, hyper, kernels, alpha: &restricted.alpha };
            slopes.information(&restricted.factor, restricted.root.as_ref())
        })?;
        HyperPrior::new(hyper).add_precision(&mut information);
        Ok(Informed { score, information })
    }

    /// Evidence and prior with their gradient, and what `further` makes of the kernels and the likelihood's quantities.
    fn scored<T>(
        &self,
        hyper: &Hyper,
        further: impl FnOnce(&Continuous, &Restricted) -> T,
    ) -> Result<(Score, T), FieldError> {
        self.cancel.check()?;
        let kernels = Continuous::new(&self.training, &self.pairings, hyper);
        let [mut covariance, projected] = self.room().take().unwrap_or_else(|| self.empty());
        write_covariance(&self.training, &self.by_column, hyper, &kernels, covariance.as_mut());
        let restricted = self.restricted(covariance, projected)?;
        let mut gradient = self.gradient(hyper, &kernels, &restricted);
        let further = further(&kernels, &restricted);
        let prior = HyperPrior::new(hyper);
        let value = restricted.value + self.of_silent(hyper) + prior.value();
        *self.room() = Some([restricted.factor.into_matrix(), restricted.projected]);
        prior.add_gradient(&mut gradient);
        Ok((Score { value, gradient }, further))
    }

    /// Evidence and prior alone, in less than half of the time.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn value(&self, hyper: &Hyper) -> Result<f64, FieldError> {
        let projection = self.projection(hyper)?;
        let (_, value) = self.explained(&projection, &projection.root());
        Ok(value + self.of_silent(hyper) + HyperPrior::new(hyper).value())
    }

    /// What pulls at the rows, P r (R,): their residual over the covariance that it has under the hyper-parameters.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn pull(&self, hyper: &Hyper) -> Result<Vec<f64>, FieldError> {
        let projection = self.projection(hyper)?;
        Ok(pulled(&projection.factor, &projection.root(), &self.training.residual))
    }

    fn projection(&self, hyper: &Hyper) -> Result<Projection, FieldError> {
        self.cancel.check()?;
        let kernels = Continuous::new(&self.training, &self.pairings, hyper);
        let mut covariance = Mat::zeros(self.by_column.rows, self.by_column.rows);
        write_covariance(&self.training, &self.by_column, hyper, &kernels, covariance.as_mut());
        Projection::new(&self.training, covariance, self.cancel)
    }

    /// P r and the logarithm of the restricted likelihood.
    fn explained(&self, projection: &Projection, root: &Mat<f64>) -> (Vec<f64>, f64) {
        let Projection { factor, inner, .. } = projection;
        let alpha = pulled(factor, root, &self.training.residual);
        let fit: f64 = alpha.iter().zip(&self.training.residual).map(|(a, r)| a * r).sum();
        let known: f64 = self.training.setup_precision.iter().map(|known| known.ln()).sum();
        let value = -0.5 * (factor.log_determinant() + inner.log_determinant() - known + fit);
        (alpha, value)
    }

    /// What rows of zeros add to the restricted likelihood.
    fn of_silent(&self, hyper: &Hyper) -> f64 {
        let of = |&(row, count): &(usize, usize)| {
            count as f64 * self.training.noise_variance(row, hyper.noise).ln()
        };
        self.gained - 0.5 * self.silent.iter().map(of).sum::<f64>()
    }

    fn room(&self) -> MutexGuard<'_, Option<Room>> {
        self.room.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn empty(&self) -> Room {
        let rows = self.by_column.rows;
        [Mat::zeros(rows, rows), Mat::zeros(rows, rows)]
    }

    /// From the covariance's lower triangle and room for P.
    fn restricted(&self, covariance: Mat<f64>, mut projected: Mat<f64>) -> Result<Restricted, FieldError> {
        let projection = Projection::new(&self.training, covariance, self.cancel)?;
        let root = projection.root();
        let (alpha, value) = self.explained(&projection, &root);
        let Projection { factor, .. } = projection;
        factor.inverse_lower(projected.as_mut());
        add_to_lower(projected.as_mut(), root.transpose(), root.as_ref(), -1.0, parallelism());
        Ok(Restricted { factor, projected, root, alpha, value })
    }

    /// Sums over the poses in a fixed order, whatever the threads.
    fn gradient(&self, hyper: &Hyper, kernels: &Continuous, restricted: &Restricted) -> Vec<f64> {
        let parts: Vec<Vec<f64>> = (0..self.training.pose_count())
            .into_par_iter()
            .map(|pose| {
                dispatch(PoseGradient {
                    evidence: self,
                    hyper,
                    kernels: &kernels.poses[pose],
                    restricted,
                    pose,
                })
            })
            .collect();
        let mut gradient = vec![0.0; hyper.count()];
        for part in &parts {
            gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        for &(row, count) in &self.silent {
            let slope = self.training.noise_slope(row, hyper.noise);
            gradient[hyper.at_noise()] -=
                count as f64 * slope / self.training.noise_variance(row, hyper.noise);
        }
        gradient
    }
}

/// P r, from the factor of K and Q.
fn pulled(factor: &Cholesky, root: &Mat<f64>, residual: &[f64]) -> Vec<f64> {
    let mut alpha = factor.solve_vector(residual);
    let common = times(root.as_ref(), residual);
    let common = times(root.transpose(), &common);
    alpha.iter_mut().zip(&common).for_each(|(value, part)| *value -= part);
    alpha
}

/// `out += scale a b` for a step of its numbers.
#[inline(always)]
fn add_to<I: Isa>(out: &mut [f64], start: usize, scale: f64, a: &Step, b: &Step) {
    let mut sum = step_at(out, start);
    add_products::<I>(&mut sum, scale, a, b);
    write_step(out, start, &sum);
}

/// The columns of one pose's share of the gradient.
struct PoseGradient<'a> {
    evidence: &'a Evidence<'a>,
    hyper: &'a Hyper,
    kernels: &'a PoseKernels,
    restricted: &'a Restricted,
    pose: usize,
}

impl Kernel for PoseGradient<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<f64> {
        if self.evidence.training.rows(self.pose).is_empty() {
            return vec![0.0; self.hyper.count()];
        }
        let shares = self.shares::<I>();
        self.contract(&shares)
    }
}

/// `(alpha alpha^T - P)[r, c] J[r, p] J[c, p]` summed over the rows c of a pose, the rows r of one from it on, and the columns p
/// of a kind: constants of each class, what blocks drive of each class, `own` of each input.
struct Shares {
    sums: Columns,
    noise: [f64; 2],
}

impl Shares {
    const CLASSES: usize = 3;
    const OWN: usize = 6;

    fn constants(&self) -> impl Iterator<Item = &[f64]> {
        self.sums.iter().take(Self::CLASSES)
    }

    fn classes(&self) -> impl Iterator<Item = &[f64]> {
        self.sums.iter().take(Self::OWN).skip(Self::CLASSES)
    }

    fn own(&self) -> impl Iterator<Item = &[f64]> {
        self.sums.iter().skip(Self::OWN)
    }
}

impl PoseGradient<'_> {
    #[inline(always)]
    fn shares<I: Isa>(&self) -> Shares {
        let training = &*self.evidence.training;
        let by_column = &self.evidence.by_column;
        let rows = training.rows(self.pose);
        let first = rows.start;
        let room = (by_column.rows - first).next_multiple_of(STEP);
        let (mut weights, mut noise) = (Columns::zeros(rows.len(), room), [0.0; 2]);
        for (row, weights) in rows.clone().zip(weights.iter_mut()) {
            self.weights(row, first, &mut weights[..by_column.rows - first]);
            let slope = training.noise_slope(row, self.hyper.noise);
            noise[usize::from(training.is_orientation[row])] += weights[row - first] * slope;
        }
        let mut by_row = Columns::zeros(Shares::OWN + by_column.own.len(), room);
        for start in (0..room).step_by(STEP) {
            for (row, weights) in rows.clone().zip(weights.iter()) {
                self.add_row::<I>(row, (first, start), &step_at(weights, start), &mut by_row);
            }
        }
        Shares { sums: self.by_pose(first, &by_row), noise }
    }

    /// Adds what one row has with a step of rows, from that many behind the pose's first one on.
    #[inline(always)]
    fn add_row<I: Isa>(
        &self,
        row: usize,
        (first, start): (usize, usize),
        weights: &Step,
        by_row: &mut Columns,
    ) {
        let by_column = &self.evidence.by_column;
        let sums = by_column.class_sums::<I>(row, first + start);
        for (k, sums) in sums.constants.iter().chain(&sums.classes).enumerate() {
            add_to::<I>(by_row.get_mut(k), start, 1.0, sums, weights);
        }
        for (k, own) in by_column.own.iter().enumerate() {
            let Some((p, lever)) = own else { continue };
            let factor = lever * lever * by_column.entry(*p, row);
            let entries = by_column.step(*p, first + start);
            add_to::<I>(by_row.get_mut(Shares::OWN + k), start, factor, &entries, weights);
        }
    }

    /// Sums over the rows of each pose from this one on, in runs of eight; columns of rows from `first` on.
    fn by_pose(&self, first: usize, by_row: &Columns) -> Columns {
        let training = &*self.evidence.training;
        let poses = self.pose..training.pose_count();
        let mut by_pose = Columns::zeros(by_row.iter().len(), padded(poses.len()));
        for (sums, values) in by_pose.iter_mut().zip(by_row.iter()) {
            for (sum, pose) in sums.iter_mut().zip(poses.clone()) {
                let rows = training.rows(pose);
                *sum = values[rows.start - first..rows.end - first].iter().sum();
            }
        }
        by_pose
    }

    /// `(alpha alpha^T - P)[r, row]` for rows r from `first` on, doubled for the poses after this one.
    #[inline(always)]
    fn weights(&self, row: usize, first: usize, out: &mut [f64]) {
        let alpha = &self.restricted.alpha;
        let last = self.evidence.training.rows(self.pose).end - first;
        let projected = &self.restricted.projected;
        let column = &projected.col_as_slice(row)[first..];
        for ((weight, entry), other) in out.iter_mut().zip(column).zip(&alpha[first..]) {
            *weight = 2.0 * (alpha[row] * other - entry);
        }
        for (k, weight) in out[..last].iter_mut().enumerate() {
            let (least, most) = (row.min(first + k), row.max(first + k));
            *weight = alpha[row] * alpha[first + k] - projected[(most, least)];
        }
    }

    /// Kernels and their derivatives against the shares: half of d log evidence / d log hyper-parameter.
    #[inline(always)]
    fn contract(&self, shares: &Shares) -> Vec<f64> {
        let hyper = self.hyper;
        let mut gradient = vec![0.0; hyper.count()];
        for (class, (factor, share)) in hyper.constant.iter().zip(shares.constants()).enumerate() {
            gradient[AT_CONSTANT + class] = factor.powi(2) * share.iter().sum::<f64>();
        }
        let by_column = &self.evidence.by_column;
        let own = shares.own().zip(by_column.has_curve.iter().zip(&by_column.joint));
        for (share, (_, &joint)) in own.filter(|(_, (has_curve, _))| **has_curve) {
            let anew = hyper.repeatability_of(joint).powi(2) * share[0];
            gradient[AT_REPEATABILITY] += anew;
            if joint < hyper.unevenness.len() {
                gradient[hyper.at_unevenness() + joint] += anew;
            }
        }
        gradient[hyper.at_noise()..].copy_from_slice(&shares.noise);
        self.contract_single(shares, &mut gradient);
        for (m, (product, kernels)) in hyper.products.iter().zip(self.kernels.products.iter()).enumerate() {
            let first = hyper.at_product(m);
            self.contract_product(product, kernels, shares, &mut gradient[first..first + product.len()]);
        }
        gradient
    }

    /// `own`, `sag` and `smooth`.
    #[inline(always)]
    fn contract_single(&self, shares: &Shares, gradient: &mut [f64]) {
        let hyper = self.hyper;
        let (own, sag) = (hyper.own.powi(2), hyper.sag.powi(2));
        for (kernels, share) in self.kernels.own().zip(shares.own()) {
            gradient[AT_OWN] += own * dot(share, kernels.kernel);
            gradient[AT_OWN_LENGTH] += 0.5 * own * dot(share, kernels.by_log_length);
            gradient[AT_OWN_CYCLES] += 0.5 * own * dot(share, kernels.by_log_cycles);
        }
        for (loads, share) in self.evidence.pairings[self.pose].loads.iter().zip(shares.own()) {
            gradient[AT_SAG] += sag * dot(share, loads);
        }
        let smooth = self.kernels.smooth();
        for (class, shares) in shares.classes().enumerate() {
            let variance = hyper.smooth[class].powi(2);
            gradient[AT_SMOOTH + class] += variance * dot(shares, smooth.kernel);
            gradient[AT_SMOOTH_LENGTH] += 0.5 * variance * dot(shares, smooth.by_log_length);
            gradient[AT_SMOOTH_LINE_LENGTH] += 0.5 * variance * dot(shares, smooth.by_log_line_length);
        }
    }

    /// One product: its amplitudes, then its lengths.
    #[inline(always)]
    fn contract_product(&self, product: &Product, kernels: &[f64], shares: &Shares, gradient: &mut [f64]) {
        let mut total = vec![0.0; kernels.len()];
        for (slope, (amplitude, shares)) in
            gradient.iter_mut().zip(product.amplitudes.iter().zip(shares.classes()))
        {
            let variance = amplitude.powi(2);
            *slope += variance * dot(shares, kernels);
            for (sum, (share, kernel)) in total.iter_mut().zip(shares.iter().zip(kernels)) {
                *sum += variance * share * kernel;
            }
        }
        for (slope, (k, factor)) in gradient[Product::AMPLITUDES..].iter_mut().zip(exponent_factors(product))
        {
            *slope += factor * dot(&total, &self.evidence.pairings[self.pose].distances[k]);
        }
    }
}
