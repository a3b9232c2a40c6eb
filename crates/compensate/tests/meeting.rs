//! After compensation the real tool is where the program means it.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

mod common;

use common::{Scene, apart, correct, readings, seven_axis, six_axis, sliding, unbounded};
use truearm_compensate::Options;

/// What the calibrated model may be off at corrected readings, m and rad.
const MET: f64 = 1e-9;
const WAYPOINTS: usize = 500;
/// Part of random waypoints that may be refused: those near singular configurations.
const SINGULAR: f64 = 0.05;

#[track_caller]
fn check_pose(scene: &Scene) {
    let (q, n) = (readings(&scene.chain, WAYPOINTS, 1), scene.chain.joint_count());
    let corrector = scene.corrector(Options { limits: unbounded(), ..Options::default() });
    let found = correct(&corrector, &q, 1);
    assert!((found.refused.len() as f64) < SINGULAR * WAYPOINTS as f64, "{} refused", found.refused.len());
    let (meant, real) = (scene.meant(&q), scene.real(&found.readings));
    for i in (0..WAYPOINTS).filter(|i| found.readings[i * n].is_finite()) {
        let (distance, angle) = apart(&meant[i], &real[i]);
        assert!(distance < MET && angle < MET, "waypoint {i}: {distance:e} m, {angle:e} rad");
        assert!((distance - found.numbers[i][0]).abs() < 1e-12, "waypoint {i} reports another residual");
    }
}

#[test]
fn six_axes() {
    check_pose(&Scene::new(six_axis(), 1e-3));
}

#[test]
fn seven_axes() {
    check_pose(&Scene::new(seven_axis(), 1e-3));
}

#[test]
fn a_joint_that_slides() {
    check_pose(&Scene::new(sliding(), 1e-3));
}

#[test]
fn parameters_that_vary() {
    check_pose(&Scene::varying(six_axis(), 1e-3));
}
