//! Rows that are gross errors, missing, or switched off.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{ur10, ur10_determined};
use crate::common::assert_close;
use crate::common::scene::{Plan, Scene};
use crate::common::stream::Stream;
use truearm_estimate::{ConstantFit, ConstantOptions, MeasurementSet, Prior, Robust, fit_constant};

fn plan() -> Plan {
    Plan { noise: (1e-4, 0.0), ..Plan::new(ur10(), ur10_determined(), 80) }
}

fn fit(scene: &Scene, robust: Option<Robust>) -> ConstantFit {
    fit_constant(&scene.problem(), &ConstantOptions { robust, ..ConstantOptions::default() }).unwrap()
}

fn with_outliers() -> Scene {
    let (mut scene, mut stream) = (plan().make(), Stream::new(5));
    for pose in (3..80).step_by(10) {
        let gross = stream.vector(0.3);
        (0..3).for_each(|k| scene.set.targets[3 * pose + k] += gross[k]);
    }
    scene
}

#[test]
fn robust_losses_ignore_gross_errors_and_least_squares_does_not() {
    let (clean, dirty) = (plan().make(), with_outliers());
    let error = |robust| dirty.error_of(&fit(&dirty, robust).parameters);
    let best = clean.error_of(&fit(&clean, None).parameters);
    let [plain, huber, cauchy] = [None, Some(Robust::Huber), Some(Robust::Cauchy)].map(error);
    assert!(cauchy < 3.0 * best, "Cauchy {cauchy:e}, without outliers {best:e}");
    assert!(huber < 10.0 * best, "Huber {huber:e}, without outliers {best:e}");
    assert!(plain > 50.0 * best, "least squares {plain:e}, without outliers {best:e}");
}

#[test]
fn robust_weights_tell_the_gross_errors_apart() {
    for robust in [Robust::Huber, Robust::Cauchy] {
        let found = fit(&with_outliers(), Some(robust));
        for (pose, &weight) in found.weights.iter().enumerate() {
            assert_eq!(weight < 0.1, pose % 10 == 3, "{robust:?} gives pose {pose} the weight {weight}");
        }
    }
}

#[test]
fn robust_losses_estimate_the_noise_of_the_good_rows() {
    for robust in [Robust::Huber, Robust::Cauchy] {
        let noise = fit(&with_outliers(), Some(robust)).noise.position;
        assert!((0.7e-4..1.5e-4).contains(&noise), "{robust:?} {noise}");
    }
}

#[test]
fn gross_distances_are_told_apart_too() {
    let anchors = [[1.5, 0.2, -0.4], [-0.3, 1.8, 0.9], [0.5, -1.5, 0.2], [-1.2, -0.4, -0.8]];
    let clean = plan().make().with_distances(&anchors, 1e-4);
    let mut dirty = plan().make().with_distances(&anchors, 1e-4);
    for distance in dirty.set.distances.iter_mut().filter(|distance| distance.pose % 10 == 3) {
        distance.value += 0.2;
    }
    let error = |scene: &Scene, robust| clean.error_of(&fit(scene, robust).parameters);
    let (best, plain) = (error(&clean, None), error(&dirty, None));
    let cauchy = error(&dirty, Some(Robust::Cauchy));
    assert!(cauchy < 3.0 * best, "Cauchy {cauchy:e}, without outliers {best:e}");
    assert!(plain > 50.0 * best, "least squares {plain:e}, without outliers {best:e}");
    for (pose, &weight) in fit(&dirty, Some(Robust::Cauchy)).weights.iter().enumerate() {
        assert_eq!(weight < 0.1, pose % 10 == 3, "pose {pose} has the weight {weight}");
    }
}

#[test]
fn no_loss_is_least_squares() {
    let scene = plan().make();
    let (none, plain) = (fit(&scene, Some(Robust::None)), fit(&scene, None));
    assert_close(&none.parameters, &plain.parameters, 1e-12);
    assert_eq!(none.weights, vec![1.0; 80]);
}

#[test]
fn missing_targets_and_orientations_cost_nothing_but_themselves() {
    let exact = Plan { targets: 2, rotations: true, noise: (0.0, 0.0), poses: vec![30, 20], ..plan() };
    let mut scene = exact.make();
    for pose in 0..50 {
        let target = 3 * (2 * pose + pose % 2);
        scene.set.targets[target..target + 3].fill(f64::NAN);
        if pose % 3 == 0 {
            scene.set.rotations[9 * pose..9 * pose + 9].fill(f64::NAN);
        }
    }
    let found = fit(&scene, None);
    assert!(scene.error_of(&found.parameters) < 1e-9);
    assert!(found.residuals.iter().all(|r| r.abs() < 1e-9));
}

#[test]
fn missing_values_do_not_count_in_the_noise() {
    let mut scene = Plan { targets: 2, ..plan() }.make();
    let full = fit(&scene, None).noise.position;
    for pose in 0..60 {
        scene.set.targets[6 * pose..6 * pose + 3].fill(f64::NAN);
    }
    let partial = fit(&scene, None).noise.position;
    assert!((partial / full - 1.0).abs() < 0.2, "{partial} and {full}");
}

#[test]
fn a_pose_without_any_value_changes_nothing() {
    let mut scene = plan().make();
    scene.set.targets[30..33].fill(f64::NAN);
    let found = fit(&scene, None);
    let without = Scene { set: without(&scene.set, &[10]), ..scene };
    assert_close(&found.parameters, &fit(&without, None).parameters, 1e-10);
}

fn without(set: &MeasurementSet, removed: &[usize]) -> MeasurementSet {
    let kept: Vec<usize> = (0..set.pose_count()).filter(|pose| !removed.contains(pose)).collect();
    let pick = |values: &[f64]| -> Vec<f64> {
        let width = values.len() / set.pose_count();
        kept.iter().flat_map(|&pose| values[pose * width..(pose + 1) * width].to_vec()).collect()
    };
    MeasurementSet {
        joints: pick(&set.joints),
        group: kept.iter().map(|&pose| set.group[pose]).collect(),
        targets: pick(&set.targets),
        rotations: pick(&set.rotations),
        sigma: kept.iter().map(|&pose| set.sigma[pose]).collect(),
        weight: pick(&set.weight),
        ..set.clone()
    }
}

#[test]
fn weights_of_zero_remove_poses_exactly() {
    for rotations in [false, true] {
        let mut scene = Plan { rotations, noise: (1e-4, 1e-4), ..plan() }.make();
        let removed = [0, 7, 8, 40, 79];
        for &pose in &removed {
            scene.set.weight[pose] = 0.0;
            scene.set.targets[3 * pose] += 0.4;
        }
        let options = ConstantOptions { prior: Some(Prior::default()), ..ConstantOptions::default() };
        let weighted = fit_constant(&scene.problem(), &options).unwrap();
        let shorter = Scene { set: without(&scene.set, &removed), ..scene.clone() };
        let cut = fit_constant(&shorter.problem(), &options).unwrap();
        assert_close(&weighted.parameters, &cut.parameters, 1e-10);
        assert!((weighted.noise.position / cut.noise.position - 1.0).abs() < 1e-6);
        assert!((weighted.noise.orientation / cut.noise.orientation - 1.0).abs() < 1e-6);
        assert!((&weighted.covariance - &cut.covariance).norm_max() < 1e-6 * cut.covariance.norm_max());
    }
}
