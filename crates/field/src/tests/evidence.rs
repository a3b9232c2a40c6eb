//! The evidence against its definition, and its gradient against finite differences.

use faer::{Mat, Par};
use truearm_estimate::dense::{Cholesky, column};
use truearm_kinematics::{Cancel, Cancelled, lever_count};

use super::oracle::{Exact, Oracle};
use super::sets::{
    by_readings, four_targets, hyper, line_inputs, loaded, poses_in_two_groups, positions, rippling,
    several_shots,
};
use crate::FieldError;
use crate::condensed::Condensed;
use crate::evidence::Evidence;
use crate::hyper::Hyper;
use crate::hyper_prior::HyperPrior;
use crate::training::Training;

/// Every derivative against central differences of fourth order. The step is long because an undetermined set-up
/// direction (a SCARA's height) leaves the value seven digits.
fn check_gradient(training: &Training, hyper: &Hyper) {
    const STEP: f64 = 4e-3;
    let cancel = Cancel::default();
    let evidence = Evidence::new(training, &cancel);
    let logs = hyper.to_logs();
    let gradient = evidence.score(hyper).unwrap().gradient;
    assert_eq!(gradient.len(), logs.len());
    for (k, found) in gradient.iter().enumerate() {
        let at = |step: f64| {
            let mut moved = logs.clone();
            moved[k] += step;
            evidence.score(&hyper.with_logs(&moved)).unwrap().value
        };
        let wanted = (8.0 * (at(STEP) - at(-STEP)) - (at(2.0 * STEP) - at(-2.0 * STEP))) / (12.0 * STEP);
        assert!(
            (found - wanted).abs() < 1e-5 * (1.0 + wanted.abs()),
            "hyper-parameter {k}: {found} instead of {wanted}"
        );
    }
}

fn check_value(training: &Training, hyper: &Hyper) {
    let cancel = Cancel::default();
    let evidence = Evidence::new(training, &cancel);
    let found = evidence.score(hyper).unwrap().value;
    assert_eq!(evidence.value(hyper).unwrap(), found, "without the gradient");
    let wanted = Oracle::new(training, hyper, Exact(training, hyper)).evidence();
    assert!((found - wanted).abs() < 1e-6 * wanted.abs(), "{found} instead of {wanted}");
}

#[test]
fn gradient_with_positions() {
    let training = positions(22);
    check_gradient(&training, &hyper(&training, 6));
}

#[test]
fn gradient_and_value_with_ripples() {
    let training = positions(22);
    check_value(&training, &rippling(&training, 6));
    check_gradient(&training, &rippling(&training, 6));
    let training = line_inputs(16);
    check_value(&training, &rippling(&training, 4));
    check_gradient(&training, &rippling(&training, 4));
}

#[test]
fn gradient_with_poses_of_two_groups_and_rows_of_their_own_sigma_and_weight() {
    let training = poses_in_two_groups(18);
    check_gradient(&training, &hyper(&training, 6));
}

#[test]
fn gradient_and_value_with_several_shots_of_poses() {
    let training = several_shots(18);
    assert_eq!(training.pose_count(), 18);
    check_value(&training, &hyper(&training, 6));
    check_gradient(&training, &hyper(&training, 6));
    // Below what shots differ by nothing changes with the noise.
    let quiet = Hyper { noise: [0.4 * training.shot[0].sqrt(), 1e-4], ..hyper(&training, 6) };
    check_gradient(&training, &quiet);
}

#[test]
fn several_targets_are_worth_six_rows_and_the_evidence_stays() {
    let training = four_targets(20);
    let few = Condensed::of(&training).unwrap().training;
    assert!(few.row_count() < 20 * 9 + 2 * (training.setup_width + 1), "{}", few.row_count());
    let hyper = hyper(&training, 6);
    check_value(&training, &hyper);
    check_gradient(&training, &hyper);
    let cancel = Cancel::default();
    let [few, all] = [Evidence::new(&training, &cancel), Evidence::by_row(&training, &cancel)]
        .map(|evidence| evidence.informed(&hyper).unwrap());
    assert!((few.score.value / all.score.value - 1.0).abs() < 1e-12);
    for (few, all) in few.score.gradient.iter().zip(&all.score.gradient) {
        assert!((few - all).abs() < 1e-8 * (1.0 + all.abs()), "{few} instead of {all}");
    }
    let apart = (few.information - &all.information).norm_max() / all.information.norm_max();
    assert!(apart < 1e-8, "{apart}");
}

#[test]
fn gradient_with_a_prismatic_joint_and_a_feature() {
    let training = line_inputs(16);
    check_gradient(&training, &hyper(&training, 4));
}

#[test]
fn gradient_and_value_with_a_payload() {
    let training = loaded(18);
    check_value(&training, &hyper(&training, 6));
    check_gradient(&training, &hyper(&training, 6));
}

#[test]
fn levers_of_a_payload_are_those_of_the_arm_in_proportion_to_the_largest() {
    let training = loaded(6);
    let own = training.levers_of(0).len() / 2;
    assert_eq!(own, lever_count(6));
    for pose in 0..6 {
        let (arm, payload) = training.levers_of(pose).split_at(own);
        let share = [0.0, 0.5, 1.0][pose % 3];
        arm.iter().zip(payload).for_each(|(arm, payload)| assert_eq!(*payload, share * arm));
    }
}

#[test]
fn gradient_and_information_where_curves_go_with_readings() {
    let training = by_readings(18);
    let mut hyper = rippling(&training, 6);
    hyper.waves[0].joint = 6;
    check_gradient(&training, &hyper);
    check_information(&training, &hyper);
}

#[test]
fn gradient_with_the_major_block_over_all_joints() {
    let training = positions(20);
    check_gradient(&training, &Hyper::start(&[0, 1, 2, 3, 4, 5], 6, [5e-5, 1e-4]));
}

#[test]
fn value_is_that_of_the_covariance_written_out() {
    let training = positions(22);
    check_value(&training, &hyper(&training, 6));
    let training = poses_in_two_groups(18);
    check_value(&training, &hyper(&training, 6));
    let training = line_inputs(16);
    check_value(&training, &hyper(&training, 4));
}

/// The average information by its definition, the derivatives of the covariance by differences, and the prior's precision.
fn check_information(training: &Training, hyper: &Hyper) {
    const STEP: f64 = 4e-3;
    let logs = hyper.to_logs();
    // Beside the set-up's share, which no hyper-parameter changes, differences would have few digits.
    let alone = Training { setup: vec![0.0; training.setup.len()], ..training.clone() };
    let here = Oracle::new(training, hyper, Exact(training, hyper)).covariance();
    let factor = Cholesky::new(here, Par::Seq).unwrap();
    let alpha = column(&factor.solve_vector(&training.residual));
    let slopes: Vec<Mat<f64>> = (0..logs.len())
        .map(|k| {
            let at = |step: f64| {
                let mut moved = logs.clone();
                moved[k] += step;
                let hyper = hyper.with_logs(&moved);
                Oracle::new(&alone, &hyper, Exact(&alone, &hyper)).covariance()
            };
            let near = (at(STEP) - at(-STEP)) * faer::Scale(8.0);
            (near - (at(2.0 * STEP) - at(-2.0 * STEP))) * &alpha * faer::Scale(1.0 / (12.0 * STEP))
        })
        .collect();
    let cancel = Cancel::default();
    let found = Evidence::new(training, &cancel).informed(hyper).unwrap().information;
    let halves: Vec<Mat<f64>> = slopes
        .into_iter()
        .map(|mut slope| {
            factor.solve_lower(slope.as_mut());
            slope
        })
        .collect();
    let mut prior = Mat::zeros(logs.len(), logs.len());
    HyperPrior::new(hyper).add_precision(&mut prior);
    for i in 0..logs.len() {
        for j in 0..logs.len() {
            let wanted = 0.5 * (halves[i].transpose() * &halves[j])[(0, 0)] + prior[(i, j)];
            let size = 0.5 * (halves[i].norm_l2() * halves[j].norm_l2());
            assert!(
                (found[(i, j)] - wanted).abs() <= 1e-5 * size + 1e-9,
                "hyper-parameters {i} and {j}: {} instead of {wanted} of {size}",
                found[(i, j)]
            );
        }
    }
}

#[test]
fn information_is_that_of_the_covariance_written_out() {
    let training = positions(22);
    check_information(&training, &hyper(&training, 6));
    check_information(&training, &rippling(&training, 6));
    let training = poses_in_two_groups(18);
    check_information(&training, &hyper(&training, 6));
    let training = line_inputs(16);
    check_information(&training, &rippling(&training, 4));
    let training = loaded(18);
    check_information(&training, &hyper(&training, 6));
    let training = several_shots(18);
    check_information(&training, &hyper(&training, 6));
}

#[test]
fn values_that_are_no_numbers_are_refused() {
    let mut training = positions(12);
    training.jacobian[5] = f64::NAN;
    let cancel = Cancel::default();
    let refused = Evidence::new(&training, &cancel).score(&hyper(&training, 6)).unwrap_err();
    assert_eq!(refused, FieldError::NotPositiveDefinite { rows: 36 });
}

#[test]
fn a_request_to_stop_is_obeyed() {
    let training = positions(12);
    let cancel = Cancel::default();
    let evidence = Evidence::new(&training, &cancel);
    cancel.request();
    let stopped = evidence.score(&hyper(&training, 6)).unwrap_err();
    assert_eq!(stopped, FieldError::Cancelled(Cancelled));
}
