//! Normal equations from the lanes against the sum over explicit rows.

use faer::{Mat, MatRef, Par};

use crate::common::arms::{all_columns, scara, ur10, with_ends};
use crate::common::differences::dense;
use crate::common::scene::{Plan, Scene};
use crate::dense::Cholesky;
use crate::device_axes::own_covariance;
use crate::layout::Layout;
use crate::packets::Packets;
use crate::pass::{Normal, normal_equations};
use crate::rows::linearise;
use crate::{Noise, Point, Sigma};

const NOISE: Noise = Noise { position: 0.5, orientation: 0.2 };

/// A scene whose points are far from the predictions, with missing rows, own sigmas and weights.
fn scene(plan: &Plan) -> Scene {
    let mut scene = plan.make();
    let n = scene.set.pose_count();
    for pose in 0..n {
        scene.set.sigma[pose] = Sigma::of_position(0.1 * (pose % 4) as f64);
        scene.set.weight[pose] = [1.0, 0.5, 0.0, 0.9, 1.0][pose % 5];
        if pose % 7 == 6 {
            let at = 3 * pose * scene.set.target_count;
            scene.set.targets[at..at + 3].fill(f64::NAN);
        }
        if pose % 6 == 4 && scene.set.has_rotations() {
            scene.set.rotations[9 * pose..9 * pose + 9].fill(f64::NAN);
        }
    }
    scene
}

fn explicit(scene: &Scene, point: Point) -> Normal {
    let (problem, set) = (scene.problem(), &scene.set);
    let rows = linearise(&problem, point).unwrap();
    let (width, jacobian) = (Layout::new(&problem).len(), dense(&problem, &rows));
    let mut normal = Normal::zeros(width);
    for (row, line) in jacobian.chunks_exact(width).enumerate() {
        let (pose, part) = (row / rows.rows, row % rows.rows);
        let position = NOISE.position.powi(2) + set.sigma[pose].of_length().powi(2);
        let variance = if part < 3 * set.target_count { position } else { NOISE.orientation.powi(2) };
        let root = (set.weight[pose] / variance).sqrt();
        let entries: Vec<_> = line.iter().enumerate().map(|(k, value)| (k, root * value)).collect();
        normal.add_row(&entries, root * rows.residual[row]);
    }
    normal
}

#[track_caller]
fn assert_same(plan: &Plan) {
    let scene = scene(plan);
    let nominal = scene.chain.nominal();
    let point = Point { parameters: &nominal, setup: &scene.setup };
    let packets = Packets::new(&scene.set);
    let weighting = Some((NOISE, &scene.set.weight[..]));
    let found = normal_equations(&scene.problem(), &packets, point, weighting).unwrap();
    let wanted = explicit(&scene, point);
    let scale = wanted.matrix.norm_max();
    assert!((&found.matrix - &wanted.matrix).norm_max() <= 1e-13 * scale);
    assert!((found.squares - wanted.squares).abs() <= 1e-12 * wanted.squares);
    let right = found.right.iter().zip(&wanted.right).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(right <= 1e-12 * scale, "{right}");
}

fn plan(poses: Vec<usize>) -> Plan {
    let chain = with_ends(&ur10());
    Plan { errors: 0.1, poses, ..Plan::new(chain.clone(), all_columns(&chain), 0) }
}

#[test]
fn any_number_of_poses_fills_the_lanes() {
    for n in 1..=20 {
        assert_same(&plan(vec![n]));
    }
}

#[test]
fn more_poses_than_one_chunk() {
    for n in [127, 128, 129, 300] {
        assert_same(&plan(vec![n]));
    }
}

#[test]
fn several_groups_targets_and_orientations() {
    for poses in [vec![3, 8, 5], vec![1, 130, 9]] {
        assert_same(&Plan { targets: 2, rotations: true, ..plan(poses) });
    }
}

#[test]
fn groups_in_mixed_order() {
    let mut scene = scene(&Plan { rotations: true, ..plan(vec![20]) });
    scene.set.group = (0..20).map(|pose| pose % 2).collect();
    scene.set.group_count = 2;
    scene.setup.groups.push(scene.setup.groups[0].clone());
    scene.setup.groups[1].targets[0] = [0.1, 0.2, 0.3];
    let packets = Packets::new(&scene.set);
    let weighting = Some((NOISE, &scene.set.weight[..]));
    let found = normal_equations(&scene.problem(), &packets, scene.point(), weighting).unwrap();
    let wanted = explicit(&scene, scene.point());
    assert!((&found.matrix - &wanted.matrix).norm_max() <= 1e-13 * wanted.matrix.norm_max());
}

#[test]
fn sigmas_that_differ_by_axis_count_as_covariances_in_the_base() {
    let mut scene = scene(&Plan { targets: 2, rotations: true, ..plan(vec![3, 8, 5]) });
    for pose in 0..16 {
        let position = [0.1, 0.2 * (pose % 2) as f64, 0.4 * (pose % 3) as f64];
        scene.set.sigma[pose] = Sigma { position, orientation: 0.1 * (pose % 2) as f64 };
    }
    let (problem, point) = (scene.problem(), scene.point());
    let rows = linearise(&problem, point).unwrap();
    let (width, jacobian) = (Layout::new(&problem).len(), dense(&problem, &rows));
    let mut wanted = Mat::<f64>::zeros(width, width);
    for pose in 0..16 {
        let own = own_covariance(&scene.set, &scene.setup, pose);
        let turned = NOISE.orientation.powi(2) + scene.set.sigma[pose].orientation.powi(2);
        for first in (0..rows.rows).step_by(3) {
            let covariance = Mat::from_fn(3, 3, |i, j| match (first < 6, i == j) {
                (true, same) => own[i][j] + if same { NOISE.position.powi(2) } else { 0.0 },
                (false, same) => {
                    if same {
                        turned
                    } else {
                        0.0
                    }
                }
            });
            let precision = Cholesky::new(covariance, Par::Seq).unwrap().inverse();
            let at = (pose * rows.rows + first) * width;
            let part = MatRef::from_row_major_slice(&jacobian[at..at + 3 * width], 3, width);
            wanted += part.transpose() * &precision * part * faer::Scale(scene.set.weight[pose]);
        }
    }
    let weighting = Some((NOISE, &scene.set.weight[..]));
    let found = normal_equations(&problem, &Packets::new(&scene.set), point, weighting).unwrap();
    assert!((&found.matrix - &wanted).norm_max() <= 1e-12 * wanted.norm_max());
}

#[test]
fn prismatic_joints_and_no_arm_columns() {
    let chain = scara();
    assert_same(&Plan { rotations: true, ..Plan::new(chain.clone(), all_columns(&chain), 13) });
    assert_same(&Plan { columns: vec![], ..plan(vec![13]) });
}
