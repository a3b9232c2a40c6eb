//! How a set-up moved while it was measured.
//!
//! Arms and instruments warm up, tripods settle. What is left when a model has said all it knows then depends on when it was
//! measured, whatever the pose. A drift is a displacement, the same for all poses, that varies with the progress of
//! the session: cells over one line, whose prior's amplitude and length the evidence chooses. The frame of the set-up
//! takes its mean, so the likelihood is the restricted one (Patterson and Thompson 1971): with features G of the rows less
//! their mean, eigenvalues e of `G^T G`, z the products of its eigenvectors with `G^T r`, and v the ratio of the drift's
//! variance to that of the noise, `s^2 = (r^T r - sum v z^2 / (1 + v e)) / N` and `log L = -1/2 (N log s^2 + 3 sum log(1 + v e))`.

use faer::{Mat, Side};
use truearm_estimate::dense::transposed_product;

use crate::FieldError;
use crate::cells::{Axis, CellKernel};
use crate::kernel::{Input, Shape};
use crate::unknowns::Root;

/// How a set-up moved.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// Displacement at each progress that was asked for, (t, 3), m; its mean over the measured rows is zero.
    pub moved: Vec<f64>,
    /// Standard deviation of a coordinate that is left, at weight one, m.
    pub noise: f64,
    /// Length scale, in sessions.
    pub length: f64,
    /// Logarithm of the evidence over that of no drift.
    pub gain: f64,
}

/// Lengths that are tried, in sessions: a tenth is as fine as some ten poses could tell from noise.
const LENGTHS: [f64; 9] = [0.1, 0.14, 0.2, 0.28, 0.4, 0.56, 0.8, 1.13, 1.6];
/// Centre and spread of the prior of the length's logarithm.
const LENGTH: f64 = 0.4;
const LENGTH_SPREAD: f64 = 1.0;
/// Ratios of the drift's standard deviation to the noise's that are tried: so many, from the least on, each a factor larger.
const RATIOS: usize = 40;
const LEAST_RATIO: f64 = 0.01;
const FACTOR: f64 = 1.2;
/// Cells of a length scale, and degree of their memberships.
const PER_LENGTH: f64 = 3.0;
const DEGREE: usize = 3;
const COORDINATES: usize = 3;

/// What is left of the rows of a session.
#[derive(Debug, Clone, Copy)]
pub struct Left<'a> {
    /// When each row was measured, from zero to one, (n,).
    pub progress: &'a [f64],
    /// (n, 3), m.
    pub residual: &'a [f64],
    /// Weight of each row, (n,): its noise variance is divided by it.
    pub weight: &'a [f64],
}

impl Left<'_> {
    fn check(&self) -> Result<(), FieldError> {
        let rows = self.progress.len();
        for (what, found, expected) in [
            ("residuals of a drift", self.residual.len(), COORDINATES * rows),
            ("weights of a drift", self.weight.len(), rows),
        ] {
            if found != expected {
                return Err(FieldError::Length { what, found, expected });
            }
        }
        let finite = self.progress.iter().chain(self.residual).all(|value| value.is_finite());
        let positive = self.weight.iter().all(|weight| weight.is_finite() && *weight > 0.0);
        if rows < 2 || !finite || !positive {
            return Err(FieldError::NotFinite { what: "progress, residuals and weights of a drift" });
        }
        Ok(())
    }
}

/// The drift that residuals show over the progress of their session; told at `wanted` (t,).
///
/// # Errors
/// [`FieldError::Length`], [`FieldError::NotFinite`], and [`FieldError::NotPositiveDefinite`] where the cells' prior fails.
pub fn find_drift(left: Left, wanted: &[f64]) -> Result<Drift, FieldError> {
    left.check()?;
    if !wanted.iter().all(|value| value.is_finite()) {
        return Err(FieldError::NotFinite { what: "progress at which a drift is asked for" });
    }
    let rows = left.progress.len();
    let right = Mat::from_fn(rows, COORDINATES, |i, k| left.residual[COORDINATES * i + k]);
    let right = centred(right, left.weight).0;
    let mut best: Option<(Curve, Choice)> = None;
    for length in LENGTHS {
        let curve = Curve::new(&left, &right, length).ok_or(FieldError::NotPositiveDefinite { rows })?;
        let choice = curve.choose();
        if best.as_ref().is_none_or(|(_, known)| choice.evidence > known.evidence) {
            best = Some((curve, choice));
        }
    }
    let (curve, choice) = best.ok_or(FieldError::NotFinite { what: "progress and residuals of a drift" })?;
    Ok(curve.drift(&choice, wanted))
}

/// The residual over features of one length.
struct Curve {
    length: f64,
    cells: CellKernel,
    root: Root,
    /// Mean of the rows' features, (f,).
    mean: Vec<f64>,
    /// Eigenvectors (f, f) and eigenvalues (f,) of `G^T G`.
    vectors: Mat<f64>,
    values: Vec<f64>,
    /// (f, 3).
    projected: Mat<f64>,
    /// Sum of the squared residuals, and how many there are less their means.
    square: f64,
    freedom: f64,
}

/// A ratio of variances with what it explains.
struct Choice {
    evidence: f64,
    gain: f64,
    ratio: f64,
    noise: f64,
}

impl Curve {
    fn new(left: &Left, right: &Mat<f64>, length: f64) -> Option<Self> {
        let input = Input::line(1.0);
        let scaled = input.scale * length;
        let axis = Axis::covering(input, [0.0, 1.0].into_iter(), scaled, PER_LENGTH, DEGREE);
        let cells = CellKernel::new(axis, |distance| Shape::Matern.at(distance, scaled));
        let root = Root::new(&cells)?;
        let features: Vec<Vec<f64>> = left.progress.iter().map(|&at| root.features(&cells, at)).collect();
        let (rows, width) = (features.len(), features[0].len());
        let (features, mean) = centred(Mat::from_fn(rows, width, |i, k| features[i][k]), left.weight);
        let gram = transposed_product(features.as_ref(), features.as_ref());
        let eigen = gram.self_adjoint_eigen(Side::Lower).ok()?;
        let vectors = eigen.U().to_owned();
        let values = eigen.S().column_vector().iter().map(|value| value.max(0.0)).collect();
        let products = transposed_product(features.as_ref(), right.as_ref());
        let projected = transposed_product(vectors.as_ref(), products.as_ref());
        let square = right.squared_norm_l2();
        let freedom = (COORDINATES * (rows - 1)) as f64;
        Some(Self { length, cells, root, mean, vectors, values, projected, square, freedom })
    }

    /// Logarithm of the likelihood at a ratio of variances, and the noise's variance.
    fn likelihood(&self, ratio: f64) -> (f64, f64) {
        let (mut explained, mut determinant) = (0.0, 0.0);
        for (k, value) in self.values.iter().enumerate() {
            let square: f64 = (0..COORDINATES).map(|c| self.projected[(k, c)].powi(2)).sum();
            explained += ratio * square / (1.0 + ratio * value);
            determinant += COORDINATES as f64 * (ratio * value).ln_1p();
        }
        let variance = ((self.square - explained) / self.freedom).max(f64::MIN_POSITIVE);
        (-0.5 * (self.freedom * variance.ln() + determinant), variance)
    }

    /// The ratio of the largest evidence.
    fn choose(&self) -> Choice {
        let without = self.likelihood(0.0).0;
        let prior = -0.5 * ((self.length / LENGTH).ln() / LENGTH_SPREAD).powi(2);
        let ratios = (0..RATIOS).map(|k| (LEAST_RATIO * FACTOR.powi(k as i32)).powi(2));
        let scored = ratios.map(|ratio| {
            let (value, variance) = self.likelihood(ratio);
            Choice { evidence: value + prior, gain: value - without, ratio, noise: variance.sqrt() }
        });
        let none = Choice {
            evidence: f64::NEG_INFINITY,
            gain: 0.0,
            ratio: 0.0,
            noise: self.likelihood(0.0).1.sqrt(),
        };
        scored.fold(none, |best, other| if other.evidence > best.evidence { other } else { best })
    }

    fn drift(&self, choice: &Choice, wanted: &[f64]) -> Drift {
        let shrunk = Mat::from_fn(self.values.len(), COORDINATES, |k, c| {
            choice.ratio * self.projected[(k, c)] / (1.0 + choice.ratio * self.values[k])
        });
        let weights = &self.vectors * shrunk;
        let mut moved = Vec::with_capacity(COORDINATES * wanted.len());
        for &at in wanted {
            let features = self.root.features(&self.cells, at);
            let of = |c: usize| -> f64 {
                let pairs = features.iter().zip(&self.mean).enumerate();
                pairs.map(|(k, (feature, mean))| (feature - mean) * weights[(k, c)]).sum()
            };
            moved.extend((0..COORDINATES).map(of));
        }
        Drift { moved, noise: choice.noise, length: self.length, gain: choice.gain }
    }
}

/// Rows less their weighted mean, each times the root of its weight, and this mean.
fn centred(mut matrix: Mat<f64>, weight: &[f64]) -> (Mat<f64>, Vec<f64>) {
    let total: f64 = weight.iter().sum();
    let mean = |k: usize| weight.iter().enumerate().map(|(i, w)| w * matrix[(i, k)]).sum::<f64>() / total;
    let means: Vec<f64> = (0..matrix.ncols()).map(mean).collect();
    for (k, mean) in means.iter().enumerate() {
        for (i, w) in weight.iter().enumerate() {
            matrix[(i, k)] = (matrix[(i, k)] - mean) * w.sqrt();
        }
    }
    (matrix, means)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ROWS: usize = 200;

    fn found_in(residual: &[f64], weight: &[f64]) -> Drift {
        let progress = progress();
        find_drift(Left { progress: &progress, residual, weight }, &progress).unwrap()
    }

    fn progress() -> Vec<f64> {
        (0..ROWS).map(|k| k as f64 / (ROWS - 1) as f64).collect()
    }

    /// Numbers that look like noise of standard deviation one.
    fn noise(seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(2).wrapping_add(1);
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..COORDINATES * ROWS).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    /// A set-up that warms up: 0.1 mm, most of it in the first tenth, along one direction.
    fn warming(progress: f64) -> [f64; 3] {
        [0.06, 0.0, -0.08].map(|most| 1e-3 * most * (1.0 - (-progress / 0.1).exp()))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20))]

        #[test]
        fn a_drift_is_found_in_noise(seed in 0_u64..1000) {
            let progress = progress();
            let truth: Vec<f64> = progress.iter().flat_map(|&at| warming(at)).collect();
            let residual: Vec<f64> = truth.iter().zip(noise(seed)).map(|(a, b)| a + 2e-5 * b).collect();
            let found = found_in(&residual, &[1.0; ROWS]);
            let mean = |c: usize| truth.iter().skip(c).step_by(3).sum::<f64>() / ROWS as f64;
            let means = [mean(0), mean(1), mean(2)];
            let squares = truth.iter().zip(&found.moved).enumerate();
            let squares = squares.map(|(k, (true_, moved))| (true_ - means[k % 3] - moved).powi(2));
            let left = (squares.sum::<f64>() / (3 * ROWS) as f64).sqrt();
            prop_assert!(left < 0.6 * 2e-5, "{left}");
            prop_assert!((found.noise / 2e-5 - 1.0).abs() < 0.15, "{}", found.noise);
            prop_assert!(found.gain > 20.0, "{}", found.gain);
        }

        #[test]
        fn noise_alone_has_next_to_none(seed in 0_u64..1000) {
            let residual: Vec<f64> = noise(seed).iter().map(|value| 1e-4 * value).collect();
            let found = found_in(&residual, &[1.0; ROWS]);
            let moved = (found.moved.iter().map(|x| x * x).sum::<f64>() / (3 * ROWS) as f64).sqrt();
            prop_assert!(found.gain < 8.0 && moved < 0.3e-4, "{} {moved}", found.gain);
        }
    }

    /// A third of the rows with noise that is fifty times as large, and said to be.
    #[test]
    fn rows_that_are_known_to_be_noisy_hide_nothing() {
        let worse = |row: usize| if row.is_multiple_of(3) { 50.0 } else { 1.0 };
        let truth: Vec<f64> = progress().iter().flat_map(|&at| warming(at)).collect();
        let rows = truth.iter().zip(noise(3)).enumerate();
        let residual: Vec<f64> = rows.map(|(k, (a, b))| a + 2e-5 * worse(k / COORDINATES) * b).collect();
        let weight: Vec<f64> = (0..ROWS).map(|row| 1.0 / worse(row).powi(2)).collect();
        assert!(found_in(&residual, &weight).gain > 20.0);
        assert!(found_in(&residual, &[1.0; ROWS]).gain < 10.0);
    }

    /// The likelihood in closed form is that of the covariance matrix of the rows.
    #[test]
    fn the_evidence_is_that_of_the_rows_covariance() {
        let (progress, residual) = (progress(), noise(7));
        let weight: Vec<f64> = (0..ROWS).map(|row| 1.0 / (1 + row % 4) as f64).collect();
        let measured = Mat::from_fn(ROWS, COORDINATES, |i, k| residual[COORDINATES * i + k]);
        let (right, _) = centred(measured.clone(), &weight);
        let left = Left { progress: &progress, residual: &residual, weight: &weight };
        let curve = Curve::new(&left, &right, 0.2).unwrap();
        let (value, variance) = curve.likelihood(0.3);
        let features: Vec<Vec<f64>> =
            progress.iter().map(|&at| curve.root.features(&curve.cells, at)).collect();
        let dot =
            |i: usize, j: usize| -> f64 { features[i].iter().zip(&features[j]).map(|(a, b)| a * b).sum() };
        let own = |i: usize, j: usize| if i == j { 1.0 / weight[i] } else { 0.0 };
        let entry = |i: usize, j: usize| variance * (0.3 * dot(i, j) + own(i, j));
        let covariance = Mat::from_fn(ROWS, ROWS, entry);
        let factor = truearm_estimate::dense::Cholesky::new(covariance, faer::Par::Seq).unwrap();
        let ones = vec![1.0; ROWS];
        let spread = factor.solve_vector(&ones);
        let total: f64 = spread.iter().sum();
        let known = weight.iter().map(|w| w.ln()).sum::<f64>() - weight.iter().sum::<f64>().ln();
        let mut expected = 0.0;
        for c in 0..COORDINATES {
            let column: Vec<f64> = (0..ROWS).map(|i| measured[(i, c)]).collect();
            let solved = factor.solve_vector(&column);
            let mean = solved.iter().sum::<f64>() / total;
            let fit: f64 =
                column.iter().zip(&solved).zip(&spread).map(|((r, s), o)| r * (s - mean * o)).sum();
            expected -= 0.5 * (factor.log_determinant() + total.ln() + known + fit);
        }
        let shown = value - 0.5 * curve.freedom;
        assert!((shown / expected - 1.0).abs() < 1e-9, "{shown} {expected}");
    }

    #[test]
    fn rows_that_do_not_belong_together_are_refused() {
        let refused = |progress: &[f64], residual: &[f64], weight: &[f64]| {
            find_drift(Left { progress, residual, weight }, &[]).is_err()
        };
        assert!(!refused(&[0.0, 1.0], &[0.0; 6], &[1.0; 2]));
        assert!(refused(&[0.0, 1.0], &[0.0; 5], &[1.0; 2]));
        assert!(refused(&[0.0, 1.0], &[0.0; 6], &[1.0; 3]));
        assert!(refused(&[0.0, 1.0], &[0.0; 6], &[1.0, 0.0]));
        assert!(refused(&[0.0, f64::NAN], &[0.0; 6], &[1.0; 2]));
        assert!(refused(&[0.5], &[0.0; 3], &[1.0]));
    }
}
