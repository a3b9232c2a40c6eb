//! Cells of an axis: their grades, and the kernel that they imply.

use std::f64::consts::TAU;

use proptest::prelude::*;
use truearm_bank::{Axis, CellKernel, Input, MOST_ACTIVE, Shape};

fn closed(degree: usize) -> Axis {
    Axis::covering(Input::ANGLE, (0..400).map(|k| f64::from(k) * 0.0157), 0.3, 0.15, degree)
}

fn open(degree: usize) -> Axis {
    Axis::covering(Input::ANGLE, (0..50).map(|k| 2.9 + f64::from(k) * 0.02), 0.2, 0.1, degree)
}

proptest! {
    #[test]
    fn grades_add_up_to_one(value in -20.0..20.0f64) {
        for degree in [2, 3] {
            let sum: f64 = closed(degree).active(value).grade.iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_turn_more_excites_the_same_cells(value in 2.9..3.9f64, turns in -3i32..3) {
        for axis in [open(2), open(3), closed(2)] {
            let (a, b) = (axis.active(value), axis.active(value + TAU * f64::from(turns)));
            prop_assert_eq!(a.cell, b.cell);
            for k in 0..MOST_ACTIVE {
                prop_assert!((a.grade[k] - b.grade[k]).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn implied_kernel_is_close_to_the_kernel(a in 0.0..6.2f64, b in 0.0..6.2f64) {
        let cells = CellKernel::new(closed(2), |d| Shape::SquaredExponential.at(d, 0.3));
        let implied = cells.implied(&cells.axis.active(a), &cells.axis.active(b));
        let exact = Shape::SquaredExponential.at(Input::ANGLE.distance(a, b), 0.3);
        prop_assert!((implied - exact).abs() < 0.06, "{implied} {exact}");
    }
}

#[test]
fn prior_variance_goes_on_where_there_are_no_cells() {
    for degree in [2, 3] {
        let cells = CellKernel::new(open(degree), |d| Shape::Matern.at(d, 0.2));
        let inside = cells.axis.active(3.4);
        assert!((cells.variance(3.4) - cells.implied(&inside, &inside)).abs() < 1e-12);
        let outside = 3.4 + 10.0 * cells.axis.spacing - TAU;
        assert!((cells.variance(outside) - cells.variance(3.4)).abs() < 1e-9);
    }
}

#[test]
fn open_axes_hold_no_cells_where_there_is_no_data() {
    let axis = open(2);
    assert!(!axis.closed);
    assert_eq!(axis.active(0.5).grade, [0.0; MOST_ACTIVE]);
}

#[test]
fn spread_is_the_product_with_the_correlation_matrix() {
    let cells = CellKernel::new(open(2), |d| Shape::Matern.at(d, 0.2));
    let (count, inner) = (cells.axis.count, 2);
    let values: Vec<f64> = (0..count * inner).map(|k| (k as f64).sin()).collect();
    let spread = cells.spread(&values, inner);
    let expected: f64 = (0..count).map(|j| cells.correlation[j.abs_diff(3)] * values[j * inner + 1]).sum();
    assert!((spread[3 * inner + 1] - expected).abs() < 1e-12);
}
