//! Tasks that ask for less than a pose, arms that have more or fewer joints, readings that are coupled.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::f64::consts::PI;

use crate::common::{Scene, apart, correct, five_axis, readings, seven_axis, six_axis, unbounded};
use truearm_compensate::{Options, Task};
use truearm_kinematics::Transform;

const MET: f64 = 1e-9;
const WAYPOINTS: usize = 200;

/// How far two poses are apart in what a task asks for.
type Measure<'a> = &'a dyn Fn(&Transform, &Transform) -> f64;

/// Runs a task over random waypoints and shows each accepted one: index, program's readings and corrected ones.
fn accepted(scene: &Scene, options: Options, check: impl Fn(usize, &[f64], &[f64])) {
    let (q, n) = (readings(&scene.chain, WAYPOINTS, 2), scene.chain.joint_count());
    let found = correct(&scene.corrector(options), &q, 1);
    let refused = &found.refused;
    assert!(refused.len() < WAYPOINTS / 10, "{} refused: {:?}", refused.len(), refused.first());
    for (i, (from, to)) in q.chunks_exact(n).zip(found.readings.chunks_exact(n)).enumerate() {
        if to[0].is_finite() {
            check(i, from, to);
        }
    }
}

fn options(task: Task, moving: Option<Vec<usize>>) -> Options {
    Options { task, moving, limits: unbounded() }
}

fn distance(a: &Transform, b: &Transform) -> f64 {
    apart(a, b).0
}

fn axis(pose: &Transform) -> [f64; 3] {
    pose.rotate([0.0, 0.0, 1.0])
}

#[test]
fn axis_leaves_the_turn_about_the_tool_free() {
    let scene = Scene::new(six_axis(), 1e-3);
    accepted(&scene, options(Task::Axis, None), |i, from, to| {
        let (meant, real) = (scene.meant(from)[0], scene.real(to)[0]);
        assert!(distance(&meant, &real) < MET, "waypoint {i}");
        let (a, b) = (axis(&meant), axis(&real));
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < MET), "waypoint {i}: {a:?} {b:?}");
    });
}

#[test]
fn a_turn_about_the_tool_that_is_free_does_not_count() {
    let mut scene = Scene::new(five_axis(), 0.0);
    let offset = 2.0_f64.to_radians();
    scene.constants[0] += offset;
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let turned = |task: Task, q: &[f64]| {
        let corrector = scene.corrector(options(task, None));
        let correction = corrector.correct(q, &[], true, &mut [0.0; 5], &mut corrector.workspace());
        assert!(correction.refusal.is_none(), "{correction:?}");
        correction.turn
    };
    // What the first axis is off is made good by turning about it; what of that is about the tool's axis is free.
    for lean in 0..12 {
        let q = [0.3, 0.6, -1.0, 0.4 + f64::from(lean) * PI / 6.0, 0.2];
        let ([x, y, z], [u, v, w]) = (turned(Task::Pose, &q), axis(&scene.meant(&q)[0]));
        assert!((norm([x, y, z]) / offset - 1.0).abs() < 1e-3);
        let across = norm([y * w - z * v, z * u - x * w, x * v - y * u]);
        assert!((norm(turned(Task::Axis, &q)) - across).abs() < 1e-4 * offset);
    }
}

#[test]
fn five_of_six_joints_meet_the_direction_of_the_tool() {
    let scene = Scene::new(six_axis(), 1e-3);
    accepted(&scene, options(Task::Axis, Some(vec![0, 1, 2, 3, 4])), |i, from, to| {
        let (meant, real) = (scene.meant(from)[0], scene.real(to)[0]);
        let (a, b) = (axis(&meant), axis(&real));
        let tilt = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        assert!(distance(&meant, &real) < MET && tilt < 1e-7, "waypoint {i}: {tilt:e}");
        assert_eq!(from[5], to[5], "waypoint {i}");
    });
}

#[test]
fn position_with_the_first_three_joints() {
    let scene = Scene::new(six_axis(), 1e-3);
    accepted(&scene, options(Task::Position, Some(vec![0, 1, 2])), |i, from, to| {
        assert!(distance(&scene.meant(from)[0], &scene.real(to)[0]) < MET, "waypoint {i}");
        assert_eq!(from[3..], to[3..], "waypoint {i}");
    });
}

#[test]
fn position_with_all_joints_moves_them_least() {
    let scene = Scene::new(six_axis(), 1e-3);
    let change = |from: &[f64], to: &[f64]| from.iter().zip(to).map(|(a, b)| (b - a).powi(2)).sum::<f64>();
    let few = scene.corrector(options(Task::Position, Some(vec![0, 1, 2])));
    let mut workspace = few.workspace();
    let workspace = std::cell::RefCell::new(&mut workspace);
    accepted(&scene, options(Task::Position, None), |i, from, to| {
        assert!(distance(&scene.meant(from)[0], &scene.real(to)[0]) < MET, "waypoint {i}");
        let mut other = vec![0.0; 6];
        few.correct(from, &[], true, &mut other, &mut workspace.borrow_mut());
        if other[0].is_finite() {
            assert!(change(from, to) <= change(from, &other) * (1.0 + 1e-2), "waypoint {i}");
        }
    });
}

#[test]
fn seven_axes_change_least() {
    // The smallest change has no part in the null space of the Jacobian there, so moving on along it costs more.
    let scene = Scene::new(seven_axis(), 3e-4);
    accepted(&scene, options(Task::Pose, None), |i, from, to| {
        let (distance, angle) = apart(&scene.meant(from)[0], &scene.real(to)[0]);
        assert!(distance < MET && angle < MET, "waypoint {i}");
        let null = null_direction(&scene, to);
        let along: f64 = (0..7).map(|k| null[k] * (to[k] - from[k])).sum();
        let change = (0..7).map(|k| (to[k] - from[k]).powi(2)).sum::<f64>().sqrt();
        assert!(along.abs() < 0.05 * change + 1e-9, "waypoint {i}: {along:e} of {change:e}");
    });
}

/// The direction in which seven joints move without the tool, by Gram-Schmidt on the Jacobian's rows.
fn null_direction(scene: &Scene, q: &[f64]) -> Vec<f64> {
    let mut jacobian = vec![0.0; 42];
    let parameters = truearm_kinematics::Parameters::One(&scene.constants);
    scene.chain.joint_pose_jacobian(q, parameters, &mut jacobian).unwrap();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let start: Vec<f64> = crate::common::stream(7, 5);
    for candidate in jacobian.chunks_exact(7).chain([&start[..]]) {
        let mut row = candidate.to_vec();
        for _ in 0..2 {
            for known in &rows {
                let part = dot(&row, known);
                row.iter_mut().zip(known).for_each(|(x, y)| *x -= part * y);
            }
        }
        let length = dot(&row, &row).sqrt();
        rows.push(row.iter().map(|x| x / length).collect());
    }
    rows.pop().unwrap()
}

#[test]
fn five_axes_meet_the_position_and_come_near_the_orientation() {
    let scene = Scene::new(five_axis(), 1e-3);
    let position = scene.corrector(options(Task::Position, None));
    let workspace = std::cell::RefCell::new(position.workspace());
    let tilt = |a: &Transform, b: &Transform| {
        let (a, b) = (axis(a), axis(b));
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
    };
    let turn = |a: &Transform, b: &Transform| apart(a, b).1;
    let measures: [(Task, Measure<'_>); 2] = [(Task::Pose, &turn), (Task::Axis, &tilt)];
    for (task, left) in measures {
        accepted(&scene, options(task, None), |i, from, to| {
            let (meant, real) = (scene.meant(from)[0], scene.real(to)[0]);
            assert!(distance(&meant, &real) < MET, "waypoint {i}: {:e}", distance(&meant, &real));
            let mut other = vec![0.0; 5];
            position.correct(from, &[], true, &mut other, &mut workspace.borrow_mut());
            if other[0].is_finite() {
                let (nearest, careless) = (left(&meant, &real), left(&meant, &scene.real(&other)[0]));
                assert!(nearest <= careless * 1.01 + 1e-6, "waypoint {i}: {nearest:e} beside {careless:e}");
            }
        });
    }
}

#[test]
fn coupled_readings() {
    let mut scene = Scene::new(six_axis(), 1e-3);
    scene.coupling[2 * 6 + 1] = -1.0;
    scene.coupling[5 * 6 + 4] = 0.02;
    scene.coupling[3 * 6 + 3] = -1.0;
    accepted(&scene, options(Task::Pose, None), |i, from, to| {
        let (distance, angle) = apart(&scene.meant(from)[0], &scene.real(to)[0]);
        assert!(distance < MET && angle < MET, "waypoint {i}: {distance:e} {angle:e}");
    });
}
