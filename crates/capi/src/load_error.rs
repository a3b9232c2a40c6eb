//! Why a calibration could not be read.

use truearm_bank::BankError;
use truearm_compensate::CompensateError;
use truearm_kinematics::KinematicsError;

/// What is wrong with a calibration file.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read at all.
    #[error("the file cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// What is there is no file, and might never end.
    #[error("this is {0}, a regular file is needed: copy the calibration into one")]
    NoFile(&'static str),
    /// Something else than a calibration.
    #[error("this is no calibration ({0}); one is written by: truearm calibrate")]
    NotOurs(&'static str),
    /// A byte is missing or another one.
    #[error("this calibration is cut short or altered ({0}): copy it again, or calibrate again")]
    Altered(String),
    /// A layout of another version.
    #[error(
        "the layout of this calibration has version {found}, this library reads version {known}: use the library of \
         the truearm that wrote it ({version}), or calibrate again"
    )]
    Schema {
        /// Version of the layout.
        found: u64,
        /// What this library reads.
        known: u64,
        /// Version of truearm that wrote it.
        version: String,
    },
    /// A model that controllers do not get.
    #[error(
        "the model of this calibration is a scheme of the paper, this library knows constant and variable models: \
         calibrate with --model constant or --model variable"
    )]
    UnknownModel,
    /// Contents that contradict each other.
    #[error("this calibration is not complete: {0}")]
    Content(String),
    /// The chain refused it.
    #[error("this calibration is no arm's: {0}")]
    Kinematics(#[from] KinematicsError),
    /// The field refused it.
    #[error("this calibration's field cannot be used: {0}")]
    Field(#[from] BankError),
    /// The model refused it.
    #[error("this calibration's model cannot be used: {0}")]
    Compensate(#[from] CompensateError),
}
