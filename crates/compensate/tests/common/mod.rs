//! What the tests share: arms with errors, and where their models put the tool.
#![allow(dead_code, missing_docs, clippy::unwrap_used, reason = "each test binary uses a part of it")]

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use truearm_bank::{Axis, Bank, Block, Grid, Input};
use truearm_compensate::{Corrector, Limits, Model, NUMBERS, Options, Path, Refusal, Run};
use truearm_kinematics::{Chain, Convention, Joint, Link, Parameters, Transform};

/// A repeatable stream of numbers between -1 and 1 (an additive recurrence, well spread).
pub fn stream(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|i| ((i + 1000 * seed + 1) as f64 * 0.618_033_988_749_895).fract() * 2.0 - 1.0).collect()
}

pub fn chain(convention: Convention, rows: &[(Joint, [f64; 5])]) -> Chain {
    let link = |(joint, p): &(Joint, [f64; 5])| Link {
        joint: *joint,
        theta: p[0],
        d: p[1],
        a: p[2],
        alpha: p[3],
        beta: p[4],
    };
    let base = Transform::from_rotation_vector([0.3, -0.2, 1.1], [0.1, -0.4, 0.7]);
    let flange = Transform::from_rotation_vector([-0.9, 0.5, 0.2], [0.05, 0.02, 0.03]);
    Chain::new(convention, rows.iter().map(link).collect(), base, flange).unwrap()
}

fn revolute(rows: &[[f64; 5]]) -> Vec<(Joint, [f64; 5])> {
    rows.iter().map(|p| (Joint::Revolute, *p)).collect()
}

/// Six axes, as a UR10.
pub fn six_axis() -> Chain {
    chain(
        Convention::Standard,
        &revolute(&[
            [0.0, 0.1273, 0.0, FRAC_PI_2, 0.0],
            [0.0, 0.0, -0.612, 0.0, 0.0],
            [0.0, 0.0, -0.5723, 0.0, 0.0],
            [0.0, 0.163_941, 0.0, FRAC_PI_2, 0.0],
            [0.0, 0.1157, 0.0, -FRAC_PI_2, 0.0],
            [0.0, 0.0922, 0.0, 0.0, 0.0],
        ]),
    )
}

/// Seven axes, as an iiwa, in Craig's convention.
pub fn seven_axis() -> Chain {
    let twist = [0.0, -FRAC_PI_2, FRAC_PI_2, FRAC_PI_2, -FRAC_PI_2, -FRAC_PI_2, FRAC_PI_2];
    let d = [0.34, 0.0, 0.4, 0.0, 0.4, 0.0, 0.126];
    let rows: Vec<[f64; 5]> = (0..7).map(|k| [0.0, d[k], 0.0, twist[k], 0.0]).collect();
    chain(Convention::Modified, &revolute(&rows))
}

/// Six axes of which the third slides.
pub fn sliding() -> Chain {
    let mut rows = revolute(&[
        [0.0, 0.4, 0.0, -FRAC_PI_2, 0.0],
        [0.0, 0.15, 0.0, FRAC_PI_2, 0.0],
        [0.0, 0.5, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -FRAC_PI_2, 0.0],
        [0.0, 0.0, 0.0, FRAC_PI_2, 0.0],
        [0.0, 0.2, 0.0, 0.0, 0.0],
    ]);
    rows[2].0 = Joint::Prismatic;
    chain(Convention::Standard, &rows)
}

/// Five axes without a wrist roll's partner, as the paper's RV-M2: its tool axis cannot leave the arm's plane.
pub fn five_axis() -> Chain {
    chain(
        Convention::Standard,
        &revolute(&[
            [0.0, 0.4, 0.12, FRAC_PI_2, 0.0],
            [0.0, 0.0, 0.25, 0.0, 0.0],
            [0.0, 0.0, 0.22, 0.0, 0.0],
            [0.0, 0.0, 0.0, FRAC_PI_2, 0.0],
            [0.0, 0.137, 0.0, 0.0, 0.0],
        ]),
    )
}

pub fn tool() -> Transform {
    Transform::from_rotation_vector([0.1, 0.7, -0.2], [0.03, -0.02, 0.18])
}

/// Parameters that are off by about so many metres and radians.
pub fn wrong(chain: &Chain, size: f64) -> Vec<f64> {
    let nominal = chain.nominal();
    nominal.iter().zip(stream(nominal.len(), 7)).map(|(p, x)| p + size * x).collect()
}

/// Readings of n waypoints within half a turn, or half a metre.
pub fn readings(chain: &Chain, n: usize, seed: usize) -> Vec<f64> {
    let columns = chain.joint_columns();
    let reach = move |i: usize| if columns[i % columns.len()] % 5 == 1 { 0.4 } else { 0.9 * PI };
    stream(n * columns.len(), seed).iter().enumerate().map(|(i, x)| x * reach(i)).collect()
}

pub fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|k| f64::from(u8::from(k / n == k % n))).collect()
}

/// A field over every joint: theta of each joint over itself, all parameters over the second joint.
pub fn field(chain: &Chain, size: f64) -> Bank {
    let (joints, width) = (chain.joint_count(), chain.parameter_count());
    let axis = |length: f64, low: f64, high: f64| {
        Axis::covering(Input::ANGLE, [low, high].into_iter(), length, length / 2.0, 2)
    };
    let mut blocks = Vec::new();
    for (joint, column) in chain.joint_columns().iter().enumerate() {
        let grid = Grid { inputs: vec![joint], axes: vec![axis(0.3, -3.0, 3.0)] };
        let weights = stream(grid.cell_count(), 11 + joint).iter().map(|x| size * x).collect();
        blocks.push(Block { name: "own".to_owned(), grid, outputs: vec![*column], weights, reading: None });
    }
    let grid = Grid { inputs: vec![1], axes: vec![axis(1.0, -1.0, 1.0)] };
    let weights = stream(grid.cell_count() * width, 3).iter().map(|x| size * x).collect();
    blocks.push(Block {
        name: "smooth".to_owned(),
        grid,
        outputs: (0..width).collect(),
        weights,
        reading: None,
    });
    Bank { blocks, ..Bank::empty(joints, width) }
}

/// Bounds that refuse nothing but what is not reached.
pub fn unbounded() -> Limits {
    Limits {
        largest_angle: f64::INFINITY,
        largest_slide: f64::INFINITY,
        largest_shift: f64::INFINITY,
        largest_turn: f64::INFINITY,
        shift_change: f64::INFINITY,
        turn_change: f64::INFINITY,
        ..Limits::default()
    }
}

/// An arm that was meant to be one thing and is another.
pub struct Scene {
    pub chain: Chain,
    pub constants: Vec<f64>,
    pub coupling: Vec<f64>,
    pub bank: Option<Bank>,
}

impl Scene {
    pub fn new(chain: Chain, size: f64) -> Self {
        let (constants, coupling) = (wrong(&chain, size), identity(chain.joint_count()));
        Self { chain, constants, coupling, bank: None }
    }

    pub fn varying(chain: Chain, size: f64) -> Self {
        let bank = field(&chain, 0.3 * size);
        Self { bank: Some(bank), ..Self::new(chain, size) }
    }

    pub fn programming(&self) -> Arc<Model> {
        Arc::new(Model::new(self.chain.clone(), &self.chain.nominal(), &self.coupling).unwrap())
    }

    pub fn calibrated(&self) -> Arc<Model> {
        let model = Model::new(self.chain.clone(), &self.constants, &self.coupling).unwrap();
        Arc::new(match &self.bank {
            Some(bank) => model.with_field(bank.compiled(), 0).unwrap(),
            None => model,
        })
    }

    pub fn corrector(&self, options: Options) -> Corrector {
        Corrector::new(self.calibrated(), self.programming(), &tool(), options).unwrap()
    }

    /// Where the programming model puts the tool, by the kinematics' own batches.
    pub fn meant(&self, readings: &[f64]) -> Vec<Transform> {
        poses(&self.chain, &self.values(readings), Parameters::One(&self.chain.nominal()))
    }

    /// Where the tool really goes.
    pub fn real(&self, readings: &[f64]) -> Vec<Transform> {
        let values = self.values(readings);
        let count = values.len() / self.chain.joint_count();
        let mut parameters: Vec<f64> = self.constants.repeat(count);
        if let Some(bank) = &self.bank {
            bank.add(&values, &mut parameters).unwrap();
        }
        poses(&self.chain, &values, Parameters::Each(&parameters))
    }

    /// Joint values of readings.
    fn values(&self, readings: &[f64]) -> Vec<f64> {
        let n = self.chain.joint_count();
        readings
            .chunks_exact(n)
            .flat_map(|row| {
                self.coupling.chunks_exact(n).map(move |c| c.iter().zip(row).map(|(a, b)| a * b).sum::<f64>())
            })
            .collect()
    }
}

fn poses(chain: &Chain, values: &[f64], parameters: Parameters<'_>) -> Vec<Transform> {
    let chain = chain.with_end(chain.end().compose(&tool())).unwrap();
    let mut out = vec![0.0; values.len() / chain.joint_count() * 16];
    chain.poses(values, parameters, &mut out).unwrap();
    out.as_chunks::<16>().0.iter().map(Transform::from_matrix).collect()
}

/// Distance of two poses in m, and the angle between them.
pub fn apart(a: &Transform, b: &Transform) -> (f64, f64) {
    let between = a.inverse().compose(b);
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length(between.translation), length(between.rotation_vector()))
}

/// What a corrector makes of a path.
pub struct Corrected {
    pub readings: Vec<f64>,
    pub numbers: Vec<[f64; NUMBERS]>,
    pub refused: Vec<(usize, Refusal)>,
}

pub fn correct(corrector: &Corrector, readings: &[f64], threads: usize) -> Corrected {
    let mut out = vec![0.0; readings.len()];
    let mut numbers = vec![0.0; readings.len() / corrector.joint_count() * NUMBERS];
    let run = Run { threads: std::num::NonZeroUsize::new(threads), ..Run::default() };
    let path = Path { readings: &mut out, numbers: &mut numbers };
    let refused = corrector.correct_path(readings, &[], path, &run).unwrap();
    Corrected { readings: out, numbers: numbers.as_chunks().0.to_vec(), refused }
}
