//! Analytic derivatives of points and orientations against differences of the residuals.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{all_columns, rv_m2, scara, seven_axis, ur10, with_ends};
use crate::common::assert_close;
use crate::common::differences::{dense, differences};
use crate::common::scene::{Plan, Scene};
use truearm_estimate::{FrameMode, Point, linearise};
use truearm_kinematics::Chain;

const TOLERANCE: f64 = 1e-8;

fn plan(chain: &Chain) -> Plan {
    let chain = with_ends(chain);
    Plan { errors: 0.05, seed: 5, ..Plan::new(chain.clone(), all_columns(&chain), 11) }
}

#[track_caller]
fn assert_derivatives(scene: &Scene) {
    let (problem, point) = (scene.problem(), scene.point());
    let analytic = dense(&problem, &linearise(&problem, point).unwrap());
    assert!(analytic.iter().any(|&entry| entry != 0.0));
    assert_close(&analytic, &differences(&problem, point), TOLERANCE);
}

#[test]
fn of_positions_standard_modified_prismatic_and_fixed_rows() {
    for chain in [ur10(), seven_axis(), scara(), rv_m2()] {
        assert_derivatives(&plan(&chain).make());
    }
}

#[test]
fn of_orientations() {
    for chain in [ur10(), seven_axis(), scara(), rv_m2()] {
        assert_derivatives(&Plan { rotations: true, ..plan(&chain) }.make());
    }
}

#[test]
fn of_several_targets_in_several_groups() {
    for rotations in [false, true] {
        assert_derivatives(&Plan { targets: 3, rotations, poses: vec![9, 1, 4], ..plan(&ur10()) }.make());
    }
}

#[test]
fn in_a_known_world() {
    assert_derivatives(
        &Plan { frame: FrameMode::World, targets: 2, rotations: true, ..plan(&rv_m2()) }.make(),
    );
}

#[test]
fn of_a_few_columns_only() {
    let scene = Plan { columns: vec![1, 3, 14, 26], rotations: true, ..plan(&ur10()) }.make();
    assert_derivatives(&scene);
    assert_derivatives(&Scene { columns: vec![], ..scene });
}

#[test]
fn of_rows_with_missing_targets_and_orientations() {
    let mut scene = Plan { targets: 2, rotations: true, ..plan(&ur10()) }.make();
    scene.set.targets[6..9].fill(f64::NAN);
    scene.set.targets[57..63].fill(f64::NAN);
    scene.set.rotations[36..45].fill(f64::NAN);
    assert_derivatives(&scene);
    let rows = linearise(&scene.problem(), scene.point()).unwrap();
    let missing = [9..12, 84..87, 90..93, 42..45].into_iter().flatten();
    assert!(missing.clone().all(|row| rows.residual[row] == 0.0));
    assert!(missing.clone().all(|row| rows.arm[row * 30..row * 30 + 30].iter().all(|&x| x == 0.0)));
}

#[test]
fn at_parameters_of_each_pose() {
    let scene = Plan { targets: 2, ..plan(&seven_axis()) }.make();
    let sets = scene.set.pose_count();
    let each: Vec<f64> =
        (0..sets).flat_map(|pose| scene.truth.iter().map(move |p| p + 0.01 * (pose as f64).sin())).collect();
    // The points are measured with these parameters, so that the residuals are zero.
    let mut scene = scene;
    let point = Point { parameters: &each, setup: &scene.setup };
    let residual = linearise(&scene.problem(), point).unwrap().residual;
    for (row, difference) in residual.chunks_exact(3).enumerate() {
        let world =
            scene.setup.groups[0].world_from_base.rotate([difference[0], difference[1], difference[2]]);
        (0..3).for_each(|k| scene.set.targets[3 * row + k] -= world[k]);
    }
    let (problem, point) = (scene.problem(), Point { parameters: &each, setup: &scene.setup });
    assert_close(
        &dense(&problem, &linearise(&problem, point).unwrap()),
        &differences(&problem, point),
        TOLERANCE,
    );
}

#[test]
fn residuals_are_measured_minus_predicted_in_the_base_frame() {
    let mut scene = Plan { targets: 2, ..plan(&ur10()) }.make();
    let shift = [1e-3, -2e-3, 3e-3];
    (0..3).for_each(|k| scene.set.targets[3 * 7 + k] += shift[k]);
    let inverse = scene.setup.groups[0].world_from_base.inverse();
    let mut wanted = vec![0.0; 66];
    wanted[21..24].copy_from_slice(&inverse.rotate(shift));
    assert_close(&linearise(&scene.problem(), scene.point()).unwrap().residual, &wanted, 1e-14);
}
