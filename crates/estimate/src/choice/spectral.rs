//! Exchange for criteria of the singular values: each chosen pose in turn gives way to a candidate that is better.
//!
//! Candidates are ranked by what the criterion gains to first order in the eigenvalues of the matrix without the pose;
//! the first of them are tried. A candidate that cannot raise the least eigenvalue enough is dropped by the inertia of
//! an m x m matrix (m rows a pose) in place of new eigenvalues.

use faer::Mat;

use crate::choice::observability::Criterion;
use crate::choice::pool::Pool;
use crate::dense::{Eigen, add_product, eigenvalues};
use truearm_kinematics::Cancel;

use crate::EstimateError;

/// Candidates that are tried for each pose that may leave.
const TRIED: usize = 32;
/// A better value is better by more than this share: less is rounding.
const BETTER: f64 = 1e-9;
/// Eigenvalues below this share of the largest one count as this share.
const LEAST_SHARE: f64 = 1e-14;

/// Eigenvalues, ascending, and eigenvectors of a symmetric matrix.
struct Spectrum {
    values: Vec<f64>,
    vectors: Mat<f64>,
}

impl Spectrum {
    fn new(matrix: &Mat<f64>) -> Result<Self, EstimateError> {
        let Eigen { values, vectors } = Eigen::new(matrix).ok_or(EstimateError::Untelling)?;
        Ok(Self { values, vectors })
    }

    /// Directions with the criterion's derivative with respect to their eigenvalues.
    fn directions(&self, criterion: Criterion) -> Vec<(f64, Vec<f64>)> {
        let last = self.values.len() - 1;
        let largest = self.values[last];
        let value = |k: usize| self.values[k].max(LEAST_SHARE * largest);
        let weight = |k: usize| match criterion {
            Criterion::O5 => value(k).powf(-1.5),
            Criterion::O3 if k == 0 => value(0).recip(),
            Criterion::O4 if k == last => -0.5 / largest,
            Criterion::Condition | Criterion::O2 if k == last => -largest.recip(),
            Criterion::Condition | Criterion::O2 | Criterion::O4 if k == 0 => value(0).recip(),
            _ => 0.0,
        };
        let vector = |k: usize| (0..=last).map(|i| self.vectors[(i, k)]).collect();
        (0..=last).map(|k| (weight(k), k)).filter(|(w, _)| *w != 0.0).map(|(w, k)| (w, vector(k))).collect()
    }

    /// Whether a pose's rows (m, P) can make the criterion better than `best`.
    ///
    /// The largest eigenvalue becomes no smaller than the Rayleigh quotient of the present one's vector; whether any stays
    /// below the least one needed then is told by inertia, which is additive over a Schur complement (Haynsworth 1968).
    fn can_reach(&self, jacobian: &Mat<f64>, criterion: Criterion, best: f64) -> bool {
        let (rows, last) = (jacobian.nrows(), self.values.len() - 1);
        let turned = jacobian * &self.vectors;
        let largest = self.values[last] + (0..rows).map(|i| turned[(i, last)].powi(2)).sum::<f64>();
        let Some(bound) = criterion.least_for(best, largest) else { return true };
        let below = self.values.iter().take_while(|&&value| value < bound).count();
        if below == 0 {
            return true;
        }
        if below > rows {
            return false;
        }
        let inverse: Vec<f64> = self.values.iter().map(|value| (value - bound).recip()).collect();
        let entry = |i: usize, j: usize| {
            let sum: f64 = inverse.iter().enumerate().map(|(k, x)| turned[(i, k)] * x * turned[(j, k)]).sum();
            sum + f64::from(u8::from(i == j))
        };
        negative_pivots(Mat::from_fn(rows, rows, entry)) >= below
    }
}

/// Negative eigenvalues of a symmetric matrix by the signs of its pivots (Sylvester).
fn negative_pivots(mut a: Mat<f64>) -> usize {
    let n = a.nrows();
    for k in 0..n {
        for i in k + 1..n {
            let factor = a[(i, k)] / a[(k, k)];
            for j in k + 1..=i {
                let change = factor * a[(j, k)];
                a[(i, j)] -= change;
            }
        }
    }
    (0..n).filter(|&k| a[(k, k)] < 0.0).count()
}

/// Exchanges until a pass through the chosen poses changes nothing, or `passes` times; gives how many were made.
///
/// # Errors
/// [`EstimateError::Untelling`], [`EstimateError::Cancelled`].
pub fn settle<const M: usize>(
    pool: &Pool<M>,
    given: &Mat<f64>,
    chosen: &mut [usize],
    (criterion, passes): (Criterion, usize),
    cancel: &Cancel,
) -> Result<usize, EstimateError> {
    let mut is_chosen = vec![false; pool.count];
    chosen.iter().for_each(|&pose| is_chosen[pose] = true);
    let mut normal = given.clone();
    chosen.iter().for_each(|&pose| add(&mut normal, &pool.jacobian(pose), 1.0));
    let mut best = criterion.value(&eigenvalues(&normal).ok_or(EstimateError::Untelling)?);
    let mut exchanges = 0;
    for _ in 0..passes {
        let before = exchanges;
        for place in 0..chosen.len() {
            cancel.check()?;
            let leaving = chosen[place];
            add(&mut normal, &pool.jacobian(leaving), -1.0);
            let found = better::<M>(pool, &normal, &is_chosen, criterion, best)?;
            if let Some((pose, value)) = found {
                (is_chosen[leaving], is_chosen[pose]) = (false, true);
                (chosen[place], best) = (pose, value);
                exchanges += 1;
            }
            add(&mut normal, &pool.jacobian(chosen[place]), 1.0);
        }
        if exchanges == before {
            break;
        }
    }
    Ok(exchanges)
}

/// The best candidate that makes the criterion better than `best`, with its value.
fn better<const M: usize>(
    pool: &Pool<M>,
    without: &Mat<f64>,
    is_chosen: &[bool],
    criterion: Criterion,
    best: f64,
) -> Result<Option<(usize, f64)>, EstimateError> {
    let spectrum = Spectrum::new(without)?;
    let scores = pool.score(&spectrum.directions(criterion));
    let mut order: Vec<usize> = (0..pool.count).filter(|&pose| !is_chosen[pose]).collect();
    let by_score = |a: &usize, b: &usize| scores[*b].total_cmp(&scores[*a]).then(a.cmp(b));
    if order.len() > TRIED {
        order.select_nth_unstable_by(TRIED - 1, by_score);
        order.truncate(TRIED);
    }
    order.sort_unstable_by(by_score);
    let (mut found, mut best) = (None, best * (1.0 + BETTER));
    for pose in order {
        let jacobian = pool.jacobian(pose);
        if !spectrum.can_reach(&jacobian, criterion, best) {
            continue;
        }
        let mut with = without.clone();
        add(&mut with, &jacobian, 1.0);
        let value = criterion.value(&eigenvalues(&with).ok_or(EstimateError::Untelling)?);
        if value > best {
            (found, best) = (Some((pose, value)), value);
        }
    }
    Ok(found)
}

fn add(normal: &mut Mat<f64>, jacobian: &Mat<f64>, sign: f64) {
    add_product(normal.as_mut(), jacobian.transpose(), jacobian.as_ref(), sign);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::stream::Stream;
    use proptest::prelude::*;

    fn random(rows: usize, columns: usize, stream: &mut Stream) -> Mat<f64> {
        Mat::from_fn(rows, columns, |_, _| stream.normal())
    }

    proptest! {
        #[test]
        fn candidates_are_dropped_only_where_they_are_worse(seed in 0u64..500, share in 0.2..3.0f64) {
            let mut stream = Stream::new(seed);
            let (rows, pose) = (random(9, 6, &mut stream), random(3, 6, &mut stream));
            let without = rows.transpose() * &rows;
            let with = &without + pose.transpose() * &pose;
            let spectrum = Spectrum::new(&without).unwrap();
            for criterion in [Criterion::Condition, Criterion::O3, Criterion::O4] {
                let value = criterion.value(&eigenvalues(&with).unwrap());
                let reached = spectrum.can_reach(&pose, criterion, share * value);
                prop_assert!(reached || share > 1.0 - 1e-9);
                if criterion == Criterion::O3 {
                    prop_assert_eq!(reached, share < 1.0);
                }
            }
        }
    }
}
