//! Where each unknown stands in the vector of unknowns, and how a step is added to a state.

use std::ops::Range;

use truearm_kinematics::{Chain, Transform};

use crate::setup::{FrameMode, Setup};
use crate::{EstimateError, MeasurementSet};

/// What is to be identified from which measurements.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The nominal chain; its end is the flange.
    pub chain: &'a Chain,
    /// The measurements.
    pub measurements: &'a MeasurementSet,
    /// Link parameters to identify: indices 5 * link + (theta, d, a, alpha, beta), ascending.
    pub columns: &'a [usize],
    /// Whether `world_from_base` is an unknown.
    pub frame: FrameMode,
}

impl Problem<'_> {
    /// The same measurements with other link parameters as unknowns.
    pub fn with_columns<'b>(&'b self, columns: &'b [usize]) -> Problem<'b> {
        Problem { columns, ..*self }
    }

    /// Checks the measurements and that there are enough of them for the unknowns without a prior.
    ///
    /// # Errors
    /// Whatever [`MeasurementSet::check`] finds, [`EstimateError::Option`] where joints or columns are not the
    /// chain's or numbers of groups or anchors cannot be right, and [`EstimateError::TooFew`].
    pub fn check(&self, columns_have_prior: bool) -> Result<(), EstimateError> {
        self.measurements.check()?;
        self.check_chain()?;
        self.check_counts()?;
        let layout = Layout::new(self);
        let per_pose = self.measurements.rows_per_pose().max(1);
        for group in 0..self.measurements.group_count {
            let rows: usize = (0..self.measurements.pose_count())
                .filter(|&pose| self.measurements.group[pose] == group)
                .map(|pose| self.measurements.measured_values_of(pose))
                .sum();
            let unknowns = layout.group_width();
            if rows < unknowns && !self.measurements.is_distances() {
                let hint = format!(" (group {group}, whose frame and targets are unknown)");
                return Err(EstimateError::TooFew {
                    rows,
                    unknowns,
                    needed: unknowns.div_ceil(per_pose),
                    hint,
                });
            }
        }
        let free = if columns_have_prior { layout.len() - layout.arm } else { layout.len() };
        let rows = self.measurements.measured_values();
        if rows < free {
            let needed = free.div_ceil(per_pose);
            return Err(EstimateError::TooFew { rows, unknowns: free, needed, hint: String::new() });
        }
        Ok(())
    }

    /// Groups and anchors that nothing was measured in cannot be fitted; so many of them would fill the memory.
    fn check_counts(&self) -> Result<(), EstimateError> {
        let (set, refuse) = (self.measurements, |what, value, rule| {
            Err(EstimateError::Option { what, value: value as f64, rule })
        });
        if set.group_count > set.pose_count() {
            let rule = "each group needs a pose of its own: number them from 0 without gaps";
            return refuse("the number of groups", set.group_count, rule);
        }
        if set.anchor_count > set.distances.len() {
            let rule = "each anchor needs a distance of its own: number them from 0 without gaps";
            return refuse("the number of anchors", set.anchor_count, rule);
        }
        Ok(())
    }

    fn check_chain(&self) -> Result<(), EstimateError> {
        let refuse = |what, value, rule| Err(EstimateError::Option { what, value: value as f64, rule });
        if self.measurements.joint_count != self.chain.joint_count() {
            let rule = "the chain has another number of moving joints: measure and describe the same arm";
            return refuse("the measurements' number of joints", self.measurements.joint_count, rule);
        }
        let count = self.chain.parameter_count();
        let fits = |k: usize| self.columns[k] < count && (k == 0 || self.columns[k - 1] < self.columns[k]);
        match (0..self.columns.len()).find(|&k| !fits(k)) {
            Some(k) => {
                refuse("a column", self.columns[k], "columns ascend and stay below 5 times the chain's links")
            }
            None => Ok(()),
        }
    }
}

/// How far from the flange targets are, m, as one standard deviation of each coordinate. Only where frame and target can
/// hardly be told apart, as along the axes of a SCARA, does it decide: errors of its axes' directions must not be put down
/// to a long tool.
const REACH: f64 = 0.1;
/// The same as a precision, 1/m^2.
pub const TARGET_PRECISION: f64 = 1.0 / (REACH * REACH);
/// Precision of targets that stay where they are to a millimetre, 1/m^2.
pub const HELD_PRECISION: f64 = 1e6;

/// Positions of the unknowns in the vector of unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Active link parameters; they stand first.
    pub arm: usize,
    /// Unknowns of `world_from_base` of a group: 6 or 0.
    pub frame: usize,
    /// Targets of a group.
    pub targets: usize,
    /// Unknowns of the target's orientation of a group: 3 or 0.
    pub rotation: usize,
    /// Groups.
    pub groups: usize,
    /// Anchors.
    pub anchors: usize,
}

impl Layout {
    /// The layout of a problem's unknowns.
    pub fn new(problem: &Problem) -> Self {
        let set = problem.measurements;
        let distances = set.is_distances();
        let free = problem.frame == FrameMode::Free && !distances;
        Self {
            arm: problem.columns.len(),
            frame: if free { 6 } else { 0 },
            targets: if distances { 1 } else { set.target_count },
            rotation: if set.has_rotations() && !distances { 3 } else { 0 },
            groups: set.group_count,
            anchors: set.anchor_count,
        }
    }

    /// Unknowns of one group.
    pub fn group_width(&self) -> usize {
        self.frame + 3 * self.targets + self.rotation
    }

    /// Where a group's unknowns stand.
    pub fn group(&self, group: usize) -> Range<usize> {
        let start = self.arm + group * self.group_width();
        start..start + self.group_width()
    }

    /// Where an anchor's coordinates stand.
    pub fn anchor(&self, anchor: usize) -> usize {
        self.arm + self.groups * self.group_width() + 3 * anchor
    }

    /// Where each group's targets stand, one coordinate after another: group, coordinate, position.
    pub fn target_coordinates(self) -> impl Iterator<Item = (usize, usize, usize)> {
        (0..self.groups).flat_map(move |group| {
            let start = self.group(group).start + self.frame;
            (0..3 * self.targets).map(move |k| (group, k, start + k))
        })
    }

    /// Prior precision of the set-up's unknowns (len - arm,): a frame is known to a metre and a radian, flat but never
    /// singular; a target's coordinates to the precision `targets`, 1/m^2.
    pub fn setup_precision(&self, targets: f64) -> Vec<f64> {
        let mut precision = vec![1.0; self.len() - self.arm];
        self.target_coordinates().for_each(|(_, _, at)| precision[at - self.arm] = targets);
        precision
    }

    /// All unknowns.
    pub fn len(&self) -> usize {
        self.arm + self.groups * self.group_width() + 3 * self.anchors
    }

    /// Whether nothing is unknown.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The set-up after a step (len,): frames and target rotations are turned from the right.
    pub fn step_setup(&self, setup: &Setup, step: &[f64]) -> Setup {
        let mut moved = setup.clone();
        for (index, group) in moved.groups.iter_mut().enumerate() {
            let part = &step[self.group(index)];
            if self.frame == 6 {
                let increment = Transform::from_rotation_vector(vector(&part[3..]), vector(part));
                group.world_from_base = group.world_from_base.compose(&increment);
            }
            for (target, point) in group.targets.iter_mut().enumerate() {
                add(point, &part[self.frame + 3 * target..]);
            }
            if self.rotation == 3 {
                let turn =
                    Transform::from_rotation_vector(vector(&part[self.frame + 3 * self.targets..]), [0.0; 3]);
                let turned =
                    Transform { rotation: group.flange_from_target, translation: [0.0; 3] }.compose(&turn);
                group.flange_from_target = turned.rotation;
            }
        }
        for (index, anchor) in moved.anchors.iter_mut().enumerate() {
            add(anchor, &step[self.anchor(index)..]);
        }
        moved
    }
}

fn vector(values: &[f64]) -> [f64; 3] {
    [values[0], values[1], values[2]]
}

fn add(point: &mut [f64; 3], step: &[f64]) {
    for (coordinate, change) in point.iter_mut().zip(step) {
        *coordinate += change;
    }
}
