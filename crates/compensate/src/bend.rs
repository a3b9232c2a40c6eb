//! The screws that a Jacobian was made of, by which its steps bend.

use truearm_kinematics::{Bent, Isa, Lane, Screw, bend};

/// The screws of eight poses, and where they were taken.
#[derive(Debug, Clone)]
pub(crate) struct Bend {
    screws: Vec<Screw>,
    /// Joint values there, N.
    from: Vec<Lane>,
    way: Vec<Lane>,
}

impl Bend {
    /// Room for N joints.
    pub fn new(joints: usize) -> Self {
        let lanes = vec![Lane::ZERO; joints];
        Self { screws: vec![Screw::ZERO; joints], from: lanes.clone(), way: lanes }
    }

    /// Takes over the screws by N joint values, and these, of the poses with the flag `stale`.
    #[inline(always)]
    pub fn take(&mut self, screws: &[Screw], joints: &[Lane], stale: Lane) {
        for (kept, new) in self.screws.iter_mut().zip(screws) {
            for i in 0..3 {
                kept.angular[i] = Lane::ZERO.where_below(stale, new.angular[i], kept.angular[i]);
                kept.linear[i] = Lane::ZERO.where_below(stale, new.linear[i], kept.linear[i]);
            }
        }
        for (kept, new) in self.from.iter_mut().zip(joints) {
            *kept = Lane::ZERO.where_below(stale, *new, *kept);
        }
    }

    /// How a step of the joint values from `joints` on bends.
    #[inline(always)]
    pub fn along<I: Isa>(&mut self, joints: &[Lane], step: &[Lane]) -> Bent {
        for ((way, joint), from) in self.way.iter_mut().zip(joints).zip(&self.from) {
            *way = *joint - *from;
        }
        bend::<I>(&self.screws, &self.way, step)
    }
}
