//! How a variable calibration is fitted, and where its search begins.

use truearm_bank::Input;
use truearm_estimate::{Prior, Problem};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::drives::Drives;
use crate::hyper::Hyper;

/// How the field is fitted.
#[derive(Debug, Clone)]
pub struct FieldOptions {
    /// Degree of the memberships, 2 or 3.
    pub degree: usize,
    /// Prior of the constants.
    pub prior: Prior,
    /// Columns (indices into the problem's) whose constants the data determines.
    pub determined: Vec<usize>,
    /// Columns that blocks drive.
    pub driven: Vec<usize>,
    /// Further inputs of the field (features), and their values (n, F).
    pub features: Vec<Input>,
    /// Which of them are weights that the arm carries.
    pub payloads: Vec<usize>,
    /// Values of the features, (n, F) row-major.
    pub feature_values: Vec<f64>,
    /// Drives that turn several joints, with whose readings curves may go.
    pub drives: Option<Drives>,
    /// Where the search for hyper-parameters begins.
    pub begin: Begin,
    /// Whether hyper-parameters of a search on a part of the poses are enough.
    pub rough: bool,
    /// Looked at between evaluations.
    pub cancel: Cancel,
}

impl FieldOptions {
    /// Checks that columns, features and payloads are those of a problem, and that something varies with something.
    ///
    /// # Errors
    /// [`FieldError::Option`], [`FieldError::Length`], [`FieldError::NotFinite`].
    pub fn check(&self, problem: &Problem) -> Result<(), FieldError> {
        let refuse = |what, value, rule| Err(FieldError::Option { what, value, rule });
        let (columns, features) = (problem.columns.len(), self.features.len());
        if !matches!(self.degree, 2 | 3) {
            return refuse("the memberships' degree", self.degree, "it must be 2 or 3");
        }
        let given = self.determined.iter().chain(&self.driven);
        if let Some(&column) = given.into_iter().find(|&&column| column >= columns) {
            let rule = "determined and driven columns are counted from 0 among the problem's: give places, not parameters";
            return refuse("a column", column, rule);
        }
        if self.driven.is_empty() {
            return refuse(
                "the number of driven columns",
                0,
                "a field needs one at least: without, fit constants",
            );
        }
        if let Some(&payload) = self.payloads.iter().find(|&&payload| payload >= features) {
            return refuse(
                "a payload",
                payload,
                "payloads are counted from 0 among the features: give its range too",
            );
        }
        let (found, expected) = (self.feature_values.len(), features * problem.measurements.pose_count());
        if found != expected {
            return Err(FieldError::Length { what: "features", found, expected });
        }
        if !self.feature_values.iter().all(|value| value.is_finite()) {
            return Err(FieldError::NotFinite { what: "features" });
        }
        Ok(())
    }
}

/// Where a fit to nearly the same measurements ended.
#[derive(Debug, Clone)]
pub struct Start {
    pub(crate) hyper: Hyper,
    pub(crate) evidence: f64,
}

/// Where the search for hyper-parameters begins.
#[derive(Debug, Clone, Default)]
pub enum Begin {
    /// From nothing but the rows.
    #[default]
    Anew,
    /// It does not: these are used.
    Known(Hyper),
    /// Where a fit to nearly the same measurements ended.
    Near(Start),
    /// There, with a search from nothing beside it: the more probable end wins.
    Contested(Start),
}

impl Begin {
    /// Whether hyper-parameters are looked for.
    pub(crate) fn searches(&self) -> bool {
        !matches!(self, Self::Known(_))
    }

    /// Hyper-parameters that were found before.
    pub(crate) fn found(&self) -> Option<&Hyper> {
        match self {
            Self::Anew => None,
            Self::Known(hyper) => Some(hyper),
            Self::Near(start) | Self::Contested(start) => Some(&start.hyper),
        }
    }
}
