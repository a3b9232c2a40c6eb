//! Indices that say how well poses determine parameters, by the singular values of their matrix M.

use faer::Mat;

use crate::EstimateError;
use crate::dense::singular_values;
use crate::scale::{PoseRows, scaled_matrix};

/// What a choice of poses is to make best.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// Smallest condition number of M, and so of M^t M, equation (4) of the paper.
    Condition,
    /// Largest determinant of M^t M.
    Determinant,
    /// Largest geometric mean of the singular values (Borm and Menq 1991).
    O1,
    /// Largest inverse condition number (Driels and Pathre 1990).
    O2,
    /// Largest least singular value (Nahvi, Hollerbach and Hayward 1994).
    O3,
    /// Largest noise amplification index (Nahvi and Hollerbach 1996).
    O4,
    /// Largest inverse of the sum of inverse singular values (Sun and Hollerbach 2008).
    O5,
}

impl Criterion {
    /// Whether the determinant decides.
    pub fn is_determinant(self) -> bool {
        matches!(self, Criterion::Determinant | Criterion::O1)
    }

    /// What is to be as large as possible, of the eigenvalues of M^t M in ascending order.
    pub(super) fn value(self, eigenvalues: &[f64]) -> f64 {
        let (Some(&least), Some(&largest)) = (eigenvalues.first(), eigenvalues.last()) else {
            return 0.0;
        };
        let least = least.max(0.0);
        match self {
            Criterion::Condition | Criterion::O2 => (least / largest).sqrt(),
            Criterion::O3 => least.sqrt(),
            Criterion::O4 => least / largest.sqrt(),
            Criterion::O5 => {
                eigenvalues.iter().map(|value| value.max(0.0).sqrt().recip()).sum::<f64>().recip()
            }
            Criterion::Determinant | Criterion::O1 => eigenvalues.iter().map(|v| v.max(0.0).ln()).sum(),
        }
    }

    /// The least eigenvalue that a better choice has at least, given that its largest one is no less than `largest`.
    pub(super) fn least_for(self, best: f64, largest: f64) -> Option<f64> {
        match self {
            Criterion::Condition | Criterion::O2 => Some(best * best * largest),
            Criterion::O3 => Some(best * best),
            Criterion::O4 => Some(best * largest.sqrt()),
            Criterion::O5 | Criterion::Determinant | Criterion::O1 => None,
        }
    }
}

/// The indices of a set of poses. M's rows are in mm, its columns per mm and per 1/300 rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observability {
    /// Condition number of M, 2-norm; infinite where the poses leave something undetermined.
    pub kappa: f64,
    /// Condition number of M^t M: equation (4) as meant, the square of `kappa`.
    pub kappa_normal: f64,
    /// (s_1 ... s_P)^(1/P) / sqrt(n), with n poses (Borm and Menq 1991).
    pub o1: f64,
    /// s_P / s_1 (Driels and Pathre 1990).
    pub o2: f64,
    /// s_P (Nahvi, Hollerbach and Hayward 1994).
    pub o3: f64,
    /// s_P^2 / s_1 (Nahvi and Hollerbach 1996).
    pub o4: f64,
    /// 1 / (1/s_1 + ... + 1/s_P) (Sun and Hollerbach 2008).
    pub o5: f64,
    /// log det M^t M.
    pub log_determinant: f64,
}

/// A singular value below this share of the largest one is zero but for rounding.
const ROUNDING: f64 = 1e-13;

/// Indices of a scaled matrix (n m, P) of n poses, see [`crate::scaled_jacobian`].
///
/// # Errors
/// [`EstimateError::NotFinite`] where the matrix holds values that have no singular values.
pub fn observability(matrix: &Mat<f64>, poses: usize) -> Result<Observability, EstimateError> {
    let failed = EstimateError::NotFinite { what: "the Jacobian of a pose", pose: 0 };
    let mut singular = singular_values(matrix.as_ref()).ok_or(failed)?;
    singular.resize(matrix.ncols(), 0.0);
    let (largest, least) = (singular[0], singular[singular.len() - 1]);
    let least = if least <= ROUNDING * largest { 0.0 } else { least };
    let logs: f64 = singular.iter().map(|s| s.ln()).sum();
    let logs = if least == 0.0 { f64::NEG_INFINITY } else { logs };
    let kappa = if least == 0.0 { f64::INFINITY } else { largest / least };
    let share = if least == 0.0 { 0.0 } else { least / largest };
    Ok(Observability {
        kappa,
        kappa_normal: kappa * kappa,
        o1: (logs / singular.len() as f64).exp() / (poses.max(1) as f64).sqrt(),
        o2: share,
        o3: least,
        o4: least * share,
        o5: if least == 0.0 { 0.0 } else { singular.iter().map(|s| s.recip()).sum::<f64>().recip() },
        log_determinant: 2.0 * logs,
    })
}

/// Indices of poses with Jacobians (n, m, P), m and rad, of the parameters `columns`.
///
/// # Errors
/// [`EstimateError`] where lengths do not fit or a value is not finite.
pub fn observability_of(
    jacobian: &[f64],
    rows: PoseRows,
    columns: &[usize],
) -> Result<Observability, EstimateError> {
    let matrix = scaled_matrix(jacobian, rows, columns)?;
    observability(&matrix, matrix.nrows() / rows.count)
}
