//! Serial chains with Denavit-Hartenberg links: poses and Jacobians over lanes of eight.
//!
//! Lengths are metres, angles radians. A chain is `base`, its links in order, `end`; its parameters are
//! ordered by link, and within a link theta, d, a, alpha, beta. A group of eight poses is worked on at
//! once: every scalar of the textbook is a [`Lane`] of eight, and [`dispatch`] compiles the same plain
//! loops for the instruction sets of the machine it may run on.

#![allow(clippy::needless_range_loop, reason = "loops over lanes go through several arrays with one index")]

mod batch;
mod bend;
mod cancel;
mod chain;
mod error;
mod exponential;
mod frame;
mod isa;
mod lane;
mod levers;
mod one_pose;
mod parameters;
mod piece;
mod point;
mod quantity;
mod rows;
mod sweep;
mod transform;
mod trig;
mod vector;
mod writer;
mod x86;

pub use batch::Batch;
pub use bend::{Bent, bend};
pub use cancel::{Cancel, Cancelled};
pub use chain::{Chain, Convention, Joint, Link};
pub use error::KinematicsError;
pub use exponential::exp;
pub use frame::LaneFrame;
pub use isa::{InstructionSet, Isa, Kernel, dispatch, dispatch_on};
pub use lane::{LANES, Lane, Pick, Short};
pub use levers::{BESIDE, LeverScratch, lever_count};
pub use one_pose::OnePose;
pub use parameters::{ANGLE_ARM, LaneParameters, Parameters, SharedParameters, is_length};
pub use rows::{lane_room, load_lanes, store_lanes};
pub use sweep::Screw;
pub use transform::{Transform, rotation_exp, rotation_log};
pub use trig::{polynomial, sin_cos};
pub use vector::{cross, lane_cross, norm};
