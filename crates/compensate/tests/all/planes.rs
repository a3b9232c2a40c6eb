//! Arms that cannot leave a plane, whose real axes are off parallel by a little.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::f64::consts::FRAC_PI_2;

use crate::common::{Scene, chain, correct, readings, unbounded};
use truearm_compensate::{Inverse, Limits, Options, Reason, Solved, Task};
use truearm_kinematics::{Chain, Convention, Joint, Parameters, Transform};

const MET: f64 = 1e-9;
const WAYPOINTS: usize = 200;
/// Errors of the arms, m and rad.
const SIZE: f64 = 1e-3;

fn arms() -> Vec<(&'static str, Chain)> {
    let turns = |lengths: &[f64]| -> Vec<(Joint, [f64; 5])> {
        lengths.iter().map(|length| (Joint::Revolute, [0.1, 0.02, *length, 0.0, 0.0])).collect()
    };
    let slide = (Joint::Prismatic, [0.0, 0.1, 0.2, FRAC_PI_2, 0.0]);
    let on_a_rail: Vec<_> = [slide].into_iter().chain(turns(&[0.4, 0.3])).collect();
    let standard = |rows: &[(Joint, [f64; 5])]| chain(Convention::Standard, rows);
    vec![
        ("two axes", standard(&turns(&[0.4, 0.3]))),
        ("three axes", standard(&turns(&[0.4, 0.3, 0.2]))),
        ("four axes", standard(&turns(&[0.4, 0.3, 0.2, 0.2]))),
        ("seven axes", standard(&turns(&[0.3, 0.3, 0.2, 0.2, 0.2, 0.1, 0.1]))),
        ("modified", chain(Convention::Modified, &turns(&[0.4, 0.3, 0.2]))),
        ("a rail", standard(&on_a_rail)),
    ]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Direction of the last axis of the nominal arm, base frame.
fn normal(chain: &Chain) -> [f64; 3] {
    let count = chain.joint_count();
    let mut motions = vec![0.0; 6 * count];
    chain.joint_pose_jacobian(&vec![0.2; count], Parameters::One(&chain.nominal()), &mut motions).unwrap();
    std::array::from_fn(|k| motions[(4 + k) * count - 1])
}

/// How far two places are apart along a direction and across it.
fn apart_by(from: &Transform, to: &Transform, direction: [f64; 3]) -> (f64, f64) {
    let way: [f64; 3] = std::array::from_fn(|k| to.translation[k] - from.translation[k]);
    let along = dot(way, direction);
    let across: [f64; 3] = std::array::from_fn(|k| way[k] - along * direction[k]);
    (along.abs(), dot(across, across).sqrt())
}

#[test]
fn positions_are_met_in_the_plane_and_no_joint_turns_far_for_what_is_off_it() {
    for (name, chain) in arms() {
        for task in [Task::Pose, Task::Position] {
            let scene = Scene::new(chain.clone(), SIZE);
            let (q, count, normal) = (readings(&chain, WAYPOINTS, 2), chain.joint_count(), normal(&chain));
            let found = correct(&scene.corrector(Options { task, moving: None, limits: unbounded() }), &q, 1);
            assert!(found.refused.len() < WAYPOINTS / 10, "{name}: {} refused", found.refused.len());
            let mut farthest = 0.0_f64;
            for (i, (from, to)) in q.chunks_exact(count).zip(found.readings.chunks_exact(count)).enumerate() {
                if to[0].is_nan() {
                    continue;
                }
                let (meant, real) = (scene.meant(from)[0], scene.real(to)[0]);
                let (off, within) = apart_by(&meant, &real, normal);
                assert!(within < MET, "{name}, waypoint {i}: {within:e}");
                assert!((found.numbers[i][0] - off).abs() < MET, "{name}, waypoint {i}: {off:e}");
                farthest = farthest.max(off);
            }
            let turned = |row: usize| {
                let pair = q[row * count..].iter().zip(&found.readings[row * count..]).take(count);
                pair.map(|(from, to)| (to - from).abs()).fold(0.0, f64::max)
            };
            let mut turns: Vec<f64> = (0..WAYPOINTS).map(turned).filter(|turn| turn.is_finite()).collect();
            turns.sort_by(f64::total_cmp);
            assert!(turns[turns.len() / 2] < 10.0 * SIZE, "{name}: {:e}", turns[turns.len() / 2]);
            assert!(farthest > 0.1 * SIZE, "{name}: nothing was off the plane");
        }
    }
}

#[test]
fn the_turn_in_the_plane_is_met_where_there_are_joints_for_it() {
    for (name, chain) in arms().into_iter().filter(|(_, chain)| chain.joint_count() > 2) {
        let scene = Scene::new(chain.clone(), SIZE);
        let (q, count, normal) = (readings(&chain, WAYPOINTS, 3), chain.joint_count(), normal(&chain));
        let found = correct(&scene.corrector(Options { limits: unbounded(), ..Options::default() }), &q, 1);
        let mut left = Vec::new();
        for (from, to) in q.chunks_exact(count).zip(found.readings.chunks_exact(count)) {
            if to[0].is_finite() {
                let (meant, real) = (scene.meant(from)[0], scene.real(to)[0]);
                let turn = Transform { translation: [0.0; 3], ..meant }.inverse().compose(&real);
                left.push(
                    dot(Transform { translation: [0.0; 3], ..meant }.rotate(turn.rotation_vector()), normal)
                        .abs(),
                );
            }
        }
        left.sort_by(f64::total_cmp);
        let median = left[left.len() / 2];
        assert!(median < 1e-2 * SIZE, "{name}: {median:e}");
    }
}

#[test]
fn readings_are_found_for_poses_beside_the_plane() {
    for (name, chain) in arms() {
        let scene = Scene::new(chain.clone(), SIZE);
        let (q, count, normal) = (readings(&chain, WAYPOINTS, 4), chain.joint_count(), normal(&chain));
        let meant = scene.meant(&q);
        let poses: Vec<f64> = meant.iter().flat_map(Transform::to_matrix).collect();
        let options = Options { limits: unbounded(), ..Options::default() };
        let inverse = Inverse::new(scene.calibrated(), &crate::common::tool(), options).unwrap();
        let (mut found, mut residuals) = (vec![0.0; q.len()], vec![0.0; 2 * WAYPOINTS]);
        let out = Solved { readings: &mut found, residuals: &mut residuals };
        let refused = inverse.each(&poses, &q, &[], out, &truearm_compensate::Run::default()).unwrap();
        assert!(refused.len() < WAYPOINTS / 10, "{name}: {} refused", refused.len());
        for (i, to) in found.chunks_exact(count).enumerate().filter(|(_, to)| to[0].is_finite()) {
            let (off, within) = apart_by(&meant[i], &scene.real(to)[0], normal);
            assert!(within < MET && (residuals[2 * i] - off).abs() < MET, "{name}, pose {i}: {within:e}");
        }
    }
}

#[test]
fn what_is_off_the_plane_by_more_than_a_shift_may_be_is_refused() {
    let (_, chain) = arms().swap_remove(1);
    let scene = Scene::new(chain.clone(), SIZE);
    let limits = Limits { largest_shift: 1e-7, ..unbounded() };
    let found =
        correct(&scene.corrector(Options { limits, ..Options::default() }), &readings(&chain, 20, 2), 1);
    assert!(found.refused.len() > 15);
    assert!(found.refused.iter().all(|(_, refusal)| refusal.reason == Reason::PositionNotReached));
}

#[test]
fn an_arm_that_slides_along_its_axes_meets_the_whole_position() {
    let revolute = |a: f64| (Joint::Revolute, [0.0, 0.1, a, 0.0, 0.0]);
    let slide = (Joint::Prismatic, [0.0, 0.0, 0.0, 0.0, 0.0]);
    let scara = chain(Convention::Standard, &[revolute(0.35), revolute(0.25), slide, revolute(0.05)]);
    let scene = Scene::new(scara.clone(), SIZE);
    let q = readings(&scara, WAYPOINTS, 2);
    let found = correct(&scene.corrector(Options { limits: unbounded(), ..Options::default() }), &q, 1);
    for (from, to) in
        q.chunks_exact(4).zip(found.readings.chunks_exact(4)).filter(|(_, to)| to[0].is_finite())
    {
        let (off, within) = apart_by(&scene.meant(from)[0], &scene.real(to)[0], normal(&scara));
        assert!(off < MET && within < MET, "{off:e} {within:e}");
    }
    assert!(found.refused.len() < WAYPOINTS / 10);
}
