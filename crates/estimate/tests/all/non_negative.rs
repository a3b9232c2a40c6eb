//! Least squares whose unknowns are not negative: the conditions that only the best of them meets.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use proptest::prelude::*;
use truearm_estimate::{EstimateError, non_negative_least_squares};

/// Columns times what is left of the target, (n,).
fn gains(columns: &[f64], target: &[f64], found: &[f64]) -> Vec<f64> {
    let count = found.len();
    let left: Vec<f64> = columns
        .chunks_exact(count)
        .zip(target)
        .map(|(row, wanted)| wanted - row.iter().zip(found).map(|(c, x)| c * x).sum::<f64>())
        .collect();
    (0..count).map(|k| left.iter().enumerate().map(|(i, left)| columns[i * count + k] * left).sum()).collect()
}

proptest! {
    /// Karush, Kuhn and Tucker: no unknown is negative, none at zero would gain by growing, none above by changing.
    #[test]
    fn nothing_is_nearer(
        (count, values, target) in (2_usize..9, 1_usize..9).prop_flat_map(|(rows, count)| (
            Just(count),
            prop::collection::vec(-1.0..1.0, rows * count),
            prop::collection::vec(-1.0..1.0, rows),
        )),
        twice in any::<bool>(),
    ) {
        // The first column again behind the others.
        let again = |row: &[f64]| row.iter().chain(&row[..usize::from(twice)]).copied().collect::<Vec<f64>>();
        let columns = values.chunks_exact(count).flat_map(again).collect::<Vec<f64>>();
        let found = non_negative_least_squares(&columns, count + usize::from(twice), &target).unwrap();
        prop_assert!(found.iter().all(|x| *x >= 0.0), "{found:?}");
        for (x, gain) in found.iter().zip(gains(&columns, &target, &found)) {
            prop_assert!(gain < 1e-6, "{found:?}, {gain}");
            prop_assert!(*x == 0.0 || gain.abs() < 1e-6, "{found:?}, {gain}");
        }
    }

    #[test]
    fn known_ones_are_found(
        columns in prop::collection::vec(-1.0..1.0, 40),
        wanted in prop::collection::vec(prop_oneof![Just(0.0), 0.1..5.0], 4),
    ) {
        let target: Vec<f64> = columns.chunks_exact(4).map(|row| row.iter().zip(&wanted).map(|(c, x)| c * x).sum()).collect();
        let found = non_negative_least_squares(&columns, 4, &target).unwrap();
        for (x, to) in found.iter().zip(&wanted) {
            prop_assert!((x - to).abs() < 1e-6, "{found:?}, {wanted:?}");
        }
    }
}

#[test]
fn columns_of_nothing_and_targets_of_nothing_are_left_at_zero() {
    let columns = [0.0, 1.0, 0.0, 2.0, 0.0, 3.0];
    assert_eq!(non_negative_least_squares(&columns, 2, &[0.0; 3]).unwrap(), [0.0, 0.0]);
    let found = non_negative_least_squares(&columns, 2, &[2.0, 4.0, 6.0]).unwrap();
    assert!(found[0] == 0.0 && (found[1] - 2.0).abs() < 1e-12, "{found:?}");
    assert!(non_negative_least_squares(&[], 0, &[1.0; 3]).unwrap().is_empty());
}

#[test]
fn columns_of_other_rows_are_refused() {
    let refused = non_negative_least_squares(&[1.0, 2.0], 1, &[1.0; 3]);
    let told = EstimateError::Length { what: "the matrix of columns", found: 2, expected: 3 };
    assert_eq!(refused, Err(told));
}

#[test]
fn what_is_not_finite_is_refused() {
    for (column, target) in [([1.0, f64::NAN], [1.0; 2]), ([1.0; 2], [1.0, f64::INFINITY])] {
        let refused = non_negative_least_squares(&column, 1, &target);
        assert!(matches!(refused, Err(EstimateError::NotFinite { pose: 1, .. })), "{refused:?}");
    }
}

#[test]
fn columns_that_are_rounding_beside_others_stay_at_zero() {
    let found = non_negative_least_squares(&[1.0, 0.0, 0.0, 1e-9], 2, &[2.0, 1.0]).unwrap();
    assert_eq!(found, [2.0, 0.0]);
    let found = non_negative_least_squares(&[1.0, 0.0, 0.0, 1e-6], 2, &[2.0, 1.0]).unwrap();
    assert!((found[1] - 1e6).abs() < 1.0, "{found:?}");
}
