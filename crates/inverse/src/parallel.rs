//! Three parallel axes across the first and the fifth, as arms of Universal Robots have them.
//!
//! The model, with q its angles: base . Rz(q1) T(a1, b, 0) Ry(q2) Tz(c2) Ry(q3) Tz(c3) Ry(q4) Tz(c4) Rz(q5)
//! Ry(q6) . end. The first joint follows from how far the wrist is beside the arm's plane, the fifth and sixth
//! from the end's direction, and two links in a plane remain (Hawkins: Analytic inverse kinematics for the
//! Universal Robots UR-5/UR-10 arms, 2013).

use std::f64::consts::{PI, TAU};

use truearm_kinematics::{Transform, cross};

use crate::axes::Axes;
use crate::branch::Planar;
use crate::shape::{Base, MEETING_M, along, frame, square};
use crate::vector::{Vector, dot, sub, unit_across};

/// How far beyond its reach a pose of a plain arm may be and still be tried stretched: the arm at hand may
/// not be quite plain.
const BEYOND: f64 = 1e-3;
/// Sine of the fifth joint below which the fourth and the sixth turn about one axis.
const ONE_AXIS: f64 = 1e-9;

#[derive(Debug, Clone)]
pub struct Parallel {
    b: f64,
    c3: f64,
    start: [f64; 6],
    sign: [f64; 6],
    model_from_base: Transform,
    end_from_wrist: Transform,
    pub planar: Planar,
}

impl Parallel {
    /// The plain arm nearest to the axes, if they are near to one.
    pub fn of(axes: &Axes, base: &Base) -> Option<Parallel> {
        let [_, _, third, fourth, fifth, sixth] = axes.lines.as_slice() else {
            return None;
        };
        if !along(fourth, base.y) || !square(fifth, base.y) || !square(sixth, fifth.direction) {
            return None;
        }
        let (wrist, gap) = fifth.meeting(sixth)?;
        let z4 = unit_across(fifth.direction, base.y)?;
        let x4 = cross(base.y, z4);
        let hand = sub(wrist, fourth.point);
        let (u, w) = base.planar(sub(fourth.point, third.point));
        let c3 = u.hypot(w);
        if gap.max(dot(hand, x4).abs()) > MEETING_M || c3 < MEETING_M {
            return None;
        }
        let upper = u.atan2(w);
        let (u, w) = base.planar(z4);
        let y6 = unit_across(sixth.direction, z4)?;
        let q5 = (-dot(y6, x4)).atan2(dot(y6, base.y));
        let start = [0.0, base.start, upper - base.start, u.atan2(w) - upper, q5, 0.0];
        let sign = [1.0, 1.0, base.sign, dot(fourth.direction, base.y).signum(), 1.0, 1.0];
        let base_from_wrist = frame(cross(y6, z4), y6, z4, wrist);
        Some(Parallel {
            b: dot(sub(wrist, base.origin), base.y),
            c3,
            start,
            sign,
            model_from_base: base.frame().inverse(),
            end_from_wrist: axes.end.inverse().compose(&base_from_wrist),
            planar: Planar {
                start: [start[1], start[2], start[3]],
                sign: [sign[1], sign[2], sign[3]],
                a1: base.a1,
                c2: base.c2,
                forearm: (c3, 0.0),
                hand: dot(hand, z4),
                wrist: Some(q5),
            },
        })
    }

    /// Joint values, rad, at which the plain arm's end has the pose, base_from_end; up to eight, near the seed where a
    /// joint is open.
    pub fn candidates(&self, base_from_end: &Transform, seed: &[f64; 6]) -> Vec<[f64; 6]> {
        let wrist = self.model_from_base.compose(base_from_end).compose(&self.end_from_wrist);
        let mut found = Vec::with_capacity(8);
        for q1 in self.shoulders(wrist.translation) {
            for bent in [1.0, -1.0] {
                let hand = self.hand(&wrist, q1, bent, seed);
                self.elbows(&wrist, q1, &hand, &mut found);
            }
        }
        found
    }

    /// Angles of the first joint at which the wrist is beside the arm's plane by b.
    fn shoulders(&self, wrist: Vector) -> Vec<f64> {
        let distance = wrist[0].hypot(wrist[1]);
        if distance * (1.0 + BEYOND) < self.b.abs() {
            return Vec::new();
        }
        let (ahead, aside) = (wrist[1].atan2(wrist[0]), bounded(self.b / distance).asin());
        vec![ahead - aside, ahead - PI + aside]
    }

    /// Angles of the second to fourth joint together, of the fifth and of the sixth.
    fn hand(&self, wrist: &Transform, q1: f64, bent: f64, seed: &[f64; 6]) -> [f64; 3] {
        let r = &wrist.rotation;
        let (s1, c1) = q1.sin_cos();
        let seen = |k: usize| [c1 * r[k] + s1 * r[3 + k], c1 * r[3 + k] - s1 * r[k], r[6 + k]];
        let (y, z) = (seen(1), seen(2));
        let sine = y[0].hypot(y[2]);
        if sine < ONE_AXIS {
            // The sixth joint turns about the same axis as the arm: it stays where the seed has it.
            let q6 = self.start[5] + self.sign[5] * seed[5];
            let (q5, turn) = if y[1] > 0.0 { (0.0, 1.0) } else { (PI, -1.0) };
            return [z[0].atan2(z[2]) - turn * q6, q5, q6];
        }
        let q5 = (bent * sine).atan2(y[1]);
        let all = (bent * y[2]).atan2(-bent * y[0]);
        let (s, c) = all.sin_cos();
        let before = [s, 0.0, c];
        [all, q5, dot(z, cross(y, before)).atan2(dot(z, before))]
    }

    /// The two ways of the planar links to reach the hand.
    fn elbows(&self, wrist: &Transform, q1: f64, hand: &[f64; 3], found: &mut Vec<[f64; 6]>) {
        let [all, q5, q6] = *hand;
        let (s1, c1) = q1.sin_cos();
        let [px, py, pz] = wrist.translation;
        let (c2, c3) = (self.planar.c2, self.c3);
        let u = c1 * px + s1 * py - self.planar.a1 - self.planar.hand * all.sin();
        let w = pz - self.planar.hand * all.cos();
        let cosine = (u * u + w * w - c2 * c2 - c3 * c3) / (2.0 * c2 * c3);
        if cosine.abs() > 1.0 + BEYOND {
            return;
        }
        for side in [1.0, -1.0] {
            let q3 = side * bounded(cosine).acos();
            let q2 = u.atan2(w) - (c3 * q3.sin()).atan2(c2 + c3 * q3.cos());
            let model = [q1, q2, q3, all - q2 - q3, q5, q6];
            let mut joints = [0.0; 6];
            for (i, joint) in joints.iter_mut().enumerate() {
                let value = self.sign[i] * (model[i] - self.start[i]);
                *joint = value - TAU * (value / TAU).round();
            }
            found.push(joints);
        }
    }
}

fn bounded(x: f64) -> f64 {
    x.clamp(-1.0, 1.0)
}
