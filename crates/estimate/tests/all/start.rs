//! The set-up is found without start values, wherever the arm stands and whatever it holds.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{scara, seven_axis, ur10, ur10_determined};
use crate::common::root_mean_square;
use crate::common::scene::{Plan, Scene};
use proptest::prelude::*;
use truearm_estimate::{ConstantOptions, Setup, fit_constant, initial_setup, residuals};

fn start(scene: &Scene) -> Setup {
    initial_setup(&scene.problem(), &scene.chain.nominal()).unwrap()
}

fn determinant(r: &[f64; 9]) -> f64 {
    r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6])
        + r[2] * (r[3] * r[7] - r[4] * r[6])
}

#[track_caller]
fn assert_rigid_and_finite(setup: &Setup) {
    for group in &setup.groups {
        let rotations = [&group.world_from_base.rotation, &group.flange_from_target];
        for rotation in rotations {
            assert!((determinant(rotation) - 1.0).abs() < 1e-9, "{rotation:?}");
        }
        let mut points = group.targets.iter().chain([&group.world_from_base.translation]).flatten();
        assert!(points.all(|x| x.is_finite()), "{group:?}");
    }
}

/// The set-up of a perfect arm, found to rounding from the closed form on.
fn left_after_fit(scene: &Scene) -> f64 {
    let only_setup = Scene { columns: vec![], ..scene.clone() };
    let found = fit_constant(&only_setup.problem(), &ConstantOptions::default()).unwrap();
    root_mean_square(&found.residuals)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_frame_and_tool_of_a_perfect_arm(seed in 0u64..1_000_000, poses in 5usize..30, arm in 0usize..2) {
        let chain = [ur10(), seven_axis()][arm].clone();
        let scene = Plan { seed, tool: 0.3, errors: 0.0, ..Plan::new(chain, vec![], poses) }.make();
        prop_assert!(left_after_fit(&scene) < 1e-9);
    }

    #[test]
    fn any_frame_and_tool_of_an_arm_with_errors_and_noise(seed in 0u64..1_000_000, poses in 5usize..30) {
        let plan = Plan { seed, tool: 0.3, noise: (1e-4, 0.0), ..Plan::new(ur10(), ur10_determined(), poses) };
        let scene = plan.make();
        assert_rigid_and_finite(&start(&scene));
        let left = left_after_fit(&scene);
        prop_assert!(left < 0.01, "{left}");
    }

    #[test]
    fn several_targets_and_orientations(seed in 0u64..1_000_000, poses in 5usize..12) {
        let plan = Plan { seed, tool: 0.3, errors: 0.0, rotations: true, ..Plan::new(ur10(), vec![], poses) };
        let scene = Plan { targets: 3, poses: vec![poses, 6], ..plan }.make();
        assert_rigid_and_finite(&start(&scene));
        prop_assert!(left_after_fit(&scene) < 1e-9);
    }

    #[test]
    fn degenerate_sets_still_give_a_rotation(seed in 0u64..1_000_000, poses in 1usize..9, moving in 0usize..4) {
        let spans = (0..6).map(|joint| if joint < moving { 2.0 } else { 0.0 }).collect();
        let scene = Plan { seed, spans, tool: 0.3, rotations: true, ..Plan::new(ur10(), vec![], poses) }.make();
        assert_rigid_and_finite(&start(&scene));
    }

    #[test]
    fn mirrored_points_still_give_a_rotation(seed in 0u64..1_000_000, axis in 0usize..3) {
        let mut scene = Plan { seed, tool: 0.3, ..Plan::new(ur10(), vec![], 12) }.make();
        scene.set.targets.iter_mut().skip(axis).step_by(3).for_each(|x| *x = -*x);
        assert_rigid_and_finite(&start(&scene));
    }
}

#[test]
fn planar_points_are_enough_with_an_arm_that_moves_in_a_plane() {
    let plan = Plan { spans: vec![2.0, 2.0, 0.0, 2.0], errors: 0.0, ..Plan::new(scara(), vec![], 20) };
    let scene = plan.make();
    assert_rigid_and_finite(&start(&scene));
    let setup = start(&scene);
    let point = truearm_estimate::Point { parameters: &scene.truth, setup: &setup };
    assert!(root_mean_square(&residuals(&scene.problem(), point).unwrap()) < 1e-6);
}

#[test]
fn the_start_of_a_perfect_arm_is_already_there() {
    let scene = Plan { errors: 0.0, tool: 0.3, ..Plan::new(ur10(), vec![], 20) }.make();
    let setup = start(&scene);
    crate::common::assert_close(&setup.groups[0].targets[0], &scene.setup.groups[0].targets[0], 1e-6);
    let (got, wanted) = (&setup.groups[0].world_from_base, &scene.setup.groups[0].world_from_base);
    crate::common::assert_close(&got.rotation, &wanted.rotation, 1e-6);
}

#[test]
fn anchors_are_found() {
    let anchors = [[1.5, 0.2, -0.4], [-0.3, 1.8, 0.9]];
    let scene =
        Plan { errors: 0.0, tool: 0.0, ..Plan::new(ur10(), vec![], 20) }.make().with_distances(&anchors, 0.0);
    for (found, wanted) in start(&scene).anchors.iter().zip(&anchors) {
        crate::common::assert_close(found, wanted, 1e-6);
    }
}
