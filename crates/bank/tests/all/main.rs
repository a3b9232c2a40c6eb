//! All tests of the crate from outside, in one binary: it is built and linked once.
#![allow(missing_docs, reason = "tests")]

#[path = "../common/mod.rs"]
mod common;

mod banks;
mod cells;
mod kernel;
