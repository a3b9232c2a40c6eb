//! One unit of each kind: a millimetre and 1/300 rad are alike.

use faer::Mat;
use truearm_kinematics::{ANGLE_ARM, is_length};

use crate::EstimateError;

/// Metres that a unit of a parameter counts, 5 * link + (theta, d, a, alpha, beta): lengths as they are, angles at
/// [`ANGLE_ARM`].
pub fn column_unit(column: usize) -> f64 {
    if is_length(column) { 1.0 } else { ANGLE_ARM }
}

/// What the rows of a pose are: three positions of each target, then a rotation vector where orientation is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PoseRows {
    /// Rows of a pose, m.
    pub count: usize,
    /// Those of positions, which stand first.
    pub positions: usize,
}

impl PoseRows {
    /// So many rows of a pose with so many targets.
    pub fn new(count: usize, targets: usize) -> Self {
        Self { count, positions: 3 * targets }
    }

    /// Metres that a unit of a row counts, of all poses' rows one behind the other: positions as they are, rotation
    /// vectors at [`ANGLE_ARM`].
    pub fn unit(self, row: usize) -> f64 {
        if row % self.count < self.positions { 1.0 } else { ANGLE_ARM }
    }
}

/// A Jacobian (n, m, P) of parameters `columns` in units that are alike: m per m, so mm per mm, and angles at [`ANGLE_ARM`].
pub fn scaled_jacobian(jacobian: &[f64], rows: PoseRows, columns: &[usize]) -> Vec<f64> {
    let width = columns.len();
    let scale: Vec<f64> = columns.iter().map(|&column| column_unit(column).recip()).collect();
    let entry = |(at, value): (usize, &f64)| value * rows.unit(at / width) * scale[at % width];
    jacobian.iter().enumerate().map(entry).collect()
}

/// The same as a matrix (n m, P).
///
/// # Errors
/// [`EstimateError::Length`] where the entries are none, or no whole poses.
pub fn scaled_matrix(jacobian: &[f64], rows: PoseRows, columns: &[usize]) -> Result<Mat<f64>, EstimateError> {
    let (width, found) = (columns.len(), jacobian.len());
    let expected = (rows.count * width).max(1);
    if found == 0 || !found.is_multiple_of(expected) {
        return Err(EstimateError::Length { what: "the Jacobian", found, expected });
    }
    let scaled = scaled_jacobian(jacobian, rows, columns);
    Ok(Mat::from_fn(found / width, width, |i, j| scaled[i * width + j]))
}
