//! Shots of the same pose count as one.

use truearm_bank::Input;
use truearm_estimate::{MeasurementSet, Sigma};

use super::common::{Measure, Truth, deviations, fit, root_mean_square, shots, six_axes, subset};
use super::sets::rows_of;
use crate::joined::{Joined, join};
use crate::options::FieldOptions;
use crate::training::Training;

const STILL: f64 = 2e-5;

fn joined(rows: Training, set: &MeasurementSet) -> Joined {
    let left = rows.residual.clone();
    join(rows, &left, &set.group, set.rows_per_pose())
}

/// Gives the pose behind one the joint values of that one.
fn note_again(set: &mut MeasurementSet, pose: usize) {
    let joints = set.joint_count;
    set.joints.copy_within(pose * joints..(pose + 1) * joints, (pose + 1) * joints);
}

#[test]
fn shots_are_joined_to_their_mean() {
    let arm = six_axes(Truth::BENDING);
    let once = Measure { groups: 2, ..Measure::poses(30) }.of(&arm);
    let often = shots(&once, 4, 0.0, 1e-5, 3);
    let Joined { training: found, pose_of, doubtful } = joined(rows_of(&arm, &often, |_| ()), &often);
    assert!(doubtful.is_empty());
    assert_eq!(pose_of, (0..120).map(|shot| shot / 4).collect::<Vec<usize>>());
    let all = rows_of(&arm, &often, |_| ());
    for pose in 0..30 {
        for (k, row) in found.rows(pose).enumerate() {
            let of_shots = (0..4).map(|shot| all.residual[all.rows(4 * pose + shot).start + k]);
            assert!((found.residual[row] - of_shots.sum::<f64>() / 4.0).abs() < 1e-15);
            assert!((found.kept(row) - 0.25).abs() < 1e-15);
        }
    }
    let first = found.first_shots(all.row_count() + 1);
    assert_eq!(first[12..24], [12; 12]);
    assert_eq!(first.last(), Some(&all.row_count()));
    // 30 x 3 x 3 differences know the shots' variance to 9 %; it is the smallest that is still plausible that is taken.
    let share = found.shot[0] / 1e-10;
    assert!((0.6..1.05).contains(&share), "{share}");
    let (noise, mean) = (3e-5_f64, found.noise_variance(0, [3e-5, 0.0]));
    assert!((mean - (noise * noise - 0.75 * found.shot[0])).abs() < 1e-18);
}

#[test]
fn nothing_changes_where_poses_were_measured_once() {
    let arm = six_axes(Truth::BENDING);
    let set = Measure::poses(40).of(&arm);
    let Joined { training: found, pose_of, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!(pose_of, (0..40).collect::<Vec<usize>>());
    assert_eq!(found.residual, rows_of(&arm, &set, |_| ()).residual);
    assert_eq!(found.shot, [0.0; 2]);
}

#[test]
fn readings_that_scatter_are_one_pose_and_others_are_not() {
    let arm = six_axes(Truth::BENDING);
    let mut set = shots(&Measure::poses(30).of(&arm), 3, STILL, 1e-5, 4);
    set.joints[6 * 4] += 1e-3;
    set.group_count = 2;
    set.group[8] = 1;
    set.group[9..].iter_mut().step_by(2).for_each(|group| *group = 1);
    set.weight[5] = 0.0;
    let Joined { training: found, pose_of, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!(pose_of[..9], [0, 0, 0, 1, 2, 3, 4, 4, 5]);
    assert!(found.rows(3).is_empty(), "a row without weight");
}

#[test]
fn a_shot_that_its_others_contradict_stands_apart() {
    let arm = six_axes(Truth::BENDING);
    let mut set = shots(&Measure::poses(60).of(&arm), 3, STILL, 1e-5, 5);
    set.targets[3 * 31] += 1e-3;
    let Joined { pose_of, doubtful, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!((&pose_of[30..33], &doubtful[..]), (&[10, 11, 10][..], &[11][..]));
    let fit = fit(&arm, &set).unwrap();
    assert_eq!(fit.field.judgement.outliers, [31]);
    let weights = &fit.field.weights;
    assert!(weights[31] < 0.01 && weights[30] == 1.0);
}

#[test]
fn two_rows_that_cannot_be_shots_of_one_pose_are_none() {
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure::poses(60).of(&arm);
    // Nothing else tells what shots differ by.
    note_again(&mut set, 30);
    let Joined { pose_of, training, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!(pose_of, (0..60).collect::<Vec<usize>>());
    assert_eq!(training.shot, [0.0; 2]);
    assert_eq!(fit(&arm, &set).unwrap().field.judgement.outliers, [31]);
}

#[test]
fn few_shots_do_not_tell_the_noise_of_all() {
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure::poses(40).of(&arm);
    note_again(&mut set, 10);
    set.targets.copy_within(30..33, 33);
    set.targets[33] += 5e-5;
    let Joined { training, pose_of, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!((&pose_of[9..13], training.shot), (&[9, 10, 10, 11][..], [0.0; 2]));
}

#[test]
fn shots_do_not_pass_what_poses_scatter_off_as_the_fields() {
    let arm = six_axes(Truth { own: 2e-5, ..Truth::BENDING });
    let scatter = 4e-5;
    let test = Measure { noise: 0.0, seed: 99, ..Measure::poses(300) }.of(&arm);
    let once = Measure { noise: scatter, ..Measure::poses(60) }.of(&arm);
    let all = fit(&arm, &shots(&once, 4, STILL, 1e-6, 6)).unwrap();
    let left = |fit| root_mean_square(&deviations(&arm, fit, &test).1);
    let single = fit(&arm, &subset(&once, &(0..60).collect::<Vec<usize>>())).unwrap();
    assert!((0.6..1.4).contains(&(all.field.hyper.noise[0] / scatter)), "{:?}", all.field.hyper.noise);
    let (all, single) = (left(&all), left(&single));
    assert!(all < 1.05 * single, "{all} from four shots of each pose, {single} from one");
}

#[test]
fn many_contradicted_shots_are_found() {
    let arm = six_axes(Truth::BENDING);
    let mut set = shots(&Measure::poses(60).of(&arm), 3, STILL, 1e-5, 8);
    let bad: Vec<usize> = (0..12).map(|k| 3 * (5 * k) + k % 3).collect();
    bad.iter().for_each(|&shot| set.targets[3 * shot] += 1e-3);
    let fit = fit(&arm, &set).unwrap();
    assert_eq!(fit.field.judgement.outliers, bad);
    assert!(fit.field.hyper.noise[0] < 6e-5, "{:?}", fit.field.hyper.noise);
}

#[test]
fn noise_is_not_less_than_what_shots_differ_by() {
    let arm = six_axes(Truth::BENDING);
    let quiet = Measure { noise: 0.0, ..Measure::poses(60) }.of(&arm);
    let fit = fit(&arm, &shots(&quiet, 5, 0.0, 2e-5, 9)).unwrap();
    let share = fit.field.hyper.noise[0] / 2e-5;
    assert!((0.85..1.3).contains(&share), "{share} of the noise of a shot");
}

#[test]
fn shots_count_by_what_they_state() {
    let arm = six_axes(Truth::BENDING);
    let mut set = shots(&Measure::poses(30).of(&arm), 3, STILL, 1e-5, 10);
    set.sigma[1] = Sigma::of_position(5e-4);
    (set.sigma[0], set.sigma[2]) = (Sigma::of_position(1e-7), Sigma::of_position(2e-7));
    let Joined { training: found, pose_of, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!(pose_of, (0..90).map(|shot| shot / 3).collect::<Vec<usize>>());
    let shares: Vec<f64> = found.source[0].iter().map(|shot| shot.share).collect();
    assert!(shares[1] < 1e-3 && (shares[0] - shares[2]).abs() < 1e-3, "{shares:?}");
    assert!(found.variance[0] < 1e-12, "{}", found.variance[0]);
}

#[test]
fn shots_of_two_instruments_are_told_apart_by_what_they_state() {
    let arm = six_axes(Truth::BENDING);
    let (fine, coarse) = (5e-6, 2e-4);
    let mut set = shots(&Measure { groups: 2, ..Measure::poses(60) }.of(&arm), 3, STILL, fine, 11);
    let mut turn = 0.0_f64;
    for shot in 0..180 {
        let of_camera = set.group[shot] == 1;
        set.sigma[shot] = Sigma::of_position(if of_camera { coarse } else { fine });
        for value in set.targets[3 * shot..][..3].iter_mut().filter(|_| of_camera) {
            turn += 2.4;
            *value += coarse * turn.sin();
        }
    }
    let Joined { pose_of, training, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!(pose_of, (0..180).map(|shot| shot / 3).collect::<Vec<usize>>());
    // What readings jitter by moves a target within a metre by less.
    assert!(training.shot[0] < STILL * STILL, "{}", training.shot[0]);
}

#[test]
fn a_target_is_the_mean_of_the_shots_that_hold_it() {
    let arm = six_axes(Truth::BENDING);
    let measure = Measure { orientation: Some(1e-5), ..Measure::poses(20) };
    let mut set = shots(&measure.of(&arm), 3, 0.0, 1e-5, 12);
    for pose in 0..20 {
        set.rotations[9 * (3 * pose)..][..9].fill(f64::NAN);
        set.targets[3 * (3 * pose + 1)..][..3].fill(f64::NAN);
    }
    let all = rows_of(&arm, &set, |_| ());
    let Joined { training: found, pose_of, .. } = joined(all.clone(), &set);
    assert_eq!(pose_of, (0..60).map(|shot| shot / 3).collect::<Vec<usize>>());
    assert_eq!((found.rows(7).len(), found.is_orientation[found.rows(7).start + 3]), (6, true));
    let mean = |a: usize, b: usize| 0.5 * (all.residual[a] + all.residual[b]);
    // Shots hold a position, an orientation, and both.
    let [first, second, third] = [0, 1, 2].map(|shot| all.rows(21 + shot).start);
    let found_at = |row: usize| found.residual[found.rows(7).start + row];
    assert!((found_at(0) - mean(first, third)).abs() < 1e-15);
    assert!((found_at(3) - mean(second, third + 3)).abs() < 1e-15);
    assert_eq!(found.first_shots(360)[6 * 23..][..6], [6 * 21; 6]);
}

#[test]
fn features_of_shots_scatter_and_those_of_other_states_differ() {
    let arm = six_axes(Truth::BENDING);
    let set = shots(&Measure::poses(30).of(&arm), 3, STILL, 1e-5, 10);
    let warm = |options: &mut FieldOptions| {
        options.features = vec![Input::line(10.0)];
        options.feature_values =
            (0..90).map(|row| if row == 3 { 9.0 } else { 0.2 * (row % 3) as f64 }).collect();
    };
    let Joined { pose_of, training, .. } = joined(rows_of(&arm, &set, warm), &set);
    assert_eq!(pose_of[..9], [0, 0, 0, 1, 2, 2, 3, 3, 3]);
    assert!((training.values_of(0)[6] - 0.2).abs() < 1e-15);
}

#[test]
fn a_pose_begins_with_the_least_weight_of_its_shots() {
    let arm = six_axes(Truth::BENDING);
    let mut set = shots(&Measure::poses(30).of(&arm), 3, STILL, 1e-5, 13);
    set.weight[4] = 1e-4;
    let Joined { pose_of, training, .. } = joined(rows_of(&arm, &set, |_| ()), &set);
    assert_eq!(pose_of, (0..90).map(|shot| shot / 3).collect::<Vec<usize>>());
    assert_eq!((training.weight_of(0), training.weight_of(1)), (Some(1.0), Some(1e-4)));
}
