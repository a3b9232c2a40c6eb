//! What can go wrong in an estimate, said with the value, the rule and the way out.

use truearm_kinematics::{Cancelled, KinematicsError};

/// An estimate that could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EstimateError {
    /// An array's length contradicts the counts that go with it.
    #[error("{what} has {found} values where {expected} are needed: give one entry per pose")]
    Length {
        /// The array that was given.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that the counts ask for.
        expected: usize,
    },
    /// There are fewer measured values than unknowns.
    #[error(
        "{rows} measured values cannot determine {unknowns} unknowns: measure at least {needed} poses{hint}"
    )]
    TooFew {
        /// Measured values (rows of the least-squares problem).
        rows: usize,
        /// Unknowns without a prior.
        unknowns: usize,
        /// Poses that would be enough.
        needed: usize,
        /// A sentence on the group concerned, or nothing.
        hint: String,
    },
    /// The normal equations are singular although the prior should prevent it.
    #[error(
        "the normal equations are singular ({unknowns} unknowns, {rows} measured values): the poses are too alike to \
         determine the set-up; spread them over the workspace and turn the wrist"
    )]
    Singular {
        /// Unknowns of the problem.
        unknowns: usize,
        /// Measured values.
        rows: usize,
    },
    /// Distances where points are needed.
    #[error("distances were measured where points are needed: measure points, or fit constants alone")]
    Distances,
    /// A value that must be finite is not.
    #[error("{what} is not finite at pose {pose} (counted from 0): remove the row or mend the value")]
    NotFinite {
        /// The quantity concerned.
        what: &'static str,
        /// The first pose concerned.
        pose: usize,
    },
    /// No choice can be made by what candidates tell.
    #[error(
        "the candidates' Jacobians are zero, or too large to be weighed against each other: draw poses in which more \
         joints move, or choose them for other parameters"
    )]
    Untelling,
    /// A set-up is that of other measurements.
    #[error(
        "the set-up has {found} {what} where the measurements need {expected}: give the set-up of a fit to them"
    )]
    Setup {
        /// What there are too few or too many of.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// Link parameters are those of another arm or of other poses.
    #[error(
        "the link parameters have {found} values where {expected} are needed, or as many for each pose: give five for \
         each link"
    )]
    Parameters {
        /// How many there are.
        found: usize,
        /// Those of one set.
        expected: usize,
    },
    /// An option is out of its range.
    #[error("{what} is {value}, but {rule}")]
    Option {
        /// The option.
        what: &'static str,
        /// The value given.
        value: f64,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The chain refused its input.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
}
