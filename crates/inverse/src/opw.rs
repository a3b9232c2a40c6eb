//! Ortho-parallel base and spherical wrist, by rs-opw-kinematics.
//!
//! Its model, with q the model's angles: base . Rz(q1) T(a1, b, 0) Ry(q2) Tz(c2) Ry(q3) Tx(a2) Rz(q4) Tz(c3)
//! Ry(q5) Rz(q6) . end. Brandstötter, Angerer, Hofbaur: An analytical solution of the inverse kinematics
//! problem of industrial serial manipulators with an ortho-parallel basis and a spherical wrist (2014).

use rs_opw_kinematics::glam::{DMat3, DQuat, DVec3};
use rs_opw_kinematics::kinematic_traits::{Kinematics, Pose};
use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;
use truearm_kinematics::{Transform, cross, norm};

use crate::axes::Axes;
use crate::branch::Planar;
use crate::shape::{Base, MEETING_M, frame, square};
use crate::vector::{dot, sub, unit_across};

#[derive(Debug, Clone)]
pub struct Opw {
    solver: OPWKinematics,
    model_from_base: Transform,
    end_from_wrist: Transform,
    pub planar: Planar,
}

impl Opw {
    /// The plain arm nearest to the axes, if they are near to one.
    pub fn of(axes: &Axes, base: &Base) -> Option<Opw> {
        let [_, _, third, fourth, fifth, sixth] = axes.lines.as_slice() else {
            return None;
        };
        let (wrist, gap) = fourth.meeting(fifth)?;
        let apart = norm(sub(sixth.nearest(wrist), wrist));
        let squared =
            square(fourth, base.y) && square(fifth, fourth.direction) && square(sixth, fifth.direction);
        if !squared || gap.max(apart) > MEETING_M {
            return None;
        }
        let arm = sub(wrist, third.point);
        let along = unit_across(fourth.direction, base.y)?;
        let sign = if dot(arm, along) < 0.0 { -1.0 } else { 1.0 };
        let z4 = along.map(|x| sign * x);
        let x4 = cross(base.y, z4);
        let (u, w) = base.planar(z4);
        let (a2, c3) = (dot(arm, x4), dot(arm, z4));
        let y5 = unit_across(fifth.direction, z4)?;
        let z6 = unit_across(sixth.direction, y5)?;
        let starts = [
            0.0,
            base.start,
            u.atan2(w) - base.start,
            (-dot(y5, x4)).atan2(dot(y5, base.y)),
            dot(z6, cross(y5, z4)).atan2(dot(z6, z4)),
            0.0,
        ];
        let parameters = Parameters {
            a1: base.a1,
            a2,
            b: dot(sub(wrist, base.origin), base.y),
            c1: 0.0,
            c2: base.c2,
            c3,
            c4: 0.0,
            offsets: starts.map(|angle| -wrapped(angle)),
            sign_corrections: [1, 1, base.sign as i8, sign as i8, 1, 1],
            dof: 6,
        };
        let base_from_wrist = frame(cross(y5, z6), y5, z6, wrist);
        Some(Opw {
            solver: OPWKinematics::new(parameters),
            model_from_base: base.frame().inverse(),
            end_from_wrist: axes.end.inverse().compose(&base_from_wrist),
            planar: Planar {
                start: [starts[1], starts[2], 0.0],
                sign: [1.0, base.sign, 1.0],
                a1: base.a1,
                c2: base.c2,
                forearm: (a2.hypot(c3), a2.atan2(c3)),
                hand: 0.0,
                wrist: Some(starts[4]),
            },
        })
    }

    /// Joint values, rad, at which the plain arm's end has the pose, base_from_end; up to eight, near the seed where a
    /// joint is open.
    pub fn candidates(&self, base_from_end: &Transform, seed: &[f64; 6]) -> Vec<[f64; 6]> {
        let wrist = self.model_from_base.compose(base_from_end).compose(&self.end_from_wrist);
        let r = &wrist.rotation;
        let matrix = DMat3::from_cols(
            DVec3::new(r[0], r[3], r[6]),
            DVec3::new(r[1], r[4], r[7]),
            DVec3::new(r[2], r[5], r[8]),
        );
        let [x, y, z] = wrist.translation;
        match Pose::try_from_parts(DVec3::new(x, y, z), DQuat::from_mat3(&matrix)) {
            Ok(pose) => self.solver.inverse_continuing(&pose, seed),
            // Only a pose that is not finite: nothing reaches it.
            Err(_) => Vec::new(),
        }
    }
}

fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::TAU;
    angle - TAU * (angle / TAU).round()
}
