//! The solver: candidates of a closed form or of many starts, polished, told apart and brought within limits.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use rayon::prelude::*;
use truearm_kinematics::{KinematicsError, Transform, cross, norm};

use crate::arm::Arm;
use crate::axes::Axes;
use crate::branch::Branch;
use crate::error::InverseError;
use crate::newton::Newton;
use crate::readings::Readings;
use crate::shape::{Method, Shape};
use crate::vector::dot;

/// Steps that polish a closed form's candidate: enough from where a factory calibration puts it.
const POLISHING: usize = 16;
/// Steps from a start that is near to nothing.
const SEARCHING: usize = 60;
/// Starts of an arm without a closed form, spread over its limits.
const STARTS: usize = 96;
/// Of these, starts at whose poses the closed form is tried.
const TRIALS: usize = 6;
/// Distance from a seed within which the solution that Newton's steps lead to is the nearest, rad.
const NEARBY: f64 = 0.2;
/// How far beside a target the plain arm is asked for branches that it may lack at the target, metres.
const BESIDE_M: [f64; 4] = [-0.02, -0.003, 0.003, 0.02];
/// How far beside a target the closed form is asked once more, metres: at the border of its reach, where the arm
/// is stretched or its wrist lies on the first axis, roundings decide whether it has a branch.
const HAIR_M: [f64; 2] = [-1e-7, 1e-7];
/// Sine of the angle between the fourth and the sixth axis below which a wrist is nearly straight: the closed form's two
/// ways of its turning may lead to one of the solutions that a wrist whose axes do not quite meet has there.
const STRAIGHT: f64 = 0.05;
/// Ways of turning a straight wrist between its first and its last axis that solutions are searched for from.
const WAYS: usize = 8;
/// Solutions of an arm with a closed form when none is lacking.
const BRANCHES: usize = 8;

/// All inverse kinematics of a plain arm.
#[derive(Debug, Clone)]
pub struct Inverse {
    newton: Newton,
    readings: Readings,
    shape: Shape,
    starts: Vec<f64>,
    /// The closed form is of this very arm, not of one nearby.
    exact: bool,
}

impl Inverse {
    /// Looks at where the arm's axes are.
    ///
    /// # Errors
    /// [`InverseError::Length`] if the readings are of another number of joints.
    pub fn new(arm: Arm) -> Result<Inverse, InverseError> {
        let Arm { chain, readings } = arm;
        check("the readings", readings.count(), chain.joint_count())?;
        let shape = Shape::of(&Axes::of(&chain)?);
        let starts = spread(&readings);
        let mut inverse = Inverse { newton: Newton::new(&chain), readings, shape, starts, exact: false };
        inverse.exact = inverse.closed_form_fits()?;
        Ok(inverse)
    }

    /// Whether the closed form gives starts back at their own poses, by forward kinematics.
    fn closed_form_fits(&self) -> Result<bool, KinematicsError> {
        for start in self.starts.chunks_exact(self.readings.count()).take(TRIALS) {
            let pose = self.newton.pose(start)?;
            let mut found = self.shape.candidates(&pose, start).concat();
            let left = self.newton.improve(&pose, &mut found, 0)?;
            if left.is_empty() || !left.iter().all(|left| self.newton.arrived(left)) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// How this arm is solved.
    pub fn method(&self) -> Method {
        self.shape.method()
    }

    /// The branch of readings, where the arm's shape has branches with names.
    pub fn branch(&self, readings: &[f64]) -> Option<Branch> {
        let joints = self.readings.joints(readings);
        match &self.shape {
            Shape::Opw(opw) => Some(opw.planar.branch(&joints)),
            Shape::Parallel(parallel) => Some(parallel.planar.branch(&joints)),
            Shape::None(planar) => planar.as_ref().map(|planar| planar.branch(&joints)),
        }
    }

    /// Readings within limits at which the flange has the pose, one for each branch, sorted; with `turns` all
    /// that differ from them by whole turns. An arm with more than six joints has infinitely many: a sample.
    ///
    /// # Errors
    /// As of the chain, and [`InverseError::Turns`].
    pub fn solutions(&self, target: &Transform, turns: bool) -> Result<Vec<Vec<f64>>, InverseError> {
        let middle = self.readings.middle();
        let distinct = self.distinct(target, &middle)?;
        let mut found: Vec<Vec<f64>> = if turns {
            let turned = distinct.iter().map(|readings| self.readings.all_turns(readings));
            turned.collect::<Result<Vec<_>, _>>()?.concat()
        } else {
            distinct.iter().filter_map(|readings| self.readings.turned(readings, &middle)).collect()
        };
        found.sort_by(|a, b| order(a, b));
        Ok(found)
    }

    /// The solutions of each target, as [`Inverse::solutions`] without turns, on all threads.
    ///
    /// # Errors
    /// As of the chain.
    pub fn all(&self, targets: &[Transform]) -> Result<Vec<Vec<Vec<f64>>>, InverseError> {
        targets.par_iter().map(|target| self.solutions(target, false)).collect()
    }

    /// For each target the solution within limits that is nearest to its seed of J readings, or none; of arms without a
    /// closed form near by, the one that a search from the seed arrives at. Where a target has infinitely many,
    /// as with the wrist on the first axis, one that is near to the seed.
    ///
    /// # Errors
    /// If there is not a seed for each target, or it is not finite.
    pub fn near(&self, targets: &[Transform], seeds: &[f64]) -> Result<Vec<Option<Vec<f64>>>, InverseError> {
        let joints = self.readings.count();
        check("the seeds", seeds.len(), targets.len() * joints)?;
        if let Some(&value) = seeds.iter().find(|value| !value.is_finite()) {
            return Err(InverseError::SeedNotFinite { value });
        }
        let pairs = targets.par_iter().zip(seeds.par_chunks_exact(joints));
        pairs.map(|(target, seed)| self.near_one(target, seed)).collect()
    }

    fn near_one(&self, target: &Transform, seed: &[f64]) -> Result<Option<Vec<f64>>, InverseError> {
        if !self.exact {
            let mut joints = self.readings.joints(seed);
            let left = self.newton.improve(target, &mut joints, SEARCHING)?;
            let found = self.readings.turned(&self.readings.readings(&joints), seed);
            let there = left.iter().all(|left| self.newton.arrived(left));
            let reach = if self.method() == Method::Numeric { f64::INFINITY } else { NEARBY };
            if there && found.as_ref().is_some_and(|found| distance(found, seed) < reach * reach) {
                return Ok(found);
            }
        }
        let mut distinct = self.distinct(target, seed)?;
        if self.exact {
            self.collect(target, self.readings.joints(seed), POLISHING, &mut distinct)?;
        }
        let turned = distinct.iter().filter_map(|readings| self.readings.turned(readings, seed));
        Ok(turned.min_by(|a, b| distance(a, seed).total_cmp(&distance(b, seed))))
    }

    /// Solutions in readings that differ by more than whole turns, wherever the limits are.
    ///
    /// Near the border of its reach, the plain arm beside the given one may lack branches that this one has:
    /// unless all are there, they are searched for from where it has them, a little beside the target.
    fn distinct(&self, target: &Transform, seed: &[f64]) -> Result<Vec<Vec<f64>>, KinematicsError> {
        let mut found = Vec::new();
        if self.method() != Method::Numeric {
            let joints = self.readings.joints(seed);
            let (at, lacking) = self.closed_form(target, &joints);
            self.collect(target, at, POLISHING, &mut found)?;
            self.collect(target, lacking, POLISHING, &mut found)?;
            if !self.exact && self.method() == Method::SphericalWrist {
                let turned = self.turned_wrists(&found)?;
                self.collect(target, turned, POLISHING, &mut found)?;
            }
            if !self.exact && found.len() < BRANCHES {
                self.collect(target, self.around(target, &joints), POLISHING, &mut found)?;
            }
        }
        if !self.exact && found.is_empty() {
            self.collect(target, self.starts.clone(), SEARCHING, &mut found)?;
        }
        Ok(found)
    }

    /// The plain arm's candidates for the target, and those for targets a hair beside it that have more of them.
    fn closed_form(&self, target: &Transform, seed: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let at = self.shape.candidates(target, seed);
        let mut lacking = Vec::new();
        if at.len() < BRANCHES {
            for beside in beside(target, &HAIR_M) {
                let found = self.shape.candidates(&beside, seed);
                if found.len() > at.len() {
                    lacking.extend(found.concat());
                }
            }
        }
        (at.concat(), lacking)
    }

    /// The seed, and the plain arm's candidates for targets beside this one.
    fn around(&self, target: &Transform, seed: &[f64]) -> Vec<f64> {
        let mut candidates = seed.to_vec();
        for beside in beside(target, &BESIDE_M) {
            candidates.extend(self.shape.candidates(&beside, seed).concat());
        }
        candidates
    }

    /// Those of some readings whose wrist is nearly straight, turned between its first and its last axis.
    fn turned_wrists(&self, found: &[Vec<f64>]) -> Result<Vec<f64>, KinematicsError> {
        let mut starts = Vec::new();
        for readings in found {
            let joints = self.readings.joints(readings);
            let axes = self.newton.directions(&joints)?;
            if norm(cross(axes[3], axes[5])) > STRAIGHT {
                continue;
            }
            for way in 1..WAYS {
                let turn = TAU * way as f64 / WAYS as f64;
                let start = starts.len();
                starts.extend_from_slice(&joints);
                starts[start + 3] += turn;
                starts[start + 5] -= turn * dot(axes[3], axes[5]).signum();
            }
        }
        Ok(starts)
    }

    fn collect(
        &self,
        target: &Transform,
        mut candidates: Vec<f64>,
        steps: usize,
        found: &mut Vec<Vec<f64>>,
    ) -> Result<(), KinematicsError> {
        let joints = self.readings.count();
        let left = self.newton.improve(target, &mut candidates, steps)?;
        for (values, left) in candidates.chunks_exact(joints).zip(&left) {
            let readings = self.readings.readings(values);
            if self.newton.arrived(left) && !found.iter().any(|other| self.readings.same(other, &readings)) {
                found.push(readings);
            }
        }
        Ok(())
    }
}

/// Joint values of starts spread evenly over the limits: the additive recurrence with the roots of
/// x^(J + 1) = x + 1 (Roberts, The unreasonable effectiveness of quasirandom sequences, 2018).
fn spread(readings: &Readings) -> Vec<f64> {
    let count = readings.count();
    let root = (0..64).fold(2.0_f64, |root, _| (1.0 + root).powf(1.0 / (count as f64 + 1.0)));
    (0..STARTS)
        .flat_map(|k| {
            let start: Vec<f64> = (0..count)
                .map(|j| {
                    let share = (0.5 + (k as f64 + 1.0) * root.powi(-(j as i32 + 1))).fract();
                    let [low, high] = readings.span(j);
                    low + share * (high - low)
                })
                .collect();
            readings.joints(&start)
        })
        .collect()
}

/// Targets that stand so far beside one, along each axis.
fn beside<'a>(target: &'a Transform, steps: &'a [f64]) -> impl Iterator<Item = Transform> + 'a {
    (0..3).flat_map(move |axis| {
        steps.iter().map(move |step| {
            let mut beside = *target;
            beside.translation[axis] += step;
            beside
        })
    })
}

fn order(a: &[f64], b: &[f64]) -> Ordering {
    let orders = a.iter().zip(b).map(|(x, y)| x.total_cmp(y));
    orders.fold(Ordering::Equal, Ordering::then)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

fn check(name: &'static str, got: usize, wanted: usize) -> Result<(), InverseError> {
    if got == wanted { Ok(()) } else { Err(InverseError::Length { name, got, wanted }) }
}
