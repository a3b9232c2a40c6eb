//! Single waypoints: corrections and predictions, without allocation, lock, log or panic.

use std::sync::Arc;

use truearm_compensate::Corrector;
use truearm_kinematics::Transform;

use super::guard::{check_array, check_place, copy_in, copy_out, guarded, put, rounds_to_nearest};
use super::handles::{CorrectorHandle, Turn, WorkspaceHandle, borrow, place};
use super::status::Status;
use super::types::Waypoint;

/// Corrects one waypoint: readings of the program in, readings to command out.
///
/// TRUEARM_STATUS_OK: `out` is written. TRUEARM_STATUS_REFUSED: `out` is not written, `correction` says why. The arrays may be
/// one and the same. `correction` may be null. Where the calibration needs no features, `features` may be null. The standard
/// deviation takes part of the time: it is worked out where `correction` is given or `largest_std_m` is finite.
///
/// # Safety
/// The handles were made and not freed, `readings` has `joints` numbers, `features` `feature_count`, `out` `out_size`.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C passes arrays with their sizes")]
pub unsafe extern "C" fn truearm_correct(
    corrector: *const CorrectorHandle,
    workspace: *mut WorkspaceHandle,
    readings: *const f64,
    joints: usize,
    features: *const f64,
    feature_count: usize,
    out: *mut f64,
    out_size: usize,
    correction: *mut Waypoint,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (corrector, mut held) = unsafe {
            let core = &borrow(corrector)?.core;
            (core, Held::take(core, workspace, (readings, joints), (features, feature_count))?)
        };
        check_array(out, out_size, corrector.joint_count())?;
        check_place(correction)?;
        let (workspace, memory) = held.parts();
        let (readings, features, spread) = (&memory.readings, &memory.features, !correction.is_null());
        let found = corrector.correct(readings, features, spread, &mut memory.out, workspace);
        // SAFETY: as the caller promises.
        unsafe { put(correction, Waypoint::of(&found)) };
        if found.refusal.is_some() {
            let finite = memory.readings.iter().chain(&memory.features).all(|value| value.is_finite());
            return if finite { Ok(Status::Refused) } else { Err(Status::NotFinite) };
        }
        // SAFETY: checked above, and as the caller promises.
        unsafe { copy_out(&memory.out, out) };
        Ok(Status::Ok)
    })
}

/// Where the calibrated arm puts the tool: `pose` (16 numbers, base_from_tool row by row).
///
/// # Safety
/// The handles were made and not freed, `readings` has `joints` numbers, `features` `feature_count`, `pose` `pose_size`.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C passes arrays with their sizes")]
pub unsafe extern "C" fn truearm_predict_pose(
    corrector: *const CorrectorHandle,
    workspace: *mut WorkspaceHandle,
    readings: *const f64,
    joints: usize,
    features: *const f64,
    feature_count: usize,
    pose: *mut f64,
    pose_size: usize,
) -> Status {
    guarded(|| {
        check_array(pose, pose_size, 16)?;
        // SAFETY: as the caller promises.
        unsafe {
            let found = predict(corrector, workspace, (readings, joints), (features, feature_count))?;
            copy_out(&found.to_matrix(), pose);
        }
        Ok(Status::Ok)
    })
}

/// Where the calibrated arm puts the tool's origin: `position` (3 numbers, base frame, m).
///
/// # Safety
/// The handles were made and not freed, `readings` has `joints` numbers, `features` `feature_count`, `position`
/// `position_size`.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "C passes arrays with their sizes")]
pub unsafe extern "C" fn truearm_predict_position(
    corrector: *const CorrectorHandle,
    workspace: *mut WorkspaceHandle,
    readings: *const f64,
    joints: usize,
    features: *const f64,
    feature_count: usize,
    position: *mut f64,
    position_size: usize,
) -> Status {
    guarded(|| {
        check_array(position, position_size, 3)?;
        // SAFETY: as the caller promises.
        unsafe {
            let found = predict(corrector, workspace, (readings, joints), (features, feature_count))?;
            copy_out(&found.translation, position);
        }
        Ok(Status::Ok)
    })
}

/// # Safety
/// As for [`truearm_predict_pose`].
unsafe fn predict(
    corrector: *const CorrectorHandle,
    workspace: *mut WorkspaceHandle,
    readings: (*const f64, usize),
    features: (*const f64, usize),
) -> Result<Transform, Status> {
    // SAFETY: as the caller promises.
    let (corrector, mut held) = unsafe {
        let core = &borrow(corrector)?.core;
        (core, Held::take(core, workspace, readings, features)?)
    };
    let (workspace, memory) = held.parts();
    corrector.predict(&memory.readings, &memory.features, workspace).ok_or(Status::NotFinite)
}

/// A workspace that this caller alone uses, with the arrays copied in.
struct Held {
    pointer: *mut WorkspaceHandle,
    _turn: Turn<'static>,
}

impl Held {
    /// # Safety
    /// `pointer` was made and not freed while this lives; the arrays have the sizes given.
    unsafe fn take(
        corrector: &Arc<Corrector>,
        pointer: *mut WorkspaceHandle,
        (readings, joints): (*const f64, usize),
        (features, feature_count): (*const f64, usize),
    ) -> Result<Self, Status> {
        // SAFETY: the handle lives as long as this, by the caller's promise; the turn keeps others off its memory.
        unsafe {
            rounds_to_nearest()?;
            let pointer = place(pointer)?;
            let turn = Turn::take(&(*pointer).busy)?;
            let mut held = Self { pointer, _turn: turn };
            if !Arc::ptr_eq(corrector, &(*pointer).of) {
                return Err(Status::OtherWorkspace);
            }
            let (_, memory) = held.parts();
            copy_in(readings, joints, &mut memory.readings)?;
            copy_in(features, feature_count, &mut memory.features)?;
            Ok(held)
        }
    }

    fn parts(&mut self) -> (&mut truearm_compensate::Workspace, &mut super::handles::Memory) {
        // SAFETY: the turn is ours, so nobody else has a reference to these fields.
        unsafe { (&mut (*self.pointer).core, &mut (*self.pointer).memory) }
    }
}
