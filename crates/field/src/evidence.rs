//! The marginal likelihood of the measurements and its gradient by the hyper-parameters.
//!
//! Set-up unknowns have flat priors: the likelihood is the restricted one (REML, Patterson and Thompson 1971),
//! `-1/2 (log|K| + log|S^T K^-1 S| + r^T P r)` with `P = K^-1 - K^-1 S (S^T K^-1 S)^-1 S^T K^-1`. Its
//! gradient is `1/2 sum (alpha alpha^T - P) o dK` with `alpha = P r` (Rasmussen and Williams 2006, eq. 5.9). The
//! log-normal priors of the hyper-parameters are added.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef};
use rayon::prelude::*;
use truearm_estimate::Cancel;
use truearm_estimate::dense::{Cholesky, column, parallelism, to_vec};
use truearm_kinematics::{Isa, Kernel, dispatch};

use crate::FieldError;
use crate::data_space::setup_precision;
use crate::hyper::{
    AT_CONSTANT, AT_OWN, AT_OWN_LENGTH, AT_PRODUCTS, AT_REPEATABILITY, AT_SAG, AT_SMOOTH, AT_SMOOTH_LENGTH,
    Hyper, Product,
};
use crate::kernel::{Value, matern, squared_exponential};
use crate::pairs::{ByColumn, ClassSums, PairKernels, PairTable, add_products, covariance};
use crate::sag::alike;
use crate::training::Training;

/// The evidence of one training set under any hyper-parameters.
pub struct Evidence<'a> {
    training: &'a Training,
    by_column: ByColumn,
    distances: Distances,
    loads: Loads,
    cancel: &'a Cancel,
}

/// Logarithm of evidence and prior, and its gradient by the logarithms of the hyper-parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    pub value: f64,
    pub gradient: Vec<f64>,
}

/// Distances between poses by every input, computed once: pose j with poses j.., (count, I) each.
struct Distances(Vec<Vec<f64>>);

impl Distances {
    fn new(training: &Training) -> Self {
        let of_pose = |j: usize| {
            let here = training.values_of(j);
            let there = (j..training.pose_count()).map(|i| training.values_of(i));
            let inputs = &training.inputs;
            there
                .flat_map(|there| {
                    inputs.iter().enumerate().map(|(k, input)| input.distance(there[k], here[k]))
                })
                .collect()
        };
        Self((0..training.pose_count()).into_par_iter().map(of_pose).collect())
    }
}

/// How alike the loads of the joints are, computed once: pose j with poses j.., (count, I) each, zero for what is no joint.
struct Loads(Vec<Vec<f64>>);

impl Loads {
    fn new(training: &Training) -> Self {
        let (inputs, joints) = (training.inputs.len(), training.geometry.joint_count());
        let of_pose = |j: usize| {
            let mut loads = vec![0.0; (training.pose_count() - j) * inputs];
            for (i, out) in loads.chunks_exact_mut(inputs).enumerate() {
                alike(joints, training.levers_of(j), training.levers_of(j + i), out);
            }
            loads
        };
        Self((0..training.pose_count()).into_par_iter().map(of_pose).collect())
    }
}

/// Continuous kernels under given hyper-parameters of one pose with the poses from it on.
struct PoseKernels {
    /// (count, I) each.
    own: Vec<Value>,
    smooth: Vec<Value>,
    /// For each product, (count,).
    products: Vec<Vec<f64>>,
}

impl PoseKernels {
    fn new(distances: &[f64], inputs: usize, hyper: &Hyper) -> Self {
        let product = |product: &Product| {
            let pairs = distances.chunks_exact(inputs);
            pairs.map(|distances| (-exponents(product, distances).sum::<f64>()).exp()).collect()
        };
        Self {
            own: distances.iter().map(|&d| matern(d, hyper.own_length)).collect(),
            smooth: distances.iter().map(|&d| squared_exponential(d, hyper.smooth_length)).collect(),
            products: hyper.products.iter().map(product).collect(),
        }
    }
}

/// Exponents of the factors of a product's kernel for one pair of poses.
fn exponents<'a>(product: &'a Product, distances: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let joints = product.joints.iter().zip(&product.lengths);
    joints.map(|(&k, length)| distances[k] / (length * length))
}

/// The continuous kernels of all poses.
struct Continuous<'a> {
    inputs: usize,
    poses: Vec<PoseKernels>,
    loads: &'a Loads,
}

impl PairKernels for Continuous<'_> {
    fn fill(&self, j: usize, table: &mut PairTable) {
        let kernels = &self.poses[j];
        let count = kernels.own.len() / self.inputs;
        table.clear(self.inputs, kernels.products.len(), count);
        for (i, own) in kernels.own.chunks_exact(self.inputs).enumerate() {
            table.own.iter_mut().zip(own).for_each(|(column, value)| column[i] = value.kernel);
        }
        for (i, loads) in self.loads.0[j].chunks_exact(self.inputs).enumerate() {
            table.sag.iter_mut().zip(loads).for_each(|(column, value)| column[i] = *value);
        }
        let smooth = kernels.smooth.chunks_exact(self.inputs);
        for (sum, values) in table.smooth.iter_mut().zip(smooth) {
            *sum = values.iter().map(|value| value.kernel).sum();
        }
        for (column, values) in table.products.iter_mut().zip(&kernels.products) {
            column.copy_from_slice(values);
        }
    }
}

/// Quantities of the restricted likelihood at one point.
struct Restricted {
    projected: Mat<f64>,
    alpha: Vec<f64>,
    value: f64,
}

impl<'a> Evidence<'a> {
    pub fn new(training: &'a Training, cancel: &'a Cancel) -> Self {
        let (distances, loads) = (Distances::new(training), Loads::new(training));
        Self { training, by_column: ByColumn::new(training), distances, loads, cancel }
    }

    /// Evidence and prior with their gradient at a point.
    pub fn score(&self, hyper: &Hyper) -> Result<Score, FieldError> {
        self.cancel.check()?;
        let kernels = self.kernels(hyper);
        let matrix = covariance(self.training, &self.by_column, hyper, &kernels);
        let restricted = self.restricted(&matrix)?;
        let mut gradient = self.gradient(hyper, &kernels, &restricted);
        let mut value = restricted.value;
        for (k, (range, log)) in hyper.ranges().iter().zip(hyper.to_logs()).enumerate() {
            if range.spread.is_finite() {
                let z = (log - range.start.ln()) / range.spread;
                value -= 0.5 * z * z;
                gradient[k] -= z / range.spread;
            }
        }
        Ok(Score { value, gradient })
    }

    fn kernels(&self, hyper: &Hyper) -> Continuous<'_> {
        let inputs = self.training.inputs.len();
        let poses =
            self.distances.0.par_iter().map(|distances| PoseKernels::new(distances, inputs, hyper)).collect();
        Continuous { inputs, poses, loads: &self.loads }
    }

    fn restricted(&self, matrix: &[f64]) -> Result<Restricted, FieldError> {
        let rows = self.by_column.rows;
        let error = || FieldError::NotPositiveDefinite { rows };
        let par = parallelism();
        let factor = Cholesky::new(MatRef::from_column_major_slice(matrix, rows, rows).to_owned(), par)
            .ok_or_else(error)?;
        let width = self.training.setup_width;
        let setup = MatRef::from_row_major_slice(&self.training.setup, rows, width);
        let mut projected = factor.inverse();
        let spread = &projected * setup; // (R, s)
        let inner = Cholesky::new(setup_precision(setup, &spread), faer::Par::Seq).ok_or_else(error)?;
        let mut root = spread.transpose().to_owned();
        inner.solve_lower(root.as_mut());
        matmul(projected.as_mut(), Accum::Add, root.transpose(), root.as_ref(), -1.0, par);
        let residual = column(&self.training.residual);
        let mut alpha = Mat::zeros(rows, 1);
        matmul(alpha.as_mut(), Accum::Replace, projected.as_ref(), residual.as_ref(), 1.0, faer::Par::Seq);
        let alpha = to_vec(alpha.as_ref());
        let fit: f64 = alpha.iter().zip(&self.training.residual).map(|(a, r)| a * r).sum();
        let value = -0.5 * (factor.log_determinant() + inner.log_determinant() + fit);
        Ok(Restricted { projected, alpha, value })
    }

    /// Sums over the poses in a fixed order, whatever the threads.
    fn gradient(&self, hyper: &Hyper, kernels: &Continuous, restricted: &Restricted) -> Vec<f64> {
        let parts: Vec<Vec<f64>> = (0..self.training.pose_count())
            .into_par_iter()
            .map(|pose| {
                dispatch(PoseGradient {
                    evidence: self,
                    hyper,
                    kernels: &kernels.poses[pose],
                    restricted,
                    pose,
                })
            })
            .collect();
        let mut gradient = vec![0.0; hyper.to_logs().len()];
        for part in &parts {
            gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        gradient
    }
}

/// The columns of one pose's share of the gradient.
struct PoseGradient<'a> {
    evidence: &'a Evidence<'a>,
    hyper: &'a Hyper,
    kernels: &'a PoseKernels,
    restricted: &'a Restricted,
    pose: usize,
}

impl Kernel for PoseGradient<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<f64> {
        if self.evidence.training.rows(self.pose).is_empty() {
            return vec![0.0; self.hyper.to_logs().len()];
        }
        let shares = self.shares();
        self.contract(&shares)
    }
}

/// `(alpha alpha^T - P)[r, c] J[r, p] J[c, p]` summed over the pose's rows c and the columns p of a kind; by row r
/// while it is gathered, by pose in the end.
struct Shares {
    constant: Vec<f64>,
    classes: [Vec<f64>; 3],
    own: Vec<Vec<f64>>,
    noise: [f64; 2],
}

impl Shares {
    fn zeros(rows: usize, inputs: usize) -> Self {
        let zeros = || vec![0.0; rows];
        Self {
            constant: zeros(),
            classes: [zeros(), zeros(), zeros()],
            own: vec![zeros(); inputs],
            noise: [0.0; 2],
        }
    }

    /// Sums the rows of each pose.
    fn by_pose(self, poses: &[usize]) -> Self {
        let sum = |rows: Vec<f64>| {
            let mut sums = vec![0.0; poses[poses.len() - 1] - poses[0] + 1];
            poses.iter().zip(&rows).for_each(|(pose, value)| sums[pose - poses[0]] += value);
            sums
        };
        Self {
            constant: sum(self.constant),
            classes: self.classes.map(sum),
            own: self.own.into_iter().map(sum).collect(),
            noise: self.noise,
        }
    }
}

impl PoseGradient<'_> {
    #[inline(always)]
    fn shares(&self) -> Shares {
        let training = self.evidence.training;
        let by_column = &self.evidence.by_column;
        let rows = training.rows(self.pose);
        let first = rows.start;
        let mut shares = Shares::zeros(by_column.rows - first, by_column.own.len());
        let mut sums = ClassSums::default();
        let mut weights = vec![0.0; by_column.rows - first];
        for row in rows {
            sums.fill(by_column, row, first);
            self.weights(row, first, &mut weights);
            let own_variance = training.noise_variance(row, [0.0; 2]);
            let noise = training.noise_variance(row, self.hyper.noise) - own_variance;
            shares.noise[usize::from(training.is_orientation[row])] += weights[row - first] * noise;
            add_products(&mut shares.constant, &sums.constant, &weights, 1.0);
            for (share, sums) in shares.classes.iter_mut().zip(&sums.classes) {
                add_products(share, sums, &weights, 1.0);
            }
            for (own, share) in by_column.own.iter().zip(&mut shares.own) {
                let Some((p, lever)) = own else { continue };
                let factor = lever * lever * by_column.jacobian[p * by_column.rows + row];
                add_products(share, by_column.column(*p, first), &weights, factor);
            }
        }
        shares.by_pose(&by_column.pose[first..])
    }

    /// `(alpha alpha^T - P)[r, row]` for rows r from `first` on, doubled for the poses after this one.
    #[inline(always)]
    fn weights(&self, row: usize, first: usize, out: &mut [f64]) {
        let alpha = &self.restricted.alpha;
        let last = self.evidence.training.rows(self.pose).end - first;
        let projected = &self.restricted.projected.col_as_slice(row)[first..];
        for ((weight, entry), other) in out.iter_mut().zip(projected).zip(&alpha[first..]) {
            *weight = 2.0 * (alpha[row] * other - entry);
        }
        out[..last].iter_mut().for_each(|weight| *weight *= 0.5);
    }

    /// Kernels and their derivatives against the shares: half of d log evidence / d log hyper-parameter.
    fn contract(&self, shares: &Shares) -> Vec<f64> {
        let hyper = self.hyper;
        let mut gradient = vec![0.0; hyper.to_logs().len()];
        let noise = gradient.len() - 2;
        gradient[AT_CONSTANT] = hyper.constant.powi(2) * shares.constant.iter().sum::<f64>();
        let anew: f64 = shares.own.iter().map(|share| share[0]).sum();
        gradient[AT_REPEATABILITY] = hyper.repeatability.powi(2) * anew;
        gradient[noise] = shares.noise[0];
        gradient[noise + 1] = shares.noise[1];
        self.contract_single(shares, &mut gradient);
        let mut first = AT_PRODUCTS;
        for (product, kernels) in hyper.products.iter().zip(&self.kernels.products) {
            self.contract_product(product, kernels, shares, &mut gradient[first..first + product.len()]);
            first += product.len();
        }
        gradient
    }

    /// `own`, `sag` and `smooth`.
    fn contract_single(&self, shares: &Shares, gradient: &mut [f64]) {
        let hyper = self.hyper;
        let inputs = self.evidence.training.inputs.len();
        let loads = &self.evidence.loads.0[self.pose];
        for i in 0..shares.constant.len() {
            let range = i * inputs..(i + 1) * inputs;
            for (own, share) in self.kernels.own[range.clone()].iter().zip(&shares.own) {
                let share = hyper.own.powi(2) * share[i];
                gradient[AT_OWN] += share * own.kernel;
                gradient[AT_OWN_LENGTH] += 0.5 * share * own.by_log_length;
            }
            for (load, share) in loads[range.clone()].iter().zip(&shares.own) {
                gradient[AT_SAG] += hyper.sag.powi(2) * share[i] * load;
            }
            let smooth = &self.kernels.smooth[range];
            let kernel: f64 = smooth.iter().map(|value| value.kernel).sum();
            let slope: f64 = smooth.iter().map(|value| value.by_log_length).sum();
            for class in 0..3 {
                let share = hyper.smooth[class].powi(2) * shares.classes[class][i];
                gradient[AT_SMOOTH + class] += share * kernel;
                gradient[AT_SMOOTH_LENGTH] += 0.5 * share * slope;
            }
        }
    }

    /// One product: its amplitudes, then its lengths.
    fn contract_product(&self, product: &Product, kernels: &[f64], shares: &Shares, gradient: &mut [f64]) {
        let inputs = self.evidence.training.inputs.len();
        let distances = self.evidence.distances.0[self.pose].chunks_exact(inputs);
        for (i, (kernel, distances)) in kernels.iter().zip(distances).enumerate().take(shares.constant.len())
        {
            let mut total = 0.0;
            let classes = product.amplitudes.iter().zip(&shares.classes);
            for (slope, (amplitude, shares)) in gradient.iter_mut().zip(classes) {
                let share = amplitude.powi(2) * shares[i] * kernel;
                *slope += share;
                total += share;
            }
            for (k, exponent) in exponents(product, distances).enumerate() {
                gradient[3 + k] += total * exponent;
            }
        }
    }
}
