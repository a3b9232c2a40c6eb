//! Rigid motions: group axioms, and the exponential with its inverse.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::f64::consts::PI;

use crate::common::{assert_close, mixed};
use proptest::prelude::*;
use truearm_kinematics::{Convention, Parameters, Transform, rotation_exp, rotation_log};

fn vector(size: f64) -> impl Strategy<Value = [f64; 3]> {
    [-size..size, -size..size, -size..size]
}

fn transform() -> impl Strategy<Value = Transform> {
    (vector(4.0), vector(2.0)).prop_map(|(w, t)| Transform::from_rotation_vector(w, t))
}

fn length(w: [f64; 3]) -> f64 {
    w.iter().map(|x| x * x).sum::<f64>().sqrt()
}

proptest! {
    #[test]
    fn exponentials_are_rotations(w in vector(10.0)) {
        let t = Transform::from_rotation_vector(w, [0.0; 3]);
        prop_assert!(t.check("t").is_ok());
        assert_close(&t.compose(&t.inverse()).to_matrix(), &Transform::IDENTITY.to_matrix(), 1e-14);
    }

    #[test]
    fn composition_is_associative_and_acts_on_points(
        a in transform(), b in transform(), c in transform(), p in vector(3.0)
    ) {
        assert_close(&a.compose(&b).compose(&c).to_matrix(), &a.compose(&b.compose(&c)).to_matrix(), 1e-13);
        assert_close(&a.compose(&b).apply(p), &a.apply(b.apply(p)), 1e-13);
        assert_close(&a.inverse().apply(a.apply(p)), &p, 1e-13);
    }

    #[test]
    fn logarithm_undoes_the_exponential(w in vector(1.0), angle in 0.0..PI) {
        prop_assume!(length(w) > 1e-3);
        let w = w.map(|x| x * angle / length(w));
        assert_close(&rotation_log(&rotation_exp(w)), &w, 1e-13);
    }

    #[test]
    fn matrices_go_there_and_back(t in transform()) {
        prop_assert_eq!(Transform::from_matrix(&t.to_matrix()), t);
    }

    #[test]
    fn poses_are_rigid_and_move_with_the_base(
        q in prop::collection::vec(-3.0..3.0f64, 6), base in transform()
    ) {
        for convention in [Convention::Standard, Convention::Modified] {
            let chain = mixed(convention);
            let moved = chain.with_base(base.compose(chain.base())).unwrap();
            let (mut here, mut there) = ([0.0; 16], [0.0; 16]);
            chain.poses(&q, Parameters::One(&chain.nominal()), &mut here).unwrap();
            moved.poses(&q, Parameters::One(&chain.nominal()), &mut there).unwrap();
            let here = Transform::from_matrix(&here);
            prop_assert!(here.check("pose").is_ok());
            assert_close(&there, &base.compose(&here).to_matrix(), 1e-13);
        }
    }
}

#[test]
fn small_angles_and_half_turns_keep_their_digits() {
    for size in [1e-300, 1e-20, 1e-9, 1e-8, 1e-4, 3.0, PI - 1e-4, PI - 1e-8, PI - 1e-12] {
        for axis in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [-2.0, 1.0, 2.0]] {
            let unit = axis.map(|x| x / length(axis));
            let found = rotation_log(&rotation_exp(unit.map(|x| x * size)));
            assert_close(&found.map(|x| x / size), &unit, 1e-14);
        }
    }
}

#[test]
fn half_a_turn_has_a_rotation_vector_of_length_pi() {
    for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.6, 0.8]] {
        let vector = rotation_log(&rotation_exp(axis.map(|x| x * PI)));
        assert!((length(vector) - PI).abs() < 1e-15 * 4.0);
        let along: f64 = (0..3).map(|i| vector[i] * axis[i]).sum();
        assert!((along.abs() - PI).abs() < 1e-14);
    }
}
