//! What the tests share: arms, a slow textbook reference, and the one helper that differentiates.
#![allow(dead_code, missing_docs, clippy::unwrap_used, reason = "each test binary uses a part of it")]

use truearm_kinematics::{Chain, Convention, Joint, Link, Transform};

/// A repeatable stream of numbers between -1 and 1 (an additive recurrence, well spread).
pub fn spread(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|i| ((i + 1000 * seed + 1) as f64 * 0.618_033_988_749_895).fract() * 2.0 - 1.0).collect()
}

pub fn link(joint: Joint, p: [f64; 5]) -> Link {
    Link { joint, theta: p[0], d: p[1], a: p[2], alpha: p[3], beta: p[4] }
}

/// A chain with revolute, prismatic and fixed rows, beta, and fixed transforms at both ends.
pub fn mixed(convention: Convention) -> Chain {
    use Joint::{Fixed, Prismatic, Revolute};
    let kinds = [Fixed, Revolute, Revolute, Prismatic, Revolute, Fixed, Revolute, Prismatic, Fixed];
    let values = spread(5 * kinds.len(), 3);
    let links = kinds.iter().zip(values.chunks(5)).enumerate().map(|(i, (kind, p))| {
        let beta = if i % 2 == 0 { 0.0 } else { 0.3 * p[4] };
        link(*kind, [p[0], 0.5 * p[1], 0.5 * p[2], 2.0 * p[3], beta])
    });
    let base = Transform::from_rotation_vector([0.3, -0.2, 1.1], [0.1, -0.4, 0.7]);
    let end = Transform::from_rotation_vector([-0.9, 0.5, 0.2], [0.05, 0.02, 0.21]);
    Chain::new(convention, links.collect(), base, end).unwrap()
}

/// A six-axis arm like a UR10.
pub fn six_axis() -> Chain {
    let right = std::f64::consts::FRAC_PI_2;
    let rows = [
        [0.0, 0.1273, 0.0, right, 0.0],
        [0.0, 0.0, -0.612, 0.0, 0.0],
        [0.0, 0.0, -0.5723, 0.0, 0.0],
        [0.0, 0.163_941, 0.0, right, 0.0],
        [0.0, 0.1157, 0.0, -right, 0.0],
        [0.0, 0.0922, 0.0, 0.0, 0.0],
    ];
    let links = rows.map(|p| link(Joint::Revolute, p)).to_vec();
    let end = Transform { translation: [0.01, 0.02, 0.15], ..Transform::IDENTITY };
    Chain::new(Convention::Standard, links, Transform::IDENTITY, end).unwrap()
}

/// Product of elementary transforms, one pose at a time: the definition, with nothing shared.
pub fn reference(chain: &Chain, joints: &[f64], parameters: &[f64]) -> Transform {
    let mut base_from_here = *chain.base();
    let mut joint = joints.iter();
    for (link, p) in chain.links().iter().zip(parameters.chunks(5)) {
        let (mut theta, mut d) = (p[0], p[1]);
        match link.joint {
            Joint::Revolute => theta += joint.next().unwrap(),
            Joint::Prismatic => d += joint.next().unwrap(),
            Joint::Fixed => {}
        }
        let rz = Transform::from_rotation_vector([0.0, 0.0, theta], [0.0; 3]);
        let tz = Transform::from_rotation_vector([0.0; 3], [0.0, 0.0, d]);
        let tx = Transform::from_rotation_vector([0.0; 3], [p[2], 0.0, 0.0]);
        let rx = Transform::from_rotation_vector([p[3], 0.0, 0.0], [0.0; 3]);
        let ry = Transform::from_rotation_vector([0.0, p[4], 0.0], [0.0; 3]);
        let order = match chain.convention() {
            Convention::Standard => [rz, tz, tx, rx, ry],
            Convention::Modified => [rx, tx, ry, rz, tz],
        };
        base_from_here = order.iter().fold(base_from_here, |sum, step| sum.compose(step));
    }
    base_from_here.compose(chain.end())
}

/// Derivative of a pose with respect to x by central differences, 6 x m: position, then the left rotation vector.
pub fn differences(pose: impl Fn(&[f64]) -> Transform, x: &[f64]) -> Vec<f64> {
    let step = 1e-5;
    let centre = pose(x).inverse();
    let mut out = vec![0.0; 6 * x.len()];
    for k in 0..x.len() {
        let moved = |by: f64| {
            let mut y = x.to_vec();
            y[k] += by;
            pose(&y)
        };
        let (ahead, behind) = (moved(step), moved(-step));
        let turned = [ahead, behind].map(|t| t.compose(&centre).rotation_vector());
        for i in 0..3 {
            out[i * x.len() + k] = (ahead.translation[i] - behind.translation[i]) / (2.0 * step);
            out[(i + 3) * x.len() + k] = (turned[0][i] - turned[1][i]) / (2.0 * step);
        }
    }
    out
}

#[track_caller]
pub fn assert_close(got: &[f64], wanted: &[f64], tolerance: f64) {
    assert_eq!(got.len(), wanted.len());
    for (i, (a, b)) in got.iter().zip(wanted).enumerate() {
        assert!((a - b).abs() <= tolerance, "entry {i}: {a} differs from {b} by {:e}", (a - b).abs());
    }
}
