//! What C passes and gets by value.

use truearm_compensate::{Correction, Fault, Options, Reason, Refusal, Step, StreamOptions, Task};

use super::status::Status;
use crate::loaded::Loaded;

/// Reason of a set-point that came too late; the others are those of refusals.
const LATE: u32 = 100;

/// What is corrected, and how far; infinity switches a bound off.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct CorrectorOptions {
    /// 0: position and orientation; 1: position and tool axis; 2: position.
    pub task: u32,
    /// Bit j: joint j, from 0, may move; 0: all may.
    pub moving: u64,
    /// Largest change of a revolute joint, rad.
    pub largest_angle_rad: f64,
    /// Largest change of a prismatic joint, m.
    pub largest_slide_m: f64,
    /// Largest shift of the tool, m.
    pub largest_shift_m: f64,
    /// Largest turn of the tool, rad.
    pub largest_turn_rad: f64,
    /// Largest standard deviation of the tool's position, m.
    pub largest_std_m: f64,
}

impl CorrectorOptions {
    /// The defaults, as options of C.
    pub fn usual() -> Self {
        let limits = truearm_compensate::Limits::default();
        Self {
            task: 0,
            moving: 0,
            largest_angle_rad: limits.largest_angle,
            largest_slide_m: limits.largest_slide,
            largest_shift_m: limits.largest_shift,
            largest_turn_rad: limits.largest_turn,
            largest_std_m: truearm_compensate::Limits::LARGEST_STD,
        }
    }

    /// Options of the corrector.
    pub fn core(&self, loaded: &Loaded) -> Result<Options, Status> {
        let task = match self.task {
            0 => Task::Pose,
            1 => Task::Axis,
            2 => Task::Position,
            _ => return Err(Status::BadOption),
        };
        let bits = (0..64_usize).filter(|bit| self.moving >> bit & 1 == 1);
        let mut limits = loaded.limits();
        limits.largest_angle = self.largest_angle_rad;
        limits.largest_slide = self.largest_slide_m;
        limits.largest_shift = self.largest_shift_m;
        limits.largest_turn = self.largest_turn_rad;
        limits.largest_std = self.largest_std_m;
        Ok(Options { task, moving: (self.moving != 0).then(|| bits.collect()), limits })
    }
}

/// What became of a waypoint.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Waypoint {
    /// How far from its target the calibrated model puts the tool, m.
    pub residual_m: f64,
    /// How far it is turned from it, rad.
    pub residual_rad: f64,
    /// How far the command moves: shift of the tool, base frame, m.
    pub shift_m: [f64; 3],
    /// The same of its turn: a rotation vector, base frame, rad.
    pub turn_rad: [f64; 3],
    /// Bound of the standard deviation of the tool's position, m; NaN where the calibration has none.
    pub std_m: f64,
    /// 0, or why the waypoint is refused: see truearm_reason_text().
    pub reason: u32,
    /// Joint from 1 that it is about, or 0.
    pub joint: u32,
    /// What was found, m or rad; NaN where there is nothing to compare.
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
}

impl Waypoint {
    pub(super) fn of(correction: &Correction) -> Self {
        let refusal = correction.refusal.as_ref();
        Self {
            residual_m: correction.residual_m,
            residual_rad: correction.residual_rad,
            shift_m: correction.shift,
            turn_rad: correction.turn,
            std_m: correction.std_m,
            reason: refusal.map_or(0, code),
            joint: refusal.map_or(0, |refusal| refusal.joint as u32),
            value: refusal.map_or(f64::NAN, |refusal| refusal.value),
            limit: refusal.map_or(f64::NAN, |refusal| refusal.limit),
        }
    }
}

fn code(refusal: &Refusal) -> u32 {
    refusal.reason as u32
}

/// How the correction of a stream may change.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct StreamSettings {
    /// Largest rate of a revolute joint's correction, rad/s.
    pub rate_rad_s: f64,
    /// Largest rate of a prismatic joint's correction, m/s.
    pub rate_m_s: f64,
    /// Largest acceleration of a revolute joint's correction, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Largest acceleration of a prismatic joint's correction, m/s^2.
    pub acceleration_m_s2: f64,
    /// How long the ramp takes from nothing to the whole correction, s.
    pub ramp_s: f64,
    /// How long the last correction is held before it is ramped down, s.
    pub hold_s: f64,
    /// Longest time between two set-points, s.
    pub deadline_s: f64,
}

impl StreamSettings {
    /// The defaults, as options of C.
    pub fn usual() -> Self {
        let usual = StreamOptions::default();
        Self {
            rate_rad_s: usual.rate[0],
            rate_m_s: usual.rate[1],
            acceleration_rad_s2: usual.acceleration[0],
            acceleration_m_s2: usual.acceleration[1],
            ramp_s: usual.ramp,
            hold_s: usual.hold,
            deadline_s: usual.deadline,
        }
    }

    /// Options of the stream.
    pub fn core(&self) -> StreamOptions {
        StreamOptions {
            rate: [self.rate_rad_s, self.rate_m_s],
            acceleration: [self.acceleration_rad_s2, self.acceleration_m_s2],
            ramp: self.ramp_s,
            hold: self.hold_s,
            deadline: self.deadline_s,
        }
    }
}

/// What a stream is doing.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct StreamState {
    /// 0 off, 1 rising, 2 on, 3 holding, 4 falling.
    pub phase: u32,
    /// 0, or why the correction is an older one: see truearm_reason_text().
    pub reason: u32,
    /// Share of the correction that is aimed at, 0 to 1.
    pub gain: f64,
    /// How far the applied correction is from the one aimed at: the largest of the joints, rad or m.
    pub lag: f64,
}

impl StreamState {
    pub(super) fn of(step: &Step) -> Self {
        let reason = step.fault.map_or(0, |fault| match fault {
            Fault::NotStarted | Fault::NotFinite => Reason::NotFinite as u32,
            Fault::Late => LATE,
            Fault::Refused(refusal) => code(&refusal),
        });
        Self { phase: step.phase as u32, reason, gain: step.gain, lag: step.lag }
    }
}
