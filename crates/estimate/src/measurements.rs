//! What was measured, as plain arrays over the poses.

use truearm_kinematics::Transform;

use crate::EstimateError;
use crate::distance::{Distance, DistanceTo};

/// Standard deviations of what is measured beside each row's own sigma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of each position component, m.
    pub position: f64,
    /// Of each rotation-vector component, rad.
    pub orientation: f64,
}

/// What a row states of its own standard deviations; zero where it states none.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sigma {
    /// Of a position's components along x, y and z of world, m.
    pub position: [f64; 3],
    /// Of each rotation-vector component, rad.
    pub orientation: f64,
}

impl Sigma {
    /// That of a device which is as sure of each component of a position, and of orientations as of nothing else.
    pub fn of_position(sigma: f64) -> Self {
        Self { position: [sigma; 3], orientation: 0.0 }
    }

    /// Along x, y and z, m, and of orientation, rad.
    pub fn values(&self) -> [f64; 4] {
        let [x, y, z] = self.position;
        [x, y, z, self.orientation]
    }

    /// Whether a position is less sure along one axis than along another.
    pub fn differs_by_axis(&self) -> bool {
        let [x, y, z] = self.position;
        x != y || y != z
    }

    /// Of a length in any direction: the root mean square of the axes, m.
    pub fn of_length(&self) -> f64 {
        let [x, y, z] = self.position;
        if self.differs_by_axis() { ((x * x + y * y + z * z) / 3.0).sqrt() } else { x }
    }
}

/// Measurements of `n` poses in one or more groups (set-ups).
#[derive(Debug, Clone, Default)]
pub struct MeasurementSet {
    /// Moving joints of the arm, J.
    pub joint_count: usize,
    /// Targets on the tool, T.
    pub target_count: usize,
    /// Groups, G.
    pub group_count: usize,
    /// D-H joint values, (n, J), rad or m.
    pub joints: Vec<f64>,
    /// Group of each pose, (n,), below G.
    pub group: Vec<usize>,
    /// Measured target points in world, (n, T, 3), m; NaN where a target was not measured.
    pub targets: Vec<f64>,
    /// Measured world_from_target rotations, (n, 9) row-major, or empty; NaN where not measured.
    pub rotations: Vec<f64>,
    /// What each row states of its own standard deviations, (n,).
    pub sigma: Vec<Sigma>,
    /// Weight of each pose in the fit, (n,), between 0 and 1.
    pub weight: Vec<f64>,
    /// Distances measured instead of points; poses then hold no targets.
    pub distances: Vec<Distance>,
    /// Fixed points that distances refer to, each an unknown in the base frame.
    pub anchor_count: usize,
}

impl MeasurementSet {
    /// Poses, n.
    pub fn pose_count(&self) -> usize {
        self.group.len()
    }

    /// Whether orientation was measured.
    pub fn has_rotations(&self) -> bool {
        !self.rotations.is_empty()
    }

    /// Whether distances stand in place of points.
    pub fn is_distances(&self) -> bool {
        !self.distances.is_empty()
    }

    /// Rows of the least-squares problem that each pose brings: three a target, three for orientation.
    pub fn rows_per_pose(&self) -> usize {
        3 * self.target_count + if self.has_rotations() { 3 } else { 0 }
    }

    /// Measured values that take part: rows that are neither missing nor of weight zero.
    pub fn measured_values(&self) -> usize {
        if self.is_distances() {
            return self.distances.iter().filter(|distance| distance.weight(&self.weight) > 0.0).count();
        }
        (0..self.pose_count()).map(|pose| self.measured_values_of(pose)).sum()
    }

    /// Measured values of one pose.
    pub fn measured_values_of(&self, pose: usize) -> usize {
        if self.weight[pose] == 0.0 {
            return 0;
        }
        let targets = (0..self.target_count).filter(|&target| self.has_target(pose, target)).count();
        3 * (targets + usize::from(self.has_rotation(pose)))
    }

    /// Whether some row states a position to be less sure along one axis of world than along another.
    pub fn differs_by_axis(&self) -> bool {
        self.sigma.iter().any(Sigma::differs_by_axis)
    }

    /// What a pose states as the standard deviation of one of its rows, a position's along an axis of world.
    pub fn own_sigma(&self, pose: usize, row: usize) -> f64 {
        let own = &self.sigma[pose];
        if row / 3 < self.target_count { own.position[row % 3] } else { own.orientation }
    }

    /// Whether `target` was measured at `pose`.
    pub fn has_target(&self, pose: usize, target: usize) -> bool {
        !self.targets[3 * (pose * self.target_count + target)].is_nan()
    }

    /// Whether orientation was measured at `pose`.
    pub fn has_rotation(&self, pose: usize) -> bool {
        self.has_rotations() && !self.rotations[9 * pose].is_nan()
    }

    /// The measurements of some poses, in the given order; groups keep their numbers. Distances are left out.
    pub fn subset(&self, poses: &[usize]) -> MeasurementSet {
        let take = |values: &[f64], width: usize| -> Vec<f64> {
            poses.iter().flat_map(|&pose| &values[pose * width..(pose + 1) * width]).copied().collect()
        };
        let rotations = if self.has_rotations() { take(&self.rotations, 9) } else { Vec::new() };
        MeasurementSet {
            joints: take(&self.joints, self.joint_count),
            group: poses.iter().map(|&pose| self.group[pose]).collect(),
            targets: take(&self.targets, 3 * self.target_count),
            rotations,
            sigma: poses.iter().map(|&pose| self.sigma[pose]).collect(),
            weight: take(&self.weight, 1),
            distances: Vec::new(),
            anchor_count: 0,
            ..*self
        }
    }

    /// Checks lengths and values once, at the door.
    ///
    /// # Errors
    /// [`EstimateError::Length`], [`EstimateError::NotFinite`] (also of a target or orientation of which only a part
    /// is missing), [`EstimateError::Kinematics`] of a rotation that is none, and [`EstimateError::Option`].
    pub fn check(&self) -> Result<(), EstimateError> {
        let n = self.pose_count();
        if self.rows_per_pose() == 0 && !self.is_distances() {
            let rule =
                "each pose has a target or more, or its orientation: give what was measured, or distances";
            return Err(EstimateError::Option { what: "the number of values of a pose", value: 0.0, rule });
        }
        let length = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(EstimateError::Length { what, found, expected }) }
        };
        length("joints", self.joints.len(), n * self.joint_count)?;
        length("targets", self.targets.len(), 3 * n * self.target_count)?;
        length("rotations", self.rotations.len(), if self.has_rotations() { 9 * n } else { 0 })?;
        length("sigma", self.sigma.len(), n)?;
        length("weight", self.weight.len(), n)?;
        finite("joint value", &self.joints, self.joint_count)?;
        whole_or_missing("target", &self.targets, 3, self.target_count)?;
        whole_or_missing("rotation", &self.rotations, 9, 1)?;
        finite("sigma", &self.sigma.iter().flat_map(Sigma::values).collect::<Vec<f64>>(), 4)?;
        finite("weight", &self.weight, 1)?;
        for rotation in self.rotations.as_chunks::<9>().0.iter().filter(|values| values[0].is_finite()) {
            Transform { rotation: *rotation, translation: [0.0; 3] }.check("measured rotation")?;
        }
        self.check_ranges()?;
        self.check_distances()
    }

    fn check_ranges(&self) -> Result<(), EstimateError> {
        let refuse = |what, value, rule| Err(EstimateError::Option { what, value, rule });
        if let Some(sigma) = self.sigma.iter().flat_map(Sigma::values).find(|&sigma| sigma < 0.0) {
            return refuse(
                "a pose's sigma",
                sigma,
                "a standard deviation is zero or more: give it in metres and radians",
            );
        }
        if let Some(&weight) = self.weight.iter().find(|weight| !(0.0..=1.0).contains(*weight)) {
            return refuse("a pose's weight", weight, "weights are between 0 (left out) and 1");
        }
        if let Some(&group) = self.group.iter().find(|&&group| group >= self.group_count) {
            return refuse(
                "a pose's group",
                group as f64,
                "groups count from 0 and end below the number of groups",
            );
        }
        Ok(())
    }

    fn check_distances(&self) -> Result<(), EstimateError> {
        for distance in &self.distances {
            let known = match distance.to {
                DistanceTo::Pose(pose) => pose < self.pose_count(),
                DistanceTo::Anchor(anchor) => anchor < self.anchor_count,
            };
            if !known || distance.pose >= self.pose_count() {
                return Err(EstimateError::Length {
                    what: "a distance's index",
                    found: distance.pose,
                    expected: self.pose_count(),
                });
            }
            if !distance.value.is_finite() {
                return Err(EstimateError::NotFinite { what: "distance", pose: distance.pose });
            }
            if distance.value < 0.0 {
                let (what, value, rule) = ("a distance", distance.value, "a distance is zero or more");
                return Err(EstimateError::Option { what, value, rule });
            }
        }
        Ok(())
    }
}

/// Every `width` values are finite, or all of them NaN; `per_pose` such parts belong to a pose.
fn whole_or_missing(
    what: &'static str,
    values: &[f64],
    width: usize,
    per_pose: usize,
) -> Result<(), EstimateError> {
    let bad = |part: &[f64]| !part.iter().all(|v| v.is_finite()) && !part.iter().all(|v| v.is_nan());
    match values.chunks_exact(width).position(bad) {
        Some(at) => Err(EstimateError::NotFinite { what, pose: at / per_pose }),
        None => Ok(()),
    }
}

/// All are finite; `width` values belong to a pose.
pub(crate) fn finite(what: &'static str, values: &[f64], width: usize) -> Result<(), EstimateError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(at) => Err(EstimateError::NotFinite { what, pose: at / width.max(1) }),
        None => Ok(()),
    }
}
