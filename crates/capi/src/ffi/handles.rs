//! What C holds by pointer: boxes with a mark of their kind, so that most mistaken pointers are noticed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use truearm_compensate::{Corrector, Stream, Workspace};

use super::status::Status;
use crate::loaded::Loaded;

/// Something that C holds by pointer.
pub trait Handle: Sized {
    /// Mark of the kind.
    const MARK: u64;
    /// Where the mark is.
    fn mark(&mut self) -> &mut u64;
    /// The mark of a handle that may be none.
    ///
    /// # Safety
    /// `pointer` points to readable memory of the size of the handle.
    unsafe fn mark_at(pointer: *const Self) -> u64;
}

macro_rules! handle {
    ($name:ident, $mark:literal) => {
        impl Handle for $name {
            const MARK: u64 = u64::from_le_bytes(*$mark);

            fn mark(&mut self) -> &mut u64 {
                &mut self.mark
            }

            unsafe fn mark_at(pointer: *const Self) -> u64 {
                // SAFETY: the caller's promise.
                unsafe { (&raw const (*pointer).mark).read() }
            }
        }
    };
}

/// A loaded calibration.
pub struct Calibration {
    pub(super) mark: u64,
    pub(super) loaded: Loaded,
}

/// A calibration and a tool, ready to correct and predict.
pub struct CorrectorHandle {
    pub(super) mark: u64,
    pub(super) core: Arc<Corrector>,
}

/// Memory of one thread.
pub struct WorkspaceHandle {
    pub(super) mark: u64,
    /// The corrector that it was made for.
    pub(super) of: Arc<Corrector>,
    pub(super) busy: AtomicBool,
    pub(super) core: Workspace,
    pub(super) memory: Memory,
}

/// Corrections of one robot's set-points.
pub struct StreamHandle {
    pub(super) mark: u64,
    pub(super) busy: AtomicBool,
    pub(super) core: Stream,
    pub(super) memory: Memory,
}

handle!(Calibration, b"ta-calib");
handle!(CorrectorHandle, b"ta-corre");
handle!(WorkspaceHandle, b"ta-works");
handle!(StreamHandle, b"ta-strea");

/// Room for what comes from C, so that its arrays may overlap.
pub struct Memory {
    pub readings: Vec<f64>,
    pub features: Vec<f64>,
    pub out: Vec<f64>,
}

impl Memory {
    /// Room for so many joints and features.
    pub fn new(joints: usize, features: usize) -> Self {
        Self { readings: vec![0.0; joints], features: vec![0.0; features], out: vec![0.0; joints] }
    }
}

/// A handle for C to keep.
pub fn give<T: Handle>(handle: T) -> *mut T {
    Box::into_raw(Box::new(handle))
}

/// Checks a pointer to a handle.
///
/// # Safety
/// `pointer` is null or points to readable memory of the size of a handle.
pub unsafe fn check<T: Handle>(pointer: *const T) -> Result<(), Status> {
    if pointer.is_null() || !pointer.is_aligned() {
        return Err(Status::BadPointer);
    }
    // SAFETY: not null, aligned, and readable by the caller's promise.
    let mark = unsafe { T::mark_at(pointer) };
    if mark == T::MARK { Ok(()) } else { Err(Status::BadHandle) }
}

/// A handle that is only read.
///
/// # Safety
/// As for [`check`]; nobody frees the handle meanwhile.
pub unsafe fn borrow<'a, T: Handle>(pointer: *const T) -> Result<&'a T, Status> {
    // SAFETY: as the caller promises.
    unsafe {
        check(pointer)?;
        Ok(&*pointer)
    }
}

/// Frees a handle; null is no mistake, and what is none of this kind is left alone.
///
/// # Safety
/// As for [`check`]; nobody uses the handle meanwhile or afterwards.
pub unsafe fn free<T: Handle>(pointer: *mut T) -> Status {
    if pointer.is_null() {
        return Status::Ok;
    }
    // SAFETY: the mark says that `give` made it, and the caller that nobody uses it.
    unsafe {
        if let Err(status) = check(pointer) {
            return status;
        }
        let mut handle = Box::from_raw(pointer);
        std::ptr::write_volatile(handle.mark(), 0);
    }
    Status::Ok
}

/// Keeps a workspace or stream to one caller; a second one is turned away, never made to wait.
pub struct Turn<'a>(&'a AtomicBool);

impl<'a> Turn<'a> {
    /// Takes the turn if nobody has it.
    pub fn take(busy: &'a AtomicBool) -> Result<Self, Status> {
        if busy.swap(true, Ordering::Acquire) { Err(Status::Busy) } else { Ok(Self(busy)) }
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}
