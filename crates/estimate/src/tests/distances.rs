//! Derivatives of distances against differences of the residuals.

use crate::Noise;
use crate::common::arms::{all_columns, seven_axis, ur10, with_ends};
use crate::common::assert_close;
use crate::common::differences::differences;
use crate::common::scene::{Plan, Scene};
use crate::distance::derivatives;
use crate::layout::Layout;
use crate::packets::Packets;
use crate::pass::normal_equations;

const ANCHORS: [[f64; 3]; 2] = [[1.5, 0.2, -0.4], [-0.3, 1.8, 0.9]];

fn scene(anchors: &[[f64; 3]]) -> Scene {
    let chain = with_ends(&if anchors.is_empty() { seven_axis() } else { ur10() });
    let plan = Plan { errors: 0.02, poses: vec![9, 6], ..Plan::new(chain.clone(), all_columns(&chain), 0) };
    plan.make().with_distances(anchors, 0.01)
}

#[test]
fn derivatives_to_anchors_and_between_poses_are_the_differences() {
    for anchors in [&ANCHORS[..], &[]] {
        let scene = scene(anchors);
        let analytic = derivatives(&scene.problem(), scene.point()).unwrap();
        assert_close(&analytic, &differences(&scene.problem(), scene.point()), 1e-8);
    }
}

#[test]
fn normal_equations_are_the_sum_over_weighted_rows() {
    let mut scene = scene(&ANCHORS);
    scene.set.sigma[3] = 2e-3;
    let mut weight = vec![1.0; scene.set.pose_count()];
    (weight[2], weight[5]) = (0.0, 0.3);
    let (problem, point) = (scene.problem(), scene.point());
    let noise = Noise { position: 1e-3, orientation: 1.0 };
    let packets = Packets::new(&scene.set);
    let normal = normal_equations(&problem, &packets, point, Some((noise, &weight))).unwrap();
    let (rows, width) = (derivatives(&problem, point).unwrap(), Layout::new(&problem).len());
    let variance = |pose: usize| noise.position.powi(2) + scene.set.sigma[pose].powi(2);
    let weights: Vec<f64> = scene.set.distances.iter().map(|d| weight[d.pose] / variance(d.pose)).collect();
    let tolerance = 1e-13 * normal.matrix.norm_max();
    for i in 0..width {
        for j in 0..width {
            let terms =
                weights.iter().enumerate().map(|(r, w)| w * rows[r * width + i] * rows[r * width + j]);
            let sum: f64 = terms.sum();
            assert!((normal.matrix[(i, j)] - sum).abs() <= tolerance, "{i} {j}");
        }
    }
}
