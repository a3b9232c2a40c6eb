//! One pass along the chain: the end's frame and its motion by any of the parameters.

use crate::chain::{Chain, Convention, Joint};
use crate::isa::Isa;
use crate::lane::Lane;
use crate::parameters::{LaneParameters, LinkSource, LinkValues};
use crate::transform::Transform;
use crate::trig::sin_cos;

/// Motion of the end for a unit change of one parameter, in the base frame.
///
/// The end's origin moves by `linear`, a point at offset r from it by `linear + angular x r`; the rotation
/// changes to exp(`angular`) R.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Screw {
    /// Rotation vector per unit.
    pub angular: [Lane; 3],
    /// Motion of the end's origin per unit.
    pub linear: [Lane; 3],
}

impl Screw {
    /// No motion.
    pub const ZERO: Screw = Screw { angular: [Lane::ZERO; 3], linear: [Lane::ZERO; 3] };

    /// Screws as lanes: of each, `angular`, then `linear`.
    pub(crate) fn lanes(screws: &[Screw]) -> &[Lane] {
        // SAFETY: a screw is six lanes without padding, in the order of its fields.
        unsafe { std::slice::from_raw_parts(screws.as_ptr().cast(), 6 * screws.len()) }
    }
}

/// A frame of eight poses: base_from_frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneFrame {
    /// Rotation matrix, row-major.
    pub rotation: [Lane; 9],
    /// Origin, metres.
    pub position: [Lane; 3],
}

impl LaneFrame {
    /// The same transform for all poses.
    #[inline(always)]
    pub fn splat(transform: &Transform) -> LaneFrame {
        let mut frame = LaneFrame { rotation: [Lane::ZERO; 9], position: [Lane::ZERO; 3] };
        for (lane, value) in frame.rotation.iter_mut().zip(&transform.rotation) {
            *lane = Lane::splat(*value);
        }
        for (lane, value) in frame.position.iter_mut().zip(&transform.translation) {
            *lane = Lane::splat(*value);
        }
        frame
    }

    #[inline(always)]
    fn axis(&self, k: usize) -> [Lane; 3] {
        [self.rotation[k], self.rotation[3 + k], self.rotation[6 + k]]
    }

    /// Turn about axis `2`, `0` or `1`: `first` and `second` are the other two axes in cyclic order.
    #[inline(always)]
    fn turn<I: Isa>(&mut self, first: usize, second: usize, (sine, cosine): (Lane, Lane)) {
        for row in 0..3 {
            let (u, v) = (self.rotation[3 * row + first], self.rotation[3 * row + second]);
            self.rotation[3 * row + first] = I::mul_add(u, cosine, v * sine);
            self.rotation[3 * row + second] = I::mul_add(v, cosine, -(u * sine));
        }
    }

    #[inline(always)]
    fn shift<I: Isa>(&mut self, axis: usize, by: Lane) {
        for row in 0..3 {
            self.position[row] = I::mul_add(self.rotation[3 * row + axis], by, self.position[row]);
        }
    }

    /// The frame after a fixed transform from here.
    #[inline(always)]
    fn then<I: Isa>(&self, transform: &Transform) -> LaneFrame {
        let mut out = *self;
        for axis in 0..3 {
            out.shift::<I>(axis, Lane::splat(transform.translation[axis]));
        }
        if transform.rotation == Transform::IDENTITY.rotation {
            return out;
        }
        for (index, value) in out.rotation.iter_mut().enumerate() {
            let (row, column) = (index / 3, index % 3);
            let mut sum = self.rotation[3 * row] * transform.rotation[column];
            for k in 1..3 {
                sum = I::mul_add(
                    self.rotation[3 * row + k],
                    Lane::splat(transform.rotation[3 * k + column]),
                    sum,
                );
            }
            *value = sum;
        }
        out
    }
}

/// The axes that the parameters of a link turn about or shift along, and the points the turning axes pass through.
struct Axes {
    theta: [Lane; 3],
    a: [Lane; 3],
    beta: [Lane; 3],
    theta_point: [Lane; 3],
    beta_point: [Lane; 3],
}

impl Chain {
    /// The end's frame and the screws of the wanted parameters, for a group of eight poses.
    ///
    /// `joints` are J lanes of joint values, `parameters` 5 L of the group; `columns` are wanted parameter
    /// indices (5 link + k), ascending, and `screws` is at least as long. Everything in the base frame.
    #[inline(always)]
    pub fn sweep<I: Isa>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        columns: &[usize],
        frame: &mut LaneFrame,
        screws: &mut [Screw],
    ) {
        match parameters {
            LaneParameters::Shared(shared) => {
                self.sweep_links::<I, _>(joints, shared, columns, frame, screws)
            }
            LaneParameters::Each(lanes) => self.sweep_links::<I, _>(joints, lanes, columns, frame, screws),
        }
        for (screw, column) in screws.iter_mut().zip(columns) {
            if !matches!(column % 5, 1 | 2) {
                let point = screw.linear;
                let end = &frame.position;
                let arm = [end[0] - point[0], end[1] - point[1], end[2] - point[2]];
                screw.linear = cross::<I>(&screw.angular, &arm);
            }
        }
    }

    /// The end's frame, and in `screws` each wanted axis with a point on it in place of the linear motion.
    #[inline(always)]
    fn sweep_links<I: Isa, S: LinkSource>(
        &self,
        joints: &[Lane],
        source: S,
        columns: &[usize],
        frame: &mut LaneFrame,
        screws: &mut [Screw],
    ) {
        let mut current = LaneFrame::splat(self.base());
        let mut joint = 0;
        let mut column = 0;
        for (index, link) in self.links().iter().enumerate() {
            let mut values = source.link::<I>(index);
            match link.joint {
                Joint::Revolute => values.theta += joints[joint],
                Joint::Prismatic => values.d += joints[joint],
                Joint::Fixed => {}
            }
            joint += usize::from(link.joint != Joint::Fixed);
            let axes = match self.convention() {
                Convention::Standard => standard::<I>(&mut current, &values),
                Convention::Modified => modified::<I>(&mut current, &values),
            };
            while column < columns.len() && columns[column] < 5 * (index + 1) {
                screws[column] = axes.screw(columns[column] - 5 * index);
                column += 1;
            }
        }
        *frame = current.then::<I>(self.end());
    }
}

impl Axes {
    #[inline(always)]
    fn screw(&self, k: usize) -> Screw {
        match k {
            0 => Screw { angular: self.theta, linear: self.theta_point },
            1 => Screw { angular: [Lane::ZERO; 3], linear: self.theta },
            2 => Screw { angular: [Lane::ZERO; 3], linear: self.a },
            3 => Screw { angular: self.a, linear: self.beta_point },
            _ => Screw { angular: self.beta, linear: self.beta_point },
        }
    }
}

/// Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta).
#[inline(always)]
fn standard<I: Isa>(frame: &mut LaneFrame, link: &LinkValues<Lane>) -> Axes {
    let (theta, theta_point) = (frame.axis(2), frame.position);
    frame.turn::<I>(0, 1, sin_cos::<I>(link.theta));
    frame.shift::<I>(2, link.d);
    frame.shift::<I>(0, link.a);
    let a = frame.axis(0);
    frame.turn::<I>(1, 2, link.alpha);
    let beta = frame.axis(1);
    if link.bent {
        frame.turn::<I>(2, 0, link.beta);
    }
    Axes { theta, a, beta, theta_point, beta_point: frame.position }
}

/// Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d).
#[inline(always)]
fn modified<I: Isa>(frame: &mut LaneFrame, link: &LinkValues<Lane>) -> Axes {
    let a = frame.axis(0);
    frame.turn::<I>(1, 2, link.alpha);
    frame.shift::<I>(0, link.a);
    let beta = frame.axis(1);
    if link.bent {
        frame.turn::<I>(2, 0, link.beta);
    }
    let (theta, point) = (frame.axis(2), frame.position);
    frame.turn::<I>(0, 1, sin_cos::<I>(link.theta));
    frame.shift::<I>(2, link.d);
    Axes { theta, a, beta, theta_point: point, beta_point: point }
}

#[inline(always)]
fn cross<I: Isa>(u: &[Lane; 3], v: &[Lane; 3]) -> [Lane; 3] {
    [
        I::mul_add(u[1], v[2], -(u[2] * v[1])),
        I::mul_add(u[2], v[0], -(u[0] * v[2])),
        I::mul_add(u[0], v[1], -(u[1] * v[0])),
    ]
}
