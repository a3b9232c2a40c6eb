//! Damped Newton on several starts at once.

use truearm_kinematics::{
    Chain, KinematicsError, Parameters, SharedParameters, Transform, norm, rotation_log,
};

use crate::vector::{Vector, sub};

/// Error, m and rad, below which a start has arrived: a few hundred roundings of an arm's length.
const ARRIVED: f64 = 1e-13;
/// Error up to which a start that comes no nearer has arrived as well.
const GOOD: f64 = 1e-10;
/// Longest step of a joint value, rad or m: what a linear model of an arm is good for.
const LONGEST: f64 = 0.6;
/// Damping relative to the squared error, so that it vanishes as the error does (Sugihara, Solvability-unconcerned
/// inverse kinematics by the Levenberg-Marquardt method, 2011).
const DAMPING: f64 = 0.1;
/// Damping that stays, as a part of the sum of squares of the Jacobian: above what its normal equations lose to
/// rounding, so that a stretched arm asks for no long step and for no impossible one.
const LEAST_DAMPING: f64 = 1e-15;

/// Weight of a position against a rotation, rad/m, where an arm has fewer than six axes and may have to choose:
/// what a program's rounded numbers ask of such an arm is never quite within its reach.
const POSITION_FIRST: f64 = 100.0;
/// Errors up to which such an arm has arrived, m and rad: half of a program's last digit at two or one decimals.
const ROUNDED: [f64; 2] = [1e-6, 2e-3];

/// Moves starts (n x J joint values) towards a pose.
#[derive(Debug, Clone)]
pub struct Newton {
    chain: Chain,
    parameters: SharedParameters,
    weight: f64,
}

/// What is left between a start that was moved and the target.
#[derive(Debug, Clone, Copy)]
pub struct Left {
    position_m: f64,
    rotation_rad: f64,
    weighted: f64,
}

impl Newton {
    /// For a chain at its nominal parameters.
    pub fn new(chain: &Chain) -> Newton {
        let weight = if chain.joint_count() < 6 { POSITION_FIRST } else { 1.0 };
        Newton { chain: chain.clone(), parameters: SharedParameters::new(&chain.nominal()), weight }
    }

    /// Whether a start has arrived: exactly, or as near as a program's rounded numbers let an arm with fewer
    /// than six axes come.
    pub fn arrived(&self, left: &Left) -> bool {
        let [position, rotation] = if self.weight > 1.0 { ROUNDED } else { [GOOD, GOOD] };
        left.position_m < position && left.rotation_rad < rotation
    }

    /// base_from_end at joint values.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn pose(&self, joints: &[f64]) -> Result<Transform, KinematicsError> {
        let mut matrix = [0.0; 16];
        self.chain.poses(joints, Parameters::Prepared(&self.parameters), &mut matrix)?;
        Ok(Transform::from_matrix(&matrix))
    }

    /// Directions of the axes in the base frame at joint values (J,), all of which turn.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn directions(&self, joints: &[f64]) -> Result<Vec<Vector>, KinematicsError> {
        let count = self.chain.joint_count();
        let mut jacobian = vec![0.0; 6 * count];
        self.chain.joint_pose_jacobian(joints, Parameters::Prepared(&self.parameters), &mut jacobian)?;
        Ok((0..count).map(|joint| [3, 4, 5].map(|row| jacobian[row * count + joint])).collect())
    }

    /// Improve `starts`, at most `steps` steps each; what is left of each.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn improve(
        &self,
        target: &Transform,
        starts: &mut [f64],
        steps: usize,
    ) -> Result<Vec<Left>, KinematicsError> {
        let joints = self.chain.joint_count();
        let count = starts.len() / joints;
        let (mut poses, mut jacobians) = (vec![0.0; 16 * count], vec![0.0; 6 * joints * count]);
        let none = Left { position_m: f64::INFINITY, rotation_rad: f64::INFINITY, weighted: f64::INFINITY };
        let mut best = vec![none; count];
        let mut best_joints = starts.to_vec();
        for step in 0..=steps {
            self.chain.batch(Some(std::num::NonZeroUsize::MIN)).poses(
                starts,
                Parameters::Prepared(&self.parameters),
                &mut poses,
            )?;
            let errors: Vec<[f64; 6]> =
                poses.as_chunks::<16>().0.iter().map(|pose| self.error(pose, target)).collect();
            for (k, error) in errors.iter().enumerate() {
                let left = self.left(error);
                if left.weighted < best[k].weighted {
                    best[k] = left;
                    best_joints[k * joints..][..joints].copy_from_slice(&starts[k * joints..][..joints]);
                }
            }
            if step == steps || best.iter().all(|left| left.weighted < ARRIVED) {
                break;
            }
            self.chain.batch(Some(std::num::NonZeroUsize::MIN)).joint_pose_jacobian(
                starts,
                Parameters::Prepared(&self.parameters),
                &mut jacobians,
            )?;
            let rows = jacobians.chunks_exact_mut(6 * joints).zip(&errors);
            for (start, (jacobian, error)) in starts.chunks_exact_mut(joints).zip(rows) {
                jacobian[..3 * joints].iter_mut().for_each(|x| *x *= self.weight);
                advance(start, error, jacobian);
            }
        }
        starts.copy_from_slice(&best_joints);
        Ok(best)
    }

    fn left(&self, error: &[f64; 6]) -> Left {
        let [x, y, z, a, b, c] = *error;
        Left {
            position_m: norm([x, y, z]) / self.weight,
            rotation_rad: norm([a, b, c]),
            weighted: dot6(error, error).sqrt(),
        }
    }

    /// Position times its weight, then the rotation vector in the base frame, from a pose to the target.
    fn error(&self, pose: &[f64; 16], target: &Transform) -> [f64; 6] {
        let here = Transform::from_matrix(pose);
        let back = Transform { translation: [0.0; 3], ..here }.inverse();
        let turn = rotation_log(&Transform { translation: [0.0; 3], ..*target }.compose(&back).rotation);
        let shift = sub(target.translation, here.translation).map(|x| x * self.weight);
        [shift[0], shift[1], shift[2], turn[0], turn[1], turn[2]]
    }
}

fn advance(start: &mut [f64], error: &[f64; 6], jacobian: &[f64]) {
    let squares: f64 = jacobian.iter().map(|x| x * x).sum();
    let damping = DAMPING * dot6(error, error) + LEAST_DAMPING * squares;
    let Some(change) = least_squares(jacobian, start.len(), error, damping) else {
        return;
    };
    let longest = change.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let scale = if longest > LONGEST { LONGEST / longest } else { 1.0 };
    for (value, by) in start.iter_mut().zip(change) {
        *value += scale * by;
    }
}

fn dot6(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// x that minimises |J x - e|^2 + damping |x|^2 for J (6 x n), by the smaller of its two normal equations.
fn least_squares(jacobian: &[f64], n: usize, error: &[f64; 6], damping: f64) -> Option<Vec<f64>> {
    let row = |i: usize| &jacobian[i * n..(i + 1) * n];
    let mut matrix = [[0.0; 6]; 6];
    if n < 6 {
        let mut right = [0.0; 6];
        for a in 0..n {
            for b in 0..=a {
                matrix[a][b] = (0..6).map(|i| row(i)[a] * row(i)[b]).sum();
            }
            matrix[a][a] += damping;
            right[a] = (0..6).map(|i| row(i)[a] * error[i]).sum();
        }
        return solve(&mut matrix, &mut right, n).then(|| right[..n].to_vec());
    }
    let mut right = *error;
    for a in 0..6 {
        for b in 0..=a {
            matrix[a][b] = row(a).iter().zip(row(b)).map(|(x, y)| x * y).sum();
        }
        matrix[a][a] += damping;
    }
    solve(&mut matrix, &mut right, 6)
        .then(|| (0..n).map(|j| (0..6).map(|i| row(i)[j] * right[i]).sum()).collect())
}

/// Cholesky's solution of the n x n system whose lower half is given, in place; false if it is singular.
fn solve(matrix: &mut [[f64; 6]; 6], right: &mut [f64; 6], n: usize) -> bool {
    for j in 0..n {
        let pivot = matrix[j][j] - (0..j).map(|k| matrix[j][k] * matrix[j][k]).sum::<f64>();
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        matrix[j][j] = pivot.sqrt();
        for i in j + 1..n {
            let sum: f64 = (0..j).map(|k| matrix[i][k] * matrix[j][k]).sum();
            matrix[i][j] = (matrix[i][j] - sum) / matrix[j][j];
        }
    }
    for i in 0..n {
        let sum: f64 = (0..i).map(|k| matrix[i][k] * right[k]).sum();
        right[i] = (right[i] - sum) / matrix[i][i];
    }
    for i in (0..n).rev() {
        let sum: f64 = (i + 1..n).map(|k| matrix[k][i] * right[k]).sum();
        right[i] = (right[i] - sum) / matrix[i][i];
    }
    true
}
