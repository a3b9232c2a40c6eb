//! One pass along the chain: the end's frame and its motion by any of the parameters.

use crate::chain::{Chain, Convention, Joint};
use crate::frame::{Carried, LaneFrame, OneFrame};
use crate::isa::Isa;
use crate::lane::Lane;
use crate::parameters::{LaneParameters, LinkSource, LinkValues, is_length};
use crate::vector::lane_cross;

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
        for (screw, _) in screws.iter_mut().zip(columns).filter(|(_, column)| is_length(**column)) {
            screw.angular = [Lane::ZERO; 3];
        }
        self.sweep_again::<I>(joints, parameters, columns, frame, screws);
    }

    /// The same into zero screws, or into those of other poses with the same columns: what shifts has no angular part, and
    /// stores of zeros where zeros are cost a Jacobian a twentieth of its time.
    #[inline(always)]
    pub fn sweep_again<I: Isa>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        columns: &[usize],
        frame: &mut LaneFrame,
        screws: &mut [Screw],
    ) {
        let mut axes = Wanted { columns, next: 0, slots: [NOT_WANTED; 5], screws };
        *frame = self.walk::<I, _>(joints, parameters, &mut axes);
        for (screw, column) in screws.iter_mut().zip(columns) {
            if !is_length(*column) {
                let (end, point) = (&frame.position, &screw.linear);
                let arm = [end[0] - point[0], end[1] - point[1], end[2] - point[2]];
                screw.linear = lane_cross::<I>(&screw.angular, &arm);
            }
        }
    }

    /// The end's frame alone; arguments as for [`Chain::sweep`].
    #[inline(always)]
    pub fn end_frame<I: Isa>(&self, joints: &[Lane], parameters: LaneParameters<'_>) -> LaneFrame {
        self.walk::<I, _>(joints, parameters, &mut NoAxes)
    }

    /// The end's frame; shows `axes` every frame on the way.
    #[inline(always)]
    pub(crate) fn walk<I: Isa, A: Axes>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        axes: &mut A,
    ) -> LaneFrame {
        match parameters {
            LaneParameters::Shared(shared) => {
                self.walk_links::<I, _, _, _>(joints, shared, LaneFrame::splat(self.base()), axes)
            }
            LaneParameters::Each(lanes) => {
                self.walk_links::<I, _, _, _>(joints, lanes, LaneFrame::splat(self.base()), axes)
            }
            LaneParameters::One(pose) => {
                self.walk_links::<I, _, _, _>(joints, pose, OneFrame::new(self.base()), axes)
            }
        }
    }

    #[inline(always)]
    fn walk_links<I: Isa, S: LinkSource, F: Carried, A: Axes>(
        &self,
        joints: &[Lane],
        source: S,
        mut frame: F,
        axes: &mut A,
    ) -> LaneFrame {
        let mut joint = 0;
        for (index, link) in self.links().iter().enumerate() {
            let value = if link.joint == Joint::Fixed { Lane::ZERO } else { joints[joint] };
            joint += usize::from(link.joint != Joint::Fixed);
            let values = source.link::<I>(index, link.joint, value);
            axes.enter(index);
            match self.convention() {
                Convention::Standard => standard::<I, F, A>(&mut frame, &values, axes),
                Convention::Modified => modified::<I, F, A>(&mut frame, &values, axes),
            }
        }
        let [x, y, z] = self.end().translation;
        frame.shift::<I>(0, Lane::splat(x));
        frame.shift::<I>(1, Lane::splat(y));
        frame.shift::<I>(2, Lane::splat(z));
        if self.end_turns() {
            frame.rotate::<I>(&self.end().rotation);
        }
        frame.here()
    }
}

/// Sees the frames on the way along the chain in which the parameters of the links move what comes after.
pub(crate) trait Axes {
    /// Here begins a link.
    fn enter(&mut self, link: usize);

    /// Parameter k of the link turns about an axis of the frame through its origin.
    fn turns<F: Carried>(&mut self, k: usize, frame: &F, axis: usize);

    /// Parameter k of the link shifts along an axis of the frame.
    fn shifts<F: Carried>(&mut self, k: usize, frame: &F, axis: usize);
}

/// Only the end is wanted.
struct NoAxes;

impl Axes for NoAxes {
    #[inline(always)]
    fn enter(&mut self, _link: usize) {}

    #[inline(always)]
    fn turns<F: Carried>(&mut self, _k: usize, _frame: &F, _axis: usize) {}

    #[inline(always)]
    fn shifts<F: Carried>(&mut self, _k: usize, _frame: &F, _axis: usize) {}
}

/// Slot of a parameter that is not wanted: beyond all screws.
const NOT_WANTED: usize = usize::MAX;

/// Gathers the axes of some parameters: those that turn with a point on them in place of the linear motion.
struct Wanted<'a> {
    columns: &'a [usize],
    next: usize,
    slots: [usize; 5],
    screws: &'a mut [Screw],
}

impl Axes for Wanted<'_> {
    #[inline(always)]
    fn enter(&mut self, link: usize) {
        self.slots = [NOT_WANTED; 5];
        while let Some(column) = self.columns.get(self.next)
            && *column < 5 * (link + 1)
        {
            self.slots[*column - 5 * link] = self.next;
            self.next += 1;
        }
    }

    #[inline(always)]
    fn turns<F: Carried>(&mut self, k: usize, frame: &F, axis: usize) {
        if let Some(screw) = self.screws.get_mut(self.slots[k]) {
            let frame = frame.here();
            screw.angular = frame.axis(axis);
            screw.linear = frame.position;
        }
    }

    #[inline(always)]
    fn shifts<F: Carried>(&mut self, k: usize, frame: &F, axis: usize) {
        if let Some(screw) = self.screws.get_mut(self.slots[k]) {
            screw.linear = frame.here().axis(axis);
        }
    }
}

/// Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta).
#[inline(always)]
fn standard<I: Isa, F: Carried, A: Axes>(frame: &mut F, link: &LinkValues<Lane>, axes: &mut A) {
    axes.turns(0, frame, 2);
    axes.shifts(1, frame, 2);
    frame.turn::<I>(0, 1, link.theta);
    frame.shift::<I>(2, link.d);
    axes.shifts(2, frame, 0);
    frame.shift::<I>(0, link.a);
    axes.turns(3, frame, 0);
    frame.turn::<I>(1, 2, link.alpha);
    axes.turns(4, frame, 1);
    if link.bent {
        frame.turn::<I>(2, 0, link.beta);
    }
}

/// Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d).
#[inline(always)]
fn modified<I: Isa, F: Carried, A: Axes>(frame: &mut F, link: &LinkValues<Lane>, axes: &mut A) {
    axes.turns(3, frame, 0);
    frame.turn::<I>(1, 2, link.alpha);
    axes.shifts(2, frame, 0);
    frame.shift::<I>(0, link.a);
    axes.turns(4, frame, 1);
    if link.bent {
        frame.turn::<I>(2, 0, link.beta);
    }
    axes.turns(0, frame, 2);
    axes.shifts(1, frame, 2);
    frame.turn::<I>(0, 1, link.theta);
    frame.shift::<I>(2, link.d);
}
