//! All tests of the crate from outside, in one binary: it is built and linked once.
#![allow(missing_docs, reason = "tests")]

#[path = "../common/mod.rs"]
mod common;

mod choice;
mod dense;
mod errors;
mod identifiability;
mod jacobians;
mod noise;
mod non_negative;
mod prior;
mod recovery;
mod rows;
mod start;
mod threads;
