//! What can be measured and of which arm: groups, targets, poses, gaps, features, other chains.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{
    Arm, Measure, Truth, deviations, fit, fit_from, options, root_mean_square, scara, seven_axes, six_axes,
};
use truearm_bank::Input;
use truearm_estimate::MeasurementSet;
use truearm_field::{Begin, Hyper};

const NOISE: f64 = 3e-5;

/// Fits with hyper-parameters at the centre of their priors and compares held-out positions with the constants'.
fn check(arm: &Arm, measure: Measure, share: f64) {
    let set = measure.of(arm);
    let (constant, mut options) = options(arm, &set).unwrap();
    options.begin = Begin::Known(centre(&set));
    let fit = fit_from(arm, &set, constant, options).unwrap();
    let other = Measure { seed: 99, poses: 200, ..measure }.of(arm);
    let (constant, field) = deviations(arm, &fit, &other);
    let rows = other.rows_per_pose();
    let positions = 3 * other.target_count;
    let of = |values: &[f64], orientation: bool| {
        let wanted = |k: usize| (k % rows >= positions) == orientation;
        let kept: Vec<f64> = values.iter().enumerate().filter(|(k, _)| wanted(*k)).map(|(_, x)| *x).collect();
        root_mean_square(&kept)
    };
    let (before, after) = (of(&constant, false), of(&field, false));
    assert!(after < share * before, "positions: {after} with the field, {before} without");
    if rows > positions {
        let (before, after) = (of(&constant, true), of(&field, true));
        assert!(after < 1.02 * before, "orientations: {after} with the field, {before} without");
    }
}

fn centre(set: &MeasurementSet) -> Hyper {
    Hyper::start(&[1, 2], set.joint_count, [NOISE, 1e-4])
}

#[test]
fn two_groups() {
    check(&six_axes(Truth::BENDING), Measure { groups: 2, ..Measure::poses(160) }, 0.6);
}

#[test]
fn poses_with_orientation() {
    check(&six_axes(Truth::BENDING), Measure { orientation: Some(1e-4), ..Measure::poses(120) }, 0.7);
}

#[test]
fn several_targets() {
    check(&six_axes(Truth::BENDING), Measure { targets: 3, ..Measure::poses(100) }, 0.7);
}

#[test]
fn a_scara() {
    check(&scara(Truth { own: 3e-4, ..Truth::RIGID }), Measure::poses(150), 0.6);
}

#[test]
fn seven_axes_in_modified_convention() {
    check(&seven_axes(Truth::BENDING), Measure::poses(200), 0.8);
}

#[test]
fn seven_axes_with_search() {
    let arm = seven_axes(Truth::BENDING);
    let fit = fit(&arm, &Measure::poses(60).of(&arm)).unwrap();
    let (constant, field) = deviations(&arm, &fit, &Measure { seed: 99, ..Measure::poses(200) }.of(&arm));
    let (constant, field) = (root_mean_square(&constant), root_mean_square(&field));
    assert!(field < 1.02 * constant, "{field} with the field, {constant} without");
    assert!(fit.field.hyper.major_joints().len() <= 3);
}

#[test]
fn targets_that_were_not_seen_are_done_without() {
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure { targets: 2, ..Measure::poses(80) }.of(&arm);
    for pose in (0..80).step_by(3) {
        let at = 3 * (2 * pose + pose % 2);
        set.targets[at..at + 3].fill(f64::NAN);
    }
    let (constant, mut options) = options(&arm, &set).unwrap();
    options.begin = Begin::Known(centre(&set));
    let fit = fit_from(&arm, &set, constant, options).unwrap();
    let missing = set.targets.iter().filter(|x| x.is_nan()).count();
    assert_eq!(fit.field.posterior.training().row_count(), 6 * 80 - missing);
    assert!(fit.field.parameters.iter().all(|x| x.is_finite()));
}

#[test]
fn a_feature_that_matters_is_an_input() {
    let arm = six_axes(Truth::RIGID);
    let mut set = Measure::poses(120).of(&arm);
    let hot = Measure::poses(120).of(&six_axes(Truth::RIGID).changed(7, 1e-3));
    let warmth: Vec<f64> = (0..120).map(|pose| 15.0 * (pose as f64 * 0.618_033_98).fract()).collect();
    for (k, (target, there)) in set.targets.iter_mut().zip(&hot.targets).enumerate() {
        *target += warmth[k / 3] / 15.0 * (there - *target);
    }
    let error = |features: bool| {
        let (constant, mut options) = options(&arm, &set).unwrap();
        options.begin = Begin::Known(centre(&set));
        if features {
            options.features = vec![Input::line(15.0)];
            options.feature_values = warmth.clone();
        }
        let fit = fit_from(&arm, &set, constant, options).unwrap();
        root_mean_square(&fit.field.judgement.distance)
    };
    let (with, without) = (error(true), error(false));
    assert!(with < 0.6 * without, "{with} with the feature, {without} without");
}
