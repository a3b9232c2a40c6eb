//! Waves that gears, encoders and screws leave in a joint's angle or way, finer than its own curve can be.
//!
//! A toothed or harmonic drive errs once or twice a turn of its motor, an encoder once a pole: some hundred cycles a turn of
//! the joint, at a fixed place in it; a screw errs once a pitch. A cosine and a sine hold such a wave wherever the joint goes.
//! With `s_i` how hard the residuals of pose i pull at the joint's angle (Rao's score of it under the present model), a wave of
//! c cycles gains
//!
//! `1/2 z^T I^-1 z`,   z = sum s_i (cos c q_i, sin c q_i),   I = sum s_i^2 (cos, sin) (cos, sin)^T
//!
//! nats (the score test with White's covariance, by which a few wild poses never make a wave; they hide one, so that outliers
//! are weighed down before). The best of all cycles is the best of many chances: it has to be ahead of what chance
//! brings them. Poses that stand on a grid cannot tell some numbers of cycles from others; such a wave is not taken.

use std::f64::consts::TAU;

use rayon::prelude::*;
use truearm_bank::{InputKind, range};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::evidence::Evidence;
use crate::hyper::{Hyper, Wave};
use crate::pairs::ByColumn;
use crate::training::Training;

/// What is sought of a kind of joint; cycles are in phase by value, so those a turn of one that turns.
#[derive(Debug, Clone, Copy)]
struct Sought {
    /// Fewer are for the joint's own curve, more are beyond its drive.
    cycles: [f64; 2],
    /// Where the scan begins: too few cycles for a wave, but a grid of poses may show them as more.
    from: f64,
    /// Range of values that a joint must cover at the least, for its waves to be told from each other, and may at the most: a
    /// reading beyond is no joint's.
    covered: [f64; 2],
    /// Cycles that the range must hold at the least.
    fewest: f64,
    /// Whether a whole number of cycles is likelier.
    whole: bool,
}

/// Joints that turn: from 8 to 520 cycles a turn of gears and encoders, which have whole numbers of teeth and poles.
const TURNING: Sought =
    Sought { cycles: [8.0, 520.0], from: 1.0, covered: [0.1 * TAU, 16.0 * TAU], fewest: 0.0, whole: true };
/// Joints that slide: pitches of 1 m, of a long rack, over those of a pinion's turn down to 1 mm.
const SLIDING: Sought = Sought {
    cycles: [TAU, 1000.0 * TAU],
    from: 0.25 * TAU,
    covered: [0.02, 200.0],
    fewest: 3.0,
    whole: false,
};

/// Steps of the scan for each cycle more over the range that the joint covers: neighbours hardly differ.
const STEPS: f64 = 5.0;
/// Nats by which a wave has to be ahead of what the number of choices brings by chance: between two that are independent
/// lie others, so that one fit in fifty finds a wave where there is none.
const SURE: f64 = 6.0;
/// Nats that a whole number of cycles may be behind.
const WHOLE: f64 = 1.0;
/// Nats within which another number of cycles explains the same as well, and the least coherence of the two over the
/// poses that makes it the same: a second wave has hardly any with the first.
const RIVAL: f64 = 3.0;
const SAME: f64 = 0.8;
/// Cycles by which two scans of nearly the same poses may differ.
const SLIGHTLY: f64 = 0.1;
/// Narrowings of a maximum between two steps of the scan, by the golden section each.
const NARROWINGS: usize = 24;
/// Least part of its value that is left of a determinant where cosine and sine are told apart.
const APART: f64 = 1e-6;
/// Poses below which there is no telling.
const FEWEST: usize = 50;
/// Rounds at the most, each with a wave a joint.
const ROUNDS: usize = 4;

/// The waves that the residuals of a training set show under hyper-parameters, whatever waves these have.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn find_waves(training: &Training, hyper: &Hyper, cancel: &Cancel) -> Result<Vec<Wave>, FieldError> {
    let mut found = Hyper { waves: Vec::new(), ..hyper.clone() };
    if training.pose_count() < FEWEST {
        return Ok(found.waves);
    }
    let (evidence, by_column) = (Evidence::by_row(training, cancel), ByColumn::new(training));
    let drives: Vec<(usize, usize, f64)> = by_column.curved().collect();
    for _ in 0..ROUNDS {
        let pull = evidence.pull(&found)?;
        let new: Vec<(Wave, f64)> = drives
            .par_iter()
            .filter_map(|&(joint, p, lever)| Scan::new(training, joint, (p, lever), &pull).best(drives.len()))
            .collect();
        if new.is_empty() {
            break;
        }
        new.into_iter().for_each(|(wave, within)| take(&mut found.waves, wave, within));
    }
    Ok(found.waves)
}

/// Whether two scans found the same: waves of equal joints, cycles and, but for a factor of two, amplitudes.
pub fn are_alike(first: &[Wave], second: &[Wave]) -> bool {
    let alike = |one: &Wave, other: &Wave| {
        let ratio = one.amplitude / other.amplitude;
        one.joint == other.joint
            && (one.cycles - other.cycles).abs() < SLIGHTLY
            && (0.5..2.0).contains(&ratio)
    };
    first.len() == second.len() && first.iter().all(|one| second.iter().any(|other| alike(one, other)))
}

/// A wave beside the others; more of a known one, whose cycles are the same within so many, makes that one larger.
fn take(waves: &mut Vec<Wave>, wave: Wave, within: f64) {
    let same = |known: &&mut Wave| known.joint == wave.joint && (known.cycles - wave.cycles).abs() < within;
    match waves.iter_mut().find(same) {
        Some(known) => known.amplitude = known.amplitude.hypot(wave.amplitude),
        None => waves.push(wave),
    }
}

/// One joint's values and how hard each pose pulls at its angle or way.
struct Scan {
    joint: usize,
    sought: Sought,
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
    /// Of a joint whose column moves by `lever` for each rad of amplitude.
    fn new(training: &Training, joint: usize, (column, lever): (usize, f64), pull: &[f64]) -> Self {
        let score = |pose: usize| -> f64 {
            training.rows(pose).map(|row| lever * training.jacobian_row(row)[column] * pull[row]).sum()
        };
        let turns = training.inputs[joint].kind == InputKind::Angle;
        let poses = 0..training.pose_count();
        Self {
            joint,
            sought: if turns { TURNING } else { SLIDING },
            values: poses.clone().map(|pose| training.values_of(pose)[joint]).collect(),
            scores: poses.map(score).collect(),
        }
    }

    /// The wave that gains most, where that is more than chance, and cycles within which another is the same; so many joints
    /// are looked at.
    fn best(&self, joints: usize) -> Option<(Wave, f64)> {
        let Sought { cycles: [fewest, most], from, covered, .. } = self.sought;
        let (low, high) = range(&self.values);
        if !(covered[0]..=covered[1]).contains(&(high - low)) {
            return None;
        }
        // Farther apart, numbers of cycles are different ones to poses that stand anywhere.
        let apart = TAU / (high - low);
        let (step, fewest) = (apart / STEPS, fewest.max(self.sought.fewest * apart));
        let count = ((most - from) / step) as usize;
        let gains: Vec<f64> = self.sums(from, step, count).iter().map(Sums::gain).collect();
        let cycles_at = |k: usize| from + step * k as f64;
        let candidates = (0..count).filter(|&k| cycles_at(k) >= fewest);
        let coarse = candidates.max_by(|&a, &b| gains[a].total_cmp(&gains[b])).map(cycles_at)?;
        let peak = self.peak(coarse - step, coarse + step);
        let best = self.at(peak).gain();
        // Independent choices: one for each cycle more over the range covered.
        let choices = joints as f64 * (most - fewest) / apart;
        if best < SURE + choices.max(1.0).ln() {
            return None;
        }
        let rivals = (0..count).filter(|&k| gains[k] > best - RIVAL).map(cycles_at);
        if rivals.filter(|rival| (rival - peak).abs() > apart).any(|rival| self.is_same(peak, rival)) {
            return None;
        }
        let whole = if self.sought.whole { self.whole(peak, apart, best - WHOLE) } else { None };
        let cycles = whole.unwrap_or(peak);
        let [cosine, sine] = self.at(cycles).weights();
        let within = if self.sought.whole { 1.0 } else { apart } / STEPS;
        Some((Wave { joint: self.joint, cycles, amplitude: cosine.hypot(sine) * 0.5_f64.sqrt() }, within))
    }

    /// The number of cycles of the largest power between two, which hold no other maximum: White's covariance, which holds the
    /// wave itself, would move the gain's.
    fn peak(&self, mut low: f64, mut high: f64) -> f64 {
        let share = 0.5 * (5.0_f64.sqrt() - 1.0);
        for _ in 0..NARROWINGS {
            let (left, right) = (high - share * (high - low), low + share * (high - low));
            if self.at(left).power() > self.at(right).power() { high = right } else { low = left }
        }
        0.5 * (low + high)
    }

    /// The whole number of cycles, of all within `apart` of a peak that gain at least so much, of the largest power, as the
    /// peak is.
    fn whole(&self, peak: f64, apart: f64, least: f64) -> Option<f64> {
        let fewest = (peak - apart).max(self.sought.cycles[0]);
        let numbers = (fewest.ceil() as usize..=(peak + apart).floor() as usize).map(|n| n as f64);
        let sums = numbers.map(|n| (n, self.at(n))).filter(|(_, sums)| sums.gain() > least);
        sums.max_by(|a, b| a.1.power().total_cmp(&b.1.power())).map(|(n, _)| n)
    }

    /// Whether waves of two numbers of cycles are one to these poses: of the same turns, or of opposite ones.
    fn is_same(&self, first: f64, second: f64) -> bool {
        let weight: f64 = self.scores.iter().map(|score| score * score).sum();
        [first - second, first + second].into_iter().any(|cycles| {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for (value, score) in self.values.iter().zip(&self.scores) {
                cosine += score * score * (cycles * value).cos();
                sine += score * score * (cycles * value).sin();
            }
            f64::hypot(cosine, sine) > SAME * weight
        })
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

    /// `I^-1 z`: the weights of cosine and sine, rad (of a joint that slides times [`truearm_kinematics::ANGLE_ARM`] m); zero where the poses cannot tell one from the other.
    fn weights(&self) -> [f64; 2] {
        let ([c, s], [cc, cs, ss]) = (self.score, self.information);
        let determinant = cc * ss - cs * cs;
        if determinant <= APART * cc * ss {
            return [0.0; 2];
        }
        [(ss * c - cs * s) / determinant, (cc * s - cs * c) / determinant]
    }

    fn power(&self) -> f64 {
        self.score[0].powi(2) + self.score[1].powi(2)
    }

    fn gain(&self) -> f64 {
        let [cosine, sine] = self.weights();
        0.5 * (cosine * self.score[0] + sine * self.score[1])
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;

    const POSES: usize = 400;

    /// Numbers between minus one and one that no grid of poses has.
    fn spread(seed: u64) -> impl Iterator<Item = f64> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            2.0 * ((state >> 11) as f64 / (1_u64 << 53) as f64) - 1.0
        })
    }

    /// Scores of waves, (amplitude, cycles) each, and of noise as large as one of amplitude one.
    fn scan(values: Vec<f64>, waves: &[(f64, f64)]) -> Scan {
        let noise = spread(5).map(|x| 1.2 * x);
        let sum = |q: &f64| waves.iter().map(|(size, cycles)| size * (cycles * q + 0.7).cos()).sum::<f64>();
        let scores = values.iter().zip(noise).map(|(q, noise)| sum(q) + noise).collect();
        Scan { joint: 0, sought: TURNING, values, scores }
    }

    fn anywhere(within: f64) -> Vec<f64> {
        spread(1).take(POSES).map(|x| within * x).collect()
    }

    #[test]
    fn cycles_are_found_to_a_part_of_what_the_range_tells_apart() {
        for cycles in [202.55, 77.35, 400.1] {
            let (wave, _) = scan(anywhere(3.0), &[(4.0, cycles)]).best(6).unwrap();
            assert!((wave.cycles - cycles).abs() < 0.03, "{} in place of {cycles}", wave.cycles);
        }
    }

    #[test]
    fn over_a_short_way_the_whole_number_of_the_largest_power_is_taken() {
        for cycles in [100.0, 121.0, 360.0] {
            let found = scan(anywhere(0.4), &[(4.0, cycles)]);
            let (wave, _) = found.best(6).unwrap();
            assert_eq!(wave.cycles, cycles);
        }
    }

    #[test]
    fn poses_on_a_grid_show_no_wave_that_could_be_another() {
        let degrees = |step: f64, shaken: f64| -> Vec<f64> {
            let values = spread(2).zip(spread(3)).take(POSES);
            values.map(|(x, y)| (step * (150.0 / step * x).round() + shaken * y).to_radians()).collect()
        };
        for (step, cycles) in [(15.0, 77.3), (10.0, 156.0), (5.0, 202.0)] {
            for shaken in [0.0, 0.01] {
                assert!(scan(degrees(step, shaken), &[(2.0, cycles)]).best(6).is_none(), "{step} deg");
            }
        }
        assert!(
            scan(degrees(0.1, 0.0), &[(2.0, 202.0)]).best(6).is_some_and(|(wave, _)| wave.cycles == 202.0)
        );
    }

    #[test]
    fn screws_are_found_where_poses_stand_anywhere() {
        for (pitch, way) in [(0.02, 1.2), (0.005, 0.3), (0.016, 0.1), (0.2, 3.0), (0.314, 8.0), (0.8, 5.0)] {
            let mut found = scan(anywhere(0.5 * way), &[(4.0, TAU / pitch)]);
            found.sought = SLIDING;
            let (wave, _) = found.best(6).unwrap();
            let behind = (TAU / wave.cycles - pitch).abs() / pitch;
            assert!(behind * way / pitch < 0.05, "{} m in place of {pitch}", TAU / wave.cycles);
        }
        let mut slow = scan(anywhere(0.05), &[(4.0, 4.0 * TAU)]);
        slow.sought = SLIDING;
        assert!(slow.best(6).is_none());
    }

    #[test]
    fn a_second_wave_is_no_rival() {
        let (wave, _) = scan(anywhere(2.0), &[(1.0, 202.0), (1.0, 240.0)]).best(6).unwrap();
        assert!([202.0, 240.0].contains(&wave.cycles), "{}", wave.cycles);
    }

    #[test]
    fn readings_that_are_no_joints_are_not_scanned() {
        let mut values = anywhere(2.0);
        values[7] = 6e8;
        assert!(scan(values, &[(2.0, 202.0)]).best(6).is_none());
    }

    #[test]
    fn scans_are_alike_whatever_the_order() {
        let wave = |joint, cycles, amplitude| Wave { joint, cycles, amplitude };
        let found = [wave(1, 202.0, 1e-4), wave(2, 100.0, 5e-5)];
        assert!(are_alike(&found, &[wave(2, 100.0, 6e-5), wave(1, 202.05, 1e-4)]));
        assert!(!are_alike(&found, &found[..1]));
        assert!(!are_alike(&found, &[wave(1, 202.0, 2.5e-4), found[1]]));
        assert!(!are_alike(&found, &[wave(1, 203.0, 1e-4), found[1]]));
    }
}
