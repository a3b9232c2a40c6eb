//! Kernels against their formulas, and their derivatives against finite differences.

use truearm_bank::{Input, Shape, Value};
use truearm_kinematics::{Isa, Kernel, Lane, dispatch};

struct Of(Shape, f64, f64);

impl Kernel for Of {
    type Output = Value;

    #[inline(always)]
    fn run<I: Isa>(self) -> Value {
        let Self(shape, distance, length) = self;
        shape.of::<I>(Lane::splat(distance), length)
    }
}

#[test]
fn derivatives_match_finite_differences() {
    for shape in [Shape::SquaredExponential, Shape::Matern] {
        for distance in [0.0, 1e-4, 0.03, 0.7, 2.0] {
            let (length, step) = (0.37_f64, 1e-6_f64);
            let difference = (shape.at(distance, length * step.exp())
                - shape.at(distance, length * (-step).exp()))
                / (2.0 * step);
            let value = dispatch(Of(shape, distance, length));
            assert!((difference - value.by_log_length.0[7]).abs() < 1e-8);
        }
    }
}

#[test]
fn kernels_match_their_formulas() {
    for distance in [0.0_f64, 1e-4, 0.03, 0.7, 2.0] {
        let length = 0.37;
        let s = (10.0 * distance).sqrt() / length;
        let pairs = [
            (Shape::SquaredExponential, (-distance / (length * length)).exp()),
            (Shape::Matern, (1.0 + s + s * s / 3.0) * (-s).exp()),
        ];
        for (shape, expected) in pairs {
            assert!((shape.at(distance, length) / expected - 1.0).abs() < 1e-14, "{shape:?} {distance}");
        }
    }
}

#[test]
fn a_turn_more_changes_nothing() {
    let turn = std::f64::consts::TAU;
    assert!((Input::ANGLE.distance(0.3, 0.1) - Input::ANGLE.distance(0.3 + turn, 0.1)).abs() < 1e-14);
}

#[test]
fn short_distances_are_half_squares() {
    let line = Input::line(2.0);
    assert!((line.distance(0.5, 0.4) - 0.5 * (0.1 * line.scale).powi(2)).abs() < 1e-15);
    assert!((Input::ANGLE.distance(0.5, 0.4999) - 0.5e-8).abs() < 1e-15);
}
