//! One unit of each kind: a millimetre and 1/300 rad are alike.

/// Metres that a radian counts.
pub const ANGLE_ARM: f64 = 0.3;

/// Metres that a unit of a parameter counts, 5 * link + (theta, d, a, alpha, beta): lengths as they are, angles at
/// 0.3 m.
pub fn column_unit(column: usize) -> f64 {
    if matches!(column % 5, 1 | 2) { 1.0 } else { ANGLE_ARM }
}

/// Metres that a unit of a pose's row counts: three positions, then rotation vectors at 0.3 m.
pub fn row_unit(row: usize) -> f64 {
    if row < 3 { 1.0 } else { ANGLE_ARM }
}

/// A Jacobian (n, m, P) of parameters `columns` in units that are alike: m per m, so mm per mm, and angles at 0.3 m.
pub fn scaled_jacobian(jacobian: &[f64], rows_per_pose: usize, columns: &[usize]) -> Vec<f64> {
    let width = columns.len();
    let scale: Vec<f64> = columns.iter().map(|&column| column_unit(column).recip()).collect();
    let entry = |(at, value): (usize, &f64)| value * row_unit(at / width % rows_per_pose) * scale[at % width];
    jacobian.iter().enumerate().map(entry).collect()
}
