//! The posterior in weight space: the normal equations of all weights are factored, whatever the number of rows.
//!
//! Each axis's prior correlation is written as E E^T with the eigenvectors that matter, so that the unknowns v have unit
//! priors and cells weigh `E v`. What a pose's joints do not repeat correlates its rows; they are whitened by
//! the pose's own noise covariance. With A the whitened rows, `(I + A^T A) v = A^T r`; set-up unknowns stand beside
//! with the precision of their priors.

use std::ops::Range;

use faer::{Mat, MatRef};
use truearm_bank::{Bank, Block};
use truearm_estimate::dense::{Cholesky, column, parallelism, product, times, to_vec};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::gram::add_gram;
use crate::model::{BlockPlan, Model};
use crate::outliers::SUSPICIOUS;
use crate::posterior::{LeaveOneOut, Query, Solution};
use crate::unknowns::{Unknowns, sag_start, unknowns};
use crate::weight_rows::{Batch, WeightRows};

/// Configurations of a query that are answered together.
const BATCH: usize = 512;
/// Left-out residuals of sets above this are found exactly for suspicious and sampled poses alone.
const JUDGED_EXACTLY: usize = 600;

/// Factors of the weights' normal equations.
pub struct WeightSpace {
    pub model: Model,
    unknowns: Vec<Unknowns>,
    width: usize,
    /// I + A^T A, lower triangle.
    normal: Mat<f64>,
    factor: Cholesky,
    cancel: Cancel,
}

fn factored(normal: &Mat<f64>, cancel: &Cancel) -> Result<Cholesky, FieldError> {
    let rows = normal.nrows();
    let factor = Cholesky::heeding(normal.clone(), parallelism(), cancel)?;
    factor.ok_or(FieldError::NotPositiveDefinite { rows })
}

impl WeightSpace {
    /// Factors the normal equations of a model's weights.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn new(model: Model, cancel: &Cancel) -> Result<Self, FieldError> {
        let error = FieldError::NotPositiveDefinite { rows: model.training.row_count() };
        let (unknowns, width) = unknowns(&model).ok_or(error)?;
        let mut normal = Mat::<f64>::identity(width, width);
        for (k, known) in model.training.setup_precision.iter().enumerate() {
            let at = model.by_column.constant.len() + k;
            normal[(at, at)] = *known;
        }
        let poses: Vec<usize> = (0..model.training.pose_count()).collect();
        add_gram(&mut normal, &WeightRows::new(&model, &unknowns, width), &poses, 1.0, cancel)?;
        let factor = factored(&normal, cancel)?;
        Ok(Self { model, unknowns, width, normal, factor, cancel: cancel.clone() })
    }

    /// The same posterior with other weights of the rows: the changed poses' share is taken out and put in again.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn reweighed(mut self, weight: Vec<f64>) -> Result<Self, FieldError> {
        let training = &self.model.training;
        let differs = |&pose: &usize| training.rows(pose).any(|row| training.weight[row] != weight[row]);
        let changed: Vec<usize> = (0..training.pose_count()).filter(differs).collect();
        for (sign, weight) in [(-1.0, None), (1.0, Some(weight))] {
            if let Some(weight) = weight {
                self.model.training.weight = weight;
            }
            let rows = WeightRows::new(&self.model, &self.unknowns, self.width);
            add_gram(&mut self.normal, &rows, &changed, sign, &self.cancel)?;
        }
        self.factor = factored(&self.normal, &self.cancel)?;
        Ok(self)
    }

    fn rows(&self) -> WeightRows<'_> {
        WeightRows::new(&self.model, &self.unknowns, self.width)
    }

    fn each_batch(&self, use_batch: impl FnMut(Batch) -> Result<(), FieldError>) -> Result<(), FieldError> {
        let poses: Vec<usize> = (0..self.model.training.pose_count()).collect();
        self.rows().each(&poses, &self.cancel, use_batch)
    }

    /// Constants, field and set-up from residuals (R,).
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn solve(&self, residual: &[f64]) -> Result<Solution, FieldError> {
        let solution = self.unknowns_of(residual)?;
        let training = &self.model.training;
        let mut constant = vec![0.0; training.columns.len()];
        for (k, &(p, _)) in self.model.by_column.constant.iter().enumerate() {
            constant[p] = self.model.constant_deviation(p) * solution[k];
        }
        let start = self.model.by_column.constant.len();
        let setup = solution[start..start + training.setup_width].to_vec();
        let mut bank = Bank::empty(training.input_count(), training.parameter_count);
        let plans = self.model.plans();
        bank.blocks =
            plans.iter().zip(&self.unknowns).map(|(plan, u)| self.block(plan, u, &solution)).collect();
        let sag = &solution[sag_start(&self.model)..];
        let weight = |(term, value): (Option<(usize, f64)>, &f64)| term.map_or(0.0, |(_, d)| d * value);
        bank.sag = self.model.sag(self.model.sag_terms().into_iter().zip(sag).map(weight).collect());
        Ok(Solution { constant, bank, setup })
    }

    fn unknowns_of(&self, residual: &[f64]) -> Result<Vec<f64>, FieldError> {
        let rows = self.rows();
        let mut right = Mat::<f64>::zeros(self.width, 1);
        self.each_batch(|batch| {
            right += product(batch.rows, column(&rows.whitened(&batch, residual)?).as_ref());
            Ok(())
        })?;
        Ok(self.factor.solve_vector(&to_vec(right.as_ref())))
    }

    /// Cells' weights from the unknowns: one axis's eigenvectors after the other.
    fn block(&self, plan: &BlockPlan, unknowns: &Unknowns, solution: &[f64]) -> Block {
        let grid = plan.grid();
        let width = plan.driven.len();
        let cells = |k: usize| unknowns.roots.get(k).map_or(1, |root| root.entries.nrows());
        let entry = |k: usize, cell: usize, i: usize| {
            unknowns.roots.get(k).map_or(1.0, |root| root.entries[(cell, i)])
        };
        let mut weights = vec![0.0; grid.cell_count() * width];
        for (f, c) in unknowns.combinations.iter().enumerate() {
            let values = &solution[unknowns.start + f * width..unknowns.start + (f + 1) * width];
            for i in 0..cells(0) {
                for j in 0..cells(1) {
                    let outer = entry(0, i, c[0]) * entry(1, j, c[1]);
                    for k in 0..cells(2) {
                        let grade = outer * entry(2, k, c[2]);
                        let at = ((i * cells(1) + j) * cells(2) + k) * width;
                        for (weight, (value, (_, variance))) in
                            weights[at..at + width].iter_mut().zip(values.iter().zip(&plan.driven))
                        {
                            *weight += grade * variance.sqrt() * value;
                        }
                    }
                }
            }
        }
        self.model.training.block(plan, grid, weights)
    }

    /// What each pose's residuals (R,) would be if it had taken no part; of large sets exactly for some poses alone.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn leave_one_out(&self, residual: &[f64]) -> Result<LeaveOneOut, FieldError> {
        let training = &self.model.training;
        let solution = column(&self.unknowns_of(residual)?);
        let rows = self.rows();
        let mut out = LeaveOneOut::zeros(training.row_count());
        let stride = training.pose_count().div_ceil(JUDGED_EXACTLY);
        self.each_batch(|batch| {
            let left = column(&rows.whitened(&batch, residual)?)
                - product(batch.rows.transpose(), solution.as_ref());
            let first = batch.ranges[0].start;
            // Whitened by a weight that was taken away, the farthest pose would look clear.
            let at_full_weight = |row: usize| left[(row - first, 0)].powi(2) / training.weight[row];
            let square = |pose: usize| training.rows(pose).map(at_full_weight).sum::<f64>();
            let (exact, clear): (Vec<usize>, Vec<usize>) = batch.poses.iter().partition(|&&pose| {
                pose % stride == 0 || square(pose) > SUSPICIOUS * training.rows(pose).len() as f64
            });
            for pose in clear {
                let local: Vec<f64> = training.rows(pose).map(|row| left[(row - first, 0)]).collect();
                let residual = times(self.model.noise_factor(pose)?.as_ref(), &local);
                out.approximate(training.rows(pose), &residual, &local);
            }
            for &pose in exact.iter().filter(|&&pose| pose % stride != 0) {
                out.suspect(training.rows(pose));
            }
            self.judge_exactly(&exact, &batch, left.as_ref(), &mut out)
        })?;
        Ok(out)
    }

    fn judge_exactly(
        &self,
        poses: &[usize],
        batch: &Batch,
        left: MatRef<f64>,
        out: &mut LeaveOneOut,
    ) -> Result<(), FieldError> {
        let training = &self.model.training;
        let first = batch.ranges[0].start;
        let wanted: Vec<usize> = poses.iter().flat_map(|&pose| training.rows(pose)).collect();
        let mut reduced = Mat::from_fn(self.width, wanted.len(), |k, r| batch.rows[(k, wanted[r] - first)]);
        self.factor.solve_lower(reduced.as_mut());
        let mut at = 0;
        for &pose in poses {
            let range = training.rows(pose);
            let count = range.len();
            let free = Mat::from_fn(count, count, |i, j| {
                let leverage = reduced.col(at + i).transpose() * reduced.col(at + j);
                f64::from(u8::from(i == j)) - leverage
            });
            at += count;
            let error = || FieldError::NotPositiveDefinite { rows: count };
            let free = Cholesky::new(free, faer::Par::Seq).ok_or_else(error)?;
            let local: Vec<f64> = range.clone().map(|row| left[(row - first, 0)]).collect();
            let noise = self.model.noise_factor(pose)?;
            let left_out = times(noise.as_ref(), &free.solve_vector(&local));
            let covariance = &noise * free.inverse() * noise.transpose();
            out.set(&self.model, pose, &left_out, covariance)?;
        }
        Ok(())
    }

    /// Covariance (n, m, m) of the rows of each configuration of a query.
    pub fn covariance(&self, query: &Query) -> Vec<f64> {
        let mut out = vec![0.0; query.poses() * query.rows * query.rows];
        for first in (0..query.poses()).step_by(BATCH) {
            let last = (first + BATCH).min(query.poses());
            let reduced = self.reduced(query, first..last);
            for pose in first..last {
                for i in 0..query.rows {
                    for j in 0..query.rows {
                        let at = (pose - first) * query.rows;
                        out[(pose * query.rows + i) * query.rows + j] =
                            reduced.col(at + i).transpose() * reduced.col(at + j);
                    }
                }
            }
        }
        out
    }

    /// Covariance (k m, l m) of the rows of some configurations of a query with those of some others, or of the same.
    pub fn joint(&self, query: &Query, left: Range<usize>, right: Range<usize>) -> Mat<f64> {
        let reduced = self.reduced(query, 0..query.poses());
        product(query.part(&reduced, &left).transpose(), query.part(&reduced, &right))
    }

    /// Covariance (P, P) of the columns' constants alone, whatever varies beside them.
    pub fn constants(&self) -> Mat<f64> {
        let columns = self.model.training.columns.len();
        let mut reduced = Mat::zeros(self.width, columns);
        for (k, &(p, _)) in self.model.by_column.constant.iter().enumerate() {
            reduced[(k, p)] = self.model.constant_deviation(p);
        }
        self.factor.solve_lower(reduced.as_mut());
        product(reduced.transpose(), reduced.as_ref())
    }

    /// Rows of some configurations by unknowns of unit variance, (u, k).
    fn reduced(&self, query: &Query, poses: Range<usize>) -> Mat<f64> {
        let mut reduced = self.rows().of(query, poses);
        self.factor.solve_lower(reduced.as_mut());
        reduced
    }
}
