use proptest::prelude::*;

use super::*;

const ROWS: usize = 200;

fn found_in(residual: &[f64], weight: &[f64]) -> Drift {
    let progress = progress();
    find_drift(Left { progress: &progress, residual, weight }, &progress, 3).unwrap()
}

fn progress() -> Vec<f64> {
    (0..ROWS).map(|k| k as f64 / (ROWS - 1) as f64).collect()
}

/// Numbers that look like noise of standard deviation one.
fn noise(seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..COORDINATES * ROWS).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
}

/// A set-up that warms up: 0.1 mm, most of it in the first tenth, along one direction.
fn warming(progress: f64) -> [f64; 3] {
    [0.06, 0.0, -0.08].map(|most| 1e-3 * most * (1.0 - (-progress / 0.1).exp()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn a_drift_is_found_in_noise(seed in 0_u64..1000) {
        let progress = progress();
        let truth: Vec<f64> = progress.iter().flat_map(|&at| warming(at)).collect();
        let residual: Vec<f64> = truth.iter().zip(noise(seed)).map(|(a, b)| a + 2e-5 * b).collect();
        let found = found_in(&residual, &[1.0; ROWS]);
        let mean = |c: usize| truth.iter().skip(c).step_by(3).sum::<f64>() / ROWS as f64;
        let means = [mean(0), mean(1), mean(2)];
        let squares = truth.iter().zip(&found.moved).enumerate();
        let squares = squares.map(|(k, (true_, moved))| (true_ - means[k % 3] - moved).powi(2));
        let left = (squares.sum::<f64>() / (3 * ROWS) as f64).sqrt();
        prop_assert!(left < 0.6 * 2e-5, "{left}");
        prop_assert!((found.noise / 2e-5 - 1.0).abs() < 0.15, "{}", found.noise);
        prop_assert!(found.gain > 20.0, "{}", found.gain);
    }

    #[test]
    fn noise_alone_has_next_to_none(seed in 0_u64..1000) {
        let residual: Vec<f64> = noise(seed).iter().map(|value| 1e-4 * value).collect();
        let found = found_in(&residual, &[1.0; ROWS]);
        let moved = (found.moved.iter().map(|x| x * x).sum::<f64>() / (3 * ROWS) as f64).sqrt();
        // A gain of ten is taken for a drift.
        prop_assert!(found.gain < 10.0 && moved < 0.3e-4, "{} {moved}", found.gain);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    /// A tripod that is bumped while it warms up, by ten times the noise in one coordinate, not in the twentieth of the
    /// session at either end, where a quick curve may stand for it.
    #[test]
    fn a_step_is_found_where_it_is(seed in 0_u64..1000, after in ROWS / 20 + 2..ROWS - ROWS / 20 - 2) {
        let stepped = |row: usize| if row > after { 2e-4 } else { 0.0 };
        let truth: Vec<f64> = progress().iter().flat_map(|&at| warming(at)).collect();
        let truth = truth.iter().enumerate();
        let truth = truth.map(|(k, value)| if k % 3 == 1 { stepped(k / 3) } else { *value });
        let residual: Vec<f64> = truth.zip(noise(seed)).map(|(a, b)| a + 2e-5 * b).collect();
        let found = found_in(&residual, &[1.0; ROWS]);
        let expected = (after as f64 + 0.5) / (ROWS - 1) as f64;
        let rows = |at: f64| (at - expected) * (ROWS - 1) as f64;
        prop_assert!(found.steps.len() == 1 && rows(found.steps[0]).abs() < 1.5, "{:?}", found.steps);
        let jump = found.moved[3 * (after + 3) + 1] - found.moved[3 * (after - 2) + 1];
        prop_assert!((jump / 2e-4 - 1.0).abs() < 0.25, "{jump}");
    }

    /// Two bumps, rows in any order.
    #[test]
    fn steps_are_found_one_after_the_other(seed in 0_u64..1000) {
        let progress: Vec<f64> = (0..ROWS).map(|k| (k * 77 % ROWS) as f64 / (ROWS - 1) as f64).collect();
        let bumped = |at: f64| [if at > 0.31 { 2e-4 } else { 0.0 }, 0.0, if at > 0.72 { 3e-4 } else { 0.0 }];
        let truth = progress.iter().flat_map(|&at| bumped(at));
        let residual: Vec<f64> = truth.zip(noise(seed)).map(|(a, b)| a + 2e-5 * b).collect();
        let left = Left { progress: &progress, residual: &residual, weight: &[1.0; ROWS] };
        let near = |found: f64, place: f64| (found - place).abs() < 1.5 / (ROWS - 1) as f64;
        let both = find_drift(left, &[], 4).unwrap().steps;
        prop_assert!(both.len() == 2 && near(both[0], 0.31) && near(both[1], 0.72), "{:?}", both);
        let first = find_drift(left, &[], 1).unwrap().steps;
        prop_assert!(first.len() == 1 && near(first[0], 0.72), "{:?}", first);
        prop_assert!(find_drift(left, &[], 0).unwrap().steps.is_empty());
    }

    #[test]
    fn what_drifts_slowly_has_no_step(seed in 0_u64..1000) {
        let truth: Vec<f64> = progress().iter().flat_map(|&at| warming(at)).collect();
        let residual: Vec<f64> = truth.iter().zip(noise(seed)).map(|(a, b)| a + 2e-5 * b).collect();
        prop_assert!(found_in(&residual, &[1.0; ROWS]).steps.is_empty());
    }

    /// The gain of one more step is that of the evidence with it, at the same ratio and noise.
    #[test]
    fn the_gain_of_a_step_is_that_of_the_evidence(seed in 0_u64..1000, after in 8_usize..ROWS - 8) {
        let (progress, residual) = (progress(), noise(seed));
        let weight: Vec<f64> = (0..ROWS).map(|row| 1.0 / (1 + row % 4) as f64).collect();
        let left = Left { progress: &progress, residual: &residual, weight: &weight };
        let right = Mat::from_fn(ROWS, COORDINATES, |i, k| residual[COORDINATES * i + k]);
        let (right, _) = centred(right, &weight);
        let place = (after as f64 + 0.5) / (ROWS - 1) as f64;
        let without = Curve::new(&left, &right, 0.4, &[]).unwrap();
        let with = Curve::new(&left, &right, 0.4, &[place]).unwrap();
        let choice = Choice { evidence: 0.0, gain: 0.0, ratio: 0.3, noise: 1.1 };
        let value = |curve: &Curve| {
            let variance = curve.likelihood(choice.ratio).1;
            let determinant: f64 =
                curve.values.iter().map(|value| (choice.ratio * value).ln_1p()).sum();
            -0.5 * (variance * curve.freedom / choice.noise.powi(2) + COORDINATES as f64 * determinant)
        };
        let total: f64 = weight.iter().sum();
        let behind: f64 = weight[after + 1..].iter().sum();
        let rows = after + 1..ROWS;
        let over = |of: &dyn Fn(usize) -> f64| -> f64 {
            rows.clone().map(|i| weight[i].sqrt() * of(i)).sum()
        };
        let sums = std::array::from_fn(|c| over(&|i| right[(i, c)]));
        let products: Vec<f64> =
            (0..without.values.len()).map(|k| over(&|i| without.features[(i, k)])).collect();
        let gain = without.gain_of_step(&choice, behind * (total - behind) / total, (&sums, &products));
        prop_assert!((gain - (value(&with) - value(&without))).abs() < 1e-6 * (1.0 + gain.abs()));
    }
}

/// A third of the rows with noise that is fifty times as large, and said to be.
#[test]
fn rows_that_are_known_to_be_noisy_hide_nothing() {
    let worse = |row: usize| if row.is_multiple_of(3) { 50.0 } else { 1.0 };
    let truth: Vec<f64> = progress().iter().flat_map(|&at| warming(at)).collect();
    let rows = truth.iter().zip(noise(3)).enumerate();
    let residual: Vec<f64> = rows.map(|(k, (a, b))| a + 2e-5 * worse(k / COORDINATES) * b).collect();
    let weight: Vec<f64> = (0..ROWS).map(|row| 1.0 / worse(row).powi(2)).collect();
    assert!(found_in(&residual, &weight).gain > 20.0);
    assert!(found_in(&residual, &[1.0; ROWS]).gain < 10.0);
}

/// The likelihood in closed form is that of the covariance matrix of the rows.
#[test]
fn the_evidence_is_that_of_the_rows_covariance() {
    let (progress, residual) = (progress(), noise(7));
    let weight: Vec<f64> = (0..ROWS).map(|row| 1.0 / (1 + row % 4) as f64).collect();
    let measured = Mat::from_fn(ROWS, COORDINATES, |i, k| residual[COORDINATES * i + k]);
    let (right, _) = centred(measured.clone(), &weight);
    let left = Left { progress: &progress, residual: &residual, weight: &weight };
    let curve = Curve::new(&left, &right, 0.2, &[0.31]).unwrap();
    let (value, variance) = curve.likelihood(0.3);
    let features: Vec<Vec<f64>> =
        progress.iter().map(|&at| super::features(&curve.root, &curve.cells, &[0.31], at)).collect();
    let dot = |i: usize, j: usize| -> f64 { features[i].iter().zip(&features[j]).map(|(a, b)| a * b).sum() };
    let own = |i: usize, j: usize| if i == j { 1.0 / weight[i] } else { 0.0 };
    let entry = |i: usize, j: usize| variance * (0.3 * dot(i, j) + own(i, j));
    let covariance = Mat::from_fn(ROWS, ROWS, entry);
    let factor = truearm_estimate::dense::Cholesky::new(covariance, faer::Par::Seq).unwrap();
    let ones = vec![1.0; ROWS];
    let spread = factor.solve_vector(&ones);
    let total: f64 = spread.iter().sum();
    let known = weight.iter().map(|w| w.ln()).sum::<f64>() - weight.iter().sum::<f64>().ln();
    let mut expected = 0.0;
    for c in 0..COORDINATES {
        let column: Vec<f64> = (0..ROWS).map(|i| measured[(i, c)]).collect();
        let solved = factor.solve_vector(&column);
        let mean = solved.iter().sum::<f64>() / total;
        let fit: f64 = column.iter().zip(&solved).zip(&spread).map(|((r, s), o)| r * (s - mean * o)).sum();
        expected -= 0.5 * (factor.log_determinant() + total.ln() + known + fit);
    }
    let shown = value - 0.5 * curve.freedom;
    assert!((shown / expected - 1.0).abs() < 1e-9, "{shown} {expected}");
}

#[test]
fn rows_that_do_not_belong_together_are_refused() {
    let refused = |progress: &[f64], residual: &[f64], weight: &[f64]| {
        find_drift(Left { progress, residual, weight }, &[], 0).is_err()
    };
    assert!(!refused(&[0.0, 1.0], &[0.0; 6], &[1.0; 2]));
    assert!(refused(&[0.0, 1.0], &[0.0; 5], &[1.0; 2]));
    assert!(refused(&[0.0, 1.0], &[0.0; 6], &[1.0; 3]));
    assert!(refused(&[0.0, 1.0], &[0.0; 6], &[1.0, 0.0]));
    assert!(refused(&[0.0, f64::NAN], &[0.0; 6], &[1.0; 2]));
    assert!(refused(&[0.5], &[0.0; 3], &[1.0]));
}
