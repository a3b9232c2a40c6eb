//! Representative CEPs of one region by least squares, with the set-up held (section 3.1 of the paper).

use faer::{Mat, MatRef, Par};
use truearm_estimate::dense::{Cholesky, to_vec, transposed_product};
use truearm_estimate::{Linearised, Point, PoseRows, Problem, Setup, column_unit, linearise};

use crate::FieldError;

/// What is held in every region.
#[derive(Clone, Copy)]
pub struct Held<'a> {
    /// Link parameters that CEPs are added to, (5 L,).
    pub parameters: &'a [f64],
    /// Frames and targets.
    pub setup: &'a Setup,
}

/// Gauss-Newton steps at most, and the step (m) below which no further one is made.
const STEPS: usize = 6;
const SMALLEST_STEP: f64 = 1e-13;

impl Held<'_> {
    /// Parameters with CEPs (P,) of the problem's columns added.
    pub fn with(&self, columns: &[usize], ceps: &[f64]) -> Vec<f64> {
        let mut parameters = self.parameters.to_vec();
        columns.iter().zip(ceps).for_each(|(&column, cep)| parameters[column] += cep);
        parameters
    }

    /// Rows at parameters with CEPs (P,) added.
    ///
    /// # Errors
    /// [`FieldError::Estimate`] where parameters or set-up are another problem's.
    pub fn rows(&self, problem: &Problem<'_>, ceps: &[f64]) -> Result<Linearised, FieldError> {
        let parameters = self.with(problem.columns, ceps);
        Ok(linearise(problem, Point { parameters: &parameters, setup: self.setup })?)
    }

    /// CEPs (P,) that leave the least squares, positions in metres and orientations at 0.3 m, by Gauss-Newton from
    /// `start`; `None` where there are fewer measured values than CEPs or they leave a CEP undetermined.
    ///
    /// The steps solve normal equations: their rounding slows convergence a little and does not move the minimum.
    ///
    /// # Errors
    /// As [`Held::rows`].
    pub fn least_squares(
        &self,
        problem: &Problem<'_>,
        start: &[f64],
    ) -> Result<Option<Vec<f64>>, FieldError> {
        let mut ceps = start.to_vec();
        if problem.measurements.measured_values() < ceps.len() {
            return Ok(None);
        }
        for _ in 0..STEPS {
            let (matrix, residual) = scaled(problem, &self.rows(problem, &ceps)?);
            let Some(step) = solve(matrix.as_ref(), residual.as_ref()) else { return Ok(None) };
            let mut largest = 0.0_f64;
            for (k, &column) in problem.columns.iter().enumerate() {
                ceps[k] += step[k] / column_unit(column);
                largest = largest.max(step[k].abs());
            }
            if !largest.is_finite() {
                return Ok(None);
            }
            if largest < SMALLEST_STEP {
                break;
            }
        }
        Ok(Some(ceps))
    }

    /// Lengths of the residuals at the first target, (n,), m; NaN where it was not measured.
    ///
    /// # Errors
    /// As [`Held::rows`].
    pub fn errors(&self, problem: &Problem<'_>, ceps: &[f64]) -> Result<Vec<f64>, FieldError> {
        let rows = self.rows(problem, ceps)?;
        let length = |(pose, residual): (usize, &[f64])| {
            let seen = problem.measurements.has_target(pose, 0);
            if seen { residual.iter().take(3).map(|r| r * r).sum::<f64>().sqrt() } else { f64::NAN }
        };
        Ok(rows.residual.chunks_exact(rows.rows.max(1)).enumerate().map(length).collect())
    }
}

/// Least-squares solution (P,) of matrix (r, P) x = right (r, 1); `None` where it is not determined.
pub fn solve(matrix: MatRef<f64>, right: MatRef<f64>) -> Option<Vec<f64>> {
    let factor = Cholesky::new(transposed_product(matrix, matrix), Par::Seq)?;
    Some(factor.solve_vector(&to_vec(transposed_product(matrix, right).as_ref())))
}

/// Weighted rows in metres: matrix (n m, P) and residual (n m, 1).
pub fn scaled(problem: &Problem<'_>, rows: &Linearised) -> (Mat<f64>, Mat<f64>) {
    let width = problem.columns.len();
    let kinds = PoseRows::new(rows.rows, problem.measurements.target_count);
    let weight = |row: usize| kinds.unit(row) * problem.measurements.weight[row / rows.rows].sqrt();
    let matrix = Mat::from_fn(rows.residual.len(), width, |row, k| {
        rows.arm[row * width + k] * weight(row) / column_unit(problem.columns[k])
    });
    (matrix, Mat::from_fn(rows.residual.len(), 1, |row, _| rows.residual[row] * weight(row)))
}
