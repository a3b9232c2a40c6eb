//! Exact Gaussian inference of the cells' weights from all measured rows, in data space.
//!
//! With K the covariance of the rows that cells and noise imply, and flat set-up columns S,
//! `s = (S^T K^-1 S)^-1 S^T K^-1 r`, `alpha = K^-1 (r - S s)`, and the weights are prior covariance times
//! excitations times Jacobian times alpha (universal kriging; Rasmussen and Williams 2006, section 2.7).

use faer::{Mat, MatMut, MatRef};
use truearm_estimate::dense::{Cholesky, column, parallelism, to_vec};

use crate::FieldError;
use crate::bank::{Bank, Block};
use crate::cells::{Active, Axis, CellKernel, Grid};
use crate::hyper::{Hyper, Product};
use crate::kernel::{matern, squared_exponential};
use crate::pairs::{ByColumn, PairKernels, PairTable, covariance};
use crate::training::Training;

/// Cells per length scale: `own` curves have a rougher kernel and cost little.
const OWN_CELLS: f64 = 3.0;
const CELLS: f64 = 2.0;

/// Cell priors of all blocks under given hyper-parameters.
#[derive(Debug, Clone)]
pub struct Cells {
    /// One per input; `None` where no parameter is driven.
    pub own: Vec<Option<CellKernel>>,
    /// One per input.
    pub smooth: Vec<CellKernel>,
    /// Inputs and cells of each product.
    pub products: Vec<Vec<(usize, CellKernel)>>,
}

impl Cells {
    /// Cells that cover the values of a training set.
    pub fn new(training: &Training, by_column: &ByColumn, hyper: &Hyper, degree: usize) -> Self {
        let axis = |k: usize, length: f64, per_length: f64| {
            let values = (0..training.pose_count()).map(|pose| training.values_of(pose)[k]);
            Axis::covering(training.inputs[k], values, length, per_length, degree)
        };
        let own = |k: usize| {
            let axis = axis(k, hyper.own_length, OWN_CELLS);
            by_column.own[k].map(|_| CellKernel::new(axis, |d| matern(d, hyper.own_length)))
        };
        let smooth = |k: usize, length: f64| {
            CellKernel::new(axis(k, length, CELLS), |d| squared_exponential(d, length))
        };
        let product = |product: &Product| {
            let joints = product.joints.iter().zip(&product.lengths);
            joints.map(|(&k, &length)| (k, smooth(k, length))).collect()
        };
        Self {
            own: (0..training.inputs.len()).map(own).collect(),
            smooth: (0..training.inputs.len()).map(|k| smooth(k, hyper.smooth_length)).collect(),
            products: hyper.products.iter().map(product).collect(),
        }
    }

    /// The cells that one configuration excites.
    pub fn excite(&self, values: &[f64]) -> Excited {
        Excited {
            own: self
                .own
                .iter()
                .zip(values)
                .map(|(cells, &v)| cells.as_ref().map(|c| c.axis.active(v)))
                .collect(),
            smooth: self.smooth.iter().zip(values).map(|(cells, &v)| cells.axis.active(v)).collect(),
            products: self
                .products
                .iter()
                .map(|axes| axes.iter().map(|(k, cells)| cells.axis.active(values[*k])).collect())
                .collect(),
        }
    }

    /// Prior correlations of two configurations.
    fn kernels(&self, a: &Excited, b: &Excited) -> Correlations {
        let own = self.own.iter().zip(a.own.iter().zip(&b.own)).map(|(cells, pair)| match (cells, pair) {
            (Some(cells), (Some(a), Some(b))) => cells.implied(a, b),
            _ => 0.0,
        });
        let smooth = self.smooth.iter().zip(a.smooth.iter().zip(&b.smooth));
        let product = |(axes, (a, b)): (&Vec<(usize, CellKernel)>, (&Vec<Active>, &Vec<Active>))| {
            axes.iter().zip(a.iter().zip(b)).map(|((_, cells), (a, b))| cells.implied(a, b)).product()
        };
        Correlations {
            own: own.collect(),
            smooth: smooth.map(|(cells, (a, b))| cells.implied(a, b)).sum(),
            products: self.products.iter().zip(a.products.iter().zip(&b.products)).map(product).collect(),
        }
    }
}

/// Prior correlations of two configurations, by block.
struct Correlations {
    own: Vec<f64>,
    smooth: f64,
    products: Vec<f64>,
}

/// Excited cells of one configuration.
#[derive(Debug, Clone)]
pub struct Excited {
    own: Vec<Option<Active>>,
    smooth: Vec<Active>,
    products: Vec<Vec<Active>>,
}

struct Implied<'a> {
    cells: &'a Cells,
    excited: &'a [Excited],
}

impl PairKernels for Implied<'_> {
    fn fill(&self, j: usize, table: &mut PairTable) {
        table.clear(self.cells.own.len(), self.cells.products.len(), self.excited.len() - j);
        for (i, other) in self.excited[j..].iter().enumerate() {
            let kernels = self.cells.kernels(&self.excited[j], other);
            table.own.iter_mut().zip(kernels.own).for_each(|(column, value)| column[i] = value);
            table.smooth[i] = kernels.smooth;
            table.products.iter_mut().zip(kernels.products).for_each(|(column, value)| column[i] = value);
        }
    }
}

/// What the rows say of constants, field and set-up together.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Correction of each column's constant, (P,).
    pub constant: Vec<f64>,
    /// The field.
    pub bank: Bank,
    /// Set-up step, (s,), in the training's scaled unknowns.
    pub setup: Vec<f64>,
    /// P r, (R,).
    pub alpha: Vec<f64>,
}

/// The posterior of one training set under given hyper-parameters.
pub struct Posterior {
    /// The rows.
    pub training: Training,
    /// The hyper-parameters.
    pub hyper: Hyper,
    /// The cells' priors.
    pub cells: Cells,
    by_column: ByColumn,
    excited: Vec<Excited>,
    factor: Cholesky,
    /// K^-1 S.
    spread: Mat<f64>,
    /// Factor of S^T K^-1 S.
    inner: Cholesky,
}

impl Posterior {
    /// Factors the covariance of the rows.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn new(training: Training, hyper: Hyper, degree: usize) -> Result<Self, FieldError> {
        let by_column = ByColumn::new(&training);
        let cells = Cells::new(&training, &by_column, &hyper, degree);
        let excited: Vec<Excited> =
            (0..training.pose_count()).map(|pose| cells.excite(training.values_of(pose))).collect();
        let rows = training.row_count();
        let error = || FieldError::NotPositiveDefinite { rows };
        let matrix = covariance(&training, &by_column, &hyper, &Implied { cells: &cells, excited: &excited });
        let dense = MatRef::from_column_major_slice(&matrix, rows, rows).to_owned();
        drop(matrix);
        let factor = Cholesky::new(dense, parallelism()).ok_or_else(error)?;
        let setup = MatRef::from_row_major_slice(&training.setup, rows, training.setup_width);
        let mut spread = setup.to_owned();
        factor.solve(spread.as_mut());
        let inner = Cholesky::new(setup_precision(setup, &spread), faer::Par::Seq).ok_or_else(error)?;
        Ok(Self { training, hyper, cells, by_column, excited, factor, spread, inner })
    }

    /// Constants, field and set-up from residuals (R,).
    pub fn solve(&self, residual: &[f64]) -> Solution {
        let rows = self.training.row_count();
        let setup = MatRef::from_row_major_slice(&self.training.setup, rows, self.training.setup_width);
        let right = to_vec((self.spread.transpose() * column(residual)).as_ref());
        let step = if right.is_empty() { Vec::new() } else { self.inner.solve_vector(&right) };
        let rest = column(residual) - setup * column(&step);
        let alpha = self.factor.solve_vector(&to_vec(rest.as_ref()));
        let pull = self.pull(&alpha);
        let columns = &self.training.columns;
        let constant = |p: usize| {
            let total: f64 = (0..self.training.pose_count()).map(|pose| pull[pose * columns.len() + p]).sum();
            (self.hyper.constant * columns[p].constant).powi(2) * total
        };
        Solution {
            constant: (0..columns.len()).map(constant).collect(),
            bank: self.bank(&pull),
            setup: step,
            alpha,
        }
    }

    /// J_i^T alpha_i of every pose, (n, P).
    fn pull(&self, alpha: &[f64]) -> Vec<f64> {
        let width = self.training.columns.len();
        let mut pull = vec![0.0; self.training.pose_count() * width];
        for (pose, out) in pull.chunks_exact_mut(width).enumerate() {
            for row in self.training.rows(pose) {
                let entries = self.training.jacobian_row(row);
                out.iter_mut().zip(entries).for_each(|(x, entry)| *x += entry * alpha[row]);
            }
        }
        pull
    }

    fn bank(&self, pull: &[f64]) -> Bank {
        let mut bank = Bank::empty(self.training.inputs.len(), self.training.parameter_count);
        for (k, own) in self.by_column.own.iter().enumerate() {
            if let (Some((p, lever)), Some(cells)) = (own, &self.cells.own[k]) {
                let variance = (self.hyper.own * lever).powi(2);
                bank.blocks.push(self.block("own", &[(k, cells)], &[(*p, variance)], pull));
            }
        }
        for (k, cells) in self.cells.smooth.iter().enumerate() {
            bank.blocks.push(self.block("smooth", &[(k, cells)], &self.driven(&self.hyper.smooth), pull));
        }
        for (axes, product) in self.cells.products.iter().zip(&self.hyper.products) {
            let axes: Vec<_> = axes.iter().map(|(k, cells)| (*k, cells)).collect();
            bank.blocks.push(self.block(&product.name, &axes, &self.driven(&product.amplitudes), pull));
        }
        bank
    }

    /// Driven columns with their prior variances.
    fn driven(&self, amplitudes: &[f64; 3]) -> Vec<(usize, f64)> {
        let classes = self.by_column.driven.iter().zip(amplitudes);
        let mut driven: Vec<_> =
            classes.flat_map(|(columns, a)| columns.iter().map(move |&p| (p, a * a))).collect();
        driven.sort_by_key(|entry| entry.0);
        driven
    }

    /// Weights of one block: excitations times pull, spread by the prior along each axis.
    fn block(
        &self,
        name: &str,
        axes: &[(usize, &CellKernel)],
        driven: &[(usize, f64)],
        pull: &[f64],
    ) -> Block {
        let grid = Grid {
            inputs: axes.iter().map(|axis| axis.0).collect(),
            axes: axes.iter().map(|axis| axis.1.axis.clone()).collect(),
        };
        let (width, columns) = (driven.len(), self.training.columns.len());
        let mut weights = vec![0.0; grid.cell_count() * width];
        for pose in 0..self.training.pose_count() {
            let source = &pull[pose * columns..(pose + 1) * columns];
            grid.visit(self.training.values_of(pose), |cell, grade| {
                let target = &mut weights[cell * width..(cell + 1) * width];
                for (weight, &(p, variance)) in target.iter_mut().zip(driven) {
                    *weight += grade * variance * source[p];
                }
            });
        }
        let mut inner = width;
        for (_, cells) in axes.iter().rev() {
            weights = cells.spread(&weights, inner);
            inner *= cells.axis.count;
        }
        let outputs = driven.iter().map(|&(p, _)| self.training.columns[p].parameter).collect();
        Block { name: name.to_owned(), grid, outputs, weights }
    }

    /// Residuals that each pose would have if it had taken no part, with their covariance's factor applied:
    /// standardised (R,), and the residuals themselves (R,).
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`] where a pose's share of the precision is not.
    pub fn leave_one_out(&self, alpha: &[f64]) -> Result<LeaveOneOut, FieldError> {
        let rows = self.training.row_count();
        let inverse = self.factor.inverse();
        let mut root = self.spread.transpose().to_owned();
        self.inner.solve_lower(root.as_mut());
        let mut out = LeaveOneOut { residual: vec![0.0; rows], standardised: vec![0.0; rows] };
        for pose in 0..self.training.pose_count() {
            let range = self.training.rows(pose);
            let (start, count) = (range.start, range.len());
            let block = Mat::from_fn(count, count, |i, j| {
                let setup: f64 = (0..root.nrows()).map(|k| root[(k, start + i)] * root[(k, start + j)]).sum();
                inverse[(start + i, start + j)] - setup
            });
            let error = || FieldError::NotPositiveDefinite { rows: count };
            let precision = Cholesky::new(block, faer::Par::Seq).ok_or_else(error)?;
            let local: Vec<f64> = range.map(|row| alpha[row]).collect();
            let left_out = precision.solve_vector(&local);
            let mut standardised = column(&left_out);
            let spread = self.at_full_weight(precision.inverse(), start);
            Cholesky::new(spread, faer::Par::Seq).ok_or_else(error)?.solve_lower(standardised.as_mut());
            out.residual[start..start + count].copy_from_slice(&left_out);
            out.standardised[start..start + count].copy_from_slice(&to_vec(standardised.as_ref()));
        }
        Ok(out)
    }

    /// Covariance of a pose's left-out residual as it would be if its rows had their full weight.
    fn at_full_weight(&self, mut covariance: Mat<f64>, start: usize) -> Mat<f64> {
        for i in 0..covariance.nrows() {
            let row = start + i;
            let noise = self.training.noise_variance(row, self.hyper.noise);
            covariance[(i, i)] -= noise * (1.0 - self.training.weight[row]);
        }
        covariance
    }

    /// Covariance of `J* CEP(q*)` of new poses: rows (m, P) of each, inputs (n, I); returns (n, m, m).
    ///
    /// # Errors
    /// [`FieldError::Length`].
    pub fn arm_covariance(
        &self,
        values: &[f64],
        jacobian: &[f64],
        rows: usize,
    ) -> Result<Vec<f64>, FieldError> {
        let inputs = self.training.inputs.len();
        let count = values.len() / inputs;
        let expected = count * rows * self.training.columns.len();
        if jacobian.len() != expected {
            return Err(FieldError::Length { what: "jacobian", found: jacobian.len(), expected });
        }
        let mut out = vec![0.0; count * rows * rows];
        const BATCH: usize = 64;
        for first in (0..count).step_by(BATCH) {
            let last = (first + BATCH).min(count);
            self.batch_covariance(values, jacobian, rows, first..last, &mut out);
        }
        Ok(out)
    }

    fn batch_covariance(
        &self,
        values: &[f64],
        jacobian: &[f64],
        rows: usize,
        poses: std::ops::Range<usize>,
        out: &mut [f64],
    ) {
        let (inputs, columns) = (self.training.inputs.len(), self.training.columns.len());
        let mut cross = Mat::zeros(self.training.row_count(), poses.len() * rows);
        let mut priors = Vec::new();
        for (index, pose) in poses.clone().enumerate() {
            let excited = self.cells.excite(&values[pose * inputs..(pose + 1) * inputs]);
            let own_rows = &jacobian[pose * rows * columns..(pose + 1) * rows * columns];
            let columns_of_pose = cross.as_mut().subcols_mut(index * rows, rows);
            self.cross(&excited, own_rows, columns_of_pose);
            priors.push(self.variances(&excited, &excited));
        }
        let back = self.spread.transpose() * &cross;
        let mut reduced = cross;
        self.factor.solve_lower(reduced.as_mut());
        let mut setup = back;
        self.inner.solve_lower(setup.as_mut());
        for (index, pose) in poses.enumerate() {
            let own_rows = &jacobian[pose * rows * columns..(pose + 1) * rows * columns];
            for i in 0..rows {
                for j in 0..rows {
                    let (a, b) = (index * rows + i, index * rows + j);
                    let prior: f64 = (0..columns)
                        .map(|p| own_rows[i * columns + p] * own_rows[j * columns + p] * priors[index][p])
                        .sum();
                    let learned = reduced.col(a).transpose() * reduced.col(b);
                    let lost = setup.col(a).transpose() * setup.col(b);
                    out[(pose * rows + i) * rows + j] = prior - learned + lost;
                }
            }
        }
    }

    /// Prior covariance of each column's CEP at two configurations, (P,).
    fn variances(&self, a: &Excited, b: &Excited) -> Vec<f64> {
        let kernels = self.cells.kernels(a, b);
        let mut variances: Vec<f64> = self
            .training
            .columns
            .iter()
            .map(|column| (self.hyper.constant * column.constant).powi(2))
            .collect();
        for (class, columns) in self.by_column.driven.iter().enumerate() {
            let products = self.hyper.products.iter().zip(&kernels.products);
            let products: f64 = products.map(|(product, k)| product.amplitudes[class].powi(2) * k).sum();
            let value = self.hyper.smooth[class].powi(2) * kernels.smooth + products;
            columns.iter().for_each(|&p| variances[p] += value);
        }
        for (k, entry) in self.by_column.own.iter().enumerate() {
            if let Some((p, lever)) = entry {
                variances[*p] += (self.hyper.own * lever).powi(2) * kernels.own[k];
            }
        }
        variances
    }

    /// Covariance of all training rows with the rows (m, P) of one configuration: (R, m).
    fn cross(&self, excited: &Excited, rows: &[f64], mut out: MatMut<f64>) {
        let columns = self.training.columns.len();
        for pose in 0..self.training.pose_count() {
            let variances = self.variances(excited, &self.excited[pose]);
            for row in self.training.rows(pose) {
                let entries = self.training.jacobian_row(row);
                for (k, own) in rows.chunks_exact(columns).enumerate() {
                    out[(row, k)] = (0..columns).map(|p| entries[p] * variances[p] * own[p]).sum();
                }
            }
        }
    }
}

/// S^T K^-1 S, with the precision of a set-up that is known to a metre and a radian: flat, but never singular.
pub fn setup_precision(setup: MatRef<f64>, spread: &Mat<f64>) -> Mat<f64> {
    setup.transpose() * spread + Mat::<f64>::identity(setup.ncols(), setup.ncols())
}

/// Leave-one-pose-out residuals.
#[derive(Debug, Clone)]
pub struct LeaveOneOut {
    /// (R,), m or rad.
    pub residual: Vec<f64>,
    /// (R,), standard normal if the model is right.
    pub standardised: Vec<f64>,
}
