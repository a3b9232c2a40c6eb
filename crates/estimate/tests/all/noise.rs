//! With noise: stated covariance, noise estimate, own sigmas.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{rv_m2, rv_m2_fifteen, ur10, ur10_columns, ur10_determined};
use crate::common::root_mean_square;
use crate::common::scene::{Plan, Scene};
use crate::common::stream::Stream;
use truearm_estimate::{ConstantFit, ConstantOptions, FrameMode, Noise, Prior, Sigma, fit_constant};
use truearm_kinematics::Transform;

const SEEDS: std::ops::Range<u64> = 0..60;
const TWO_SIDED_95: f64 = 1.96;

fn fit(scene: &Scene, prior: Option<Prior>) -> ConstantFit {
    fit_constant(&scene.problem(), &ConstantOptions { prior, ..ConstantOptions::default() }).unwrap()
}

/// Errors of parameters and first target in their stated standard deviations.
fn standardised(scene: &Scene, found: &ConstantFit) -> Vec<f64> {
    let deviation = |k: usize| found.covariance[(k, k)].sqrt();
    let arm = scene.columns.len();
    let parameters = scene.columns.iter().enumerate();
    let of_parameters = parameters.map(|(k, &c)| (found.parameters[c] - scene.truth[c]) / deviation(k));
    let target = arm + if scene.frame == FrameMode::Free { 6 } else { 0 };
    let (got, wanted) = (found.setup.groups[0].targets[0], scene.setup.groups[0].targets[0]);
    let of_target = (0..3).map(|k| (got[k] - wanted[k]) / deviation(target + k));
    of_parameters.chain(of_target).collect()
}

#[track_caller]
fn assert_covered(plan: &Plan, prior: Option<Prior>) {
    let errors: Vec<f64> = SEEDS
        .flat_map(|seed| {
            let scene = Plan { seed, ..plan.clone() }.make();
            standardised(&scene, &fit(&scene, prior))
        })
        .collect();
    let inside = errors.iter().filter(|z| z.abs() < TWO_SIDED_95).count() as f64 / errors.len() as f64;
    assert!((0.90..=0.98).contains(&inside), "{inside} of {} are inside", errors.len());
}

fn plan() -> Plan {
    Plan { noise: (1e-4, 3e-4), ..Plan::new(ur10(), ur10_determined(), 40) }
}

#[test]
fn intervals_of_positions_cover() {
    assert_covered(&plan(), None);
}

#[test]
fn intervals_of_poses_of_several_targets_cover() {
    assert_covered(&Plan { rotations: true, targets: 2, poses: vec![15], ..plan() }, None);
}

#[test]
fn intervals_in_a_known_world_cover() {
    let spans = vec![2.6, 1.1, 1.0, 1.5, 2.5];
    let known = Plan { frame: FrameMode::World, spans, noise: (1e-4, 0.0), ..Plan::new(rv_m2(), vec![], 40) };
    assert_covered(&Plan { columns: rv_m2_fifteen()[..12].to_vec(), ..known }, None);
}

#[test]
fn intervals_under_the_prior_cover() {
    // Columns that the data does not determine count: their intervals are the prior's.
    let fixed = Prior { length: 1e-3, angle: 1e-3, scaled: false };
    let columns: Vec<usize> = ur10_columns();
    assert_covered(&Plan { columns: columns[2..].to_vec(), ..plan() }, Some(fixed));
    assert_covered(&plan(), Some(Prior::default()));
}

#[test]
fn noise_is_estimated_free_of_the_unknowns_that_were_fitted() {
    let found: Vec<Noise> = SEEDS
        .map(|seed| fit(&Plan { seed, rotations: true, poses: vec![20], ..plan() }.make(), None).noise)
        .collect();
    let position = root_mean_square(&found.iter().map(|n| n.position).collect::<Vec<_>>());
    let orientation = root_mean_square(&found.iter().map(|n| n.orientation).collect::<Vec<_>>());
    assert!((position / 1e-4 - 1.0).abs() < 0.1, "{position}");
    assert!((orientation / 3e-4 - 1.0).abs() < 0.1, "{orientation}");
}

#[test]
fn known_noise_is_kept_and_scales_the_covariance() {
    let scene = plan().make();
    let known = Noise { position: 5e-4, orientation: 1.0 };
    let options = ConstantOptions { noise: Some(known), ..ConstantOptions::default() };
    let found = fit_constant(&scene.problem(), &options).unwrap();
    assert_eq!(found.noise, known);
    let own = fit(&scene, None);
    let ratio = (found.covariance[(3, 3)] / own.covariance[(3, 3)]).sqrt();
    assert!((ratio * own.noise.position / 5e-4 - 1.0).abs() < 1e-2, "{ratio}");
}

/// Half of the rows come from an instrument forty times worse, and say so.
fn two_instruments(seed: u64) -> Scene {
    let mut scene = Plan { seed, noise: (5e-5, 0.0), poses: vec![80], ..plan() }.make();
    let mut stream = Stream::new(seed + 1000);
    for pose in (0..80).step_by(2) {
        scene.set.sigma[pose] = Sigma::of_position(2e-3);
        let noise = stream.normals(2e-3);
        (0..3).for_each(|k| scene.set.targets[3 * pose + k] += noise[k]);
    }
    scene
}

#[test]
fn own_sigmas_are_respected() {
    let (mut told, mut untold) = (Vec::new(), Vec::new());
    for seed in 0..20 {
        let mut scene = two_instruments(seed);
        told.push(scene.error_of(&fit(&scene, None).parameters));
        scene.set.sigma.fill(Sigma::default());
        untold.push(scene.error_of(&fit(&scene, None).parameters));
    }
    let gain = root_mean_square(&untold) / root_mean_square(&told);
    assert!(gain > 5.0, "{gain}");
}

/// A device whose depth, along y of its frame, is twenty times as coarse as the rest, and says so.
fn camera(seed: u64) -> Scene {
    let mut scene = Plan { seed, noise: (5e-5, 0.0), poses: vec![80], ..plan() }.make();
    let mut stream = Stream::new(seed + 1000);
    for pose in 0..80 {
        scene.set.sigma[pose] = Sigma { position: [0.0, 1e-3, 0.0], orientation: 0.0 };
        scene.set.targets[3 * pose + 1] += stream.normals(1e-3)[0];
    }
    scene
}

#[test]
fn own_sigmas_along_the_axes_of_the_device_are_respected() {
    let (mut told, mut alike) = (Vec::new(), Vec::new());
    for seed in 0..20 {
        let mut scene = camera(seed);
        let found = fit(&scene, None);
        told.push(scene.error_of(&found.parameters));
        assert!((found.noise.position / 5e-5 - 1.0).abs() < 0.5, "{}", found.noise.position);
        scene.set.sigma.fill(Sigma::of_position(1e-3 / 3.0_f64.sqrt()));
        alike.push(scene.error_of(&fit(&scene, None).parameters));
    }
    let gain = root_mean_square(&alike) / root_mean_square(&told);
    assert!(gain > 2.0, "{gain}");
}

#[test]
fn intervals_of_a_device_with_a_coarse_axis_cover() {
    let errors: Vec<f64> =
        SEEDS.map(camera).flat_map(|scene| standardised(&scene, &fit(&scene, None))).collect();
    let inside = errors.iter().filter(|z| z.abs() < TWO_SIDED_95).count() as f64 / errors.len() as f64;
    assert!((0.90..=0.98).contains(&inside), "{inside} of {} are inside", errors.len());
}

#[test]
fn own_sigmas_of_orientations_are_respected() {
    let error = |stated: bool| {
        let errors = (0..20).map(|seed| {
            let mut scene = Plan { seed, rotations: true, poses: vec![40], ..plan() }.make();
            let mut stream = Stream::new(seed + 1000);
            for pose in 0..20 {
                let off = Transform::from_rotation_vector(stream.normals(0.02), [0.0; 3]);
                let at = 9 * pose..9 * pose + 9;
                let rotation = std::array::from_fn(|k| scene.set.rotations[9 * pose + k]);
                let turned = off.compose(&Transform { rotation, translation: [0.0; 3] });
                scene.set.rotations[at].copy_from_slice(&turned.rotation);
                scene.set.sigma[pose].orientation = if stated { 0.02 } else { 0.0 };
            }
            scene.error_of(&fit(&scene, None).parameters)
        });
        root_mean_square(&errors.collect::<Vec<f64>>())
    };
    assert!(error(true) < 0.9 * error(false), "{} and {}", error(true), error(false));
}

#[test]
fn noise_comes_beside_own_sigmas() {
    let found: Vec<f64> = (0..20).map(|seed| fit(&two_instruments(seed), None).noise.position).collect();
    let noise = root_mean_square(&found);
    assert!((noise / 5e-5 - 1.0).abs() < 0.15, "{noise}");
}
