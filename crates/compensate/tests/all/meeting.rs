//! After compensation the real tool is where the program means it.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{Scene, apart, correct, readings, seven_axis, six_axis, sliding, unbounded};
use truearm_compensate::Options;

/// What the calibrated model may be off at corrected readings, m and rad.
const MET: f64 = 1e-9;
const WAYPOINTS: usize = 500;
/// What a reported residual may differ from it, m: with constants, and with parameters that vary.
const TOLD: [f64; 2] = [1e-12, 1e-10];
/// Part of random waypoints that may be refused: those near singular configurations.
const SINGULAR: f64 = 0.05;

#[track_caller]
fn check_pose(scene: &Scene) {
    let (q, n) = (readings(&scene.chain, WAYPOINTS, 1), scene.chain.joint_count());
    let corrector = scene.corrector(Options { limits: unbounded(), ..Options::default() });
    let found = correct(&corrector, &q, 1);
    assert!((found.refused.len() as f64) < SINGULAR * WAYPOINTS as f64, "{} refused", found.refused.len());
    let (meant, real) = (scene.meant(&q), scene.real(&found.readings));
    let told = TOLD[usize::from(scene.bank.is_some())];
    for i in (0..WAYPOINTS).filter(|i| found.readings[i * n].is_finite()) {
        let (distance, angle) = apart(&meant[i], &real[i]);
        assert!(distance < MET && angle < MET, "waypoint {i}: {distance:e} m, {angle:e} rad");
        let [reported, turned] = [0, 1].map(|k| found.numbers[i][k]);
        assert!((distance - reported).abs() < told, "waypoint {i}: {distance:e} m, reported {reported:e}");
        assert!((angle - turned).abs() < 10.0 * told, "waypoint {i}: {angle:e} rad, reported {turned:e}");
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
