//! What the prior does to what the data leaves open, and what the evidence does to the prior.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{ur10, ur10_columns, ur10_plain_columns, with_parameters};
use crate::common::scene::{Plan, Scene};
use truearm_estimate::{ConstantFit, ConstantOptions, Noise, Prior, Reason, fit_constant};

fn fit(scene: &Scene, prior: Prior) -> ConstantFit {
    let options = ConstantOptions { prior: Some(prior), ..ConstantOptions::default() };
    fit_constant(&scene.problem(), &options).unwrap()
}

fn plan() -> Plan {
    Plan { noise: (1e-4, 0.0), ..Plan::new(ur10(), ur10_columns(), 60) }
}

#[test]
fn undetermined_parameters_stay_nominal() {
    let scene = plan().make();
    let (found, nominal) = (fit(&scene, Prior::default()), scene.chain.nominal());
    // The first link's theta and d only move the frame; d and theta of the last only the target, whose own prior is far
    // wider and leaves them next to nothing.
    for (column, most) in [(0, 1e-7), (1, 1e-7), (25, 1e-4), (26, 1e-4)] {
        let correction = found.parameters[column] - nominal[column];
        assert!(correction.abs() < most, "column {column} moved by {correction:e}");
    }
    assert!((found.parameters[7] - nominal[7]).abs() > 1e-5);
}

#[test]
fn parameters_that_only_their_sum_determines_share_it_equally() {
    let mut truth = ur10().nominal();
    truth[16] += 1e-3;
    let chain = with_parameters(&ur10(), &truth);
    let exact = Plan { errors: 0.0, noise: (0.0, 0.0), columns: ur10_plain_columns(), chain, ..plan() };
    let scene = Scene { chain: ur10(), ..exact.make() };
    let noise = Some(Noise { position: 1e-6, orientation: 1e-6 });
    let prior = Some(Prior { scaled: false, ..Prior::default() });
    let options = ConstantOptions { prior, noise, ..ConstantOptions::default() };
    let found = fit_constant(&scene.problem(), &options).unwrap();
    for column in [6, 11, 16] {
        let correction = found.parameters[column] - scene.chain.nominal()[column];
        assert!((correction - 1e-3 / 3.0).abs() < 1e-6, "column {column}: {correction:e}");
    }
}

#[test]
fn covariance_of_undetermined_parameters_is_the_prior_s() {
    let prior = Prior { length: 1e-3, angle: 3e-3, scaled: false };
    let found = fit(&plan().make(), prior);
    let deviation = |k: usize| found.covariance[(k, k)].sqrt();
    assert!((deviation(0) / 3e-3 - 1.0).abs() < 1e-3 && (deviation(1) / 1e-3 - 1.0).abs() < 1e-3);
    assert!(deviation(5) < 1e-4);
}

#[test]
fn the_evidence_scales_the_prior() {
    let scale = |errors: f64| {
        let scales =
            (0..20).map(|seed| fit(&Plan { errors, seed, ..plan() }.make(), Prior::default()).prior_scale);
        scales.sum::<f64>() / 20.0
    };
    let [small, middle, large] = [5e-4, 2e-3, 8e-3].map(scale);
    assert!((small / 0.25 - 1.0).abs() < 0.2, "{small}");
    assert!((middle - 1.0).abs() < 0.2, "{middle}");
    assert!((large / 4.0 - 1.0).abs() < 0.2, "{large}");
}

#[test]
fn the_scale_stays_within_its_bounds() {
    let of = |errors: f64| {
        fit(&Plan { errors, noise: (1e-5, 0.0), ..plan() }.make(), Prior::default()).prior_scale
    };
    assert_eq!((of(1e-6), of(0.05)), (0.1, 5.0));
}

#[test]
fn a_fixed_prior_is_not_scaled() {
    let scene = Plan { errors: 1e-2, ..plan() }.make();
    assert_eq!(fit(&scene, Prior { scaled: false, ..Prior::default() }).prior_scale, 1.0);
}

#[test]
fn a_tight_prior_holds_what_little_data_would_move() {
    let scene = Plan { poses: vec![6], ..plan() }.make();
    let prior = |size: f64| Prior { length: size, angle: size, scaled: false };
    let moved = |prior: Prior| {
        let found = fit(&scene, prior).parameters;
        found.iter().zip(scene.chain.nominal()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    assert!(moved(prior(1e-6)) < 1e-4 * moved(prior(1.0)));
}

#[test]
fn fewer_values_than_unknowns_promise_nothing_beyond_the_guessed_noise() {
    for (poses, seed) in [(4, 1), (5, 2), (6, 3), (7, 4), (8, 5)] {
        let scene = Plan { poses: vec![poses], seed, ..plan() }.make();
        let found = fit(&scene, Prior::default());
        assert!(found.noise.position >= Noise::GUESS.position, "{poses} poses: {:?}", found.noise);
        let far = scene.columns.iter().enumerate().filter(|&(k, &column)| {
            let error = found.parameters[column] - scene.truth[column];
            error.abs() > 5.0 * found.covariance[(k, k)].sqrt()
        });
        assert!(far.count() <= 1, "{poses} poses");
    }
}

#[test]
fn confounded_parameters_are_fitted_to_data_that_is_almost_exact() {
    for noise in [0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7] {
        let scene = Plan { noise: (noise, 0.0), ..plan() }.make();
        let found = fit(&scene, Prior::default());
        assert_eq!(found.reason, Reason::Converged, "noise {noise:e}");
        assert!(found.noise.position < 2.0 * noise.max(1e-12), "{:?} of {noise:e}", found.noise);
        let deviations = (0..found.covariance.nrows()).map(|k| found.covariance[(k, k)]);
        assert!(deviations.into_iter().all(|variance| variance > 0.0 && variance.is_finite()));
    }
}

#[test]
fn known_noise_is_positive() {
    let scene = plan().make();
    for position in [0.0, -1e-4, f64::NAN, f64::INFINITY] {
        let noise = Some(Noise { position, orientation: 0.0 });
        let options = ConstantOptions { noise, ..ConstantOptions::default() };
        let said = fit_constant(&scene.problem(), &options).map(drop).unwrap_err().to_string();
        assert!(said.contains("the noise of positions is"), "{said}");
    }
}
