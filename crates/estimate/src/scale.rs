//! One unit of each kind: a millimetre and 1/300 rad are alike.

use faer::Mat;
use truearm_kinematics::{ANGLE_ARM, is_length};

use crate::EstimateError;

/// Metres that a unit of a parameter counts, 5 * link + (theta, d, a, alpha, beta): lengths as they are, angles at
/// [`ANGLE_ARM`].
pub fn column_unit(column: usize) -> f64 {
    if is_length(column) { 1.0 } else { ANGLE_ARM }
}

/// Metres that a unit of a pose's row counts: three positions, then rotation vectors at [`ANGLE_ARM`].
pub fn row_unit(row: usize) -> f64 {
    if row < 3 { 1.0 } else { ANGLE_ARM }
}

/// A Jacobian (n, m, P) of parameters `columns` in units that are alike: m per m, so mm per mm, and angles at [`ANGLE_ARM`].
pub fn scaled_jacobian(jacobian: &[f64], rows_per_pose: usize, columns: &[usize]) -> Vec<f64> {
    let width = columns.len();
    let scale: Vec<f64> = columns.iter().map(|&column| column_unit(column).recip()).collect();
    let entry = |(at, value): (usize, &f64)| value * row_unit(at / width % rows_per_pose) * scale[at % width];
    jacobian.iter().enumerate().map(entry).collect()
}

/// The same as a matrix (n m, P).
///
/// # Errors
/// [`EstimateError::Length`] where the entries are none, or no whole poses.
pub fn scaled_matrix(
    jacobian: &[f64],
    rows_per_pose: usize,
    columns: &[usize],
) -> Result<Mat<f64>, EstimateError> {
    let (width, found) = (columns.len(), jacobian.len());
    let expected = (rows_per_pose * width).max(1);
    if found == 0 || !found.is_multiple_of(expected) {
        return Err(EstimateError::Length { what: "the Jacobian", found, expected });
    }
    let scaled = scaled_jacobian(jacobian, rows_per_pose, columns);
    Ok(Mat::from_fn(found / width, width, |i, j| scaled[i * width + j]))
}
