//! Between joint values and the readings a controller shows: coupling, limits and whole turns.

use std::f64::consts::{PI, TAU};

use crate::error::InverseError;

/// How far outside its limits a reading may be found, rad or m: the rounding of a controller's numbers.
const SLACK: f64 = 1e-9;
/// Turns each way that are listed of a joint without limits.
const TURNS_WITHOUT_LIMITS: f64 = 1.0;
/// Readings of one branch that are listed with all their turns.
const MOST_TURNS: usize = 100_000;
/// How far two readings may differ and still be one solution, rad or m.
const SAME: f64 = 1e-6;

/// Coupling and limits of an arm with J joints.
#[derive(Debug, Clone)]
pub struct Readings {
    joints_from_readings: Vec<f64>,
    readings_from_joints: Vec<f64>,
    limits: Vec<[f64; 2]>,
    turns: Vec<bool>,
}

impl Readings {
    /// Couplings are J x J, row-major; `revolute` says which joint values are angles.
    ///
    /// # Errors
    /// [`InverseError::Length`] if a length does not fit.
    pub fn new(
        joints_from_readings: Vec<f64>,
        readings_from_joints: Vec<f64>,
        limits: Vec<[f64; 2]>,
        revolute: &[bool],
    ) -> Result<Readings, InverseError> {
        let count = revolute.len();
        for (name, got, wanted) in [
            ("the coupling", joints_from_readings.len(), count * count),
            ("the inverse coupling", readings_from_joints.len(), count * count),
            ("limits", limits.len(), count),
        ] {
            if got != wanted {
                return Err(InverseError::Length { name, got, wanted });
            }
        }
        let turns = (0..count)
            .map(|j| {
                (0..count).all(|i| {
                    let part: f64 = joints_from_readings[i * count + j];
                    if revolute[i] { part.fract() == 0.0 } else { part == 0.0 }
                })
            })
            .collect();
        Ok(Readings { joints_from_readings, readings_from_joints, limits, turns })
    }

    /// Number of joints.
    pub fn count(&self) -> usize {
        self.limits.len()
    }

    /// Lowest and highest reading of a joint that a search begins between: its limits; a turn of them, about zero as
    /// far as they allow, where the joint turns farther; as much where they are open.
    pub(crate) fn span(&self, joint: usize) -> [f64; 2] {
        let [low, high] = self.limits[joint];
        if self.turns[joint] && high - low > TAU || low.is_infinite() || high.is_infinite() {
            let first = (-PI).max(low).min(high - TAU);
            return [first, first + TAU];
        }
        [low, high]
    }

    /// Joint values of readings.
    pub fn joints(&self, readings: &[f64]) -> Vec<f64> {
        product(&self.joints_from_readings, readings)
    }

    /// Readings of joint values.
    pub fn readings(&self, joints: &[f64]) -> Vec<f64> {
        product(&self.readings_from_joints, joints)
    }

    /// The readings with each joint turned to lie within its limits and as near as can be to `near`.
    pub(crate) fn turned(&self, readings: &[f64], near: &[f64]) -> Option<Vec<f64>> {
        let turned = (0..self.count()).map(|j| {
            let [low, high] = self.limits[j];
            if !self.turns[j] {
                return self.within(j, readings[j]);
            }
            let wanted = ((near[j] - readings[j]) / TAU).round();
            let first = ((low - SLACK - readings[j]) / TAU).ceil();
            let last = ((high + SLACK - readings[j]) / TAU).floor();
            (first <= last).then(|| readings[j] + TAU * wanted.clamp(first, last))
        });
        turned.collect()
    }

    /// The middle of the limits; zero where there are none.
    pub(crate) fn middle(&self) -> Vec<f64> {
        let middle = |[low, high]: &[f64; 2]| {
            if low.is_finite() && high.is_finite() { 0.5 * (low + high) } else { 0.0 }
        };
        self.limits.iter().map(middle).collect()
    }

    /// All readings within limits that differ from these by whole turns; none if these cannot be turned in.
    ///
    /// # Errors
    /// [`InverseError::Turns`] where there are too many.
    pub(crate) fn all_turns(&self, readings: &[f64]) -> Result<Vec<Vec<f64>>, InverseError> {
        let turns: Vec<Option<[f64; 2]>> = (0..self.count()).map(|j| self.choices(j, readings[j])).collect();
        let counts = || turns.iter().flatten().map(|[first, last]| last - first + 1.0);
        if counts().any(|count| count < 1.0) {
            return Ok(Vec::new());
        }
        let count: f64 = counts().product();
        if count > MOST_TURNS as f64 {
            return Err(InverseError::Turns { count, most: MOST_TURNS });
        }
        let mut found = vec![Vec::new()];
        for ((j, &reading), turns) in readings.iter().enumerate().zip(turns) {
            let choices: Vec<f64> = match turns {
                None => self.within(j, reading).into_iter().collect(),
                Some([first, last]) => {
                    (first as i64..=last as i64).map(|k| reading + TAU * k as f64).collect()
                }
            };
            found = found
                .iter()
                .flat_map(|start| choices.iter().map(|&choice| [start.as_slice(), &[choice]].concat()))
                .collect();
        }
        Ok(found)
    }

    /// First and last number of turns that keep a joint within its limits; `None` if it cannot be turned.
    fn choices(&self, j: usize, reading: f64) -> Option<[f64; 2]> {
        if !self.turns[j] {
            return None;
        }
        let bound = TAU * TURNS_WITHOUT_LIMITS;
        let [low, high] = self.limits[j];
        let (low, high) = (finite_or(low, -bound), finite_or(high, bound));
        Some([((low - SLACK - reading) / TAU).ceil(), ((high + SLACK - reading) / TAU).floor()])
    }

    fn within(&self, j: usize, reading: f64) -> Option<f64> {
        let [low, high] = self.limits[j];
        (low - SLACK <= reading && reading <= high + SLACK).then_some(reading)
    }

    /// Whether readings differ by whole turns or nothing.
    pub(crate) fn same(&self, a: &[f64], b: &[f64]) -> bool {
        (0..self.count()).all(|j| {
            let apart = a[j] - b[j];
            let apart = if self.turns[j] { apart - TAU * (apart / TAU).round() } else { apart };
            apart.abs() < SAME
        })
    }
}

fn finite_or(value: f64, other: f64) -> f64 {
    if value.is_finite() { value } else { other }
}

fn product(matrix: &[f64], vector: &[f64]) -> Vec<f64> {
    matrix.chunks_exact(vector.len()).map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum()).collect()
}
