//! Factors of large matrices: in parts, and with requests to stop.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::ops::Range;

use faer::{Mat, Par};
use truearm_estimate::{EstimateError, dense::Cholesky};
use truearm_kinematics::{Cancel, Cancelled};

/// A positive definite matrix whose rows differ.
fn matrix(n: usize) -> Mat<f64> {
    Mat::from_fn(n, n, |i, j| {
        let apart = i.abs_diff(j) as f64;
        (-0.02 * apart).exp() * (0.3 * apart).cos() + if i == j { 0.5 + 1e-3 * (i % 7) as f64 } else { 0.0 }
    })
}

/// The largest entry.
fn largest(matrix: &Mat<f64>) -> f64 {
    (0..matrix.ncols())
        .flat_map(|j| (0..matrix.nrows()).map(move |i| matrix[(i, j)].abs()))
        .fold(0.0, f64::max)
}

#[test]
fn a_large_matrix_has_the_factor_of_one_that_is_factored_at_once() {
    for n in [2048, 2049, 2400] {
        let at_once = Cholesky::new(matrix(n), Par::Seq).unwrap();
        let parts = Cholesky::heeding(matrix(n), Par::rayon(2), &Cancel::default()).unwrap().unwrap();
        assert!(largest(&(at_once.lower() - parts.lower())) < 1e-13, "{n} rows");
    }
}

#[test]
fn a_large_matrix_that_is_not_positive_definite_has_no_factor() {
    for place in [0, 1000, 2399] {
        let mut singular = matrix(2400);
        singular[(place, place)] = -1.0;
        assert!(Cholesky::heeding(singular, Par::Seq, &Cancel::default()).unwrap().is_none(), "row {place}");
    }
}

#[test]
fn blocks_of_the_inverse_are_those_of_the_whole() {
    let n = 700;
    let factor = Cholesky::new(matrix(n), Par::Seq).unwrap();
    let whole = factor.inverse();
    let sizes = [3, 0, 6, 1, 300, 3];
    let mut ranges: Vec<Range<usize>> = Vec::new();
    while ranges.last().is_none_or(|range| range.end < n) {
        let start = ranges.last().map_or(0, |range| range.end);
        ranges.push(start..(start + sizes[ranges.len() % sizes.len()]).min(n));
    }
    let blocks = factor.inverse_blocks(&ranges, &Cancel::default()).unwrap();
    assert_eq!(blocks.len(), ranges.len());
    for (range, block) in ranges.iter().zip(&blocks) {
        let wanted = Mat::from_fn(range.len(), range.len(), |i, j| whole[(range.start + i, range.start + j)]);
        assert!(largest(&(wanted - block)) < 1e-12, "{range:?}");
    }
}

#[test]
fn a_request_to_stop_is_heeded() {
    let cancel = Cancel::default();
    let factor = Cholesky::heeding(matrix(30), Par::Seq, &cancel).unwrap().unwrap();
    cancel.request();
    let stopped = Cholesky::heeding(matrix(30), Par::Seq, &cancel);
    assert!(matches!(stopped, Err(EstimateError::Cancelled(Cancelled))));
    let stopped = factor.inverse_blocks(&[0..3, 3..6], &cancel);
    assert!(matches!(stopped, Err(EstimateError::Cancelled(Cancelled))));
}
