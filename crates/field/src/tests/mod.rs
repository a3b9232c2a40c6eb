//! Tests of what the crate keeps to itself: evidence and posterior against dense computations.

#[path = "../../tests/common/mod.rs"]
mod common;
mod evidence;
mod gram;
mod greedy;
mod joined;
mod oracle;
mod posterior;
mod sets;
mod spaces;
mod widening;
