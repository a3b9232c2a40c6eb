//! What a measurement that took no part should show: predicted covariance of its residual.

use truearm_estimate::{Layout, Point, Problem, linearise, own_covariance};

use crate::FieldError;
use crate::posterior::Posterior;

/// Covariance (n, m, m) of the residuals of new measurements in the groups of the posterior's training set, base frame:
/// arm, set-up, what joints do not repeat, instrument noise and the rows' own sigma.
///
/// `problem` has the training's columns and groups, `point` the calibrated parameters of each pose and the fitted
/// set-up, `inputs` (n, I) joints and features. Rows that were not measured have their noise alone.
///
/// # Errors
/// [`FieldError::Estimate`] where the point is another problem's, [`FieldError::Length`] where inputs or groups do not
/// fit.
pub fn measurement_covariance(
    posterior: &Posterior,
    problem: &Problem,
    point: Point,
    inputs: &[f64],
) -> Result<Vec<f64>, FieldError> {
    let set = problem.measurements;
    let layout = Layout::new(problem);
    let linear = linearise(problem, point)?;
    let (rows, width) = (linear.rows, posterior.training().setup_width);
    let mut setup = vec![0.0; set.pose_count() * rows * width];
    for pose in 0..set.pose_count() {
        let place = layout.group(set.group[pose]);
        let start = place.start - layout.arm;
        if start + place.len() > width {
            return Err(FieldError::Length {
                what: "set-up columns",
                found: start + place.len(),
                expected: width,
            });
        }
        for row in pose * rows..(pose + 1) * rows {
            let source = &linear.setup[row * place.len()..(row + 1) * place.len()];
            setup[row * width + start..row * width + start + place.len()].copy_from_slice(source);
        }
    }
    let mut covariance = posterior.covariance(inputs, &linear.arm, Some(&setup), rows)?;
    let anew = posterior.repeatability(&linear.arm, rows)?;
    covariance.iter_mut().zip(&anew).for_each(|(sum, term)| *sum += term);
    let noise = posterior.model().hyper.noise;
    for pose in 0..set.pose_count() {
        let own = own_covariance(set, point.setup, pose);
        for row in 0..rows {
            let place = (pose * rows + row) * rows;
            if row / 3 >= set.target_count {
                covariance[place + row] += noise[1].powi(2) + set.sigma[pose].orientation.powi(2);
                continue;
            }
            covariance[place + row] += noise[0].powi(2);
            let first = row - row % 3;
            (0..3).for_each(|k| covariance[place + first + k] += own[row % 3][k]);
        }
    }
    Ok(covariance)
}
