//! How the tool's way bends off the straight line of its Jacobian.
//!
//! Joints with screws S_1 ... S_N, from base to tool, that move on by x carry the tool by exp(S_1 x_1) ... exp(S_N x_N), the
//! product of exponentials (Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, section 3.2).
//! With angular parts w, and linear parts v of the tool's own point, its second order is
//!
//! `f(x) = sum_j (sum_{i<j} w_i x_i + 1/2 w_j x_j) x v_j x_j`   of the position, and
//! `1/2 sum_j (sum_{i<j} w_i x_i) x w_j x_j`   of the rotation vector.

use truearm_kinematics::{Isa, Lane, Screw, lane_cross};

/// The screws of eight poses and where they were taken.
#[derive(Debug, Clone)]
pub(crate) struct Bend {
    screws: Vec<Screw>,
    /// Joint values there, N.
    from: Vec<Lane>,
}

impl Bend {
    /// Room for N joints.
    pub fn new(joints: usize) -> Self {
        Self { screws: vec![Screw::ZERO; joints], from: vec![Lane::ZERO; joints] }
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

    /// What a step from `joints` by `step` brings beside its straight line, `f(x + step) - f(x)` of the way x to `joints`.
    ///
    /// f is quadratic: the difference is twice its bilinear form of the step and the way to the middle of it.
    #[inline(always)]
    pub fn along<I: Isa>(&self, joints: &[Lane], step: &[Lane]) -> Screw {
        let mut found = Screw::ZERO;
        let (mut turned, mut turn) = ([Lane::ZERO; 3], [Lane::ZERO; 3]);
        for (k, screw) in self.screws.iter().enumerate() {
            let (on, way) = (step[k], I::mul_add(step[k], Lane::splat(0.5), joints[k] - self.from[k]));
            let mut carried = [Lane::ZERO; 3];
            for i in 0..3 {
                carried[i] = I::mul_add(turned[i], on, turn[i] * way);
            }
            let angular = lane_cross::<I>(&carried, &screw.angular);
            for i in 0..3 {
                carried[i] = I::mul_add(screw.angular[i], on * way, carried[i]);
                turned[i] = I::mul_add(screw.angular[i], way, turned[i]);
                turn[i] = I::mul_add(screw.angular[i], on, turn[i]);
            }
            let linear = lane_cross::<I>(&carried, &screw.linear);
            for i in 0..3 {
                found.angular[i] = I::mul_add(angular[i], Lane::splat(0.5), found.angular[i]);
                found.linear[i] += linear[i];
            }
        }
        found
    }
}
