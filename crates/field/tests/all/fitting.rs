//! Fits of arms whose truth is known: error and intervals on poses that took no part.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{
    Arm, Fitted, Measure, Random, Truth, deviations, fit, fit_from, fitted, options, problem,
    root_mean_square, six_axes, subset,
};
use truearm_bank::Input;
use truearm_estimate::{ConstantFit, EstimateError, MeasurementSet, Point, Problem, Setup, Sigma};
use truearm_field::{Drives, FieldError, FieldOptions, fit_field, measurement_covariance};

const NOISE: f64 = 3e-5;

fn held_out(poses: usize) -> Measure {
    Measure { seed: 99, ..Measure::poses(poses) }
}

/// Share of position components within 1.96 predicted standard deviations.
fn coverage(arm: &Arm, fit: &Fitted, measure: &Measure) -> f64 {
    coverage_of(arm, fit, &measure.of(arm))
}

/// The same of measurements.
fn coverage_of(arm: &Arm, fit: &Fitted, set: &MeasurementSet) -> f64 {
    let (_, deviations) = deviations(arm, fit, set);
    let problem = problem(arm, set, &arm.columns);
    let varying = fitted(&fit.field, &set.joints);
    let point = Point { parameters: &varying, setup: &fit.field.setup };
    let covariance = measurement_covariance(&fit.field.posterior, &problem, point, &set.joints).unwrap();
    let rows = set.rows_per_pose();
    let within = |(k, x): (usize, &f64)| {
        let (pose, row) = (k / rows, k % rows);
        x.abs() < 1.96 * covariance[(pose * rows + row) * rows + row].sqrt()
    };
    let count = deviations.iter().enumerate().filter(|entry| within(*entry)).count();
    count as f64 / deviations.len() as f64
}

/// Poses that took no part are missed by noise, and the intervals hold them.
#[track_caller]
fn assert_noise_is_left(arm: &Arm, fit: &Fitted) {
    let (_, field) = deviations(arm, fit, &held_out(200).of(arm));
    let field = root_mean_square(&field);
    assert!(field < 1.7 * NOISE, "the field leaves {field}");
    let share = coverage(arm, fit, &held_out(200));
    assert!((0.90..=0.99).contains(&share), "{share} of the components lie within their 95 % intervals");
}

#[test]
fn what_varies_is_found_and_intervals_hold() {
    let arm = six_axes(Truth::BENDING);
    let fit = fit(&arm, &Measure::poses(160).of(&arm)).unwrap();
    let (constant, _) = deviations(&arm, &fit, &held_out(200).of(&arm));
    let constant = root_mean_square(&constant);
    assert!(constant > 4.0 * NOISE, "the constants leave {constant}");
    assert_noise_is_left(&arm, &fit);
    assert!((0.5..1.7).contains(&(fit.field.hyper.noise[0] / NOISE)), "{:?}", fit.field.hyper);
    assert!(fit.field.judgement.outliers.is_empty(), "{:?}", fit.field.judgement.outliers);
}

/// Measurements of a device that is less sure along x of its frame, whose rows state these sigmas.
fn by_camera(arm: &Arm, measure: &Measure, off: f64, stated: [f64; 3]) -> MeasurementSet {
    let mut set = measure.of(arm);
    let mut random = Random::new(measure.seed + 1);
    for pose in 0..set.pose_count() {
        set.targets[3 * pose] += random.normals::<1>(off)[0];
        set.sigma[pose].position = stated;
    }
    set
}

#[test]
fn a_coarse_axis_of_the_device_spoils_nothing_where_rows_state_it() {
    const OFF: f64 = 4e-4;
    let arm = six_axes(Truth::BENDING);
    let left = |stated: [f64; 3]| {
        let fit = fit(&arm, &by_camera(&arm, &Measure::poses(160), OFF, stated)).unwrap();
        (root_mean_square(&deviations(&arm, &fit, &held_out(200).of(&arm)).1), fit)
    };
    let (told, fit) = left([OFF, 0.0, 0.0]);
    let (alike, _) = left([OFF / 3.0_f64.sqrt(); 3]);
    assert!(told < 0.75 * alike, "{told} where it is told, {alike} where all axes are taken to be alike");
    let set = by_camera(&arm, &held_out(200), OFF, [OFF, 0.0, 0.0]);
    let share = coverage_of(&arm, &fit, &set);
    assert!((0.90..=0.99).contains(&share), "{share} of the components lie within their 95 % intervals");
}

#[test]
fn axes_whose_sigmas_hardly_differ_are_fitted_as_those_that_do_not() {
    let arm = six_axes(Truth::BENDING);
    let measure = Measure { groups: 2, targets: 2, orientation: Some(NOISE), ..Measure::poses(60) };
    let found = [0.0, 1e-12].map(|more| {
        let mut set = measure.of(&arm);
        set.sigma.fill(Sigma { position: [NOISE, NOISE, NOISE + more], orientation: NOISE });
        let fit = fit(&arm, &set).unwrap();
        fitted(&fit.field, &set.joints)
    });
    let most = found[0].iter().zip(&found[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(most < 1e-6, "{most}");
}

#[test]
fn a_joint_that_scatters_more_than_the_others_is_told_and_spoils_nothing() {
    const SCATTER: f64 = 2e-4;
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure::poses(100).of(&arm);
    let mut random = Random::new(3);
    set.joints.iter_mut().step_by(set.joint_count).for_each(|q| *q += SCATTER * random.normal());
    let fit = fit(&arm, &set).unwrap();
    let missed: Vec<f64> = (0..6).map(|joint| fit.field.hyper.repeatability_of(joint)).collect();
    assert!((0.7..1.3).contains(&(missed[0] / SCATTER)), "{missed:?}");
    assert!(missed[1..].iter().all(|other| *other < 0.5 * missed[0]), "{missed:?}");
    let (constant, field) = deviations(&arm, &fit, &held_out(200).of(&arm));
    let (constant, field) = (root_mean_square(&constant), root_mean_square(&field));
    assert!(field < 0.7 * constant, "the field leaves {field}, the constants {constant}");
}

#[test]
fn curves_of_drives_behind_a_parallel_link_go_with_readings_and_others_do_not() {
    let parallel = Some([1, 2]);
    for truth in [Truth { parallel, ..Truth::BENDING }, Truth::BENDING] {
        let arm = six_axes(truth);
        let set = Measure::poses(160).of(&arm);
        let (constant, mut options) = options(&arm, &set).unwrap();
        options.drives = Drives::of(&six_axes(Truth { parallel, ..truth }).coupling(), |_| false);
        let fit = fit_from(&arm, &set, constant, options).unwrap();
        assert_eq!(fit.field.hyper.by_readings, truth.parallel.is_some());
        assert_noise_is_left(&arm, &fit);
    }
}

#[test]
fn joints_that_act_together_are_the_major_ones() {
    let truth = Truth { coupled: (8e-4, [2, 4]), ..Truth::RIGID };
    let arm = six_axes(truth);
    let fit = fit(&arm, &Measure::poses(150).of(&arm)).unwrap();
    let found = fit.field.hyper.major_joints();
    assert!(found.contains(&2) && found.contains(&4), "{found:?}");
}

#[test]
fn a_wave_that_is_too_fine_for_a_curve_is_found_and_taken_away() {
    for (cycles, joint) in [(202.0, 1), (77.3, 2)] {
        let arm = six_axes(Truth { wave: (8e-5, cycles, joint), ..Truth::BENDING });
        let fit = fit(&arm, &Measure::poses(160).of(&arm)).unwrap();
        let waves = &fit.field.hyper.waves;
        assert!(!waves.is_empty() && waves.iter().all(|wave| wave.joint == joint), "{waves:?}");
        assert!(waves.iter().any(|wave| (wave.cycles - cycles).abs() < 0.2), "{waves:?}");
        assert_noise_is_left(&arm, &fit);
    }
}

#[test]
fn outliers_do_not_hide_a_wave() {
    let arm = six_axes(Truth { wave: (8e-5, 202.0, 1), ..Truth::BENDING });
    let mut set = Measure::poses(150).of(&arm);
    for pose in 0..4 {
        set.targets[3 * (35 * pose + 5) + pose % 3] += 20e-3;
    }
    let fit = fit(&arm, &set).unwrap();
    let waves = &fit.field.hyper.waves;
    assert!(waves.iter().any(|wave| wave.joint == 1 && wave.cycles == 202.0), "{waves:?}");
    assert!(waves.iter().all(|wave| wave.amplitude < 2e-4), "{waves:?}");
    let (_, field) = deviations(&arm, &fit, &held_out(200).of(&arm));
    let field = root_mean_square(&field);
    assert!(field < 1.7 * NOISE, "the field leaves {field}");
}

#[test]
fn where_there_is_no_wave_none_is_found() {
    for seed in 1..4 {
        let arm = six_axes(Truth::BENDING);
        let fit = fit(&arm, &Measure { seed, ..Measure::poses(120) }.of(&arm)).unwrap();
        assert!(fit.field.hyper.waves.is_empty(), "seed {seed}: {:?}", fit.field.hyper.waves);
    }
}

/// Held-out error with the field over that without, mean of three draws.
fn cost_of_varying(arm: &Arm, poses: usize) -> f64 {
    let of = |seed: u64| {
        let fit = fit(arm, &Measure { seed, ..Measure::poses(poses) }.of(arm)).unwrap();
        let (constant, field) = deviations(arm, &fit, &held_out(300).of(arm));
        root_mean_square(&field) / root_mean_square(&constant)
    };
    (of(7) + of(8) + of(9)) / 3.0
}

#[test]
fn a_rigid_arm_is_left_alone() {
    let arm = six_axes(Truth::RIGID);
    // Priors expect an arm to bend: the values of some poses of a rigid one do not quite talk them out of it.
    let cost = cost_of_varying(&arm, 100);
    assert!(cost < 1.05, "100 poses: {cost} times the constants' error");
    let cost = cost_of_varying(&arm, 30);
    assert!(cost < 1.15, "30 poses: {cost} times the constants' error");
}

#[test]
fn few_poses_do_no_harm() {
    let arm = six_axes(Truth::BENDING);
    for poses in [12, 20, 30] {
        let fit = fit(&arm, &Measure::poses(poses).of(&arm)).unwrap();
        let (constant, field) = deviations(&arm, &fit, &held_out(200).of(&arm));
        let (constant, field) = (root_mean_square(&constant), root_mean_square(&field));
        assert!(field < 1.1 * constant, "{poses} poses: the field leaves {field}, the constants {constant}");
    }
}

#[test]
fn too_few_poses_are_refused() {
    let arm = six_axes(Truth::BENDING);
    let Err(refused) = fit(&arm, &Measure::poses(2).of(&arm)) else { panic!("two poses determine nothing") };
    assert!(refused.to_string().contains("measure at least 3 poses"), "{refused}");
}

#[test]
fn options_of_other_problems_are_refused() {
    let arm = six_axes(Truth::RIGID);
    let set = Measure::poses(40).of(&arm);
    let (constant, given) = options(&arm, &set).unwrap();
    let given = FieldOptions { rough: true, ..given };
    let problem = problem(&arm, &set, &arm.columns);
    let said = |problem: &Problem, spoil: &dyn Fn(&mut FieldOptions)| {
        let mut spoilt = given.clone();
        spoil(&mut spoilt);
        fit_field(problem, &constant, &spoilt).map(drop).unwrap_err().to_string()
    };
    assert!(said(&problem, &|o| o.driven.clear()).contains("the number of driven columns is 0"));
    assert!(said(&problem, &|o| o.driven.push(999)).contains("a column is 999"));
    assert!(said(&problem, &|o| o.determined.push(999)).contains("a column is 999"));
    assert!(said(&problem, &|o| o.payloads.push(0)).contains("a payload is 0"));
    assert!(
        said(&problem, &|o| o.features.push(Input::line(1.0))).contains("features has 0 values where 40")
    );
    assert!(said(&problem, &|o| o.degree = 4).contains("degree is 4"));
    let nothing = problem.with_columns(&[]);
    assert!(said(&nothing, &|o| o.determined.clear()).contains("a column is 0"));
    let empty = subset(&set, &[]);
    assert!(said(&Problem { measurements: &empty, ..problem }, &|_| ()).contains("measured values is 0"));
    let unweighted = MeasurementSet { weight: vec![0.0; 40], ..set.clone() };
    assert!(
        said(&Problem { measurements: &unweighted, ..problem }, &|_| ()).contains("measured values is 0")
    );
    let other = ConstantFit { setup: Setup::identity(2, 1, 0), ..constant.clone() };
    let refused = fit_field(&problem, &other, &given).map(drop).unwrap_err();
    assert!(matches!(refused, FieldError::Estimate(EstimateError::Setup { .. })), "{refused}");
}
