//! Distances between the target points of two poses, or from a pose's target to an unknown fixed point.
//!
//! A distance sees no frame: `world_from_base` drops out, and so do the parameters that only move the arm
//! as a whole, unless anchors are shared by many poses.

use truearm_kinematics::{Parameters, Transform, cross, norm};

use crate::EstimateError;
use crate::layout::{Layout, Problem};
use crate::noise::row_weight;
use crate::pass::Normal;
use crate::rows::{Point, Weighting};

/// What a distance is measured to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DistanceTo {
    /// The target at another pose.
    Pose(usize),
    /// A fixed point, unknown in the base frame.
    Anchor(usize),
}

/// A measured distance, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    /// The pose whose target is one end.
    pub pose: usize,
    /// The other end.
    pub to: DistanceTo,
    /// The distance, m.
    pub value: f64,
}

impl Distance {
    /// Its part of the poses' weights (n,): that of the pose where it starts; none where the pose at its other end is left
    /// out.
    pub fn weight(&self, weight: &[f64]) -> f64 {
        match self.to {
            DistanceTo::Pose(other) if weight[other] == 0.0 => 0.0,
            _ => weight[self.pose],
        }
    }
}

/// Flange poses and their derivatives, enough to move the target of any pose.
struct Arm {
    poses: Vec<f64>,
    jacobian: Vec<f64>,
    parameters: usize,
}

impl Arm {
    fn new(problem: &Problem, point: Point) -> Result<Self, EstimateError> {
        let (chain, set) = (problem.chain, problem.measurements);
        let parameters = chain.parameter_count();
        let mut arm = Self {
            poses: vec![0.0; 16 * set.pose_count()],
            jacobian: vec![0.0; 6 * parameters * set.pose_count()],
            parameters,
        };
        let source = if point.parameters.len() == parameters {
            Parameters::One(point.parameters)
        } else {
            Parameters::Each(point.parameters)
        };
        chain.poses(&set.joints, source, &mut arm.poses)?;
        chain.pose_jacobian(&set.joints, source, &mut arm.jacobian)?;
        Ok(arm)
    }

    fn flange(&self, pose: usize) -> Transform {
        Transform::from_matrix(&std::array::from_fn(|k| self.poses[16 * pose + k]))
    }

    /// Motion along `direction` of a point at `arm` from the flange's origin, per unit of a parameter.
    fn along(&self, pose: usize, column: usize, arm: [f64; 3], direction: [f64; 3]) -> f64 {
        let entry = |row: usize| self.jacobian[(6 * pose + row) * self.parameters + column];
        let turn = [entry(3), entry(4), entry(5)];
        (0..3).map(|k| direction[k] * (entry(k) + cross(turn, arm)[k])).sum()
    }
}

/// One linearised distance: derivatives at the unknowns, and the residual.
struct Row {
    entries: Vec<(usize, f64)>,
    residual: f64,
}

fn row(problem: &Problem, layout: &Layout, arm: &Arm, point: Point, distance: &Distance) -> Row {
    let set = problem.measurements;
    let end = |pose: usize| {
        let group = set.group[pose];
        let flange = arm.flange(pose);
        let offset = flange.rotate(point.setup.groups[group].targets[0]);
        let place = [0, 1, 2].map(|k| flange.translation[k] + offset[k]);
        (flange, offset, place, layout.group(group).start)
    };
    let (flange, offset, place, start) = end(distance.pose);
    let other = match distance.to {
        DistanceTo::Pose(pose) => end(pose).2,
        DistanceTo::Anchor(anchor) => point.setup.anchors[anchor],
    };
    let difference = [0, 1, 2].map(|k| place[k] - other[k]);
    let predicted = norm(difference);
    let direction = difference.map(|x| x / predicted.max(f64::MIN_POSITIVE));
    let mut derivative = vec![0.0; layout.len()];
    let mut add = |pose: usize, flange: &Transform, offset: [f64; 3], start: usize, sign: f64| {
        for (k, &column) in problem.columns.iter().enumerate() {
            derivative[k] += sign * arm.along(pose, column, offset, direction);
        }
        let back = flange.inverse().rotate(direction);
        (0..3).for_each(|k| derivative[start + k] += sign * back[k]);
    };
    add(distance.pose, &flange, offset, start, 1.0);
    match distance.to {
        DistanceTo::Pose(pose) => {
            let (flange, offset, _, start) = end(pose);
            add(pose, &flange, offset, start, -1.0);
        }
        DistanceTo::Anchor(anchor) => {
            (0..3).for_each(|k| derivative[layout.anchor(anchor) + k] -= direction[k]);
        }
    }
    let entries = derivative.into_iter().enumerate().filter(|entry| entry.1 != 0.0).collect();
    Row { entries, residual: distance.value - predicted }
}

fn rows(problem: &Problem, point: Point) -> Result<Vec<Row>, EstimateError> {
    let layout = Layout::new(problem);
    let arm = Arm::new(problem, point)?;
    let distances = &problem.measurements.distances;
    Ok(distances.iter().map(|distance| row(problem, &layout, &arm, point, distance)).collect())
}

/// Normal equations of all distances.
///
/// # Errors
/// [`EstimateError::Kinematics`].
pub fn normal_equations(
    problem: &Problem,
    point: Point,
    weighting: Weighting,
) -> Result<Normal, EstimateError> {
    let set = problem.measurements;
    let mut normal = Normal::zeros(Layout::new(problem).len());
    for (row, distance) in rows(problem, point)?.into_iter().zip(&set.distances) {
        let weight = weighting.map_or(1.0, |(noise, weight)| {
            row_weight(noise.position, set.sigma[distance.pose].of_length(), distance.weight(weight)).sqrt()
        });
        let entries: Vec<_> = row.entries.iter().map(|&(at, value)| (at, weight * value)).collect();
        normal.add_row(&entries, weight * row.residual);
    }
    Ok(normal)
}

/// Residuals of all distances, m.
///
/// # Errors
/// [`EstimateError::Kinematics`].
pub fn residuals(problem: &Problem, point: Point) -> Result<Vec<f64>, EstimateError> {
    Ok(rows(problem, point)?.into_iter().map(|row| row.residual).collect())
}

/// Derivatives (rows, unknowns) of all distances, row-major.
///
/// # Errors
/// [`EstimateError::Kinematics`].
pub fn derivatives(problem: &Problem, point: Point) -> Result<Vec<f64>, EstimateError> {
    let width = Layout::new(problem).len();
    let rows = rows(problem, point)?;
    let mut dense = vec![0.0; rows.len() * width];
    for (index, row) in rows.iter().enumerate() {
        row.entries.iter().for_each(|&(at, value)| dense[index * width + at] = value);
    }
    Ok(dense)
}
