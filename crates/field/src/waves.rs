//! Waves that gears and encoders leave in a joint's angle, finer than its own curve can be.
//!
//! A toothed or harmonic drive errs once or twice a turn of its motor, an encoder once a pole: some hundred cycles a turn of
//! the joint, at a fixed place in it. A cosine and a sine hold such a wave wherever the joint goes. With `s_i` how hard the
//! residuals of pose i pull at the joint's angle (Rao's score of it under the present model), a wave of c cycles gains
//!
//! `1/2 z^T I^-1 z`,   z = sum s_i (cos c q_i, sin c q_i),   I = sum s_i^2 (cos, sin) (cos, sin)^T
//!
//! nats (the score test with White's covariance, which a few wild poses do not deceive). The best of all cycles is the
//! best of many chances: it has to be ahead of what chance brings them.

use std::f64::consts::TAU;

use rayon::prelude::*;
use truearm_estimate::Cancel;

use crate::FieldError;
use crate::cells::range;
use crate::evidence::Evidence;
use crate::hyper::{Hyper, Wave};
use crate::kernel::InputKind;
use crate::pairs::ByColumn;
use crate::training::Training;

/// Cycles a turn: fewer are for the joint's own curve, more are beyond gears and encoders.
const CYCLES: [f64; 2] = [8.0, 520.0];
/// Steps of the scan for each cycle more over the range that the joint covers: neighbours hardly differ.
const STEPS: f64 = 5.0;
/// Least part of a turn that a joint must cover for its waves to be told from each other.
const LEAST_TURN: f64 = 0.1;
/// Nats by which a wave has to be ahead of what the number of choices brings by chance: between two that are independent
/// lie others, so that one fit in fifty finds a wave where there is none.
const SURE: f64 = 6.0;
/// Nats that a whole number of cycles may be behind: gears and encoders have whole numbers of teeth and poles.
const WHOLE: f64 = 1.0;
/// Poses below which there is no telling.
const FEWEST: usize = 50;
/// Rounds at the most, each with a wave a joint.
const ROUNDS: usize = 4;

/// The hyper-parameters with the waves that the residuals of a training set show; `None` where there are none.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn find_waves(training: &Training, hyper: &Hyper, cancel: &Cancel) -> Result<Option<Hyper>, FieldError> {
    if training.pose_count() < FEWEST {
        return Ok(None);
    }
    let (evidence, by_column) = (Evidence::new(training, cancel), ByColumn::new(training));
    let mut found = hyper.clone();
    for _ in 0..ROUNDS {
        let pull = evidence.pull(&found)?;
        let joints: Vec<(usize, usize)> = (0..training.inputs.len())
            .filter(|&joint| training.inputs[joint].kind == InputKind::Angle)
            .filter_map(|joint| by_column.own[joint].map(|(column, _)| (joint, column)))
            .collect();
        let new: Vec<Wave> = joints
            .par_iter()
            .filter_map(|&(joint, column)| Scan::new(training, joint, column, &pull).best(joints.len()))
            .collect();
        if new.is_empty() {
            break;
        }
        new.into_iter().for_each(|wave| take(&mut found.waves, wave));
    }
    Ok((found.waves.len() > hyper.waves.len()).then_some(found))
}

/// A wave beside the others; more of a known one makes that one larger.
fn take(waves: &mut Vec<Wave>, wave: Wave) {
    let same =
        |known: &&mut Wave| known.joint == wave.joint && (known.cycles - wave.cycles).abs() < 1.0 / STEPS;
    match waves.iter_mut().find(same) {
        Some(known) => known.amplitude = known.amplitude.hypot(wave.amplitude),
        None => waves.push(wave),
    }
}

/// One joint's values and how hard each pose pulls at its angle.
struct Scan {
    joint: usize,
    values: Vec<f64>,
    scores: Vec<f64>,
}

/// Sums over the poses at one number of cycles.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    score: [f64; 2],
    /// Of cosine and cosine, cosine and sine, sine and sine.
    information: [f64; 3],
}

impl Scan {
    fn new(training: &Training, joint: usize, column: usize, pull: &[f64]) -> Self {
        let score = |pose: usize| -> f64 {
            training.rows(pose).map(|row| training.jacobian_row(row)[column] * pull[row]).sum()
        };
        let poses = 0..training.pose_count();
        Self {
            joint,
            values: poses.clone().map(|pose| training.values_of(pose)[joint]).collect(),
            scores: poses.map(score).collect(),
        }
    }

    /// The wave that gains most, where that is more than chance; so many joints are looked at.
    fn best(&self, joints: usize) -> Option<Wave> {
        let (low, high) = range(&self.values);
        let turns = (high - low) / TAU;
        if turns < LEAST_TURN {
            return None;
        }
        let step = 1.0 / (STEPS * turns);
        let count = ((CYCLES[1] - CYCLES[0]) / step) as usize;
        let (mut best, mut cycles) = (0.0, CYCLES[0]);
        for (k, sums) in self.sums(CYCLES[0], step, count).into_iter().enumerate() {
            if sums.gain() > best {
                (best, cycles) = (sums.gain(), CYCLES[0] + step * k as f64);
            }
        }
        // Independent choices: one for each cycle more over the range covered.
        let choices = joints as f64 * count as f64 / STEPS;
        if best < SURE + choices.max(1.0).ln() {
            return None;
        }
        let whole = cycles.round();
        if (whole - cycles).abs() < step * STEPS && self.at(whole).gain() > best - WHOLE {
            cycles = whole;
        }
        let [cosine, sine] = self.at(cycles).weights();
        Some(Wave { joint: self.joint, cycles, amplitude: cosine.hypot(sine) * 0.5_f64.sqrt() })
    }

    /// Sums at `count` numbers of cycles: from one to the next each pose turns by the same angle.
    fn sums(&self, first: f64, step: f64, count: usize) -> Vec<Sums> {
        let mut all = vec![Sums::default(); count];
        for (value, score) in self.values.iter().zip(&self.scores) {
            let (mut sine, mut cosine) = (first * value).sin_cos();
            let (by_sine, by_cosine) = (step * value).sin_cos();
            for sums in &mut all {
                sums.add(*score, cosine, sine);
                (cosine, sine) = (cosine * by_cosine - sine * by_sine, sine * by_cosine + cosine * by_sine);
            }
        }
        all
    }

    fn at(&self, cycles: f64) -> Sums {
        let mut sums = Sums::default();
        for (value, score) in self.values.iter().zip(&self.scores) {
            let (sine, cosine) = (cycles * value).sin_cos();
            sums.add(*score, cosine, sine);
        }
        sums
    }
}

impl Sums {
    fn add(&mut self, score: f64, cosine: f64, sine: f64) {
        let (c, s) = (score * cosine, score * sine);
        self.score[0] += c;
        self.score[1] += s;
        self.information[0] += c * c;
        self.information[1] += c * s;
        self.information[2] += s * s;
    }

    /// `I^-1 z`: the weights of cosine and sine, rad; zero where the poses cannot tell one from the other.
    fn weights(&self) -> [f64; 2] {
        let ([c, s], [cc, cs, ss]) = (self.score, self.information);
        let determinant = cc * ss - cs * cs;
        if determinant <= f64::EPSILON * cc * ss {
            return [0.0; 2];
        }
        [(ss * c - cs * s) / determinant, (cc * s - cs * c) / determinant]
    }

    fn gain(&self) -> f64 {
        let [cosine, sine] = self.weights();
        0.5 * (cosine * self.score[0] + sine * self.score[1])
    }
}
