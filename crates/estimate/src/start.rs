//! A first set-up in closed form, so that nobody is asked for start values.
//!
//! Written in the base frame the measurement model `p_flange + R_flange t = R y + b` is linear in the
//! inverse frame (R, b) and the target points t: fifteen unknowns for one target. R is then projected onto
//! the rotations. Where the poses are too few or too alike for fifteen unknowns, a frame without target
//! offsets (Procrustes) is the better start; the start with the smaller residual is taken.

use faer::Mat;
use truearm_kinematics::{Parameters, Transform};

use crate::dense::Cholesky;
use crate::layout::{Layout, Problem};
use crate::setup::{FrameMode, GroupSetup, Setup};
use crate::{EstimateError, MeasurementSet};

/// Poses of a group that the start looks at.
const POSES_FOR_START: usize = 200;

/// Relative ridge that keeps alike poses from breaking the solution; far below what real poses bring.
const RIDGE: f64 = 1e-12;

/// Set-ups in closed form for given link parameters, (5 L,) or one set a pose (n, 5 L).
///
/// # Errors
/// [`EstimateError::TooFew`] where a group has no complete pose, [`EstimateError::Kinematics`].
pub fn initial_setup(problem: &Problem, parameters: &[f64]) -> Result<Setup, EstimateError> {
    let set = problem.measurements;
    if set.is_distances() {
        return distance_start(problem, parameters);
    }
    let mut setup = Setup::identity(set.group_count, set.target_count, set.anchor_count);
    for (group, start) in setup.groups.iter_mut().enumerate() {
        let sample = Sample::new(problem, parameters, group)?;
        *start = sample.start(problem.frame);
    }
    Ok(setup)
}

/// Flange poses and measurements of some poses of one group.
struct Sample<'a> {
    set: &'a MeasurementSet,
    poses: Vec<usize>,
    flanges: Vec<Transform>,
}

impl<'a> Sample<'a> {
    fn new(problem: &Problem<'a>, parameters: &[f64], group: usize) -> Result<Self, EstimateError> {
        let set = problem.measurements;
        let usable = |&pose: &usize| {
            set.group[pose] == group
                && (0..set.target_count).any(|t| set.has_target(pose, t))
                && set.weight[pose] > 0.0
        };
        let all: Vec<usize> = (0..set.pose_count()).filter(usable).collect();
        if all.is_empty() {
            let hint = format!(" (group {group} has no row with a measured target)");
            return Err(EstimateError::TooFew { rows: 0, unknowns: 9, needed: 3, hint });
        }
        let stride = all.len().div_ceil(POSES_FOR_START);
        let poses: Vec<usize> = all.into_iter().step_by(stride).collect();
        let flanges = flange_poses(problem, parameters, &poses)?;
        Ok(Self { set, poses, flanges })
    }

    fn start(&self, frame: FrameMode) -> GroupSetup {
        let candidates = match frame {
            FrameMode::World => vec![self.targets_given(Transform::IDENTITY)],
            FrameMode::Free => {
                let linear = self.linear_frame();
                let plain = self.procrustes();
                vec![
                    self.targets_given(linear),
                    self.targets_given(plain),
                    self.refined(plain),
                    self.refined(linear),
                ]
            }
        };
        let mut best = candidates[0].clone();
        for candidate in &candidates[1..] {
            if self.squares(candidate) < self.squares(&best) {
                best = candidate.clone();
            }
        }
        best.flange_from_target = self.target_rotation(&best.world_from_base);
        best
    }

    /// Measured points: index into the sample, target, point in world.
    fn points(&self) -> impl Iterator<Item = (usize, usize, [f64; 3])> + '_ {
        self.poses.iter().enumerate().flat_map(move |(index, &pose)| {
            (0..self.set.target_count).filter(move |&t| self.set.has_target(pose, t)).map(move |t| {
                let at = 3 * (pose * self.set.target_count + t);
                (index, t, [self.set.targets[at], self.set.targets[at + 1], self.set.targets[at + 2]])
            })
        })
    }

    /// world_from_base from the linear system in (R, b, t).
    fn linear_frame(&self) -> Transform {
        let centre = mean(self.points().map(|point| point.2));
        let width = 12 + 3 * self.set.target_count;
        let mut normal = (Mat::<f64>::zeros(width, width), vec![0.0; width]);
        for (index, target, measured) in self.points() {
            let flange = &self.flanges[index];
            for k in 0..3 {
                let mut row = vec![0.0; width];
                (0..3).for_each(|j| row[3 * k + j] = measured[j] - centre[j]);
                row[9 + k] = 1.0;
                (0..3).for_each(|j| row[12 + 3 * target + j] = -flange.rotation[3 * k + j]);
                for i in 0..width {
                    (0..width).for_each(|j| normal.0[(i, j)] += row[i] * row[j]);
                    normal.1[i] += row[i] * flange.translation[k];
                }
            }
        }
        let solution = ridge_solve(normal.0, &normal.1);
        let rotation = nearest_rotation(&std::array::from_fn(|k| solution[k]));
        // Base coordinates of the measured points' centre.
        let centre_in_base = [solution[9], solution[10], solution[11]];
        frame_through(rotation, centre, centre_in_base)
    }

    /// world_from_base that maps the flange's origins onto the measured points (Kabsch 1976).
    fn procrustes(&self) -> Transform {
        self.fit_frame(|index, _| self.flanges[index].translation)
    }

    /// Frame and targets in turn, starting from a frame.
    fn refined(&self, frame: Transform) -> GroupSetup {
        const ROUNDS: usize = 10;
        let mut setup = self.targets_given(frame);
        for _ in 0..ROUNDS {
            let frame = self.fit_frame(|index, target| self.flanges[index].apply(setup.targets[target]));
            setup = self.targets_given(frame);
        }
        setup
    }

    fn fit_frame(&self, in_base: impl Fn(usize, usize) -> [f64; 3]) -> Transform {
        let centre = mean(self.points().map(|point| point.2));
        let centre_in_base = mean(self.points().map(|(index, target, _)| in_base(index, target)));
        let mut covariance = [0.0; 9];
        for (index, target, measured) in self.points() {
            let base = in_base(index, target);
            for (k, entry) in covariance.iter_mut().enumerate() {
                *entry += (base[k / 3] - centre_in_base[k / 3]) * (measured[k % 3] - centre[k % 3]);
            }
        }
        frame_through(nearest_rotation(&covariance), centre, centre_in_base)
    }

    /// The target points that fit best in a given frame: means over the poses.
    fn targets_given(&self, world_from_base: Transform) -> GroupSetup {
        let base_from_world = world_from_base.inverse();
        let offset = |target: usize| {
            mean(self.points().filter(|point| point.1 == target).map(|(index, _, measured)| {
                self.flanges[index].inverse().apply(base_from_world.apply(measured))
            }))
        };
        let targets = (0..self.set.target_count).map(offset).collect();
        GroupSetup { world_from_base, targets, flange_from_target: Transform::IDENTITY.rotation }
    }

    fn squares(&self, setup: &GroupSetup) -> f64 {
        self.points()
            .map(|(index, target, measured)| {
                let predicted = setup.world_from_base.apply(self.flanges[index].apply(setup.targets[target]));
                (0..3).map(|k| (measured[k] - predicted[k]).powi(2)).sum::<f64>()
            })
            .sum()
    }

    fn target_rotation(&self, world_from_base: &Transform) -> [f64; 9] {
        let mut sum = [0.0; 9];
        for (index, &pose) in self.poses.iter().enumerate().filter(|(_, pose)| self.set.has_rotation(**pose))
        {
            let rotation = std::array::from_fn(|k| self.set.rotations[9 * pose + k]);
            let measured = Transform { rotation, translation: [0.0; 3] };
            let relative = world_from_base.compose(&self.flanges[index]).inverse().compose(&measured);
            (0..9).for_each(|k| sum[k] += relative.rotation[k]);
        }
        if sum == [0.0; 9] { Transform::IDENTITY.rotation } else { nearest_rotation(&sum) }
    }
}

/// Flange poses under link parameters, (5 L,) or one set a pose (n, 5 L).
///
/// # Errors
/// [`EstimateError::Kinematics`].
pub fn flange_poses(
    problem: &Problem,
    parameters: &[f64],
    poses: &[usize],
) -> Result<Vec<Transform>, EstimateError> {
    let width = problem.measurements.joint_count;
    let joints: Vec<f64> = poses
        .iter()
        .flat_map(|&pose| &problem.measurements.joints[pose * width..(pose + 1) * width])
        .copied()
        .collect();
    let mut matrices = vec![0.0; 16 * poses.len()];
    let size = problem.chain.parameter_count();
    if parameters.len() == size {
        problem.chain.poses(&joints, Parameters::One(parameters), &mut matrices)?;
    } else {
        let each: Vec<f64> =
            poses.iter().flat_map(|&pose| &parameters[pose * size..(pose + 1) * size]).copied().collect();
        problem.chain.poses(&joints, Parameters::Each(&each), &mut matrices)?;
    }
    Ok(matrices.chunks_exact(16).map(|m| Transform::from_matrix(&std::array::from_fn(|k| m[k]))).collect())
}

/// Targets at the flange's origin; anchors by linear trilateration, |p - a|^2 = d^2 being linear in (a, |a|^2).
fn distance_start(problem: &Problem, parameters: &[f64]) -> Result<Setup, EstimateError> {
    let set = problem.measurements;
    let mut setup = Setup::identity(set.group_count, Layout::new(problem).targets, set.anchor_count);
    let all: Vec<usize> = (0..set.pose_count()).collect();
    let flanges = flange_poses(problem, parameters, &all)?;
    for (anchor, point) in setup.anchors.iter_mut().enumerate() {
        let mut normal = (Mat::<f64>::zeros(4, 4), vec![0.0; 4]);
        let to_anchor = crate::DistanceTo::Anchor(anchor);
        let counts = |d: &&crate::Distance| d.to == to_anchor && set.weight[d.pose] > 0.0;
        for distance in set.distances.iter().filter(counts) {
            let p = flanges[distance.pose].translation;
            let row = [2.0 * p[0], 2.0 * p[1], 2.0 * p[2], -1.0];
            let value = p.iter().map(|x| x * x).sum::<f64>() - distance.value.powi(2);
            for i in 0..4 {
                (0..4).for_each(|j| normal.0[(i, j)] += row[i] * row[j]);
                normal.1[i] += row[i] * value;
            }
        }
        let solution = ridge_solve(normal.0, &normal.1);
        *point = [solution[0], solution[1], solution[2]];
    }
    Ok(setup)
}

/// Solves a positive semidefinite system with a ridge that grows until the factor exists.
fn ridge_solve(mut matrix: Mat<f64>, right: &[f64]) -> Vec<f64> {
    const LARGEST_RIDGE: f64 = 1.0;
    let trace: f64 = (0..right.len()).map(|i| matrix[(i, i)]).sum();
    let mut ridge = RIDGE;
    while ridge < LARGEST_RIDGE {
        (0..right.len()).for_each(|i| matrix[(i, i)] += ridge * trace);
        if let Some(factor) = Cholesky::new(matrix.clone(), faer::Par::Seq) {
            return factor.solve_vector(right);
        }
        ridge *= 10.0;
    }
    vec![0.0; right.len()]
}

fn frame_through(base_from_world: [f64; 9], centre: [f64; 3], centre_in_base: [f64; 3]) -> Transform {
    let turn = Transform { rotation: base_from_world, translation: [0.0; 3] };
    let rotated = turn.rotate(centre);
    let translation = [0, 1, 2].map(|k| centre_in_base[k] - rotated[k]);
    Transform { rotation: base_from_world, translation }.inverse()
}

fn mean(points: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut count = 0.0;
    for point in points {
        (0..3).for_each(|k| sum[k] += point[k]);
        count += 1.0;
    }
    sum.map(|x| x / f64::max(count, 1.0))
}

/// The rotation closest to a matrix: U diag(1, 1, det) V^T of its singular value decomposition.
fn nearest_rotation(matrix: &[f64; 9]) -> [f64; 9] {
    let square = Mat::from_fn(3, 3, |i, j| matrix[3 * i + j]);
    // The decomposition fails on matrices that are not finite only; any rotation is as good a start then.
    let Ok(svd) = square.svd() else { return Transform::IDENTITY.rotation };
    let (u, v) = (svd.U(), svd.V());
    let determinant = (u * v.transpose()).determinant();
    std::array::from_fn(|k| {
        let (i, j) = (k / 3, k % 3);
        u[(i, 0)] * v[(j, 0)] + u[(i, 1)] * v[(j, 1)] + determinant.signum() * u[(i, 2)] * v[(j, 2)]
    })
}
