//! Every Jacobian against finite differences of the textbook reference.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{assert_close, differences, mixed, reference, six_axis, spread};
use truearm_kinematics::{Chain, Convention, Parameters};

/// Error of central differences with a step of 1e-5.
const TOLERANCE: f64 = 1e-8;
/// A full group of eight and a part of one.
const POSES: usize = 11;

fn chains() -> [Chain; 3] {
    [six_axis(), mixed(Convention::Standard), mixed(Convention::Modified)]
}

/// Parameters of their own for every pose, near the nominal ones.
fn each(chain: &Chain) -> Vec<f64> {
    let nominal = chain.nominal();
    spread(POSES * nominal.len(), 9)
        .iter()
        .enumerate()
        .map(|(i, x)| nominal[i % nominal.len()] + 0.05 * x)
        .collect()
}

fn joints(chain: &Chain) -> Vec<f64> {
    spread(POSES * chain.joint_count(), 1).iter().map(|x| 3.0 * x).collect()
}

/// Upper three rows of each 6 x m matrix.
fn position_rows(pose_rows: &[f64]) -> Vec<f64> {
    pose_rows.chunks(pose_rows.len() / POSES).flat_map(|m| m[..m.len() / 2].to_vec()).collect()
}

fn check_parameters(chain: &Chain, parameters: Parameters<'_>, of_pose: impl Fn(usize) -> Vec<f64>) {
    let (q, count, width) = (joints(chain), chain.joint_count(), chain.parameter_count());
    let wanted: Vec<f64> = (0..POSES)
        .flat_map(|i| differences(|p| reference(chain, &q[i * count..][..count], p), &of_pose(i)))
        .collect();
    let mut pose = vec![0.0; POSES * 6 * width];
    chain.pose_jacobian(&q, parameters, &mut pose).unwrap();
    assert_close(&pose, &wanted, TOLERANCE);
    let mut position = vec![0.0; POSES * 3 * width];
    chain.position_jacobian(&q, parameters, &mut position).unwrap();
    assert_eq!(position, position_rows(&pose));
}

#[test]
fn parameters_shared_by_all_poses() {
    for chain in chains() {
        let nominal = chain.nominal();
        check_parameters(&chain, Parameters::One(&nominal), |_| nominal.clone());
    }
}

#[test]
fn parameters_of_each_pose() {
    for chain in chains() {
        let (values, width) = (each(&chain), chain.parameter_count());
        check_parameters(&chain, Parameters::Each(&values), |i| values[i * width..][..width].to_vec());
    }
}

#[test]
fn joints_of_all_kinds() {
    for chain in chains() {
        let (q, p, count) = (joints(&chain), chain.nominal(), chain.joint_count());
        let wanted: Vec<f64> =
            q.chunks(count).flat_map(|row| differences(|x| reference(&chain, x, &p), row)).collect();
        let mut pose = vec![0.0; POSES * 6 * count];
        chain.joint_pose_jacobian(&q, Parameters::One(&p), &mut pose).unwrap();
        assert_close(&pose, &wanted, TOLERANCE);
        let mut position = vec![0.0; POSES * 3 * count];
        chain.joint_position_jacobian(&q, Parameters::One(&p), &mut position).unwrap();
        assert_eq!(position, position_rows(&pose));
    }
}

#[test]
fn poses_and_positions_are_the_textbook_products() {
    for chain in chains() {
        let (q, values, count, width) =
            (joints(&chain), each(&chain), chain.joint_count(), chain.parameter_count());
        let wanted: Vec<_> = (0..POSES)
            .map(|i| reference(&chain, &q[i * count..][..count], &values[i * width..][..width]))
            .collect();
        let mut poses = vec![0.0; POSES * 16];
        chain.poses(&q, Parameters::Each(&values), &mut poses).unwrap();
        assert_close(&poses, &wanted.iter().flat_map(|t| t.to_matrix()).collect::<Vec<_>>(), 1e-14);
        let mut positions = vec![0.0; POSES * 3];
        chain.positions(&q, Parameters::Each(&values), &mut positions).unwrap();
        assert_close(&positions, &wanted.iter().flat_map(|t| t.translation).collect::<Vec<_>>(), 1e-14);
    }
}
