//! Which halving helps most, from what was measured in the whole.

use faer::Mat;
use truearm_estimate::MeasurementSet;

use crate::FieldError;
use crate::regions::divide::Arm;
use crate::regions::estimate::{scaled, solve};
use crate::regions::source::RegionRows;

/// Axes by how much smaller the squares become when CEPs may differ between the halves, the best first.
///
/// What differs has opposite signs in the halves, so each axis is allowed the same number of unknowns. `axes` breaks ties.
///
/// # Errors
/// [`FieldError::Estimate`] where rows are another set-up's.
pub fn best_first(
    arm: &Arm<'_>,
    rows: &RegionRows,
    ceps: &[f64],
    (low, high): (&[f64], &[f64]),
    axes: Vec<usize>,
) -> Result<Vec<usize>, FieldError> {
    let sets = [(&rows.identify, &rows.identify_features), (&rows.judge, &rows.judge_features)];
    let measured = sets.into_iter().filter(|set| set.0.pose_count() > 0);
    let parts: Vec<Part> = measured.map(|set| part(arm, set, ceps)).collect::<Result<_, _>>()?;
    let dimensions = low.len();
    let left = |axis: usize| {
        let middle = 0.5 * (low[axis] + high[axis]);
        squares_left(&parts, |feature| if feature[axis] < middle { -1.0 } else { 1.0 }, dimensions)
    };
    let mut judged: Vec<(f64, usize)> = axes.into_iter().map(|axis| (left(axis), axis)).collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(judged.into_iter().map(|(_, axis)| axis).collect())
}

struct Part {
    matrix: Mat<f64>,
    residual: Mat<f64>,
    features: Vec<f64>,
    rows_per_pose: usize,
}

fn part(
    arm: &Arm<'_>,
    (set, features): (&MeasurementSet, &Vec<f64>),
    ceps: &[f64],
) -> Result<Part, FieldError> {
    let problem = arm.problem(set);
    let rows = arm.held().rows(&problem, ceps)?;
    let (matrix, residual) = scaled(&problem, &rows);
    Ok(Part { matrix, residual, features: features.clone(), rows_per_pose: rows.rows })
}

fn squares_left(parts: &[Part], sign: impl Fn(&[f64]) -> f64, dimensions: usize) -> f64 {
    let lines: usize = parts.iter().map(|part| part.matrix.nrows()).sum();
    let width = parts[0].matrix.ncols();
    let (mut matrix, mut residual) = (Mat::zeros(lines, width), Mat::zeros(lines, 1));
    let mut line = 0;
    for part in parts {
        for row in 0..part.matrix.nrows() {
            let pose = row / part.rows_per_pose;
            let side = sign(&part.features[pose * dimensions..(pose + 1) * dimensions]);
            (0..width).for_each(|k| matrix[(line, k)] = side * part.matrix[(row, k)]);
            residual[(line, 0)] = part.residual[(row, 0)];
            line += 1;
        }
    }
    let Some(difference) = solve(matrix.as_ref(), residual.as_ref()) else { return f64::INFINITY };
    let left = |line: usize| {
        let explained: f64 = difference.iter().enumerate().map(|(k, x)| matrix[(line, k)] * x).sum();
        (residual[(line, 0)] - explained).powi(2)
    };
    (0..lines).map(left).sum()
}
