//! The rank of the paper's table, which counts the base row and no set-up.

use faer::{Mat, MatRef};

use crate::common::arms::{PARALLEL, PLAIN, RV_M2_SPANS, columns, rv_m2, rv_m2_fifteen};
use crate::common::scene::Plan;
use crate::identifiability::in_order;
use crate::rows::linearise;
use crate::setup::FrameMode;

const EVERY: [usize; 5] = [0, 1, 2, 3, 4];

/// Columns of the tool's position at joints four and five zero, in mm; the paper's tool has no unknown of its own.
fn paper(columns: &[usize]) -> Mat<f64> {
    let plan = Plan {
        frame: FrameMode::World,
        spans: RV_M2_SPANS.to_vec(),
        tool: 0.0,
        errors: 0.0,
        ..Plan::new(rv_m2(), columns.to_vec(), 200)
    };
    let scene = plan.make();
    let rows = linearise(&scene.problem(), scene.point()).unwrap().arm;
    let width = columns.len();
    let unit = |k: usize| if matches!(columns[k] % 5, 1 | 2) { 1e3 } else { 1e3 / 300.0 };
    Mat::from_fn(rows.len() / width, width, |i, k| rows[i * width + k] * unit(k))
}

fn determined(matrix: MatRef<f64>, columns: &[usize]) -> Vec<usize> {
    in_order(matrix, 0).determined.into_iter().map(|k| columns[k]).collect()
}

/// Base, three links and the tool: the twenty-five that the paper starts from.
fn twenty_five() -> Vec<usize> {
    let mut all = columns(&[EVERY.as_slice(); 4]);
    all.extend(30..35);
    all
}

#[test]
fn fifteen_of_the_paper_s_twenty_five() {
    let all = twenty_five();
    assert_eq!(determined(paper(&all).as_ref(), &all).len(), 15);
}

#[test]
fn exactly_the_paper_s_where_beta_stands_in_place_of_d_between_anti_parallel_axes() {
    let mut offered = columns(&[&PARALLEL, &PLAIN, &PARALLEL, &PLAIN]);
    offered.extend(30..35);
    assert_eq!(determined(paper(&offered).as_ref(), &offered), rv_m2_fifteen());
}

#[test]
fn in_plain_order_the_first_of_two_confounded_lengths_is_kept() {
    let all = twenty_five();
    let found = determined(paper(&all).as_ref(), &all);
    assert!(found.contains(&1) && !rv_m2_fifteen().contains(&1), "d of the base");
    assert!(!found.contains(&16) && rv_m2_fifteen().contains(&16), "d of link 3");
}

#[test]
fn a_column_that_repeats_another_is_named_with_its_factor() {
    let column = |k: usize, i: usize| match k {
        0 => (i as f64).sin(),
        1 => (2.0 * i as f64).cos(),
        2 => -3.0 * (i as f64).sin() + 0.5 * (2.0 * i as f64).cos(),
        _ => 0.0,
    };
    let answer = in_order(Mat::from_fn(30, 4, |i, k| column(k, i)).as_ref(), 1);
    assert_eq!((answer.determined, answer.total_rank), (vec![0], 2));
    let [spanned, empty] = &answer.undetermined[..] else { panic!("two are undetermined") };
    assert_eq!((spanned.column, spanned.with_setup, spanned.with.len()), (1, true, 1));
    assert!(spanned.with[0].0 == 0 && (spanned.with[0].1 - 0.5).abs() < 1e-12);
    assert_eq!((empty.column, empty.with_setup, empty.with.len()), (2, false, 0));
}
