//! The posterior in data space: the covariance of all rows is factored.
//!
//! With K the covariance of the rows that cells and noise imply, and flat set-up columns S,
//! `s = (S^T K^-1 S)^-1 S^T K^-1 r`, `alpha = K^-1 (r - S s)`, and the weights are prior covariance times
//! excitations times Jacobian times alpha (universal kriging; Rasmussen and Williams 2006, section 2.7).

use std::ops::Range;

use faer::{Mat, MatMut};
use rayon::prelude::*;
use truearm_bank::{Bank, Block};
use truearm_estimate::dense::{Cholesky, parallelism, product, times};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::model::{BlockPlan, Excited, Implied, Model};
use crate::pairs::write_covariance;
use crate::posterior::{LeaveOneOut, Query, Solution};
use crate::projection::{Projection, setup_columns};

/// Poses whose covariances are found together.
const BATCH: usize = 64;
/// Rows of a configuration whose covariances with a training row are summed together.
const SIDE_BY_SIDE: usize = 4;

/// The rows' covariance, factored.
pub struct DataSpace {
    pub model: Model,
    excited: Vec<Excited>,
    pub(crate) projection: Projection,
    cancel: Cancel,
}

impl DataSpace {
    /// Factors the covariance of a model's rows.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn new(model: Model, cancel: &Cancel) -> Result<Self, FieldError> {
        let training = &model.training;
        let excited: Vec<Excited> =
            (0..training.pose_count()).map(|pose| model.cells.excite(training.values_of(pose))).collect();
        let rows = training.row_count();
        let kernels = Implied { cells: &model.cells, excited: &excited };
        let mut matrix = Mat::zeros(rows, rows);
        write_covariance(training, &model.by_column, &model.hyper, &kernels, matrix.as_mut());
        cancel.check()?;
        let projection = Projection::new(training, matrix, cancel)?;
        Ok(Self { model, excited, projection, cancel: cancel.clone() })
    }

    /// Constants, field and set-up from residuals (R,).
    pub fn solve(&self, residual: &[f64]) -> Solution {
        let training = &self.model.training;
        let step = self.setup_step(residual);
        let alpha = self.alpha(residual, &step);
        let pull = self.pull(&alpha);
        let columns = training.columns.len();
        let constant = |p: usize| {
            let total: f64 = (0..training.pose_count()).map(|pose| pull[pose * columns + p]).sum();
            self.model.constant_deviation(p).powi(2) * total
        };
        let mut bank = Bank::empty(training.input_count(), training.parameter_count);
        bank.blocks = self.model.plans().iter().map(|plan| self.block(plan, &pull)).collect();
        bank.sag = self.model.sag(self.sag_weights(&pull));
        Solution { constant: (0..columns).map(constant).collect(), bank, setup: step }
    }

    /// Weight of every lever, (L,).
    fn sag_weights(&self, pull: &[f64]) -> Vec<f64> {
        let training = &self.model.training;
        let columns = training.columns.len();
        let weight = |(lever, term): (usize, &Option<(usize, f64)>)| {
            let Some((p, deviation)) = *term else { return 0.0 };
            let of = |pose: usize| pull[pose * columns + p] * training.levers_of(pose)[lever];
            deviation.powi(2) * (0..training.pose_count()).map(of).sum::<f64>()
        };
        self.model.sag_terms().iter().enumerate().map(weight).collect()
    }

    fn setup_step(&self, residual: &[f64]) -> Vec<f64> {
        let right = times(self.projection.spread.transpose(), residual);
        if right.is_empty() { Vec::new() } else { self.projection.inner.solve_vector(&right) }
    }

    fn alpha(&self, residual: &[f64], step: &[f64]) -> Vec<f64> {
        let explained = times(setup_columns(&self.model.training), step);
        let rest: Vec<f64> = residual.iter().zip(&explained).map(|(all, part)| all - part).collect();
        self.projection.factor.solve_vector(&rest)
    }

    /// J_i^T alpha_i of every pose, (n, P).
    fn pull(&self, alpha: &[f64]) -> Vec<f64> {
        let width = self.model.training.columns.len();
        let mut pull = vec![0.0; self.model.training.pose_count() * width];
        for (pose, out) in pull.chunks_exact_mut(width).enumerate() {
            for row in self.model.training.rows(pose) {
                let entries = self.model.training.jacobian_row(row);
                out.iter_mut().zip(entries).for_each(|(x, entry)| *x += entry * alpha[row]);
            }
        }
        pull
    }

    /// Weights of one block: excitations times pull, spread by the prior along each axis.
    fn block(&self, plan: &BlockPlan, pull: &[f64]) -> Block {
        let grid = plan.grid();
        let training = &self.model.training;
        let (width, columns) = (plan.driven.len(), training.columns.len());
        let mut weights = vec![0.0; grid.cell_count() * width];
        for pose in 0..training.pose_count() {
            let source = &pull[pose * columns..(pose + 1) * columns];
            grid.visit(training.values_of(pose), |cell, grade| {
                let target = &mut weights[cell * width..(cell + 1) * width];
                for (weight, &(p, variance)) in target.iter_mut().zip(&plan.driven) {
                    *weight += grade * variance * source[p];
                }
            });
        }
        let mut inner = width;
        for (_, cells) in plan.axes.iter().rev() {
            weights = cells.spread(&weights, inner);
            inner *= cells.axis.count;
        }
        training.block(plan, grid, weights)
    }

    /// What each pose's residuals (R,) would be if it had taken no part.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn leave_one_out(&self, residual: &[f64]) -> Result<LeaveOneOut, FieldError> {
        let training = &self.model.training;
        let alpha = self.alpha(residual, &self.setup_step(residual));
        let ranges: Vec<Range<usize>> = (0..training.pose_count()).map(|pose| training.rows(pose)).collect();
        let inverses = self.projection.factor.inverse_blocks(&ranges, &self.cancel)?;
        let root = self.projection.root();
        let mut out = LeaveOneOut::zeros(training.row_count());
        for (pose, (range, inverse)) in ranges.into_iter().zip(inverses).enumerate() {
            let (start, count) = (range.start, range.len());
            let block = Mat::from_fn(count, count, |i, j| {
                let setup: f64 = (0..root.nrows()).map(|k| root[(k, start + i)] * root[(k, start + j)]).sum();
                inverse[(i, j)] - setup
            });
            let error = FieldError::NotPositiveDefinite { rows: count };
            let precision = Cholesky::new(block, faer::Par::Seq).ok_or(error)?;
            let left_out = precision.solve_vector(&alpha[range]);
            out.set(&self.model, pose, &left_out, precision.inverse())?;
        }
        Ok(out)
    }

    /// Residuals of whole blocks of poses that would have taken no part, with their variances, block by block.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn leave_blocks_out(
        &self,
        residual: &[f64],
        blocks: &[Vec<usize>],
    ) -> Result<Vec<Vec<LeftOut>>, FieldError> {
        let model = &self.model;
        let training = &model.training;
        let alpha = self.alpha(residual, &self.setup_step(residual));
        let inverse = self.projection.factor.inverse();
        let root = self.projection.root();
        let mut out = Vec::new();
        for block in blocks {
            let rows: Vec<usize> = block.iter().flat_map(|&pose| training.rows(pose)).collect();
            let own = Mat::from_fn(root.nrows(), rows.len(), |k, i| root[(k, rows[i])]);
            let mut precision = product(own.transpose(), own.as_ref()) * faer::Scale(-1.0);
            for j in 0..rows.len() {
                (0..rows.len()).for_each(|i| precision[(i, j)] += inverse[(rows[i], rows[j])]);
            }
            let error = FieldError::NotPositiveDefinite { rows: rows.len() };
            let factor = Cholesky::new(precision, parallelism()).ok_or(error)?;
            let local: Vec<f64> = rows.iter().map(|&row| alpha[row]).collect();
            let left_out = factor.solve_vector(&local);
            let covariance = factor.inverse();
            let (mut at, mut left) = (0, Vec::with_capacity(rows.len()));
            for &pose in block {
                let range = training.rows(pose);
                let anew = model.noise_covariance(&training.jacobian, range.clone());
                let noise =
                    |i: usize| training.noise_variance(range.start + i, model.hyper.noise) + anew[(i, i)];
                let known = |i: usize| (covariance[(at + i, at + i)] - noise(i)).max(0.0);
                left.extend((0..range.len()).map(|i| LeftOut {
                    residual: left_out[at + i],
                    noise: noise(i),
                    known: known(i),
                }));
                at += range.len();
            }
            out.push(left);
        }
        Ok(out)
    }

    /// Covariance (n, m, m) of the rows of each configuration of a query.
    pub fn covariance(&self, query: &Query) -> Vec<f64> {
        let size = query.rows * query.rows;
        let mut out = vec![0.0; query.poses() * size];
        out.par_chunks_mut(BATCH * size).enumerate().for_each(|(batch, out)| {
            let first = batch * BATCH;
            self.batch_covariance(query, first..first + out.len() / size, out);
        });
        out
    }

    fn batch_covariance(&self, query: &Query, poses: Range<usize>, out: &mut [f64]) {
        let rows = query.rows;
        let excited = self.excite(query, poses.clone());
        let (learned, lost) = self.reduced(query, poses.clone(), &excited);
        for (index, pose) in poses.enumerate() {
            let priors = self.model.variances(&excited[index]);
            let out = &mut out[index * rows * rows..(index + 1) * rows * rows];
            for i in 0..rows {
                for j in 0..=i {
                    let (a, b) = (index * rows + i, index * rows + j);
                    let prior = query.prior(pose, (i, j), &priors);
                    let learned = learned.col(a).transpose() * learned.col(b);
                    let setup = lost.col(a).transpose() * lost.col(b);
                    let entry = prior - learned + setup;
                    (out[i * rows + j], out[j * rows + i]) = (entry, entry);
                }
            }
        }
    }

    /// Covariance (k m, l m) of the rows of some configurations of a query with those of some others, or of the same.
    pub fn joint(&self, query: &Query, left: Range<usize>, right: Range<usize>) -> Mat<f64> {
        let excited = self.excite(query, 0..query.poses());
        let (learned, lost) = self.reduced(query, 0..query.poses(), &excited);
        let mut joint = product(query.part(&learned, &left).transpose(), query.part(&learned, &right))
            * faer::Scale(-1.0);
        joint += product(query.part(&lost, &left).transpose(), query.part(&lost, &right));
        let symmetric = left == right;
        let prior = |a: usize| -> Vec<f64> {
            let others = right.start..if symmetric { a + 1 } else { right.end };
            let covariances = self.model.covariances(&excited[a], &excited[others.clone()]);
            let each = others.zip(covariances.chunks_exact(self.model.training.columns.len()));
            each.flat_map(|(b, covariances)| query.cross((a, b), covariances)).collect()
        };
        let priors: Vec<Vec<f64>> = left.into_par_iter().map(prior).collect();
        for (a, blocks) in priors.iter().enumerate() {
            add_blocks(&mut joint, query.rows, a, blocks, symmetric);
        }
        joint
    }

    /// Covariance (P, P) of the columns' constants alone, whatever varies beside them.
    pub fn constants(&self) -> Mat<f64> {
        let training = &self.model.training;
        let columns = training.columns.len();
        let variance = |p: usize| self.model.constant_deviation(p).powi(2);
        let entry = |row: usize, p: usize| training.jacobian_row(row)[p] * variance(p);
        let (learned, lost) = self.solved(Mat::from_fn(training.row_count(), columns, entry), None);
        let prior = Mat::from_fn(columns, columns, |i, j| if i == j { variance(i) } else { 0.0 });
        prior - product(learned.transpose(), learned.as_ref()) + product(lost.transpose(), lost.as_ref())
    }

    /// The cells that some configurations of a query excite.
    fn excite(&self, query: &Query, poses: Range<usize>) -> Vec<Excited> {
        poses.map(|pose| self.model.cells.excite(query.values_of(pose))).collect()
    }

    /// What the rows of some configurations, which excite these cells, have in common with the training rows (R, k), and
    /// with the set-up's unknowns (s, k): learned^T learned is taken from their prior covariance, lost^T lost added to it.
    fn reduced(&self, query: &Query, poses: Range<usize>, excited: &[Excited]) -> (Mat<f64>, Mat<f64>) {
        let training = &self.model.training;
        let (rows, width) = (query.rows, training.setup_width);
        let mut cross = Mat::zeros(training.row_count(), poses.len() * rows);
        for (index, (pose, excited)) in poses.clone().zip(excited).enumerate() {
            self.cross(excited, query.jacobian_of(pose), cross.as_mut().subcols_mut(index * rows, rows));
        }
        let setup = query.setup.map(|setup| &setup[poses.start * rows * width..poses.end * rows * width]);
        self.solved(cross, setup)
    }

    /// The same for what has prior covariances (R, k) with the training rows, and set-up columns (k, s).
    fn solved(&self, mut cross: Mat<f64>, setup: Option<&[f64]>) -> (Mat<f64>, Mat<f64>) {
        let width = self.model.training.setup_width;
        let mut lost = product(self.projection.spread.transpose(), cross.as_ref()) * faer::Scale(-1.0);
        if let Some(setup) = setup {
            for (k, line) in setup.chunks_exact(width).enumerate() {
                (0..width).for_each(|i| lost[(i, k)] += line[i]);
            }
        }
        self.projection.factor.solve_lower(cross.as_mut());
        self.projection.inner.solve_lower(lost.as_mut());
        (cross, lost)
    }

    /// Covariance of all training rows with the rows (m, P) of one configuration: (R, m).
    fn cross(&self, excited: &Excited, rows: &[f64], mut out: MatMut<f64>) {
        let training = &self.model.training;
        let columns = training.columns.len();
        let count = rows.len() / columns;
        // Column by column, so that the sums of some rows go on side by side.
        let own = |first: usize| -> Vec<[f64; SIDE_BY_SIDE]> {
            let entry = |p: usize, k: usize| if k < count { rows[k * columns + p] } else { 0.0 };
            (0..columns).map(|p| std::array::from_fn(|k| entry(p, first + k))).collect()
        };
        let own: Vec<_> = (0..count).step_by(SIDE_BY_SIDE).map(own).collect();
        let covariances = self.model.covariances(excited, &self.excited);
        for (pose, variances) in covariances.chunks_exact(columns).enumerate() {
            for row in training.rows(pose) {
                for (part, own) in own.iter().enumerate() {
                    let mut sums = [0.0; SIDE_BY_SIDE];
                    let entries = training.jacobian_row(row).iter().zip(variances);
                    for ((entry, variance), own) in entries.zip(own) {
                        let weight = entry * variance;
                        sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += weight * own);
                    }
                    let first = part * SIDE_BY_SIDE;
                    (first..count.min(first + SIDE_BY_SIDE)).for_each(|k| out[(row, k)] = sums[k - first]);
                }
            }
        }
    }
}

/// Adds the blocks (m, m) of a configuration with those up to it to a symmetric matrix, on both sides of its diagonal.
fn add_blocks(joint: &mut Mat<f64>, rows: usize, pose: usize, blocks: &[f64], symmetric: bool) {
    for (other, block) in blocks.chunks_exact(rows * rows).enumerate() {
        for i in 0..rows {
            for j in 0..rows {
                let (a, b) = (pose * rows + i, other * rows + j);
                joint[(a, b)] += block[i * rows + j];
                if symmetric && other != pose {
                    joint[(b, a)] += block[i * rows + j];
                }
            }
        }
    }
}

/// A row that was predicted without its block.
#[derive(Debug, Clone, Copy)]
pub struct LeftOut {
    /// Measured - predicted.
    pub residual: f64,
    /// Variance of the measurement.
    pub noise: f64,
    /// Variance of the prediction.
    pub known: f64,
}
