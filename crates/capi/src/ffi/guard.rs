//! What every C function does: check pointers and sizes, copy, and let no panic out.

use std::ffi::c_char;
use std::hint::black_box;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::status::Status;

/// Runs the work of a C function; a panic, which would be a mistake of ours, becomes a status.
pub fn guarded(work: impl FnOnce() -> Result<Status, Status>) -> Status {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(status) | Err(status)) => status,
        Err(_) => Status::Internal,
    }
}

/// Checks a pointer to `found` numbers of which `expected` are needed.
pub fn check_array(pointer: *const f64, found: usize, expected: usize) -> Result<(), Status> {
    if found != expected {
        return Err(Status::WrongSize);
    }
    if expected > 0 && (pointer.is_null() || !pointer.is_aligned()) {
        return Err(Status::BadPointer);
    }
    Ok(())
}

/// Copies numbers from C.
///
/// # Safety
/// `from` points to `count` readable numbers.
pub unsafe fn copy_in(from: *const f64, count: usize, to: &mut [f64]) -> Result<(), Status> {
    check_array(from, count, to.len())?;
    if count > 0 {
        // SAFETY: not null, aligned, readable by the caller's promise; our memory is apart from C's.
        unsafe { std::ptr::copy_nonoverlapping(from, to.as_mut_ptr(), count) };
    }
    Ok(())
}

/// Copies numbers to C, whose pointer was checked.
///
/// # Safety
/// `to` points to as many writable numbers.
pub unsafe fn copy_out(from: &[f64], to: *mut f64) {
    // SAFETY: by the caller's promise; our memory is apart from C's.
    unsafe { std::ptr::copy_nonoverlapping(from.as_ptr(), to, from.len()) };
}

/// Checks where a value goes; null means that C wants none.
pub fn check_place<T>(to: *const T) -> Result<(), Status> {
    if to.is_null() || to.is_aligned() { Ok(()) } else { Err(Status::BadPointer) }
}

/// Writes a value where C wants one, whose place was checked.
///
/// # Safety
/// `to` is null or points to writable memory of the size of the value.
pub unsafe fn put<T>(to: *mut T, value: T) {
    if !to.is_null() {
        // SAFETY: not null, aligned, writable by the caller's promise.
        unsafe { to.write(value) };
    }
}

/// Checks that sums are rounded to nearest: what is less than half a step changes 1 neither upwards nor downwards.
pub fn rounds_to_nearest() -> Result<(), Status> {
    const LITTLE: f64 = f64::EPSILON / 8.0;
    let (one, little) = black_box((1.0_f64, LITTLE));
    if one + little == 1.0 && one - little == 1.0 { Ok(()) } else { Err(Status::BadRounding) }
}

/// Checks where a new handle goes, and leaves null there until there is one.
///
/// # Safety
/// `to` is null or points to a writable pointer.
pub unsafe fn empty<T>(to: *mut *mut T) -> Result<(), Status> {
    if to.is_null() || !to.is_aligned() {
        return Err(Status::BadPointer);
    }
    // SAFETY: not null, aligned, writable by the caller's promise.
    unsafe { to.write(std::ptr::null_mut()) };
    Ok(())
}

/// Guards a function with a message, which is empty where all went well and holds words where it did not.
///
/// # Safety
/// As for [`tell`].
pub unsafe fn worded(
    message: *mut c_char,
    size: usize,
    work: impl FnOnce() -> Result<Status, Status>,
) -> Status {
    // SAFETY: as the caller promises.
    unsafe { tell(message, size, "") };
    let status = guarded(work);
    // SAFETY: as the caller promises; the first byte has just been written.
    unsafe {
        if status as i32 != 0 && !message.is_null() && size > 0 && message.read() == 0 {
            tell(message, size, &status.text().to_string_lossy());
        }
    }
    status
}

/// Writes a message of an error, cut to `size` bytes with the zero at its end.
///
/// # Safety
/// `to` is null or points to `size` writable bytes.
pub unsafe fn tell(to: *mut c_char, size: usize, message: &str) {
    if to.is_null() || size == 0 {
        return;
    }
    let mut length = message.len().min(size - 1);
    while !message.is_char_boundary(length) {
        length -= 1;
    }
    // SAFETY: length is below size.
    unsafe {
        std::ptr::copy_nonoverlapping(message.as_ptr(), to.cast(), length);
        to.add(length).write(0);
    }
}
