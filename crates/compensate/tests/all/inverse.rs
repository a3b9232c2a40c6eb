//! Readings for poses, on the branch and turn of the seed.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::f64::consts::PI;

use crate::common::{Scene, apart, readings, seven_axis, six_axis, stream, tool};
use truearm_compensate::{Inverse, Options, Reason, Run, Solved};
use truearm_kinematics::Transform;

fn matrices(poses: &[Transform]) -> Vec<f64> {
    poses.iter().flat_map(Transform::to_matrix).collect()
}

struct Found {
    readings: Vec<f64>,
    refused: Vec<(usize, Reason)>,
}

fn solve(inverse: &Inverse, poses: &[Transform], seeds: &[f64], along: bool) -> Found {
    let mut out = vec![0.0; poses.len() * inverse.joint_count()];
    let mut residuals = vec![0.0; poses.len() * 2];
    let solved = Solved { readings: &mut out, residuals: &mut residuals };
    let work = if along { Inverse::follow } else { Inverse::each };
    let refused = work(inverse, &matrices(poses), seeds, &[], solved, &Run::default()).unwrap();
    Found { refused: refused.into_iter().map(|(place, r)| (place, r.reason)).collect(), readings: out }
}

fn inverse(scene: &Scene) -> Inverse {
    Inverse::new(scene.calibrated(), &tool(), Options::default()).unwrap()
}

#[test]
fn finds_the_readings_that_made_a_pose() {
    let scene = Scene::varying(six_axis(), 1e-3);
    let q: Vec<f64> = readings(&scene.chain, 400, 3);
    let seeds: Vec<f64> = q.iter().zip(stream(q.len(), 9)).map(|(q, x)| q + 0.02 * x).collect();
    let (poses, inverse) = (scene.real(&q), inverse(&scene));
    let found = solve(&inverse, &poses, &seeds, false);
    assert!(found.refused.len() < 20, "{:?}", found.refused);
    let mut same = 0;
    for i in (0..400).filter(|i| found.readings[i * 6].is_finite()) {
        let here = &found.readings[i * 6..i * 6 + 6];
        let (distance, angle) = apart(&poses[i], &scene.real(here)[0]);
        assert!(distance < 1e-9 && angle < 1e-9, "pose {i}");
        same += usize::from(here.iter().zip(&q[i * 6..]).all(|(a, b)| (a - b).abs() < 1e-6));
    }
    assert!(same > 370, "{same} are the readings that made the pose");
}

#[test]
fn far_seeds_are_followed_home() {
    let scene = Scene::new(six_axis(), 1e-3);
    let goal = [0.3, -1.2, 1.4, -0.7, 1.1, 0.2];
    let inverse = inverse(&scene);
    for (seed, x) in [0.5, -0.4, 0.3].into_iter().enumerate() {
        let start: Vec<f64> = goal.iter().zip(stream(6, seed)).map(|(q, y)| q + x * y).collect();
        let found = solve(&inverse, &scene.real(&goal), &start, false);
        assert_eq!(found.refused, []);
        assert!(found.readings.iter().zip(&goal).all(|(a, b)| (a - b).abs() < 1e-9), "{:?}", found.readings);
    }
}

#[test]
fn a_path_keeps_its_turn() {
    // Joint six goes round twice: each solution continues from the one before.
    let scene = Scene::new(six_axis(), 1e-3);
    let start = [0.3, -1.2, 1.4, -0.7, 1.1, -6.0];
    let q: Vec<f64> = (0..120)
        .flat_map(|i| [start[0], start[1], start[2], start[3], start[4], start[5] + 0.1 * f64::from(i)])
        .collect();
    let found = solve(&inverse(&scene), &scene.real(&q), &start, true);
    assert_eq!(found.refused, []);
    assert!(found.readings.iter().zip(&q).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn half_a_turn_is_no_standstill() {
    let scene = Scene::new(seven_axis(), 1e-3);
    let inverse = Inverse::new(scene.calibrated(), &tool(), Options::default()).unwrap();
    for turned in [PI, PI - 1e-3, 3.0] {
        let seeds: Vec<f64> = readings(&scene.chain, 16, 3).iter().map(|x| 0.4 * x).collect();
        let mut goals = seeds.clone();
        goals.iter_mut().skip(6).step_by(7).for_each(|q| *q += turned);
        let poses = scene.real(&goals);
        let found = solve(&inverse, &poses, &seeds, false);
        assert_eq!(found.refused, [], "{turned} rad");
        for (pose, real) in poses.iter().zip(scene.real(&found.readings)) {
            let (distance, angle) = apart(pose, &real);
            assert!(distance < 1e-8 && angle < 1e-7, "{distance} m, {angle} rad");
        }
    }
}

#[test]
fn what_cannot_be_reached_is_refused() {
    let scene = Scene::new(six_axis(), 1e-3);
    let mut pose = scene.real(&[0.3, -1.2, 1.4, -0.7, 1.1, 0.2])[0];
    pose.translation[0] += 5.0;
    let found = solve(&inverse(&scene), &[pose], &[0.0; 6], true);
    assert!(matches!(found.refused[..], [(0, Reason::PositionNotReached)]), "{:?}", found.refused);
    assert!(found.readings.iter().all(|value| value.is_nan()));
}

#[test]
fn a_pose_that_is_none_is_refused() {
    let scene = Scene::new(six_axis(), 1e-3);
    let (mut out, mut residuals) = (vec![0.0; 6], vec![0.0; 2]);
    let solved = Solved { readings: &mut out, residuals: &mut residuals };
    let error = inverse(&scene).each(&[1.0; 16], &[0.0; 6], &[], solved, &Run::default()).unwrap_err();
    assert!(error.to_string().contains("the target pose's transform is not rigid"), "{error}");
}
