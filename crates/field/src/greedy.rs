//! Choice of measurements one after the other, each the best given those before it, by exact Gaussian updates.
//!
//! Everything is one Gaussian vector: what each candidate would show, m entries each, then the targets. A measurement of
//! a candidate takes `S_i^T (S_ii + N_i)^-1 S_i` from its covariance S, a change of rank m.

use faer::{Mat, MatRef};
use rayon::prelude::*;
use truearm_estimate::dense::Cholesky;
use truearm_kinematics::Cancel;

use crate::FieldError;

/// Candidates, as far as they can be told apart.
pub struct Candidates<'a> {
    /// Noise covariances (c, m, m).
    pub noise: &'a [f64],
    /// Entries of each, m.
    pub rows: usize,
    /// Where each is, (c, 3).
    pub points: &'a [f64],
    /// Candidates closer than this to a chosen one are left out, as long as there are others.
    pub apart: f64,
}

/// Candidates in the order of their choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Greedy {
    /// Indices of candidates.
    pub chosen: Vec<usize>,
    /// The criterion before the first choice and after each.
    pub values: Vec<f64>,
}

impl Candidates<'_> {
    fn count(&self) -> usize {
        self.noise.len() / (self.rows * self.rows)
    }

    /// Whether each may be chosen after others.
    fn open(&self, chosen: &[usize]) -> Vec<bool> {
        let distance = |a: usize, b: usize| -> f64 {
            (0..3).map(|k| (self.points[3 * a + k] - self.points[3 * b + k]).powi(2)).sum::<f64>().sqrt()
        };
        let free: Vec<bool> = (0..self.count()).map(|k| !chosen.contains(&k)).collect();
        let apart: Vec<bool> =
            (0..self.count()).map(|k| chosen.iter().all(|&other| distance(k, other) >= self.apart)).collect();
        let open: Vec<bool> = free.iter().zip(&apart).map(|(a, b)| *a && *b).collect();
        if open.contains(&true) { open } else { free }
    }

    /// What is known of all entries, from a covariance (size, size), row-major.
    fn known(&self, covariance: &[f64], count: usize) -> Result<Known<'_>, FieldError> {
        if self.rows == 0 {
            let rule = "a candidate shows one at least: give noise (c, m, m) of measured values";
            return Err(FieldError::Option { what: "the number of entries m", value: 0, rule });
        }
        let (size, least) = (covariance.len().isqrt(), self.count() * self.rows);
        let length = |what, found, expected| Err(FieldError::Length { what, found, expected });
        if size < least || size * size != covariance.len() {
            return length("covariance", covariance.len(), size.max(least).pow(2));
        }
        if self.points.len() != 3 * self.count() {
            return length("points", self.points.len(), 3 * self.count());
        }
        if self.count() < count {
            return length("candidates", self.count(), count);
        }
        let covariance = MatRef::from_row_major_slice(covariance, size, size).to_owned();
        Ok(Known { covariance, candidates: self })
    }
}

/// What is known of all entries.
struct Known<'a> {
    covariance: Mat<f64>,
    candidates: &'a Candidates<'a>,
}

impl Known<'_> {
    /// Factor of the covariance of what a candidate would show, noise included.
    fn shown(&self, candidate: usize) -> Result<Cholesky, FieldError> {
        let m = self.candidates.rows;
        let noise = &self.candidates.noise[candidate * m * m..(candidate + 1) * m * m];
        let first = candidate * m;
        let block = Mat::from_fn(m, m, |i, j| self.covariance[(first + i, first + j)] + noise[i * m + j]);
        Cholesky::new(block, faer::Par::Seq).ok_or(FieldError::NotPositiveDefinite { rows: m })
    }

    /// L^-1 of `shown` times the candidate's covariances with the entries from `first` on, (m, size - first).
    fn learned(&self, candidate: usize, first: usize) -> Result<Mat<f64>, FieldError> {
        let m = self.candidates.rows;
        let width = self.covariance.ncols() - first;
        let mut cross = self.covariance.submatrix(candidate * m, first, m, width).to_owned();
        self.shown(candidate)?.solve_lower(cross.as_mut());
        Ok(cross)
    }

    /// Takes in a measurement of a candidate.
    fn measure(&mut self, candidate: usize) -> Result<(), FieldError> {
        let learned = self.learned(candidate, 0)?;
        let size = self.covariance.nrows();
        let columns = self.covariance.as_mut().par_col_chunks_mut(1).enumerate();
        columns.for_each(|(b, mut column)| {
            for a in 0..size {
                let taken: f64 = (0..learned.nrows()).map(|k| learned[(k, a)] * learned[(k, b)]).sum();
                column[(a, 0)] -= taken;
            }
        });
        Ok(())
    }
}

/// Chooses `count` candidates after which the sum of the targets' variances is smallest (A-optimal; active learning of
/// Cohn 1996). Values are that sum. The covariance (size, size) is row-major.
///
/// # Errors
/// [`FieldError::Length`] where arrays do not fit, [`FieldError::Option`] where candidates show nothing,
/// [`FieldError::NotPositiveDefinite`].
pub fn choose_informative(
    covariance: &[f64],
    candidates: &Candidates,
    count: usize,
    cancel: &Cancel,
) -> Result<Greedy, FieldError> {
    let mut known = candidates.known(covariance, count)?;
    let first = candidates.count() * candidates.rows;
    let left =
        |known: &Known| -> f64 { (first..known.covariance.nrows()).map(|k| known.covariance[(k, k)]).sum() };
    let mut found = Greedy { chosen: Vec::new(), values: vec![left(&known)] };
    for _ in 0..count {
        cancel.check()?;
        let gain = |candidate: usize| Ok(known.learned(candidate, first)?.squared_norm_l2());
        let best = best(&candidates.open(&found.chosen), gain)?;
        known.measure(best)?;
        found.chosen.push(best);
        found.values.push(left(&known));
    }
    Ok(found)
}

/// Chooses `count` candidates that together tell most about what may have changed (D-optimal): the mutual information
/// of their measurements and the changes, nat.
///
/// # Arguments
/// * `changed`: covariance (size, size), row-major, of what the candidates would show if the changes have happened.
/// * `unchanged`: the same without them.
///
/// # Errors
/// [`FieldError::Length`] where arrays do not fit, [`FieldError::Option`] where candidates show nothing,
/// [`FieldError::NotPositiveDefinite`].
pub fn choose_telling(
    changed: &[f64],
    unchanged: &[f64],
    candidates: &Candidates,
    count: usize,
    cancel: &Cancel,
) -> Result<Greedy, FieldError> {
    let mut with = candidates.known(changed, count)?;
    let mut without = candidates.known(unchanged, count)?;
    let mut found = Greedy { chosen: Vec::new(), values: vec![0.0] };
    let mut total = 0.0;
    for _ in 0..count {
        cancel.check()?;
        let gain = |candidate: usize| {
            let (a, b) = (with.shown(candidate)?, without.shown(candidate)?);
            Ok(0.5 * (a.log_determinant() - b.log_determinant()))
        };
        let best = best(&candidates.open(&found.chosen), gain)?;
        total += gain(best)?;
        with.measure(best)?;
        without.measure(best)?;
        found.chosen.push(best);
        found.values.push(total);
    }
    Ok(found)
}

/// The first open candidate with the largest gain.
fn best(open: &[bool], gain: impl Fn(usize) -> Result<f64, FieldError> + Sync) -> Result<usize, FieldError> {
    let gains: Vec<f64> = (0..open.len())
        .into_par_iter()
        .map(|k| if open[k] { gain(k) } else { Ok(f64::NEG_INFINITY) })
        .collect::<Result<_, _>>()?;
    Ok((0..gains.len()).fold(0, |best, k| if gains[k] > gains[best] { k } else { best }))
}
