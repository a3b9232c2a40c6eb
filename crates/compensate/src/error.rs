//! What a model, a corrector or an array can have wrong.

use truearm_kinematics::{Cancelled, KinematicsError};

/// Why a corrector could not be made, or a path not be worked on at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CompensateError {
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
    /// A number that is NaN or infinite.
    #[error("{what} holds {value}, its numbers must be finite")]
    NotFinite {
        /// The array.
        what: &'static str,
        /// The value.
        value: f64,
    },
    /// A bound that bounds nothing.
    #[error("{what} is {value}, it must be positive; infinity switches it off")]
    Bound {
        /// The bound.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A time that is nothing, or never ends.
    #[error("{what} is {value}, it must be positive and finite")]
    Time {
        /// The time.
        what: &'static str,
        /// Its value, s.
        value: f64,
    },
    /// Joint limits between which no reading lies.
    #[error(
        "the limits of joint {joint} are {low} and {high}: give the lowest reading first; infinity is none"
    )]
    JointLimits {
        /// Joint from 1.
        joint: usize,
        /// Lowest reading, rad or m.
        low: f64,
        /// Highest reading.
        high: f64,
    },
    /// Moving joints that the arm does not have, or none.
    #[error("joints {moving:?} (from 0) are to move, it must be some of the arm's {joints}, ascending")]
    Moving {
        /// What was given.
        moving: Vec<usize>,
        /// Joints of the arm.
        joints: usize,
    },
    /// Two models of arms that differ in their joints.
    #[error("the programming model has {programming} joints and the calibrated one {calibrated}")]
    Joints {
        /// Joints of the one.
        programming: usize,
        /// Joints of the other.
        calibrated: usize,
    },
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The chain refused its input.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
}

/// Check the length of an array.
pub(crate) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), CompensateError> {
    if found == expected { Ok(()) } else { Err(CompensateError::Length { what, found, expected }) }
}

/// Check that all bounds, each with its name, are positive; infinity is.
pub(crate) fn check_bounds(bounds: &[(&'static str, f64)]) -> Result<(), CompensateError> {
    match bounds.iter().find(|(_, value)| value.is_nan() || *value <= 0.0) {
        Some(&(what, value)) => Err(CompensateError::Bound { what, value }),
        None => Ok(()),
    }
}

/// Check that all numbers are finite.
pub(crate) fn check_finite(what: &'static str, values: &[f64]) -> Result<(), CompensateError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(CompensateError::NotFinite { what, value }),
        None => Ok(()),
    }
}
