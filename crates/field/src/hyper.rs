//! Hyper-parameters of the field, their starts, bounds and priors.
//!
//! Amplitudes and lengths are shared by the joints: one more per joint costs at thirty poses and gains nothing
//! measurable at four hundred (docs/decisions/0003). Each has a wide log-normal prior centred on its start.

use crate::training::Class;

/// Hyper-parameters; amplitudes in rad or m, lengths in scaled input units (rad).
#[derive(Debug, Clone, PartialEq)]
pub struct Hyper {
    /// Factor on the constants' prior standard deviations.
    pub constant: f64,
    /// Amplitude of `own` blocks, rad (for prismatic joints times [`OWN_LEVER`] m).
    pub own: f64,
    /// Length scale of `own` blocks.
    pub own_length: f64,
    /// Amplitudes of `smooth` blocks by class.
    pub smooth: [f64; 3],
    /// Length scale of `smooth` blocks.
    pub smooth_length: f64,
    /// Amplitudes of the `major` block by class.
    pub major: [f64; 3],
    /// Joints of the `major` block.
    pub major_joints: Vec<usize>,
    /// Their length scales.
    pub major_lengths: Vec<f64>,
    /// Noise of positions (m) and of orientations (rad).
    pub noise: [f64; 2],
}

/// An `own` amplitude of a revolute joint moves a tool at this distance as much as that of a prismatic one, m.
pub const OWN_LEVER: f64 = 0.3;

/// One hyper-parameter as the optimiser sees it, in its own unit.
#[derive(Debug, Clone, Copy)]
pub struct Range {
    pub start: f64,
    pub low: f64,
    pub high: f64,
    /// Standard deviation of the logarithm about the start; infinite for a flat prior.
    pub spread: f64,
}

const MILLI: f64 = 1e-3;

const fn range(start: f64, low: f64, high: f64, spread: f64) -> Range {
    Range { start, low, high, spread }
}

const CONSTANT: Range = range(1.0, 0.1, 10.0, 0.5);
const OWN: Range = range(0.1 * MILLI, 0.003 * MILLI, 3.0 * MILLI, 1.0);
const OWN_LENGTH: Range = range(0.1, 0.02, 3.0, 0.7);
const SMOOTH_LENGTH: Range = range(1.5, 0.5, 10.0, 0.7);
const SMOOTH: [Range; 3] = [
    range(0.05 * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0),
    range(0.05 * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0),
    range(0.025 * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0),
];
const MAJOR_LENGTH: Range = range(2.0, 0.6, 20.0, 0.7);
const MAJOR: [Range; 3] = [
    range(0.1 * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0),
    range(0.1 * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0),
    range(0.05 * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0),
];
const NOISE_LOW: f64 = 0.003 * MILLI;
const NOISE_HIGH: f64 = 10.0 * MILLI;

/// Positions of the hyper-parameters in the vector of logarithms; major lengths follow, then noise.
pub const AT_CONSTANT: usize = 0;
pub const AT_OWN: usize = 1;
pub const AT_OWN_LENGTH: usize = 2;
pub const AT_SMOOTH: usize = 3;
pub const AT_SMOOTH_LENGTH: usize = 6;
pub const AT_MAJOR: usize = 7;
pub const AT_MAJOR_LENGTHS: usize = 10;

impl Hyper {
    /// Starts for the given joints of the `major` block and noise.
    pub fn start(major_joints: &[usize], noise: [f64; 2]) -> Self {
        Self {
            constant: CONSTANT.start,
            own: OWN.start,
            own_length: OWN_LENGTH.start,
            smooth: SMOOTH.map(|r| r.start),
            smooth_length: SMOOTH_LENGTH.start,
            major: MAJOR.map(|r| r.start),
            major_joints: major_joints.to_vec(),
            major_lengths: vec![MAJOR_LENGTH.start; major_joints.len()],
            noise,
        }
    }

    /// Logarithms of all hyper-parameters.
    pub fn to_logs(&self) -> Vec<f64> {
        let mut values = vec![self.constant, self.own, self.own_length];
        values.extend(self.smooth);
        values.push(self.smooth_length);
        values.extend(self.major);
        values.extend(&self.major_lengths);
        values.extend(self.noise);
        values.into_iter().map(f64::ln).collect()
    }

    /// The inverse of [`Hyper::to_logs`], for the same joints of the `major` block.
    pub fn with_logs(&self, logs: &[f64]) -> Self {
        let at = |index: usize| logs[index].exp();
        let three = |first: usize| std::array::from_fn(|k| at(first + k));
        let lengths = self.major_joints.len();
        Self {
            constant: at(AT_CONSTANT),
            own: at(AT_OWN),
            own_length: at(AT_OWN_LENGTH),
            smooth: three(AT_SMOOTH),
            smooth_length: at(AT_SMOOTH_LENGTH),
            major: three(AT_MAJOR),
            major_joints: self.major_joints.clone(),
            major_lengths: (0..lengths).map(|k| at(AT_MAJOR_LENGTHS + k)).collect(),
            noise: [at(AT_MAJOR_LENGTHS + lengths), at(AT_MAJOR_LENGTHS + lengths + 1)],
        }
    }

    /// Bounds and priors in the order of the logarithms.
    pub fn ranges(&self) -> Vec<Range> {
        let mut ranges = vec![CONSTANT, OWN, OWN_LENGTH];
        ranges.extend(SMOOTH);
        ranges.push(SMOOTH_LENGTH);
        ranges.extend(MAJOR);
        ranges.extend(vec![MAJOR_LENGTH; self.major_joints.len()]);
        ranges.extend(self.noise.map(|start| range(start, NOISE_LOW, NOISE_HIGH, f64::INFINITY)));
        ranges
    }

    /// The same hyper-parameters without one of the `major` joints.
    pub fn without(&self, position: usize) -> Self {
        let mut fewer = self.clone();
        fewer.major_joints.remove(position);
        fewer.major_lengths.remove(position);
        fewer
    }

    /// Amplitude of `smooth` or `major` of a class.
    pub fn amplitude(amplitudes: &[f64; 3], class: Class) -> f64 {
        amplitudes[class.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_and_back() {
        let hyper = Hyper::start(&[1, 2, 3], [1e-4, 3e-4]);
        let logs = hyper.to_logs();
        assert_eq!(logs.len(), hyper.ranges().len());
        let back = hyper.with_logs(&logs);
        for (a, b) in back.to_logs().iter().zip(&logs) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!(back.major_joints, hyper.major_joints);
    }

    #[test]
    fn starts_lie_within_bounds() {
        for range in Hyper::start(&[0, 1], [1e-4, 1e-4]).ranges() {
            assert!(range.low < range.start && range.start < range.high);
        }
    }
}
