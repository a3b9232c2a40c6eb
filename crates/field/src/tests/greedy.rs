//! Choosing by rank updates against posteriors that are inferred anew.

use proptest::prelude::*;
use truearm_kinematics::Cancel;

use super::posterior::{close, own_columns, queries, sets, space_without, spaces};
use crate::greedy::{Candidates, Greedy, choose_informative, choose_telling};
use crate::posterior::Posterior;
use crate::training::Training;

/// Covariance, noise and points of some candidates of m rows, and of t targets behind them.
#[derive(Debug, Clone)]
struct Case {
    covariance: Vec<f64>,
    noise: Vec<f64>,
    points: Vec<f64>,
    rows: usize,
}

impl Case {
    fn candidates(&self, apart: f64) -> Candidates<'_> {
        Candidates { noise: &self.noise, rows: self.rows, points: &self.points, apart }
    }

    fn informative(&self, count: usize) -> Greedy {
        choose_informative(&self.covariance, &self.candidates(0.0), count, &Cancel::default()).unwrap()
    }
}

/// `factor factor^T` of a row-major (size, width).
fn gram(factor: &[f64], size: usize) -> Vec<f64> {
    let width = factor.len() / size;
    let row = |i: usize| &factor[i * width..(i + 1) * width];
    let entry = |k: usize| row(k / size).iter().zip(row(k % size)).map(|(a, b)| a * b).sum();
    (0..size * size).map(entry).collect()
}

fn cases() -> impl Strategy<Value = Case> {
    (2_usize..6, 1_usize..4, 1_usize..4).prop_flat_map(|(count, rows, targets)| {
        let size = count * rows + targets;
        let factor = prop::collection::vec(-1.0..1.0_f64, size * size);
        let levels = prop::collection::vec(0.05..1.0_f64, count * rows);
        let points = prop::collection::vec(-1.0..1.0_f64, 3 * count);
        (factor, levels, points).prop_map(move |(factor, levels, points)| {
            let mut noise = vec![0.0; count * rows * rows];
            for (k, level) in levels.iter().enumerate() {
                noise[(k / rows) * rows * rows + (k % rows) * (rows + 1)] = *level;
            }
            Case { covariance: gram(&factor, size), noise, points, rows }
        })
    })
}

/// The rows of a pose, and whether they were measured: Jacobian, set-up, noise covariance.
fn rows_of(posterior: &Posterior, training: &Training, pose: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let rows = training.rows(pose);
    let (columns, width) = (training.columns.len(), training.setup_width);
    let jacobian = own_columns(training, &training.jacobian[rows.start * columns..rows.end * columns]);
    let setup = training.setup[rows.start * width..rows.end * width].to_vec();
    let mut noise = posterior.repeatability(&jacobian, rows.len()).unwrap();
    for (i, row) in rows.clone().enumerate() {
        noise[i * (rows.len() + 1)] += training.noise_variance(row, posterior.model().hyper.noise);
    }
    (jacobian, setup, noise)
}

#[test]
fn a_measured_candidate_leaves_what_a_posterior_with_it_leaves() {
    let (training, joints) = sets().into_iter().next().unwrap();
    for posterior in spaces(&training, joints) {
        let pose = 5;
        let fewer = space_without(posterior.model(), pose);
        let (jacobian, setup, noise) = rows_of(&fewer, &training, pose);
        for target in queries(&training).into_iter().take(4) {
            let values = [training.values_of(pose), &target].concat();
            let both = [jacobian.clone(), jacobian.clone()].concat();
            let own = [setup.clone(), vec![0.0; setup.len()]].concat();
            let case = Case {
                covariance: fewer.joint_covariance(&values, &both, Some(&own), 3).unwrap(),
                noise: noise.clone(),
                points: vec![0.0; 3],
                rows: 3,
            };
            let with = space_without(posterior.model(), usize::MAX);
            let known = with.covariance(&target, &jacobian, None, 3).unwrap();
            let wanted: f64 = (0..3).map(|k| known[4 * k]).sum();
            close(&case.informative(1).values[1..], &[wanted], 1e-6, "variance");
        }
    }
}

#[test]
fn the_joint_covariance_holds_that_of_each() {
    for (training, joints) in sets() {
        for posterior in spaces(&training, joints) {
            let rows = training.rows(1).len();
            let (jacobian, setup, _) = rows_of(&posterior, &training, 1);
            let places = queries(&training);
            let all = places.concat();
            let many = jacobian.repeat(places.len());
            let setups = setup.repeat(places.len());
            for given in [None, Some(setups.as_slice())] {
                let joint = posterior.joint_covariance(&all, &many, given, rows).unwrap();
                let each = posterior.covariance(&all, &many, given, rows).unwrap();
                let size = rows * places.len();
                for (k, wanted) in each.chunks_exact(rows * rows).enumerate() {
                    let entry = |e: usize| joint[(k * rows + e / rows) * size + k * rows + e % rows];
                    let found: Vec<f64> = (0..rows * rows).map(entry).collect();
                    close(&found, wanted, 1e-9, "diagonal block");
                }
                let turned: Vec<f64> =
                    (0..size * size).map(|e| joint[(e % size) * size + e / size]).collect();
                close(&joint, &turned, 1e-9, "symmetric");
                let first = 1;
                let cross = posterior.cross_covariance(first, &all, &many, given, rows).unwrap();
                let block: Vec<f64> = (0..first * rows)
                    .flat_map(|i| joint[i * size + first * rows..(i + 1) * size].to_vec())
                    .collect();
                close(&cross, &block, 1e-9, "block beside the diagonal");
            }
        }
    }
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let candidates = Candidates { noise: &[1.0; 2], rows: 1, points: &[0.0; 6], apart: 0.0 };
    let cancel = Cancel::default();
    for (covariance, count) in [(vec![1.0], 1), (vec![1.0; 5], 1), (vec![1.0, 0.0, 0.0, 1.0], 3)] {
        assert!(choose_informative(&covariance, &candidates, count, &cancel).is_err());
        assert!(choose_telling(&covariance, &covariance, &candidates, count, &cancel).is_err());
    }
    let few = Candidates { points: &[0.0; 3], ..candidates };
    assert!(choose_informative(&[1.0, 0.0, 0.0, 1.0], &few, 1, &cancel).is_err());
    cancel.request();
    assert!(choose_informative(&[1.0, 0.0, 0.0, 1.0], &candidates, 1, &cancel).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn variance_never_rises(case in cases()) {
        let found = case.informative(case.candidates(0.0).noise.len() / (case.rows * case.rows));
        prop_assert!(found.values.windows(2).all(|pair| pair[1] <= pair[0] + 1e-12));
        prop_assert!(found.values.iter().all(|value| *value >= -1e-9));
        let mut sorted = found.chosen.clone();
        sorted.sort_unstable();
        sorted.dedup();
        prop_assert_eq!(sorted.len(), found.chosen.len());
    }

    #[test]
    fn the_first_is_the_best_single_one(case in cases()) {
        let (m, count) = (case.rows, case.noise.len() / (case.rows * case.rows));
        let size = case.covariance.len().isqrt();
        let alone = |k: usize| {
            let kept: Vec<usize> = (k * m..(k + 1) * m).chain(count * m..size).collect();
            let part = Case {
                covariance: kept.iter().flat_map(|&i| kept.iter().map(move |&j| (i, j)))
                    .map(|(i, j)| case.covariance[i * size + j]).collect(),
                noise: case.noise[k * m * m..(k + 1) * m * m].to_vec(),
                points: vec![0.0; 3],
                rows: m,
            };
            part.informative(1).values[1]
        };
        let best = (0..count).map(alone).fold(f64::INFINITY, f64::min);
        let found = case.informative(1).values[1];
        prop_assert!((found - best).abs() <= 1e-9 * (1.0 + best), "{} instead of {}", found, best);
    }

    #[test]
    fn information_grows_and_chosen_ones_lie_apart(case in cases(), seed in 0.1..1.0_f64) {
        let (m, count) = (case.rows, case.noise.len() / (case.rows * case.rows));
        let whole = case.covariance.len().isqrt();
        let size = count * m;
        let unchanged: Vec<f64> = (0..size * size).map(|k| case.covariance[(k / size) * whole + k % size]).collect();
        let column: Vec<f64> = (0..size).map(|k| (seed * (k + 1) as f64).sin()).collect();
        let changed: Vec<f64> =
            (0..size * size).map(|k| unchanged[k] + column[k / size] * column[k % size]).collect();
        let candidates = case.candidates(0.5);
        let found = choose_telling(&changed, &unchanged, &candidates, count, &Cancel::default()).unwrap();
        prop_assert!(found.values.windows(2).all(|pair| pair[1] >= pair[0] - 1e-9));
        let far = |a: usize, b: usize| {
            (0..3).map(|k| (case.points[3 * a + k] - case.points[3 * b + k]).powi(2)).sum::<f64>().sqrt() >= 0.5
        };
        let first = found.chosen[0];
        if (0..count).any(|k| k != first && far(k, first)) {
            prop_assert!(far(found.chosen[1], first));
        }
    }
}
