//! What a chain refuses, and what it says of itself.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{link, mixed, six_axis};
use truearm_kinematics::{Chain, Convention, InstructionSet, Joint, KinematicsError, Link, Transform};

fn make(links: Vec<Link>, base: Transform) -> Result<Chain, KinematicsError> {
    Chain::new(Convention::Standard, links, base, Transform::IDENTITY)
}

#[test]
fn counts_and_parameters() {
    let chain = mixed(Convention::Standard);
    assert_eq!((chain.link_count(), chain.joint_count(), chain.parameter_count()), (9, 6, 45));
    assert_eq!(chain.joint_columns(), [5, 10, 16, 20, 30, 36]);
    let nominal = chain.nominal();
    for (link, row) in chain.links().iter().zip(nominal.chunks(5)) {
        assert_eq!([link.theta, link.d, link.a, link.alpha, link.beta], row);
    }
}

#[test]
fn impossible_chains_are_refused() {
    assert_eq!(make(vec![], Transform::IDENTITY), Err(KinematicsError::NoLinks));
    let fixed = link(Joint::Fixed, [0.0; 5]);
    assert_eq!(make(vec![fixed; 2], Transform::IDENTITY), Err(KinematicsError::NoJoints { links: 2 }));
    let turning = link(Joint::Revolute, [0.0; 5]);
    let broken = Link { alpha: f64::INFINITY, ..turning };
    let wanted = KinematicsError::LinkNotFinite { link: 1, name: "alpha", value: f64::INFINITY };
    assert_eq!(make(vec![turning, broken], Transform::IDENTITY), Err(wanted));
}

#[test]
fn transforms_that_are_not_rigid_are_refused() {
    let turning = vec![link(Joint::Revolute, [0.0; 5])];
    let scaled = Transform { rotation: [2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0], ..Transform::IDENTITY };
    let mirrored =
        Transform { rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0], ..Transform::IDENTITY };
    let nowhere = Transform { translation: [0.0, f64::NAN, 0.0], ..Transform::IDENTITY };
    for base in [scaled, mirrored, nowhere] {
        assert!(matches!(make(turning.clone(), base), Err(KinematicsError::NotRigid { name: "base", .. })));
        assert!(matches!(six_axis().with_end(base), Err(KinematicsError::NotRigid { name: "end", .. })));
    }
}

#[test]
fn another_end_or_base_changes_nothing_else() {
    let chain = mixed(Convention::Modified);
    let other = Transform::from_rotation_vector([0.1, 0.2, 0.3], [1.0, 2.0, 3.0]);
    let (moved_end, moved_base) = (chain.with_end(other).unwrap(), chain.with_base(other).unwrap());
    assert_eq!((moved_end.end(), moved_end.base()), (&other, chain.base()));
    assert_eq!((moved_base.end(), moved_base.base()), (chain.end(), &other));
    assert_eq!(moved_end.links(), chain.links());
    assert_eq!(moved_base.convention(), chain.convention());
}

#[test]
fn a_lower_instruction_set_is_a_lower_one() {
    let [baseline, avx2, avx512] = InstructionSet::ALL;
    assert!(baseline < avx2 && avx2 < avx512);
    assert!(InstructionSet::ALL.contains(&InstructionSet::detected()));
}

#[test]
fn with_up_heights_are_along_up() {
    for chain in [six_axis(), mixed(Convention::Modified)] {
        let q = crate::common::spread(chain.joint_count(), 3);
        let before = crate::common::reference(&chain, &q, &chain.nominal()).translation;
        for up in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.4, -0.2, -0.7]] {
            let turned = chain.with_up(up).unwrap();
            let after = crate::common::reference(&turned, &q, &chain.nominal()).translation;
            let length = up.iter().map(|part| part * part).sum::<f64>().sqrt();
            let height: f64 = up.iter().zip(before).map(|(a, b)| a * b / length).sum();
            assert!((after[2] - height).abs() < 1e-12, "{up:?}: {} is not {height}", after[2]);
        }
    }
    for none in [[0.0; 3], [0.0, f64::NAN, 1.0]] {
        assert!(matches!(six_axis().with_up(none), Err(KinematicsError::NoDirection { .. })));
    }
}
