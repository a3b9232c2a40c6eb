//! What functions return, and its words.

use std::ffi::{CStr, c_char};

/// What a function returns: zero done, positive done with a remark, negative not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// The set-point has no correction of its own; the last one is held or ramped down, and is in the output.
    Held = 1,
    /// The waypoint must not be corrected; the output is not written.
    Refused = 2,
    /// A pointer is null or not aligned.
    BadPointer = -1,
    /// An array has another length than the arm or the calibration's features need.
    WrongSize = -2,
    /// A reading or a feature is NaN or infinite, or so large that the result is; the output is not written.
    NotFinite = -3,
    /// A handle is of another kind or was freed.
    BadHandle = -4,
    /// Another thread is using this workspace or stream.
    Busy = -5,
    /// The file cannot be read.
    Unreadable = -6,
    /// The file is no calibration.
    NotACalibration = -7,
    /// The calibration is cut short, altered or contradicts itself.
    Altered = -8,
    /// The calibration has a layout that this library does not know.
    UnknownLayout = -9,
    /// An option breaks its rule.
    BadOption = -10,
    /// There was no set-point yet, so there is nothing to give out.
    NotStarted = -11,
    /// A mistake in this library.
    Internal = -12,
    /// The workspace was made for another corrector.
    OtherWorkspace = -13,
    /// The calibration is whole, but its model is none that this library knows: constant and variable ones.
    UnknownModel = -14,
    /// The thread does not round to nearest, without which numbers would be wrong: fesetround(FE_TONEAREST).
    BadRounding = -15,
}

impl Status {
    const ALL: [Self; 18] = [
        Self::Ok,
        Self::Held,
        Self::Refused,
        Self::BadPointer,
        Self::WrongSize,
        Self::NotFinite,
        Self::BadHandle,
        Self::Busy,
        Self::Unreadable,
        Self::NotACalibration,
        Self::Altered,
        Self::UnknownLayout,
        Self::BadOption,
        Self::NotStarted,
        Self::Internal,
        Self::OtherWorkspace,
        Self::UnknownModel,
        Self::BadRounding,
    ];

    /// A sentence about it.
    pub(super) const fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"done",
            Self::Held => c"the set-point has no correction of its own; the last one is held or ramped down",
            Self::Refused => c"the waypoint must not be corrected: see reason",
            Self::BadPointer => c"a pointer is null or not aligned",
            Self::WrongSize => c"an array has another length than truearm_joint_count and truearm_feature_count say",
            Self::NotFinite => c"a reading or a feature is NaN or infinite, or so large that the result is",
            Self::BadHandle => c"a handle is of another kind or was freed",
            Self::Busy => c"another thread is using this workspace or stream: give each thread its own",
            Self::Unreadable => c"the file cannot be read",
            Self::NotACalibration => c"the file is no calibration",
            Self::Altered => c"the calibration is cut short, altered or contradicts itself",
            Self::UnknownLayout => c"the calibration has a layout that this library does not know",
            Self::BadOption => c"an option breaks its rule",
            Self::NotStarted => c"there was no set-point yet",
            Self::Internal => c"a mistake in this library: please report it",
            Self::OtherWorkspace => c"the workspace was made for another corrector",
            Self::UnknownModel => {
                c"this library knows constant and variable models: calibrate with --model constant or variable"
            }
            Self::BadRounding => c"the thread does not round to nearest: call fesetround(FE_TONEAREST) before",
        }
    }
}

/// Version of this interface; a program compares it with truearm_abi_version().
pub const TRUEARM_ABI_VERSION: u32 = 1;

/// TRUEARM_ABI_VERSION of the library that is linked.
#[unsafe(no_mangle)]
pub extern "C" fn truearm_abi_version() -> u32 {
    TRUEARM_ABI_VERSION
}

/// Version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn truearm_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(text) => text,
            Err(_) => c"unknown",
        };
    VERSION.as_ptr()
}

/// A sentence about a status; never null.
#[unsafe(no_mangle)]
pub extern "C" fn truearm_status_text(status: i32) -> *const c_char {
    let known = Status::ALL.into_iter().find(|known| *known as i32 == status);
    known.map_or(c"no status of this library", Status::text).as_ptr()
}

/// A sentence about the reason of a correction or of a stream's state; never null.
#[unsafe(no_mangle)]
pub extern "C" fn truearm_reason_text(reason: u32) -> *const c_char {
    let text = match reason {
        0 => c"nothing is wrong",
        1 => c"a reading or a feature is not a finite number, or none came",
        2 => c"the tool cannot be brought to the target's position: singular, or out of reach",
        3 => c"the tool cannot be turned to the target's orientation: singular, or out of reach",
        4 => c"a corrected joint would be beyond its limits",
        5 => c"a joint would change by more than is allowed",
        6 => c"the tool would be shifted by more than is allowed",
        7 => c"the tool would be turned by more than is allowed",
        8 => c"the calibration is more uncertain there than is allowed",
        9 => c"the shift changes too fast along the path",
        10 => c"the turn changes too fast along the path",
        11 => c"the solution belongs to another branch of the arm",
        100 => c"the set-point came after the deadline, or none came",
        _ => c"no reason of this library",
    };
    text.as_ptr()
}
