//! The continuous kernels between the poses of one training set.
//!
//! All is kept by pose j with the poses j.. in runs of eight. Places that no pose fills hold distances of zero, whose kernels
//! are one: what they are multiplied with must be zero there.

use rayon::prelude::*;
use truearm_bank::{Input, InputKind, Shape, alike};
use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch, exp};

use crate::columns::Columns;
use crate::hyper::{Hyper, Product};
use crate::own::OwnKernel;
use crate::pairs::{PairKernels, PairTable};
use crate::training::Training;

/// What kernels of one pose with the poses from it on are made of, computed once.
pub struct Pairing {
    /// Poses from it on.
    count: usize,
    /// Distances by each input, (I, count).
    pub distances: Vec<Vec<f64>>,
    /// How alike the loads of each joint are, (N, count).
    pub loads: Vec<Vec<f64>>,
}

/// Kernels of one pose with the poses from it on, under given hyper-parameters.
pub struct PoseKernels {
    /// Three of each input.
    own: Columns,
    /// Three, each summed over the inputs.
    smooth: Columns,
    /// Of each product.
    pub products: Columns,
}

/// Kernels and their derivatives by the logarithms of the length scales, (count,).
pub struct SmoothSlopes<'a> {
    pub kernel: &'a [f64],
    /// By that of angles.
    pub by_log_length: &'a [f64],
    /// By that of lines.
    pub by_log_line_length: &'a [f64],
}

/// The same of an `own` block, (count,).
pub struct OwnSlopes<'a> {
    pub kernel: &'a [f64],
    pub by_log_length: &'a [f64],
    pub by_log_cycles: &'a [f64],
}

/// The kernels of all poses.
pub struct Continuous<'a> {
    training: &'a Training,
    hyper: &'a Hyper,
    pairings: &'a [Pairing],
    pub poses: Vec<PoseKernels>,
}

/// Room for a number of poses in runs of eight.
pub fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// What all kernels of a training set are made of, by pose.
pub fn pairings(training: &Training) -> Vec<Pairing> {
    (0..training.pose_count()).into_par_iter().map(|pose| Pairing::new(training, pose)).collect()
}

impl Pairing {
    fn new(training: &Training, j: usize) -> Self {
        let (count, joints) = (training.pose_count() - j, training.geometry.joint_count());
        let mut distances = vec![vec![0.0; padded(count)]; training.inputs.len()];
        for (k, (input, distances)) in training.inputs.iter().zip(&mut distances).enumerate() {
            for (i, distance) in distances[..count].iter_mut().enumerate() {
                *distance = input.distance(training.values_of(j + i)[k], training.values_of(j)[k]);
            }
        }
        let mut loads = vec![vec![0.0; padded(count)]; joints];
        let mut pair = vec![0.0; joints];
        for i in 0..count {
            alike(joints, training.levers_of(j), training.levers_of(j + i), &mut pair);
            loads.iter_mut().zip(&pair).for_each(|(column, load)| column[i] = *load);
        }
        Self { count, distances, loads }
    }
}

impl<'a> Continuous<'a> {
    /// Under given hyper-parameters.
    pub fn new(training: &'a Training, pairings: &'a [Pairing], hyper: &'a Hyper) -> Self {
        let poses = pairings.par_iter().map(|pairing| dispatch(Fill { pairing, training, hyper })).collect();
        Self { training, hyper, pairings, poses }
    }
}

impl PairKernels for Continuous<'_> {
    fn fill(&self, j: usize, table: &mut PairTable) {
        let (pairing, kernels) = (&self.pairings[j], &self.poses[j]);
        let waves = &self.hyper.waves;
        table.clear(pairing.distances.len(), kernels.products.iter().len(), waves.len(), pairing.count);
        let copy = |column: &mut Vec<f64>, values: &[f64]| {
            column.copy_from_slice(&values[..pairing.count]);
        };
        table.own.iter_mut().zip(kernels.own()).for_each(|(column, own)| copy(column, own.kernel));
        table.sag.iter_mut().zip(&pairing.loads).for_each(|(column, loads)| copy(column, loads));
        let products = table.products.iter_mut().zip(kernels.products.iter());
        products.for_each(|(column, values)| copy(column, values));
        copy(&mut table.smooth, kernels.smooth().kernel);
        for (column, wave) in table.waves.iter_mut().zip(waves) {
            let value = |pose: usize| self.training.values_of(pose)[wave.joint];
            for (i, out) in column.iter_mut().enumerate() {
                *out = (wave.cycles * (value(j + i) - value(j))).cos();
            }
        }
    }
}

struct Fill<'a> {
    pairing: &'a Pairing,
    training: &'a Training,
    hyper: &'a Hyper,
}

impl Kernel for Fill<'_> {
    type Output = PoseKernels;

    #[inline(always)]
    fn run<I: Isa>(self) -> PoseKernels {
        let Self { pairing: Pairing { distances, count, .. }, training, hyper } = self;
        let inputs = &training.inputs;
        let length = padded(*count);
        let mut own = Columns::zeros(PER_INPUT * inputs.len(), length);
        let mut smooth = Columns::zeros(PER_INPUT, length);
        let plain = training.input_count();
        for (k, ((input, distances), slopes)) in
            inputs.iter().zip(distances).zip(own.iter_mut_by()).enumerate()
        {
            if training.has_curve(k) {
                write_own::<I>(OwnKernel::of(hyper, input.kind), distances, slopes);
            }
            for sums in smooth.iter_mut_by().filter(|_| k < plain) {
                add_smooth::<I>(input, distances, hyper, sums);
            }
        }
        let mut products = Columns::zeros(hyper.products.len(), length);
        for (product, kernels) in hyper.products.iter().zip(products.iter_mut()) {
            write_product::<I>(product, distances, kernels);
        }
        PoseKernels { own, smooth, products }
    }
}

/// A kernel, and its derivatives by two logarithms.
const PER_INPUT: usize = 3;

impl PoseKernels {
    /// Of each input.
    pub fn own(&self) -> impl Iterator<Item = OwnSlopes<'_>> {
        (0..self.own.iter().len() / PER_INPUT).map(|input| self.own_of(input))
    }

    /// Of one input.
    pub fn own_of(&self, input: usize) -> OwnSlopes<'_> {
        let first = PER_INPUT * input;
        OwnSlopes {
            kernel: self.own.get(first),
            by_log_length: self.own.get(first + 1),
            by_log_cycles: self.own.get(first + 2),
        }
    }

    /// Of all inputs.
    pub fn smooth(&self) -> SmoothSlopes<'_> {
        SmoothSlopes {
            kernel: self.smooth.get(0),
            by_log_length: self.smooth.get(1),
            by_log_line_length: self.smooth.get(2),
        }
    }
}

#[inline(always)]
fn write_own<I: Isa>(kernel: OwnKernel, distances: &[f64], slopes: [&mut [f64]; PER_INPUT]) {
    let [kernels, by_length, by_cycles] = slopes.map(runs_mut);
    let outputs = kernels.iter_mut().zip(by_length).zip(by_cycles);
    for (distance, ((value, by_length), by_cycles)) in runs(distances).iter().zip(outputs) {
        let found = kernel.of_lane::<I>(Lane(*distance));
        *value = found.kernel.0;
        *by_length = found.by_log_length.0;
        *by_cycles = found.by_log_cycles.0;
    }
}

#[inline(always)]
fn add_smooth<I: Isa>(input: &Input, distances: &[f64], hyper: &Hyper, sums: [&mut [f64]; PER_INPUT]) {
    let length = hyper.smooth_length_of(input);
    let [kernels, by_length, by_line_length] = sums.map(runs_mut);
    let slopes = match input.kind {
        InputKind::Angle => by_length,
        InputKind::Line => by_line_length,
    };
    for ((distance, kernel), slope) in runs(distances).iter().zip(kernels).zip(slopes) {
        let value = Shape::SquaredExponential.of::<I>(Lane(*distance), length);
        *kernel = (Lane(*kernel) + value.kernel).0;
        *slope = (Lane(*slope) + value.by_log_length).0;
    }
}

/// Kernels of a product, (count,), in place of zeros: one exponential of the sum of its exponents.
#[inline(always)]
fn write_product<I: Isa>(product: &Product, distances: &[Vec<f64>], kernels: &mut [f64]) {
    for (k, factor) in exponent_factors(product) {
        for (sum, distance) in runs_mut(kernels).iter_mut().zip(runs(&distances[k])) {
            *sum = I::mul_add(Lane(*distance), Lane::splat(-factor), Lane(*sum)).0;
        }
    }
    for kernel in runs_mut(kernels) {
        *kernel = exp::<I>(Lane(*kernel)).0;
    }
}

/// Inputs of a product, and what their distances are multiplied with in its exponent.
pub fn exponent_factors(product: &Product) -> impl Iterator<Item = (usize, f64)> {
    product.joints.iter().zip(&product.lengths).map(|(&k, length)| (k, 1.0 / (length * length)))
}

/// Sum of the products of two padded runs of numbers, in a fixed order.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = Lane::ZERO;
    for (a, b) in runs(a).iter().zip(runs(b)) {
        sum += Lane(*a) * Lane(*b);
    }
    sum.sum()
}

#[inline(always)]
fn runs(values: &[f64]) -> &[[f64; LANES]] {
    values.as_chunks().0
}

#[inline(always)]
fn runs_mut(values: &mut [f64]) -> &mut [[f64; LANES]] {
    values.as_chunks_mut().0
}
