//! Maximising the evidence within bounds by Newton's steps.
//!
//! The average information stands for the second derivatives (AI-REML; Gilmour, Thompson and Cullis 1995). What it misses
//! is learned from how the gradient turned along the steps, as Dennis, Gay and Welsch (1981) do for least squares:
//! amplitudes and length scales that can stand for each other bend in ways that the information alone shows too little of.

use faer::{Mat, Par};
use truearm_estimate::dense::Cholesky;

use crate::FieldError;
use crate::evidence::Informed;
use crate::hyper::Range;
use crate::optimise::{LONGEST_STEP, Limits, Optimum, Search, Step, clamped, free};

/// Added to the diagonal where a step cannot be solved for or would be too long, at the least: far below what a prior has.
const DAMPING: f64 = 1e-2;
const MORE_DAMPING: f64 = 3.0;

/// Maximises `function` over logarithms from `start`; a step that promises less than the limits ask for is not made.
///
/// # Errors
/// Those of the function at the start; elsewhere a point where it fails counts as infinitely bad, except when the
/// caller asked to stop.
pub fn climb<F>(function: F, start: &[f64], ranges: &[Range], limits: Limits) -> Result<Optimum, FieldError>
where
    F: FnMut(&[f64]) -> Result<Informed, FieldError>,
{
    let mut search = Search { function, ranges, limits, evaluations: 0 };
    let mut point = clamped(start, ranges);
    let mut here = search.evaluate(&point)?;
    let mut missed = Mat::zeros(point.len(), point.len());
    while search.evaluations < limits.evaluations {
        let bend = &here.information + &missed;
        let gradient = &here.score.gradient;
        let direction = step(&bend, gradient, &point, ranges);
        let promised = dot(gradient, &direction) - 0.5 * dot(&times(&bend, &direction), &direction);
        if promised.is_nan() || promised < limits.gain {
            break;
        }
        let Some(Step { point: next, found: there, length }) =
            search.line_search(&point, &here.score, &direction)?
        else {
            break;
        };
        let moved: Vec<f64> = next.iter().zip(&point).map(|(a, b)| a - b).collect();
        learn(&mut missed, &moved, &here, &there);
        let gain = there.score.value - here.score.value;
        (point, here) = (next, there);
        // A step that had to be shortened shows that the bend was wrong, not that there is nothing left to gain.
        if gain < limits.gain && length == 1.0 {
            break;
        }
    }
    Ok(Optimum { point, value: here.score.value, evaluations: search.evaluations })
}

/// Newton's step within the bounds. A coordinate that would leave them goes to its bound, the first one to get there at a
/// time, and the others are solved for again: what is left of a step whose parts are cut off may lead down.
fn step(bend: &Mat<f64>, gradient: &[f64], point: &[f64], ranges: &[Range]) -> Vec<f64> {
    let mut free = free(point, gradient, ranges);
    let mut step = vec![0.0; point.len()];
    loop {
        solve(bend, gradient, &free, &mut step);
        let Some((k, way)) = first_to_leave(point, ranges, &step, &free) else { return step };
        (step[k], free[k]) = (way, false);
    }
}

/// The coordinate that a step takes out of the bounds first, and its way to the bound.
fn first_to_leave(point: &[f64], ranges: &[Range], step: &[f64], free: &[bool]) -> Option<(usize, f64)> {
    let way = |k: usize| {
        let (to, low, high) = (point[k] + step[k], ranges[k].low.ln(), ranges[k].high.ln());
        (free[k] && !(low..=high).contains(&to)).then(|| (k, to.clamp(low, high) - point[k]))
    };
    let leaving = (0..step.len()).filter_map(way);
    leaving.min_by(|&(a, to_a), &(b, to_b)| (to_a / step[a]).total_cmp(&(to_b / step[b])))
}

/// Writes the free coordinates of Newton's step beside those that are fixed, damped (Levenberg and Marquardt) until it can
/// be solved and no part of it is too long; zeros where there is no such damping.
fn solve(bend: &Mat<f64>, gradient: &[f64], free: &[bool], step: &mut [f64]) {
    let kept: Vec<usize> = (0..free.len()).filter(|&k| free[k]).collect();
    kept.iter().for_each(|&k| step[k] = 0.0);
    let fixed = times(bend, step);
    let left: Vec<f64> = kept.iter().map(|&k| gradient[k] - fixed[k]).collect();
    let mut damping = 0.0;
    while damping < f64::MAX {
        let damped = Mat::from_fn(kept.len(), kept.len(), |i, j| {
            bend[(kept[i], kept[j])] + if i == j { damping } else { 0.0 }
        });
        let found = Cholesky::new(damped, Par::Seq).map(|factor| factor.solve_vector(&left));
        if let Some(found) = found.filter(|step| step.iter().all(|x| x.abs() <= LONGEST_STEP)) {
            kept.iter().zip(found).for_each(|(&k, x)| step[k] = x);
            break;
        }
        damping = (MORE_DAMPING * damping).max(DAMPING);
    }
}

/// Adds what the information missed along a step (BFGS update of the two together); what was known before counts for no
/// more than this step shows of it.
fn learn(missed: &mut Mat<f64>, moved: &[f64], here: &Informed, there: &Informed) {
    let gradients = here.score.gradient.iter().zip(&there.score.gradient);
    let turned: Vec<f64> = gradients.map(|(a, b)| a - b).collect();
    let informed = times(&there.information, moved);
    let shown = dot(&turned, moved) - dot(&informed, moved);
    let known = dot(&times(missed, moved), moved);
    if known.abs() > shown.abs() {
        *missed *= faer::Scale(shown.abs() / known.abs());
    }
    let bent: Vec<f64> = times(missed, moved).iter().zip(&informed).map(|(a, b)| a + b).collect();
    let (before, after) = (dot(&bent, moved), dot(&turned, moved));
    if before > 0.0 && after > 0.0 {
        for i in 0..moved.len() {
            for j in 0..moved.len() {
                missed[(i, j)] += turned[i] * turned[j] / after - bent[i] * bent[j] / before;
            }
        }
    }
}

fn times(matrix: &Mat<f64>, vector: &[f64]) -> Vec<f64> {
    (0..matrix.nrows()).map(|i| (0..vector.len()).map(|j| matrix[(i, j)] * vector[j]).sum()).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::evidence::Score;
    use truearm_kinematics::Cancelled;

    const LIMITS: Limits = Limits { evaluations: 100, gain: 1e-12 };

    fn ranges(high: f64) -> Vec<Range> {
        vec![Range { start: 1.0, low: 1e-3, high, spread: f64::INFINITY }; 3]
    }

    /// A curved ridge with its maximum at the logarithms (0.5, 0.25, 0.5); the information knows half of how it bends.
    fn ridge(point: &[f64]) -> Result<Informed, FieldError> {
        let (across, along, third) = (point[1] - point[0].powi(2), point[0] - 0.5, point[2] - 0.5);
        let value = -50.0 * across.powi(2) - along.powi(2) - third.exp() + third;
        let gradient = vec![200.0 * across * point[0] - 2.0 * along, -100.0 * across, 1.0 - third.exp()];
        let slope = [-2.0 * point[0], 1.0, 0.0];
        let information = Mat::from_fn(3, 3, |i, j| {
            50.0 * slope[i] * slope[j] + if i == j { [1.0, 0.0, 0.5 * third.exp()][i] } else { 0.0 }
        });
        Ok(Informed { score: Score { value, gradient }, information })
    }

    #[test]
    fn finds_the_maximum_in_fewer_steps_than_without_the_information() {
        let start = [-1.0, 1.0, -1.0];
        let found = climb(ridge, &start, &ranges(1e3), LIMITS).unwrap();
        let wanted = [0.5, 0.25, 0.5];
        assert!(found.point.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}");
        let plain = crate::optimise::maximise(
            |point| ridge(point).map(|there| there.score),
            &start,
            &ranges(1e3),
            LIMITS,
        );
        assert!(found.evaluations < plain.unwrap().evaluations, "{found:?}");
    }

    #[test]
    fn stays_within_bounds_and_finds_the_rest() {
        let high = 1.2;
        let found = climb(ridge, &[5.0; 3], &ranges(high), LIMITS).unwrap();
        let held = high.ln();
        let across = 2.0 * held;
        assert!((found.point[0] - held).abs() < 1e-9 && (found.point[2] - held).abs() < 1e-9, "{found:?}");
        assert!((found.point[1] - (0.5 * across).powi(2)).abs() < 1e-6, "{found:?}");
    }

    /// A step that is cut off at a bound alone would lead down from where this starts.
    #[test]
    fn a_bound_that_a_long_step_would_cross_is_no_end() {
        let (bend, top) = ([[100.0, 90.0], [90.0, 100.0]], [4.789_473_684_210_526, -4.210_526_315_789_474]);
        let bowl = |point: &[f64]| {
            let off = [point[0] - top[0], point[1] - top[1]];
            let gradient: Vec<f64> = bend.iter().map(|row| -(row[0] * off[0] + row[1] * off[1])).collect();
            let value = 0.5 * (gradient[0] * off[0] + gradient[1] * off[1]);
            Ok(Informed {
                score: Score { value, gradient },
                information: Mat::from_fn(2, 2, |i, j| bend[i][j]),
            })
        };
        let near = [Range { high: 0.01_f64.exp(), ..ranges(1e3)[0] }, ranges(1e3)[1]];
        let found = climb(bowl, &[0.0; 2], &near, LIMITS).unwrap();
        // Where the slope by the second coordinate is zero on the first one's bound.
        let second = top[1] - 0.9 * (0.01 - top[0]);
        assert!((found.point[0] - 0.01).abs() < 1e-12 && (found.point[1] - second).abs() < 1e-9, "{found:?}");
        assert!(found.evaluations <= 3, "{found:?}");
    }

    #[test]
    fn a_flat_direction_brings_no_long_step() {
        let flat = |point: &[f64]| {
            assert!(point.iter().all(|x| x.abs() <= LONGEST_STEP));
            let score = Score { value: -point[0].powi(2), gradient: vec![-2.0 * point[0], 0.0, 1e-30] };
            Ok(Informed { score, information: Mat::from_fn(3, 3, |i, j| if i + j == 0 { 2.0 } else { 0.0 }) })
        };
        let found = climb(flat, &[1.0, 0.0, 0.0], &ranges(1e3), LIMITS).unwrap();
        assert!(found.point[0].abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn what_promises_too_little_is_not_tried() {
        let limits = Limits { gain: 1.0, ..LIMITS };
        let near = climb(ridge, &[0.5, 0.3, 0.5], &ranges(1e3), limits).unwrap();
        assert_eq!((near.evaluations, near.point), (1, vec![0.5, 0.3, 0.5]));
    }

    /// The first steps along the ridge are shortened and bring little.
    #[test]
    fn a_shortened_step_that_brings_little_is_not_the_last() {
        let limits = Limits { gain: 0.01, ..LIMITS };
        let start = [-1.0, 1.0, -1.0];
        let (soon, late) = (
            climb(ridge, &start, &ranges(1e3), limits).unwrap(),
            climb(ridge, &start, &ranges(1e3), LIMITS).unwrap(),
        );
        assert!(soon.evaluations < late.evaluations && late.value - soon.value < 0.1, "{soon:?} {late:?}");
    }

    #[test]
    fn slopes_without_numbers_end_a_search() {
        let nowhere = |point: &[f64]| {
            let there = ridge(point)?;
            Ok(Informed { score: Score { gradient: vec![f64::NAN; 3], ..there.score }, ..there })
        };
        let found = climb(nowhere, &[-1.0, 1.0, -1.0], &ranges(1e3), LIMITS).unwrap();
        assert_eq!(found.evaluations, 1);
    }

    /// With what was learned the slopes along a step turn as they were seen to (secant equation); nothing is learned of a
    /// step along which they do not fall.
    #[test]
    fn what_the_information_misses_is_learned_along_steps() {
        let (from, to) = ([-1.0, 1.0, -1.0], [-0.9, 0.8, -0.7]);
        let (here, there) = (ridge(&from).unwrap(), ridge(&to).unwrap());
        let moved: Vec<f64> = to.iter().zip(from).map(|(a, b)| a - b).collect();
        let mut missed = Mat::zeros(3, 3);
        learn(&mut missed, &moved, &here, &there);
        let bent = times(&(&there.information + &missed), &moved);
        for (k, bent) in bent.iter().enumerate() {
            let turned = here.score.gradient[k] - there.score.gradient[k];
            assert!((bent - turned).abs() < 1e-9 * turned.abs().max(1.0), "{bent} {turned}");
        }
        let back: Vec<f64> = moved.iter().map(|x| -x).collect();
        let mut nothing = Mat::zeros(3, 3);
        learn(&mut nothing, &back, &here, &there);
        assert!(times(&nothing, &moved).iter().all(|x| *x == 0.0));
    }

    #[test]
    fn points_where_it_fails_are_kept_away_from_and_requests_to_stop_are_passed_on() {
        let fails = |point: &[f64]| {
            if point[0] > 0.4 { Err(FieldError::NotPositiveDefinite { rows: 1 }) } else { ridge(point) }
        };
        let found = climb(fails, &[-1.0, 1.0, 0.0], &ranges(1e3), LIMITS).unwrap();
        assert!(found.point[0] > 0.0 && found.point[0] <= 0.4, "{found:?}");
        let mut left = 3;
        let stops = |point: &[f64]| {
            left -= 1;
            if left == 0 { Err(FieldError::Cancelled(Cancelled)) } else { ridge(point) }
        };
        let stopped = climb(stops, &[-1.0, 1.0, -1.0], &ranges(1e3), LIMITS).unwrap_err();
        assert_eq!((stopped, left), (FieldError::Cancelled(Cancelled), 0));
    }
}
