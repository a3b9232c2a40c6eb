//! Refusals: what is wrong, the rule, and the way out; never a plausible answer.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::f64::consts::FRAC_PI_2;

use crate::common::arms::{ur10, ur10_columns, ur10_determined};
use crate::common::root_mean_square;
use crate::common::scene::{Plan, Scene};
use truearm_estimate::{
    ConstantOptions, Distance, DistanceTo, EstimateError, FrameMode, MeasurementSet, Point, Prior, Problem,
    Setup, Sigma, fit_constant, identifiability, linearise, residuals, setup_precision,
};
use truearm_kinematics::{Cancel, Cancelled};

fn plan() -> Plan {
    Plan { noise: (1e-4, 0.0), ..Plan::new(ur10(), ur10_determined(), 40) }
}

#[track_caller]
fn refusal(scene: &Scene, prior: Option<Prior>) -> EstimateError {
    let options = ConstantOptions { prior, ..ConstantOptions::default() };
    let answer = fit_constant(&scene.problem(), &options);
    answer.map(|found| found.parameters).unwrap_err()
}

#[track_caller]
fn assert_refused(wanted: &str, spoil: impl Fn(&mut MeasurementSet)) {
    let mut scene = Plan { rotations: true, targets: 2, ..plan() }.make();
    spoil(&mut scene.set);
    let said = refusal(&scene, None).to_string();
    assert!(said.contains(wanted), "'{said}' does not say '{wanted}'");
}

#[test]
fn arrays_of_another_length() {
    assert_refused("joints has 239 values where 240 are needed", |set| set.joints.truncate(239));
    assert_refused("targets has 237 values where 240", |set| set.targets.truncate(237));
    assert_refused("rotations has 359 values where 360", |set| set.rotations.truncate(359));
    assert_refused("sigma has 41 values where 40", |set| set.sigma.push(Sigma::default()));
    assert_refused("weight has 0 values where 40", |set| set.weight.clear());
}

#[test]
fn values_that_are_not_finite_with_their_pose() {
    assert_refused("joint value is not finite at pose 17", |set| set.joints[6 * 17 + 4] = f64::NAN);
    assert_refused("target is not finite at pose 9", |set| set.targets[6 * 9 + 5] = f64::INFINITY);
    assert_refused("rotation is not finite at pose 39", |set| set.rotations[9 * 39 + 8] = f64::NEG_INFINITY);
    assert_refused("sigma is not finite at pose 3", |set| set.sigma[3] = Sigma::of_position(f64::NAN));
    assert_refused("weight is not finite at pose 0", |set| set.weight[0] = f64::INFINITY);
}

#[test]
fn targets_and_orientations_of_which_a_part_is_missing() {
    for k in 0..3 {
        assert_refused("target is not finite at pose 4", |set| set.targets[6 * 4 + 3 + k] = f64::NAN);
    }
    assert_refused("rotation is not finite at pose 2", |set| set.rotations[9 * 2 + 7] = f64::NAN);
}

#[test]
fn values_out_of_range() {
    assert_refused("weight is -0.5", |set| set.weight[3] = -0.5);
    assert_refused("weight is 2, but weights are between 0 (left out) and 1", |set| set.weight[3] = 2.0);
    assert_refused("sigma is -0.001", |set| set.sigma[3] = Sigma::of_position(-1e-3));
    assert_refused("group is 1, but groups count from 0", |set| set.group[3] = 1);
}

#[test]
fn distances_that_refer_to_nothing_or_are_no_number() {
    let scene = plan().make().with_distances(&[], 0.0);
    let with = |pose, to, value| {
        let mut other = scene.clone();
        other.set.distances.push(Distance { pose, to, value });
        refusal(&other, None)
    };
    let lost = [(40, DistanceTo::Pose(0)), (0, DistanceTo::Pose(40)), (0, DistanceTo::Anchor(0))];
    for (pose, to) in lost {
        assert!(matches!(with(pose, to, 1.0), EstimateError::Length { .. }));
    }
    let wanted = EstimateError::NotFinite { what: "distance", pose: 5 };
    assert_eq!(with(5, DistanceTo::Pose(6), f64::NAN), wanted);
}

#[test]
fn another_arm() {
    let mut scene = plan().make();
    scene.set.joint_count = 5;
    scene.set.joints.truncate(200);
    assert!(refusal(&scene, None).to_string().contains("number of joints is 5"));
    for columns in [vec![2, 30], vec![3, 2], vec![2, 2]] {
        let said = refusal(&Scene { columns, ..plan().make() }, None).to_string();
        assert!(said.contains("columns ascend"), "{said}");
    }
    let parameters = Some(vec![0.0; 31]);
    let options = ConstantOptions { parameters, ..ConstantOptions::default() };
    let said = fit_constant(&plan().make().problem(), &options).unwrap_err().to_string();
    assert!(said.contains("parameters have 31 values where 30"), "{said}");
}

#[test]
fn too_few_measurements_say_how_many_are_needed() {
    let few = Plan { poses: vec![8], ..plan() }.make();
    let said = refusal(&few, None).to_string();
    assert_eq!(said, "24 measured values cannot determine 27 unknowns: measure at least 9 poses");
    let prior = Some(Prior::default());
    let options = ConstantOptions { prior, ..ConstantOptions::default() };
    assert!(fit_constant(&few.problem(), &options).is_ok());
    let said = refusal(&Plan { poses: vec![30, 2], ..plan() }.make(), prior).to_string();
    assert!(
        said.contains("6 measured values cannot determine 9 unknowns: measure at least 3 poses"),
        "{said}"
    );
    assert!(said.contains("group 1, whose frame and targets are unknown"), "{said}");
}

#[test]
fn weights_of_zero_and_missing_targets_do_not_count_as_measured() {
    let mut scene = plan().make();
    scene.set.weight[8..].fill(0.0);
    assert!(matches!(refusal(&scene, None), EstimateError::TooFew { rows: 24, .. }));
    let mut scene = plan().make();
    scene.set.targets[15..].fill(f64::NAN);
    assert!(matches!(refusal(&scene, None), EstimateError::TooFew { rows: 15, .. }));
    let mut scene = plan().make().with_distances(&[], 0.0);
    // From each pose to the next one, and to the seventh: four have both ends among the first five.
    scene.set.weight[5..].fill(0.0);
    assert!(matches!(refusal(&scene, None), EstimateError::TooFew { rows: 4, .. }));
}

#[test]
fn poses_all_alike() {
    for rotations in [false, true] {
        let mut scene = Plan { rotations, ..plan() }.make();
        let first = scene.set.joints[..6].to_vec();
        scene.set.joints = first.repeat(40);
        for prior in [None, Some(Prior::default())] {
            let said = refusal(&scene, prior).to_string();
            assert!(said.contains("too alike") && said.contains("spread them"), "{said}");
        }
    }
}

#[test]
fn poses_that_move_too_little_of_the_arm() {
    let prior = Some(Prior::default());
    for spans in [vec![2.0, 0.0, 0.0, 0.0, 0.0, 0.0], vec![0.0, 1.0, 1.0, 1.0, 0.0, 0.0]] {
        let scene = Plan { spans, errors: 0.0, ..plan() }.make();
        let found = refusal(&scene, prior);
        assert!(matches!(found, EstimateError::Singular { .. }), "{found}");
    }
}

/// Joints of a UR10 whose tool keeps one orientation, pointing down.
fn held_down(joints: &mut [f64]) {
    joints[3] = -FRAC_PI_2 - joints[1] - joints[2];
    joints[4] = -FRAC_PI_2;
    joints[5] = joints[0];
}

#[test]
fn poses_with_one_orientation_keep_the_target_near_the_flange_and_those_in_a_plane_are_refused() {
    let spans = vec![2.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let space = Plan { bound: held_down, spans, columns: vec![], ..plan() };
    for prior in [None, Some(Prior::default())] {
        let scene = space.make();
        let found = fit_constant(&scene.problem(), &ConstantOptions { prior, ..ConstantOptions::default() });
        let found = found.unwrap();
        let point = Point { parameters: &found.parameters, setup: &found.setup };
        let left = root_mean_square(&residuals(&scene.problem(), point).unwrap());
        assert!(left < 1.2e-4, "{left}");
        assert!(root_mean_square(&found.setup.groups[0].targets[0]) < 0.2);
        let precision = setup_precision(&scene.problem(), &found.setup).unwrap();
        assert_eq!(precision, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1e6, 1e6, 1e6]);
    }
    let elsewhere = plan().make();
    let precision = setup_precision(&elsewhere.problem(), &elsewhere.setup).unwrap();
    assert!(precision[6..].iter().all(|known| (known - 100.0).abs() < 1e-9), "{precision:?}");
    let plane = Plan { spans: vec![0.0, 1.0, 1.0, 0.0, 0.0, 0.0], ..space };
    let said = refusal(&plane.make(), None).to_string();
    assert!(said.contains("too alike"), "{said}");
}

#[test]
fn a_group_in_a_plane_with_its_wrist_turned_spoils_no_group_with_one_orientation() {
    // The second group turns about the vertical axis and moves its wrist alone: flanges near one height.
    fn by_turns(joints: &mut [f64]) {
        if joints[5] > 0.0 {
            held_down(joints);
        } else {
            (joints[1], joints[2], joints[3]) = (-1.2, 1.6, -0.4);
            joints[4] *= 0.1;
        }
    }
    let mut scene = Plan { bound: by_turns, columns: vec![], poses: vec![120], ..plan() }.make();
    let in_space = |joints: &[f64]| (joints[4] + FRAC_PI_2).abs() < 1e-12;
    let groups: Vec<usize> =
        scene.set.joints.chunks_exact(6).map(|joints| usize::from(!in_space(joints))).collect();
    scene.set.group = groups;
    scene.set.group_count = 2;
    scene.setup.groups.push(scene.setup.groups[0].clone());
    assert!(fit_constant(&scene.problem(), &ConstantOptions::default()).is_ok());
    let precision = setup_precision(&scene.problem(), &scene.setup).unwrap();
    assert_eq!((precision[6], precision[15]), (1e6, 1e6));
    // Rows that take no part do not turn the wrist either.
    let mut alone = Plan { bound: held_down, columns: vec![], ..plan() }.make();
    // One turn leaves its own axis open.
    (alone.set.joints[4], alone.set.joints[9]) = (alone.set.joints[4] + 0.5, alone.set.joints[9] + 0.5);
    assert!(setup_precision(&alone.problem(), &alone.setup).unwrap()[6] < 101.0);
    alone.set.weight[..2].fill(0.0);
    assert_eq!(setup_precision(&alone.problem(), &alone.setup).unwrap()[6], 1e6);
}

#[test]
fn exact_orientations_beside_noisy_positions_are_no_poses_that_are_alike() {
    let scene = Plan { rotations: true, noise: (4e-5, 0.0), ..plan() }.make();
    for prior in [None, Some(Prior::default())] {
        let options = ConstantOptions { prior, ..ConstantOptions::default() };
        let found = fit_constant(&scene.problem(), &options).unwrap();
        assert!(scene.error_of(&found.parameters) < 1e-3);
    }
}

#[test]
fn one_group_s_poses_all_alike() {
    let mut scene = Plan { poses: vec![30, 10], columns: ur10_columns(), ..plan() }.make();
    let first = scene.set.joints[180..186].to_vec();
    scene.set.joints.truncate(180);
    scene.set.joints.extend(first.repeat(10));
    assert!(matches!(refusal(&scene, Some(Prior::default())), EstimateError::Singular { .. }));
}

#[test]
fn alike_poses_are_enough_for_a_target_in_a_known_world() {
    let mut scene = Plan { frame: FrameMode::World, columns: vec![], ..plan() }.make();
    let first = scene.set.joints[..6].to_vec();
    scene.set.joints = first.repeat(40);
    assert!(fit_constant(&scene.problem(), &ConstantOptions::default()).is_ok());
}

#[test]
fn a_request_to_stop_is_obeyed() {
    let scene = plan().make();
    let options = ConstantOptions::default();
    options.cancel.clone().request();
    assert_eq!(fit_constant(&scene.problem(), &options).unwrap_err(), EstimateError::Cancelled(Cancelled));
    let flag = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let options = ConstantOptions { cancel: Cancel::from_flag(flag.clone()), ..ConstantOptions::default() };
    assert_eq!(fit_constant(&scene.problem(), &options).unwrap_err(), EstimateError::Cancelled(Cancelled));
    flag.store(false, std::sync::atomic::Ordering::Relaxed);
    assert!(fit_constant(&scene.problem(), &options).is_ok());
}

#[test]
fn set_ups_and_parameters_of_other_measurements() {
    let scene = Plan { poses: vec![20, 20], rotations: true, targets: 2, ..plan() }.make();
    let problem = scene.problem();
    let said = |parameters: &[f64], setup: &Setup| {
        let point = Point { parameters, setup };
        let all = [
            residuals(&problem, point).map(drop).unwrap_err().to_string(),
            linearise(&problem, point).map(drop).unwrap_err().to_string(),
            identifiability(&problem, parameters, setup).map(drop).unwrap_err().to_string(),
        ];
        assert!(all[0] == all[1] && all[1] == all[2]);
        all[0].clone()
    };
    let few = Setup { groups: scene.setup.groups[..1].to_vec(), ..scene.setup.clone() };
    assert!(said(&scene.truth, &few).contains("the set-up has 1 groups where the measurements need 2"));
    let other = Setup::identity(2, 1, 0);
    assert!(said(&scene.truth, &other).contains("1 targets in a group where the measurements need 2"));
    assert!(said(&scene.truth[..7], &scene.setup).contains("7 values where 30 are needed"));
    for start in [few, other, Setup::identity(3, 2, 0), Setup::identity(2, 2, 1)] {
        let options = ConstantOptions { start: Some(start), ..ConstantOptions::default() };
        let refused = fit_constant(&problem, &options).map(drop).unwrap_err();
        assert!(matches!(refused, EstimateError::Setup { .. }), "{refused}");
    }
}

#[test]
fn set_ups_of_more_groups_serve_rows_of_some() {
    let scene = Plan { poses: vec![5, 5], ..plan() }.make();
    let set = MeasurementSet { group_count: 1, ..scene.set.subset(&[0, 3]) };
    let problem = Problem { measurements: &set, ..scene.problem() };
    assert_eq!(residuals(&problem, scene.point()).unwrap().len(), 6);
}

#[test]
fn numbers_of_groups_and_anchors_that_fill_the_memory() {
    let scene = plan().make();
    let mut huge = scene.clone();
    huge.set.group[3] = 1 << 40;
    huge.set.group_count = (1 << 40) + 1;
    assert!(refusal(&huge, None).to_string().contains("number them from 0 without gaps"));
    assert!(matches!(
        residuals(&huge.problem(), scene.point()).unwrap_err(),
        EstimateError::Setup { expected: 0x100_0000_0001, .. }
    ));
    let mut far = scene.with_distances(&[[1.0, 0.0, 0.0]], 0.0);
    far.set.distances[0].to = DistanceTo::Anchor(1 << 40);
    far.set.anchor_count = (1 << 40) + 1;
    assert!(refusal(&far, None).to_string().contains("the number of anchors"));
}
