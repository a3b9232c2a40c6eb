//! Factors of matrices: Cholesky's with the parallelism said by the caller, others by one thread.
//!
//! faer's results do not depend on the number of threads for the routines used here except when it solves
//! for a single right-hand side, which is therefore always done sequentially.

use std::ops::Range;

use faer::diag::Diag;
use faer::linalg::cholesky::llt::{factor, inverse};
use faer::linalg::matmul::matmul;
use faer::linalg::qr::no_pivoting::factor::{qr_in_place, qr_in_place_scratch, recommended_block_size};
use faer::linalg::qr::no_pivoting::solve::{solve_lstsq_in_place, solve_lstsq_in_place_scratch};
use faer::linalg::solvers::DenseSolveCore;
use faer::linalg::svd::{ComputeSvdVectors, svd, svd_scratch};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, Mat, MatMut, MatRef, Par};

use truearm_kinematics::Cancel;

use crate::EstimateError;

mod eigen;
mod products;

pub use eigen::{Eigen, eigenvalues};
pub use products::{add_product, add_to_lower, product, symmetric_product, times, transposed_product};

/// Rows up to which a matrix is factored at once: in some tenths of a second.
const AT_ONCE: usize = 2048;
/// Columns that are factored or solved for between two looks at a request to stop.
const PANEL: usize = 256;

/// The lower Cholesky factor L of a matrix A = L L^T, (n, n).
#[derive(Debug, Clone)]
pub struct Cholesky {
    lower: Mat<f64>,
    par: Par,
}

impl Cholesky {
    /// Factors the lower triangle of `matrix`; `None` when it is not positive definite.
    pub fn new(mut matrix: Mat<f64>, par: Par) -> Option<Self> {
        factor_in_place(matrix.as_mut(), par)?;
        Some(Self { lower: matrix, par })
    }

    /// The same with a look at `cancel` between parts of the work, which takes seconds where the matrix is large.
    ///
    /// # Errors
    /// [`EstimateError::Cancelled`].
    pub fn heeding(mut matrix: Mat<f64>, par: Par, cancel: &Cancel) -> Result<Option<Self>, EstimateError> {
        let n = matrix.nrows();
        cancel.check()?;
        if n <= AT_ONCE {
            return Ok(Self::new(matrix, par));
        }
        for start in (0..n).step_by(PANEL) {
            cancel.check()?;
            let (width, left) = (PANEL.min(n - start), n - start);
            let rest = matrix.as_mut().submatrix_mut(start, start, left, left);
            let (mut corner, _, mut below, behind) = rest.split_at_mut(width, width);
            if factor_in_place(corner.rb_mut(), par).is_none() {
                return Ok(None);
            }
            let alone = if below.nrows() == 1 { Par::Seq } else { par };
            solve_lower_triangular_in_place(corner.rb(), below.rb_mut().transpose_mut(), alone);
            add_to_lower(behind, below.rb(), below.rb().transpose(), -1.0, par);
        }
        Ok(Some(Self { lower: matrix, par }))
    }

    /// Rows of the matrix.
    pub fn len(&self) -> usize {
        self.lower.nrows()
    }

    /// Whether the matrix has no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// L, zero above the diagonal, (n, n).
    pub fn lower(&self) -> Mat<f64> {
        let n = self.len();
        Mat::from_fn(n, n, |i, j| if i >= j { self.lower[(i, j)] } else { 0.0 })
    }

    /// log det A.
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..self.len()).map(|i| self.lower[(i, i)].ln()).sum::<f64>()
    }

    /// Overwrites `right` (n, k) with L^-1 right.
    pub fn solve_lower(&self, right: MatMut<f64>) {
        let par = if right.ncols() == 1 { Par::Seq } else { self.par };
        solve_lower_triangular_in_place(self.lower.as_ref(), right, par);
    }

    /// Overwrites `right` (n, k) with A^-1 right.
    pub fn solve(&self, mut right: MatMut<f64>) {
        self.solve_lower(right.rb_mut());
        let par = if right.ncols() == 1 { Par::Seq } else { self.par };
        solve_upper_triangular_in_place(self.lower.transpose(), right, par);
    }

    /// A^-1 b for one right-hand side (n,).
    pub fn solve_vector(&self, right: &[f64]) -> Vec<f64> {
        let mut column = column(right);
        self.solve(column.as_mut());
        to_vec(column.as_ref())
    }

    /// The matrix that holds the factor, for another use.
    pub fn into_matrix(self) -> Mat<f64> {
        self.lower
    }

    /// A^-1, both triangles, (n, n).
    pub fn inverse(&self) -> Mat<f64> {
        let mut out = Mat::zeros(self.len(), self.len());
        self.inverse_lower(out.as_mut());
        mirror_lower(&mut out);
        out
    }

    /// Blocks of A^-1 on its diagonal, of ascending ranges of rows, with a look at `cancel` between parts of the work.
    ///
    /// # Errors
    /// [`EstimateError::Cancelled`].
    pub fn inverse_blocks(
        &self,
        ranges: &[Range<usize>],
        cancel: &Cancel,
    ) -> Result<Vec<Mat<f64>>, EstimateError> {
        let mut blocks = Vec::with_capacity(ranges.len());
        let mut left = ranges;
        while let Some(first) = left.first() {
            cancel.check()?;
            let start = first.start;
            let together = left.iter().take_while(|range| range.end <= start + PANEL).count().max(1);
            let (now, later) = left.split_at(together);
            let (rows, columns) = (self.len() - start, now[together - 1].end - start);
            // Columns of L^-1, which are zero above the diagonal.
            let mut root = Mat::<f64>::identity(rows, columns);
            let below = self.lower.as_ref().submatrix(start, start, rows, rows);
            let par = if columns == 1 { Par::Seq } else { self.par };
            solve_lower_triangular_in_place(below, root.as_mut(), par);
            blocks.extend(now.iter().map(|range| {
                let own = root.as_ref().subcols(range.start - start, range.len());
                let mut block = Mat::zeros(range.len(), range.len());
                matmul(block.as_mut(), Accum::Replace, own.transpose(), own, 1.0, Par::Seq);
                block
            }));
            left = later;
        }
        Ok(blocks)
    }

    /// Overwrites the lower triangle of `out` (n, n) with that of A^-1.
    pub fn inverse_lower(&self, out: MatMut<f64>) {
        let mut memory =
            faer::dyn_stack::MemBuffer::new(inverse::inverse_scratch::<f64>(self.len(), self.par));
        let stack = faer::dyn_stack::MemStack::new(&mut memory);
        inverse::inverse(out, self.lower.as_ref(), self.par, stack);
    }
}

/// Overwrites the lower triangle of a matrix with its factor; None when it is not positive definite.
fn factor_in_place(mut matrix: MatMut<f64>, par: Par) -> Option<()> {
    let n = matrix.nrows();
    let scratch = factor::cholesky_in_place_scratch::<f64>(n, par, Default::default());
    let mut memory = faer::dyn_stack::MemBuffer::new(scratch);
    let stack = faer::dyn_stack::MemStack::new(&mut memory);
    factor::cholesky_in_place(matrix.rb_mut(), Default::default(), par, stack, Default::default()).ok()?;
    (0..n).all(|i| matrix[(i, i)].is_finite()).then_some(())
}

/// Factors Q R of a matrix (m, n) with orthonormal Q, found and used by one thread.
#[derive(Debug, Clone)]
pub struct Orthogonal {
    /// R on and above the diagonal, Householder's reflections that make Q below it, (m, n).
    reflections: Mat<f64>,
    /// Their coefficients, block by block.
    coefficients: Mat<f64>,
}

impl Orthogonal {
    /// Factors a matrix.
    pub fn new(mut matrix: Mat<f64>) -> Self {
        let (m, n) = matrix.shape();
        let block = recommended_block_size::<f64>(m, n);
        let mut coefficients = Mat::zeros(block, m.min(n));
        let scratch = qr_in_place_scratch::<f64>(m, n, block, Par::Seq, Default::default());
        let mut memory = faer::dyn_stack::MemBuffer::new(scratch);
        let stack = faer::dyn_stack::MemStack::new(&mut memory);
        qr_in_place(matrix.as_mut(), coefficients.as_mut(), Par::Seq, stack, Default::default());
        Self { reflections: matrix, coefficients }
    }

    /// R without rows of zeros, (min(m, n), n).
    pub fn upper(&self) -> Mat<f64> {
        let (m, n) = self.reflections.shape();
        Mat::from_fn(m.min(n), n, |i, j| if i <= j { self.reflections[(i, j)] } else { 0.0 })
    }

    /// The x (n,) that makes the matrix times x come nearest to `right` (m,), of no fewer rows than columns of full rank.
    pub fn least_squares(&self, right: &[f64]) -> Vec<f64> {
        let ((m, n), block) = (self.reflections.shape(), self.coefficients.nrows());
        let mut solution = column(right);
        let scratch = solve_lstsq_in_place_scratch::<f64>(m, n, block, 1, Par::Seq);
        let mut memory = faer::dyn_stack::MemBuffer::new(scratch);
        let stack = faer::dyn_stack::MemStack::new(&mut memory);
        let factors = self.reflections.as_ref();
        solve_lstsq_in_place(
            factors,
            self.coefficients.as_ref(),
            factors,
            solution.as_mut(),
            Par::Seq,
            stack,
        );
        (0..n).map(|i| solution[(i, 0)]).collect()
    }
}

/// Singular values, the largest first, by one thread; `None` where they cannot be found.
pub fn singular_values(matrix: MatRef<f64>) -> Option<Vec<f64>> {
    let (rows, columns) = (matrix.nrows(), matrix.ncols());
    let none = ComputeSvdVectors::No;
    let scratch = svd_scratch::<f64>(rows, columns, none, none, Par::Seq, Default::default());
    let mut memory = faer::dyn_stack::MemBuffer::new(scratch);
    let stack = faer::dyn_stack::MemStack::new(&mut memory);
    let mut values = Diag::zeros(rows.min(columns));
    svd(matrix, values.as_mut(), None, None, Par::Seq, stack, Default::default()).ok()?;
    Some((0..values.dim()).map(|k| values[k]).collect())
}

/// The inverse of a square matrix, infinite or not a number where it has none.
pub fn inverse_of_square(matrix: &Mat<f64>) -> Mat<f64> {
    matrix.partial_piv_lu().inverse()
}

/// Copies the lower triangle onto the upper one.
pub fn mirror_lower(matrix: &mut Mat<f64>) {
    for j in 0..matrix.ncols() {
        for i in 0..j {
            matrix[(i, j)] = matrix[(j, i)];
        }
    }
}

/// A column matrix (n, 1) of a slice (n,).
pub fn column(values: &[f64]) -> Mat<f64> {
    Mat::from_fn(values.len(), 1, |i, _| values[i])
}

/// The first column (n,) of a matrix.
pub fn to_vec(matrix: MatRef<f64>) -> Vec<f64> {
    let matrix = matrix.rb();
    (0..matrix.nrows()).map(|i| matrix[(i, 0)]).collect()
}

/// How many threads faer may use: those of rayon's current pool.
pub fn parallelism() -> Par {
    Par::rayon(rayon::current_num_threads())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn positive_definite(n: usize) -> Mat<f64> {
        let a = Mat::from_fn(n, n, |i, j| ((3 * i + 7 * j) as f64).sin());
        &a * a.transpose() + Mat::<f64>::identity(n, n)
    }

    #[test]
    fn inverse_times_matrix_is_identity() {
        let a = positive_definite(40);
        let inverse = Cholesky::new(a.clone(), Par::Seq).unwrap().inverse();
        let error = (&inverse * &a - Mat::<f64>::identity(40, 40)).norm_max();
        assert!(error < 1e-10, "{error}");
    }

    #[test]
    fn solution_satisfies_the_equations() {
        let a = positive_definite(30);
        let right: Vec<f64> = (0..30).map(|i| (i as f64).cos()).collect();
        let solution = Cholesky::new(a.clone(), Par::Seq).unwrap().solve_vector(&right);
        let error = (&a * column(&solution) - column(&right)).norm_max();
        assert!(error < 1e-10, "{error}");
    }

    #[test]
    fn least_squares_leave_a_rest_across_all_columns() {
        for (m, n) in [(7, 3), (300, 40), (30, 30)] {
            let a = Mat::from_fn(m, n, |i, j| {
                ((3 * i + 7 * j * j) as f64).sin() + if i == j { 3.0 } else { 0.0 }
            });
            let right: Vec<f64> = (0..m).map(|i| (i as f64).cos()).collect();
            let factors = Orthogonal::new(a.clone());
            let rest = &a * column(&factors.least_squares(&right)) - column(&right);
            assert!((a.transpose() * rest).norm_max() < 1e-10);
            let upper = factors.upper();
            assert_eq!(upper.shape(), (n, n));
            assert!((upper.transpose() * &upper - a.transpose() * &a).norm_max() < 1e-10);
        }
    }

    #[test]
    fn indefinite_matrices_are_refused() {
        let matrix = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 2.0 });
        assert!(Cholesky::new(matrix, Par::Seq).is_none());
    }
}
