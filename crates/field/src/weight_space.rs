//! The posterior in weight space: the normal equations of all weights are factored, whatever the number of rows.
//!
//! Each axis's prior correlation is written as E E^T with the eigenvectors that matter, so that the unknowns v have unit
//! priors and cells weigh `E v`. What a pose's joints do not repeat correlates its rows; they are whitened by
//! the pose's own noise covariance. With A the whitened rows, `(I + A^T A) v = A^T r`; set-up unknowns stand beside
//! with the precision of their priors.

use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::prelude::ReborrowMut;
use faer::{Accum, Mat, MatMut, MatRef};
use truearm_estimate::Cancel;
use truearm_estimate::dense::{Cholesky, column, mirror_lower, parallelism, to_vec};

use crate::FieldError;
use crate::bank::{Bank, Block};
use crate::model::{BlockPlan, Model};
use crate::posterior::{LeaveOneOut, Query, Solution};
use crate::product::{product, times};
use crate::unknowns::{Unknowns, sag_start, unknowns};

/// Poses whose rows are formed together.
const BATCH: usize = 512;
/// Left-out residuals of sets above this are found exactly for suspicious and sampled poses alone.
const JUDGED_EXACTLY: usize = 600;
/// A pose is suspicious when its squared residual reaches this many times its number of rows.
const SUSPICIOUS: f64 = 3.0;

/// Factors of the weights' normal equations.
pub struct WeightSpace {
    pub model: Model,
    unknowns: Vec<Unknowns>,
    width: usize,
    /// I + A^T A, lower triangle.
    normal: Mat<f64>,
    factor: Cholesky,
}

/// Rows of one pose: (m, u) before whitening.
struct Rows<'a> {
    space: &'a WeightSpaceParts<'a>,
    plans: &'a [BlockPlan<'a>],
    sag: &'a [Option<(usize, f64)>],
}

/// What rows are formed from.
struct WeightSpaceParts<'a> {
    model: &'a Model,
    unknowns: &'a [Unknowns],
}

impl Rows<'_> {
    fn fill(&self, values: &[f64], jacobian: &[f64], setup: Option<&[f64]>, mut out: MatMut<f64>) {
        let model = self.space.model;
        let columns = model.training.columns.len();
        let constants = model.by_column.constant.len();
        for (row, entries) in jacobian.chunks_exact(columns).enumerate() {
            for (k, &(p, _)) in model.by_column.constant.iter().enumerate() {
                out[(row, k)] = entries[p] * model.constant_deviation(p);
            }
            if let Some(setup) = setup {
                let width = model.training.setup_width;
                (0..width).for_each(|k| out[(row, constants + k)] = setup[row * width + k]);
            }
        }
        let levers = model.training.geometry.at(values);
        let start = sag_start(model);
        for (k, (term, lever)) in self.sag.iter().zip(&levers).enumerate() {
            let Some((p, deviation)) = term else { continue };
            for (row, entries) in jacobian.chunks_exact(columns).enumerate() {
                out[(row, start + k)] = entries[*p] * deviation * lever;
            }
        }
        for (plan, unknowns) in self.plans.iter().zip(self.space.unknowns) {
            let features = products(plan, unknowns, values);
            for (row, entries) in jacobian.chunks_exact(columns).enumerate() {
                let scaled: Vec<f64> =
                    plan.driven.iter().map(|&(p, variance)| entries[p] * variance.sqrt()).collect();
                for (f, feature) in features.iter().enumerate() {
                    let at = unknowns.start + f * scaled.len();
                    scaled.iter().enumerate().for_each(|(k, entry)| out[(row, at + k)] = feature * entry);
                }
            }
        }
    }
}

fn products(plan: &BlockPlan, unknowns: &Unknowns, values: &[f64]) -> Vec<f64> {
    let axes = plan.axes.iter().zip(&unknowns.roots);
    let features: Vec<Vec<f64>> =
        axes.map(|((input, cells), root)| root.features(cells, values[*input])).collect();
    let of = |k: usize, i: usize| features.get(k).map_or(1.0, |f| f[i]);
    unknowns.combinations.iter().map(|c| of(0, c[0]) * of(1, c[1]) * of(2, c[2])).collect()
}

/// Adds sign rows^T rows to the lower triangle.
fn add_gram(normal: &mut Mat<f64>, rows: &Mat<f64>, sign: f64) {
    triangular::matmul(
        normal.as_mut(),
        BlockStructure::TriangularLower,
        Accum::Add,
        rows.transpose(),
        BlockStructure::Rectangular,
        rows.as_ref(),
        BlockStructure::Rectangular,
        sign,
        parallelism(),
    );
}

fn factored(normal: &Mat<f64>) -> Result<Cholesky, FieldError> {
    let rows = normal.nrows();
    Cholesky::new(normal.clone(), parallelism()).ok_or(FieldError::NotPositiveDefinite { rows })
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
        let parts = WeightSpaceParts { model: &model, unknowns: &unknowns };
        for batch in parts.batches() {
            cancel.check()?;
            add_gram(&mut normal, &parts.whitened(&batch, width)?, 1.0);
        }
        let factor = factored(&normal)?;
        Ok(Self { model, unknowns, width, normal, factor })
    }

    /// The same posterior with other weights of the rows: the changed poses' share is taken out and put in again.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn reweighed(mut self, weight: Vec<f64>) -> Result<Self, FieldError> {
        let training = &self.model.training;
        let differs = |&pose: &usize| training.rows(pose).any(|row| training.weight[row] != weight[row]);
        let changed: Vec<usize> = (0..training.pose_count()).filter(differs).collect();
        for (sign, weight) in [(-1.0, None), (1.0, Some(weight))] {
            if let Some(weight) = weight {
                self.model.training.weight = weight;
            }
            for some in changed.chunks(BATCH) {
                let rows = self.parts().whitened(some, self.width)?;
                add_gram(&mut self.normal, &rows, sign);
            }
        }
        self.factor = factored(&self.normal)?;
        Ok(self)
    }

    fn parts(&self) -> WeightSpaceParts<'_> {
        WeightSpaceParts { model: &self.model, unknowns: &self.unknowns }
    }

    /// Constants, field and set-up from residuals (R,).
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn solve(&self, residual: &[f64]) -> Result<Solution, FieldError> {
        let solution = self.unknowns_of(residual)?;
        let training = &self.model.training;
        let mut constant = vec![0.0; training.columns.len()];
        for (k, &(p, _)) in self.model.by_column.constant.iter().enumerate() {
            constant[p] = self.model.constant_deviation(p) * solution[k];
        }
        let start = self.model.by_column.constant.len();
        let setup = solution[start..start + training.setup_width].to_vec();
        let mut bank = Bank::empty(training.inputs.len(), training.parameter_count);
        let plans = self.model.plans();
        bank.blocks =
            plans.iter().zip(&self.unknowns).map(|(plan, u)| self.block(plan, u, &solution)).collect();
        let sag = &solution[sag_start(&self.model)..];
        let weight = |(term, value): (Option<(usize, f64)>, &f64)| term.map_or(0.0, |(_, d)| d * value);
        bank.sag = self.model.sag(self.model.sag_terms().into_iter().zip(sag).map(weight).collect());
        Ok(Solution { constant, bank, setup })
    }

    fn unknowns_of(&self, residual: &[f64]) -> Result<Vec<f64>, FieldError> {
        let parts = self.parts();
        let mut right = Mat::<f64>::zeros(self.width, 1);
        for batch in parts.batches() {
            let rows = parts.whitened(&batch, self.width)?;
            right += product(rows.transpose(), column(&parts.whitened_values(&batch, residual)?).as_ref());
        }
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
        let outputs = plan.driven.iter().map(|&(p, _)| self.model.training.columns[p].parameter).collect();
        Block { name: plan.name.to_owned(), grid, outputs, weights }
    }

    /// What each pose's residuals (R,) would be if it had taken no part; of large sets exactly for some poses alone.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn leave_one_out(&self, residual: &[f64]) -> Result<LeaveOneOut, FieldError> {
        let training = &self.model.training;
        let solution = column(&self.unknowns_of(residual)?);
        let parts = self.parts();
        let mut out = LeaveOneOut::zeros(training.row_count());
        let stride = training.pose_count().div_ceil(JUDGED_EXACTLY);
        for batch in parts.batches() {
            let rows = parts.whitened(&batch, self.width)?;
            let left =
                column(&parts.whitened_values(&batch, residual)?) - product(rows.as_ref(), solution.as_ref());
            let first = training.rows(batch[0]).start;
            let square =
                |pose: usize| training.rows(pose).map(|row| left[(row - first, 0)].powi(2)).sum::<f64>();
            let (exact, clear): (Vec<usize>, Vec<usize>) = batch.into_iter().partition(|&pose| {
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
            self.judge_exactly(&exact, rows.as_ref(), left.as_ref(), &mut out)?;
        }
        Ok(out)
    }

    fn judge_exactly(
        &self,
        poses: &[usize],
        rows: MatRef<f64>,
        left: MatRef<f64>,
        out: &mut LeaveOneOut,
    ) -> Result<(), FieldError> {
        let training = &self.model.training;
        let Some(&pose) = poses.first() else { return Ok(()) };
        let first = training.rows(pose - pose % BATCH).start;
        let wanted: Vec<usize> = poses.iter().flat_map(|&pose| training.rows(pose)).collect();
        let mut reduced = Mat::from_fn(self.width, wanted.len(), |k, r| rows[(wanted[r] - first, k)]);
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

    /// Covariance (n m, n m) of all rows of a query with one another.
    pub fn joint(&self, query: &Query) -> Mat<f64> {
        let reduced = self.reduced(query, 0..query.poses());
        product(reduced.transpose(), reduced.as_ref())
    }

    /// Rows of some configurations by unknowns of unit variance, (u, k).
    fn reduced(&self, query: &Query, poses: std::ops::Range<usize>) -> Mat<f64> {
        let plans = self.model.plans();
        let parts = self.parts();
        let sag = self.model.sag_terms();
        let rows = Rows { space: &parts, plans: &plans, sag: &sag };
        let width = self.model.training.setup_width;
        let mut filled = Mat::zeros(poses.len() * query.rows, self.width);
        for (index, pose) in poses.enumerate() {
            let setup = query.setup.map(|s| &s[pose * query.rows * width..(pose + 1) * query.rows * width]);
            let target = filled.as_mut().subrows_mut(index * query.rows, query.rows);
            rows.fill(query.values_of(pose), query.jacobian_of(pose), setup, target);
        }
        let mut reduced = filled.transpose().to_owned();
        self.factor.solve_lower(reduced.as_mut());
        reduced
    }
}

impl WeightSpaceParts<'_> {
    fn batches(&self) -> Vec<Vec<usize>> {
        let poses: Vec<usize> = (0..self.model.training.pose_count()).collect();
        poses.chunks(BATCH).map(<[usize]>::to_vec).collect()
    }

    /// Whitened rows (r, u) of a batch of poses.
    fn whitened(&self, poses: &[usize], width: usize) -> Result<Mat<f64>, FieldError> {
        let training = &self.model.training;
        let plans = self.model.plans();
        let sag = self.model.sag_terms();
        let rows = Rows { space: self, plans: &plans, sag: &sag };
        let count = poses.iter().map(|&pose| training.rows(pose).len()).sum();
        let mut out = Mat::zeros(count, width);
        let mut at = 0;
        for &pose in poses {
            let range = training.rows(pose);
            let columns = training.columns.len();
            let jacobian = &training.jacobian[range.start * columns..range.end * columns];
            let setup = &training.setup[range.start * training.setup_width..range.end * training.setup_width];
            let mut target = out.as_mut().subrows_mut(at, range.len());
            at += range.len();
            rows.fill(training.values_of(pose), jacobian, Some(setup), target.rb_mut());
            self.model.noise_cholesky(pose)?.solve_lower(target);
        }
        Ok(out)
    }

    fn whitened_values(&self, poses: &[usize], values: &[f64]) -> Result<Vec<f64>, FieldError> {
        let mut out = Vec::new();
        for &pose in poses {
            let mut local = column(&values[self.model.training.rows(pose)]);
            self.model.noise_cholesky(pose)?.solve_lower(local.as_mut());
            out.extend(to_vec(local.as_ref()));
        }
        Ok(out)
    }
}

impl Model {
    /// Factor of the noise covariance of one pose's rows: instrument and what its joints do not repeat.
    fn noise_cholesky(&self, pose: usize) -> Result<Cholesky, FieldError> {
        let rows = self.training.rows(pose);
        let noise = self.noise_covariance(&self.training.jacobian, rows.clone());
        let noise = Mat::from_fn(rows.len(), rows.len(), |i, j| {
            let own =
                if i == j { self.training.noise_variance(rows.start + i, self.hyper.noise) } else { 0.0 };
            noise[(i, j)] + own
        });
        Cholesky::new(noise, faer::Par::Seq).ok_or(FieldError::NotPositiveDefinite { rows: rows.len() })
    }

    /// The lower factor itself, (m, m).
    fn noise_factor(&self, pose: usize) -> Result<Mat<f64>, FieldError> {
        Ok(self.noise_cholesky(pose)?.lower())
    }

    /// What joints do not repeat, carried to rows of a Jacobian (rows, P).
    pub fn noise_covariance(&self, jacobian: &[f64], rows: std::ops::Range<usize>) -> Mat<f64> {
        let columns = self.training.columns.len();
        let mut noise = Mat::zeros(rows.len(), rows.len());
        for (p, lever) in self.by_column.own.iter().flatten() {
            let entry =
                |i: usize| jacobian[(rows.start + i) * columns + p] * lever * self.hyper.repeatability;
            for i in 0..rows.len() {
                (0..=i).for_each(|j| noise[(i, j)] += entry(i) * entry(j));
            }
        }
        mirror_lower(&mut noise);
        noise
    }
}
