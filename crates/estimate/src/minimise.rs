//! Levenberg-Marquardt on the unknowns of a problem (Levenberg 1944; Marquardt 1963, diagonal scaling).

use faer::Par;

use crate::dense::Cholesky;
use crate::layout::{Layout, Problem};
use crate::packets::Packets;
use crate::pass::{Normal, normal_equations};
use crate::rows::{Point, Weighting};
use crate::setup::Setup;
use truearm_kinematics::Cancel;

use crate::EstimateError;

/// The unknowns' current values.
#[derive(Debug, Clone)]
pub struct State {
    /// Absolute link parameters (5 L,).
    pub parameters: Vec<f64>,
    pub setup: Setup,
}

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The last step promised no noticeable decrease.
    Converged,
    /// No damped step decreased the cost any more.
    Stalled,
    /// The limit of iterations was reached.
    IterationLimit,
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Reason::Converged => "converged: the last step promised no noticeable decrease",
            Reason::Stalled => "stalled: no damped step decreased the cost any more",
            Reason::IterationLimit => "stopped at the limit of iterations, not converged",
        })
    }
}

/// Least squares with a Gaussian prior on the arm's corrections.
pub struct Objective<'a> {
    pub problem: &'a Problem<'a>,
    pub packets: &'a Packets,
    pub weighting: Weighting<'a>,
    /// Prior precision of each active correction, (A,); zero where there is none.
    pub precision: &'a [f64],
    /// Prior precision of each target's coordinates, about the flange; zero where there is none.
    pub target_precision: f64,
    /// Nominal link parameters (5 L,).
    pub nominal: &'a [f64],
    pub cancel: &'a Cancel,
}

/// Where the iteration ended, with the normal equations (without the prior) there.
pub struct Minimum {
    pub state: State,
    pub normal: Normal,
    pub iterations: usize,
    pub reason: Reason,
}

const ITERATION_LIMIT: usize = 60;
const FIRST_DAMPING: f64 = 1e-9;
const LARGEST_DAMPING: f64 = 1e10;
/// From this iteration on damping may fall lower: where data is almost exact, the prior alone moves confounded unknowns, and
/// it is weaker than the first damping.
const LATE: usize = 30;
const LATE_DAMPING: f64 = 1e-14;
/// A step that promises less than this share of the cost is the last one; convergence is quadratic.
const SHARE_OF_COST: f64 = 1e-9;
/// A step below this (m, rad) is the last one even where the cost is zero.
const SMALLEST_STEP: f64 = 1e-14;

impl Objective<'_> {
    /// Normal equations at a state, without the prior.
    ///
    /// # Errors
    /// [`EstimateError::Kinematics`].
    pub fn normal(&self, state: &State) -> Result<Normal, EstimateError> {
        let point = Point { parameters: &state.parameters, setup: &state.setup };
        normal_equations(self.problem, self.packets, point, self.weighting)
    }

    fn correction(&self, state: &State, k: usize) -> f64 {
        let column = self.problem.columns[k];
        state.parameters[column] - self.nominal[column]
    }

    fn cost(&self, state: &State, normal: &Normal) -> f64 {
        let prior: f64 =
            self.precision.iter().enumerate().map(|(k, p)| p * self.correction(state, k).powi(2)).sum();
        let squares: f64 =
            state.setup.groups.iter().flat_map(|group| group.targets.as_flattened()).map(|x| x * x).sum();
        normal.squares + prior + self.target_precision * squares
    }

    /// The damped step and the decrease of the cost that it promises; `None` where the matrix is singular.
    fn step(&self, state: &State, normal: &Normal, damping: f64) -> Option<(Vec<f64>, f64)> {
        let mut matrix = normal.matrix.clone();
        let mut right = normal.right.clone();
        for (k, precision) in self.precision.iter().enumerate() {
            matrix[(k, k)] += precision;
            right[k] -= precision * self.correction(state, k);
        }
        for (group, k, at) in Layout::new(self.problem).target_coordinates() {
            matrix[(at, at)] += self.target_precision;
            right[at] -= self.target_precision * state.setup.groups[group].targets.as_flattened()[k];
        }
        // Unknowns scaled to a unit diagonal, so that damping and the factor see no units.
        let scale: Vec<f64> =
            (0..right.len()).map(|i| matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
        let scaled = faer::Mat::from_fn(right.len(), right.len(), |i, j| {
            matrix[(i, j)] * scale[i] * scale[j] + if i == j { damping } else { 0.0 }
        });
        let target: Vec<f64> = right.iter().zip(&scale).map(|(r, s)| r * s).collect();
        let solution = Cholesky::new(scaled, Par::Seq)?.solve_vector(&target);
        let promised = solution.iter().zip(&target).map(|(x, r)| x * r).sum();
        Some((solution.iter().zip(&scale).map(|(x, s)| x * s).collect(), promised))
    }

    fn moved(&self, state: &State, step: &[f64]) -> State {
        let mut parameters = state.parameters.clone();
        for (&column, change) in self.problem.columns.iter().zip(step) {
            parameters[column] += change;
        }
        State { parameters, setup: Layout::new(self.problem).step_setup(&state.setup, step) }
    }

    /// Minimises from a start.
    ///
    /// # Errors
    /// [`EstimateError::Singular`], [`EstimateError::Kinematics`], [`EstimateError::Cancelled`].
    pub fn minimise(&self, start: State) -> Result<Minimum, EstimateError> {
        let normal = self.normal(&start)?;
        let mut minimum = Minimum { state: start, normal, iterations: 0, reason: Reason::IterationLimit };
        let mut cost = self.cost(&minimum.state, &minimum.normal);
        let mut damping = FIRST_DAMPING;
        // Whether a lower damping left the matrix at this state singular.
        let mut lowest = false;
        let mut late_damping = LATE_DAMPING;
        while minimum.iterations < ITERATION_LIMIT {
            self.cancel.check()?;
            minimum.iterations += 1;
            let Some((step, promised)) = self.step(&minimum.state, &minimum.normal, damping) else {
                damping *= 100.0;
                lowest = true;
                if minimum.iterations >= LATE {
                    late_damping = damping;
                }
                if damping > LARGEST_DAMPING {
                    return Err(self.singular());
                }
                continue;
            };
            let state = self.moved(&minimum.state, &step);
            let tiny = step.iter().all(|change| change.abs() < SMALLEST_STEP);
            if (lowest || damping <= FIRST_DAMPING) && (promised <= SHARE_OF_COST * cost || tiny) {
                minimum.state = state;
                minimum.reason = Reason::Converged;
                break;
            }
            let normal = self.normal(&state)?;
            let trial = self.cost(&state, &normal);
            if trial < cost {
                (minimum.state, minimum.normal, cost) = (state, normal, trial);
                let least = if minimum.iterations < LATE { FIRST_DAMPING } else { late_damping };
                damping = (damping * 0.01).max(least);
                lowest = false;
            } else {
                damping = (damping * 100.0).max(1e-6);
                lowest = false;
                if damping > LARGEST_DAMPING {
                    minimum.reason = Reason::Stalled;
                    break;
                }
            }
        }
        Ok(minimum)
    }

    /// What is said where the rows leave unknowns open.
    pub fn singular(&self) -> EstimateError {
        let unknowns = Layout::new(self.problem).len();
        EstimateError::Singular { unknowns, rows: self.problem.measurements.measured_values() }
    }
}
