//! Without noise, the parameters that the data determines come back to rounding.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{
    ALPHA, PLAIN, THETA, columns, rv_m2, rv_m2_fifteen, scara, seven_axis, ur10, ur10_determined,
};
use crate::common::scene::{Plan, Scene};
use crate::common::{assert_close, distance, root_mean_square};
use truearm_estimate::{ConstantFit, ConstantOptions, FrameMode, Prior, Reason, fit_constant};

#[track_caller]
fn fit(scene: &Scene) -> ConstantFit {
    fit_constant(&scene.problem(), &ConstantOptions::default()).unwrap()
}

#[track_caller]
fn assert_recovered(scene: &Scene) {
    let found = fit(scene);
    let error = scene.error_of(&found.parameters);
    assert!(error < 1e-9, "{error:e} {:?} after {} steps", found.reason, found.iterations);
    assert!(found.residuals.iter().all(|r| r.abs() < 1e-9));
    for (group, truth) in found.setup.groups.iter().zip(&scene.setup.groups) {
        assert_close(&group.world_from_base.rotation, &truth.world_from_base.rotation, 1e-9);
        assert_close(&group.world_from_base.translation, &truth.world_from_base.translation, 1e-9);
        for (target, point) in group.targets.iter().zip(&truth.targets) {
            assert_close(target, point, 1e-9);
        }
        assert_close(&group.flange_from_target, &truth.flange_from_target, 1e-9);
    }
}

fn plan() -> Plan {
    Plan::new(ur10(), ur10_determined(), 40)
}

#[test]
fn from_positions() {
    assert_recovered(&plan().make());
}

#[test]
fn from_poses() {
    assert_recovered(&Plan { rotations: true, ..plan() }.make());
}

#[test]
fn from_several_targets() {
    assert_recovered(&Plan { targets: 3, poses: vec![15], ..plan() }.make());
}

#[test]
fn from_two_groups_with_frames_and_tools_of_their_own() {
    assert_recovered(&Plan { poses: vec![25, 12], targets: 2, rotations: true, ..plan() }.make());
}

#[test]
fn in_a_known_world() {
    let arm = rv_m2_fifteen()[..12].to_vec();
    let spans = vec![2.6, 1.1, 1.0, 1.5, 2.5];
    assert_recovered(&Plan { frame: FrameMode::World, spans, ..Plan::new(rv_m2(), arm, 40) }.make());
}

#[test]
fn of_a_seven_axis_arm_in_craig_s_convention() {
    let inner = columns(&[&[], &PLAIN, &PLAIN, &PLAIN, &PLAIN, &PLAIN, &[2, ALPHA]]);
    assert_recovered(&Plan { rotations: true, ..Plan::new(seven_axis(), inner, 60) }.make());
}

#[test]
fn of_large_errors() {
    assert_recovered(&Plan { errors: 0.02, ..plan() }.make());
}

#[test]
fn of_a_scara_whose_frame_and_target_cannot_be_told_apart_along_its_axes() {
    for rotations in [false, true] {
        let scene = Plan { rotations, ..Plan::new(scara(), columns(&[&[2], &[THETA]]), 40) }.make();
        let found = fit(&scene);
        assert!(found.residuals.iter().all(|r| r.abs() < 1e-9));
        assert!(scene.error_of(&found.parameters) < 1e-9, "{}", scene.error_of(&found.parameters));
    }
}

#[test]
fn of_a_scara_whose_axes_are_nearly_parallel_down_to_the_noise() {
    let arm = columns(&[&[2, ALPHA], &[THETA, 2, ALPHA]]);
    let scene = Plan { noise: (1e-4, 0.0), ..Plan::new(scara(), arm, 80) }.make();
    let found = fit(&scene);
    let left = root_mean_square(&found.residuals);
    assert!((0.7e-4..1.1e-4).contains(&left), "{left}");
}

#[test]
fn from_distances_to_anchors() {
    let anchors = [[1.5, 0.2, -0.4], [-0.3, 1.8, 0.9], [0.5, -1.5, 0.2], [-1.2, -0.4, -0.8]];
    let scene = plan().make().with_distances(&anchors, 0.0);
    let found = fit(&scene);
    assert!(scene.error_of(&found.parameters) < 1e-9, "{:e}", scene.error_of(&found.parameters));
    assert!(distance(&found.setup.anchors[2], &anchors[2]) < 1e-8);
}

#[test]
fn from_distances_between_poses() {
    let scene = Plan { poses: vec![60], ..plan() }.make().with_distances(&[], 0.0);
    let found = fit(&scene);
    assert!(scene.error_of(&found.parameters) < 1e-9, "{:e}", scene.error_of(&found.parameters));
    assert!(distance(&found.setup.groups[0].targets[0], &scene.setup.groups[0].targets[0]) < 1e-8);
}

#[test]
fn the_same_from_any_start() {
    let scene = plan().make();
    let near = ConstantOptions { start: Some(scene.setup.clone()), ..ConstantOptions::default() };
    let found = fit_constant(&scene.problem(), &near).unwrap();
    assert!(distance(&found.parameters, &fit(&scene).parameters) < 1e-9);
}

#[test]
fn only_the_set_up_where_no_columns_are_asked_for() {
    let mut scene = Plan { rotations: true, ..plan() }.make();
    scene.columns.clear();
    let known = ConstantOptions { parameters: Some(scene.truth.clone()), ..ConstantOptions::default() };
    let found = fit_constant(&scene.problem(), &known).unwrap();
    assert_eq!(found.parameters, scene.truth);
    assert_close(&found.setup.groups[0].targets[0], &scene.setup.groups[0].targets[0], 1e-10);
    let each = ConstantOptions { parameters: Some(scene.truth.repeat(40)), ..ConstantOptions::default() };
    let with_each = fit_constant(&scene.problem(), &each).unwrap();
    assert_close(&with_each.setup.groups[0].targets[0], &found.setup.groups[0].targets[0], 1e-10);
}

#[test]
fn noise_makes_it_converge_and_say_so() {
    let scene = Plan { noise: (1e-4, 0.0), ..plan() }.make();
    let options = ConstantOptions { prior: Some(Prior::default()), ..ConstantOptions::default() };
    let found = fit_constant(&scene.problem(), &options).unwrap();
    assert_eq!(found.reason, Reason::Converged);
    assert!(found.reason.to_string().starts_with("converged"));
    assert!(found.iterations < 20);
}
