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
}

/// What a handle is in memory. C's pointer leads to its first bytes, so that a check reads nothing but the mark.
#[repr(C)]
struct Marked<T> {
    mark: u64,
    handle: T,
}

/// A loaded calibration.
pub struct Calibration {
    pub(super) loaded: Loaded,
}

/// A calibration and a tool, ready to correct and predict.
pub struct CorrectorHandle {
    pub(super) core: Arc<Corrector>,
}

/// Memory of one thread.
pub struct WorkspaceHandle {
    /// The corrector that it was made for.
    pub(super) of: Arc<Corrector>,
    pub(super) busy: AtomicBool,
    pub(super) core: Workspace,
    pub(super) memory: Memory,
}

/// Corrections of one robot's set-points.
pub struct StreamHandle {
    pub(super) busy: AtomicBool,
    pub(super) core: Stream,
    pub(super) memory: Memory,
}

impl Handle for Calibration {
    const MARK: u64 = u64::from_le_bytes(*b"ta-calib");
}

impl Handle for CorrectorHandle {
    const MARK: u64 = u64::from_le_bytes(*b"ta-corre");
}

impl Handle for WorkspaceHandle {
    const MARK: u64 = u64::from_le_bytes(*b"ta-works");
}

impl Handle for StreamHandle {
    const MARK: u64 = u64::from_le_bytes(*b"ta-strea");
}

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
    Box::into_raw(Box::new(Marked { mark: T::MARK, handle })).cast()
}

/// Checks a pointer that C passed; what it says is of this kind was made by `give`.
///
/// # Safety
/// `pointer` is null or points to eight readable bytes.
unsafe fn check<T: Handle>(pointer: *const T) -> Result<*const Marked<T>, Status> {
    let mark = pointer.cast::<u64>();
    if mark.is_null() || !mark.is_aligned() {
        return Err(Status::BadPointer);
    }
    // SAFETY: not null, aligned, and readable by the caller's promise.
    if unsafe { mark.read() } == T::MARK { Ok(pointer.cast()) } else { Err(Status::BadHandle) }
}

/// Where the handle is that C's pointer means.
///
/// # Safety
/// `pointer` is null or points to a handle, of whatever kind.
pub unsafe fn place<T: Handle>(pointer: *mut T) -> Result<*mut T, Status> {
    // SAFETY: as the caller promises; the mark says that `give` made it.
    unsafe {
        let marked = check(pointer)?.cast_mut();
        Ok(&raw mut (*marked).handle)
    }
}

/// A handle that is only read.
///
/// # Safety
/// As for [`place`]; nobody frees the handle meanwhile.
pub unsafe fn borrow<'a, T: Handle>(pointer: *const T) -> Result<&'a T, Status> {
    // SAFETY: as the caller promises; the mark says that `give` made it.
    unsafe { Ok(&(*check(pointer)?).handle) }
}

/// Frees a handle; null is no mistake, and what is none of this kind is left alone.
///
/// # Safety
/// As for [`place`]; nobody uses the handle meanwhile or afterwards.
pub unsafe fn free<T: Handle>(pointer: *mut T) -> Status {
    if pointer.is_null() {
        return Status::Ok;
    }
    // SAFETY: the mark says that `give` made it, and the caller that nobody uses it.
    unsafe {
        let marked = match check(pointer) {
            Ok(marked) => marked.cast_mut(),
            Err(status) => return status,
        };
        (&raw mut (*marked).mark).write_volatile(0);
        drop(Box::from_raw(marked));
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
