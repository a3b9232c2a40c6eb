//! Streams of set-points, without allocation, lock, log or panic.

use truearm_compensate::Fault;

use super::guard::{check_array, check_place, copy_in, copy_out, guarded, put, rounds_to_nearest};
use super::handles::{StreamHandle, Turn, place};
use super::status::Status;
use super::types::StreamState;

/// Corrects the next set-point of a robot.
///
/// `readings` may be null where none came in time, and then `features`, too. `elapsed_s` is the time since the
/// call before; above the deadline, below zero or not finite the set-point counts as missed. The first one is
/// never late.
///
/// TRUEARM_STATUS_OK or TRUEARM_STATUS_HELD: `out` is written and finite; HELD says that this set-point has no
/// correction of its own, and that the last one is held or on its ramp down (`state` says why). Where the
/// set-point itself is not finite, `out` is the last finite one, corrected. TRUEARM_STATUS_NOT_STARTED: there was
/// none yet, and `out` is not written; go on calling. `state` may be null. After any other status nothing has
/// become of the set-point.
///
/// # Safety
/// `stream` was made and not freed, `readings` is null or has `joints` numbers, `features` `feature_count`, `out`
/// `out_size`, `state` is null or points to a state.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C passes arrays with their sizes")]
pub unsafe extern "C" fn truearm_stream_step(
    stream: *mut StreamHandle,
    readings: *const f64,
    joints: usize,
    features: *const f64,
    feature_count: usize,
    elapsed_s: f64,
    out: *mut f64,
    out_size: usize,
    state: *mut StreamState,
) -> Status {
    guarded(|| {
        // SAFETY: the handle is as the caller promises; the turn keeps others off its memory.
        unsafe {
            rounds_to_nearest()?;
            let stream = place(stream)?;
            let _turn = Turn::take(&(*stream).busy)?;
            let (core, memory) = (&mut (*stream).core, &mut (*stream).memory);
            check_array(out, out_size, core.joint_count())?;
            check_place(state)?;
            let given = !readings.is_null();
            if given {
                copy_in(readings, joints, &mut memory.readings)?;
            }
            if given || !features.is_null() {
                copy_in(features, feature_count, &mut memory.features)?;
            }
            let readings = given.then_some(&memory.readings[..]);
            let step = core.step(readings, &memory.features, elapsed_s, &mut memory.out);
            put(state, StreamState::of(&step));
            match step.fault {
                Some(Fault::NotStarted) => Err(Status::NotStarted),
                fault => {
                    copy_out(&memory.out, out);
                    Ok(if fault.is_some() { Status::Held } else { Status::Ok })
                }
            }
        }
    })
}

/// Ramps the correction up (`on` not 0) or down (0) from now on.
///
/// # Safety
/// `stream` was made and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_stream_switch(stream: *mut StreamHandle, on: u32) -> Status {
    guarded(|| {
        // SAFETY: the handle is as the caller promises; the turn keeps others off its memory.
        unsafe {
            let stream = place(stream)?;
            let _turn = Turn::take(&(*stream).busy)?;
            let core = &mut (*stream).core;
            core.switch(on != 0);
        }
        Ok(Status::Ok)
    })
}
