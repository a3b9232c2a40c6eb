//! What can go wrong in fitting or evaluating a field.

use truearm_bank::BankError;
use truearm_estimate::EstimateError;
use truearm_kinematics::{Cancelled, KinematicsError};

/// A field that could not be fitted or evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// A covariance matrix that is not positive definite.
    #[error(
        "the covariance of {rows} measured values is not positive definite: the measurements hold values far outside \
         the model (look for wrong units or gross outliers)"
    )]
    NotPositiveDefinite {
        /// Rows of the matrix.
        rows: usize,
    },
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
    /// A number or an index that is out of its range.
    #[error("{what} is {value}, but {rule}")]
    Option {
        /// What was given.
        what: &'static str,
        /// Its value.
        value: usize,
        /// The rule that it breaks, and the way out.
        rule: &'static str,
    },
    /// Values that are not finite, or not positive where they must be, or none at all.
    #[error("{what}: they must be given, finite, and standard deviations positive")]
    NotFinite {
        /// The values.
        what: &'static str,
    },
    /// A range without an inside.
    #[error(
        "the range of input {input} (counted from 0) is {low} to {high}: give the lowest and then the highest value, \
         both finite"
    )]
    Ends {
        /// The input.
        input: usize,
        /// What should be the lowest value.
        low: f64,
        /// What should be the highest.
        high: f64,
    },
    /// A value beyond its range.
    #[error(
        "input {input} (counted from 0) is at {value} where its range is {low} to {high}: take samples within the \
         ranges, or widen these"
    )]
    Range {
        /// The input.
        input: usize,
        /// Its value.
        value: f64,
        /// Lowest value.
        low: f64,
        /// Highest value.
        high: f64,
    },
    /// A whole workspace whose poses tell too little of the CEPs.
    #[error(
        "the condition number of the whole workspace's poses is {kappa:.1} where {limit} is allowed: give more poses \
         or candidates, fewer parameters, or a higher limit"
    )]
    IllConditioned {
        /// Their condition number.
        kappa: f64,
        /// The largest that is allowed.
        limit: f64,
    },
    /// A whole workspace with fewer poses than a region takes.
    #[error(
        "the whole workspace has {found} poses where a region takes {needed}: widen the workspace, loosen its rules, \
         measure more, or ask for fewer poses a region"
    )]
    Scarce {
        /// Poses that there are.
        found: usize,
        /// Poses that it takes.
        needed: usize,
    },
    /// Hyper-parameters of no arm, as a file that was changed may hold.
    #[error("the hyper-parameters of the field are of no use: {what}; calibrate again")]
    Hyper {
        /// What is wrong.
        what: &'static str,
    },
    /// The constant stage failed.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// The bank refused what it was made of, or its input.
    #[error(transparent)]
    Bank(#[from] BankError),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The chain refused its input.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
}
