//! What can be wrong with an arm, or with a way that is asked about.

use thiserror::Error;
use truearm_kinematics::KinematicsError;

/// Why gaps could not be told.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ClearanceError {
    /// A chain, or joint values.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
    /// An arm with more joints before a link than in all.
    #[error("a link has {joints} joints before it, the arm has {all}")]
    Joints {
        /// Of the link.
        joints: usize,
        /// Of the arm.
        all: usize,
    },
    /// Numbers that do not fill rows.
    #[error("{got} numbers were given, they must fill rows of {width}, one at least")]
    Rows {
        /// How many numbers.
        got: usize,
        /// How many a row has.
        width: usize,
    },
    /// Rows of another width.
    #[error("a place has {got} numbers, it must have {wanted}")]
    Width {
        /// How many a row has.
        got: usize,
        /// How many it should have.
        wanted: usize,
    },
    /// A number that is NaN or infinite.
    #[error("a place holds {value}, all its numbers must be finite")]
    NotFinite {
        /// The number.
        value: f64,
    },
    /// A number of what the table carries, or of where the base stands, that says nothing.
    #[error("{what} holds {value}, it must be {rule}")]
    Value {
        /// What holds it.
        what: &'static str,
        /// The number.
        value: f64,
        /// What it should be.
        rule: &'static str,
    },
    /// A way with more places than are looked at.
    #[error("a way of {count:.0} places was asked for, it may have {most}: take a larger step")]
    TooLong {
        /// How many.
        count: f64,
        /// How many it may have.
        most: usize,
    },
    /// A step of a way.
    #[error("the step is {value}, it must be above 0")]
    Step {
        /// The step.
        value: f64,
    },
}
