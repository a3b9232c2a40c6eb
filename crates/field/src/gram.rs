//! A^T A of weight space, of which most is summed by pairs of parameters.
//!
//! A row of a block that drives all columns is `phi (x) w`: what the block's eigenvectors make of the pose's joints, times
//! the row's whitened entries. Over the rows of a pose these add up to `phi phi^T (x) w^T w`, so that each pair of columns
//! asks for one symmetric product of features, `sum of (w^T w)_ab phi phi^T` over the poses, whatever the rows of a
//! pose. Of 24 columns and three rows a pose that is a sixth of the multiplications of the rows' own product. With
//! other unknowns x of a row it meets in `phi (sum of x w)^T`, a third of them.

use faer::{Mat, MatRef, Par};
use rayon::prelude::*;
use truearm_estimate::dense::{add_product, add_to_lower, parallelism};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::pairs::by_pose;
use crate::weight_rows::WeightRows;

/// Poses whose features are multiplied at a time: they stay in a core's cache.
const POSES: usize = 256;
/// Numbers of pairs' products that are kept at a time, 64 megabytes; one product a thread at least.
const ROOM: usize = 1 << 23;

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
    let of_all = OfAll::new(rows, poses)?;
    let beside = of_all.start;
    let mut meeting = vec![Mat::zeros(of_all.features.nrows(), beside); of_all.entries.nrows()];
    let mut first = 0;
    rows.each(poses, cancel, |batch| {
        let own = batch.rows.subrows(0, beside);
        let corner = normal.as_mut().submatrix_mut(0, 0, beside, beside);
        add_to_lower(corner, own, own.transpose(), sign, parallelism());
        meeting.par_iter_mut().enumerate().for_each(|(column, sum)| of_all.meet(own, first, column, sum));
        first += batch.poses.len();
        Ok(())
    })?;
    for (column, sum) in meeting.iter().enumerate() {
        for k in 0..beside {
            for f in 0..sum.nrows() {
                let deviation = of_all.deviations[(column, f)];
                normal[(of_all.unknown(f, column), k)] += sign * deviation * sum[(f, k)];
            }
        }
    }
    of_all.add(normal, sign, cancel)
}

/// Blocks that drive all columns, at some poses.
struct OfAll {
    /// Their first unknown: those before it are of constants, set-up, `sag` and single columns.
    start: usize,
    /// phi, block by block, (F, n).
    features: Mat<f64>,
    /// Prior standard deviation of each feature's weight for each driven column, (columns, F).
    deviations: Mat<f64>,
    /// w of the poses' rows, one pose behind the other, (columns, r), and where each pose's begin, (n + 1,).
    entries: Mat<f64>,
    offsets: Vec<usize>,
}

impl OfAll {
    fn new(rows: &WeightRows, poses: &[usize]) -> Result<Self, FieldError> {
        let training = &rows.model().training;
        let columns = rows.driven_by_all();
        let deviations = rows.deviations_of_all();
        let counts = || poses.iter().map(|&pose| training.rows(pose).len());
        let mut offsets = vec![0];
        offsets.extend(counts().scan(0, |end, count| {
            *end += count;
            Some(*end)
        }));
        let mut features = Mat::zeros(deviations.ncols(), poses.len());
        let mut entries = Mat::zeros(columns.len(), offsets[poses.len()]);
        let parts = by_pose(entries.as_mut(), counts());
        let places = poses.par_iter().zip(features.par_col_iter_mut()).zip(parts);
        places.try_for_each(|((&pose, features), mut entries)| {
            let values = rows.features_of_all(training.values_of(pose));
            features.iter_mut().zip(values).for_each(|(out, value)| *out = value);
            for (r, row) in training.rows(pose).enumerate() {
                let jacobian = training.jacobian_row(row);
                columns.iter().enumerate().for_each(|(k, &p)| entries[(k, r)] = jacobian[p]);
            }
            rows.model().noise_cholesky(pose)?.solve_lower(entries.transpose_mut());
            Ok::<(), FieldError>(())
        })?;
        Ok(Self { start: rows.first_of_all(), features, deviations, entries, offsets })
    }

    /// The unknown of a feature and a column.
    fn unknown(&self, feature: usize, column: usize) -> usize {
        self.start + feature * self.entries.nrows() + column
    }

    /// Adds to `sum` (F, k) what poses from `first` on hold of one column with other unknowns, of rows `own` (k, r).
    fn meet(&self, own: MatRef<f64>, first: usize, column: usize, sum: &mut Mat<f64>) {
        let begin = self.offsets[first];
        let poses = self.offsets[first..].partition_point(|&offset| offset < begin + own.ncols());
        let rows = |i: usize| self.offsets[first + i]..self.offsets[first + i + 1];
        let of_poses = Mat::from_fn(own.nrows(), poses, |k, i| {
            rows(i).map(|row| own[(k, row - begin)] * self.entries[(column, row)]).sum::<f64>()
        });
        let features = self.features.subcols(first, poses);
        add_product(sum.as_mut(), features, of_poses.transpose(), 1.0);
    }

    fn add(&self, normal: &mut Mat<f64>, sign: f64, cancel: &Cancel) -> Result<(), FieldError> {
        let pairs: Vec<_> = (0..self.entries.nrows()).flat_map(|a| (0..=a).map(move |b| (a, b))).collect();
        let at_once = (ROOM / self.features.nrows().pow(2).max(1)).max(rayon::current_num_threads());
        for pairs in pairs.chunks(at_once) {
            let sums = pairs.par_iter().map(|&pair| {
                cancel.check()?;
                Ok(self.sum(pair))
            });
            let sums = sums.collect::<Result<Vec<_>, FieldError>>()?;
            pairs.iter().zip(&sums).for_each(|(&pair, sum)| self.put(normal, pair, sum, sign));
        }
        Ok(())
    }

    /// Sum over the poses of (w^T w)_ab phi phi^T, lower triangle.
    fn sum(&self, (a, b): (usize, usize)) -> Mat<f64> {
        let (count, poses) = (self.features.nrows(), self.features.ncols());
        let moment = |pose: usize| -> f64 {
            let rows = self.offsets[pose]..self.offsets[pose + 1];
            rows.map(|row| self.entries[(a, row)] * self.entries[(b, row)]).sum()
        };
        let moments: Vec<f64> = (0..poses).map(moment).collect();
        let mut sum = Mat::zeros(count, count);
        for first in (0..poses).step_by(POSES) {
            let part = self.features.subcols(first, POSES.min(poses - first));
            let scaled = Mat::from_fn(count, part.ncols(), |f, i| moments[first + i] * part[(f, i)]);
            add_to_lower(sum.as_mut(), part, scaled.transpose(), 1.0, Par::Seq);
        }
        sum
    }

    /// Adds a pair's sum where its two columns meet: for two features each of them goes with either.
    fn put(&self, normal: &mut Mat<f64>, (a, b): (usize, usize), sum: &Mat<f64>, sign: f64) {
        for g in 0..sum.ncols() {
            for f in g..sum.nrows() {
                let value = sign * sum[(f, g)];
                let deviation =
                    |of_f: usize, of_g: usize| self.deviations[(of_f, f)] * self.deviations[(of_g, g)];
                normal[(self.unknown(f, a), self.unknown(g, b))] += value * deviation(a, b);
                if a != b && f != g {
                    normal[(self.unknown(f, b), self.unknown(g, a))] += value * deviation(b, a);
                }
            }
        }
    }
}
