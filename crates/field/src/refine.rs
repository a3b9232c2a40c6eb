//! From the linear solution to the exact model's.

use truearm_bank::Bank;
use truearm_estimate::{Layout, Point, Problem, Setup, residuals, turn_to_device};

use crate::FieldError;
use crate::posterior::{Posterior, Solution};
use crate::training::{Shot, Training};

/// Gauss-Newton steps on the exact model after the linear solution.
const RELINEARISATIONS: usize = 2;

/// Constants, field and set-up with the exact residuals that they leave.
pub struct Refined {
    pub parameters: Vec<f64>,
    pub bank: Bank,
    pub setup: Setup,
    /// (n, m), base frame.
    pub residuals: Vec<f64>,
}

/// Gauss-Newton on the exact model with the factor of the linear one: the remainder is of second order in the CEPs.
/// `values` (n, I) are the inputs of all measured poses.
///
/// # Errors
/// [`FieldError`] of the posterior, the bank and the residuals.
pub fn relinearised(
    problem: &Problem,
    point: Point,
    posterior: &Posterior,
    values: &[f64],
    mut solution: Solution,
) -> Result<Refined, FieldError> {
    let mut refined = apply(problem, point, posterior, values, &solution)?;
    for _ in 0..RELINEARISATIONS {
        let explained = explained(posterior.training(), &solution)?;
        let mut residuals = refined.residuals.clone();
        turn_to_device(problem.measurements, point.setup, &mut residuals, 1);
        let left =
            |shots: &Vec<Shot>| shots.iter().map(|shot| shot.share * residuals[shot.place]).sum::<f64>();
        let source = posterior.training().source.iter();
        let linear: Vec<f64> = source.zip(&explained).map(|(shots, part)| left(shots) + part).collect();
        solution = posterior.solve(&linear)?;
        refined = apply(problem, point, posterior, values, &solution)?;
    }
    Ok(refined)
}

/// What constants, field and set-up of a solution explain of a training set's residual, (R,).
///
/// # Errors
/// [`FieldError`] of the bank.
pub fn explained(training: &Training, solution: &Solution) -> Result<Vec<f64>, FieldError> {
    let mut ceps = vec![0.0; training.pose_count() * training.parameter_count];
    solution.bank.add(&training.without_readings(), &mut ceps)?;
    let mut out = Vec::with_capacity(training.row_count());
    for pose in 0..training.pose_count() {
        let ceps = &ceps[pose * training.parameter_count..(pose + 1) * training.parameter_count];
        for row in training.rows(pose) {
            let arm: f64 = training
                .jacobian_row(row)
                .iter()
                .zip(training.columns.iter().zip(&solution.constant))
                .take(training.column_count())
                .map(|(entry, (column, constant))| entry * (constant + ceps[column.parameter]))
                .sum();
            let setup = &training.setup[row * training.setup_width..(row + 1) * training.setup_width];
            out.push(arm + setup.iter().zip(&solution.setup).map(|(a, b)| a * b).sum::<f64>());
        }
    }
    Ok(out)
}

/// Constants, field and set-up of a solution, with the exact residuals they leave.
fn apply(
    problem: &Problem,
    point: Point,
    posterior: &Posterior,
    values: &[f64],
    solution: &Solution,
) -> Result<Refined, FieldError> {
    let training = posterior.training();
    let mut parameters = problem.chain.nominal();
    for (column, constant) in training.columns.iter().zip(&solution.constant) {
        parameters[column.parameter] += constant;
    }
    let layout = Layout::new(problem);
    let mut step = vec![0.0; layout.arm];
    step.extend(&solution.setup);
    let setup = layout.step_setup(point.setup, &step);
    let poses = problem.measurements.pose_count();
    let mut varying: Vec<f64> = std::iter::repeat_n(&parameters, poses).flatten().copied().collect();
    solution.bank.add(values, &mut varying)?;
    let residuals = residuals(problem, Point { parameters: &varying, setup: &setup })?;
    Ok(Refined { parameters, bank: solution.bank.clone(), setup, residuals })
}
