//! How the end's way bends off the straight line of its Jacobian.
//!
//! Joints with screws S_1 ... S_N, from base to end, that move on by x carry the end by exp(S_1 x_1) ... exp(S_N x_N), the
//! product of exponentials (Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 3).
//! With angular parts w, and linear parts v of the end's origin, its second order is
//!
//! `f(x) = sum_j (sum_{i<j} w_i x_i + 1/2 w_j x_j) x v_j x_j`   of the position, and
//! `1/2 sum_j (sum_{i<j} w_i x_i) x w_j x_j`   of the rotation vector.

use crate::isa::Isa;
use crate::lane::Lane;
use crate::sweep::Screw;
use crate::vector::lane_cross;

/// A step's second order, in the base frame.
#[derive(Debug, Clone, Copy)]
pub struct Bent {
    /// What it brings beside its straight line: to the position, and to the rotation vector of its turn from where it
    /// starts.
    pub beside: Screw,
    /// Rotation vector of the way before it, to the first order.
    pub turned: [Lane; 3],
    /// Its own, to the first order.
    pub turn: [Lane; 3],
}

/// How a `step` (N) bends that begins after the joints have moved on by `way` (N) from where their `screws` were taken.
///
/// The position's f is quadratic: f(way + step) - f(way) is twice its bilinear form of the step and the way to the middle
/// of it. Of the turn, with x the way and s the step, `sum_j (sum_{i<j} w_i (x_i + s_i / 2)) x w_j s_j` is left.
#[inline(always)]
pub fn bend<I: Isa>(screws: &[Screw], way: &[Lane], step: &[Lane]) -> Bent {
    let mut beside = Screw::ZERO;
    // Turns so far, to the middle of the step and of the step.
    let (mut middle, mut turn) = ([Lane::ZERO; 3], [Lane::ZERO; 3]);
    for (k, screw) in screws.iter().enumerate() {
        let (on, to_middle) = (step[k], I::mul_add(step[k], Lane::splat(0.5), way[k]));
        let mut carried = [Lane::ZERO; 3];
        for i in 0..3 {
            carried[i] = middle[i] * on;
        }
        let angular = lane_cross::<I>(&carried, &screw.angular);
        for i in 0..3 {
            carried[i] = I::mul_add(turn[i], to_middle, carried[i]);
            carried[i] = I::mul_add(screw.angular[i], on * to_middle, carried[i]);
            middle[i] = I::mul_add(screw.angular[i], to_middle, middle[i]);
            turn[i] = I::mul_add(screw.angular[i], on, turn[i]);
        }
        let linear = lane_cross::<I>(&carried, &screw.linear);
        for i in 0..3 {
            beside.angular[i] += angular[i];
            beside.linear[i] += linear[i];
        }
    }
    let mut turned = middle;
    for i in 0..3 {
        turned[i] = I::mul_add(turn[i], Lane::splat(-0.5), middle[i]);
    }
    Bent { beside, turned, turn }
}
