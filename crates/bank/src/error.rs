//! What can be wrong with a bank or with the arrays given to it.

use truearm_kinematics::KinematicsError;

/// A bank or a bound that could not be made or evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BankError {
    /// Array lengths that contradict each other.
    #[error("{what} has {found} values where {expected} are needed")]
    Length {
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length needed.
        expected: usize,
    },
    /// Values that are not finite, or beyond what tables hold.
    #[error("{what}: they must be given and finite")]
    NotFinite {
        /// The values.
        what: &'static str,
    },
    /// A block that no fit makes, as a file that was changed may hold.
    #[error("a block of the field is of no use: {what}; calibrate again")]
    Block {
        /// What is wrong.
        what: &'static str,
    },
    /// The chain refused its input.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
}
