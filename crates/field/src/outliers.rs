//! Outliers, judged against the finished model by what the other poses predict.
//!
//! A loss that forgives large residuals before the field is fitted throws away genuine local error. Here a pose is
//! judged by its leave-one-out residual under constants and field, standardised by everything that the model knows of
//! its own uncertainty, at full weight even where an earlier judgement took its weight away.

use std::collections::BTreeMap;

use faer::Mat;
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::posterior::{Posterior, Solution, standardised};
use crate::refine::explained;
use crate::training::Training;

/// Judgement of every pose by the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Each pose's squared standardised leave-one-out residual over the squared limit, (n,): above one is an outlier.
    pub score: Vec<f64>,
    /// Length of each pose's leave-one-out residual of the first target, (n,), m.
    pub distance: Vec<f64>,
    /// Each pose's squared leave-one-out residual, every row's over the variance of its noise at full weight, (n,).
    pub over_noise: Vec<f64>,
    /// Factor that makes 95 % of the standardised components lie within [`QUANTILE_95`], at least one.
    pub inflation: f64,
    /// Poses that are outliers.
    pub outliers: Vec<usize>,
}

/// Standard normal quantile of odds of one in a million: overwhelming evidence against a pose.
const OVERWHELMING: f64 = 4.753_424_308_8;
/// Weight of a row that just is an outlier's, less the farther it is out: its square no longer counts, in noise and
/// amplitudes neither.
const NEGLIGIBLE: f64 = 1e-3;
/// Share of all squared residuals from which outliers have spoiled what noise and amplitudes were taken for.
const SPOILING: f64 = 0.1;
/// A pose is suspicious when its squared residual reaches this many times its number of rows.
pub const SUSPICIOUS: f64 = 3.0;
/// Poses that are predicted between two looks at a request to stop.
const TOGETHER: usize = 128;
/// 95 % of a standard normal variable lies within this.
pub const QUANTILE_95: f64 = 1.959_963_984_540_054;

/// Quantile of the chi-squared distribution at a standard normal quantile (Wilson and Hilferty 1931), at odds of one in a
/// million up to 8 % too large.
pub fn chi_squared(freedom: f64, normal_quantile: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    freedom * (1.0 - spread + normal_quantile * spread.sqrt()).powi(3)
}

/// Judges every pose of a training set by a posterior that was inferred from all or from some of them, and its solution.
///
/// `places` says which of `all` poses each of the posterior's is. Poses of which it has no rows are judged by what it
/// predicts of them.
///
/// # Errors
/// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
pub fn judge(
    posterior: &Posterior,
    solution: &Solution,
    all: &Training,
    places: &[usize],
    cancel: &Cancel,
) -> Result<Judgement, FieldError> {
    let training = posterior.training();
    let left_out = posterior.leave_one_out(&training.residual)?;
    let took_part: Vec<usize> =
        (0..training.pose_count()).filter(|&pose| !training.rows(pose).is_empty()).collect();
    let poses = 0..all.pose_count();
    let (mut squares, mut distance) = (vec![0.0; poses.len()], vec![0.0; poses.len()]);
    let (mut over_noise, noise) = (vec![0.0; poses.len()], posterior.model().hyper.noise);
    let mut is_aside: Vec<bool> = poses.clone().map(|pose| !all.rows(pose).is_empty()).collect();
    for &pose in &took_part {
        let place = places[pose];
        squares[place] = square_of(&left_out.standardised[training.rows(pose)]);
        distance[place] = distance_of(&left_out.residual[training.rows(pose)]);
        over_noise[place] = over_noise_of(training, pose, noise, &left_out.residual[training.rows(pose)]);
        is_aside[place] = false;
    }
    let sampled = |pose: usize| training.rows(pose).next().is_some_and(|row| left_out.sampled[row]);
    let trusted: Vec<usize> =
        took_part.into_iter().filter(|&pose| is_trusted(training, pose) && sampled(pose)).collect();
    let shares = trusted
        .iter()
        .map(|&pose| squares[places[pose]] / chi_squared(training.rows(pose).len() as f64, 0.0));
    let typical = quantile(shares, 0.5).max(1.0);
    let limit = |rows: usize| typical * chi_squared(rows as f64, OVERWHELMING);
    let others: Vec<usize> = poses.clone().filter(|&pose| is_aside[pose]).collect();
    for aside in judge_aside(posterior, solution, (all, &others), limit, cancel)? {
        (squares[aside.pose], distance[aside.pose]) = (aside.square, aside.distance);
        over_noise[aside.pose] = aside.over_noise;
    }
    let score = |pose: usize| match all.rows(pose).len() {
        0 => 0.0,
        rows => squares[pose] / limit(rows),
    };
    let components = trusted.iter().flat_map(|&pose| &left_out.standardised[training.rows(pose)]);
    let inflation = (quantile(components.map(|z| z.abs()), 0.95) / QUANTILE_95).max(1.0);
    let score: Vec<f64> = poses.clone().map(score).collect();
    let outliers = poses.filter(|&pose| score[pose] > 1.0).collect();
    Ok(Judgement { distance, over_noise, outliers, score, inflation })
}

fn square_of(standardised: &[f64]) -> f64 {
    standardised.iter().map(|z| z * z).sum()
}

/// Length of a pose's residual (m,) of the first target.
fn distance_of(residual: &[f64]) -> f64 {
    residual.iter().take(3).map(|x| x * x).sum::<f64>().sqrt()
}

/// Variance of a row's noise at full weight.
fn noise_of(training: &Training, row: usize, noise: [f64; 2]) -> f64 {
    training.weight[row] * training.noise_variance(row, noise)
}

/// Squares of a pose's residual (m,), each over the variance of its row's noise at full weight.
fn over_noise_of(training: &Training, pose: usize, noise: [f64; 2], residual: &[f64]) -> f64 {
    training.rows(pose).zip(residual).map(|(row, left)| left.powi(2) / noise_of(training, row, noise)).sum()
}

/// What is left of a pose that others stood for.
struct Aside {
    pose: usize,
    square: f64,
    distance: f64,
    over_noise: f64,
}

/// Judges poses of a training set that no posterior was inferred from: all that took part are others. What is below the limit of
/// its number of rows beside the noise alone needs no covariance of the prediction.
fn judge_aside(
    posterior: &Posterior,
    solution: &Solution,
    (all, poses): (&Training, &[usize]),
    limit: impl Fn(usize) -> f64,
    cancel: &Cancel,
) -> Result<Vec<Aside>, FieldError> {
    if poses.is_empty() {
        return Ok(Vec::new());
    }
    let part = all.select(poses);
    let explained = explained(&part, solution)?;
    let left: Vec<f64> =
        part.residual.iter().zip(explained).map(|(residual, known)| residual - known).collect();
    let noise = posterior.model().hyper.noise;
    let mut found = Vec::with_capacity(poses.len());
    let mut suspicious: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (k, &pose) in poses.iter().enumerate() {
        let rows = part.rows(k);
        let over_noise = over_noise_of(&part, k, noise, &left[rows.clone()]);
        if over_noise > limit(rows.len()) {
            suspicious.entry(rows.len()).or_default().push(k);
        }
        found.push(Aside { pose, square: over_noise, distance: distance_of(&left[rows]), over_noise });
    }
    let chunks =
        suspicious.iter().flat_map(|(&count, some)| some.chunks(TOGETHER).map(move |some| (count, some)));
    for (count, some) in chunks {
        cancel.check()?;
        let chosen = part.select(some);
        let setup = Some(chosen.setup.as_slice());
        let known = posterior.covariance(&chosen.values, &chosen.jacobian, setup, count)?;
        let anew = posterior.repeatability(&chosen.jacobian, count)?;
        for (at, &k) in some.iter().enumerate() {
            let first = part.rows(k).start;
            let covariance = Mat::from_fn(count, count, |i, j| {
                let entry = (at * count + i) * count + j;
                known[entry] + anew[entry] + if i == j { noise_of(&part, first + i, noise) } else { 0.0 }
            });
            found[k].square = square_of(&standardised(covariance, &left[part.rows(k)])?);
        }
    }
    Ok(found)
}

/// Whether a pose takes part with its full weight.
fn is_trusted(training: &Training, pose: usize) -> bool {
    training.weight_of(pose).is_some_and(|weight| weight > NEGLIGIBLE)
}

fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    if sorted.is_empty() {
        return 1.0;
    }
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

impl Training {
    /// The poses that take part with their full weight.
    pub fn trusted(&self) -> Training {
        let poses: Vec<usize> = (0..self.pose_count()).filter(|&pose| is_trusted(self, pose)).collect();
        self.select(&poses)
    }

    /// Takes the weight of some poses away until they are judged.
    pub fn take_weight(&mut self, poses: &[usize]) {
        for &pose in poses {
            for row in self.rows(pose) {
                self.weight[row] *= NEGLIGIBLE;
            }
        }
    }
}

/// What a judgement changed.
#[derive(Debug, Clone, Copy)]
pub struct News {
    /// Whether poses became outliers, or are none any more.
    pub poses: bool,
    /// Share of all squared residuals, over noise, that weights were given or taken away of.
    pub share: f64,
}

impl News {
    /// Whether hyper-parameters that were found with the former weights cannot stay.
    pub fn spoils(&self) -> bool {
        self.share > SPOILING
    }
}

impl Judgement {
    /// Takes the weight of the outliers away and gives it back to poses judged innocent: weights that the measurements came
    /// with, between 0 and 1, were where the judgement began and no more.
    ///
    /// A model that an outlier has bent finds it less far out than it is: it may leave it too much.
    pub fn reweigh(&self, training: &mut Training) -> News {
        let (mut poses, mut changed, mut kept) = (false, 0.0, 0.0);
        for pose in 0..training.pose_count() {
            let weight = if self.score[pose] > 1.0 { NEGLIGIBLE / self.score[pose] } else { 1.0 };
            let rows = training.rows(pose);
            let Some(before) = training.weight_of(pose) else { continue };
            poses |= (before < 1.0) != (weight < 1.0);
            changed += (before - weight).abs() * self.over_noise[pose];
            kept += weight * self.over_noise[pose];
            training.weight[rows].fill(weight);
        }
        News { poses, share: changed / (changed + kept).max(f64::MIN_POSITIVE) }
    }

    /// The same for shots, each of the pose that `pose_of` (n,) says.
    pub fn of_shots(&self, pose_of: &[usize]) -> Judgement {
        let of = |values: &[f64]| pose_of.iter().map(|&pose| values[pose]).collect::<Vec<f64>>();
        let score = of(&self.score);
        let outliers = (0..score.len()).filter(|&shot| score[shot] > 1.0).collect();
        let (distance, over_noise) = (of(&self.distance), of(&self.over_noise));
        Judgement { distance, over_noise, outliers, score, inflation: self.inflation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_squared_quantiles_match_tables() {
        // Half of chi-squared with 3, 6 and 9 degrees of freedom lies below the first number, 99.9999 % below the second.
        for (freedom, half, most) in [(3.0, 2.366, 30.665), (6.0, 5.348, 38.258), (9.0, 8.343, 44.811)] {
            assert!((chi_squared(freedom, 0.0) / half - 1.0).abs() < 0.01);
            let limit = chi_squared(freedom, OVERWHELMING) / most;
            assert!((1.0..1.08).contains(&limit), "the approximation may only be too careful: {limit}");
        }
    }
}
