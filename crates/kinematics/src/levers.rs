//! By how much the joints lift the links: what a joint's drive carries of the links' weights.

use crate::chain::{Chain, Joint};
use crate::frame::LaneFrame;
use crate::isa::Isa;
use crate::lane::Lane;
use crate::parameters::LaneParameters;
use crate::sweep::Axes;

/// Number of levers of so many joints: one for each joint with itself and with each one behind it.
pub const fn lever_count(joints: usize) -> usize {
    joints * (joints + 1) / 2
}

/// What levers are worked out in.
#[derive(Debug, Clone)]
pub struct LeverScratch {
    /// Axis and origin of each joint's frame.
    frames: Vec<[[Lane; 3]; 2]>,
}

impl LeverScratch {
    /// Room for a chain.
    pub fn new(chain: &Chain) -> Self {
        Self { frames: vec![[[Lane::ZERO; 3]; 2]; chain.joint_count()] }
    }
}

impl Chain {
    /// Derivatives of heights by the joints, for a group of eight poses; `joints` and `parameters` as for
    /// [`Chain::sweep`].
    ///
    /// `out` holds [`lever_count`] lanes: for each joint j and each k from j on the derivative, by joint j, of the
    /// height (z in the base frame, m) at which the link that joint k moves ends; m/rad, for a prismatic joint m/m.
    /// A weight there loads joint j with so much of itself.
    #[inline(always)]
    pub fn levers<I: Isa>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        scratch: &mut LeverScratch,
        out: &mut [Lane],
    ) {
        let mut seen =
            Frames { columns: self.joint_columns(), link: 0, next: 0, frames: &mut scratch.frames };
        let end = self.walk::<I, _>(joints, parameters, &mut seen);
        let kinds = self.links().iter().map(|link| link.joint).filter(|joint| *joint != Joint::Fixed);
        let (frames, mut at) = (&scratch.frames, 0);
        for (j, kind) in kinds.enumerate() {
            let [axis, point] = &frames[j];
            for k in j..frames.len() {
                let tip = frames.get(k + 1).map_or(&end.position, |frame| &frame[1]);
                out[at] = match kind {
                    Joint::Prismatic => axis[2],
                    _ => I::mul_add(axis[0], tip[1] - point[1], -(axis[1] * (tip[0] - point[0]))),
                };
                at += 1;
            }
        }
    }
}

/// Gathers the frame of each joint.
struct Frames<'a> {
    columns: &'a [usize],
    link: usize,
    next: usize,
    frames: &'a mut [[[Lane; 3]; 2]],
}

impl Frames<'_> {
    #[inline(always)]
    fn take(&mut self, k: usize, frame: &LaneFrame) {
        if self.columns.get(self.next) == Some(&(5 * self.link + k)) {
            self.frames[self.next] = [frame.axis(2), frame.position];
            self.next += 1;
        }
    }
}

impl Axes for Frames<'_> {
    #[inline(always)]
    fn enter(&mut self, link: usize) {
        self.link = link;
    }

    #[inline(always)]
    fn turns(&mut self, k: usize, frame: &LaneFrame, _axis: usize) {
        self.take(k, frame);
    }

    #[inline(always)]
    fn shifts(&mut self, k: usize, frame: &LaneFrame, _axis: usize) {
        self.take(k, frame);
    }
}
