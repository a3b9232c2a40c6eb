//! Data space and weight space against the dense computation with the kernels that their cells imply.

use truearm_kinematics::Cancel;

use super::common::Random;
use super::oracle::{OfCells, Oracle, dot, squared};
use super::sets::{by_readings, line_inputs, loaded, long, poses_in_two_groups, positions};
use crate::data_space::{DataSpace, LeftOut};
use crate::model::Model;
use crate::posterior::{LeaveOneOut, Posterior, Solution};
use crate::training::Training;
use crate::weight_space::WeightSpace;

fn data_space(training: &Training, joints: usize, degree: usize) -> Posterior {
    let model = Model::new(training.clone(), long(training, joints), degree);
    Posterior::Data(Box::new(DataSpace::new(model, &Cancel::default()).unwrap()))
}

fn weight_space(training: &Training, joints: usize, degree: usize) -> Posterior {
    let model = Model::new(training.clone(), long(training, joints), degree);
    Posterior::Weight(Box::new(WeightSpace::new(model, &Cancel::default()).unwrap()))
}

pub fn spaces(training: &Training, joints: usize) -> [Posterior; 2] {
    [data_space(training, joints, 2), weight_space(training, joints, 2)]
}

/// The sets with their number of joints: positions; poses, groups, own sigma and weight; prismatic joint and feature; a payload;
/// curves that go with readings.
pub fn sets() -> [(Training, usize); 5] {
    [
        (positions(22), 6),
        (poses_in_two_groups(18), 6),
        (line_inputs(16), 4),
        (loaded(18), 6),
        (by_readings(18), 6),
    ]
}

pub fn close(found: &[f64], wanted: &[f64], share: f64, what: &str) {
    let size = wanted.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    assert_eq!(found.len(), wanted.len());
    for (k, (a, b)) in found.iter().zip(wanted).enumerate() {
        assert!((a - b).abs() <= share * size, "{what}, entry {k}: {a} instead of {b} (largest {size})");
    }
}

/// What the field adds to each column of the problem at a configuration, (P,).
fn varying(solution: &Solution, training: &Training, values: &[f64]) -> Vec<f64> {
    let mut ceps = vec![0.0; training.parameter_count];
    solution.bank.add(values, &mut ceps).unwrap();
    training.columns[..training.column_count()].iter().map(|column| ceps[column.parameter]).collect()
}

/// The same of what each column has: angles have a part of what their drives have.
fn together(training: &Training, of_columns: &[f64]) -> Vec<f64> {
    let (own, of_drives) = of_columns.split_at(training.column_count());
    let mut sums = own.to_vec();
    for (drive, value) in training.in_use().iter().zip(of_drives) {
        training.parts(drive).iter().for_each(|&(p, by)| sums[p] += by * value);
    }
    sums
}

/// Rows (m, P) of a Jacobian with the problem's columns alone.
pub fn own_columns(training: &Training, jacobian: &[f64]) -> Vec<f64> {
    let rows = jacobian.chunks_exact(training.columns.len());
    rows.flat_map(|row| &row[..training.column_count()]).copied().collect()
}

/// Joints and features of a training pose, (I,).
fn inputs_of(training: &Training, pose: usize) -> &[f64] {
    &training.values_of(pose)[..training.input_count()]
}

/// Joints and features of configurations among the data, and of one beyond it.
pub fn queries(training: &Training) -> Vec<Vec<f64>> {
    let mut random = Random::new(3);
    let mut inside = |_| {
        let (a, b) = (inputs_of(training, 1), inputs_of(training, 2));
        let share = random.unit();
        a.iter().zip(b).map(|(x, y)| x + share * (y - x)).collect::<Vec<f64>>()
    };
    let mut all: Vec<Vec<f64>> = (0..4).map(&mut inside).collect();
    all.push(inputs_of(training, 0).iter().map(|x| x + 0.4).collect());
    all
}

#[test]
fn solution_is_that_of_the_covariance_written_out() {
    for (training, joints) in sets() {
        for degree in [2, 3] {
            let spaces = [
                (data_space(&training, joints, degree), 1e-5),
                (weight_space(&training, joints, degree), 2e-3),
            ];
            for (posterior, share) in spaces {
                let model = posterior.model();
                let oracle = Oracle::new(&training, &model.hyper, OfCells(model));
                let solution = posterior.solve(&training.residual).unwrap();
                for values in queries(&training) {
                    let (constant, setup, field) =
                        oracle.solution(&training.residual, &training.with_own_inputs(&values));
                    close(&solution.constant, &constant, share, "constants");
                    close(&solution.setup, &setup, share, "set-up");
                    let field = together(&training, &field);
                    close(&varying(&solution, &training, &values), &field, share, "field");
                }
            }
        }
    }
}

#[test]
fn covariance_is_that_of_the_covariance_written_out() {
    for (training, joints) in sets() {
        for (posterior, share) in spaces(&training, joints).iter().zip([1e-5, 2e-3]) {
            let model = posterior.model();
            let oracle = Oracle::new(&training, &model.hyper, OfCells(model));
            let rows = training.rows(1);
            let (columns, width) = (training.columns.len(), training.setup_width);
            let jacobian = &training.jacobian[rows.start * columns..rows.end * columns];
            let setup = &training.setup[rows.start * width..rows.end * width];
            for values in queries(&training) {
                for (given, own) in [(Some(setup), setup.to_vec()), (None, vec![0.0; setup.len()])] {
                    let asked = own_columns(&training, jacobian);
                    let found = posterior.covariance(&values, &asked, given, rows.len()).unwrap();
                    let wanted = oracle.posterior(&training.with_own_inputs(&values), jacobian, &own);
                    let m = rows.len();
                    let wanted: Vec<f64> = (0..m * m).map(|k| wanted[(k / m, k % m)]).collect();
                    close(&found, &wanted, share, "covariance");
                }
            }
        }
    }
}

#[test]
fn constants_are_known_as_by_the_covariance_written_out() {
    for (training, joints) in sets() {
        for (posterior, share) in spaces(&training, joints).iter().zip([1e-5, 2e-3]) {
            let model = posterior.model();
            let oracle = Oracle::new(&training, &model.hyper, OfCells(model));
            let wanted = oracle.constants();
            let (count, all) = (training.column_count(), training.columns.len());
            let wanted: Vec<f64> = (0..count * count).map(|k| wanted[k / count * all + k % count]).collect();
            close(&posterior.constants(), &wanted, share, "covariance of constants");
        }
    }
}

/// The same prior, cells included, on fewer poses.
pub fn space_without(model: &Model, pose: usize) -> Posterior {
    let kept: Vec<usize> = (0..model.training.pose_count()).filter(|&other| other != pose).collect();
    let training = model.training.select(&kept);
    let by_column = crate::pairs::ByColumn::new(&training);
    let model = Model { training, by_column, hyper: model.hyper.clone(), cells: model.cells.clone() };
    Posterior::Data(Box::new(DataSpace::new(model, &Cancel::default()).unwrap()))
}

/// Residual of a pose that took no part, and its standardised square at full weight.
fn refitted(posterior: &Posterior, pose: usize) -> (Vec<f64>, f64) {
    let (model, training) = (posterior.model(), posterior.training());
    let fewer = space_without(model, pose);
    let solution = fewer.solve(&fewer.training().residual).unwrap();
    let field = varying(&solution, training, inputs_of(training, pose));
    let ceps: Vec<f64> = field.iter().zip(&solution.constant).map(|(a, b)| a + b).collect();
    let rows = training.rows(pose);
    let (columns, width) = (training.columns.len(), training.setup_width);
    let jacobian = &training.jacobian[rows.start * columns..rows.end * columns];
    let setup = &training.setup[rows.start * width..rows.end * width];
    let left = |(k, row): (usize, usize)| {
        training.residual[row]
            - dot(training.jacobian_row(row), &ceps)
            - dot(&setup[k * width..(k + 1) * width], &solution.setup)
    };
    let residual: Vec<f64> = rows.clone().enumerate().map(left).collect();
    let asked = own_columns(training, jacobian);
    let known = fewer.covariance(inputs_of(training, pose), &asked, Some(setup), rows.len()).unwrap();
    let anew = fewer.repeatability(&asked, rows.len()).unwrap();
    let covariance = faer::Mat::from_fn(rows.len(), rows.len(), |i, j| {
        let row = rows.start + i;
        let noise = training.noise_variance(row, model.hyper.noise) * training.weight[row];
        known[i * rows.len() + j] + anew[i * rows.len() + j] + if i == j { noise } else { 0.0 }
    });
    let square = squared(covariance, &residual);
    (residual, square)
}

fn squares(left_out: &LeaveOneOut, training: &Training, pose: usize) -> f64 {
    left_out.standardised[training.rows(pose)].iter().map(|z| z * z).sum()
}

#[test]
fn leaving_one_out_is_refitting_without_it() {
    for (training, joints) in sets() {
        for (posterior, share) in spaces(&training, joints).iter().zip([1e-6, 2e-3]) {
            let left_out = posterior.leave_one_out(&training.residual).unwrap();
            assert!(left_out.sampled.iter().all(|sampled| *sampled));
            for pose in (0..training.pose_count()).filter(|&pose| !training.rows(pose).is_empty()).step_by(3)
            {
                let (residual, square) = refitted(posterior, pose);
                close(&left_out.residual[training.rows(pose)], &residual, share, "residual");
                close(&[squares(&left_out, &training, pose)], &[square], share, "standardised square");
            }
        }
    }
}

#[test]
fn leaving_blocks_out_is_refitting_without_them() {
    let training = positions(24);
    let model = Model::new(training.clone(), long(&training, 6), 2);
    let space = DataSpace::new(model, &Cancel::default()).unwrap();
    let alone: Vec<Vec<usize>> = (0..3).map(|pose| vec![pose]).collect();
    let each = space.leave_blocks_out(&training.residual, &alone).unwrap();
    let left_out = space.leave_one_out(&training.residual).unwrap();
    let each: Vec<LeftOut> = each.into_iter().flatten().collect();
    let found: Vec<f64> = each.iter().map(|row| row.residual).collect();
    close(&found, &left_out.residual[..9], 1e-9, "blocks of one");
    let together = &space.leave_blocks_out(&training.residual, &[vec![0, 1, 2]]).unwrap()[0];
    let pair =
        |k: usize| together[k].known >= each[k].known * (1.0 - 1e-9) && together[k].noise == each[k].noise;
    assert!((0..9).all(pair), "what is left out together is known less: {together:?} {each:?}");
}

#[test]
fn other_weights_are_a_new_start() {
    let training = poses_in_two_groups(18);
    let mut reweighted = training.clone();
    for pose in [2, 5, 6] {
        reweighted.weight[training.rows(pose)].fill(1e-3);
    }
    for (posterior, anew) in spaces(&training, 6).into_iter().zip(spaces(&reweighted, 6)) {
        let changed = posterior.reweighed(&reweighted, &Cancel::default()).unwrap();
        assert_eq!(changed.training().weight, reweighted.weight);
        let (a, b) = (changed.solve(&training.residual).unwrap(), anew.solve(&training.residual).unwrap());
        close(&a.constant, &b.constant, 1e-6, "constants");
        close(&a.setup, &b.setup, 1e-6, "set-up");
        let values = training.values_of(3);
        close(&varying(&a, &training, values), &varying(&b, &training, values), 1e-6, "field");
    }
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let training = positions(12);
    for posterior in spaces(&training, 6) {
        let jacobian = vec![0.0; 3 * training.columns.len()];
        assert!(posterior.covariance(&[0.0; 7], &jacobian, None, 3).is_err());
        assert!(posterior.covariance(&[0.0; 6], &jacobian[1..], None, 3).is_err());
        assert!(posterior.covariance(&[0.0; 6], &jacobian, Some(&[0.0]), 3).is_err());
    }
}
