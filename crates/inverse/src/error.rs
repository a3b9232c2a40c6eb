//! What can be wrong with an arm or with what is asked of it.

use thiserror::Error;
use truearm_kinematics::KinematicsError;

/// Why inverse kinematics could not be made or asked.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum InverseError {
    /// The chain itself.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
    /// An array whose length does not fit.
    #[error("{name} has {got} numbers, it must have {wanted}")]
    Length {
        /// Which array.
        name: &'static str,
        /// Its length.
        got: usize,
        /// What it should be.
        wanted: usize,
    },
    /// More solutions than anybody can go through.
    #[error(
        "there are {count:.0} readings that differ by whole turns, at the most {most} are listed: leave turns out, or give the \
         joints narrower limits"
    )]
    Turns {
        /// How many.
        count: f64,
        /// The most.
        most: usize,
    },
    /// A seed that is NaN or infinite.
    #[error("the seed holds {value}, all its numbers must be finite")]
    SeedNotFinite {
        /// The number.
        value: f64,
    },
}
