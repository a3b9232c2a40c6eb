//! The end's origin alone: a point carried from the end back to the base, for a third of a sweep's arithmetic.

use crate::chain::{Chain, Convention, Joint};
use crate::isa::Isa;
use crate::lane::Lane;
use crate::parameters::{LaneParameters, LinkSource, LinkValues};

impl Chain {
    /// Origin of the end in the base frame, for a group of eight poses; arguments as for [`Chain::sweep`].
    #[inline(always)]
    pub fn end_point<I: Isa>(&self, joints: &[Lane], parameters: LaneParameters<'_>) -> [Lane; 3] {
        match parameters {
            LaneParameters::Shared(shared) => self.carry::<I, _>(joints, shared),
            LaneParameters::Each(lanes) => self.carry::<I, _>(joints, lanes),
            LaneParameters::One(pose) => self.carry::<I, _>(joints, pose),
        }
    }

    #[inline(always)]
    fn carry<I: Isa, S: LinkSource>(&self, joints: &[Lane], source: S) -> [Lane; 3] {
        let mut point = Lane::splat_all(&self.end().translation);
        let mut values = joints.iter().rev();
        for (index, link) in self.links().iter().enumerate().rev() {
            let value = if link.joint == Joint::Fixed { None } else { values.next() };
            let numbers = source.link::<I>(index, link.joint, value.copied().unwrap_or(Lane::ZERO));
            match self.convention() {
                Convention::Standard => standard::<I>(&mut point, &numbers),
                Convention::Modified => modified::<I>(&mut point, &numbers),
            }
        }
        let (r, from) = (&self.base().rotation, [point[0], point[1], point[2]]);
        for (i, to) in point.iter_mut().enumerate() {
            *to = Lane::splat(self.base().translation[i]);
            for k in 0..3 {
                *to = I::mul_add(from[k], Lane::splat(r[3 * i + k]), *to);
            }
        }
        point
    }
}

#[inline(always)]
fn standard<I: Isa>(point: &mut [Lane; 3], link: &LinkValues<Lane>) {
    if link.bent {
        turn::<I>(point, 2, 0, link.beta);
    }
    turn::<I>(point, 1, 2, link.alpha);
    point[0] += link.a;
    point[2] += link.d;
    turn::<I>(point, 0, 1, link.theta);
}

#[inline(always)]
fn modified<I: Isa>(point: &mut [Lane; 3], link: &LinkValues<Lane>) {
    point[2] += link.d;
    turn::<I>(point, 0, 1, link.theta);
    if link.bent {
        turn::<I>(point, 2, 0, link.beta);
    }
    point[0] += link.a;
    turn::<I>(point, 1, 2, link.alpha);
}

/// Turn a point about the axis that follows `first` and `second` in cyclic order.
#[inline(always)]
fn turn<I: Isa>(point: &mut [Lane; 3], first: usize, second: usize, (sine, cosine): (Lane, Lane)) {
    let (u, v) = (point[first], point[second]);
    point[first] = I::mul_add(u, cosine, -(v * sine));
    point[second] = I::mul_add(v, cosine, u * sine);
}
