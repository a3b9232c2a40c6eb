//! Arms: nominal chain, which parameters are fitted, and what they truly are at any configuration.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use truearm_kinematics::{Chain, Convention, Joint, Link, Transform};

use super::Random;

/// How far the true parameters lie from the nominal ones.
#[derive(Debug, Clone, Copy)]
pub struct Truth {
    /// Standard deviation of constant errors, m and rad.
    pub constant: f64,
    /// Amplitude of each joint's own curve, rad (prismatic: 0.3 m times it).
    pub own: f64,
    /// Amplitude of the sag of the second and third joint under gravity, rad.
    pub gravity: f64,
    /// Amplitude of a twist that two joints bring together, rad, and the two.
    pub coupled: (f64, [usize; 2]),
    /// Amplitude of a wave of a joint's angle, rad, its cycles a turn, and the joint.
    pub wave: (f64, f64, usize),
    /// Two joints with a parallel link: what the first one's drive leaves turns both, and the second is read against the horizon.
    pub parallel: Option<[usize; 2]>,
}

impl Truth {
    /// Constants alone.
    pub const RIGID: Truth = Truth {
        constant: 5e-4,
        own: 0.0,
        gravity: 0.0,
        coupled: (0.0, [0, 1]),
        wave: (0.0, 100.0, 0),
        parallel: None,
    };
    /// Own curves and gravity.
    pub const BENDING: Truth = Truth { own: 1.5e-4, gravity: 5e-4, ..Truth::RIGID };
}

/// An arm.
pub struct Arm {
    pub chain: Chain,
    /// Candidates, 5 * link + (theta, d, a, alpha, beta).
    pub columns: Vec<usize>,
    /// Range of each joint.
    pub ranges: Vec<(f64, f64)>,
    pub truth: Truth,
    constants: Vec<f64>,
}

impl Arm {
    fn new(
        convention: Convention,
        rows: &[(Joint, [f64; 4])],
        ranges: Vec<(f64, f64)>,
        truth: Truth,
    ) -> Self {
        let link = |&(joint, [theta, d, a, alpha]): &(Joint, [f64; 4])| Link {
            joint,
            theta,
            d,
            a,
            alpha,
            beta: 0.0,
        };
        let links: Vec<Link> = rows.iter().map(link).collect();
        let columns = candidates(convention, &links);
        let mut random = Random::new(11);
        let mut constants = vec![0.0; 5 * links.len()];
        columns.iter().for_each(|&column| constants[column] = truth.constant * random.normal());
        let chain = Chain::new(convention, links, Transform::IDENTITY, Transform::IDENTITY).unwrap();
        Self { chain, columns, ranges, truth, constants }
    }

    /// The same arm with one true parameter changed.
    pub fn changed(mut self, column: usize, by: f64) -> Self {
        self.constants[column] += by;
        self
    }

    /// Candidates that get constants: all but what a prismatic joint adds to.
    pub fn constant_columns(&self) -> Vec<usize> {
        let links = self.chain.links();
        let kept = |column: &&usize| links[**column / 5].joint != Joint::Prismatic || **column % 5 != 1;
        self.columns.iter().filter(kept).copied().collect()
    }

    /// Joint values within the given share of the ranges, (count, J).
    pub fn configurations(&self, count: usize, share: (f64, f64), seed: u64) -> Vec<f64> {
        let mut random = Random::new(seed);
        (0..count)
            .flat_map(|_| self.ranges.clone())
            .map(|(low, high)| low + (high - low) * random.between(share.0, share.1))
            .collect()
    }

    /// What the drive of a joint reads.
    fn reading(&self, q: &[f64], joint: usize) -> f64 {
        let behind = self.truth.parallel.filter(|pair| pair[1] == joint);
        behind.map_or(q[joint], |[first, second]| q[second] - q[first])
    }

    /// The matrix that makes joint values of readings, row-major.
    pub fn coupling(&self) -> Vec<f64> {
        let count = self.chain.joint_count();
        let mut matrix: Vec<f64> =
            (0..count * count).map(|k| if k / count == k % count { 1.0 } else { 0.0 }).collect();
        if let Some([first, second]) = self.truth.parallel {
            matrix[second * count + first] = 1.0;
        }
        matrix
    }

    /// True parameters at a configuration, (5 L,).
    pub fn parameters(&self, q: &[f64]) -> Vec<f64> {
        let nominal = self.chain.nominal();
        let mut parameters: Vec<f64> = nominal.iter().zip(&self.constants).map(|(a, b)| a + b).collect();
        for (joint, &column) in self.chain.joint_columns().iter().enumerate() {
            let (low, high) = self.ranges[joint];
            let is_line = column % 5 == 1;
            let reading = self.reading(q, joint);
            let phase = if is_line { TAU * (reading - low) / (high - low) } else { 2.0 * reading };
            let lever = if is_line { 0.3 } else { 1.0 };
            let shift = joint as f64;
            let mut left = lever * self.truth.own * ((phase + shift).sin() + 0.5 * (2.0 * phase).cos());
            let (amplitude, cycles, waving) = self.truth.wave;
            if waving == joint {
                left += amplitude * (cycles * reading + 0.4).cos();
            }
            parameters[column] += left;
            if let Some([first, second]) = self.truth.parallel.filter(|pair| pair[0] == joint) {
                parameters[column + 5 * (second - first)] += left;
            }
        }
        if self.truth.gravity != 0.0 {
            let sag = self.truth.gravity * (q[1] + q[2]).cos();
            parameters[5] += self.truth.gravity * q[1].cos() + 0.5 * sag;
            parameters[10] += sag;
            parameters[8] += 0.5 * sag;
        }
        let (twist, [first, second]) = self.truth.coupled;
        let both = twist * (q[first] + q[second]).sin() * (q[first] - 2.0 * q[second]).cos();
        parameters[5] += both;
        parameters[13] += both;
        parameters
    }
}

/// theta, d, a and alpha of each link; beta in place of d where the neighbouring axes are parallel.
fn candidates(convention: Convention, links: &[Link]) -> Vec<usize> {
    let mut columns = Vec::new();
    for (index, link) in links.iter().enumerate() {
        let has_neighbour = match convention {
            Convention::Standard => index + 1 < links.len(),
            Convention::Modified => index > 0,
        };
        let is_parallel = has_neighbour && link.alpha.sin().abs() < 1e-3;
        let kinds: &[usize] = match (link.joint, is_parallel) {
            (Joint::Prismatic, true) => &[1, 3, 4],
            (Joint::Prismatic, false) => &[0, 1, 3],
            (_, true) => &[0, 2, 3, 4],
            (_, false) => &[0, 1, 2, 3],
        };
        columns.extend(kinds.iter().map(|kind| 5 * index + kind));
    }
    columns
}

/// A UR10.
pub fn six_axes(truth: Truth) -> Arm {
    let rows = [
        [0.0, 0.1273, 0.0, FRAC_PI_2],
        [0.0, 0.0, -0.612, 0.0],
        [0.0, 0.0, -0.5723, 0.0],
        [0.0, 0.163_941, 0.0, FRAC_PI_2],
        [0.0, 0.1157, 0.0, -FRAC_PI_2],
        [0.0, 0.0922, 0.0, 0.0],
    ];
    let ranges = vec![(-1.5, 1.5), (-2.2, -0.3), (-2.2, 2.2), (-2.5, 2.5), (-2.5, 2.5), (-PI, PI)];
    Arm::new(Convention::Standard, &rows.map(|row| (Joint::Revolute, row)), ranges, truth)
}

/// A seven-axis arm in modified convention.
pub fn seven_axes(truth: Truth) -> Arm {
    let rows = [
        [0.0, 0.333, 0.0, 0.0],
        [0.0, 0.0, 0.0, -FRAC_PI_2],
        [0.0, 0.316, 0.0, FRAC_PI_2],
        [0.0, 0.0, 0.0825, FRAC_PI_2],
        [0.0, 0.384, -0.0825, -FRAC_PI_2],
        [0.0, 0.0, 0.0, FRAC_PI_2],
        [0.0, 0.107, 0.088, FRAC_PI_2],
    ];
    let ranges =
        vec![(-2.0, 2.0), (-1.5, 1.5), (-2.0, 2.0), (-2.8, -0.4), (-2.0, 2.0), (0.3, 3.2), (-2.5, 2.5)];
    Arm::new(Convention::Modified, &rows.map(|row| (Joint::Revolute, row)), ranges, truth)
}

/// A SCARA.
pub fn scara(truth: Truth) -> Arm {
    let rows = [
        (Joint::Revolute, [0.0, 0.4, 0.35, 0.0]),
        (Joint::Revolute, [0.0, 0.0, 0.3, PI]),
        (Joint::Prismatic, [0.0, 0.0, 0.0, 0.0]),
        (Joint::Revolute, [0.0, 0.05, 0.0, 0.0]),
    ];
    let ranges = vec![(-2.0, 2.0), (-2.2, 2.2), (0.0, 0.2), (-PI, PI)];
    Arm::new(Convention::Standard, &rows, ranges, truth)
}
