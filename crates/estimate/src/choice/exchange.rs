//! The choice itself: from a start by determinant, then by the criterion, with the indices before and after.

use faer::Mat;

use crate::choice::determinant::Present;
use crate::choice::observability::{Criterion, Observability, observability};
use crate::choice::pool::Pool;
use crate::choice::spectral;
use crate::dense::transposed_product;
use crate::scale::{PoseRows, scaled_jacobian};
use truearm_kinematics::Cancel;

use crate::EstimateError;

/// What is chosen, and by what.
#[derive(Debug, Clone)]
pub struct ChoiceOptions<'a> {
    /// Poses to choose, n.
    pub count: usize,
    /// What is to be made best.
    pub criterion: Criterion,
    /// Parameters of the columns, (P,): 5 * link + (theta, d, a, alpha, beta).
    pub columns: &'a [usize],
    /// Jacobians of poses that are measured anyway, (k, m, P), m and rad.
    pub given: &'a [f64],
    /// Candidates to exchange from; without them the best are gathered one by one.
    pub start: Option<&'a [usize]>,
    /// Largest condition number kappa(M) that counts as well conditioned.
    pub limit: Option<f64>,
    /// Runs through the chosen poses at most.
    pub passes: usize,
    /// Looked at between exchanges.
    pub cancel: Cancel,
}

/// Chosen poses and what the choice gained.
#[derive(Debug, Clone)]
pub struct Choice {
    /// Indices of the chosen candidates, ascending.
    pub chosen: Vec<usize>,
    /// Indices of the start, or of candidates taken evenly from the pool; with what is given.
    pub before: Observability,
    /// Indices of the chosen poses, with what is given.
    pub after: Observability,
    /// Exchanges made.
    pub exchanges: usize,
    /// Whether the condition number is finite and within the limit.
    pub well_conditioned: bool,
}

/// Choose poses from candidates with Jacobians (N, m, P), m and rad, of `rows` rows each, 6 at most: a target's position
/// and, behind it, its orientation.
///
/// # Errors
/// [`EstimateError`] where lengths do not fit, a value is not finite, all are zero, or there are fewer candidates than poses.
pub fn choose_poses(
    jacobian: &[f64],
    rows: usize,
    options: &ChoiceOptions<'_>,
) -> Result<Choice, EstimateError> {
    check(jacobian, rows, options)?;
    let scaled = scaled_jacobian(jacobian, of_one_target(rows), options.columns);
    match rows {
        ..=3 => choose::<3>(&scaled, rows, options),
        _ => choose::<6>(&scaled, rows, options),
    }
}

fn of_one_target(rows: usize) -> PoseRows {
    PoseRows::new(rows, 1)
}

fn choose<const M: usize>(
    scaled: &[f64],
    rows: usize,
    options: &ChoiceOptions<'_>,
) -> Result<Choice, EstimateError> {
    let width = options.columns.len();
    let given = scaled_jacobian(options.given, of_one_target(rows), options.columns);
    let given_rows = Mat::from_fn(given.len() / width, width, |i, j| given[i * width + j]);
    let normal = transposed_product(given_rows.as_ref(), given_rows.as_ref());
    let mut pool = Pool::<M>::new(scaled, rows, width);
    let indices = |chosen: &[usize]| {
        let from = |line: usize| match line.checked_sub(given_rows.nrows()) {
            None => &given[line * width..],
            Some(line) => &scaled[(chosen[line / rows] * rows + line % rows) * width..],
        };
        let lines = given_rows.nrows() + chosen.len() * rows;
        let poses = given_rows.nrows() / rows + chosen.len();
        observability(&Mat::from_fn(lines, width, |i, j| from(i)[j]), poses)
    };
    let evenly: Vec<usize> = (0..options.count).map(|k| k * pool.count / options.count).collect();
    let before = indices(options.start.unwrap_or(&evenly))?;
    let mut present = Present::new(&mut pool, &normal, options.start.unwrap_or_default())?;
    present.fill(options.count, &options.cancel)?;
    let mut exchanges = present.settle(options.passes * options.count, &options.cancel)?;
    let mut chosen = present.chosen;
    if !options.criterion.is_determinant() {
        let by = (options.criterion, options.passes);
        exchanges += spectral::settle(&pool, &normal, &mut chosen, by, &options.cancel)?;
    }
    chosen.sort_unstable();
    let after = indices(&chosen)?;
    let well_conditioned = after.kappa.is_finite() && options.limit.is_none_or(|limit| after.kappa <= limit);
    Ok(Choice { chosen, before, after, exchanges, well_conditioned })
}

fn check(jacobian: &[f64], rows: usize, options: &ChoiceOptions<'_>) -> Result<(), EstimateError> {
    let refuse = |what, value: usize, rule| Err(EstimateError::Option { what, value: value as f64, rule });
    let width = options.columns.len();
    if width == 0 {
        return refuse("the number of parameters", width, "choose poses for one parameter or more");
    }
    if rows == 0 || rows > 6 {
        return refuse("the number of rows of a pose", rows, "it must be 3 (position) to 6 (pose)");
    }
    for (what, values) in [("the candidates' Jacobians", jacobian), ("the given Jacobians", options.given)] {
        let expected = values.len() / (rows * width) * rows * width;
        if values.len() != expected {
            return Err(EstimateError::Length { what, found: values.len(), expected });
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            return Err(EstimateError::NotFinite { what, pose: at / (rows * width) });
        }
    }
    let candidates = jacobian.len() / (rows * width);
    if options.count == 0 || options.count > candidates {
        let rule = "it must be 1 or more and no more than there are candidates: widen the region or make more candidates";
        return refuse("the number of poses to choose", options.count, rule);
    }
    let Some(start) = options.start else { return Ok(()) };
    let mut sorted = start.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    if sorted.len() != options.count || sorted.len() != start.len() {
        return refuse(
            "the number of different candidates to start from",
            sorted.len(),
            "it must be the number to choose",
        );
    }
    match sorted.last() {
        Some(&last) if last >= candidates => {
            refuse("a candidate to start from", last, "candidates count from 0 and end below their number")
        }
        _ => Ok(()),
    }
}
