//! All inverse kinematics of a plain arm: the readings at which its flange has a given pose.
//!
//! Arms with an ortho-parallel base and a spherical wrist, and arms with three parallel axes such as those of
//! Universal Robots, have closed forms with up to eight solutions. They are taken from the plain arm that is
//! nearest to the given one and polished by Newton steps on the given one, so that a factory-calibrated arm,
//! which is never quite plain, has all its branches too. Any other arm is solved from many starts.

mod arm;
mod axes;
mod branch;
mod error;
mod newton;
mod opw;
mod parallel;
mod readings;
mod shape;
mod solver;
mod vector;

pub use arm::Arm;
pub use branch::Branch;
pub use error::InverseError;
pub use readings::Readings;
pub use shape::Method;
pub use solver::Inverse;
