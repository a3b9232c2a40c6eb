//! Fitting the factor of a [`Leverage`] to exact standard deviations, by least squares of the logarithms.

use rayon::prelude::*;
use truearm_bank::{FACTOR_COLUMNS, Leverage, MOVED, squared};
use truearm_kinematics::{Cancel, Chain, Isa, Kernel, Lane, dispatch};

use crate::FieldError;
use crate::evidence::Score;
use crate::hyper::Range;
use crate::optimise::{Limits, maximise};

/// Samples of one piece of work.
const PIECE: usize = 256;
/// The search for a factor ends after so many evaluations, or with a step that gains less, in nats.
const SEARCH: Limits = Limits { evaluations: 250, gain: 0.5 };
/// Bounds of the factor's entries, in units of their mean size: their logarithms, no more than 69 either way, are what counts.
const ENTRIES: Range = Range { start: 1.0, low: 1e-30, high: 1e30, spread: f64::INFINITY };
/// Share of the largest motion below which one is rounding: such unknowns do not move the point.
const ROUNDING: f64 = 1e-9;
/// Squares of what does not move a point at all, m^2; logarithms are still taken.
const STILL: f64 = 1e-30;

/// The factor whose deviations follow standard deviations `std` (n,), m, at `inputs` (n, `width`), whose first J are
/// the joint values.
///
/// # Errors
/// As [`Leverage::new`] and [`Leverage::check_inputs`], [`FieldError::Length`], or on request.
pub fn fit_leverage(
    to_flange: &Chain,
    point: [f64; 3],
    (inputs, width): (&[f64], usize),
    std: &[f64],
    cancel: &Cancel,
) -> Result<Leverage, FieldError> {
    let rows = to_flange.parameter_count() + MOVED;
    let unknown = Leverage::new(to_flange, point, &vec![0.0; rows * FACTOR_COLUMNS])?;
    unknown.check_inputs(width)?;
    if inputs.len() != std.len() * width {
        let (what, found) = ("inputs of standard deviations", inputs.len());
        return Err(FieldError::Length { what, found, expected: std.len() * width });
    }
    let mut motions = unknown.motions(inputs, width);
    let sizes = sizes(&motions, rows);
    for (at, motion) in motions.iter_mut().enumerate() {
        let size = sizes[at % rows];
        motion.iter_mut().for_each(|value| *value = if size > 0.0 { *value / size } else { 0.0 });
    }
    let logs: Vec<f64> = std.iter().map(|std| 2.0 * std.ln()).collect();
    let targets = Targets { motions: &motions, rows, logs: &logs };
    let start = targets.start();
    let ranges = vec![ENTRIES; start.len()];
    let scale = targets.scale(&start);
    let score = |entries: &[f64]| {
        cancel.check()?;
        Ok(targets.score(entries, scale))
    };
    let found = maximise(score, &start, &ranges, SEARCH)?;
    let entry = |(k, entry): (usize, &f64)| {
        let size = sizes[k / FACTOR_COLUMNS];
        if size > 0.0 { scale * entry / size } else { 0.0 }
    };
    let factor: Vec<f64> = found.point.iter().enumerate().map(entry).collect();
    Ok(Leverage::new(to_flange, point, &factor)?)
}

/// Root mean squares of the motions by each unknown; zero where it moves nothing.
fn sizes(motions: &[[f64; 3]], rows: usize) -> Vec<f64> {
    let mut squares = vec![0.0; rows];
    for (at, motion) in motions.iter().enumerate() {
        squares[at % rows] += motion.iter().map(|value| value * value).sum::<f64>();
    }
    let count = (motions.len() / rows).max(1) as f64;
    let sizes: Vec<f64> = squares.iter().map(|sum| (sum / count).sqrt()).collect();
    let least = ROUNDING * sizes.iter().copied().fold(0.0, f64::max);
    sizes.into_iter().map(|size| if size > least { size } else { 0.0 }).collect()
}

/// What a factor is to follow: logarithms (n,) of variances, with motions (n, rows).
struct Targets<'a> {
    motions: &'a [[f64; 3]],
    rows: usize,
    logs: &'a [f64],
}

impl Targets<'_> {
    /// Entries (rows, 8) of which none is like another.
    fn start(&self) -> Vec<f64> {
        (0..self.rows * FACTOR_COLUMNS).map(|k| ((k * k + 1) as f64).sin()).collect()
    }

    /// What entries are multiplied by for their deviations to be as large as the targets in the mean.
    fn scale(&self, entries: &[f64]) -> f64 {
        let off = self.pieces(entries, 1.0).iter().map(|piece| piece.off).sum::<f64>();
        (-0.5 * off / self.logs.len().max(1) as f64).exp()
    }

    /// The likelihood of the entries, were what is left in the logarithms of one unknown size.
    fn score(&self, entries: &[f64], scale: f64) -> Score {
        let pieces = self.pieces(entries, scale);
        let left = pieces.iter().map(|piece| piece.squares).sum::<f64>().max(f64::MIN_POSITIVE);
        let count = self.logs.len() as f64;
        let mut gradient = vec![0.0; entries.len()];
        for piece in &pieces {
            for (sum, row) in gradient.chunks_exact_mut(FACTOR_COLUMNS).zip(&piece.gradient) {
                sum.iter_mut().zip(row.0).for_each(|(sum, value)| *sum -= count / left * value);
            }
        }
        Score { value: -0.5 * count * (left / count).ln(), gradient }
    }

    /// Sums over samples, in pieces that do not depend on the number of threads.
    fn pieces(&self, entries: &[f64], scale: f64) -> Vec<Piece> {
        let rows: Vec<Lane> = entries
            .chunks_exact(FACTOR_COLUMNS)
            .map(|row| Lane::from_fn(|column| scale * row[column]))
            .collect();
        let samples = self.motions.par_chunks(PIECE * self.rows).zip(self.logs.par_chunks(PIECE));
        samples.map(|(motions, logs)| dispatch(Sum { factor: &rows, scale, motions, logs })).collect()
    }
}

/// Sums over some samples: of what logarithms are too large by, of its square, and half the square's gradient.
struct Piece {
    off: f64,
    squares: f64,
    gradient: Vec<Lane>,
}

struct Sum<'a> {
    factor: &'a [Lane],
    scale: f64,
    motions: &'a [[f64; 3]],
    logs: &'a [f64],
}

impl Kernel for Sum<'_> {
    type Output = Piece;

    #[inline(always)]
    fn run<I: Isa>(self) -> Piece {
        let Self { factor, scale, motions, logs } = self;
        let mut piece = Piece { off: 0.0, squares: 0.0, gradient: vec![Lane::ZERO; factor.len()] };
        for (motions, log) in motions.chunks_exact(factor.len()).zip(logs) {
            let mut moved = [Lane::ZERO; 3];
            for (motion, factor) in motions.iter().zip(factor) {
                for i in 0..3 {
                    moved[i] = I::mul_add(Lane::splat(motion[i]), *factor, moved[i]);
                }
            }
            let variance = squared::<I>(&moved).sum() + STILL;
            let off = variance.ln() - log;
            piece.off += off;
            piece.squares += off * off;
            let slope = Lane::splat(2.0 * off * scale / variance);
            for value in &mut moved {
                *value = *value * slope;
            }
            for (motion, sum) in motions.iter().zip(&mut piece.gradient) {
                for i in 0..3 {
                    *sum = I::mul_add(Lane::splat(motion[i]), moved[i], *sum);
                }
            }
        }
        piece
    }
}
