//! The unknowns of a measurement set-up: where the arm stands and where the targets sit on the tool.

use truearm_kinematics::Transform;

use crate::EstimateError;
use crate::layout::Layout;

/// What stands between the measuring device's world and the arm's first link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameMode {
    /// `world_from_base` is an unknown of each group.
    Free,
    /// World is known: the base is part of the calibrated chain.
    World,
}

/// The set-up of one group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupSetup {
    /// Where the robot's base stands in the measuring device's frame.
    pub world_from_base: Transform,
    /// Target points in the flange frame, m.
    pub targets: Vec<[f64; 3]>,
    /// Orientation of the measured target in the flange frame, row-major.
    pub flange_from_target: [f64; 9],
}

/// The set-ups of all groups, and the anchors of distances.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// One entry per group.
    pub groups: Vec<GroupSetup>,
    /// Fixed points in the base frame, m.
    pub anchors: Vec<[f64; 3]>,
}

impl Setup {
    /// World and base coincide, targets sit at the flange's origin, anchors at the base's.
    pub fn identity(group_count: usize, target_count: usize, anchor_count: usize) -> Self {
        let group = GroupSetup {
            world_from_base: Transform::IDENTITY,
            targets: vec![[0.0; 3]; target_count],
            flange_from_target: Transform::IDENTITY.rotation,
        };
        Self { groups: vec![group; group_count], anchors: vec![[0.0; 3]; anchor_count] }
    }

    /// Checks that every group with its targets and every anchor is there. More may be: rows that are looked at later need
    /// not hold every group.
    ///
    /// # Errors
    /// [`EstimateError::Setup`].
    pub fn check(&self, layout: &Layout) -> Result<(), EstimateError> {
        let refuse = |what, found, expected| Err(EstimateError::Setup { what, found, expected });
        if self.groups.len() < layout.groups {
            return refuse("groups", self.groups.len(), layout.groups);
        }
        if self.anchors.len() < layout.anchors {
            return refuse("anchors", self.anchors.len(), layout.anchors);
        }
        match self.groups.iter().find(|group| group.targets.len() != layout.targets) {
            Some(group) => refuse("targets in a group", group.targets.len(), layout.targets),
            None => Ok(()),
        }
    }

    /// Checks that there is nothing else, as steps of a layout's unknowns need it.
    ///
    /// # Errors
    /// [`EstimateError::Setup`].
    pub fn check_steps(&self, layout: &Layout) -> Result<(), EstimateError> {
        self.check(layout)?;
        let refuse = |what, found, expected| Err(EstimateError::Setup { what, found, expected });
        if self.groups.len() != layout.groups {
            return refuse("groups", self.groups.len(), layout.groups);
        }
        if self.anchors.len() != layout.anchors {
            return refuse("anchors", self.anchors.len(), layout.anchors);
        }
        Ok(())
    }
}
