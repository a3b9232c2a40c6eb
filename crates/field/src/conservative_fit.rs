//! Fitting the conservative standard deviation to exact values.
//!
//! First a [`Leverage`] is fitted to the position's, where a chain is given; what follows is about what is left. The
//! logarithms are fitted by least squares with a small ridge, in which a value that the tables fall short of weighs a
//! hundred times one that they exceed, so that the tables lie along the upper edge of what they cannot follow. Then they
//! are raised by the largest shortfall at configurations that took no part, and beyond it by what the tail
//! of the shortfalls lets expect: peaks over a threshold whose excesses fall off exponentially.

use std::f64::consts::{PI, TAU};

use faer::Mat;
use truearm_bank::{
    Axis, BOUNDED, Bank, Block, Conservative, ConservativeParts, Grid, Input, InputKind, Leverage,
};
use truearm_estimate::dense::{Cholesky, parallelism};
use truearm_kinematics::{Cancel, Chain};

use crate::FieldError;
use crate::leverage_fit::fit_leverage;

/// Cells of a turn along one input; fine curves of single joints are about this wide.
const FINE: f64 = 40.0;
/// Cells of a turn of each of two inputs together, and of three.
const PAIR: f64 = 12.0;
const TRIPLE: f64 = 8.0;
/// Most inputs that are tabulated together.
const MOST_TOGETHER: usize = 3;
/// How much more a shortfall weighs than an excess.
const SHORTFALL: f64 = 100.0;
/// Reweightings by the side that a value lies on.
const ROUNDS: usize = 5;
/// Ridge on the tables, in weights of a sample: cells without samples stay at zero.
const RIDGE: f64 = 0.3;
/// Share of the shortfalls that belong to the tail.
const TAIL: f64 = 0.05;
/// How seldom an exact value may lie above, were the tail exponential.
const SELDOM: f64 = 1e-6;
/// The least raise beyond what was seen, in logarithms: tails of a smooth function are no exponentials.
const LEAST: f64 = 0.02;
const DEGREE: usize = 2;
/// So far beyond a range, as a share of it, values are at its end but for rounding.
const ROUNDING: f64 = 1e-9;

/// Exact values at configurations.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    /// Inputs, (n, I).
    pub inputs: &'a [f64],
    /// Position (m) and rotation (rad), (n, 2), positive.
    pub std: &'a [f64],
}

/// What the tables are over.
#[derive(Debug, Clone, PartialEq)]
pub struct ConservativePlan {
    /// Kinds of the inputs, (I,).
    pub kinds: Vec<InputKind>,
    /// Lowest and highest value of each, (I,); whole turns for angles that go round.
    pub ranges: Vec<[f64; 2]>,
    /// Inputs that are tabulated together as well; the first three count.
    pub together: Vec<usize>,
    /// What is never exceeded, m and rad.
    pub largest: [f64; BOUNDED],
    /// The point whose position the samples are of, in the flange's frame, m.
    pub centre: [f64; 3],
    /// The chain to the flange whose joint values are the first inputs, for a leverage.
    pub chain: Option<Chain>,
}

fn check(plan: &ConservativePlan, samples: Samples) -> Result<(), FieldError> {
    let count = plan.kinds.len();
    if count == 0 {
        let rule = "a standard deviation varies with one at least: give the kinds of joints and features";
        return Err(FieldError::Option { what: "the number of inputs", value: count, rule });
    }
    let poses = samples.std.len() / BOUNDED;
    let lengths = [
        ("ranges", plan.ranges.len(), count),
        ("inputs of samples", samples.inputs.len(), poses * count),
        ("standard deviations of samples", samples.std.len(), poses * BOUNDED),
    ];
    for (what, found, expected) in lengths {
        if found != expected {
            return Err(FieldError::Length { what, found, expected });
        }
    }
    let positive = samples.std.iter().all(|&value| value > 0.0 && value.is_finite());
    if poses == 0 || !positive || !samples.inputs.iter().all(|value| value.is_finite()) {
        return Err(FieldError::NotFinite { what: "samples of the standard deviation" });
    }
    Ok(())
}

impl ConservativePlan {
    /// Fits the tables to `fitted`, and raises them by what `fresh`, configurations of their own, shows.
    ///
    /// # Errors
    /// [`FieldError::Length`], [`FieldError::NotFinite`] where values are not positive or there are none,
    /// [`FieldError::Ends`], [`FieldError::Range`] where samples lie beyond the ranges,
    /// [`FieldError::NotPositiveDefinite`], or on request.
    pub fn fit(&self, fitted: Samples, fresh: Samples, cancel: &Cancel) -> Result<Conservative, FieldError> {
        check(self, fitted)?;
        check(self, fresh)?;
        self.check_ranges()?;
        self.check_within(fitted)?;
        self.check_within(fresh)?;
        let grids = self.grids();
        let rows = ExcitedCells::new(&grids, self.kinds.len(), fitted.inputs);
        let mut solved = Vec::with_capacity(BOUNDED);
        let (leverage, units) = leverage(self, fitted, cancel)?;
        for k in 0..BOUNDED {
            cancel.check()?;
            solved.push(solve(&rows, &logs(fitted, &units, k))?);
        }
        let parts = ConservativeParts {
            tables: bank(self, grids, &solved),
            leverage,
            level: [solved[0].level, solved[1].level],
            largest: self.largest,
            centre: self.centre,
            ranges: self.ranges.iter().zip(&self.kinds).map(limits).collect(),
            looseness: [1.0; BOUNDED],
        };
        raised(parts, fitted, fresh)
    }

    fn check_ranges(&self) -> Result<(), FieldError> {
        for (input, &[low, high]) in self.ranges.iter().enumerate() {
            if !(low <= high && low.is_finite() && high.is_finite()) {
                return Err(FieldError::Ends { input, low, high });
            }
        }
        Ok(())
    }

    /// Beyond the ranges nothing is fitted: a sample there would raise all tables.
    fn check_within(&self, samples: Samples) -> Result<(), FieldError> {
        let limits: Vec<[f64; 2]> = self.ranges.iter().zip(&self.kinds).map(limits).collect();
        for inputs in samples.inputs.chunks_exact(limits.len()) {
            for (input, (&value, &[low, high])) in inputs.iter().zip(&limits).enumerate() {
                let slack = ROUNDING * (1.0 + high - low);
                if value < low - slack || value > high + slack {
                    return Err(FieldError::Range { input, value, low, high });
                }
            }
        }
        Ok(())
    }

    /// A fine line over each input, and a coarse grid over those together.
    fn grids(&self) -> Vec<Grid> {
        let axis = |k: usize, per_turn: f64| axis(self.kinds[k], self.ranges[k], per_turn);
        let mut grids: Vec<Grid> =
            (0..self.kinds.len()).map(|k| Grid { inputs: vec![k], axes: vec![axis(k, FINE)] }).collect();
        let mut inputs: Vec<usize> =
            self.together.iter().copied().filter(|&k| k < self.kinds.len()).take(MOST_TOGETHER).collect();
        inputs.dedup();
        if inputs.len() > 1 {
            let per_turn = if inputs.len() == 2 { PAIR } else { TRIPLE };
            let axes = inputs.iter().map(|&k| axis(k, per_turn)).collect();
            grids.push(Grid { inputs, axes });
        }
        grids
    }
}

/// Cells over a range: a closed turn, or one cell beyond each end.
fn axis(kind: InputKind, range: [f64; 2], per_turn: f64) -> Axis {
    let spacing = TAU / per_turn;
    let input = match kind {
        InputKind::Angle => Input::ANGLE,
        InputKind::Line => Input::line(range[1] - range[0]),
    };
    let [low, high] = range.map(|value| value * input.scale);
    if goes_round(kind, range, spacing) {
        let count = per_turn as usize;
        return Axis { input, origin: -PI, spacing, count, closed: true, degree: DEGREE };
    }
    let count = ((high - low) / spacing).ceil() as usize + 3;
    let origin = 0.5 * (low + high) - 0.5 * spacing * (count - 1) as f64;
    Axis { input, origin, spacing, count, closed: false, degree: DEGREE }
}

/// Whether open cells over a range of angles would meet.
fn goes_round(kind: InputKind, range: [f64; 2], spacing: f64) -> bool {
    kind == InputKind::Angle && range[1] - range[0] + 4.0 * spacing >= TAU
}

/// Where an input may lie: anywhere if its range is a turn.
fn limits((range, kind): (&[f64; 2], &InputKind)) -> [f64; 2] {
    let turn = goes_round(*kind, *range, 0.0);
    if turn { [f64::NEG_INFINITY, f64::INFINITY] } else { *range }
}

/// The leverage that the position's standard deviations follow, and both numbers' units (n, 2) with it.
fn leverage(
    plan: &ConservativePlan,
    fitted: Samples,
    cancel: &Cancel,
) -> Result<(Option<Leverage>, Vec<f64>), FieldError> {
    let Some(chain) = &plan.chain else { return Ok((None, vec![1.0; fitted.std.len()])) };
    let (position, width): (Vec<f64>, _) =
        (fitted.std.iter().copied().step_by(BOUNDED).collect(), plan.kinds.len());
    let found = fit_leverage(chain, plan.centre, (fitted.inputs, width), &position, cancel)?;
    let units = found.at(fitted.inputs, width).into_iter().flat_map(|unit| [unit, 1.0]).collect();
    Ok((Some(found), units))
}

fn logs(samples: Samples, units: &[f64], k: usize) -> Vec<f64> {
    let pairs = samples.std.chunks_exact(BOUNDED).zip(units.chunks_exact(BOUNDED));
    pairs.map(|(std, unit)| (std[k] / unit[k]).ln()).collect()
}

/// Excited cells of each sample, numbered through all grids.
struct ExcitedCells {
    cells: usize,
    entries: Vec<Vec<(usize, f64)>>,
}

impl ExcitedCells {
    fn new(grids: &[Grid], inputs: usize, values: &[f64]) -> Self {
        let row = |values: &[f64]| {
            let (mut entries, mut first) = (Vec::new(), 0);
            for grid in grids {
                grid.visit(values, |cell, grade| entries.push((first + cell, grade)));
                first += grid.cell_count();
            }
            entries
        };
        let cells = grids.iter().map(Grid::cell_count).sum();
        Self { cells, entries: values.chunks_exact(inputs).map(row).collect() }
    }

    fn sum(&self, sample: usize, weights: &[f64]) -> f64 {
        self.entries[sample].iter().map(|&(cell, grade)| grade * weights[cell]).sum()
    }
}

/// Tables of one output and what is added to them.
struct Solved {
    level: f64,
    weights: Vec<f64>,
}

fn solve(rows: &ExcitedCells, logs: &[f64]) -> Result<Solved, FieldError> {
    let level = logs.iter().sum::<f64>() / logs.len() as f64;
    let mut weights = vec![0.0; rows.cells];
    let mut importance = vec![1.0; logs.len()];
    for _ in 0..ROUNDS {
        let mut normal = Mat::<f64>::zeros(rows.cells, rows.cells);
        let mut right = vec![0.0; rows.cells];
        let ridge = RIDGE * importance.iter().sum::<f64>() / logs.len() as f64;
        (0..rows.cells).for_each(|cell| normal[(cell, cell)] = ridge);
        for ((entries, log), importance) in rows.entries.iter().zip(logs).zip(&importance) {
            for &(i, a) in entries {
                right[i] += importance * a * (log - level);
                entries.iter().filter(|entry| entry.0 <= i).for_each(|&(j, b)| {
                    normal[(i, j)] += importance * a * b;
                });
            }
        }
        let error = FieldError::NotPositiveDefinite { rows: rows.cells };
        weights = Cholesky::new(normal, parallelism()).ok_or(error)?.solve_vector(&right);
        for (sample, importance) in importance.iter_mut().enumerate() {
            let short = logs[sample] > level + rows.sum(sample, &weights);
            *importance = if short { SHORTFALL } else { 1.0 };
        }
    }
    Ok(Solved { level, weights })
}

fn bank(plan: &ConservativePlan, grids: Vec<Grid>, solved: &[Solved]) -> Bank {
    let mut tables = Bank::empty(plan.kinds.len(), BOUNDED);
    let mut first = 0;
    for grid in grids {
        let cells = first..first + grid.cell_count();
        first = cells.end;
        let weights = cells.flat_map(|cell| solved.iter().map(move |one| one.weights[cell])).collect();
        let name = if grid.inputs.len() == 1 { "each" } else { "together" }.to_owned();
        tables.blocks.push(Block { name, grid, outputs: (0..BOUNDED).collect(), weights, reading: None });
    }
    tables
}

/// The same with levels that no sample lies above, and as much higher as the tail asks for.
fn raised(mut parts: ConservativeParts, fitted: Samples, fresh: Samples) -> Result<Conservative, FieldError> {
    let largest = std::mem::replace(&mut parts.largest, [f64::MAX; BOUNDED]);
    let free = Conservative::new(parts.clone())?;
    parts.largest = largest;
    let shortfalls = |samples: Samples| -> Result<[Vec<f64>; BOUNDED], FieldError> {
        let found = free.std(samples.inputs)?;
        let pairs = || samples.std.chunks_exact(BOUNDED).zip(found.chunks_exact(BOUNDED));
        Ok([0, 1].map(|k| pairs().map(|(exact, found)| (exact[k] / found[k]).ln()).collect()))
    };
    let (seen, mut unseen) = (shortfalls(fitted)?, shortfalls(fresh)?);
    for k in 0..BOUNDED {
        unseen[k].sort_by(f64::total_cmp);
        let known = seen[k].iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let raise = tail_bound(&unseen[k]).max(known + LEAST);
        parts.level[k] += raise;
        parts.looseness[k] = (raise - unseen[k][unseen[k].len() / 2]).exp();
    }
    Ok(Conservative::new(parts)?)
}

/// What sorted shortfalls exceed with the probability [`SELDOM`], and at least a little more than the largest.
fn tail_bound(sorted: &[f64]) -> f64 {
    let first = ((1.0 - TAIL) * sorted.len() as f64) as usize;
    let tail = &sorted[first.min(sorted.len() - 1)..];
    let threshold = tail[0];
    let excess = tail.iter().map(|value| value - threshold).sum::<f64>() / tail.len() as f64;
    (tail[tail.len() - 1] + LEAST).max(threshold + excess * (TAIL / SELDOM).ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_of_exponential_values_is_found() {
        let count = 20_000;
        let sorted: Vec<f64> = (0..count).map(|k| -(1.0 - (k as f64 + 0.5) / count as f64).ln()).collect();
        let exact = -SELDOM.ln();
        assert!((tail_bound(&sorted) / exact - 1.0).abs() < 0.02);
    }

    #[test]
    fn axes_cover_their_ranges() {
        for (kind, range) in [(InputKind::Angle, [-1.0, 2.5]), (InputKind::Line, [0.3, 0.9])] {
            let axis = axis(kind, range, PAIR);
            for k in 0..=100 {
                let value = range[0] + (range[1] - range[0]) * f64::from(k) / 100.0;
                let sum: f64 = axis.active(value).grade.iter().sum();
                assert!((sum - 1.0).abs() < 1e-12, "{kind:?} {value} {sum}");
            }
        }
        assert!(axis(InputKind::Angle, [-6.0, 6.0], FINE).closed);
    }
}
