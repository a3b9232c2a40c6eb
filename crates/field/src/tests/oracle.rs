//! The slow and obvious way: every covariance written out, set-up unknowns as further unknowns with unit priors.

use std::f64::consts::TAU;

use faer::{Mat, Par};
use truearm_bank::{CellKernel, InputKind};
use truearm_estimate::dense::{Cholesky, column};
use truearm_kinematics::ANGLE_ARM;

use crate::hyper::Hyper;
use crate::hyper_prior::HyperPrior;
use crate::model::Model;
use crate::training::{Class, Training};

/// Correlations of two configurations.
pub trait Kernels {
    fn own(&self, input: usize, a: f64, b: f64) -> f64;
    fn smooth(&self, input: usize, a: f64, b: f64) -> f64;
    /// Of axis `axis` of product `product`, which varies with `input`.
    fn product(&self, product: usize, axis: usize, input: usize, a: f64, b: f64) -> f64;
    fn wave(&self, wave: usize, a: f64, b: f64) -> f64;
}

/// The formulas.
pub struct Exact<'a>(pub &'a Training, pub &'a Hyper);

impl Exact<'_> {
    fn squared_exponential(&self, input: usize, a: f64, b: f64, length: f64) -> f64 {
        (-self.distance(input, a, b) / length.powi(2)).exp()
    }

    fn ripple(&self, input: usize, difference: f64) -> f64 {
        let cycles = if self.0.inputs[input].kind == InputKind::Angle { self.1.own_cycles } else { 0.0 };
        let (whole, part) = (cycles.floor(), cycles.fract());
        (1.0 - part) * (whole * difference).cos() + part * ((whole + 1.0) * difference).cos()
    }

    fn distance(&self, input: usize, a: f64, b: f64) -> f64 {
        let difference = self.0.inputs[input].scale * (a - b);
        match self.0.inputs[input].kind {
            InputKind::Angle => 1.0 - difference.cos(),
            InputKind::Line => 0.5 * difference.powi(2),
        }
    }
}

impl Kernels for Exact<'_> {
    fn own(&self, input: usize, a: f64, b: f64) -> f64 {
        let r = (2.0 * self.distance(input, a, b)).max(0.0).sqrt() / self.1.own_length;
        let s = 5f64.sqrt() * r;
        (1.0 + s + 5.0 * r * r / 3.0) * (-s).exp() * self.ripple(input, a - b)
    }

    fn smooth(&self, input: usize, a: f64, b: f64) -> f64 {
        let line = self.0.inputs[input].kind == InputKind::Line;
        self.squared_exponential(
            input,
            a,
            b,
            if line { self.1.smooth_line_length } else { self.1.smooth_length },
        )
    }

    fn product(&self, product: usize, axis: usize, input: usize, a: f64, b: f64) -> f64 {
        self.squared_exponential(input, a, b, self.1.products[product].lengths[axis])
    }

    fn wave(&self, wave: usize, a: f64, b: f64) -> f64 {
        (self.1.waves[wave].cycles * (a - b)).cos()
    }
}

/// A value as many whole cells away as bring it among the cells: its own variance does not end with them.
fn inside(cells: &CellKernel, value: f64) -> f64 {
    let axis = &cells.axis;
    let middle = 0.5 * (axis.centre(0) + axis.centre(axis.count - 1));
    let mut offset = axis.input.scale * value - middle;
    if axis.input.kind == InputKind::Angle {
        offset -= TAU * (offset / TAU).round();
    }
    (middle + offset.rem_euclid(axis.spacing)) / axis.input.scale
}

/// What cells imply.
pub struct OfCells<'a>(pub &'a Model);

fn implied(cells: &CellKernel, a: f64, b: f64) -> f64 {
    let grades = |value: f64| cells.axis.active(value).nonzero().collect::<Vec<(usize, f64)>>();
    let (a, b) = if a == b { (inside(cells, a), inside(cells, b)) } else { (a, b) };
    let (a, b) = (grades(a), grades(b));
    let pairs = a.iter().flat_map(|x| b.iter().map(move |y| (x, y)));
    pairs.map(|((i, x), (j, y))| x * cells.correlation[i.abs_diff(*j)] * y).sum()
}

impl Kernels for OfCells<'_> {
    fn own(&self, input: usize, a: f64, b: f64) -> f64 {
        self.0.cells.own[input].as_ref().map_or(0.0, |cells| implied(cells, a, b))
    }

    fn smooth(&self, input: usize, a: f64, b: f64) -> f64 {
        implied(&self.0.cells.smooth[input], a, b)
    }

    fn product(&self, product: usize, axis: usize, input: usize, a: f64, b: f64) -> f64 {
        let (found, cells) = &self.0.cells.products[product][axis];
        assert_eq!(*found, input);
        implied(cells, a, b)
    }

    fn wave(&self, wave: usize, a: f64, b: f64) -> f64 {
        implied(&self.0.cells.waves[wave].1, a, b)
    }
}

/// Gaussian inference written out.
pub struct Oracle<'a, K> {
    training: &'a Training,
    hyper: &'a Hyper,
    kernels: K,
    factor: Option<Cholesky>,
}

/// Prior variances of each column: of the constant, and of what varies.
pub struct Variances {
    pub constant: Vec<f64>,
    pub varying: Vec<f64>,
}

impl<'a, K: Kernels> Oracle<'a, K> {
    pub fn new(training: &'a Training, hyper: &'a Hyper, kernels: K) -> Self {
        let mut oracle = Self { training, hyper, kernels, factor: None };
        oracle.factor = Cholesky::new(oracle.covariance(), Par::Seq);
        oracle
    }

    pub fn variances(&self, a: &[f64], b: &[f64]) -> Variances {
        let hyper = self.hyper;
        let driven: Vec<f64> = (0..hyper.smooth.len()).map(|class| self.driven(class, a, b)).collect();
        let of = |column: &crate::Column| {
            let mut sum = if column.driven { driven[Class::of(column.parameter).index()] } else { 0.0 };
            if let Some(k) = column.own {
                if self.training.has_curve(k) {
                    sum += (hyper.own * self.lever(k)).powi(2) * self.kernels.own(k, a[k], b[k]);
                }
                sum += (hyper.sag * self.lever(k)).powi(2) * self.loads(k, a, b);
                for (index, wave) in hyper.waves.iter().enumerate().filter(|(_, wave)| wave.joint == k) {
                    sum += (wave.amplitude * self.lever(k)).powi(2) * self.kernels.wave(index, a[k], b[k]);
                }
            }
            sum
        };
        let columns = &self.training.columns;
        Variances {
            constant: columns
                .iter()
                .map(|column| (hyper.constant[Class::of(column.parameter).index()] * column.constant).powi(2))
                .collect(),
            varying: columns.iter().map(of).collect(),
        }
    }

    /// Of columns of a class that vary with all inputs.
    fn driven(&self, class: usize, a: &[f64], b: &[f64]) -> f64 {
        let hyper = self.hyper;
        let one = |k: usize| hyper.smooth[class].powi(2) * self.kernels.smooth(k, a[k], b[k]);
        let smooth: f64 = (0..self.training.input_count()).map(one).sum();
        let several = |(index, product): (usize, &crate::hyper::Product)| {
            let factor = |(axis, &k): (usize, &usize)| self.kernels.product(index, axis, k, a[k], b[k]);
            let kernel: f64 = product.joints.iter().enumerate().map(factor).product();
            product.amplitudes[class].powi(2) * kernel
        };
        smooth + hyper.products.iter().enumerate().map(several).sum::<f64>()
    }

    /// Sum of the products of a joint's levers.
    fn loads(&self, joint: usize, a: &[f64], b: &[f64]) -> f64 {
        let geometry = &self.training.geometry;
        let pairs = geometry.joints().zip(geometry.at(a).into_iter().zip(geometry.at(b)));
        pairs.filter(|(owner, _)| *owner == joint).map(|(_, (x, y))| x * y).sum()
    }

    fn lever(&self, input: usize) -> f64 {
        if self.training.inputs[input].kind == InputKind::Line { ANGLE_ARM } else { 1.0 }
    }

    fn setup_row(&self, row: usize) -> &[f64] {
        let width = self.training.setup_width;
        &self.training.setup[row * width..(row + 1) * width]
    }

    /// Prior covariance of two rows that the set-up brings.
    fn of_setup(&self, a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).zip(&self.training.setup_precision).map(|((x, y), known)| x * y / known).sum()
    }

    fn pose_of(&self, row: usize) -> usize {
        (0..self.training.pose_count()).find(|&pose| self.training.rows(pose).contains(&row)).unwrap()
    }

    /// Covariance of all rows, the set-up's share included, (R, R).
    pub fn covariance(&self) -> Mat<f64> {
        let training = self.training;
        let rows = training.row_count();
        let mut matrix = Mat::zeros(rows, rows);
        for i in 0..training.pose_count() {
            for j in 0..=i {
                let v = self.variances(training.values_of(i), training.values_of(j));
                let total: Vec<f64> = v.constant.iter().zip(&v.varying).map(|(a, b)| a + b).collect();
                for r in training.rows(i) {
                    for c in training.rows(j) {
                        let arm = inner(training.jacobian_row(r), &total, training.jacobian_row(c));
                        matrix[(r, c)] = arm + self.of_setup(self.setup_row(r), self.setup_row(c));
                        if i == j {
                            matrix[(r, c)] += self.anew(training.jacobian_row(r), training.jacobian_row(c));
                        }
                        matrix[(c, r)] = matrix[(r, c)];
                    }
                }
            }
        }
        (0..rows).for_each(|row| matrix[(row, row)] += training.noise_variance(row, self.hyper.noise));
        matrix
    }

    /// What joints do not repeat.
    pub fn anew(&self, a: &[f64], b: &[f64]) -> f64 {
        let of = |(p, column): (usize, &crate::Column)| {
            let drive = column.own.filter(|&k| self.training.has_curve(k));
            let missed =
                |k: usize| self.hyper.repeatability * self.hyper.unevenness[self.training.joint_of(k)];
            drive.map_or(0.0, |k| a[p] * b[p] * (missed(k) * self.lever(k)).powi(2))
        };
        self.training.columns.iter().enumerate().map(of).sum()
    }

    fn factor(&self) -> &Cholesky {
        self.factor.as_ref().unwrap()
    }

    /// Logarithm of evidence and priors.
    pub fn evidence(&self) -> f64 {
        let factor = self.factor();
        let residual = &self.training.residual;
        let explained = factor.log_determinant() + dot(residual, &factor.solve_vector(residual));
        HyperPrior::new(self.hyper).value() - 0.5 * explained
    }

    /// Constants, set-up, and the varying part at a configuration.
    pub fn solution(&self, residual: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let training = self.training;
        let alpha = self.factor().solve_vector(residual);
        let mut constant = vec![0.0; training.columns.len()];
        let mut varying = constant.clone();
        let mut setup = vec![0.0; training.setup_width];
        for (row, weight) in alpha.iter().enumerate() {
            let v = self.variances(values, training.values_of(self.pose_of(row)));
            for (p, entry) in training.jacobian_row(row).iter().enumerate() {
                constant[p] += v.constant[p] * entry * weight;
                varying[p] += v.varying[p] * entry * weight;
            }
            for ((sum, entry), known) in
                setup.iter_mut().zip(self.setup_row(row)).zip(&training.setup_precision)
            {
                *sum += entry * weight / known;
            }
        }
        (constant, setup, varying)
    }

    /// Posterior covariance (P, P) of the constants, row-major: the prior without what a unit residual of every row tells.
    pub fn constants(&self) -> Vec<f64> {
        let training = self.training;
        let (rows, columns) = (training.row_count(), training.columns.len());
        let prior = self.variances(training.values_of(0), training.values_of(0)).constant;
        let told: Vec<Vec<f64>> = (0..rows)
            .map(|row| {
                let unit: Vec<f64> = (0..rows).map(|other| f64::from(u8::from(other == row))).collect();
                let alpha = self.factor().solve_vector(&unit);
                let of = |p: usize| (0..rows).map(|r| training.jacobian_row(r)[p] * alpha[r]).sum::<f64>();
                (0..columns).map(|p| prior[p] * of(p)).collect()
            })
            .collect();
        let entry = |i: usize, j: usize| {
            let own = if i == j { prior[i] } else { 0.0 };
            own - (0..rows).map(|row| told[row][i] * training.jacobian_row(row)[j] * prior[j]).sum::<f64>()
        };
        (0..columns * columns).map(|k| entry(k / columns, k % columns)).collect()
    }

    /// Posterior covariance (m, m) of rows of a Jacobian (m, P) at a configuration, with set-up columns (m, s).
    pub fn posterior(&self, values: &[f64], jacobian: &[f64], setup: &[f64]) -> Mat<f64> {
        let training = self.training;
        let (columns, width) = (training.columns.len(), training.setup_width);
        let rows = jacobian.len() / columns;
        let line = |i: usize| &jacobian[i * columns..(i + 1) * columns];
        let own = |i: usize| &setup[i * width..(i + 1) * width];
        let total = |other: &[f64]| -> Vec<f64> {
            let v = self.variances(values, other);
            v.constant.iter().zip(&v.varying).map(|(a, b)| a + b).collect()
        };
        let mut cross = Mat::zeros(training.row_count(), rows);
        for row in 0..training.row_count() {
            let v = total(training.values_of(self.pose_of(row)));
            for i in 0..rows {
                cross[(row, i)] = inner(training.jacobian_row(row), &v, line(i))
                    + self.of_setup(self.setup_row(row), own(i));
            }
        }
        let mut solved = cross.clone();
        self.factor().solve(solved.as_mut());
        let here = total(values);
        let prior =
            Mat::from_fn(rows, rows, |i, j| inner(line(i), &here, line(j)) + self.of_setup(own(i), own(j)));
        prior - cross.transpose() * solved
    }
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn inner(a: &[f64], weights: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(weights).zip(b).map(|((x, w), y)| x * w * y).sum()
}

/// Quadratic form `x^T A^-1 x`.
pub fn squared(matrix: Mat<f64>, x: &[f64]) -> f64 {
    let mut z = column(x);
    Cholesky::new(matrix, Par::Seq).unwrap().solve_lower(z.as_mut());
    z.squared_norm_l2()
}
