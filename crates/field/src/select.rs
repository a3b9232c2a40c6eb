//! Which joints the `major` block varies with, chosen by the evidence.
//!
//! Backward elimination from all joints: the joint whose absence costs least after refitting goes, until three are
//! left, and further while one costs less than [`WORTH`]. Length scales alone do not tell: a long one may still carry
//! a first harmonic.

use truearm_estimate::Cancel;

use crate::FieldError;
use crate::evidence::Evidence;
use crate::hyper::Hyper;
use crate::optimise::{Limits, Optimum, maximise};
use crate::training::Training;

/// A joint must bring this many nats to stay.
const WORTH: f64 = -1e9;
/// Joints of the `major` block at the most: its grid grows with their power.
const MOST: usize = 3;
const FIRST: Limits = Limits { evaluations: 40, gain: 0.1 };
const REFIT: Limits = Limits { evaluations: 8, gain: 0.3 };

/// Hyper-parameters with the chosen joints, fitted to the (small) training set.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn select_major(
    training: &Training,
    joints: usize,
    noise: [f64; 2],
    cancel: &Cancel,
) -> Result<Hyper, FieldError> {
    let evidence = Evidence::new(training, cancel);
    let all: Vec<usize> = (0..joints).collect();
    let start = Hyper::start(&all, noise);
    let mut best = start.clone();
    let mut value = refine(&evidence, &mut best, FIRST)?.value;
    while best.major_joints.len() > 1 {
        let (candidate, reached) = cheapest_removal(&evidence, &best)?;
        if best.major_joints.len() <= MOST && value - reached >= WORTH {
            break;
        }
        (best, value) = (candidate, reached);
    }
    Ok(best)
}

fn cheapest_removal(evidence: &Evidence, from: &Hyper) -> Result<(Hyper, f64), FieldError> {
    let mut best: Option<(Hyper, f64)> = None;
    for position in 0..from.major_joints.len() {
        let mut candidate = from.without(position);
        let value = refine(evidence, &mut candidate, REFIT)?.value;
        if best.as_ref().is_none_or(|(_, reached)| value > *reached) {
            best = Some((candidate, value));
        }
    }
    best.ok_or(FieldError::Length { what: "joints of the major block", found: 0, expected: 1 })
}

/// Maximises the evidence from given hyper-parameters, which become the best found.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn refine(evidence: &Evidence, hyper: &mut Hyper, limits: Limits) -> Result<Optimum, FieldError> {
    let shape = hyper.clone();
    let optimum =
        maximise(|logs| evidence.score(&shape.with_logs(logs)), &hyper.to_logs(), &hyper.ranges(), limits)?;
    *hyper = shape.with_logs(&optimum.point);
    Ok(optimum)
}
