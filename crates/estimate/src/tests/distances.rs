//! Derivatives of distances against differences of the residuals.

use crate::common::arms::{all_columns, seven_axis, ur10, with_ends};
use crate::common::assert_close;
use crate::common::differences::differences;
use crate::common::scene::{Plan, Scene};
use crate::distance::derivatives;
use crate::layout::Layout;
use crate::packets::Packets;
use crate::pass::normal_equations;
use crate::{ConstantOptions, Noise, Prior, Robust, Sigma, fit_constant};

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
    scene.set.sigma[3] = Sigma::of_position(2e-3);
    let mut weight = vec![1.0; scene.set.pose_count()];
    (weight[2], weight[5]) = (0.0, 0.3);
    let (problem, point) = (scene.problem(), scene.point());
    let noise = Noise { position: 1e-3, orientation: 1.0 };
    let packets = Packets::new(&scene.set);
    let normal = normal_equations(&problem, &packets, point, Some((noise, &weight))).unwrap();
    let (rows, width) = (derivatives(&problem, point).unwrap(), Layout::new(&problem).len());
    let variance = |pose: usize| noise.position.powi(2) + scene.set.sigma[pose].of_length().powi(2);
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

/// Noise of a fit to distances of which the last third, wrong by `bias` m, is left out.
fn noise_beside(bias: f64, robust: Robust) -> Noise {
    let chain = ur10();
    let plan = Plan { poses: vec![120], ..Plan::new(chain.clone(), all_columns(&chain), 0) };
    let mut scene = plan.make().with_distances(&ANCHORS, 1e-4);
    scene.set.weight[80..].fill(0.0);
    scene.set.distances.iter_mut().filter(|d| d.pose >= 80).for_each(|d| d.value += bias);
    let options = ConstantOptions {
        prior: Some(Prior::default()),
        robust: Some(robust),
        start: Some(scene.setup.clone()),
        ..ConstantOptions::default()
    };
    fit_constant(&scene.problem(), &options).unwrap().noise
}

#[test]
fn distances_that_are_left_out_say_nothing_of_the_noise() {
    for robust in [Robust::None, Robust::Huber, Robust::Cauchy] {
        let noise = noise_beside(0.0, robust);
        assert_eq!(noise, noise_beside(0.05, robust));
        assert!((0.5e-4..2e-4).contains(&noise.position), "{robust:?}: {noise:?}");
    }
}
