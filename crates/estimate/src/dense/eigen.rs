//! Eigenvalues and eigenvectors of symmetric matrices.

use faer::{Mat, Side};

/// Of a symmetric matrix (n, n).
#[derive(Debug, Clone)]
pub struct Eigen {
    /// Ascending, (n,).
    pub values: Vec<f64>,
    /// Of unit length, in columns, (n, n).
    pub vectors: Mat<f64>,
}

impl Eigen {
    /// Of a matrix's lower triangle; `None` where it has none, as with entries that are not finite.
    pub fn new(matrix: &Mat<f64>) -> Option<Self> {
        let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
        let values = eigen.S().column_vector().iter().copied().collect();
        Some(Self { values, vectors: eigen.U().to_owned() })
    }
}

/// Eigenvalues alone, ascending, (n,); `None` as for [`Eigen::new`].
pub fn eigenvalues(matrix: &Mat<f64>) -> Option<Vec<f64>> {
    matrix.self_adjoint_eigenvalues(Side::Lower).ok()
}
