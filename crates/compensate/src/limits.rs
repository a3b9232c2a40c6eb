//! What a correction may be.

use truearm_kinematics::Chain;

use crate::error::{CompensateError, check_bounds};
use crate::plan::{Left, Plan};
use crate::refusal::{Reason, Refusal};

/// Bounds of a correction; infinity switches one off.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Lowest and highest reading of each joint, rad or m; empty for none.
    pub joints: Vec<[f64; 2]>,
    /// Largest change of a revolute joint's reading, rad.
    pub largest_angle: f64,
    /// Largest change of a prismatic joint's reading, m.
    pub largest_slide: f64,
    /// Largest shift of the tool, m.
    pub largest_shift: f64,
    /// Largest turn of the tool, rad.
    pub largest_turn: f64,
    /// Largest standard deviation of the tool's position, m.
    pub largest_std: f64,
    /// Largest change of the shift along a path, m per m.
    pub shift_change: f64,
    /// Largest change of the turn along a path, rad per rad.
    pub turn_change: f64,
    /// How far from its target the tool may stay, m; off the plane that an arm cannot leave `largest_shift` counts.
    pub residual: f64,
    /// How far it may stay turned from it, rad; with fewer than six joints, which cannot meet every orientation,
    /// `largest_turn` counts.
    pub residual_turn: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            joints: Vec::new(),
            largest_angle: 3.0_f64.to_radians(),
            largest_slide: 10e-3,
            largest_shift: 5e-3,
            largest_turn: 1.0_f64.to_radians(),
            largest_std: f64::INFINITY,
            shift_change: 0.05,
            turn_change: 0.05,
            residual: 1e-9,
            residual_turn: 1e-8,
        }
    }
}

impl Limits {
    /// Largest standard deviation of the tool's position for models that know it, unless told otherwise, m.
    pub const LARGEST_STD: f64 = 1e-3;

    pub(crate) fn check(&self, joints: usize) -> Result<(), CompensateError> {
        if !self.joints.is_empty() && self.joints.len() != joints {
            let (found, expected) = (self.joints.len(), joints);
            return Err(CompensateError::Length { what: "the joint limits", found, expected });
        }
        for (joint, &[low, high]) in (1..).zip(&self.joints) {
            if low.is_nan() || high.is_nan() || low > high {
                return Err(CompensateError::JointLimits { joint, low, high });
            }
        }
        check_bounds(&[
            ("the largest correction of a revolute joint", self.largest_angle),
            ("the largest correction of a prismatic joint", self.largest_slide),
            ("the largest shift", self.largest_shift),
            ("the largest turn", self.largest_turn),
            ("the largest standard deviation", self.largest_std),
            ("the largest change of the shift", self.shift_change),
            ("the largest change of the turn", self.turn_change),
            ("the residual", self.residual),
            ("the residual turn", self.residual_turn),
        ])
    }
}

impl Limits {
    /// Whether the tool stays too far from its target in pose `i`.
    pub(crate) fn refuse_residual(&self, plan: &Plan, left: &Left, i: usize) -> Option<Refusal> {
        let turn = if plan.position_first() { self.largest_turn } else { self.residual_turn };
        Refusal::above(Reason::PositionNotReached, left.position.0[i], self.residual)
            .or_else(|| Refusal::above(Reason::PositionNotReached, left.aside.0[i], self.largest_shift))
            .or_else(|| Refusal::above(Reason::OrientationNotReached, left.turn.0[i], turn))
    }

    /// Largest change of a joint's reading, m where it slides, else rad.
    pub(crate) fn largest_correction(&self, slides: bool) -> f64 {
        if slides { self.largest_slide } else { self.largest_angle }
    }

    /// The first joint whose reading is beyond its limits; `before` it is corrected, so far that no correction helps.
    pub(crate) fn refuse_reading(
        &self,
        chain: &Chain,
        before: bool,
        reading: impl Fn(usize) -> f64,
    ) -> Option<Refusal> {
        for (joint, [low, high]) in self.joints.iter().enumerate() {
            let (value, slides) = (reading(joint), chain.slides(joint));
            let slack = if before { self.largest_correction(slides) } else { 0.0 };
            if value < *low - slack || value > *high + slack {
                let limit = if value < *low { *low } else { *high };
                return Some(Refusal { reason: Reason::JointLimit, joint: joint + 1, value, limit, slides });
            }
        }
        None
    }
}
