//! How a correction changes along a path.
//!
//! The shift of the tool may change by so much for each metre of the tool's way, its turn by so much for each radian
//! that the tool turns; a radian counts as [`ANGLE_ARM`] metres, so that a tool that turns on the spot may
//! be shifted differently as well. So may one that rests while the joints move: the way of the joint that goes
//! farthest counts where it is longer.

use truearm_kinematics::{ANGLE_ARM, LaneFrame, norm};

use crate::corrector::{Correction, Corrector};
use crate::refusal::{Reason, Refusal};

/// Waypoints further apart in a joint are no path: the arm changes its configuration between them, rad.
const PATH_JOINT: f64 = std::f64::consts::FRAC_PI_2;
/// Change that is always allowed, m and rad: many times what converged searches differ by.
const ALWAYS: f64 = 1e-7;

/// Correction of a waypoint, and where the program means the tool to be.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mark {
    pub correction: Correction,
    point: [f64; 3],
    rotation: [f64; 9],
}

impl Mark {
    /// Of waypoint `i` of a group, and the target of its tool in the base frame.
    #[inline(always)]
    pub fn new(correction: Correction, target: &LaneFrame, i: usize) -> Self {
        let mut mark = Self { correction, point: [0.0; 3], rotation: [0.0; 9] };
        for (value, lane) in mark.point.iter_mut().zip(&target.position) {
            *value = lane.0[i];
        }
        for (value, lane) in mark.rotation.iter_mut().zip(&target.rotation) {
            *value = lane.0[i];
        }
        mark
    }
}

impl Mark {
    /// Whether the waypoint was good, or refused for nothing but the change up to it.
    fn is_comparable(&self) -> bool {
        let of_change = |refusal: Refusal| matches!(refusal.reason, Reason::ShiftChange | Reason::TurnChange);
        self.correction.refusal.is_none_or(of_change)
    }
}

impl Corrector {
    /// Whether the correction changes too fast between two waypoints; `readings` begin with theirs.
    ///
    /// Those that are refused for themselves have no correction to compare with.
    pub(crate) fn refuse_change(&self, before: &Mark, after: &Mark, readings: &[f64]) -> Option<Refusal> {
        let (limits, count) = (&self.options.limits, self.joint_count());
        let (from, to) = (&readings[..count], &readings[count..2 * count]);
        if !before.is_comparable()
            || !after.is_comparable()
            || from.iter().zip(to).any(|(a, b)| (a - b).abs() > PATH_JOINT)
        {
            return None;
        }
        let way = apart(&before.point, &after.point) + ANGLE_ARM * chord(&before.rotation, &after.rotation);
        let way = way.max(self.joint_way(from, to));
        let shift = apart(&before.correction.shift, &after.correction.shift);
        let turn = apart(&before.correction.turn, &after.correction.turn);
        let shift_limit = limits.shift_change * way + ALWAYS;
        let turn_limit = limits.turn_change * way / ANGLE_ARM + ALWAYS;
        if shift > shift_limit {
            return Some(Refusal::new(Reason::ShiftChange, shift, shift_limit));
        }
        (turn > turn_limit).then(|| Refusal::new(Reason::TurnChange, turn, turn_limit))
    }

    /// How far the joint goes that goes farthest between two readings, m; a radian counts as [`ANGLE_ARM`].
    fn joint_way(&self, from: &[f64], to: &[f64]) -> f64 {
        let chain = &self.calibrated.chain;
        let each = from.iter().zip(to).enumerate();
        each.map(|(joint, (a, b))| (a - b).abs() * if chain.slides(joint) { 1.0 } else { ANGLE_ARM })
            .fold(0.0, f64::max)
    }
}

fn apart(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    norm([b[0] - a[0], b[1] - a[1], b[2] - a[2]])
}

/// Twice the sine of half the angle between two rotations, which is the angle but for the third order.
fn chord(a: &[f64; 9], b: &[f64; 9]) -> f64 {
    (0.5 * a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>()).sqrt()
}
