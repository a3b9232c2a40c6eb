//! Corrections of a stream of set-points, such as a controller's servo cycle: nothing is ever applied or dropped at once.
//!
//! What is added to the set-points follows the wanted correction with bounded rate and acceleration. Switched on or
//! off it ramps. Where a set-point is refused, is not finite or comes late, the last correction is held for a
//! moment and then ramped down, until good set-points come again. Where that would lead a joint out of its limits it
//! stays at the limit; with a set-point beyond them nothing is added that leads farther out.

use std::sync::Arc;

use crate::corrector::{Corrector, Workspace};
use crate::error::{CompensateError, check_bounds};
use crate::refusal::Refusal;

/// Between two steps less than this nothing moves, s.
const SHORTEST: f64 = 1e-9;

/// How a stream of corrections may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamOptions {
    /// Largest rate of a revolute joint's correction (rad/s) and of a prismatic one's (m/s).
    pub rate: [f64; 2],
    /// Largest acceleration of the same, rad/s^2 and m/s^2.
    pub acceleration: [f64; 2],
    /// How long the ramp takes from nothing to the whole correction, s.
    pub ramp: f64,
    /// How long the last correction is held where there is no good one, s.
    pub hold: f64,
    /// Longest time between two set-points, s; a later one counts as missed.
    pub deadline: f64,
}

impl Default for StreamOptions {
    fn default() -> Self {
        let (rate, acceleration) = (6.0_f64.to_radians(), 120.0_f64.to_radians());
        Self { rate: [rate, 0.02], acceleration: [acceleration, 0.5], ramp: 1.0, hold: 0.1, deadline: 0.05 }
    }
}

impl StreamOptions {
    fn check(&self) -> Result<(), CompensateError> {
        check_bounds(&[
            ("the largest rate of a revolute joint's correction", self.rate[0]),
            ("the largest rate of a prismatic joint's correction", self.rate[1]),
            ("the largest acceleration of a revolute joint's correction", self.acceleration[0]),
            ("the largest acceleration of a prismatic joint's correction", self.acceleration[1]),
            ("the time that a correction is held", self.hold),
            ("the longest time between set-points", self.deadline),
        ])?;
        let ends = self.ramp > 0.0 && self.ramp.is_finite();
        if ends {
            Ok(())
        } else {
            Err(CompensateError::Time { what: "the time of the ramp", value: self.ramp })
        }
    }
}

/// What a stream is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Phase {
    /// Nothing is added.
    Off = 0,
    /// On its way to the whole correction.
    Rising = 1,
    /// The whole correction.
    On = 2,
    /// The last correction is kept, for want of a good one.
    Holding = 3,
    /// On its way to nothing.
    Falling = 4,
}

/// Why a step has no correction of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// There was no set-point yet, so there is nothing to give out.
    NotStarted,
    /// The set-point or a feature is missing, not finite, or has another length.
    NotFinite,
    /// The set-point came after the deadline.
    Late,
    /// The corrector refuses the set-point.
    Refused(Refusal),
}

/// What became of one set-point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// What the stream is doing.
    pub phase: Phase,
    /// Share of the correction that is aimed at, 0 to 1.
    pub gain: f64,
    /// How far the applied correction is from the one aimed at: the largest of the joints, rad or m.
    pub lag: f64,
    /// Why the correction is an older one.
    pub fault: Option<Fault>,
}

/// Corrects set-points one after the other; one for each robot.
#[derive(Debug, Clone)]
pub struct Stream {
    corrector: Arc<Corrector>,
    workspace: Workspace,
    options: StreamOptions,
    /// The last good correction.
    wanted: Vec<f64>,
    joints: Vec<Follower>,
    /// The last finite set-point.
    readings: Vec<f64>,
    corrected: Vec<f64>,
    on: bool,
    started: bool,
    gain: f64,
    without: f64,
    /// The last time between two steps that was no later than the deadline, s: what counts where a clock gives none.
    cycle: f64,
}

impl Stream {
    /// A stream that is switched on and has nothing applied.
    ///
    /// # Errors
    /// [`CompensateError::Bound`] if an option is not positive; [`CompensateError::Time`] if the ramp takes no time
    /// or never ends.
    pub fn new(corrector: Arc<Corrector>, options: StreamOptions) -> Result<Stream, CompensateError> {
        options.check()?;
        let count = corrector.joint_count();
        let chain = &corrector.calibrated.chain;
        let joints = (0..count).map(|joint| usize::from(chain.slides(joint)));
        let joints =
            joints.map(|kind| Follower::new(options.rate[kind], options.acceleration[kind])).collect();
        Ok(Stream {
            workspace: corrector.workspace(),
            options,
            wanted: vec![0.0; count],
            joints,
            readings: vec![0.0; count],
            corrected: vec![0.0; count],
            on: true,
            started: false,
            gain: 0.0,
            without: 0.0,
            cycle: 0.0,
            corrector,
        })
    }

    /// Number of joints, N.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Number of features, F.
    pub fn feature_count(&self) -> usize {
        self.corrector.feature_count()
    }

    /// Ramps the correction up or down from now on.
    pub fn switch(&mut self, on: bool) {
        self.on = on;
    }

    /// What is added to set-points now, (N,).
    pub fn applied(&self) -> impl Iterator<Item = f64> + '_ {
        self.joints.iter().map(|joint| joint.applied)
    }

    /// The corrected set-point to command; without allocation, lock or panic.
    ///
    /// `readings` (N) are the set-point, or None where none came in time, and `features` (F); `elapsed` (s) is the time since
    /// the step before: one that is negative or no finite number counts as late, and as long as the last good one. `out` (N) is
    /// always finite, but not written before the first finite set-point; with one of another length nothing becomes of the
    /// set-point, which is told as not finite.
    pub fn step(
        &mut self,
        readings: Option<&[f64]>,
        features: &[f64],
        elapsed: f64,
        out: &mut [f64],
    ) -> Step {
        if out.len() != self.joints.len() {
            return Step { phase: Phase::Off, gain: self.gain, lag: 0.0, fault: Some(Fault::NotFinite) };
        }
        let good = elapsed.is_finite() && (0.0..=self.options.deadline).contains(&elapsed);
        let late = self.started && !good;
        let elapsed = self.since(elapsed);
        let fault = self.take(readings, features, late);
        if !self.started {
            return Step { phase: Phase::Off, gain: self.gain, lag: 0.0, fault: Some(Fault::NotStarted) };
        }
        let phase = self.ramp(fault.is_some(), elapsed);
        let share = self.gain * self.gain * (3.0 - 2.0 * self.gain);
        let mut lag = 0.0_f64;
        for (joint, follower) in self.joints.iter_mut().enumerate() {
            let aim = share * self.wanted[joint];
            match self.corrector.options.limits.joints.get(joint) {
                Some(limits) => {
                    follower.follow_within(aim, elapsed, limits.map(|limit| limit - self.readings[joint]));
                }
                None => follower.follow(aim, elapsed),
            }
            lag = lag.max((aim - follower.applied).abs());
            out[joint] = self.readings[joint] + follower.applied;
        }
        Step { phase, gain: self.gain, lag, fault }
    }

    /// The time that a step counts, s.
    fn since(&mut self, elapsed: f64) -> f64 {
        if !(elapsed.is_finite() && elapsed >= 0.0) {
            return self.cycle;
        }
        if elapsed > SHORTEST && elapsed <= self.options.deadline {
            self.cycle = elapsed;
        }
        elapsed.min(self.options.deadline)
    }

    /// Takes in a set-point, and its correction if that is good.
    fn take(&mut self, readings: Option<&[f64]>, features: &[f64], late: bool) -> Option<Fault> {
        let count = self.joints.len();
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let Some(readings) = readings.filter(|values| values.len() == count && finite(values)) else {
            return Some(if late { Fault::Late } else { Fault::NotFinite });
        };
        self.readings.copy_from_slice(readings);
        self.started = true;
        if late {
            return Some(Fault::Late);
        }
        if !self.on {
            return None;
        }
        if features.len() != self.corrector.feature_count() || !finite(features) {
            return Some(Fault::NotFinite);
        }
        let found =
            self.corrector.correct(readings, features, false, &mut self.corrected, &mut self.workspace);
        if let Some(refusal) = found.refusal {
            return Some(Fault::Refused(refusal));
        }
        for (wanted, (to, from)) in self.wanted.iter_mut().zip(self.corrected.iter().zip(readings)) {
            *wanted = to - from;
        }
        None
    }

    /// Moves the share of the correction that is aimed at.
    fn ramp(&mut self, faulty: bool, elapsed: f64) -> Phase {
        self.without = if faulty { self.without + elapsed } else { 0.0 };
        let step = elapsed / self.options.ramp;
        if self.on && !faulty {
            self.gain = (self.gain + step).min(1.0);
            return if self.gain < 1.0 { Phase::Rising } else { Phase::On };
        }
        if self.on && self.without <= self.options.hold {
            return Phase::Holding;
        }
        self.gain = (self.gain - step).max(0.0);
        let still = self.joints.iter().all(|joint| joint.applied == 0.0 && joint.rate == 0.0);
        if self.gain > 0.0 || !still { Phase::Falling } else { Phase::Off }
    }
}

/// Follows a value with bounded rate and acceleration, without delay where it may.
#[derive(Debug, Clone, Copy)]
struct Follower {
    largest_rate: f64,
    acceleration: f64,
    applied: f64,
    rate: f64,
    /// The value that was followed last.
    aim: f64,
}

impl Follower {
    fn new(largest_rate: f64, acceleration: f64) -> Self {
        Self { largest_rate, acceleration, applied: 0.0, rate: 0.0, aim: 0.0 }
    }

    /// One step towards `aim`.
    ///
    /// The rate is that of the aim plus one that closes what was left before, from which it can still stop in time.
    fn follow(&mut self, aim: f64, elapsed: f64) {
        if elapsed > SHORTEST {
            let left = self.aim - self.applied;
            let brake = self.acceleration * elapsed;
            let stopping = brake * (0.25 + 2.0 * left.abs() / (brake * elapsed)).sqrt() - 0.5 * brake;
            let closing = left.signum() * stopping.min(left.abs() / elapsed);
            let moving = ((aim - self.aim) / elapsed).clamp(-self.largest_rate, self.largest_rate);
            let rate = (moving + closing).clamp(self.rate - brake, self.rate + brake);
            self.rate = rate.clamp(-self.largest_rate, self.largest_rate);
            self.applied += self.rate * elapsed;
            self.settle(aim, elapsed, brake.min(self.largest_rate));
            self.aim = aim;
        }
    }

    /// The same within what is left to the limits; of one that the set-point itself is beyond nothing is left.
    ///
    /// What is cut at once is no more than the set-point moved: before, it led no farther than to the limit.
    fn follow_within(&mut self, aim: f64, elapsed: f64, [low, high]: [f64; 2]) {
        let (low, high) = (low.min(0.0), high.max(0.0));
        self.follow(aim.clamp(low, high), elapsed);
        if !(low..=high).contains(&self.applied) {
            (self.applied, self.rate) = (self.applied.clamp(low, high), 0.0);
        }
    }

    /// Arrives where only rounding is left of a change by `rate`.
    fn settle(&mut self, aim: f64, elapsed: f64, rate: f64) {
        let near = (aim - self.applied).abs() <= 1e-12 * rate * elapsed;
        if near {
            self.applied = aim;
        }
        if near && aim == self.aim && self.rate.abs() <= 1e-12 * rate {
            self.rate = 0.0;
        }
    }
}
