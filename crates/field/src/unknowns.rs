//! The unknowns of weight space: constants, set-up, `sag`, then block by block the eigenvectors of the cells' priors that matter.

use faer::{Mat, Side};

use crate::cells::CellKernel;
use crate::model::Model;

/// Eigenvalues (of products: their products) below this share of the largest are left out.
const NEGLIGIBLE: f64 = 1e-5;

/// E of one axis, (cells, r).
pub struct Root {
    pub entries: Mat<f64>,
    /// Eigenvalues that are kept, over the largest, (r,).
    values: Vec<f64>,
}

impl Root {
    /// Of an axis's cells; `None` where their prior has no eigenvectors.
    pub fn new(cells: &CellKernel) -> Option<Self> {
        let n = cells.axis.count;
        let matrix = Mat::from_fn(n, n, |i, j| cells.correlation[i.abs_diff(j)]);
        let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let largest = values[n - 1];
        let kept: Vec<usize> = (0..n).rev().filter(|&k| values[k] > NEGLIGIBLE * largest).collect();
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
    for plan in &plans {
        let roots: Vec<Root> = plan.axes.iter().map(|(_, cells)| Root::new(cells)).collect::<Option<_>>()?;
        let combinations = combinations(&roots);
        all.push(Unknowns { start: 0, roots, combinations });
    }
    let mut start = sag_start(model) + model.training.geometry.len();
    for of_all in [false, true] {
        for (plan, unknowns) in plans.iter().zip(&mut all).filter(|(plan, _)| plan.of_all == of_all) {
            unknowns.start = start;
            start += unknowns.combinations.len() * plan.driven.len();
        }
    }
    Some((all, start))
}

/// Where the weights of the `sag` block stand, one a lever.
pub fn sag_start(model: &Model) -> usize {
    model.by_column.constant.len() + model.training.setup_width
}

fn combinations(roots: &[Root]) -> Vec<[usize; 3]> {
    let count = |k: usize| roots.get(k).map_or(1, |root| root.values.len());
    let value = |k: usize, i: usize| roots.get(k).map_or(1.0, |root| root.values[i]);
    let mut kept = Vec::new();
    for i in 0..count(0) {
        for j in 0..count(1) {
            for k in 0..count(2) {
                if value(0, i) * value(1, j) * value(2, k) > NEGLIGIBLE {
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
