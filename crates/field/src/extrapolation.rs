//! How far to trust the field where nothing was measured.
//!
//! Leave-one-out residuals say nothing of whole parts of the space without data, where stationary kernels learned elsewhere
//! are too sure of themselves. The tails of every input are left out in turn and predicted from the rest; the arm's
//! standard deviation is scaled until 95 % of the predictions hold in four fifths of the tails. The errors of one tail are
//! nearly one draw: what one needs tells nothing of what the next will, and the worst of many makes all others too
//! wide. A row tells of the factor what its variance is the arm's part of: a coarse one next to nothing, whatever it misses by chance.

use std::f64::consts::TAU;

use truearm_bank::InputKind;
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::data_space::{DataSpace, LeftOut};
use crate::hyper::Hyper;
use crate::model::Model;
use crate::outliers::QUANTILE_95;
use crate::training::Training;

/// Share of the poses that make a tail.
const TAIL: f64 = 0.2;
/// Values are of one level up to this share of how far apart they would stand if they were spread evenly.
const LEVEL: f64 = 0.25;
/// Fewer poses do not tell.
const FEWEST_POSES: usize = 50;
/// Largest factor: beyond, the field knows nothing.
const LARGEST: f64 = 6.0;
/// Share of its predictions that holds in a tail.
const HELD: f64 = 0.95;
/// Share of the tails in which so many hold.
const TAILS: f64 = 0.8;

/// Factor on the standard deviation of the arm's part, at least one.
///
/// # Errors
/// [`FieldError`].
pub fn extrapolation_factor(
    training: &Training,
    hyper: &Hyper,
    degree: usize,
    cancel: &Cancel,
) -> Result<f64, FieldError> {
    if training.pose_count() < FEWEST_POSES {
        return Ok(1.0);
    }
    let space = DataSpace::new(Model::new(training.clone(), hyper.widened(), degree), cancel)?;
    let tails = space.leave_blocks_out(&training.residual, &tails(training))?;
    Ok(factor_of_most(&tails))
}

/// The least factor with which enough predictions hold in enough of the tails.
fn factor_of_most(tails: &[Vec<LeftOut>]) -> f64 {
    let mut factors: Vec<f64> = tails.iter().map(|rows| factor(rows)).collect();
    factors.sort_by(f64::total_cmp);
    let enough = (TAILS * factors.len() as f64).ceil() as usize;
    factors.get(enough.saturating_sub(1)).copied().unwrap_or(1.0)
}

/// The least factor with which enough of a tail's predictions hold, each for as much as it tells.
fn factor(rows: &[LeftOut]) -> f64 {
    let all: f64 = rows.iter().map(told).sum();
    let holds = |factor: f64| {
        let within: f64 = rows.iter().filter(|row| is_within(row, factor)).map(told).sum();
        within >= HELD * all
    };
    let (mut low, mut high) = (1.0, LARGEST);
    if holds(low) {
        return low;
    }
    while high - low > 0.01 {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    high
}

/// Twice the information of a row on the logarithm of the factor's square, at a factor of one.
fn told(row: &LeftOut) -> f64 {
    if row.known > 0.0 { (row.known / (row.noise + row.known)).powi(2) } else { 0.0 }
}

fn is_within(row: &LeftOut, factor: f64) -> bool {
    let variance = row.noise + row.known * factor * factor;
    row.residual.abs() <= QUANTILE_95 * variance.sqrt()
}

/// Poses with the largest and the smallest values of each input, those of an angle to both sides of the widest gap on
/// its circle.
fn tails(training: &Training) -> Vec<Vec<usize>> {
    let mut tails = Vec::new();
    for (k, input) in training.inputs.iter().enumerate() {
        let values = (0..training.pose_count()).map(|pose| training.values_of(pose)[k]);
        let mut order = match input.kind {
            InputKind::Line => ordered(values),
            InputKind::Angle => ordered_on_circle(values),
        };
        for _ in 0..2 {
            if let Some(count) = whole_levels(&order) {
                tails.push(order[..count].iter().map(|&(_, pose)| pose).collect());
            }
            order.reverse();
        }
    }
    tails
}

/// Values and whose they are, from the least to the largest.
fn ordered(values: impl Iterator<Item = f64>) -> Vec<(f64, usize)> {
    let mut order: Vec<(f64, usize)> = values.zip(0..).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order
}

/// The same of angles on one turn, which begins behind the widest gap.
fn ordered_on_circle(values: impl Iterator<Item = f64>) -> Vec<(f64, usize)> {
    let mut order = ordered(values.map(|value| value.rem_euclid(TAU)));
    let before = |place: usize| match place {
        0 => order[order.len() - 1].0 - TAU,
        _ => order[place - 1].0,
    };
    let gap = |place: usize| order[place].0 - before(place);
    let start = (0..order.len()).max_by(|&a, &b| gap(a).total_cmp(&gap(b))).unwrap_or(0);
    order[..start].iter_mut().for_each(|(value, _)| *value += TAU);
    order.rotate_left(start);
    order
}

/// How many of the first poses make a tail: some [`TAIL`] of all, and no level of values with a part of its poses, as the
/// rest of it would tell what the tail holds. None where a level is of more than twice so many.
fn whole_levels(order: &[(f64, usize)]) -> Option<usize> {
    let (all, wanted) = (order.len() as f64, order.len() as f64 * TAIL);
    let apart = LEVEL * (order.last()?.0 - order.first()?.0).abs() / all;
    (1..order.len())
        .filter(|&count| count as f64 <= 2.0 * wanted && (order[count].0 - order[count - 1].0).abs() > apart)
        .min_by(|&a, &b| (a as f64 - wanted).abs().total_cmp(&(b as f64 - wanted).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tail of twenty rows that need the given factor, and one that needs any other.
    fn tail(factor: f64, noise: f64) -> Vec<LeftOut> {
        let row = |factor: f64| LeftOut {
            residual: QUANTILE_95 * (noise + factor * factor).sqrt(),
            noise,
            known: 1.0,
        };
        (0..19).map(|_| row(factor)).chain([row(100.0)]).collect()
    }

    fn poses(order: &[(f64, usize)]) -> Vec<usize> {
        order.iter().map(|&(_, pose)| pose).collect()
    }

    #[test]
    fn a_tail_is_of_whole_levels() {
        let spread = ordered((0..100).map(|k| f64::from(k) / 7.0));
        assert_eq!(whole_levels(&spread), Some(20));
        let payload = |loaded: usize| ordered((0..100).map(move |k| if k < loaded { 5.0 } else { 0.0 }));
        let tails = |mut order: Vec<(f64, usize)>| {
            let low = whole_levels(&order);
            order.reverse();
            (low, whole_levels(&order))
        };
        assert_eq!(tails(payload(30)), (None, Some(30)));
        assert_eq!(tails(payload(50)), (None, None));
        assert_eq!(tails(payload(0)), (None, None), "a joint that is still");
        // Four levels of a grid, as they are read back.
        let read = ordered((0..100).map(|k| f64::from(k % 4) + 1e-5 * f64::from(k)));
        assert_eq!(whole_levels(&read), Some(25));
    }

    #[test]
    fn whole_turns_leave_tails_as_they_are() {
        let angles: Vec<f64> = (0..50).map(|k| -1.0 + 0.1 * f64::from(k)).collect();
        let turned = angles.iter().zip(0..).map(|(angle, k)| angle + TAU * f64::from(k % 3 - 1));
        assert_eq!(poses(&ordered_on_circle(angles.iter().copied())), (0..50).collect::<Vec<_>>());
        assert_eq!(poses(&ordered_on_circle(turned)), (0..50).collect::<Vec<_>>());
    }

    #[test]
    fn four_fifths_of_the_tails_hold() {
        for noise in [0.0, 0.3] {
            let needed = |most: usize| {
                let tails: Vec<_> = (0..12).map(|k| tail(if k < most { 2.0 } else { 5.0 }, noise)).collect();
                factor_of_most(&tails)
            };
            assert!((needed(10) - 2.0).abs() < 0.02, "{}", needed(10));
            assert!((needed(9) - 5.0).abs() < 0.02, "{}", needed(9));
        }
    }

    #[test]
    fn rows_that_are_all_noise_do_not_count() {
        let coarse = LeftOut { residual: 2.2 * 30.0, noise: 900.0, known: 1.0 };
        let rows: Vec<LeftOut> = tail(1.5, 0.1).into_iter().take(19).chain((0..20).map(|_| coarse)).collect();
        assert!((factor(&rows) - 1.5).abs() < 0.02, "{}", factor(&rows));
        assert_eq!(factor(&[LeftOut { residual: 1.0, noise: 0.1, known: 0.0 }]), 1.0);
    }

    #[test]
    fn factors_are_at_least_one_and_have_an_end() {
        assert_eq!(factor_of_most(&[tail(0.2, 0.1), tail(0.5, 0.1)]), 1.0);
        assert_eq!(factor_of_most(&[tail(50.0, 0.1)]), LARGEST);
        assert_eq!(factor_of_most(&[]), 1.0);
    }
}
