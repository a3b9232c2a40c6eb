//! Constant CEPs: one correction of each identified parameter for the whole arm.
//!
//! Minimises `sum w |residual|^2 / (noise^2 + sigma^2) + sum (CEP / prior)^2`. Noise, prior scale and robust
//! weights depend on the residuals and are renewed between minimisations until they rest: noise from the
//! residual squares and the degrees of freedom that the prior leaves, the prior's scale by the evidence
//! (MacKay 1992: sum of squares over the well-determined number of parameters).

use faer::{Mat, Par};

use truearm_kinematics::{Cancel, is_length};

use crate::alike::leave_targets_open;
use crate::dense::Cholesky;
use crate::device_axes::turn_to_device;
use crate::distance::Distance;
use crate::layout::{Layout, Problem, TARGET_PRECISION};
use crate::measurements::{Noise, Sigma};
use crate::minimise::{Minimum, Objective, Reason, State};
use crate::noise::Squares;
use crate::packets::Packets;
use crate::robust::Robust;
use crate::rows::{Point, residuals_of};
use crate::setup::Setup;
use crate::start::initial_setup;

use crate::EstimateError;

/// Gaussian prior of the corrections, zero mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Standard deviation of lengths, m.
    pub length: f64,
    /// Standard deviation of angles, rad.
    pub angle: f64,
    /// Whether the evidence scales both.
    pub scaled: bool,
}

impl Default for Prior {
    fn default() -> Self {
        Self { length: 2e-3, angle: 2e-3, scaled: true }
    }
}

impl Prior {
    /// Standard deviation of the parameter with index 5 * link + (theta, d, a, alpha, beta).
    pub fn of(&self, column: usize) -> f64 {
        if is_length(column) { self.length } else { self.angle }
    }
}

/// How constants are fitted.
#[derive(Debug, Clone, Default)]
pub struct ConstantOptions {
    /// Prior of the corrections; none leaves them to the data alone.
    pub prior: Option<Prior>,
    /// Known noise; estimated from the residuals where there is none.
    pub noise: Option<Noise>,
    /// Loss of a pose's residuals, or of a distance's; `None` is least squares.
    pub robust: Option<Robust>,
    /// A set-up to start from, instead of the closed form.
    pub start: Option<Setup>,
    /// Link parameters to start from instead of the nominal ones, (5 L,); or one set a pose, (n, 5 L), where only the
    /// set-up is unknown.
    pub parameters: Option<Vec<f64>>,
    /// Looked at between iterations.
    pub cancel: Cancel,
}

/// Constant CEPs with what is needed to judge them.
#[derive(Debug, Clone)]
pub struct ConstantFit {
    /// Absolute link parameters (5 L,).
    pub parameters: Vec<f64>,
    /// Frames, targets and anchors.
    pub setup: Setup,
    /// Covariance of all unknowns in the layout's order, (u, u), SI.
    pub covariance: Mat<f64>,
    /// Noise beside the rows' own sigma.
    pub noise: Noise,
    /// Factor on the prior's standard deviations that the evidence chose.
    pub prior_scale: f64,
    /// Unweighted residuals (n, m) in the base frame.
    pub residuals: Vec<f64>,
    /// Robust weights (n,), one where least squares was asked for.
    pub weights: Vec<f64>,
    /// Steps of the last minimisation.
    pub iterations: usize,
    /// Why it ended.
    pub reason: Reason,
}

/// Rounds of noise, prior scale and weights at the most, and the relative change at which they rest.
const ROUNDS: usize = 30;
const REST: f64 = 1e-3;
/// The evidence may shrink the prior to a tenth and widen it five times: beyond, weak priors bend the tool.
const SCALE_RANGE: (f64, f64) = (0.1, 5.0);

/// Fits the columns' constants and the set-up.
///
/// # Errors
/// [`EstimateError`] where lengths or values are wrong, measurements are too few, the poses too alike to determine
/// the set-up, or on request.
pub fn fit_constant(problem: &Problem, options: &ConstantOptions) -> Result<ConstantFit, EstimateError> {
    problem.check(options.prior.is_some())?;
    check_noise(problem, options.noise)?;
    let nominal = problem.chain.nominal();
    let parameters = options.parameters.clone().unwrap_or_else(|| nominal.clone());
    let sets = parameters.len() / nominal.len();
    let poses = problem.measurements.pose_count();
    if parameters.len() != nominal.len() && !(sets == poses && problem.columns.is_empty()) {
        let (found, expected) = (parameters.len(), nominal.len());
        return Err(EstimateError::Parameters { found, expected });
    }
    let setup = match &options.start {
        Some(setup) => setup.clone(),
        None => initial_setup(problem, &parameters)?,
    };
    setup.check_steps(&Layout::new(problem))?;
    let fit = Fit { problem, options, packets: &Packets::new(problem.measurements), nominal: &nominal };
    fit.run(State { parameters, setup })
}

/// Known noise is positive; that of orientations counts where there are some.
fn check_noise(problem: &Problem, noise: Option<Noise>) -> Result<(), EstimateError> {
    let Some(noise) = noise else { return Ok(()) };
    let turned =
        problem.measurements.has_rotations().then_some(("the noise of orientations", noise.orientation));
    for (what, value) in [("the noise of positions", noise.position)].into_iter().chain(turned) {
        if !(value > 0.0 && value.is_finite()) {
            let rule = "a known noise is positive: give it in m and rad, or none to estimate it";
            return Err(EstimateError::Option { what, value, rule });
        }
    }
    Ok(())
}

struct Fit<'a> {
    problem: &'a Problem<'a>,
    options: &'a ConstantOptions,
    packets: &'a Packets,
    nominal: &'a [f64],
}

/// What is renewed between minimisations.
#[derive(Clone)]
struct Balance {
    noise: Noise,
    scale: f64,
    weights: Vec<f64>,
    /// Prior precision of the targets' coordinates, 1/m^2; zero where they have none.
    targets: f64,
}

impl Fit<'_> {
    fn precision(&self, scale: f64) -> Vec<f64> {
        let of =
            |&column: &usize| self.options.prior.map_or(0.0, |prior| (scale * prior.of(column)).powi(-2));
        self.problem.columns.iter().map(of).collect()
    }

    fn minimise(&self, start: State, balance: &Balance) -> Result<Minimum, EstimateError> {
        let objective = Objective {
            problem: self.problem,
            packets: self.packets,
            weighting: Some((balance.noise, &balance.weights)),
            precision: &self.precision(balance.scale),
            target_precision: balance.targets,
            nominal: self.nominal,
            cancel: &self.options.cancel,
        };
        objective.minimise(start)
    }

    fn run(&self, start: State) -> Result<ConstantFit, EstimateError> {
        let set = self.problem.measurements;
        let noise = self.options.noise.unwrap_or(Noise::GUESS);
        let targets = self.options.prior.map_or(0.0, |_| TARGET_PRECISION);
        let mut balance = Balance { noise, scale: 1.0, weights: set.weight.clone(), targets };
        let mut minimum = self.minimise(start, &balance)?;
        if leave_targets_open(self.problem, &minimum.state.setup)? && targets == 0.0 {
            balance.targets = TARGET_PRECISION;
            minimum = self.minimise(minimum.state, &balance)?;
        }
        let mut covariance = self.covariance(&minimum, &balance)?;
        let mut residuals = self.residuals(&minimum.state)?;
        for _ in 0..ROUNDS {
            let renewed = self.renewed(&balance, &minimum, &covariance, &residuals);
            if self.settled(&balance, &renewed) {
                let ratio = if self.only_scales_the_cost(&balance) {
                    renewed.noise.position / balance.noise.position
                } else {
                    1.0
                };
                covariance *= faer::Scale(ratio * ratio);
                balance = renewed;
                break;
            }
            balance = renewed;
            minimum = self.minimise(minimum.state, &balance)?;
            covariance = self.covariance(&minimum, &balance)?;
            residuals = self.residuals(&minimum.state)?;
        }
        let Minimum { state, iterations, reason, .. } = minimum;
        Ok(ConstantFit {
            parameters: state.parameters,
            setup: state.setup,
            covariance,
            noise: balance.noise,
            prior_scale: balance.scale,
            residuals,
            weights: balance.weights,
            iterations,
            reason,
        })
    }

    fn residuals(&self, state: &State) -> Result<Vec<f64>, EstimateError> {
        let point = Point { parameters: &state.parameters, setup: &state.setup };
        residuals_of(self.problem, self.packets, point)
    }

    /// Inverse of the normal equations with the prior, rescaled to the balance's noise. The set-up has its own, or is known as
    /// well as rounding allows where the data is exact.
    fn covariance(&self, minimum: &Minimum, balance: &Balance) -> Result<Mat<f64>, EstimateError> {
        let mut matrix = minimum.normal.matrix.clone();
        for (k, precision) in self.precision(balance.scale).into_iter().enumerate() {
            matrix[(k, k)] += precision;
        }
        let (n, arm) = (matrix.nrows(), self.problem.columns.len());
        for (k, known) in Layout::new(self.problem).setup_precision(TARGET_PRECISION).into_iter().enumerate()
        {
            matrix[(arm + k, arm + k)] += known.max(ROUNDING * matrix[(arm + k, arm + k)]);
        }
        if let Some(covariance) = inverse(&matrix) {
            return Ok(covariance);
        }
        if self.options.prior.is_some() {
            // Beside exact data the prior of confounded parameters is lost in rounding.
            (0..arm).for_each(|k| matrix[(k, k)] *= 1.0 + ROUNDING);
        }
        let rows = self.problem.measurements.measured_values();
        inverse(&matrix).ok_or(EstimateError::Singular { unknowns: n, rows })
    }

    fn renewed(&self, old: &Balance, minimum: &Minimum, covariance: &Mat<f64>, residuals: &[f64]) -> Balance {
        let arm = self.problem.columns.len();
        let precision = self.precision(old.scale);
        let determined = |k: usize| 1.0 - precision[k] * covariance[(k, k)];
        let effective: f64 = (0..arm).map(determined).sum();
        let fixed = (Layout::new(self.problem).len() - arm) as f64;
        let mut residuals = residuals.to_vec();
        turn_to_device(self.problem.measurements, &minimum.state.setup, &mut residuals, 1);
        let noise = self.options.noise.unwrap_or_else(|| self.noise(old, &residuals, effective + fixed));
        let scale = match self.options.prior {
            Some(prior) if prior.scaled && arm > 0 => self.prior_scale(&prior, minimum, effective),
            _ => 1.0,
        };
        let weights = match self.options.robust {
            Some(robust) => self.robust_weights(robust, noise, &residuals),
            None => old.weights.clone(),
        };
        Balance { noise, scale, weights, targets: old.targets }
    }

    fn prior_scale(&self, prior: &Prior, minimum: &Minimum, effective: f64) -> f64 {
        let squares: f64 = self
            .problem
            .columns
            .iter()
            .map(|&column| {
                ((minimum.state.parameters[column] - self.nominal[column]) / prior.of(column)).powi(2)
            })
            .sum();
        (squares / effective.max(1.0)).sqrt().clamp(SCALE_RANGE.0, SCALE_RANGE.1)
    }

    /// Noise of positions (or distances) and of orientations from residuals along the axes of sigmas; the unknowns are shared
    /// out by rows.
    ///
    /// Where there are no more values than unknowns the residuals can be made as small as one likes and tell nothing:
    /// the noise is then no less than the guess, or the covariance would promise what nobody measured.
    fn noise(&self, old: &Balance, residuals: &[f64], unknowns: f64) -> Noise {
        let (position, orientation) = self.squares(residuals, &old.weights);
        let rows = position.rows() + orientation.rows();
        let of = |squares: &Squares| match self.options.robust {
            Some(Robust::Huber | Robust::Cauchy) => {
                squares.robust_noise((rows / (rows - unknowns).max(1.0)).sqrt())
            }
            _ => squares.noise(unknowns * squares.rows() / rows),
        };
        let noise = Noise { position: of(&position), orientation: of(&orientation) };
        let tells = self.problem.measurements.measured_values() > Layout::new(self.problem).len();
        let floor = if tells { NOISE_FLOOR } else { Noise::GUESS };
        let (position, orientation) =
            (noise.position.max(floor.position), noise.orientation.max(floor.orientation));
        if !self.problem.measurements.has_rotations() {
            return Noise { position, orientation };
        }
        Noise { position: position.max(APART * orientation), orientation: orientation.max(APART * position) }
    }

    fn squares(&self, residuals: &[f64], weights: &[f64]) -> (Squares, Squares) {
        let set = self.problem.measurements;
        let (mut position, mut orientation) = (Squares::default(), Squares::default());
        if set.is_distances() {
            let counts = |distance: &Distance| distance.weight(&set.weight) > 0.0;
            let measured = set.distances.iter().zip(residuals);
            for (distance, residual) in measured.filter(|(distance, _)| counts(distance)) {
                let own = set.sigma[distance.pose].of_length().powi(2);
                position.push(residual * residual, own, distance.weight(weights));
            }
            return (position, orientation);
        }
        let rows = set.rows_per_pose();
        for pose in (0..set.pose_count()).filter(|&pose| set.weight[pose] > 0.0) {
            for row in 0..rows {
                let square = residuals[pose * rows + row].powi(2);
                let (target, own) = (row / 3, set.own_sigma(pose, row).powi(2));
                if target < set.target_count && set.has_target(pose, target) {
                    position.push(square, own, weights[pose]);
                } else if target == set.target_count && set.has_rotation(pose) {
                    orientation.push(square, own, weights[pose]);
                }
            }
        }
        (position, orientation)
    }

    /// A pose's weight from the root mean square of its standardised residuals.
    fn robust_weights(&self, robust: Robust, noise: Noise, residuals: &[f64]) -> Vec<f64> {
        let set = self.problem.measurements;
        if set.is_distances() {
            return self.robust_weights_of_distances(robust, noise, residuals);
        }
        let rows = set.rows_per_pose();
        let of_pose = |pose: usize| {
            let standardised: Vec<f64> = (0..rows)
                .filter(|row| {
                    if row / 3 < set.target_count {
                        set.has_target(pose, row / 3)
                    } else {
                        set.has_rotation(pose)
                    }
                })
                .map(|row| {
                    let of_position = row / 3 < set.target_count;
                    let noise = if of_position { noise.position } else { noise.orientation };
                    residuals[pose * rows + row] / noise.hypot(set.own_sigma(pose, row))
                })
                .collect();
            let mean = standardised.iter().map(|z| z * z).sum::<f64>() / standardised.len().max(1) as f64;
            set.weight[pose] * robust.weight(mean.sqrt())
        };
        (0..set.pose_count()).map(of_pose).collect()
    }

    /// The same of the distances that start at each pose.
    fn robust_weights_of_distances(&self, robust: Robust, noise: Noise, residuals: &[f64]) -> Vec<f64> {
        let set = self.problem.measurements;
        let mut squares = vec![(0.0, 0.0_f64); set.pose_count()];
        for (distance, residual) in set.distances.iter().zip(residuals) {
            let sigma = noise.position.hypot(set.sigma[distance.pose].of_length());
            let (sum, count) = &mut squares[distance.pose];
            *sum += (residual / sigma).powi(2);
            *count += 1.0;
        }
        let weights = squares.iter().zip(&set.weight);
        weights.map(|((sum, count), weight)| weight * robust.weight((sum / count.max(1.0)).sqrt())).collect()
    }

    /// Whether another minimisation would change nothing that matters.
    fn settled(&self, old: &Balance, new: &Balance) -> bool {
        let same = |a: f64, b: f64| (a - b).abs() <= REST * a.abs().max(b.abs());
        let set = self.problem.measurements;
        let noise = same(old.noise.position, new.noise.position)
            && (!set.has_rotations() || same(old.noise.orientation, new.noise.orientation));
        let weights = old.weights.iter().zip(&new.weights).all(|(a, b)| (a - b).abs() < 1e-2);
        weights && (self.only_scales_the_cost(old) || noise && same(old.scale, new.scale))
    }

    /// Whether the noise weighs all rows alike, so that its value moves nothing.
    fn only_scales_the_cost(&self, balance: &Balance) -> bool {
        let set = self.problem.measurements;
        self.options.prior.is_none()
            && balance.targets == 0.0
            && !set.has_rotations()
            && set.sigma.iter().all(|&sigma| sigma == Sigma::default())
            && self.options.robust.is_none_or(|robust| robust == Robust::None)
    }
}

/// Inverse of a symmetric matrix (n, n), scaled to a unit diagonal on the way; `None` where it is not positive definite.
fn inverse(matrix: &Mat<f64>) -> Option<Mat<f64>> {
    let n = matrix.nrows();
    let scale: Vec<f64> = (0..n).map(|i| matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    let scaled = Mat::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = Cholesky::new(scaled, Par::Seq)?.inverse();
    Some(Mat::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// Share of a diagonal entry below which a pivot of the normal equations is nothing but rounding.
const ROUNDING: f64 = 1e-12;
/// Least ratio of the noises of positions and orientations, in m and rad: with more between them, rows of one kind drown those
/// of the other in rounding.
const APART: f64 = 1e-6;
/// Below what any instrument resolves; keeps weights finite where data is exact.
const NOISE_FLOOR: Noise = Noise { position: 1e-12, orientation: 1e-12 };
