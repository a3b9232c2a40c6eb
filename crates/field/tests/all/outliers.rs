//! Gross errors are found and innocent poses are not.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{Measure, Truth, deviations, fit, root_mean_square, scara, six_axes};
use truearm_field::{FieldFit, Posterior};

/// Files keep these weights: standard deviations are to come out of them as out of the fit.
fn assert_weights_are_of_the_posterior(fit: &FieldFit) {
    let training = fit.posterior.training();
    for (pose, weight) in fit.weights.iter().enumerate() {
        assert!(training.rows(pose).all(|row| training.weight[row] == *weight), "pose {pose}: {weight}");
    }
}

#[test]
fn gross_errors_are_named_and_others_are_not() {
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure::poses(120).of(&arm);
    for (pose, shift) in [(3, 2e-3), (50, -1e-3), (97, 5e-3)] {
        set.targets[3 * pose + pose % 3] += shift;
    }
    let fit = fit(&arm, &set).unwrap();
    assert_eq!(fit.field.judgement.outliers, [3, 50, 97]);
    let training = fit.field.posterior.training();
    assert!(training.rows(50).all(|row| training.weight[row] < 0.01));
    let (constant, field) = deviations(&arm, &fit, &Measure { seed: 99, ..Measure::poses(200) }.of(&arm));
    let (constant, field) = (root_mean_square(&constant), root_mean_square(&field));
    assert!(field < 0.6 * constant, "{field} with the field, {constant} without");
    assert!(fit.field.judgement.distance[97] > 4e-3);
}

#[test]
fn gross_errors_among_thousands_of_poses_are_named_and_spoil_nothing() {
    let arm = scara(Truth { own: 1e-4, ..Truth::RIGID });
    let measure = Measure::poses(2100);
    let mut set = measure.of(&arm);
    let wrong: Vec<usize> = (7..2100).step_by(50).collect();
    for pose in &wrong {
        set.targets[3 * pose + pose % 3] += 3e-3;
    }
    let with = fit(&arm, &set).unwrap().field;
    assert!(matches!(with.posterior, Posterior::Weight(_)));
    assert_eq!(with.judgement.outliers, wrong);
    let without: Vec<usize> = (0..2100).filter(|&pose| with.weights[pose] < 1.0).collect();
    assert_eq!(without, wrong);
    assert_weights_are_of_the_posterior(&with);
    assert!((with.hyper.noise[0] / measure.noise - 1.0).abs() < 0.05, "{}", with.hyper.noise[0]);
}

/// As where a robust loss has taken genuine local error for gross errors, and gross ones for none.
#[test]
fn outliers_are_those_that_have_lost_their_weight() {
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure::poses(120).of(&arm);
    (0..120).step_by(4).for_each(|pose| set.weight[pose] = 1e-3);
    for pose in [3, 50, 97] {
        set.targets[3 * pose] += 6e-4;
    }
    let fit = fit(&arm, &set).unwrap().field;
    let without: Vec<usize> = (0..120).filter(|&pose| fit.weights[pose] < 1.0).collect();
    assert_weights_are_of_the_posterior(&fit);
    assert_eq!((without.as_slice(), fit.judgement.outliers.as_slice()), (&[3, 50, 97][..], &[3, 50, 97][..]));
}

#[test]
fn genuine_local_error_is_no_outlier() {
    let arm = six_axes(Truth { own: 6e-4, ..Truth::BENDING });
    let fit = fit(&arm, &Measure::poses(80).of(&arm)).unwrap();
    assert!(fit.field.judgement.outliers.is_empty(), "{:?}", fit.field.judgement);
}

/// Outliers that are noticed by one target only have spoiled the fit whichever it is.
#[test]
fn it_is_no_matter_which_target_is_far_off() {
    let arm = six_axes(Truth::BENDING);
    let measure = Measure { targets: 3, ..Measure::poses(70) };
    let mut set = measure.of(&arm);
    for pose in [10, 33, 56] {
        set.targets[9 * pose + 6 + pose % 3] += 2e-2;
    }
    let mut turned = set.clone();
    for pose in turned.targets.chunks_mut(9) {
        pose.rotate_right(3);
    }
    let [third, first] = [set, turned].map(|set| fit(&arm, &set).unwrap().field);
    assert_eq!(third.judgement.outliers, [10, 33, 56]);
    assert_eq!(first.judgement.outliers, [10, 33, 56]);
    let (noise, as_first) = (third.hyper.noise[0], first.hyper.noise[0]);
    assert!((noise / as_first - 1.0).abs() < 1e-3, "{noise} and {as_first}");
    assert!((noise / measure.noise - 1.0).abs() < 0.2, "{noise}");
}
