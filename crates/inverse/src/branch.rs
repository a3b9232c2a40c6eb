//! The branch of a configuration: shoulder, elbow and wrist.

use crate::axes::Axes;
use crate::shape::{Base, MEETING_M};
use crate::vector::sub;

/// On which side an arm's shoulder, elbow and wrist are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Branch {
    /// The wrist is on the side of the first axis that the arm faces.
    pub front: bool,
    /// The elbow is above the line from the second axis to the wrist.
    pub up: bool,
    /// The fifth joint is bent the negative way; `None` where the wrist has one solution.
    pub flip: Option<bool>,
}

/// The arm in the plane of its second and third link.
#[derive(Debug, Clone)]
pub struct Planar {
    /// Model angles of joints 2, 3 and 4 with all joint values zero; that of joint 4 of parallel arms only.
    pub start: [f64; 3],
    /// Directions of the same joints.
    pub sign: [f64; 3],
    pub a1: f64,
    pub c2: f64,
    /// Length from the third axis to the wrist and its angle against the third link's z.
    pub forearm: (f64, f64),
    /// Length behind the fourth axis, of arms with three parallel ones.
    pub hand: f64,
    /// Model angle of joint 5 with joint value zero, of arms with six axes.
    pub wrist: Option<f64>,
}

impl Planar {
    /// The planar part of an arm with a base of two parallel axes across the first; `None` where it has none.
    pub fn of_five_axes(axes: &Axes, base: &Base) -> Option<Planar> {
        let [_, _, third, fourth, fifth] = axes.lines.as_slice() else {
            return None;
        };
        let wrist = match fourth.meeting(fifth) {
            Some((point, gap)) if gap < MEETING_M => point,
            _ => fourth.point,
        };
        let (u, w) = base.planar(sub(wrist, third.point));
        Some(Planar {
            start: [base.start, u.atan2(w) - base.start, 0.0],
            sign: [1.0, base.sign, 1.0],
            a1: base.a1,
            c2: base.c2,
            forearm: (u.hypot(w), 0.0),
            hand: 0.0,
            wrist: None,
        })
    }

    /// The branch of joint values.
    pub fn branch(&self, joints: &[f64]) -> Branch {
        let [q2, q3, q4] = [0, 1, 2].map(|i| self.start[i] + self.sign[i] * joints[i + 1]);
        let (length, angle) = self.forearm;
        let bent = q3 + angle;
        let wrist =
            self.a1 + self.c2 * q2.sin() + length * (q2 + bent).sin() + self.hand * (q2 + q3 + q4).sin();
        let front = wrist >= 0.0;
        Branch {
            front,
            up: (bent.sin() >= 0.0) == front,
            flip: self.wrist.map(|start| (start + joints[4]).sin() < 0.0),
        }
    }
}
