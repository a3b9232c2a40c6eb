//! A^T A of weight space, of which most is summed by pairs of parameters.
//!
//! A row of a block that drives all columns is `phi (x) w`: what the block's eigenvectors make of the pose's joints, times
//! the row's whitened entries. Over the rows of a pose these add up to `phi phi^T (x) w^T w`, so that each pair of columns
//! asks for one symmetric product of features, `sum of (w^T w)_ab phi phi^T` over the poses, whatever the rows of a
//! pose. Of 24 columns and three rows a pose that is a sixth of the multiplications of the rows' own product.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;
use truearm_estimate::Cancel;
use truearm_estimate::dense::parallelism;

use crate::FieldError;
use crate::model::Model;
use crate::weight_rows::WeightRows;

/// Poses whose features are multiplied at a time: they stay in a core's cache.
const POSES: usize = 256;
/// Pairs of columns whose products are kept at a time, some tens of megabytes.
const PAIRS: usize = 64;

/// Adds sign A^T A of some poses to the lower triangle of `normal`.
///
/// # Errors
/// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
pub fn add_gram(
    normal: &mut Mat<f64>,
    rows: &WeightRows,
    poses: &[usize],
    sign: f64,
    cancel: &Cancel,
) -> Result<(), FieldError> {
    rows.each(poses, cancel, |batch| {
        add_beside(normal.as_mut(), batch.rows, rows.first_of_all(), sign);
        Ok(())
    })?;
    OfAll::new(rows, poses)?.add(normal, sign, cancel)
}

/// The part in which the first `beside` unknowns, those of no block that drives all columns, meet one another and the others.
fn add_beside(normal: MatMut<f64>, rows: MatRef<f64>, beside: usize, sign: f64) {
    let (own, others) = rows.split_at_row(beside);
    let (corner, _, below, _) = normal.split_at_mut(beside, beside);
    triangular::matmul(
        corner,
        BlockStructure::TriangularLower,
        Accum::Add,
        own,
        BlockStructure::Rectangular,
        own.transpose(),
        BlockStructure::Rectangular,
        sign,
        parallelism(),
    );
    matmul(below, Accum::Add, others, own.transpose(), sign, parallelism());
}

/// Blocks that drive all columns, at some poses.
struct OfAll {
    /// Their first unknown.
    start: usize,
    /// phi, block by block, (F, n).
    features: Mat<f64>,
    /// Prior standard deviation of each feature's weight for each driven column, (columns, F).
    deviations: Mat<f64>,
    /// Pairs (a, b) of driven columns, a >= b.
    pairs: Vec<(usize, usize)>,
    /// w^T w of each pair, (pairs, n).
    moments: Mat<f64>,
}

impl OfAll {
    fn new(rows: &WeightRows, poses: &[usize]) -> Result<Self, FieldError> {
        let model = rows.model();
        let columns = rows.driven_by_all();
        let pairs: Vec<_> = (0..columns.len()).flat_map(|a| (0..=a).map(move |b| (a, b))).collect();
        let deviations = rows.deviations_of_all();
        let mut features = Mat::zeros(deviations.ncols(), poses.len());
        let mut moments = Mat::zeros(pairs.len(), poses.len());
        let places = features.par_col_iter_mut().zip(moments.par_col_iter_mut());
        places.zip(poses.par_iter()).try_for_each(|((features, moments), &pose)| {
            let values = rows.features_of_all(model.training.values_of(pose));
            features.iter_mut().zip(values).for_each(|(out, value)| *out = value);
            let entries = whitened(model, pose, &columns)?;
            moments
                .iter_mut()
                .zip(&pairs)
                .for_each(|(out, &(a, b))| *out = entries.col(a).transpose() * entries.col(b));
            Ok::<(), FieldError>(())
        })?;
        Ok(Self { start: rows.first_of_all(), features, deviations, pairs, moments })
    }

    fn add(&self, normal: &mut Mat<f64>, sign: f64, cancel: &Cancel) -> Result<(), FieldError> {
        for first in (0..self.pairs.len()).step_by(PAIRS) {
            let pairs = first..(first + PAIRS).min(self.pairs.len());
            let sums = pairs.clone().into_par_iter().map(|pair| {
                cancel.check()?;
                Ok(self.sum(pair))
            });
            let sums = sums.collect::<Result<Vec<_>, FieldError>>()?;
            pairs.zip(&sums).for_each(|(pair, sum)| self.put(normal, self.pairs[pair], sum, sign));
        }
        Ok(())
    }

    /// Sum over the poses of a pair's moment times phi phi^T, lower triangle.
    fn sum(&self, pair: usize) -> Mat<f64> {
        let (count, poses) = (self.features.nrows(), self.features.ncols());
        let mut sum = Mat::zeros(count, count);
        for first in (0..poses).step_by(POSES) {
            let part = self.features.subcols(first, POSES.min(poses - first));
            let scaled =
                Mat::from_fn(count, part.ncols(), |f, i| self.moments[(pair, first + i)] * part[(f, i)]);
            triangular::matmul(
                sum.as_mut(),
                BlockStructure::TriangularLower,
                Accum::Add,
                part,
                BlockStructure::Rectangular,
                scaled.transpose(),
                BlockStructure::Rectangular,
                1.0,
                Par::Seq,
            );
        }
        sum
    }

    /// Adds a pair's sum where its two columns meet: for two features each of them goes with either.
    fn put(&self, normal: &mut Mat<f64>, (a, b): (usize, usize), sum: &Mat<f64>, sign: f64) {
        let at = |feature: usize, column: usize| self.start + feature * self.deviations.nrows() + column;
        for g in 0..sum.ncols() {
            for f in g..sum.nrows() {
                let value = sign * sum[(f, g)];
                let deviation =
                    |of_f: usize, of_g: usize| self.deviations[(of_f, f)] * self.deviations[(of_g, g)];
                normal[(at(f, a), at(g, b))] += value * deviation(a, b);
                if a != b && f != g {
                    normal[(at(f, b), at(g, a))] += value * deviation(b, a);
                }
            }
        }
    }
}

/// A pose's rows of some columns, whitened, (m, columns).
fn whitened(model: &Model, pose: usize, columns: &[usize]) -> Result<Mat<f64>, FieldError> {
    let range = model.training.rows(pose);
    let mut entries = Mat::from_fn(range.len(), columns.len(), |r, k| {
        model.training.jacobian_row(range.start + r)[columns[k]]
    });
    model.noise_cholesky(pose)?.solve_lower(entries.as_mut());
    Ok(entries)
}
