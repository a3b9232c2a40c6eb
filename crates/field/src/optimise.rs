//! Maximising a smooth function within bounds: steps that are projected onto them (Bertsekas 1982) and shortened until they
//! bring enough; and quasi-Newton with a dense inverse Hessian (BFGS) where gradients are all that is known.

use crate::FieldError;
use crate::evidence::Score;
use crate::hyper::Range;

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Evaluations at the most.
    pub evaluations: usize,
    /// A step that gains less than this, in nats, is the last.
    pub gain: f64,
}

/// The best point found.
#[derive(Debug, Clone)]
pub struct Optimum {
    pub point: Vec<f64>,
    pub value: f64,
    pub evaluations: usize,
}

/// A step that was made.
pub struct Step<T> {
    /// Where it led.
    pub point: Vec<f64>,
    /// What the function is there.
    pub found: T,
    /// Its share of what was asked for.
    pub length: f64,
}

/// Longest step in any logarithm: a factor of about four.
pub const LONGEST_STEP: f64 = 1.4;
/// Share of the promised gain that a step must bring (Armijo 1966).
const SUFFICIENT: f64 = 1e-4;

/// A search within bounds for the maximum of a function whose values tell a score.
pub struct Search<'a, F> {
    pub function: F,
    pub ranges: &'a [Range],
    pub limits: Limits,
    pub evaluations: usize,
}

/// Maximises `function` over logarithms that start at `start`.
///
/// # Errors
/// Those of the function at the start; elsewhere a point where it fails counts as infinitely bad, except when the
/// caller asked to stop.
pub fn maximise<F>(
    function: F,
    start: &[f64],
    ranges: &[Range],
    limits: Limits,
) -> Result<Optimum, FieldError>
where
    F: FnMut(&[f64]) -> Result<Score, FieldError>,
{
    Search { function, ranges, limits, evaluations: 0 }.run(start)
}

impl<F: FnMut(&[f64]) -> Result<Score, FieldError>> Search<'_, F> {
    fn run(&mut self, start: &[f64]) -> Result<Optimum, FieldError> {
        let mut point = clamped(start, self.ranges);
        let mut here = self.evaluate(&point)?;
        let mut fresh = true;
        let mut inverse = Inverse::identity(point.len(), 0.1);
        while self.evaluations < self.limits.evaluations {
            let free = free(&point, &here.gradient, self.ranges);
            let direction = limited(inverse.times(&here.gradient, &free));
            let Some(Step { point: next, found: score, .. }) = self.line_search(&point, &here, &direction)?
            else {
                if fresh {
                    break;
                }
                inverse = Inverse::identity(point.len(), 0.02);
                fresh = true;
                continue;
            };
            let gain = score.value - here.value;
            let moved: Vec<f64> = next.iter().zip(&point).map(|(a, b)| a - b).collect();
            let turned: Vec<f64> = here.gradient.iter().zip(&score.gradient).map(|(a, b)| a - b).collect();
            inverse.update(&moved, &turned, fresh);
            fresh = false;
            (point, here) = (next, score);
            if gain < self.limits.gain {
                break;
            }
        }
        Ok(Optimum { point, value: here.value, evaluations: self.evaluations })
    }
}

impl<T: AsRef<Score>, F: FnMut(&[f64]) -> Result<T, FieldError>> Search<'_, F> {
    /// The function at a point.
    ///
    /// # Errors
    /// Those of the function.
    pub fn evaluate(&mut self, point: &[f64]) -> Result<T, FieldError> {
        self.evaluations += 1;
        (self.function)(point)
    }

    /// The first of ever shorter steps that brings enough, by quadratic interpolation.
    ///
    /// # Errors
    /// Those of the function, but for points that are infinitely bad.
    pub fn line_search(
        &mut self,
        point: &[f64],
        here: &Score,
        direction: &[f64],
    ) -> Result<Option<Step<T>>, FieldError> {
        let mut length = 1.0;
        for _ in 0..8 {
            let next: Vec<f64> = point.iter().zip(direction).map(|(x, d)| x + length * d).collect();
            let next = clamped(&next, self.ranges);
            let promised: f64 =
                next.iter().zip(point).zip(&here.gradient).map(|((a, b), g)| (a - b) * g).sum();
            if promised <= 0.0 {
                return Ok(None);
            }
            match self.evaluate(&next) {
                Ok(found) if found.as_ref().value >= here.value + SUFFICIENT * promised => {
                    return Ok(Some(Step { point: next, found, length }));
                }
                Ok(found) => {
                    let curvature = promised - (found.as_ref().value - here.value);
                    length *= (0.5 * promised / curvature).clamp(0.1, 0.5);
                }
                Err(FieldError::NotPositiveDefinite { .. }) => length *= 0.2,
                Err(error) => return Err(error),
            }
            if self.evaluations >= self.limits.evaluations {
                break;
            }
        }
        Ok(None)
    }
}

/// A point within the bounds.
pub fn clamped(point: &[f64], ranges: &[Range]) -> Vec<f64> {
    point.iter().zip(ranges).map(|(x, range)| x.clamp(range.low.ln(), range.high.ln())).collect()
}

/// Coordinates that are not held at a bound by the gradient.
pub fn free(point: &[f64], gradient: &[f64], ranges: &[Range]) -> Vec<bool> {
    let held = |k: usize| {
        (point[k] <= ranges[k].low.ln() && gradient[k] < 0.0)
            || (point[k] >= ranges[k].high.ln() && gradient[k] > 0.0)
    };
    (0..point.len()).map(|k| !held(k)).collect()
}

fn limited(mut direction: Vec<f64>) -> Vec<f64> {
    let longest = direction.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    if longest > LONGEST_STEP {
        direction.iter_mut().for_each(|x| *x *= LONGEST_STEP / longest);
    }
    direction
}

/// A symmetric positive definite matrix.
struct Inverse {
    size: usize,
    entries: Vec<f64>,
}

impl Inverse {
    fn identity(size: usize, scale: f64) -> Self {
        let entries = (0..size * size).map(|k| if k / size == k % size { scale } else { 0.0 }).collect();
        Self { size, entries }
    }

    fn times(&self, vector: &[f64], free: &[bool]) -> Vec<f64> {
        let row = |i: usize| {
            (0..self.size)
                .filter(|&j| free[j])
                .map(|j| self.entries[i * self.size + j] * vector[j])
                .sum::<f64>()
        };
        (0..self.size).map(|i| if free[i] { row(i) } else { 0.0 }).collect()
    }

    /// BFGS update from a step and the fall of the gradient along it; skipped where curvature is not positive.
    fn update(&mut self, moved: &[f64], turned: &[f64], first: bool) {
        let curvature: f64 = moved.iter().zip(turned).map(|(s, y)| s * y).sum();
        let size: f64 = turned.iter().map(|y| y * y).sum();
        if curvature <= 1e-10 * size.sqrt() {
            return;
        }
        if first {
            *self = Self::identity(self.size, curvature / size);
        }
        let all = vec![true; self.size];
        let spread = self.times(turned, &all);
        let inner: f64 = spread.iter().zip(turned).map(|(a, b)| a * b).sum();
        let factor = (1.0 + inner / curvature) / curvature;
        for i in 0..self.size {
            for j in 0..self.size {
                self.entries[i * self.size + j] +=
                    factor * moved[i] * moved[j] - (moved[i] * spread[j] + spread[i] * moved[j]) / curvature;
            }
        }
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use truearm_kinematics::Cancelled;

    fn ranges(high: f64) -> Vec<Range> {
        vec![Range { start: 1.0, low: 1e-3, high, spread: f64::INFINITY }; 4]
    }

    /// A curved valley with its maximum at logarithms 0.5.
    fn valley(point: &[f64]) -> Result<Score, FieldError> {
        let weights = [1.0, 10.0, 100.0, 3.0];
        let mut value = 0.0;
        let mut gradient = vec![0.0; 4];
        for k in 0..4 {
            let x = point[k] - 0.5;
            value -= weights[k] * (x.exp() - x - 1.0);
            gradient[k] = -weights[k] * (x.exp() - 1.0);
        }
        Ok(Score { value, gradient })
    }

    #[test]
    fn finds_the_maximum() {
        let limits = Limits { evaluations: 200, gain: 1e-12 };
        let optimum = maximise(valley, &[0.0; 4], &ranges(1e3), limits).unwrap();
        assert!(optimum.point.iter().all(|x| (x - 0.5).abs() < 1e-4), "{optimum:?}");
    }

    #[test]
    fn stays_within_bounds() {
        let limits = Limits { evaluations: 200, gain: 1e-12 };
        let ranges = ranges(1.2);
        let mut seen = Vec::new();
        let watched = |point: &[f64]| {
            seen.extend(point.to_vec());
            valley(point)
        };
        let optimum = maximise(watched, &[9.0; 4], &ranges, limits).unwrap();
        assert!(optimum.point.iter().all(|x| (x - 1.2_f64.ln()).abs() < 1e-9), "{optimum:?}");
        assert!(seen.iter().all(|x| (1e-3_f64.ln()..=1.2_f64.ln()).contains(x)));
    }

    #[test]
    fn a_bound_holds_one_coordinate_and_not_the_others() {
        let mut ranges = ranges(1e3);
        ranges[1].high = 1.1;
        let limits = Limits { evaluations: 200, gain: 1e-12 };
        let optimum = maximise(valley, &[-1.0; 4], &ranges, limits).unwrap();
        assert!((optimum.point[1] - 1.1_f64.ln()).abs() < 1e-12);
        assert!([0, 2, 3].iter().all(|&k| (optimum.point[k] - 0.5_f64).abs() < 1e-4), "{optimum:?}");
    }

    #[test]
    fn points_where_the_function_fails_are_kept_away_from() {
        let fails_beyond = |point: &[f64]| {
            if point[0] > 0.4 { Err(FieldError::NotPositiveDefinite { rows: 1 }) } else { valley(point) }
        };
        let limits = Limits { evaluations: 200, gain: 1e-12 };
        let optimum = maximise(fails_beyond, &[-1.0; 4], &ranges(1e3), limits).unwrap();
        assert!(optimum.point[0] <= 0.4 && optimum.value > valley(&[-1.0; 4]).unwrap().value + 10.0);
        let refused = maximise(fails_beyond, &[1.0; 4], &ranges(1e3), limits).unwrap_err();
        assert_eq!(refused, FieldError::NotPositiveDefinite { rows: 1 });
    }

    #[test]
    fn a_request_to_stop_is_passed_on() {
        let mut left = 5;
        let stops = |point: &[f64]| {
            left -= 1;
            if left == 0 { Err(FieldError::Cancelled(Cancelled)) } else { valley(point) }
        };
        let limits = Limits { evaluations: 200, gain: 1e-12 };
        let stopped = maximise(stops, &[0.0; 4], &ranges(1e3), limits).unwrap_err();
        assert_eq!(stopped, FieldError::Cancelled(Cancelled));
        assert_eq!(left, 0, "nothing is evaluated after the request");
    }

    #[test]
    fn evaluations_are_bounded() {
        let limits = Limits { evaluations: 3, gain: 0.0 };
        let optimum = maximise(valley, &[-3.0; 4], &ranges(1e3), limits).unwrap();
        assert_eq!(optimum.evaluations, 3);
        assert!(optimum.value > valley(&[-3.0; 4]).unwrap().value);
    }
}
