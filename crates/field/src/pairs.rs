//! Covariance of measured rows, column by column, from kernels between poses.
//!
//! For rows r of pose i and c of pose j,
//! `K[r, c] = sum_p J[r, p] J[c, p] (constant_p^2 + own^2 k_own + sag^2 k_sag + (smooth^2 k_smooth + sum product^2 k_product) of p's class)`,
//! and within one pose what its joints do not repeat.
//! The sums over the parameters of a class are formed first, for all rows at once, so that the inner loops run over
//! contiguous rows; nothing of the size of the matrix is kept but the matrix.

use rayon::prelude::*;
use truearm_kinematics::{Isa, Kernel, dispatch};

use crate::hyper::{Hyper, OWN_LEVER};
use crate::kernel::InputKind;
use crate::training::{Class, Training};

/// Kernels between one pose and all poses from it on (or all of another set), each (count,) long.
#[derive(Debug, Clone, Default)]
pub struct PairTable {
    pub own: Vec<Vec<f64>>,
    pub smooth: Vec<f64>,
    /// Of each input that is a joint, how alike its loads are.
    pub sag: Vec<Vec<f64>>,
    /// One for each product.
    pub products: Vec<Vec<f64>>,
}

impl PairTable {
    pub fn clear(&mut self, joints: usize, products: usize, count: usize) {
        self.own.resize(joints, Vec::new());
        self.sag.resize(joints, Vec::new());
        self.products.resize(products, Vec::new());
        let columns = self.own.iter_mut().chain(&mut self.sag).chain(&mut self.products);
        for column in columns.chain([&mut self.smooth]) {
            column.clear();
            column.resize(count, 0.0);
        }
    }
}

/// Kernels between poses of one training set.
pub trait PairKernels: Sync {
    /// Fills the table with kernels between pose `j` and poses `j..n`.
    fn fill(&self, j: usize, table: &mut PairTable);
}

/// The Jacobian by columns, with what each column is driven by.
pub struct ByColumn {
    pub rows: usize,
    /// (P, R).
    pub jacobian: Vec<f64>,
    /// Pose of each row.
    pub pose: Vec<usize>,
    /// Columns of each class that blocks drive.
    pub driven: [Vec<usize>; 3],
    /// Column and lever of each joint's `own` block.
    pub own: Vec<Option<(usize, f64)>>,
    /// Column and prior variance of each constant.
    pub constant: Vec<(usize, f64)>,
}

impl ByColumn {
    pub fn new(training: &Training) -> Self {
        let (rows, width) = (training.row_count(), training.columns.len());
        let mut jacobian = vec![0.0; rows * width];
        for row in 0..rows {
            for (p, value) in training.jacobian_row(row).iter().enumerate() {
                jacobian[p * rows + row] = *value;
            }
        }
        let of_class = |class: Class| {
            let wanted =
                |&p: &usize| training.columns[p].driven && Class::of(training.columns[p].parameter) == class;
            (0..width).filter(wanted).collect()
        };
        let mut own = vec![None; training.inputs.len()];
        for (p, column) in training.columns.iter().enumerate() {
            if let Some(joint) = column.own {
                let lever = if training.inputs[joint].kind == InputKind::Angle { 1.0 } else { OWN_LEVER };
                own[joint] = Some((p, lever));
            }
        }
        let constant = training.columns.iter().enumerate().filter(|(_, column)| column.constant > 0.0);
        Self {
            rows,
            jacobian,
            pose: (0..training.pose_count())
                .flat_map(|pose| training.rows(pose).map(move |_| pose))
                .collect(),
            driven: [of_class(Class::Theta), of_class(Class::Angle), of_class(Class::Length)],
            own,
            constant: constant.map(|(p, column)| (p, column.constant.powi(2))).collect(),
        }
    }

    /// Column `p` from row `first` on.
    #[inline(always)]
    pub fn column(&self, p: usize, first: usize) -> &[f64] {
        &self.jacobian[p * self.rows + first..(p + 1) * self.rows]
    }

    /// `out[r] = sum over p of J[r, p] weight_p J[c, p]` for rows r from `first` on.
    #[inline(always)]
    pub fn products(
        &self,
        terms: impl Iterator<Item = (usize, f64)>,
        row: usize,
        first: usize,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        for (p, weight) in terms {
            let factor = weight * self.jacobian[p * self.rows + row];
            for (sum, value) in out.iter_mut().zip(self.column(p, first)) {
                *sum += factor * value;
            }
        }
    }
}

/// Sums over the parameters of each class for one row c, over rows r from the pose's first on.
#[derive(Default)]
pub struct ClassSums {
    pub constant: Vec<f64>,
    pub classes: [Vec<f64>; 3],
}

impl ClassSums {
    #[inline(always)]
    pub fn fill(&mut self, by_column: &ByColumn, row: usize, first: usize) {
        let count = by_column.rows - first;
        self.constant.resize(count, 0.0);
        by_column.products(by_column.constant.iter().copied(), row, first, &mut self.constant);
        for (class, sums) in self.classes.iter_mut().enumerate() {
            sums.resize(count, 0.0);
            by_column.products(by_column.driven[class].iter().map(|&p| (p, 1.0)), row, first, sums);
        }
    }
}

/// Prior covariances of one pose with the rows from its first on, by what they multiply.
#[derive(Default)]
struct RowFactors {
    classes: [Vec<f64>; 3],
    own: Vec<Vec<f64>>,
}

impl RowFactors {
    /// Kernels times amplitudes, repeated for each pose's rows.
    fn fill(
        &mut self,
        by_column: &ByColumn,
        hyper: &Hyper,
        table: &PairTable,
        (pose, first): (usize, usize),
    ) {
        let poses = &by_column.pose[first..];
        for (class, factors) in self.classes.iter_mut().enumerate() {
            let smooth = hyper.smooth[class].powi(2);
            factors.clear();
            factors.extend(poses.iter().map(|i| smooth * table.smooth[i - pose]));
            for (product, kernels) in hyper.products.iter().zip(&table.products) {
                let variance = product.amplitudes[class].powi(2);
                let terms = poses.iter().map(|i| variance * kernels[i - pose]);
                factors.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
        self.own.resize(by_column.own.len(), Vec::new());
        let tables = table.own.iter().zip(&table.sag);
        for ((factors, (kernels, loads)), own) in self.own.iter_mut().zip(tables).zip(&by_column.own) {
            let lever = own.map_or(0.0, |(_, lever)| lever);
            let sag = (hyper.sag * lever).powi(2);
            let (variance, anew) = ((hyper.own * lever).powi(2), (hyper.repeatability * lever).powi(2));
            factors.clear();
            factors.extend(poses.iter().map(|i| {
                let varying = variance * kernels[i - pose] + sag * loads[i - pose];
                varying + if *i == pose { anew } else { 0.0 }
            }));
        }
    }
}

struct PoseColumns<'a> {
    training: &'a Training,
    by_column: &'a ByColumn,
    hyper: &'a Hyper,
    factors: &'a RowFactors,
    pose: usize,
    out: &'a mut [f64],
}

impl Kernel for PoseColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { training, by_column, hyper, factors, pose, out } = self;
        let rows = training.rows(pose);
        let first = rows.start;
        let mut sums = ClassSums::default();
        for (k, row) in rows.enumerate() {
            let column = &mut out[k * by_column.rows + first..(k + 1) * by_column.rows];
            sums.fill(by_column, row, first);
            let constant = hyper.constant * hyper.constant;
            for (value, sum) in column.iter_mut().zip(&sums.constant) {
                *value = constant * sum;
            }
            for (sums, factors) in sums.classes.iter().zip(&factors.classes) {
                add_products(column, sums, factors, 1.0);
            }
            for (own, factors) in by_column.own.iter().zip(&factors.own) {
                let Some((p, _)) = own else { continue };
                add_products(
                    column,
                    by_column.column(*p, first),
                    factors,
                    by_column.jacobian[p * by_column.rows + row],
                );
            }
        }
    }
}

/// `out += scale a b`, element by element.
#[inline(always)]
pub fn add_products(out: &mut [f64], a: &[f64], b: &[f64], scale: f64) {
    for ((value, x), y) in out.iter_mut().zip(a).zip(b) {
        *value += scale * x * y;
    }
}

/// The lower triangle of the rows' covariance with noise on its diagonal, column-major (R, R).
pub fn covariance(
    training: &Training,
    by_column: &ByColumn,
    hyper: &Hyper,
    kernels: &impl PairKernels,
) -> Vec<f64> {
    let rows = by_column.rows;
    let mut matrix = vec![0.0; rows * rows];
    let scratch = || (PairTable::default(), RowFactors::default());
    by_pose(training, &mut matrix).into_par_iter().for_each_init(scratch, |(table, factors), (pose, out)| {
        kernels.fill(pose, table);
        factors.fill(by_column, hyper, table, (pose, training.rows(pose).start));
        dispatch(PoseColumns { training, by_column, hyper, factors, pose, out });
    });
    for row in 0..rows {
        matrix[row * rows + row] += training.noise_variance(row, hyper.noise);
    }
    matrix
}

/// Columns of the matrix that belong to each pose.
fn by_pose<'a>(training: &Training, matrix: &'a mut [f64]) -> Vec<(usize, &'a mut [f64])> {
    let rows = training.row_count();
    let mut rest = matrix;
    let mut parts = Vec::with_capacity(training.pose_count());
    for pose in 0..training.pose_count() {
        let (head, tail) = rest.split_at_mut(training.rows(pose).len() * rows);
        parts.push((pose, head));
        rest = tail;
    }
    parts
}
