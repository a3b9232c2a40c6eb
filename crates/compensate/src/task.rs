//! What of a pose is to be met, as rows of an error and of its Jacobian.

use truearm_kinematics::{Bent, Isa, Lane, LaneFrame, Screw, lane_cross};

use crate::turn::{axis_turn, turn};

/// What the corrected joints bring the tool to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Task {
    /// Position and orientation.
    #[default]
    Pose,
    /// Position and the direction of the tool's z axis.
    Axis,
    /// Position.
    Position,
}

impl Task {
    /// Numbers that are to be met.
    pub fn rows(self) -> usize {
        match self {
            Self::Pose => 6,
            Self::Axis => 5,
            Self::Position => 3,
        }
    }
}

/// The rows of a task. Rows 0 to 2 are the position's, in the base frame.
pub(crate) trait Goal<const M: usize> {
    /// From where the frame is to the target: a shift and a rotation vector.
    fn error<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; M];

    /// Motion of the rows by a screw.
    fn column<I: Isa>(screw: &Screw, frame: &LaneFrame) -> [Lane; M];

    /// What a step from where the frame is brings to the rows beside its straight line.
    #[inline(always)]
    fn bent<I: Isa>(bent: &Bent, frame: &LaneFrame) -> [Lane; M] {
        Self::column::<I>(&bent.beside, frame)
    }
}

pub(crate) struct PoseGoal;
pub(crate) struct AxisGoal;
pub(crate) struct PositionGoal;

impl Goal<6> for PoseGoal {
    #[inline(always)]
    fn error<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 6] {
        let ([x, y, z], [u, v, w]) = (shift(frame, target), turn::<I>(frame, target));
        [x, y, z, u, v, w]
    }

    #[inline(always)]
    fn column<I: Isa>(screw: &Screw, _frame: &LaneFrame) -> [Lane; 6] {
        let ([x, y, z], [u, v, w]) = (screw.linear, screw.angular);
        [x, y, z, u, v, w]
    }
}

impl Goal<5> for AxisGoal {
    #[inline(always)]
    fn error<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 5] {
        let [x, y, z] = shift(frame, target);
        let turn = axis_turn::<I>(frame, target);
        [x, y, z, dot::<I>(&frame.axis(0), &turn), dot::<I>(&frame.axis(1), &turn)]
    }

    #[inline(always)]
    fn column<I: Isa>(screw: &Screw, frame: &LaneFrame) -> [Lane; 5] {
        let [x, y, z] = screw.linear;
        [x, y, z, dot::<I>(&frame.axis(0), &screw.angular), dot::<I>(&frame.axis(1), &screw.angular)]
    }

    /// The turn about the tool's axis, which is free, carries that about the others with it; and the axes that rows are
    /// told in have turned since the columns were taken.
    #[inline(always)]
    fn bent<I: Isa>(bent: &Bent, frame: &LaneFrame) -> [Lane; 5] {
        let mut rows = Self::column::<I>(&bent.beside, frame);
        let (x, y) = (frame.axis(0), frame.axis(1));
        let half = dot::<I>(&frame.axis(2), &bent.turn) * 0.5;
        rows[3] = I::mul_add(-half, dot::<I>(&y, &bent.turn), rows[3]);
        rows[4] = I::mul_add(half, dot::<I>(&x, &bent.turn), rows[4]);
        rows[3] += dot::<I>(&bent.turned, &lane_cross::<I>(&x, &bent.turn));
        rows[4] += dot::<I>(&bent.turned, &lane_cross::<I>(&y, &bent.turn));
        rows
    }
}

impl Goal<3> for PositionGoal {
    #[inline(always)]
    fn error<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 3] {
        shift(frame, target)
    }

    #[inline(always)]
    fn column<I: Isa>(screw: &Screw, _frame: &LaneFrame) -> [Lane; 3] {
        screw.linear
    }
}

/// From the frame's origin to the target's.
#[inline(always)]
pub(crate) fn shift(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 3] {
    let (p, t) = (&frame.position, &target.position);
    [t[0] - p[0], t[1] - p[1], t[2] - p[2]]
}

#[inline(always)]
pub(crate) fn dot<I: Isa>(u: &[Lane; 3], v: &[Lane; 3]) -> Lane {
    I::mul_add(u[0], v[0], I::mul_add(u[1], v[1], u[2] * v[2]))
}
