//! How a set-up moved while it was measured.
//!
//! Arms and instruments warm up, tripods settle. What is left when a model has said all it knows then depends on when
//! it was measured, whatever the pose. A drift is a displacement, the same for all poses, that varies with the progress
//! of the session: cells over one line, whose prior's amplitude and length the evidence chooses, and steps where a
//! tripod was bumped or something slipped, with the same amplitude, one at a time as long as the evidence asks for
//! them. The frame of the set-up takes its mean, so the likelihood is the restricted one (Patterson and Thompson 1971):
//! with features G of the rows less their mean, eigenvalues e of `G^T G`, z the products of its eigenvectors with
//! `G^T r`, and v the ratio of the drift's variance to that of the noise, `s^2 = (r^T r - sum v z^2 / (1 + v e)) / N`
//! and `log L = -1/2 (N log s^2 + 3 sum log(1 + v e))`.

use faer::Mat;
use truearm_bank::{Axis, CellKernel, Input, Shape};
use truearm_estimate::dense::{Eigen, transposed_product};

use crate::FieldError;
use crate::unknowns::{NEGLIGIBLE, Root};

/// How a set-up moved.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// Displacement at each progress that was asked for, (t, 3), m; its mean over the measured rows is zero.
    pub moved: Vec<f64>,
    /// Standard deviation of a coordinate that is left, at weight one, m.
    pub noise: f64,
    /// Logarithm of the evidence over that of no drift.
    pub gain: f64,
    /// Progress at which it moved at once, ascending (s,): in the middle between two measured rows.
    pub steps: Vec<f64>,
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
/// Gain in the logarithm of the evidence, the choice of its place paid for, from which there is a step: what warms up within
/// a tenth of a session gains up to 15.
const STEP_GAIN: f64 = 20.0;
/// Rows before and behind a step: fewer are outliers.
const BESIDE: usize = 5;

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

/// The drift that residuals show over the progress of their session, with so many steps at the most; told at `wanted`
/// (t,).
///
/// # Errors
/// [`FieldError::Length`], [`FieldError::NotFinite`], and [`FieldError::NotPositiveDefinite`] where the cells' prior fails.
pub fn find_drift(left: Left, wanted: &[f64], most_steps: usize) -> Result<Drift, FieldError> {
    left.check()?;
    if !wanted.iter().all(|value| value.is_finite()) {
        return Err(FieldError::NotFinite { what: "progress at which a drift is asked for" });
    }
    let rows = left.progress.len();
    let right = Mat::from_fn(rows, COORDINATES, |i, k| left.residual[COORDINATES * i + k]);
    let right = centred(right, left.weight).0;
    let order = ascending(left.progress);
    let places = (order.len().max(2 * BESIDE) - 2 * BESIDE + 1) as f64;
    let mut found = best_curve(&left, &right, &[])?;
    while found.0.steps.len() < most_steps {
        let Some(step) = found.0.next_step(&left, &right, &found.1, &order) else { break };
        let steps: Vec<f64> = found.0.steps.iter().copied().chain([step]).collect();
        let other = best_curve(&left, &right, &steps)?;
        if other.1.evidence - places.ln() <= found.1.evidence + STEP_GAIN {
            break;
        }
        found = other;
    }
    let (curve, choice) = found;
    let mut drift = curve.drift(&choice, wanted);
    drift.gain -= curve.steps.len() as f64 * places.ln();
    Ok(drift)
}

/// Indices of values in ascending order.
fn ascending(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    order
}

/// The curve, with steps at the given places, whose length and ratio have the largest evidence.
fn best_curve(left: &Left, right: &Mat<f64>, steps: &[f64]) -> Result<(Curve, Choice), FieldError> {
    let rows = left.progress.len();
    let mut best: Option<(Curve, Choice)> = None;
    for length in LENGTHS {
        let curve = Curve::new(left, right, length, steps).ok_or(FieldError::NotPositiveDefinite { rows })?;
        let choice = curve.choose();
        if best.as_ref().is_none_or(|(_, known)| choice.evidence > known.evidence) {
            best = Some((curve, choice));
        }
    }
    best.ok_or(FieldError::NotFinite { what: "progress and residuals of a drift" })
}

/// The residual over features of one length.
struct Curve {
    length: f64,
    cells: CellKernel,
    root: Root,
    steps: Vec<f64>,
    /// Mean of the rows' features, (f,).
    mean: Vec<f64>,
    /// Features of the rows less their mean, each row times the root of its weight, (n, f).
    features: Mat<f64>,
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
    fn new(left: &Left, right: &Mat<f64>, length: f64, steps: &[f64]) -> Option<Self> {
        let input = Input::line(1.0);
        let scaled = input.scale * length;
        let axis = Axis::covering(input, [0.0, 1.0].into_iter(), scaled, scaled / PER_LENGTH, DEGREE);
        let cells = CellKernel::new(axis, |distance| Shape::Matern.at(distance, scaled));
        let root = Root::new(&cells, NEGLIGIBLE)?;
        let features: Vec<Vec<f64>> =
            left.progress.iter().map(|&at| features(&root, &cells, steps, at)).collect();
        let (rows, width) = (features.len(), features[0].len());
        let (features, mean) = centred(Mat::from_fn(rows, width, |i, k| features[i][k]), left.weight);
        let gram = transposed_product(features.as_ref(), features.as_ref());
        let Eigen { values, vectors } = Eigen::new(&gram)?;
        let values = values.into_iter().map(|value| value.max(0.0)).collect();
        let products = transposed_product(features.as_ref(), right.as_ref());
        let projected = transposed_product(vectors.as_ref(), products.as_ref());
        let square = right.squared_norm_l2();
        let freedom = (COORDINATES * (rows - 1)) as f64;
        let steps = steps.to_vec();
        Some(Self { length, cells, root, steps, mean, features, vectors, values, projected, square, freedom })
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
            let features = features(&self.root, &self.cells, &self.steps, at);
            let of = |c: usize| -> f64 {
                let pairs = features.iter().zip(&self.mean).enumerate();
                pairs.map(|(k, (feature, mean))| (feature - mean) * weights[(k, c)]).sum()
            };
            moved.extend((0..COORDINATES).map(of));
        }
        let mut steps = self.steps.clone();
        steps.sort_by(f64::total_cmp);
        Drift { moved, noise: choice.noise, gain: choice.gain, steps }
    }

    /// Where one more step has the largest evidence, the ratio and the noise left as they are.
    ///
    /// With `C = I + v G G^T` a step h of the same variance adds `1/2 (z^2 v / (s^2 (1 + v q)) - log(1 + v q))`
    /// per coordinate, `q = h^T C^-1 h` and `z = h^T C^-1 r`; `G^T h`, `r^T h` and `h^T h` are sums over the rows behind it.
    fn next_step(&self, left: &Left, right: &Mat<f64>, choice: &Choice, order: &[usize]) -> Option<f64> {
        let total: f64 = left.weight.iter().sum();
        let (mut behind, mut sums, mut products) = (total, [0.0; COORDINATES], vec![0.0; self.values.len()]);
        let mut best: Option<(f64, f64)> = None;
        for (count, pair) in order.windows(2).enumerate() {
            let (row, next) = (pair[0], pair[1]);
            let root = left.weight[row].sqrt();
            behind -= left.weight[row];
            sums.iter_mut().enumerate().for_each(|(c, sum)| *sum -= root * right[(row, c)]);
            products.iter_mut().enumerate().for_each(|(k, sum)| *sum -= root * self.features[(row, k)]);
            let place = 0.5 * (left.progress[row] + left.progress[next]);
            let tied = left.progress[row] == left.progress[next];
            if tied || !self.has_room(left, order, (count + 1, place)) {
                continue;
            }
            let gain = self.gain_of_step(choice, behind * (total - behind) / total, (&sums, &products));
            if best.is_none_or(|(most, _)| gain > most) {
                best = Some((gain, place));
            }
        }
        best.map(|(_, place)| place)
    }

    /// Whether enough rows are before and behind a step, and between it and the others.
    fn has_room(&self, left: &Left, order: &[usize], (before, place): (usize, f64)) -> bool {
        let between = |other: f64| {
            let (low, high) = (other.min(place), other.max(place));
            left.progress.iter().filter(|at| (low..high).contains(*at)).count()
        };
        before >= BESIDE
            && order.len() - before >= BESIDE
            && self.steps.iter().all(|&other| between(other) >= BESIDE)
    }

    /// Gain in the logarithm of the evidence from a step of a square, with its products with residuals and features.
    fn gain_of_step(
        &self,
        choice: &Choice,
        square: f64,
        (sums, products): (&[f64; COORDINATES], &[f64]),
    ) -> f64 {
        let along: Vec<f64> = (0..self.values.len())
            .map(|k| products.iter().enumerate().map(|(j, value)| self.vectors[(j, k)] * value).sum())
            .collect();
        let shrink = |k: usize| choice.ratio / (1.0 + choice.ratio * self.values[k]);
        let inner = square - along.iter().enumerate().map(|(k, a)| shrink(k) * a * a).sum::<f64>();
        let known = 1.0 + choice.ratio * inner;
        let gain = |(c, sum): (usize, &f64)| {
            let explained: f64 =
                along.iter().enumerate().map(|(k, a)| shrink(k) * a * self.projected[(k, c)]).sum();
            let pull = (sum - explained) / choice.noise;
            0.5 * (choice.ratio * pull * pull / known - known.ln())
        };
        sums.iter().enumerate().map(gain).sum()
    }
}

/// Features of a progress: those of the cells, then of each step whether it is behind.
fn features(root: &Root, cells: &CellKernel, steps: &[f64], at: f64) -> Vec<f64> {
    let mut features = root.features(cells, at);
    features.extend(steps.iter().map(|&step| f64::from(u8::from(at > step))));
    features
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
#[path = "tests/drift.rs"]
mod tests;
