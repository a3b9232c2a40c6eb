//! Hyper-parameters of the field, their starts, bounds and priors.
//!
//! Amplitudes and lengths are shared by the joints: one more per joint costs at thirty poses and gains nothing
//! measurable at four hundred (docs/decisions/0003). What they do not repeat is each one's own, about a level that they share
//! (docs/decisions/0040). Each has a wide log-normal prior centred on its start, amplitudes about a factor that they share.

use std::iter;

use truearm_bank::{Input, InputKind, UPRIGHT};

/// A block that varies with several joints together.
#[derive(Debug, Clone, PartialEq)]
pub struct Product {
    /// `major` or `wrist`.
    pub name: String,
    /// Amplitudes by class (theta, other angles, lengths), rad or m.
    pub amplitudes: [f64; 3],
    /// Its joints.
    pub joints: Vec<usize>,
    /// Their length scales, rad (scaled input units).
    pub lengths: Vec<f64>,
    /// Root mean square of each amplitude under its posterior, over the amplitude itself.
    pub widening: [f64; 3],
}

/// A wave of one joint's angle or way, as gears, encoders and screws leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// The input: a joint, from 0, or a reading behind all joints and features.
    pub joint: usize,
    /// Its phase by the joint's value: cycles a turn; where the joint slides, rad/m.
    pub cycles: f64,
    /// Prior standard deviation of the weights of its cosine and its sine, rad (prismatic: times
    /// [`truearm_kinematics::ANGLE_ARM`] m).
    pub amplitude: f64,
}

/// Hyper-parameters; amplitudes in rad or m, lengths in scaled input units (rad).
#[derive(Debug, Clone, PartialEq)]
pub struct Hyper {
    /// Factors on the constants' prior standard deviations by class (theta, other angles, lengths).
    pub constant: [f64; 3],
    /// Amplitude of `own` blocks, rad (for prismatic joints times [`truearm_kinematics::ANGLE_ARM`] m).
    pub own: f64,
    /// Length scale of `own` blocks.
    pub own_length: f64,
    /// Cycles a turn that `own` blocks of angles ripple with; they hardly do where it is far below one by the length scale.
    pub own_cycles: f64,
    /// Amplitudes of `smooth` blocks by class.
    pub smooth: [f64; 3],
    /// Length scale of `smooth` blocks over angles.
    pub smooth_length: f64,
    /// The same over slides and features, in parts of their range over pi: what rails do has nothing to do with turns.
    pub smooth_line_length: f64,
    /// What joints miss anew at every pose, rad (prismatic: times [`truearm_kinematics::ANGLE_ARM`] m).
    pub repeatability: f64,
    /// Factor of each joint on it, (N,).
    pub unevenness: Vec<f64>,
    /// Amplitude of `sag` weights, rad for each metre of lever (prismatic: times [`truearm_kinematics::ANGLE_ARM`] m).
    pub sag: f64,
    /// The direction, in the base frame, against which `sag` takes links to weigh.
    pub up: [f64; 3],
    /// Whether what drives of coupled joints leave goes with their readings, and not with joint values.
    pub by_readings: bool,
    /// Blocks over several joints together.
    pub products: Vec<Product>,
    /// Waves of single joints; they are found by a scan and not by the optimiser.
    pub waves: Vec<Wave>,
    /// Noise of positions (m) and of orientations (rad).
    pub noise: [f64; 2],
    /// Root mean square under the posterior of the `own` amplitude, over the amplitude itself.
    pub own_widening: f64,
    /// The same of the `smooth` amplitudes.
    pub smooth_widening: [f64; 3],
    /// The same of the `sag` amplitude.
    pub sag_widening: f64,
    /// Factor on the standard deviation of the arm's part, at least one; found by leaving out whole parts of the space, not
    /// by the evidence.
    pub extrapolation: f64,
}

/// One hyper-parameter as the optimiser sees it, in its own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    pub start: f64,
    pub low: f64,
    pub high: f64,
    /// Standard deviation of the logarithm about the start, of amplitudes about what they share; infinite for a flat prior.
    pub spread: f64,
}

const MILLI: f64 = 1e-3;

const fn range(start: f64, low: f64, high: f64, spread: f64) -> Range {
    Range { start, low, high, spread }
}

const fn amplitude(start: f64) -> Range {
    range(start * MILLI, 0.001 * MILLI, 3.0 * MILLI, 1.0)
}

const CONSTANT: Range = range(1.0, 0.02, 10.0, 1.0);
const OWN: Range = range(0.1 * MILLI, 0.003 * MILLI, 3.0 * MILLI, 1.0);
const OWN_LENGTH: Range = range(0.1, 0.02, 3.0, 0.7);
const OWN_CYCLES: Range = range(0.7, 0.1, 60.0, 1.7);
/// Where a search for ripples begins.
const RIPPLE: f64 = 10.0;
const SMOOTH: [Range; 3] = [amplitude(0.05), amplitude(0.05), amplitude(0.025)];
const SMOOTH_LENGTH: Range = range(1.5, 0.5, 10.0, 0.7);
const SMOOTH_LINE_LENGTH: Range = range(1.5, 0.05, 20.0, 1.0);
/// Where a search for rails that bend often begins.
const BENDS: f64 = 0.3;
const REPEATABILITY: Range = range(0.03 * MILLI, 0.002 * MILLI, MILLI, 1.0);
/// One joint beside the others: play, wear or a coarse encoder in one of them is common.
const UNEVENNESS: Range = range(1.0, 0.02, 50.0, 0.5);
const SAG: Range = range(MILLI, 0.003 * MILLI, 100.0 * MILLI, 1.5);
const MAJOR: [Range; 3] = [amplitude(0.1), amplitude(0.1), amplitude(0.05)];
const WRIST: [Range; 3] = [amplitude(0.05), amplitude(0.05), amplitude(0.025)];
const PRODUCT_LENGTH: Range = range(2.0, 0.6, 20.0, 0.7);
const NOISE_LOW: f64 = 0.001 * MILLI;
/// Orientations that are noted in another way than stated are no nearer than a radian, and must not spoil the positions.
const NOISE_HIGH: f64 = 1000.0 * MILLI;

/// Positions of the hyper-parameters in the vector of logarithms; products follow, then the joints' unevenness and noise.
pub const AT_CONSTANT: usize = 0;
pub const AT_OWN: usize = 3;
pub const AT_OWN_LENGTH: usize = 4;
pub const AT_OWN_CYCLES: usize = 5;
pub const AT_SMOOTH: usize = 6;
pub const AT_SMOOTH_LENGTH: usize = 9;
pub const AT_SMOOTH_LINE_LENGTH: usize = 10;
pub const AT_REPEATABILITY: usize = 11;
pub const AT_SAG: usize = 12;
pub const AT_PRODUCTS: usize = 13;

/// Name of the block whose joints the evidence chooses.
pub const MAJOR_NAME: &str = "major";
/// Name of blocks that hold a wave each.
pub const WAVE_NAME: &str = "wave";
/// Name of the block over the last three joints.
pub const WRIST_NAME: &str = "wrist";

impl Product {
    /// How many amplitudes a block has, before its lengths: one of each class.
    pub const AMPLITUDES: usize = 3;

    /// A block at the centre of its priors.
    pub fn start(name: &str, joints: Vec<usize>) -> Self {
        let amplitudes = Self::amplitude_ranges(name).map(|r| r.start);
        let lengths = vec![PRODUCT_LENGTH.start; joints.len()];
        Self { name: name.to_owned(), amplitudes, joints, lengths, widening: [1.0; 3] }
    }

    fn amplitude_ranges(name: &str) -> [Range; 3] {
        if name == WRIST_NAME { WRIST } else { MAJOR }
    }

    /// Hyper-parameters of the block: the amplitudes, then the lengths.
    pub fn len(&self) -> usize {
        Self::AMPLITUDES + self.lengths.len()
    }

    /// Whether the block has no joints.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }
}

impl Hyper {
    /// The priors' centres, with a `major` block over the given joints and a `wrist` block over the last three of an arm
    /// that has more.
    pub fn start(major_joints: &[usize], joint_count: usize, noise: [f64; 2]) -> Self {
        let mut products = vec![Product::start(MAJOR_NAME, major_joints.to_vec())];
        if joint_count > 3 {
            let last_three = (joint_count - 3..joint_count).collect();
            products.push(Product::start(WRIST_NAME, last_three));
        }
        Self {
            constant: [CONSTANT.start; 3],
            own: OWN.start,
            own_length: OWN_LENGTH.start,
            own_cycles: OWN_CYCLES.start,
            smooth: SMOOTH.map(|r| r.start),
            smooth_length: SMOOTH_LENGTH.start,
            smooth_line_length: SMOOTH_LINE_LENGTH.start,
            repeatability: REPEATABILITY.start,
            unevenness: vec![UNEVENNESS.start; joint_count],
            sag: SAG.start,
            up: UPRIGHT,
            by_readings: false,
            products,
            waves: Vec::new(),
            noise,
            own_widening: 1.0,
            smooth_widening: [1.0; 3],
            sag_widening: 1.0,
            extrapolation: 1.0,
        }
    }

    /// Several starts: the evidence has more than one maximum.
    ///
    /// Beside the priors' centres, errors that sit in rippling curves of the joints and errors that sit in slow variations
    /// of all joints together; with `lines` among the inputs, rails that bend often.
    pub fn starts(major_joints: &[usize], joint_count: usize, noise: [f64; 2], lines: bool) -> Vec<Self> {
        let plain = Self::start(major_joints, joint_count, noise);
        let rippling = Self {
            constant: plain.constant.map(|factor| 0.3 * factor),
            own: 4.0 * plain.own,
            own_cycles: RIPPLE,
            ..plain.clone()
        };
        let mut slow = Self {
            constant: plain.constant.map(|factor| 0.3 * factor),
            own: 0.2 * plain.own,
            own_length: 2.0 * plain.own_length,
            ..plain.clone()
        };
        for product in &mut slow.products {
            product.amplitudes = product.amplitudes.map(|amplitude| 3.0 * amplitude);
        }
        let bending = Self { smooth_line_length: BENDS, ..plain.clone() };
        let mut starts = vec![plain, rippling, slow];
        starts.extend(lines.then_some(bending));
        starts
    }

    /// Shows all hyper-parameters, each with its bounds and prior, in the order of their logarithms: `AT_...` are places in it.
    fn visit(&mut self, mut see: impl FnMut(&mut f64, Range)) {
        self.constant.iter_mut().for_each(|factor| see(factor, CONSTANT));
        see(&mut self.own, OWN);
        see(&mut self.own_length, OWN_LENGTH);
        see(&mut self.own_cycles, OWN_CYCLES);
        self.smooth.iter_mut().zip(SMOOTH).for_each(|(amplitude, range)| see(amplitude, range));
        see(&mut self.smooth_length, SMOOTH_LENGTH);
        see(&mut self.smooth_line_length, SMOOTH_LINE_LENGTH);
        see(&mut self.repeatability, REPEATABILITY);
        see(&mut self.sag, SAG);
        for product in &mut self.products {
            let ranges = Product::amplitude_ranges(&product.name);
            product.amplitudes.iter_mut().zip(ranges).for_each(|(amplitude, range)| see(amplitude, range));
            product.lengths.iter_mut().for_each(|length| see(length, PRODUCT_LENGTH));
        }
        self.unevenness.iter_mut().for_each(|factor| see(factor, UNEVENNESS));
        for noise in &mut self.noise {
            let about = range(*noise, NOISE_LOW, NOISE_HIGH, f64::INFINITY);
            see(noise, about);
        }
    }

    /// Logarithms of all hyper-parameters.
    pub fn to_logs(&self) -> Vec<f64> {
        let mut logs = Vec::with_capacity(self.count());
        // Fields that do not ripple are near those that hardly do.
        let mut all = Self { own_cycles: self.own_cycles.max(OWN_CYCLES.low), ..self.clone() };
        all.visit(|value, _| logs.push(value.ln()));
        logs
    }

    /// The inverse of [`Hyper::to_logs`], for the same blocks.
    pub fn with_logs(&self, logs: &[f64]) -> Self {
        let (mut other, mut place) = (self.clone(), 0);
        other.visit(|value, _| {
            *value = logs[place].exp();
            place += 1;
        });
        other
    }

    /// What a joint misses anew at every pose, rad.
    pub fn repeatability_of(&self, joint: usize) -> f64 {
        self.repeatability * self.unevenness.get(joint).copied().unwrap_or(UNEVENNESS.start)
    }

    /// How many hyper-parameters have logarithms.
    pub fn count(&self) -> usize {
        self.at_noise() + self.noise.len()
    }

    /// Position of the first hyper-parameter of a product among the logarithms; of none more, where they end.
    pub fn at_product(&self, product: usize) -> usize {
        AT_PRODUCTS + self.products[..product].iter().map(Product::len).sum::<usize>()
    }

    /// Position of the joints' unevenness among the logarithms.
    pub fn at_unevenness(&self) -> usize {
        self.at_product(self.products.len())
    }

    /// Position of the noise among the logarithms.
    pub fn at_noise(&self) -> usize {
        self.at_unevenness() + self.unevenness.len()
    }

    /// Length scale of the `smooth` block over an input.
    pub fn smooth_length_of(&self, input: &Input) -> f64 {
        match input.kind {
            InputKind::Angle => self.smooth_length,
            InputKind::Line => self.smooth_line_length,
        }
    }

    /// Positions of the amplitudes among the logarithms: `own`, `smooth`, `sag`, then each product's.
    pub fn amplitude_positions(&self) -> Vec<usize> {
        let mut positions = vec![AT_OWN];
        positions.extend((0..self.smooth.len()).map(|class| AT_SMOOTH + class));
        positions.push(AT_SAG);
        for product in 0..self.products.len() {
            positions.extend((0..Product::AMPLITUDES).map(|class| self.at_product(product) + class));
        }
        positions
    }

    /// The same hyper-parameters with other widenings, in the order of [`Hyper::amplitude_positions`].
    pub fn with_widenings(&self, widenings: &[f64]) -> Self {
        let mut other = self.clone();
        let own = iter::once(&mut other.own_widening).chain(&mut other.smooth_widening);
        let all = own.chain([&mut other.sag_widening]);
        let all = all.chain(other.products.iter_mut().flat_map(|product| &mut product.widening));
        all.zip(widenings).for_each(|(widening, found)| *widening = *found);
        other
    }

    /// Amplitudes as wide as what the evidence leaves open makes them.
    pub fn widened(&self) -> Self {
        let times = |a: &[f64; 3], b: &[f64; 3]| std::array::from_fn(|k| a[k] * b[k]);
        let mut wide = self.clone();
        wide.own *= self.own_widening;
        wide.sag *= self.sag_widening;
        wide.smooth = times(&self.smooth, &self.smooth_widening);
        for product in &mut wide.products {
            product.amplitudes = times(&product.amplitudes, &product.widening);
        }
        wide
    }

    /// Bounds and priors in the order of the logarithms.
    pub fn ranges(&self) -> Vec<Range> {
        let mut ranges = Vec::with_capacity(self.count());
        self.clone().visit(|_, range| ranges.push(range));
        ranges
    }

    /// Joints of the `major` block.
    pub fn major_joints(&self) -> &[usize] {
        self.products.first().map_or(&[], |product| &product.joints)
    }

    /// Whether all `major` joints belong to the `wrist` block, which holds what they do together already.
    pub fn major_is_wrist(&self) -> bool {
        let wrist = self.products.iter().find(|product| product.name == WRIST_NAME);
        wrist.is_some_and(|wrist| self.major_joints().iter().all(|joint| wrist.joints.contains(joint)))
    }

    /// The same hyper-parameters with a fresh `major` block over other joints.
    pub fn with_major(&self, joints: Vec<usize>) -> Self {
        let mut other = self.clone();
        other.products[0] = Product::start(MAJOR_NAME, joints);
        other
    }

    /// The same hyper-parameters without one of the `major` joints.
    pub fn without_major(&self, position: usize) -> Self {
        let mut fewer = self.clone();
        fewer.products[0].joints.remove(position);
        fewer.products[0].lengths.remove(position);
        fewer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_and_back() {
        let hyper = Hyper::start(&[1, 2], 6, [1e-4, 3e-4]);
        let logs = hyper.to_logs();
        assert_eq!(logs.len(), hyper.ranges().len());
        let back = hyper.with_logs(&logs);
        for (a, b) in back.to_logs().iter().zip(&logs) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!(back.major_joints(), [1, 2]);
        assert_eq!(back.products[1].joints, [3, 4, 5]);
    }

    #[test]
    fn each_is_where_its_position_says() {
        let start = Hyper::start(&[1, 2], 4, [1e-4, 3e-4]);
        let places: Vec<f64> = (0..start.count()).map(|place| place as f64).collect();
        let of_places = start.with_logs(&places);
        let [major, wrist] = &of_places.products[..] else { panic!("two products") };
        for (value, place) in [
            (of_places.constant[1], AT_CONSTANT + 1),
            (of_places.own, AT_OWN),
            (of_places.own_length, AT_OWN_LENGTH),
            (of_places.own_cycles, AT_OWN_CYCLES),
            (of_places.smooth[2], AT_SMOOTH + 2),
            (of_places.smooth_length, AT_SMOOTH_LENGTH),
            (of_places.smooth_line_length, AT_SMOOTH_LINE_LENGTH),
            (of_places.repeatability, AT_REPEATABILITY),
            (of_places.sag, AT_SAG),
            (major.amplitudes[0], start.at_product(0)),
            (major.lengths[1], start.at_product(0) + Product::AMPLITUDES + 1),
            (wrist.amplitudes[2], start.at_product(1) + 2),
            (of_places.unevenness[3], start.at_unevenness() + 3),
            (of_places.noise[1], start.at_noise() + 1),
        ] {
            assert_eq!(value, (place as f64).exp(), "place {place}");
        }
    }

    #[test]
    fn starts_lie_within_bounds() {
        for hyper in Hyper::starts(&[0, 1], 7, [1e-4, 1e-4], true) {
            for (range, log) in hyper.ranges().iter().zip(hyper.to_logs()) {
                assert!(range.low < log.exp() && log.exp() < range.high);
            }
        }
    }
}
