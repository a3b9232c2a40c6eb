//! What of a pose is to be met, as rows of an error and of its Jacobian.

use truearm_kinematics::{Bent, Isa, Lane, LaneFrame, Screw, lane_cross};

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

/// A turn of half a turn has no direction; its error counts as so much.
const HALF_TURN: f64 = 1e3;
/// Of 2 (1 + cos) of a turn's angle: below it the turn is half a turn.
const OPPOSITE: f64 = 1e-9;

/// The rows of a task. Rows 0 to 2 are the position's, in the base frame.
pub(crate) trait Goal<const M: usize> {
    /// The target minus where the frame is; of angles twice the tangent of half of them.
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

/// Turn from the frame to the target in the base frame: its axis times twice the tangent of half its angle, which is
/// the rotation vector but for the third order.
#[inline(always)]
pub(crate) fn turn<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 3] {
    let mut twice = [Lane::ZERO; 3];
    let mut trace = Lane::ZERO;
    for k in 0..3 {
        let (from, to) = (frame.axis(k), target.axis(k));
        trace += dot::<I>(&from, &to);
        let part = lane_cross::<I>(&from, &to);
        for (sum, part) in twice.iter_mut().zip(part) {
            *sum += part;
        }
    }
    let mut sine = twice;
    for value in &mut sine {
        *value = *value * 0.5;
    }
    halved(sine, trace + Lane::splat(1.0))
}

/// The same of the tool's axis alone, whatever the turn about it.
#[inline(always)]
pub(crate) fn axis_turn<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 3] {
    let (axis, wanted) = (frame.axis(2), target.axis(2));
    let cosine = dot::<I>(&axis, &wanted);
    halved(lane_cross::<I>(&axis, &wanted), cosine * 2.0 + Lane::splat(2.0))
}

/// Axis times twice the tangent of half the angle, from axis times sine and from 2 (1 + cosine).
#[inline(always)]
fn halved(sine: [Lane; 3], denominator: Lane) -> [Lane; 3] {
    let least = Lane::splat(OPPOSITE);
    let factor = Lane::splat(4.0) / denominator.where_below(least, least, denominator);
    let x = sine[0] * factor;
    let opposite = denominator.where_below(least, Lane::splat(HALF_TURN), x);
    [opposite, sine[1] * factor, sine[2] * factor]
}

#[inline(always)]
pub(crate) fn dot<I: Isa>(u: &[Lane; 3], v: &[Lane; 3]) -> Lane {
    I::mul_add(u[0], v[0], I::mul_add(u[1], v[1], u[2] * v[2]))
}
