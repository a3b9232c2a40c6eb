//! Least squares whose unknowns are not negative: Lawson and Hanson, Solving Least Squares Problems (1974), ch. 23.

use faer::{Mat, MatRef};

use crate::EstimateError;
use crate::dense::Orthogonal;
use crate::identifiability::length;
use crate::measurements::finite;

/// A column of which no more than this share is beyond the columns in use is made up of them; one that is no longer than
/// this share of the longest is none.
const INDEPENDENT_SHARE: f64 = 1e-8;
/// An unknown may grow whose column has more than this share of the length of the target in common with what is left.
const GAIN_SHARE: f64 = 1e-10;
/// Steps for each unknown; some three are needed.
const STEPS_EACH: usize = 30;

/// The x (`count`,), none of it negative, that makes `columns` (m, `count`), row by row, times x come nearest to `target`
/// (m,).
///
/// Columns that those in use make up stay at zero: they come no nearer. So do columns a hundred million times shorter than the
/// longest one, which are taken for rounding.
///
/// # Errors
/// [`EstimateError::Length`] where the columns are not of as many rows as the target, [`EstimateError::NotFinite`].
pub fn non_negative_least_squares(
    columns: &[f64],
    count: usize,
    target: &[f64],
) -> Result<Vec<f64>, EstimateError> {
    let rows = target.len();
    if columns.len() != rows * count {
        let (found, expected) = (columns.len(), rows * count);
        return Err(EstimateError::Length { what: "the matrix of columns", found, expected });
    }
    finite("a column", columns, count)?;
    finite("the target", target, 1)?;
    let columns = MatRef::from_row_major_slice(columns, rows, count);
    let lengths: Vec<f64> = (0..count).map(|column| columns.col(column).norm_l2()).collect();
    let negligible = INDEPENDENT_SHARE * lengths.iter().copied().fold(0.0, f64::max);
    let unit = Mat::from_fn(rows, count, |row, column| columns[(row, column)] / lengths[column]);
    let usable = lengths.iter().map(|&length| length > negligible).collect();
    let found = Search { columns: unit.as_ref(), target, usable, used: Vec::new() }.run();
    Ok(found.iter().zip(&lengths).map(|(x, length)| if *x > 0.0 { x / length } else { 0.0 }).collect())
}

/// The search over which unknowns are above zero.
struct Search<'a> {
    /// Of length one, (m, n).
    columns: MatRef<'a, f64>,
    target: &'a [f64],
    /// Whether a column may be used (n,).
    usable: Vec<bool>,
    /// Unknowns above zero, in the order in which they came to be.
    used: Vec<usize>,
}

impl Search<'_> {
    fn run(mut self) -> Vec<f64> {
        let mut found = vec![0.0; self.columns.ncols()];
        let mut barred = vec![false; found.len()];
        let enough = GAIN_SHARE * length(self.target);
        for _ in 0..STEPS_EACH * found.len() {
            let Some(best) = self.most_gaining(&found, &barred, enough) else { break };
            self.used.push(best);
            let solution = self.solution().filter(|wanted| wanted.last().is_some_and(|newest| *newest > 0.0));
            let Some(mut wanted) = solution else {
                self.used.pop();
                barred[best] = true;
                continue;
            };
            barred.fill(false);
            while let Some((first, share)) = self.first_at_zero(&found, &wanted) {
                for (&unknown, to) in self.used.iter().zip(&wanted) {
                    found[unknown] += share * (to - found[unknown]);
                }
                found[first] = 0.0;
                self.used.retain(|&unknown| found[unknown] > 0.0);
                wanted = self.solution().unwrap_or_default();
            }
            found.fill(0.0);
            self.used.iter().zip(&wanted).for_each(|(&unknown, value)| found[unknown] = *value);
        }
        found
    }

    /// The unknown at zero, and not barred, whose column has most in common with what is left, if that is more than
    /// `enough`.
    fn most_gaining(&self, found: &[f64], barred: &[bool], enough: f64) -> Option<usize> {
        let left: Vec<f64> = (0..self.target.len())
            .map(|row| {
                self.target[row] - self.used.iter().map(|&k| self.columns[(row, k)] * found[k]).sum::<f64>()
            })
            .collect();
        (0..found.len())
            .filter(|k| self.usable[*k] && !barred[*k] && !self.used.contains(k))
            .map(|k| (k, (0..left.len()).map(|row| self.columns[(row, k)] * left[row]).sum::<f64>()))
            .filter(|(_, gain)| *gain > enough)
            .max_by(|one, other| one.1.total_cmp(&other.1))
            .map(|(k, _)| k)
    }

    /// What unknowns in use are where they may be negative; `None` where the last of them depends on the others.
    fn solution(&self) -> Option<Vec<f64>> {
        let (rows, last) = (self.columns.nrows(), self.used.len().checked_sub(1)?);
        if last >= rows {
            return None;
        }
        let factors =
            Orthogonal::new(Mat::from_fn(rows, last + 1, |row, k| self.columns[(row, self.used[k])]));
        (factors.upper()[(last, last)].abs() > INDEPENDENT_SHARE).then(|| factors.least_squares(self.target))
    }

    /// The unknown in use that is at zero first on the way to `wanted`, and at which share of it; `None` where all
    /// stay above.
    fn first_at_zero(&self, found: &[f64], wanted: &[f64]) -> Option<(usize, f64)> {
        self.used
            .iter()
            .zip(wanted)
            .filter(|(_, to)| **to <= 0.0)
            .map(|(&unknown, to)| (unknown, found[unknown] / (found[unknown] - to)))
            .min_by(|one, other| one.1.total_cmp(&other.1))
    }
}
