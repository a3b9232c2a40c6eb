//! Training by the paper's rule (A5), pattern after pattern, until all differences are within the tolerance.

use truearm_estimate::{EstimateError, column_unit};
use truearm_kinematics::{Cancel, Isa, Kernel, LANES, Lane, dispatch};

use crate::cmac::network::Network;

/// Factor of the update w += factor mu (CEP - CEP').
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rate {
    /// The learning rate alone, as (A5) is printed: the fuller the excitation, the longer the step.
    Printed(f64),
    /// The learning rate times sum(mu) / sum(mu^2): a rate of one meets the pattern with one update (Kaczmarz).
    Projected(f64),
}

/// When training ends, and how long its steps are.
#[derive(Debug, Clone)]
pub struct TrainingOptions {
    /// Length of the steps.
    pub rate: Rate,
    /// Largest difference to be left of any pattern, m; angles count at 0.3 m.
    pub tolerance: f64,
    /// Runs through all patterns at most.
    pub epochs: usize,
    /// Looked at between epochs.
    pub cancel: Cancel,
}

impl Default for TrainingOptions {
    fn default() -> Self {
        Self { rate: Rate::Printed(1.0), tolerance: 1e-5, epochs: 5000, cancel: Cancel::default() }
    }
}

/// Why training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrainingEnd {
    /// Every difference is within the tolerance.
    Converged,
    /// The differences hardly fell any more: the patterns contradict each other at this number of cells.
    Stalled,
    /// The number of epochs was reached.
    EpochLimit,
    /// The differences grew without bound.
    Diverged,
}

impl std::fmt::Display for TrainingEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            TrainingEnd::Converged => "converged: every difference is within the tolerance",
            TrainingEnd::Stalled => {
                "stalled: the differences hardly fall any more, so the patterns contradict each other or need more cells"
            }
            TrainingEnd::EpochLimit => {
                "stopped at the limit of epochs, not converged: allow more or raise the rate"
            }
            TrainingEnd::Diverged => "diverged: the learning rate is too large",
        })
    }
}

/// A trained network and how training went.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The network.
    pub network: Network,
    /// Runs through all patterns.
    pub epochs: usize,
    /// Why it ended.
    pub end: TrainingEnd,
    /// Largest difference left, m.
    pub largest: f64,
    /// Root mean square of the differences left, m.
    pub rms: f64,
    /// Association cells that the patterns excite.
    pub excited: usize,
    /// How many of them share their row of weights with another one.
    pub collisions: usize,
}

/// Differences of one run through all patterns.
#[derive(Debug, Clone, Copy, Default)]
pub struct Measure {
    largest: Lane,
    squares: Lane,
    values: usize,
}

impl Measure {
    /// Adds eight differences, in metres.
    #[inline(always)]
    pub fn add(&mut self, difference: Lane) {
        for i in 0..LANES {
            let size = difference.0[i].abs();
            self.largest.0[i] = if size <= self.largest.0[i] { self.largest.0[i] } else { size };
        }
        self.squares += difference * difference;
    }

    /// Counts values that were added; lanes hold more.
    #[inline(always)]
    pub fn count(&mut self, values: usize) {
        self.values += values;
    }

    fn largest(&self) -> f64 {
        self.largest.0.into_iter().fold(0.0, |most, size| if size <= most { most } else { size })
    }

    fn rms(&self) -> f64 {
        (self.squares.sum() / self.values.max(1) as f64).sqrt()
    }
}

/// What a network is trained on: inputs, and for each the change of the output that is wanted.
pub trait Patterns {
    /// Inputs (n, I).
    fn inputs(&self) -> &[f64];

    /// The change of CEPs wanted at a pattern, given the output there, and its size.
    fn error<I: Isa>(&self, pattern: usize, output: &[Lane], error: &mut [Lane], measure: &mut Measure);
}

/// Wanted CEPs for inputs, such as the representative sets of regions.
pub struct Wanted<'a> {
    inputs: &'a [f64],
    ceps: Vec<Lane>,
    units: Vec<Lane>,
    outputs: usize,
}

impl Patterns for Wanted<'_> {
    #[inline(always)]
    fn inputs(&self) -> &[f64] {
        self.inputs
    }

    #[inline(always)]
    fn error<I: Isa>(&self, pattern: usize, output: &[Lane], error: &mut [Lane], measure: &mut Measure) {
        let lanes = self.units.len();
        let wanted = &self.ceps[pattern * lanes..(pattern + 1) * lanes];
        for k in 0..lanes {
            error[k] = wanted[k] - output[k];
            measure.add(error[k] * self.units[k]);
        }
        measure.count(self.outputs);
    }
}

impl Network {
    /// Train on wanted CEPs (n, P) at inputs (n, I); weights start at the mean CEPs.
    ///
    /// # Arguments
    /// `columns` (P,) are the driven parameters, 5 * link + (theta, d, a, alpha, beta): they tell angles from lengths.
    ///
    /// # Errors
    /// [`EstimateError`] where an array does not fit, a value is not finite, or on request.
    pub fn train(
        &self,
        (inputs, ceps): (&[f64], &[f64]),
        columns: &[usize],
        options: &TrainingOptions,
    ) -> Result<Trained, EstimateError> {
        let (count, outputs) = (self.check_inputs(inputs)?, self.output_count());
        check_length("the driven parameters", columns.len(), outputs)?;
        check_length("the wanted CEPs", ceps.len(), count * outputs)?;
        if let Some(at) = ceps.iter().position(|value| !value.is_finite()) {
            return Err(EstimateError::NotFinite { what: "a wanted CEP", pose: at / outputs });
        }
        let lanes = |values: &[f64]| -> Vec<Lane> {
            let lane = |part: &[f64]| Lane(std::array::from_fn(|i| part.get(i).copied().unwrap_or_default()));
            values.chunks_exact(outputs).flat_map(|row| row.chunks(LANES)).map(lane).collect()
        };
        let units: Vec<f64> = columns.iter().map(|&column| column_unit(column)).collect();
        let wanted = Wanted { inputs, ceps: lanes(ceps), units: lanes(&units), outputs };
        let mean = |k: usize| ceps.iter().skip(k).step_by(outputs).sum::<f64>() / count.max(1) as f64;
        let mut start = self.clone();
        start.fill(&(0..outputs).map(mean).collect::<Vec<_>>());
        start.train_from(&wanted, options)
    }

    /// Train from the present weights.
    ///
    /// # Errors
    /// As [`Network::train`].
    pub fn train_from<P: Patterns>(
        mut self,
        patterns: &P,
        options: &TrainingOptions,
    ) -> Result<Trained, EstimateError> {
        options.check()?;
        let activity = Activity::new(&self, patterns.inputs(), options.rate)?;
        let (mut epochs, mut history) = (0, Vec::new());
        let end = loop {
            options.cancel.check()?;
            if epochs == options.epochs {
                break TrainingEnd::EpochLimit;
            }
            let met =
                dispatch(Epoch::<P> { network: &mut self, activity: &activity, patterns, update: true });
            epochs += 1;
            let verified =
                || dispatch(Epoch::<P> { network: &mut self, activity: &activity, patterns, update: false });
            if met.largest() <= options.tolerance && { verified }().largest() <= options.tolerance {
                break TrainingEnd::Converged;
            }
            history.push(met.rms());
            if let Some(end) = ended(&history) {
                break end;
            }
        };
        let left = dispatch(Epoch { network: &mut self, activity: &activity, patterns, update: false });
        let (excited, collisions) = activity.collisions();
        let (largest, rms) = (left.largest(), left.rms());
        // While weights change, patterns are met before what comes after them does them good.
        let end = if largest <= options.tolerance { TrainingEnd::Converged } else { end };
        Ok(Trained { network: self, epochs, end, largest, rms, excited, collisions })
    }
}

impl TrainingOptions {
    fn check(&self) -> Result<(), EstimateError> {
        let refuse = |what, value, rule| Err(EstimateError::Option { what, value, rule });
        let (Rate::Printed(rate) | Rate::Projected(rate)) = self.rate;
        if !(rate > 0.0 && rate < 2.0) {
            return refuse("the learning rate", rate, "it must be above 0 and below 2, or training diverges");
        }
        if !(self.tolerance >= 0.0 && self.tolerance.is_finite()) {
            return refuse("the tolerance", self.tolerance, "it must be a length of zero or more, m");
        }
        Ok(())
    }
}

/// Checks the length of an array.
///
/// # Errors
/// [`EstimateError::Length`].
pub fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), EstimateError> {
    if found == expected { Ok(()) } else { Err(EstimateError::Length { what, found, expected }) }
}

/// Epochs over which the differences must fall by [`FALL`] or training has stalled.
const WINDOW: usize = 25;
const FALL: f64 = 1e-2;
/// Growth of the differences that counts as divergence.
const GROWTH: f64 = 1e3;

fn ended(history: &[f64]) -> Option<TrainingEnd> {
    let (first, last) = (history.first()?, history.last()?);
    if !last.is_finite() || *last > GROWTH * first.max(f64::MIN_POSITIVE) {
        return Some(TrainingEnd::Diverged);
    }
    let before = history.len().checked_sub(WINDOW + 1)?;
    (*last > (1.0 - FALL) * history[before]).then_some(TrainingEnd::Stalled)
}

/// Active cells of all patterns, found once: they do not change while weights do.
struct Activity {
    /// Rows of weights, (n, A).
    rows: Vec<u32>,
    /// Excitations, (n, A).
    grades: Vec<f64>,
    /// 1 / sum of the excitations, and the factor of the update, (n,).
    factors: Vec<(f64, f64)>,
    /// Association cells, where several may share a row.
    cells: Vec<u64>,
}

/// Active cells of all patterns at most: 1.5 GB.
const MOST_GRADES: usize = 1 << 27;

impl Activity {
    fn new(network: &Network, inputs: &[f64], rate: Rate) -> Result<Activity, EstimateError> {
        let active = network.active_count();
        let size = network.check_inputs(inputs)? * active;
        if size > MOST_GRADES {
            return Err(EstimateError::Option {
                what: "the number of patterns times active cells",
                value: size as f64,
                rule: "it must be 134217728 or fewer: train on fewer patterns or lower c",
            });
        }
        let (cells, grades) = network.active(inputs)?;
        let rows = cells.iter().map(|&cell| network.table().row(cell) as u32).collect();
        let factor = |grades: &[f64]| {
            let (sum, squares): (f64, f64) = grades.iter().fold((0.0, 0.0), |(s, q), g| (s + g, q + g * g));
            let factor = match rate {
                Rate::Printed(rate) => rate,
                Rate::Projected(rate) => rate * sum / squares,
            };
            (sum.recip(), factor)
        };
        let factors = grades.chunks_exact(active).map(factor).collect();
        Ok(Activity { rows, grades, factors, cells })
    }

    /// Distinct cells, and how many of them are not alone in their row.
    fn collisions(mut self) -> (usize, usize) {
        let mut pairs: Vec<(u32, u64)> = self.rows.drain(..).zip(self.cells.drain(..)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let shared = pairs.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1);
        (pairs.len(), shared.map(<[_]>::len).sum())
    }
}

struct Epoch<'a, P> {
    network: &'a mut Network,
    activity: &'a Activity,
    patterns: &'a P,
    update: bool,
}

impl<P: Patterns> Kernel for Epoch<'_, P> {
    type Output = Measure;

    #[inline(always)]
    fn run<I: Isa>(self) -> Measure {
        match self.network.lanes() {
            1 => self.with::<I, 1>(),
            2 => self.with::<I, 2>(),
            3 => self.with::<I, 3>(),
            4 => self.with::<I, 4>(),
            _ => self.with::<I, 0>(),
        }
    }
}

impl<P: Patterns> Epoch<'_, P> {
    /// With rows of L lanes, or of a number known only now where L is zero.
    #[inline(always)]
    fn with<I: Isa, const L: usize>(self) -> Measure {
        let (active, lanes) = (self.network.active_count(), if L == 0 { self.network.lanes() } else { L });
        let (mut output, mut error) = (vec![Lane::ZERO; lanes], vec![Lane::ZERO; lanes]);
        let mut measure = Measure::default();
        let weights = self.network.lane_weights_mut();
        for (pattern, &(inverse, factor)) in self.activity.factors.iter().enumerate() {
            let rows = &self.activity.rows[pattern * active..(pattern + 1) * active];
            let grades = &self.activity.grades[pattern * active..(pattern + 1) * active];
            if L == 0 {
                wide_sum::<I>(weights, rows, grades, &mut output);
            } else {
                narrow_sum::<I, L>(weights, rows, grades, &mut output);
            }
            output.iter_mut().for_each(|lane| *lane = *lane * inverse);
            self.patterns.error::<I>(pattern, &output, &mut error, &mut measure);
            if self.update {
                error.iter_mut().for_each(|lane| *lane = *lane * factor);
                for (row, grade) in rows.iter().zip(grades) {
                    let grade = Lane::splat(*grade);
                    let row = &mut weights[*row as usize * lanes..][..lanes];
                    for k in 0..lanes {
                        row[k] = I::mul_add(grade, error[k], row[k]);
                    }
                }
            }
        }
        measure
    }
}

#[inline(always)]
fn narrow_sum<I: Isa, const L: usize>(weights: &[Lane], rows: &[u32], grades: &[f64], out: &mut [Lane]) {
    let mut sums = [Lane::ZERO; L];
    for (row, grade) in rows.iter().zip(grades) {
        let (from, grade) = (&weights[*row as usize * L..][..L], Lane::splat(*grade));
        for k in 0..L {
            sums[k] = I::mul_add(grade, from[k], sums[k]);
        }
    }
    out.copy_from_slice(&sums);
}

#[inline(always)]
fn wide_sum<I: Isa>(weights: &[Lane], rows: &[u32], grades: &[f64], out: &mut [Lane]) {
    out.fill(Lane::ZERO);
    for (row, grade) in rows.iter().zip(grades) {
        let (from, grade) = (&weights[*row as usize * out.len()..][..out.len()], Lane::splat(*grade));
        for k in 0..out.len() {
            out[k] = I::mul_add(grade, from[k], out[k]);
        }
    }
}
