//! Choice of poses: the criteria, the exchange against all subsets, and what is refused.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::stream::Stream;
use truearm_estimate::{
    Choice, ChoiceOptions, Criterion, EstimateError, Observability, PoseRows, choose_poses, observability_of,
};
use truearm_kinematics::{Cancel, Cancelled};

const COLUMNS: [usize; 5] = [0, 1, 2, 3, 4];
const ALL: [Criterion; 7] = [
    Criterion::Condition,
    Criterion::Determinant,
    Criterion::O1,
    Criterion::O2,
    Criterion::O3,
    Criterion::O4,
    Criterion::O5,
];

/// Jacobians (count, rows, 5) of no arm in particular, some of them much larger than others.
fn jacobians(count: usize, rows: usize, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed);
    (0..count)
        .flat_map(|_| {
            let size = 1.0 + stream.within(0.8);
            (0..5 * rows).map(|_| size * stream.normal()).collect::<Vec<_>>()
        })
        .collect()
}

fn options(count: usize, criterion: Criterion) -> ChoiceOptions<'static> {
    ChoiceOptions {
        count,
        criterion,
        columns: &COLUMNS,
        given: &[],
        start: None,
        limit: None,
        passes: 20,
        cancel: Cancel::default(),
    }
}

fn value(criterion: Criterion, found: &Observability) -> f64 {
    match criterion {
        Criterion::Condition | Criterion::O2 => found.o2,
        Criterion::Determinant => found.log_determinant,
        Criterion::O1 => found.o1,
        Criterion::O3 => found.o3,
        Criterion::O4 => found.o4,
        Criterion::O5 => found.o5,
    }
}

fn of(jacobian: &[f64], rows: usize, chosen: &[usize]) -> Observability {
    let width = 5 * rows;
    let part: Vec<f64> =
        chosen.iter().flat_map(|&k| &jacobian[k * width..(k + 1) * width]).copied().collect();
    observability_of(&part, PoseRows::new(rows, 1), &COLUMNS).unwrap()
}

/// The best value of all choices of three.
fn best_of_three(jacobian: &[f64], criterion: Criterion, count: usize) -> f64 {
    let mut best = f64::NEG_INFINITY;
    for a in 0..count {
        for b in a + 1..count {
            for c in b + 1..count {
                best = best.max(value(criterion, &of(jacobian, 3, &[a, b, c])));
            }
        }
    }
    best
}

#[test]
fn exchange_comes_near_the_best_of_all_subsets() {
    for criterion in ALL {
        let mut shares = Vec::new();
        for seed in 1..7 {
            let jacobian = jacobians(14, 3, seed);
            let choice = choose_poses(&jacobian, 3, &options(3, criterion)).unwrap();
            let best = best_of_three(&jacobian, criterion, 14);
            let found = value(criterion, &choice.after);
            assert!(found <= best + 1e-9);
            shares.push(if criterion == Criterion::Determinant {
                (found - best).exp()
            } else {
                found / best
            });
        }
        shares.sort_by(f64::total_cmp);
        assert!(shares[0] > 0.7 && shares[3] > 0.9, "{criterion:?}: {shares:?}");
    }
}

#[test]
fn every_criterion_is_served_best_by_its_own_choice() {
    for rows in [3, 6] {
        let jacobian = jacobians(60, rows, 3);
        let choices: Vec<Choice> =
            ALL.iter().map(|&by| choose_poses(&jacobian, rows, &options(8, by)).unwrap()).collect();
        for (criterion, choice) in ALL.iter().zip(&choices) {
            let own = value(*criterion, &choice.after);
            assert!(own > value(*criterion, &choice.before), "{criterion:?} gained nothing");
            for other in &choices {
                assert!(own > 0.9 * value(*criterion, &other.after), "{criterion:?} rows {rows}");
            }
        }
    }
}

#[test]
fn reported_indices_are_those_of_the_chosen_rows() {
    let jacobian = jacobians(40, 3, 5);
    let choice = choose_poses(&jacobian, 3, &options(6, Criterion::O4)).unwrap();
    assert_eq!(choice.after, of(&jacobian, 3, &choice.chosen));
    assert!(choice.chosen.windows(2).all(|pair| pair[0] < pair[1]));
    assert!((choice.after.kappa_normal / choice.after.kappa.powi(2) - 1.0).abs() < 1e-12);
}

#[test]
fn indices_of_a_diagonal_matrix_are_known() {
    // Columns of two lengths in metres per metre and an angle, which counts at 0.3 m.
    let jacobian = [3.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.3];
    let found = observability_of(&jacobian, PoseRows::new(3, 1), &[1, 2, 3]).unwrap();
    let expected = [3.0, 6.0_f64.cbrt(), 1.0 / 3.0, 1.0, 1.0 / 3.0, 6.0 / 11.0, 2.0 * 6.0_f64.ln()];
    let got = [found.kappa, found.o1, found.o2, found.o3, found.o4, found.o5, found.log_determinant];
    crate::common::assert_close(&got, &expected, 1e-12);
}

#[test]
fn what_is_measured_anyway_is_not_chosen_again() {
    let mut jacobian = vec![0.0; 4 * 15];
    // Candidates 0 and 1 see the first three columns, 2 and 3 the last two.
    for pose in 0..4 {
        for row in 0..3 {
            let column = if pose < 2 { row } else { 3 + row % 2 };
            jacobian[pose * 15 + row * 5 + column] = 1.0 + 0.1 * pose as f64;
        }
    }
    let given = jacobian[..15].to_vec();
    let how = ChoiceOptions { given: &given, ..options(1, Criterion::Determinant) };
    let choice = choose_poses(&jacobian, 3, &how).unwrap();
    assert!(choice.chosen == [2] || choice.chosen == [3], "{:?}", choice.chosen);
    assert!(choice.well_conditioned);
}

#[test]
fn a_pool_that_leaves_a_parameter_open_is_not_well_conditioned() {
    let mut jacobian = jacobians(20, 3, 8);
    jacobian.chunks_exact_mut(5).for_each(|row| row[4] = row[3]);
    let choice = choose_poses(&jacobian, 3, &options(6, Criterion::Condition)).unwrap();
    assert!(!choice.well_conditioned && choice.after.kappa > 1e6);
    let how = ChoiceOptions { limit: Some(1.0), ..options(6, Criterion::Condition) };
    assert!(!choose_poses(&jacobians(20, 3, 8), 3, &how).unwrap().well_conditioned);
}

#[test]
fn a_start_is_exchanged_from() {
    let jacobian = jacobians(30, 3, 2);
    let start = [0, 1, 2, 3];
    let how = ChoiceOptions { start: Some(&start), ..options(4, Criterion::Determinant) };
    let choice = choose_poses(&jacobian, 3, &how).unwrap();
    assert_eq!(choice.before, of(&jacobian, 3, &start));
    assert!(choice.after.log_determinant > choice.before.log_determinant && choice.exchanges > 0);
}

#[test]
fn bad_input_is_refused_with_its_value() {
    let jacobian = jacobians(10, 3, 1);
    let message = |result: Result<Choice, EstimateError>| result.unwrap_err().to_string();
    assert!(message(choose_poses(&jacobian, 3, &options(11, Criterion::O1))).contains("11"));
    assert!(message(choose_poses(&jacobian, 0, &options(2, Criterion::O1))).contains("number of rows"));
    assert!(message(choose_poses(&jacobian[1..], 3, &options(2, Criterion::O1))).contains("149 values"));
    let mut broken = jacobian.clone();
    broken[17] = f64::NAN;
    assert!(message(choose_poses(&broken, 3, &options(2, Criterion::O1))).contains("pose 1"));
    for start in [[0, 0], [0, 10]] {
        let how = ChoiceOptions { start: Some(&start), ..options(2, Criterion::O1) };
        assert!(message(choose_poses(&jacobian, 3, &how)).contains("start from"));
    }
    let cancel = Cancel::default();
    cancel.request();
    let how = ChoiceOptions { cancel, ..options(2, Criterion::O1) };
    assert_eq!(choose_poses(&jacobian, 3, &how).unwrap_err(), EstimateError::Cancelled(Cancelled));
}
