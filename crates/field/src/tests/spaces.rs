//! What a posterior must be wherever it is asked: positive semidefinite, surer among the data than away from it, back at
//! the constants far away; and the choice between the spaces.

use truearm_estimate::dense::eigenvalues;
use truearm_kinematics::Cancel;

use super::common::{Measure, Truth, scara};
use super::posterior::close;
use super::sets::{few_driven, hyper, positions, rows_of};
use crate::data_space::DataSpace;
use crate::hyper::{Hyper, WAVE_NAME};
use crate::model::Model;
use crate::outliers::{Judgement, judge};
use crate::posterior::Posterior;
use crate::refine::explained;
use crate::training::Training;
use crate::weight_space::WeightSpace;

fn both(training: &Training, hyper: &Hyper) -> [Posterior; 2] {
    let model = || Model::new(training.clone(), hyper.clone(), 2);
    let cancel = Cancel::default();
    [
        Posterior::Data(Box::new(DataSpace::new(model(), &cancel).unwrap())),
        Posterior::Weight(Box::new(WeightSpace::new(model(), &cancel).unwrap())),
    ]
}

/// Short length scales, so that the data ends somewhere.
fn short(training: &Training) -> Hyper {
    let mut hyper = hyper(training, 6);
    (hyper.smooth_length, hyper.smooth_line_length) = (0.5, 0.5);
    hyper.own_length = 0.1;
    hyper.products.truncate(1);
    hyper.products.iter_mut().for_each(|product| product.lengths.fill(0.6));
    hyper
}

/// Variances of every column's CEP alone at a configuration, (P,).
fn variances(posterior: &Posterior, values: &[f64]) -> Vec<f64> {
    let columns = posterior.training().columns.len();
    let identity: Vec<f64> =
        (0..columns * columns).map(|k| if k / columns == k % columns { 1.0 } else { 0.0 }).collect();
    let covariance = posterior.covariance(values, &identity, None, columns).unwrap();
    let matrix = faer::Mat::from_fn(columns, columns, |i, j| covariance[i * columns + j]);
    let eigenvalues = eigenvalues(&matrix).unwrap();
    let largest = eigenvalues[columns - 1];
    assert!(eigenvalues[0] > -1e-9 * largest, "{eigenvalues:?}");
    (0..columns).map(|p| matrix[(p, p)]).collect()
}

#[test]
fn covariance_grows_away_from_the_data_up_to_the_prior() {
    let mut training = few_driven(60);
    training.values.iter_mut().for_each(|value| *value *= 0.3);
    let hyper = short(&training);
    for posterior in both(&training, &hyper) {
        let prior = posterior.model();
        let here = training.values_of(3).to_vec();
        let at = |distance: f64| -> Vec<f64> { here.iter().map(|x| x + distance).collect() };
        let sums: Vec<f64> =
            [0.0, 0.4, 0.8].map(|d| variances(&posterior, &at(d)).iter().sum::<f64>()).to_vec();
        assert!(sums[0] < sums[1] && sums[1] < sums[2], "{sums:?}");
        let far = at(1.3);
        let excited = prior.cells.excite(&far);
        let held = prior.variances(&excited);
        let beyond = prior.beyond(&far);
        for (p, found) in variances(&posterior, &far).iter().enumerate() {
            let most = held[p] + beyond[p];
            assert!((beyond[p]..=most * (1.0 + 1e-9)).contains(found), "{found} {most}");
        }
    }
}

#[test]
fn beyond_the_cells_nothing_is_left_but_constants_sag_and_waves() {
    let mut training = few_driven(40);
    training.values.iter_mut().for_each(|value| *value *= 0.2);
    let hyper = short(&training);
    for posterior in both(&training, &hyper) {
        let mut solution = posterior.solve(&training.residual).unwrap();
        assert!(solution.bank.sag.take().is_some());
        let blocks = solution.bank.blocks.len();
        solution.bank.blocks.retain(|block| block.name != WAVE_NAME);
        assert_eq!(solution.bank.blocks.len() + hyper.waves.len(), blocks);
        let far: Vec<f64> = (0..6).map(|k| training.values[k] + std::f64::consts::PI).collect();
        let mut ceps = vec![0.0; training.parameter_count];
        solution.bank.add(&far, &mut ceps).unwrap();
        assert!(solution.bank.blocks.iter().any(|block| !block.grid.axes[0].closed));
        let closed = |k: usize| {
            let blocks = &solution.bank.blocks;
            blocks
                .iter()
                .any(|block| block.grid.inputs.contains(&k) && block.grid.axes.iter().any(|a| a.closed))
        };
        assert!((0..6).all(|k| !closed(k)), "the test needs data on a part of the turn");
        assert_eq!(ceps, vec![0.0; training.parameter_count]);
        let (near, beyond) =
            (posterior.model().beyond(training.values_of(0)), posterior.model().beyond(&far));
        assert!(near.iter().all(|&variance| variance < 1e-20));
        for (variance, field) in variances(&posterior, &far).iter().zip(&beyond) {
            assert!(variance >= field, "what the field may be there stays in the standard deviation");
        }
        assert!(beyond.iter().filter(|&&variance| variance > 0.0).count() == 4);
        assert!(solution.constant.iter().any(|constant| *constant != 0.0));
    }
}

/// Positions of a SCARA with few weights.
fn of_scara(poses: usize) -> (Training, Hyper) {
    let arm = scara(Truth { own: 1e-4, ..Truth::RIGID });
    let training = rows_of(&arm, &Measure::poses(poses).of(&arm), |_| ());
    let mut hyper = Hyper::start(&[0, 1], 4, [3e-5, 1e-4]);
    hyper.own_length = 1.0;
    (hyper.smooth_length, hyper.smooth_line_length) = (3.0, 3.0);
    hyper.products.truncate(1);
    hyper.products[0].lengths.fill(3.0);
    (training, hyper)
}

#[test]
fn many_rows_go_to_weight_space_where_suspicious_poses_are_judged_exactly() {
    let (mut training, hyper) = of_scara(2300);
    for pose in [101, 1503] {
        training.residual[3 * pose] += 2e-3;
    }
    let posterior = Posterior::new(training.clone(), hyper, 2, &Cancel::default()).unwrap();
    assert!(matches!(posterior, Posterior::Weight(_)));
    let judgement = judged(&posterior, &training);
    assert_eq!(judgement.outliers, [101, 1503]);
    assert!(judgement.distance.iter().all(|&distance| distance > 0.0), "all poses have residuals");
    let left_out = posterior.leave_one_out(&training.residual).unwrap();
    assert!(!left_out.sampled[3 * 101] && left_out.sampled[0] && !left_out.sampled[3 * 7]);
    let news = judgement.reweigh(&mut training);
    assert!(news.poses);
    let posterior = posterior.reweighed(&training, &Cancel::default()).unwrap();
    let again = judged(&posterior, &training);
    assert_eq!(again.outliers, [101, 1503], "what has lost its weight is judged at its full weight");
    assert!(!again.reweigh(&mut training).poses);
}

/// What eigenvalues are left out of is seen where there is hardly any noise, be they small beside the largest.
#[test]
fn what_rows_without_noise_tell_is_the_same_in_both_spaces() {
    let arm = scara(Truth { own: 3e-4, ..Truth::RIGID });
    let training = rows_of(&arm, &Measure { noise: 1e-7, ..Measure::poses(150) }.of(&arm), |_| ());
    let mut hyper = Hyper::start(&[0, 1], 4, [1e-6, 1e-5]);
    (hyper.smooth_length, hyper.smooth_line_length) = (6.0, 6.0);
    hyper.products.truncate(1);
    hyper.products[0].lengths.fill(12.0);
    hyper.products[0].amplitudes.fill(3e-3);
    let [by_rows, by_weights] = both(&training, &hyper).map(|posterior| {
        let solution = posterior.solve(&posterior.training().residual).unwrap();
        explained(&training, &solution).unwrap()
    });
    let largest = by_rows.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    close(&by_weights, &by_rows, 0.1 * hyper.noise[0] / largest, "what is explained");
}

fn judged(posterior: &Posterior, all: &Training) -> Judgement {
    let solution = posterior.solve(&posterior.training().residual).unwrap();
    judge(posterior, &solution, all, &(0..all.pose_count()).collect::<Vec<_>>(), &Cancel::default()).unwrap()
}

#[test]
fn some_poses_judge_all_wherever_they_stand() {
    let (mut training, hyper) = of_scara(300);
    let chosen: Vec<usize> = (0..300).step_by(2).collect();
    for pose in [41, 120, 271] {
        training.residual[3 * pose + 1] += 5e-4;
    }
    let of = |training: Training| Posterior::new(training, hyper.clone(), 2, &Cancel::default()).unwrap();
    let alone = of(training.select(&chosen));
    let solution = alone.solve(&alone.training().residual).unwrap();
    let found = judge(&alone, &solution, &training, &chosen, &Cancel::default()).unwrap();
    assert_eq!(found.outliers, [41, 120, 271]);
    let beside = judged(&of(training.only(&chosen)), &training);
    assert_eq!(found.outliers, beside.outliers);
    close(&found.score, &beside.score, 2e-3, "scores, but for where cells begin");
    close(&found.distance, &beside.distance, 2e-3, "distances, but for where cells begin");
}

#[test]
fn poses_that_others_stand_for_are_judged_by_them() {
    let (mut training, hyper) = of_scara(300);
    let kept = training.fill_space(200, &Cancel::default()).unwrap();
    let aside: Vec<usize> = (0..300).filter(|pose| !kept.contains(pose)).collect();
    let mut wrong = vec![aside[10], aside[70], kept[50]];
    wrong.sort_unstable();
    for pose in &wrong {
        training.residual[3 * pose + 1] += 5e-4;
    }
    let of = |training: Training| {
        Posterior::Data(Box::new(
            DataSpace::new(Model::new(training, hyper.clone(), 2), &Cancel::default()).unwrap(),
        ))
    };
    let posterior = of(training.only(&kept));
    assert_eq!(posterior.training().aside(&training), aside);
    let judgement = judged(&posterior, &training);
    assert_eq!(judgement.outliers, wrong);
    let pose = aside[10];
    let with_it: Vec<usize> = (0..300).filter(|&k| k == pose || kept.contains(&k)).collect();
    let all = judged(&of(training.only(&with_it)), &training);
    close(&[judgement.distance[pose]], &[all.distance[pose]], 1e-6, "left out");
    close(&[judgement.score[pose]], &[all.score[pose]], 0.05, "but for what is typical");
    assert!(judgement.reweigh(&mut training).poses);
    let again = judged(&posterior.reweighed(&training, &Cancel::default()).unwrap(), &training);
    assert_eq!(again.outliers, wrong);
    assert!(!again.reweigh(&mut training).poses);
}

#[test]
fn few_rows_stay_in_data_space() {
    let training = positions(12);
    let posterior = Posterior::new(training.clone(), hyper(&training, 6), 2, &Cancel::default()).unwrap();
    assert!(matches!(posterior, Posterior::Data(_)));
}

#[test]
fn poses_that_fill_the_space_are_far_apart() {
    let mut training = positions(40);
    let width = training.inputs.len();
    let first = training.values[..width].to_vec();
    training.values[5 * width..6 * width].copy_from_slice(&first);
    let kept = training.fill_space(39, &Cancel::default()).unwrap();
    let alike = kept.iter().filter(|&&pose| pose == 0 || pose == 5).count();
    assert_eq!((kept.len(), alike), (39, 1), "of two poses that are the same one is enough");
    assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
    assert_eq!(training.fill_space(100, &Cancel::default()).unwrap().len(), 40);
    training.values = first.repeat(40);
    assert!(
        training.fill_space(30, &Cancel::default()).unwrap().windows(2).all(|pair| pair[0] < pair[1]),
        "no pose stands twice"
    );
}
