use super::{GAUSSIAN, inputs, made, network};
use crate::cmac::{Composition, LinearRows, NetworkOptions, Rate, TrainingEnd, TrainingOptions};

const LENGTHS: [usize; 2] = [1, 2];

fn options(rate: Rate, epochs: usize) -> TrainingOptions {
    TrainingOptions { rate, tolerance: 1e-9, epochs, ..TrainingOptions::default() }
}

/// A smooth CEP of millimetres at inputs of two.
fn smooth(s: &[f64]) -> Vec<f64> {
    s.chunks_exact(2).flat_map(|x| [1e-3 * (x[0] + x[1]).sin(), 1e-3 * x[0] * x[1]]).collect()
}

#[test]
fn one_update_is_rule_a5() {
    let network = network(&[6, 7], 3, 2, GAUSSIAN);
    let (s, wanted) = ([0.3, 0.9, 0.4, 0.8], [1e-3, -2e-3, 3e-3, 0.0]);
    let trained = network.train((&s, &wanted), &LENGTHS, &options(Rate::Printed(0.5), 1)).unwrap();
    let mut weights = [2e-3, -1e-3].repeat(42);
    let (cells, grades) = network.active(&s).unwrap();
    for pattern in 0..2 {
        let (cells, grades) = (&cells[pattern * 9..][..9], &grades[pattern * 9..][..9]);
        for output in 0..2 {
            let at = |cell: &u64| *cell as usize * 2 + output;
            let sum: f64 = cells.iter().zip(grades).map(|(cell, grade)| grade * weights[at(cell)]).sum();
            let difference = wanted[pattern * 2 + output] - sum / grades.iter().sum::<f64>();
            cells.iter().zip(grades).for_each(|(cell, grade)| weights[at(cell)] += 0.5 * grade * difference);
        }
    }
    for (found, expected) in trained.network.weights().iter().zip(&weights) {
        assert!((found - expected).abs() < 1e-17);
    }
}

#[test]
fn a_projected_update_meets_its_pattern() {
    let network = network(&[6, 7], 3, 2, GAUSSIAN);
    let wanted = [1e-3, -2e-3];
    let start = network.with_weights(&(0..84).map(|k| f64::from(k) * 1e-4).collect::<Vec<_>>()).unwrap();
    let rows = LinearRows {
        inputs: &[0.1, 0.2],
        jacobian: &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        residual: &[1e-3, -2e-3, 0.0],
        columns: &LENGTHS,
        targets: 1,
    };
    let trained = start.train_on_rows(&rows, &options(Rate::Projected(1.0), 2)).unwrap();
    let mut out = [0.0; 2];
    trained.network.output(&[0.1, 0.2], &mut out).unwrap();
    assert!((out[0] - wanted[0]).abs() < 1e-12 && (out[1] - wanted[1]).abs() < 1e-12);
    assert_eq!(trained.end, TrainingEnd::Converged);
}

#[test]
fn training_converges_to_the_tolerance_it_reports() {
    let network = network(&[12, 12], 3, 2, GAUSSIAN);
    let s = inputs(60, 2);
    let how = TrainingOptions { tolerance: 1e-6, ..options(Rate::Printed(1.0), 5000) };
    let trained = network.train((&s, &smooth(&s)), &LENGTHS, &how).unwrap();
    assert_eq!(trained.end, TrainingEnd::Converged, "{} left after {}", trained.largest, trained.epochs);
    let mut out = vec![0.0; 120];
    trained.network.output(&s, &mut out).unwrap();
    let left = out.iter().zip(smooth(&s)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(left <= 1e-6 && (left - trained.largest).abs() < 1e-15 && trained.rms <= left);
}

#[test]
fn what_is_within_the_tolerance_has_converged_whatever_ended_training() {
    let network = network(&[12, 12], 3, 2, GAUSSIAN);
    let s = inputs(60, 2);
    let trained = |tolerance: f64| {
        let how = TrainingOptions { tolerance, ..options(Rate::Printed(1.0), 40) };
        network.train((&s, &smooth(&s)), &LENGTHS, &how).unwrap()
    };
    let cut = trained(1e-9);
    assert_eq!((cut.end, cut.epochs), (TrainingEnd::EpochLimit, 40));
    let met = trained(cut.largest);
    assert_eq!((met.end, met.epochs, met.largest), (TrainingEnd::Converged, 40, cut.largest));
}

#[test]
fn contradictions_stall_and_the_limit_of_epochs_is_said() {
    let network = network(&[6, 6], 3, 2, GAUSSIAN);
    let (s, wanted) = ([0.5, 0.5, 0.5, 0.5], [1e-3, 0.0, -1e-3, 0.0]);
    let trained = network.train((&s, &wanted), &LENGTHS, &options(Rate::Printed(0.5), 5000)).unwrap();
    assert_eq!(trained.end, TrainingEnd::Stalled);
    assert!(trained.epochs < 100 && trained.largest > 5e-4);
    let s = inputs(60, 2);
    let cut = network.train((&s, &smooth(&s)), &LENGTHS, &options(Rate::Printed(0.5), 3)).unwrap();
    assert_eq!((cut.end, cut.epochs), (TrainingEnd::EpochLimit, 3));
    assert!(cut.end.to_string().contains("not converged"));
}

#[test]
fn angles_count_at_the_length_of_an_arm() {
    let network = network(&[6, 6], 3, 2, GAUSSIAN);
    let (s, wanted) = ([0.5, 0.5, 0.5, 0.5], [1e-3, 0.0, -1e-3, 0.0]);
    let how = options(Rate::Projected(1e-6), 1);
    let of = |columns: &[usize]| network.train((&s, &wanted), columns, &how).unwrap().largest;
    assert!((of(&[0, 2]) / of(&[1, 2]) - 0.3).abs() < 1e-6);
}

#[test]
fn measurements_train_to_the_ceps_that_they_determine() {
    // Two rows a pose that see both CEPs, and a third of nothing.
    let network = network(&[10, 10], 3, 2, GAUSSIAN);
    let s = inputs(60, 2);
    let (mut jacobian, mut residual) = (Vec::new(), Vec::new());
    for (pose, ceps) in smooth(&s).chunks_exact(2).enumerate() {
        let (sine, cosine) = (pose as f64).sin_cos();
        for row in [[cosine, sine], [-sine, cosine], [0.0, 0.0]] {
            jacobian.extend(row);
            residual.push(row[0] * ceps[0] + row[1] * ceps[1]);
        }
    }
    let rows =
        LinearRows { inputs: &s, jacobian: &jacobian, residual: &residual, columns: &LENGTHS, targets: 1 };
    let how = TrainingOptions { tolerance: 1e-5, ..options(Rate::Printed(1.0), 3000) };
    let trained = network.train_on_rows(&rows, &how).unwrap();
    let mut out = vec![0.0; 120];
    trained.network.output(&s, &mut out).unwrap();
    let left = out.iter().zip(smooth(&s)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(trained.end == TrainingEnd::Converged && left < 2e-5, "{left} {:?}", trained.end);
}

#[test]
fn a_hash_table_without_collisions_is_as_good_as_a_dense_one() {
    let dense = NetworkOptions { membership: GAUSSIAN, composition: Composition::Min, hashed: None };
    let s = inputs(20, 2);
    let how = options(Rate::Printed(0.5), 50);
    let train = |hashed| {
        let network = made(&[9, 9], 3, 2, NetworkOptions { hashed, ..dense });
        network.train((&s, &smooth(&s)), &LENGTHS, &how).unwrap()
    };
    let (plain, roomy, tight) = (train(None), train(Some(1 << 22)), train(Some(20)));
    assert_eq!((plain.collisions, roomy.collisions), (0, 0));
    assert!(tight.collisions > 20 && tight.excited == plain.excited && plain.excited <= 81);
    let mut out = [vec![0.0; 40], vec![0.0; 40]];
    plain.network.output(&s, &mut out[0]).unwrap();
    roomy.network.output(&s, &mut out[1]).unwrap();
    assert_eq!(out[0], out[1]);
}

#[test]
fn bad_training_is_refused() {
    let network = network(&[6, 6], 3, 2, GAUSSIAN);
    let s = [0.5, 0.5];
    let message = |ceps: &[f64], columns: &[usize], how: &TrainingOptions| {
        network.train((&s, ceps), columns, how).map(|_| ()).unwrap_err().to_string()
    };
    let fine = TrainingOptions::default();
    assert!(message(&[0.0], &LENGTHS, &fine).contains("wanted CEPs has 1 values where 2"));
    assert!(message(&[0.0, f64::NAN], &LENGTHS, &fine).contains("wanted CEP is not finite"));
    assert!(message(&[0.0; 2], &[1], &fine).contains("driven parameters"));
    let how = TrainingOptions { rate: Rate::Printed(2.0), ..TrainingOptions::default() };
    assert!(message(&[0.0; 2], &LENGTHS, &how).contains("learning rate is 2"));
    let how = TrainingOptions { tolerance: f64::NAN, ..TrainingOptions::default() };
    assert!(message(&[0.0; 2], &LENGTHS, &how).contains("tolerance"));
    let how = TrainingOptions::default();
    how.cancel.request();
    assert!(message(&[0.0; 2], &LENGTHS, &how).contains("stopped on request"));
}
