//! Outliers, judged against the finished model by what the other poses predict.
//!
//! A loss that forgives large residuals before the field is fitted throws away genuine local error. Here a pose is
//! judged by its leave-one-out residual under constants and field, standardised by everything that the model knows of
//! its own uncertainty.

use crate::FieldError;
use crate::posterior::{Posterior, Solution};
use crate::training::Training;

/// Judgement of every pose by the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Root mean square of each pose's standardised leave-one-out residual, (n,), relative to the typical one.
    pub score: Vec<f64>,
    /// Length of each pose's leave-one-out residual of the first target, (n,), m.
    pub distance: Vec<f64>,
    /// Factor that makes 95 % of the standardised components lie within 1.96, at least one.
    pub inflation: f64,
    /// Poses taken out of the fit.
    pub outliers: Vec<usize>,
}

/// A pose this many typical deviations off is taken out: a normal error of this size has odds of 1e-9 a row.
const OVERWHELMING: f64 = 6.0;
/// Weight of an outlier's rows: their noise is a thousand times larger.
const NEGLIGIBLE: f64 = 1e-6;
/// 95 % of a standard normal variable lies within this.
const QUANTILE_95: f64 = 1.959_963_984_540_054;

/// Judges every pose of a posterior's training set.
///
/// # Errors
/// [`FieldError::NotPositiveDefinite`].
pub fn judge(posterior: &Posterior, solution: &Solution) -> Result<Judgement, FieldError> {
    let training = &posterior.training;
    let left_out = posterior.leave_one_out(&solution.alpha)?;
    let root_mean_square =
        |values: &[f64]| (values.iter().map(|z| z * z).sum::<f64>() / values.len().max(1) as f64).sqrt();
    let raw: Vec<f64> = (0..training.pose_count())
        .map(|pose| root_mean_square(&left_out.standardised[training.rows(pose)]))
        .collect();
    let judged: Vec<usize> = (0..training.pose_count()).filter(|&pose| is_judged(training, pose)).collect();
    let typical = quantile(judged.iter().map(|&pose| raw[pose]), 0.5).max(f64::MIN_POSITIVE);
    let components =
        judged.iter().flat_map(|&pose| &left_out.standardised[training.rows(pose)]).map(|z| z.abs());
    let inflation = (quantile(components, 0.95) / QUANTILE_95).max(1.0);
    let distance = |pose: usize| {
        let rows = training.rows(pose);
        let first = rows.start..(rows.start + 3).min(rows.end);
        left_out.residual[first].iter().map(|x| x * x).sum::<f64>().sqrt()
    };
    let score: Vec<f64> = raw.iter().map(|z| z / typical.max(1.0)).collect();
    let outliers = (0..training.pose_count())
        .filter(|&pose| !training.rows(pose).is_empty())
        .filter(|&pose| score[pose] > OVERWHELMING || !is_judged(training, pose))
        .collect();
    Ok(Judgement { distance: (0..training.pose_count()).map(distance).collect(), score, inflation, outliers })
}

/// Whether a pose takes part with its full weight.
fn is_judged(training: &Training, pose: usize) -> bool {
    training.rows(pose).next().is_some_and(|row| training.weight[row] > NEGLIGIBLE)
}

fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    if sorted.is_empty() {
        return 1.0;
    }
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

impl Judgement {
    /// Takes the outliers' weight away; says whether that changed anything.
    pub fn reweigh(&self, training: &mut Training) -> bool {
        let mut changed = false;
        for &pose in &self.outliers {
            for row in training.rows(pose) {
                changed |= training.weight[row] > NEGLIGIBLE;
                training.weight[row] = training.weight[row].min(NEGLIGIBLE);
            }
        }
        changed
    }
}
