//! The continuous kernels between the poses of one training set.
//!
//! All is kept by pose j with the poses j.. in runs of eight. Places that no pose fills hold distances of zero, whose kernels
//! are one: what they are multiplied with must be zero there.

use rayon::prelude::*;
use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch, exp};

use crate::hyper::{Hyper, Product};
use crate::kernel::{Input, InputKind, Shape};
use crate::own::OwnKernel;
use crate::pairs::{PairKernels, PairTable};
use crate::sag::alike;
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
    /// Of each input, (I, count).
    pub own: Vec<OwnSlopes>,
    /// Summed over the inputs.
    pub smooth: SmoothSlopes,
    /// For each product, (count,).
    pub products: Vec<Vec<f64>>,
}

/// Kernels and their derivatives by the logarithms of the length scales, (count,).
pub struct SmoothSlopes {
    pub kernel: Vec<f64>,
    /// By that of angles.
    pub by_log_length: Vec<f64>,
    /// By that of lines; empty without such inputs.
    pub by_log_line_length: Vec<f64>,
}

/// The same of an `own` block.
pub struct OwnSlopes {
    pub kernel: Vec<f64>,
    pub by_log_length: Vec<f64>,
    pub by_log_cycles: Vec<f64>,
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
        let inputs = &training.inputs;
        let poses = pairings.par_iter().map(|pairing| dispatch(Fill { pairing, inputs, hyper })).collect();
        Self { training, hyper, pairings, poses }
    }
}

impl PairKernels for Continuous<'_> {
    fn fill(&self, j: usize, table: &mut PairTable) {
        let (pairing, kernels) = (&self.pairings[j], &self.poses[j]);
        let waves = &self.hyper.waves;
        table.clear(kernels.own.len(), kernels.products.len(), waves.len(), pairing.count);
        let copy = |column: &mut Vec<f64>, values: &Vec<f64>| {
            column.copy_from_slice(&values[..pairing.count]);
        };
        table.own.iter_mut().zip(&kernels.own).for_each(|(column, own)| copy(column, &own.kernel));
        table.sag.iter_mut().zip(&pairing.loads).for_each(|(column, loads)| copy(column, loads));
        table.products.iter_mut().zip(&kernels.products).for_each(|(column, values)| copy(column, values));
        copy(&mut table.smooth, &kernels.smooth.kernel);
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
    inputs: &'a [Input],
    hyper: &'a Hyper,
}

impl Kernel for Fill<'_> {
    type Output = PoseKernels;

    #[inline(always)]
    fn run<I: Isa>(self) -> PoseKernels {
        let Self { pairing: Pairing { distances, count, .. }, inputs, hyper } = self;
        let mut own = Vec::with_capacity(distances.len());
        let mut smooth = SmoothSlopes::zeros(*count, inputs);
        for (input, distances) in inputs.iter().zip(distances) {
            own.push(OwnSlopes::new::<I>(OwnKernel::of(hyper, input.kind), distances));
            smooth.add::<I>(input, distances, hyper);
        }
        let mut products = Vec::with_capacity(hyper.products.len());
        for product in &hyper.products {
            products.push(product_kernels::<I>(product, distances, *count));
        }
        PoseKernels { own, smooth, products }
    }
}

impl OwnSlopes {
    #[inline(always)]
    fn new<I: Isa>(kernel: OwnKernel, distances: &[f64]) -> Self {
        let zeros = || vec![0.0; distances.len()];
        let mut slopes = Self { kernel: zeros(), by_log_length: zeros(), by_log_cycles: zeros() };
        let (kernels, lengths) = (runs_mut(&mut slopes.kernel), runs_mut(&mut slopes.by_log_length));
        let outputs = kernels.iter_mut().zip(lengths).zip(runs_mut(&mut slopes.by_log_cycles));
        for (distance, ((value, by_length), by_cycles)) in runs(distances).iter().zip(outputs) {
            let found = kernel.of_lane::<I>(Lane(*distance));
            *value = found.kernel.0;
            *by_length = found.by_log_length.0;
            *by_cycles = found.by_log_cycles.0;
        }
        slopes
    }
}

impl SmoothSlopes {
    fn zeros(count: usize, inputs: &[Input]) -> Self {
        let zeros = || vec![0.0; padded(count)];
        let lines = inputs.iter().any(|input| input.kind == InputKind::Line);
        let by_log_line_length = if lines { zeros() } else { Vec::new() };
        Self { kernel: zeros(), by_log_length: zeros(), by_log_line_length }
    }

    #[inline(always)]
    fn add<I: Isa>(&mut self, input: &Input, distances: &[f64], hyper: &Hyper) {
        let length = hyper.smooth_length_of(input);
        let slopes = match input.kind {
            InputKind::Angle => &mut self.by_log_length,
            InputKind::Line => &mut self.by_log_line_length,
        };
        let kernels = runs_mut(&mut self.kernel);
        for ((distance, kernel), slope) in runs(distances).iter().zip(kernels).zip(runs_mut(slopes)) {
            let value = Shape::SquaredExponential.of::<I>(Lane(*distance), length);
            *kernel = (Lane(*kernel) + value.kernel).0;
            *slope = (Lane(*slope) + value.by_log_length).0;
        }
    }
}

/// Kernels of a product, (count,): one exponential of the sum of its exponents.
#[inline(always)]
fn product_kernels<I: Isa>(product: &Product, distances: &[Vec<f64>], count: usize) -> Vec<f64> {
    let mut kernels = vec![0.0; padded(count)];
    for (k, factor) in exponent_factors(product) {
        for (sum, distance) in runs_mut(&mut kernels).iter_mut().zip(runs(&distances[k])) {
            *sum = I::mul_add(Lane(*distance), Lane::splat(-factor), Lane(*sum)).0;
        }
    }
    for kernel in runs_mut(&mut kernels) {
        *kernel = exp::<I>(Lane(*kernel)).0;
    }
    kernels
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
