//! Which joints the `major` block varies with, chosen by the evidence.
//!
//! Usual are the arm's first three joints, and the two or three after the first, about which gravity does not turn: they
//! stand against each other. Against them stands what backward elimination from all joints ends at on a small training set:
//! the joint whose absence costs least after refitting goes, until three are left; length scales alone do not tell, since a
//! long one may still carry a first harmonic. It is the best of dozens of choices, and so has to be far ahead
//! (docs/decisions/0004). A joint must bring [`WORTH`] nats to stay; two stay always.

use truearm_bank::InputKind;
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::ascent::climb;
use crate::evidence::Evidence;
use crate::hyper::Hyper;
use crate::optimise::Limits;
use crate::training::Training;

/// A joint must bring this many nats to stay.
const WORTH: f64 = 3.0;
/// So many nats the best of all choices may be ahead of the usual ones by chance.
const CHANCE: f64 = 25.0;
/// Joints of the `major` block at the most: its grid grows with their power.
const MOST: usize = 3;
/// One joint alone is what `smooth` blocks hold already.
const FEWEST: usize = 2;
const FIRST: Limits = Limits { evaluations: 40, gain: 0.1 };
const RIVAL: Limits = Limits { evaluations: 16, gain: 0.2 };
const REFIT: Limits = Limits { evaluations: 8, gain: 0.3 };

/// Hyper-parameters, the logarithm of their evidence and prior, and what it cost to find them.
#[derive(Debug, Clone)]
pub struct Found {
    pub hyper: Hyper,
    pub value: f64,
    pub evaluations: usize,
}

/// The usual joints of an arm, each choice once and of [`FEWEST`] at least, those that the search begins with first.
fn usual_joints(count: usize) -> Vec<Vec<usize>> {
    let known = [0..3, 1..3, 1..4].into_iter();
    let mut choices: Vec<Vec<usize>> =
        known.map(|joints| joints.filter(|&joint| joint < count).collect()).collect();
    choices.retain(|joints| joints.len() >= FEWEST.min(count));
    choices.dedup();
    choices
}

/// What is left of the evidence of `found` once its joints, and how they were chosen, are counted against it.
fn net(found: &Found, joints: usize) -> f64 {
    let major = found.hyper.major_joints();
    let chance = if usual_joints(joints).iter().any(|usual| usual == major) { 0.0 } else { CHANCE };
    found.value - WORTH * major.len() as f64 - chance
}

/// Hyper-parameters of three joints at the most, fitted to a small training set from several starts: the first of the
/// usual joints, or what elimination ends at.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn select_major(
    training: &Training,
    joints: usize,
    noise: [f64; 2],
    cancel: &Cancel,
) -> Result<Found, FieldError> {
    let evidence = Evidence::new(training, cancel);
    let first = usual_joints(joints).into_iter().next().unwrap_or_default();
    let (mut begun, mut usual) = (0, None::<Found>);
    let lines = training.inputs.iter().any(|input| input.kind == InputKind::Line);
    for start in Hyper::starts(&first, joints, noise, lines) {
        let found = refine(&evidence, start, FIRST)?;
        begun += found.evaluations;
        if usual.as_ref().is_none_or(|usual| found.value > usual.value) {
            usual = Some(found);
        }
    }
    let usual = usual.ok_or(FieldError::Length { what: "starts", found: 0, expected: 1 })?;
    let all = refine(&evidence, usual.hyper.with_major((0..joints).collect()), FIRST)?;
    let mut evaluations = begun + all.evaluations;
    // With fewer joints it can hardly be more.
    if all.value - WORTH * FEWEST as f64 - CHANCE <= net(&usual, joints) {
        return Ok(Found { evaluations, ..usual });
    }
    let mut other = all;
    while other.hyper.major_joints().len() > MOST {
        other = cheapest_removal(&evidence, &other, &mut evaluations)?;
    }
    let best = if net(&other, joints) > net(&usual, joints) { other } else { usual };
    Ok(Found { evaluations, ..best })
}

/// The best of `found` and the usual joints, by what is left of their evidence.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn contest_major(evidence: &Evidence, found: Found, joints: usize) -> Result<Found, FieldError> {
    let mut evaluations = found.evaluations;
    let present = found.hyper.clone();
    let mut best = found;
    for rival in usual_joints(joints) {
        if rival == present.major_joints() {
            continue;
        }
        let rival = present.with_major(rival);
        if rival.major_is_wrist() {
            continue;
        }
        let candidate = refine(evidence, rival, RIVAL)?;
        evaluations += candidate.evaluations;
        if net(&candidate, joints) > net(&best, joints) {
            best = candidate;
        }
    }
    Ok(Found { evaluations, ..best })
}

/// Takes out joints that bring less than [`WORTH`], one by one, while more than [`FEWEST`] are left.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn prune_major(evidence: &Evidence, mut best: Found) -> Result<Found, FieldError> {
    while best.hyper.major_joints().len() > FEWEST {
        let mut evaluations = best.evaluations;
        let candidate = cheapest_removal(evidence, &best, &mut evaluations)?;
        if best.value - candidate.value >= WORTH {
            best.evaluations = evaluations;
            break;
        }
        best = Found { evaluations, ..candidate };
    }
    Ok(best)
}

/// The removal that costs least, among those that leave more than joints of the wrist.
fn cheapest_removal(evidence: &Evidence, from: &Found, evaluations: &mut usize) -> Result<Found, FieldError> {
    let mut best: Option<Found> = None;
    for position in 0..from.hyper.major_joints().len() {
        let candidate = from.hyper.without_major(position);
        if candidate.major_is_wrist() {
            continue;
        }
        let found = refine(evidence, candidate, REFIT)?;
        *evaluations += found.evaluations;
        if best.as_ref().is_none_or(|best| found.value > best.value) {
            best = Some(found);
        }
    }
    best.ok_or(FieldError::Length { what: "joints of the major block", found: 0, expected: 1 })
}

/// Maximises the evidence from given hyper-parameters.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn refine(evidence: &Evidence, start: Hyper, limits: Limits) -> Result<Found, FieldError> {
    let informed = |logs: &[f64]| evidence.informed(&start.with_logs(logs));
    let summit = climb(informed, &start.to_logs(), &start.ranges(), limits)?;
    Ok(Found { hyper: start.with_logs(&summit.point), value: summit.value, evaluations: summit.evaluations })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_joints_are_two_at_least_and_each_choice_once() {
        let sets = |joints: &[&[usize]]| joints.iter().map(|set| set.to_vec()).collect::<Vec<_>>();
        assert_eq!(usual_joints(6), sets(&[&[0, 1, 2], &[1, 2], &[1, 2, 3]]));
        assert_eq!(usual_joints(3), sets(&[&[0, 1, 2], &[1, 2]]));
        assert_eq!(usual_joints(2), sets(&[&[0, 1]]));
        assert_eq!(usual_joints(1), sets(&[&[0]]));
    }
}
