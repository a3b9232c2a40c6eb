//! What the set-up's unknowns leave of the rows' covariance.
//!
//! With K the covariance of the rows (R, R) and flat set-up columns S (R, s) the precision of the rows is
//! `P = K^-1 - K^-1 S (S^T K^-1 S)^-1 S^T K^-1` (Patterson and Thompson 1971).

use faer::{Mat, MatRef};
use truearm_estimate::dense::{Cholesky, parallelism};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::training::Training;

/// The factors of P.
pub struct Projection {
    /// Factor of K.
    pub factor: Cholesky,
    /// K^-1 S, (R, s).
    pub spread: Mat<f64>,
    /// Factor of S^T K^-1 S, with the set-up's prior precision: all but flat, and never singular.
    pub inner: Cholesky,
}

impl Projection {
    /// From the lower triangle of the covariance (R, R) of a training set's rows.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn new(training: &Training, covariance: Mat<f64>, cancel: &Cancel) -> Result<Self, FieldError> {
        let error = || FieldError::NotPositiveDefinite { rows: training.row_count() };
        let factor = Cholesky::heeding(covariance, parallelism(), cancel)?.ok_or_else(error)?;
        let setup = setup_columns(training);
        let mut spread = setup.to_owned();
        factor.solve(spread.as_mut());
        let mut precision = setup.transpose() * &spread;
        for (k, known) in training.setup_precision.iter().enumerate() {
            precision[(k, k)] += known;
        }
        let inner = Cholesky::new(precision, faer::Par::Seq).ok_or_else(error)?;
        Ok(Self { factor, spread, inner })
    }

    /// Q (s, R) with `P = K^-1 - Q^T Q`.
    pub fn root(&self) -> Mat<f64> {
        let mut root = self.spread.transpose().to_owned();
        self.inner.solve_lower(root.as_mut());
        root
    }
}

/// S, (R, s).
pub fn setup_columns(training: &Training) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(&training.setup, training.row_count(), training.setup_width)
}
