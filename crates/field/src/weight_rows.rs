//! What measured rows hold of the unknowns of weight space, each row a column (u,), poses side by side by all threads.

use std::ops::Range;

use faer::prelude::ReborrowMut;
use faer::{Mat, MatMut, MatRef};
use rayon::prelude::*;
use truearm_estimate::dense::{Cholesky, column, mirror_lower, to_vec};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::model::{BlockPlan, Model};
use crate::pairs::by_pose;
use crate::posterior::Query;
use crate::unknowns::{Unknowns, sag_start};

/// Poses whose rows are formed together.
const BATCH: usize = 512;

/// Forms rows of a model's unknowns.
pub struct WeightRows<'a> {
    model: &'a Model,
    unknowns: &'a [Unknowns],
    width: usize,
    plans: Vec<BlockPlan<'a>>,
    sag: Vec<Option<(usize, f64)>>,
}

/// Whitened rows of some poses of the training set.
pub struct Batch<'a> {
    pub poses: &'a [usize],
    /// (u, r).
    pub rows: MatRef<'a, f64>,
    /// Rows of the training set that they are, one after the other.
    pub ranges: Vec<Range<usize>>,
}

impl<'a> WeightRows<'a> {
    /// Of unknowns of which there are `width` in all.
    pub fn new(model: &'a Model, unknowns: &'a [Unknowns], width: usize) -> Self {
        Self { model, unknowns, width, plans: model.plans(), sag: model.sag_terms() }
    }

    /// The model whose unknowns they are of.
    pub fn model(&self) -> &Model {
        self.model
    }

    /// Blocks that drive all columns.
    fn of_all(&self) -> impl Iterator<Item = (&BlockPlan<'a>, &Unknowns)> {
        self.plans.iter().zip(self.unknowns).filter(|(plan, _)| plan.of_all)
    }

    /// The first unknown of blocks that drive all columns: one block stands behind the other, up to the last unknown.
    pub fn first_of_all(&self) -> usize {
        self.of_all().map(|(_, unknowns)| unknowns.start).min().unwrap_or(self.width)
    }

    /// The columns that those blocks drive, in the order of each one's unknowns.
    pub fn driven_by_all(&self) -> Vec<usize> {
        self.of_all().next().map_or(vec![], |(plan, _)| plan.driven.iter().map(|&(p, _)| p).collect())
    }

    /// Prior standard deviation of the weights of those blocks' features, (columns, F).
    pub fn deviations_of_all(&self) -> Mat<f64> {
        let of_features = self
            .of_all()
            .flat_map(|(plan, unknowns)| std::iter::repeat_n(&plan.driven, unknowns.combinations.len()));
        let of_features: Vec<_> = of_features.collect();
        let columns = of_features.first().map_or(0, |driven| driven.len());
        Mat::from_fn(columns, of_features.len(), |k, f| of_features[f][k].1.sqrt())
    }

    /// Those blocks' features of a configuration, one block behind the other, (F,).
    pub fn features_of_all(&self, values: &[f64]) -> Vec<f64> {
        self.of_all().flat_map(|(plan, unknowns)| products(plan, unknowns, values)).collect()
    }

    /// Calls `use_batch` with whitened rows of some poses at a time, in order.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled, and those of `use_batch`.
    pub fn each(
        &self,
        poses: &[usize],
        cancel: &Cancel,
        mut use_batch: impl FnMut(Batch) -> Result<(), FieldError>,
    ) -> Result<(), FieldError> {
        let training = &self.model.training;
        // Fresh pages for every batch would cost as much as its rows.
        let mut room = Mat::new();
        for poses in poses.chunks(BATCH) {
            cancel.check()?;
            let ranges: Vec<Range<usize>> = poses.iter().map(|&pose| training.rows(pose)).collect();
            let count = ranges.iter().map(Range::len).sum();
            room.resize_with(self.width, count, |_, _| 0.0);
            let parts = by_pose(room.as_mut(), ranges.iter().map(Range::len));
            let columns = training.columns.len();
            let (setup, width) = (&training.setup, training.setup_width);
            poses.par_iter().zip(&ranges).zip(parts).try_for_each(|((&pose, range), mut out)| {
                let jacobian = &training.jacobian[range.start * columns..range.end * columns];
                let setup = &setup[range.start * width..range.end * width];
                self.fill(training.values_of(pose), jacobian, Some(setup), out.rb_mut());
                let noise = self.model.noise_cholesky(pose)?;
                noise.solve_lower(out.transpose_mut());
                Ok::<(), FieldError>(())
            })?;
            use_batch(Batch { poses, rows: room.as_ref(), ranges })?;
        }
        Ok(())
    }

    /// Values (R,) of a batch's rows, whitened as these are, (r,).
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn whitened(&self, batch: &Batch, values: &[f64]) -> Result<Vec<f64>, FieldError> {
        let mut out = Vec::with_capacity(batch.rows.ncols());
        for (&pose, range) in batch.poses.iter().zip(&batch.ranges) {
            let mut local = column(&values[range.clone()]);
            self.model.noise_cholesky(pose)?.solve_lower(local.as_mut());
            out.extend(to_vec(local.as_ref()));
        }
        Ok(out)
    }

    /// Rows of some configurations of a query, as they are, (u, k).
    pub fn of(&self, query: &Query, poses: Range<usize>) -> Mat<f64> {
        let (rows, width) = (query.rows, self.model.training.setup_width);
        let mut out = Mat::zeros(self.width, poses.len() * rows);
        let parts = by_pose(out.as_mut(), poses.clone().map(|_| rows));
        poses.into_par_iter().zip(parts).for_each(|(pose, part)| {
            let setup = query.setup.map(|s| &s[pose * rows * width..(pose + 1) * rows * width]);
            self.fill(query.values_of(pose), query.jacobian_of(pose), setup, part);
        });
        out
    }

    /// Overwrites `out` (u, m) with the rows of one pose.
    fn fill(&self, values: &[f64], jacobian: &[f64], setup: Option<&[f64]>, mut out: MatMut<f64>) {
        let model = self.model;
        let columns = model.training.columns.len();
        let (start, setup_width) = (model.by_column.constant.len(), model.training.setup_width);
        let levers = model.training.geometry.at(values);
        let features: Vec<Vec<f64>> = self
            .plans
            .iter()
            .zip(self.unknowns)
            .map(|(plan, unknowns)| products(plan, unknowns, values))
            .collect();
        for (row, entries) in jacobian.chunks_exact(columns).enumerate() {
            let mut out = out.rb_mut().col_mut(row);
            for (k, &(p, _)) in model.by_column.constant.iter().enumerate() {
                out[k] = entries[p] * model.constant_deviation(p);
            }
            for k in 0..setup_width {
                out[start + k] = setup.map_or(0.0, |setup| setup[row * setup_width + k]);
            }
            for (k, (term, lever)) in self.sag.iter().zip(&levers).enumerate() {
                out[sag_start(model) + k] = term.map_or(0.0, |(p, deviation)| entries[p] * deviation * lever);
            }
            for ((plan, unknowns), features) in self.plans.iter().zip(self.unknowns).zip(&features) {
                let scaled: Vec<f64> =
                    plan.driven.iter().map(|&(p, variance)| entries[p] * variance.sqrt()).collect();
                for (f, feature) in features.iter().enumerate() {
                    let at = unknowns.start + f * scaled.len();
                    scaled.iter().enumerate().for_each(|(k, entry)| out[at + k] = feature * entry);
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

impl Model {
    /// Factor of the noise covariance of one pose's rows: instrument and what its joints do not repeat.
    pub fn noise_cholesky(&self, pose: usize) -> Result<Cholesky, FieldError> {
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
    pub fn noise_factor(&self, pose: usize) -> Result<Mat<f64>, FieldError> {
        Ok(self.noise_cholesky(pose)?.lower())
    }

    /// What joints do not repeat, carried to rows of a Jacobian (rows, P).
    pub fn noise_covariance(&self, jacobian: &[f64], rows: std::ops::Range<usize>) -> Mat<f64> {
        let columns = self.training.columns.len();
        let mut noise = Mat::zeros(rows.len(), rows.len());
        for (input, p, lever) in self.by_column.curved() {
            let missed = lever * self.hyper.repeatability_of(self.by_column.joint[input]);
            let entry = |i: usize| jacobian[(rows.start + i) * columns + p] * missed;
            for i in 0..rows.len() {
                (0..=i).for_each(|j| noise[(i, j)] += entry(i) * entry(j));
            }
        }
        mirror_lower(&mut noise);
        noise
    }
}
