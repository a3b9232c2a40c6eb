//! Loading and freeing. These functions may allocate and take milliseconds.

use std::ffi::{CStr, c_char};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use truearm_compensate::{Corrector, Stream};
use truearm_kinematics::Transform;

use super::guard::{copy_in, empty, guarded, rounds_to_nearest, tell, worded};
use super::handles::{
    Calibration, CorrectorHandle, Memory, StreamHandle, WorkspaceHandle, borrow, free, give,
};
use super::status::Status;
use super::types::{CorrectorOptions, StreamSettings};
use crate::load_error::LoadError;
use crate::loaded::Loaded;
use crate::reading::read;

/// Joints at the most: more than any arm has, and what a mask of moving joints holds.
const MOST_JOINTS: usize = 64;

/// Loads a calibration file, which has to be a regular one: no pipe and no device.
///
/// On failure `*out` is null and `message` (of `message_size` bytes; may be null) says what is wrong.
///
/// # Safety
/// `path` is a text that ends with a zero, `out` points to a pointer, `message` is null or has `message_size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_load_file(
    path: *const c_char,
    out: *mut *mut Calibration,
    message: *mut c_char,
    message_size: usize,
) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        worded(message, message_size, || {
            empty(out)?;
            rounds_to_nearest()?;
            if path.is_null() {
                return Err(Status::BadPointer);
            }
            let loaded = read(CStr::from_ptr(path)).and_then(|bytes| Loaded::from_bytes(&bytes));
            hand_over(loaded, out, message, message_size)
        })
    }
}

/// Loads a calibration from `size` bytes of memory, which are not needed afterwards.
///
/// On failure `*out` is null and `message` (of `message_size` bytes; may be null) says what is wrong.
///
/// # Safety
/// `bytes` has `size` bytes, `out` points to a pointer, `message` is null or has `message_size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_load_memory(
    bytes: *const u8,
    size: usize,
    out: *mut *mut Calibration,
    message: *mut c_char,
    message_size: usize,
) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        worded(message, message_size, || {
            empty(out)?;
            rounds_to_nearest()?;
            if bytes.is_null() {
                return Err(Status::BadPointer);
            }
            if size > isize::MAX as usize {
                return Err(Status::WrongSize);
            }
            let loaded = Loaded::from_bytes(std::slice::from_raw_parts(bytes, size));
            hand_over(loaded, out, message, message_size)
        })
    }
}

/// Frees a calibration; correctors made of it stay usable. Null is no mistake.
///
/// # Safety
/// `calibration` is null or was loaded and not freed, and nobody uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_calibration_free(calibration: *mut Calibration) -> Status {
    // SAFETY: as the caller promises.
    guarded(|| Ok(unsafe { free(calibration) }))
}

/// Number of joints; 0 if this is no calibration.
///
/// # Safety
/// `calibration` is null or was loaded and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_joint_count(calibration: *const Calibration) -> usize {
    // SAFETY: as the caller promises.
    unsafe { borrow(calibration) }.map_or(0, |calibration| calibration.loaded.calibrated.joint_count())
}

/// Number of features, such as temperature, that the calibration needs beside the joints; 0 for most.
///
/// Wherever features are given, they stand in the order in which calibrating named them, in the units of their columns.
///
/// # Safety
/// `calibration` is null or was loaded and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_feature_count(calibration: *const Calibration) -> usize {
    // SAFETY: as the caller promises.
    unsafe { borrow(calibration) }.map_or(0, |calibration| calibration.loaded.features.len())
}

/// Writes the arm's name, cut to `size` bytes with the zero at its end.
///
/// # Safety
/// `calibration` is null or was loaded and not freed, `name` has `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_robot_name(
    calibration: *const Calibration,
    name: *mut c_char,
    size: usize,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        unsafe {
            let calibration = borrow(calibration)?;
            if name.is_null() {
                return Err(Status::BadPointer);
            }
            tell(name, size, &calibration.loaded.name);
        }
        Ok(Status::Ok)
    })
}

/// Options with their defaults: pose, 3 deg, 10 mm, 5 mm, 1 deg, and 1 mm of standard deviation.
#[unsafe(no_mangle)]
pub extern "C" fn truearm_default_options() -> CorrectorOptions {
    CorrectorOptions::usual()
}

/// Makes a corrector for a tool.
///
/// `flange_from_tool` are 16 numbers, a 4 x 4 matrix row by row; null means the robot file's own tool. Null as
/// `options` means the defaults. On failure `*out` is null and `message` (may be null) says what is wrong.
///
/// # Safety
/// `calibration` was loaded and not freed, `flange_from_tool` is null or has 16 numbers, `options` is null or points to
/// options, `out` points to a pointer, `message` is null or has `message_size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_corrector_new(
    calibration: *const Calibration,
    flange_from_tool: *const f64,
    options: *const CorrectorOptions,
    out: *mut *mut CorrectorHandle,
    message: *mut c_char,
    message_size: usize,
) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        worded(message, message_size, || {
            empty(out)?;
            rounds_to_nearest()?;
            let loaded = &borrow(calibration)?.loaded;
            let tool = tool(flange_from_tool, &loaded.tool).inspect_err(|status| {
                if *status == Status::BadOption {
                    tell(message, message_size, "the last row of the tool must be 0 0 0 1");
                }
            })?;
            let options =
                if options.is_null() { CorrectorOptions::usual() } else { options.read_unaligned() };
            let options = options.core(loaded).inspect_err(|_| {
                tell(message, message_size, "the task must be 0, 1 or 2");
            })?;
            let (calibrated, programming) = (Arc::clone(&loaded.calibrated), Arc::clone(&loaded.programming));
            match Corrector::new(calibrated, programming, &tool, options) {
                Ok(core) => {
                    warm_up(&core);
                    out.write(give(CorrectorHandle { core: Arc::new(core) }));
                    Ok(Status::Ok)
                }
                Err(error) => {
                    tell(message, message_size, &error.to_string());
                    Err(Status::BadOption)
                }
            }
        })
    }
}

/// Frees a corrector; its workspaces and streams stay usable. Null is no mistake.
///
/// # Safety
/// `corrector` is null or was made and not freed, and nobody uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_corrector_free(corrector: *mut CorrectorHandle) -> Status {
    // SAFETY: as the caller promises.
    guarded(|| Ok(unsafe { free(corrector) }))
}

/// Makes a workspace: the memory that one thread needs to use a corrector.
///
/// # Safety
/// `corrector` was made and not freed, `out` points to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_workspace_new(
    corrector: *const CorrectorHandle,
    out: *mut *mut WorkspaceHandle,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        unsafe {
            empty(out)?;
            let core = &borrow(corrector)?.core;
            out.write(give(WorkspaceHandle {
                of: Arc::clone(core),
                busy: AtomicBool::new(false),
                core: core.workspace(),
                memory: Memory::new(core.joint_count(), core.feature_count()),
            }));
        }
        Ok(Status::Ok)
    })
}

/// Frees a workspace. Null is no mistake.
///
/// # Safety
/// `workspace` is null or was made and not freed, and nobody uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_workspace_free(workspace: *mut WorkspaceHandle) -> Status {
    // SAFETY: as the caller promises.
    guarded(|| Ok(unsafe { free(workspace) }))
}

/// Stream options with their defaults.
#[unsafe(no_mangle)]
pub extern "C" fn truearm_default_stream_options() -> StreamSettings {
    StreamSettings::usual()
}

/// Makes a stream: corrections of one robot's set-points, switched on, with nothing applied yet.
///
/// Null as `options` means the defaults. On failure `*out` is null and `message` (may be null) says what is wrong.
///
/// # Safety
/// `corrector` was made and not freed, `options` is null or points to options, `out` points to a pointer, `message` is null
/// or has `message_size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_stream_new(
    corrector: *const CorrectorHandle,
    options: *const StreamSettings,
    out: *mut *mut StreamHandle,
    message: *mut c_char,
    message_size: usize,
) -> Status {
    // SAFETY: as the caller promises.
    unsafe {
        worded(message, message_size, || {
            empty(out)?;
            let core = &borrow(corrector)?.core;
            let options = if options.is_null() { StreamSettings::usual() } else { options.read_unaligned() };
            let memory = Memory::new(core.joint_count(), core.feature_count());
            match Stream::new(Arc::clone(core), options.core()) {
                Ok(core) => {
                    let busy = AtomicBool::new(false);
                    out.write(give(StreamHandle { busy, core, memory }));
                    Ok(Status::Ok)
                }
                Err(error) => {
                    tell(message, message_size, &error.to_string());
                    Err(Status::BadOption)
                }
            }
        })
    }
}

/// Frees a stream. Null is no mistake.
///
/// # Safety
/// `stream` is null or was made and not freed, and nobody uses it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn truearm_stream_free(stream: *mut StreamHandle) -> Status {
    // SAFETY: as the caller promises.
    guarded(|| Ok(unsafe { free(stream) }))
}

/// Gives a loaded calibration to C, or says why there is none.
///
/// # Safety
/// `out` points to a pointer, `message` is null or has `size` bytes.
unsafe fn hand_over(
    loaded: Result<Loaded, LoadError>,
    out: *mut *mut Calibration,
    message: *mut c_char,
    size: usize,
) -> Result<Status, Status> {
    let loaded = loaded.and_then(|loaded| {
        let joints = loaded.calibrated.joint_count();
        let few = joints <= MOST_JOINTS;
        if few { Ok(loaded) } else { Err(LoadError::Content(format!("it has {joints} joints"))) }
    });
    // SAFETY: as the caller promises.
    unsafe {
        match loaded {
            Ok(loaded) => {
                out.write(give(Calibration { loaded }));
                Ok(Status::Ok)
            }
            Err(error) => {
                tell(message, size, &error.to_string());
                Err(status(&error))
            }
        }
    }
}

fn status(error: &LoadError) -> Status {
    match error {
        LoadError::Unreadable(_) | LoadError::NoFile(_) => Status::Unreadable,
        LoadError::NotOurs(_) => Status::NotACalibration,
        LoadError::Schema { .. } => Status::UnknownLayout,
        LoadError::UnknownModel => Status::UnknownModel,
        _ => Status::Altered,
    }
}

/// # Safety
/// `matrix` is null or has 16 numbers.
unsafe fn tool(matrix: *const f64, own: &Transform) -> Result<Transform, Status> {
    if matrix.is_null() {
        return Ok(*own);
    }
    let mut numbers = [0.0; 16];
    // SAFETY: as the caller promises.
    unsafe { copy_in(matrix, numbers.len(), &mut numbers)? };
    if numbers[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(Status::BadOption);
    }
    Ok(Transform::from_matrix(&numbers))
}

/// The first call chooses the machine's instruction set, which reads the environment.
fn warm_up(corrector: &Corrector) {
    let mut workspace = corrector.workspace();
    let (joints, features) = (corrector.joint_count(), corrector.feature_count());
    let mut out = vec![0.0; joints];
    let _ = corrector.correct(&vec![0.0; joints], &vec![0.0; features], true, &mut out, &mut workspace);
}
