//! Rotation vectors from frames to their targets, of eight poses at once.
//!
//! A cross product gives the axis times the sine with all digits; a series gives angle / sine for small angles. Of larger
//! ones the sine is that of an eighth times cosines, `sin a = 8 sin(a / 8) cos(a / 8) cos(a / 4) cos(a / 2)`. Half a turn,
//! whose sine has no axis, is taken pose by pose: rare, and so kept out of the way.

use truearm_kinematics::{
    Isa, LANES, Lane, LaneFrame, Transform, cross, lane_cross, norm, polynomial, rotation_log,
};

use crate::task::dot;

/// Squared sine of half an angle up to which the series alone tells angle / sine to 1e-16.
const SMALL: f64 = 6e-3;
/// angle / sine in the squared sine of half the angle: 4^k k!^2 / (2 k + 1)! (Abramowitz and Stegun, 4.4.40 and 4.4.43).
const ANGLE_BY_SINE: [f64; 7] =
    [1.0, 2.0 / 3.0, 8.0 / 15.0, 16.0 / 35.0, 128.0 / 315.0, 256.0 / 693.0, 1024.0 / 3003.0];
/// How often a larger angle is halved: an eighth of it is told to 1e-10 at least.
const HALVINGS: usize = 3;
/// Squared cosine of half an angle below which rounding has a part in its axis.
const OPPOSITE: f64 = 1e-6;
/// So near half a turn rounding would say which way round it goes, rad.
const EITHER_WAY: f64 = 1e-9;
/// Half a turn of an axis may go about all that are square to it: about one that is square to few arms' joints, x and y.
const SKEW: [f64; 2] = [0.6, 0.8];

/// Rotation vector that turns a frame to its target, base frame, rad; half a turn goes about the axis whose
/// largest component is positive.
#[inline(always)]
pub(crate) fn turn<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 3] {
    let mut sine = [Lane::ZERO; 3];
    let mut trace = Lane::ZERO;
    for k in 0..3 {
        let (from, to) = (frame.axis(k), target.axis(k));
        trace += dot::<I>(&from, &to);
        let part = lane_cross::<I>(&from, &to);
        for (sum, part) in sine.iter_mut().zip(part) {
            *sum += part * 0.5;
        }
    }
    let half = (Lane::splat(3.0) - trace) * 0.25;
    rotation_vector::<I>(&sine, half, |i| opposite(&frame.pose(i), &target.pose(i)))
}

/// The same of the tool's axis alone, whatever the turn about it.
#[inline(always)]
pub(crate) fn axis_turn<I: Isa>(frame: &LaneFrame, target: &LaneFrame) -> [Lane; 3] {
    let (axis, wanted) = (frame.axis(2), target.axis(2));
    let half = (Lane::splat(1.0) - dot::<I>(&axis, &wanted)) * 0.5;
    let sine = lane_cross::<I>(&axis, &wanted);
    rotation_vector::<I>(&sine, half, |i| opposite_axis(&frame.pose(i), &target.pose(i)))
}

/// Axis times angle, from axis times sine and the squared sine of half the angle; about half a turn what `opposite` says.
#[inline(always)]
fn rotation_vector<I: Isa>(sine: &[Lane; 3], half: Lane, opposite: impl Fn(usize) -> [f64; 3]) -> [Lane; 3] {
    let mut factor = polynomial::<I>(&ANGLE_BY_SINE, half);
    let small = Lane::splat(SMALL);
    if small.any_below(half) {
        factor = small.where_below(half, by_parts::<I>(half), factor);
    }
    let vector = [sine[0] * factor, sine[1] * factor, sine[2] * factor];
    let nearly = Lane::splat(1.0 - OPPOSITE);
    if nearly.any_below(half) { each_opposite(half, vector, opposite) } else { vector }
}

/// angle / sine by that of a part of the angle, and the cosines of what was halved.
#[inline(always)]
fn by_parts<I: Isa>(mut half: Lane) -> Lane {
    let (one, mut cosines) = (Lane::splat(1.0), Lane::splat(1.0));
    for _ in 0..HALVINGS {
        let cosine = (one - half).sqrt();
        cosines = cosines * cosine;
        half = (one - cosine) * 0.5;
    }
    polynomial::<I>(&ANGLE_BY_SINE, half) / cosines
}

#[cold]
#[inline(never)]
fn each_opposite(half: Lane, mut turn: [Lane; 3], vector: impl Fn(usize) -> [f64; 3]) -> [Lane; 3] {
    for i in (0..LANES).filter(|&i| half.0[i] > 1.0 - OPPOSITE) {
        for (lane, value) in turn.iter_mut().zip(vector(i)) {
            lane.0[i] = value;
        }
    }
    turn
}

fn opposite(frame: &Transform, target: &Transform) -> [f64; 3] {
    let vector = rotation_log(&target.compose(&frame.inverse()).rotation);
    let largest = vector.into_iter().fold(0.0_f64, |most, x| if x.abs() > most.abs() { x } else { most });
    let down = largest < 0.0 && norm(vector) > std::f64::consts::PI - EITHER_WAY;
    vector.map(|x| if down { -x } else { x })
}

fn opposite_axis(frame: &Transform, target: &Transform) -> [f64; 3] {
    let axis = |frame: &Transform| frame.rotate([0.0, 0.0, 1.0]);
    let (from, to) = (axis(frame), axis(target));
    let sine = cross(from, to);
    let (size, cosine) = (norm(sine), (0..3).map(|k| from[k] * to[k]).sum::<f64>());
    let angle = size.atan2(cosine);
    if size > EITHER_WAY {
        sine.map(|x| x * angle / size)
    } else {
        frame.rotate([SKEW[0] * angle, SKEW[1] * angle, 0.0])
    }
}
