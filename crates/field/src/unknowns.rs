//! The unknowns of weight space: constants, set-up, `sag`, then block by block the eigenvectors of the cells' priors that matter.

use faer::Mat;
use truearm_bank::CellKernel;
use truearm_estimate::dense::Eigen;

use crate::model::{BlockPlan, Model};

/// Eigenvalues below this share of the largest are left out, where noise hides what they stand for.
pub const NEGLIGIBLE: f64 = 1e-5;
/// Of a block, at the rows, at most so much of the noise's variance is left out with one eigenvalue.
const HIDDEN: f64 = 0.1;
/// Smaller shares are rounding.
const ROUNDING: f64 = 1e-13;
/// Of products of eigenvalues those below such a share: the first that leaves few unknowns, or the last, which leaves out less than
/// a hundredth of a block's prior variance.
const SHARES: [f64; 3] = [NEGLIGIBLE, 1e-4, 1e-3];
/// Unknowns, or rows where they are fewer, that are few: seconds to factor on two cores.
const FEW: usize = 7000;

/// E of one axis, (cells, r).
pub struct Root {
    pub entries: Mat<f64>,
    /// Eigenvalues that are kept, over the largest, (r,).
    values: Vec<f64>,
}

impl Root {
    /// Of an axis's cells, without eigenvalues below a share of the largest; `None` where their prior has no
    /// eigenvectors.
    pub fn new(cells: &CellKernel, share: f64) -> Option<Self> {
        let n = cells.axis.count;
        let matrix = Mat::from_fn(n, n, |i, j| cells.correlation[i.abs_diff(j)]);
        let Eigen { values, vectors } = Eigen::new(&matrix)?;
        let largest = values[n - 1];
        let kept: Vec<usize> = (0..n).rev().filter(|&k| values[k] > share * largest).collect();
        let entries = Mat::from_fn(n, kept.len(), |i, k| vectors[(i, kept[k])] * values[kept[k]].sqrt());
        Some(Self { entries, values: kept.iter().map(|&k| values[k] / largest).collect() })
    }

    /// E^T times the excitation of a value.
    pub fn features(&self, cells: &CellKernel, value: f64) -> Vec<f64> {
        let mut features = vec![0.0; self.entries.ncols()];
        for (cell, grade) in cells.axis.active(value).nonzero() {
            features.iter_mut().enumerate().for_each(|(k, x)| *x += grade * self.entries[(cell, k)]);
        }
        features
    }
}

/// Unknowns of one block: for each kept combination of the axes' eigenvectors, one per driven column.
pub struct Unknowns {
    /// Where they stand among all.
    pub start: usize,
    /// E of each axis.
    pub roots: Vec<Root>,
    /// Kept eigenvectors of each axis.
    pub combinations: Vec<[usize; 3]>,
}

/// Unknowns that a model has in weight space, constants and set-up included; `None` where the cells' priors fail.
///
/// Blocks that drive all columns have the last ones.
pub fn unknowns(model: &Model) -> Option<(Vec<Unknowns>, usize)> {
    let plans = model.plans();
    let mut all = Vec::new();
    let most: Vec<f64> = plans.iter().map(|plan| most_hidden(model, plan)).collect();
    for (plan, most) in plans.iter().zip(&most) {
        let of_axis = |cells| Root::new(cells, NEGLIGIBLE.min(*most));
        let roots = plan.axes.iter().map(|(_, cells)| of_axis(cells)).collect::<Option<_>>()?;
        all.push(Unknowns { start: 0, roots, combinations: Vec::new() });
    }
    let first = sag_start(model) + model.training.geometry.len();
    for share in SHARES {
        for (unknowns, most) in all.iter_mut().zip(&most) {
            unknowns.combinations = combinations(&unknowns.roots, share.min(*most));
        }
        let counts = plans.iter().zip(&all).map(|(plan, u)| u.combinations.len() * plan.driven.len());
        if model.by_column.rows.min(first + counts.sum::<usize>()) <= FEW {
            break;
        }
    }
    let mut start = first;
    for of_all in [false, true] {
        for (plan, unknowns) in plans.iter().zip(&mut all).filter(|(plan, _)| plan.of_all == of_all) {
            unknowns.start = start;
            start += unknowns.combinations.len() * plan.driven.len();
        }
    }
    Some((all, start))
}

/// The share of a block's prior variance that noise hides at the rows, in the mean.
fn most_hidden(model: &Model, plan: &BlockPlan) -> f64 {
    let training = &model.training;
    let entries = training.jacobian.chunks_exact(training.columns.len());
    let over_noise = entries.enumerate().map(|(row, entries)| {
        let variance: f64 = plan.driven.iter().map(|&(p, variance)| entries[p].powi(2) * variance).sum();
        variance / training.noise_variance(row, model.hyper.noise)
    });
    let seen = over_noise.sum::<f64>() / training.row_count() as f64;
    (HIDDEN / seen).max(ROUNDING)
}

/// Where the weights of the `sag` block stand, one a lever.
pub fn sag_start(model: &Model) -> usize {
    model.by_column.constant.len() + model.training.setup_width
}

/// Eigenvectors of the axes whose eigenvalues' product is above a share of the largest; of a single axis all.
fn combinations(roots: &[Root], share: f64) -> Vec<[usize; 3]> {
    let share = if roots.len() > 1 { share } else { 0.0 };
    let count = |k: usize| roots.get(k).map_or(1, |root| root.values.len());
    let value = |k: usize, i: usize| roots.get(k).map_or(1.0, |root| root.values[i]);
    let mut kept = Vec::new();
    for i in 0..count(0) {
        for j in 0..count(1) {
            for k in 0..count(2) {
                if value(0, i) * value(1, j) * value(2, k) > share {
                    kept.push([i, j, k]);
                }
            }
        }
    }
    kept
}

/// Unknowns in weight space: what its cost grows with.
pub fn size(model: &Model) -> Option<usize> {
    unknowns(model).map(|found| found.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use truearm_bank::{Axis, Input, Shape};

    /// E of a whole turn with such a length scale.
    fn root(length: f64) -> Root {
        let turn = (0..400).map(|k| f64::from(k) * std::f64::consts::TAU / 400.0);
        let axis = Axis::covering(Input::ANGLE, turn, length, length / 2.0, 3);
        Root::new(
            &CellKernel::new(axis, |distance| Shape::SquaredExponential.at(distance, length)),
            NEGLIGIBLE,
        )
        .unwrap()
    }

    #[test]
    fn larger_shares_leave_fewer_unknowns_and_nearly_all_of_the_variance() {
        let roots = [root(0.6), root(0.7), root(5.0)];
        let variance = |kept: &[[usize; 3]]| -> f64 {
            kept.iter()
                .map(|kept| roots.iter().zip(kept).map(|(root, &k)| root.values[k]).product::<f64>())
                .sum()
        };
        let all = combinations(&roots, 0.0);
        let [fine, middle, coarse] = SHARES.map(|share| combinations(&roots, share));
        assert!(all.len() > 2 * fine.len() && fine.len() > middle.len() && middle.len() > coarse.len());
        assert!(2 * coarse.len() < fine.len(), "{} of {}", coarse.len(), fine.len());
        let lost = 1.0 - variance(&coarse) / variance(&all);
        assert!((0.0..0.01).contains(&lost), "{lost}");
        assert!(coarse.iter().all(|kept| middle.contains(kept)));
    }

    #[test]
    fn blocks_over_single_axes_keep_all() {
        let roots = [root(0.3)];
        assert_eq!(combinations(&roots, SHARES[2]).len(), roots[0].values.len());
    }
}
