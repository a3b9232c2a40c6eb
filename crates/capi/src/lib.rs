//! The C library for controllers: a calibration is loaded once; then predictions and corrections cost microseconds and
//! allocate, lock, log and panic never.
//!
//! The C functions are in `ffi`; the header `include/truearm.h` is made from them. [`Loaded`] reads calibration files.

mod container;
mod content;
mod ffi;
mod load_error;
mod loaded;
mod reading;

pub use ffi::*;
pub use load_error::LoadError;
pub use loaded::Loaded;
