//! Which way is up in the base frame, as the evidence has it.
//!
//! An arm on a wall whose file does not say so would have levers of the wrong heights. Which of two opposite directions is
//! up does not matter: weights of the `sag` block have either sign.

use truearm_bank::{InputKind, UPRIGHT};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::evidence::Evidence;
use crate::hyper::Hyper;
use crate::optimise::Limits;
use crate::select::{Found, refine};
use crate::training::Training;

const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Directions beside the base's z axis: any is within 36 degrees of z, of one of them or of an opposite.
const DIRECTIONS: [[f64; 3]; 8] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [HALF, 0.0, HALF],
    [-HALF, 0.0, HALF],
    [0.0, HALF, HALF],
    [0.0, -HALF, HALF],
    [HALF, HALF, 0.0],
    [HALF, -HALF, 0.0],
];
/// Amplitudes to begin with, rad/m: the one that was found explains nothing where up is wrong.
const AMPLITUDES: [f64; 3] = [3e-4, 1.5e-3, 8e-3];
/// So many nats the best of all directions may be ahead of z by chance.
const CHANCE: f64 = 6.0;
/// Levers that are shorter than this, m, are none: axes that stand upright have nothing to bear, and any other direction
/// could only gain.
const NO_LEVER: f64 = 1e-6;
const REFIT: Limits = Limits { evaluations: 16, gain: 0.2 };

/// Whether no joint that turns has a lever. Those of slides are the same at all poses of an arm whose axes all stand upright.
fn no_axis_bears(upright: &Training) -> bool {
    let joints: Vec<usize> = upright.geometry.joints().collect();
    let turns = |joint: usize| upright.inputs[joint].kind == InputKind::Angle;
    let of_pose = |pose| joints.iter().zip(upright.levers_of(pose)).filter(|&(&joint, _)| turns(joint));
    (0..upright.pose_count()).flat_map(of_pose).all(|(_, lever)| lever.abs() < NO_LEVER)
}

/// The best of `found`, whose up is the z axis, and of the other directions, on the rows it was found on.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn contest_up(training: &Training, found: Found, cancel: &Cancel) -> Result<Found, FieldError> {
    if no_axis_bears(&training.clone().lifted(UPRIGHT)?) {
        return Ok(found);
    }
    let mut evaluations = found.evaluations;
    let mut best: Option<(f64, Hyper)> = None;
    for up in DIRECTIONS {
        let lifted = training.clone().lifted(up)?;
        let evidence = Evidence::new(&lifted, cancel);
        for sag in AMPLITUDES {
            let hyper = Hyper { up, sag, ..found.hyper.clone() };
            let value = evidence.value(&hyper)?;
            evaluations += 1;
            if best.as_ref().is_none_or(|(most, _)| value > *most) {
                best = Some((value, hyper));
            }
        }
    }
    let Some((_, hyper)) = best.filter(|(value, _)| *value > found.value) else {
        return Ok(Found { evaluations, ..found });
    };
    let lifted = training.clone().lifted(hyper.up)?;
    let other = refine(&Evidence::new(&lifted, cancel), hyper, REFIT)?;
    evaluations += other.evaluations;
    let ahead = other.value > found.value + CHANCE;
    Ok(Found { evaluations, ..if ahead { other } else { found } })
}
