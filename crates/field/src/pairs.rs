//! Covariance of measured rows, column by column, from kernels between poses.
//!
//! For rows r of pose i and c of pose j,
//! `K[r, c] = sum_p J[r, p] J[c, p] (constant^2 constant_p^2 + own^2 k_own + sag^2 k_sag + sum wave^2 k_wave + (smooth^2 k_smooth + sum product^2 k_product) of p's class)`,
//! and within one pose what its joints do not repeat.
//! The sums over the parameters of a class are formed first, for a step of rows r at once and in registers; nothing of the size
//! of the matrix is kept but the matrix.

use faer::prelude::ReborrowMut;
use faer::{ColRef, MatMut};
use rayon::prelude::*;
use truearm_bank::InputKind;
use truearm_kinematics::{ANGLE_ARM, Isa, Kernel, LANES, Lane, dispatch};

use crate::columns::Columns;
use crate::hyper::Hyper;
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
    /// One for each wave.
    pub waves: Vec<Vec<f64>>,
}

impl PairTable {
    /// Makes room for one pose with `count` others, all zero.
    pub fn clear(&mut self, joints: usize, products: usize, waves: usize, count: usize) {
        self.own.resize(joints, Vec::new());
        self.sag.resize(joints, Vec::new());
        self.products.resize(products, Vec::new());
        self.waves.resize(waves, Vec::new());
        let columns = self.own.iter_mut().chain(&mut self.sag).chain(&mut self.products);
        for column in columns.chain(&mut self.waves).chain([&mut self.smooth]) {
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
    /// (P, R), and room behind each column for a step.
    jacobian: Vec<f64>,
    /// Pose of each row.
    pub pose: Vec<usize>,
    /// Columns of each class that blocks drive.
    pub driven: [Vec<usize>; 3],
    /// Column and lever of each joint's `own` block, and of its `sag`.
    pub own: Vec<Option<(usize, f64)>>,
    /// Whether what the joint's drive leaves, curves and what it does not repeat, goes with this input.
    pub has_curve: Vec<bool>,
    /// The joint whose drive an input is of; joints count before features.
    pub joint: Vec<usize>,
    /// Column and prior variance of each constant.
    pub constant: Vec<(usize, f64)>,
    /// Columns that are summed together.
    groups: Vec<Group>,
}

/// Columns of one class with one prior variance of their constants.
struct Group {
    /// The class, by its index.
    class: usize,
    /// Whether its blocks drive them.
    driven: bool,
    constant: f64,
    columns: Vec<usize>,
}

/// Rows that are summed at a time: sums stay in registers.
pub const STEP: usize = 4 * LANES;
/// A number for each of a step's rows.
pub type Step = [Lane; STEP / LANES];

const NOTHING: Step = [Lane::ZERO; STEP / LANES];

impl ByColumn {
    /// Column and lever of each input's drive, where curves go with that input.
    pub fn curved(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let own = self.own.iter().zip(&self.has_curve).enumerate();
        own.filter(|(_, (_, has_curve))| **has_curve)
            .filter_map(|(k, (own, _))| own.map(|(p, lever)| (k, p, lever)))
    }

    /// The columns of a training set's Jacobian.
    pub fn new(training: &Training) -> Self {
        let (rows, width) = (training.row_count(), training.columns.len());
        let mut jacobian = vec![0.0; (rows + STEP) * width];
        for row in 0..rows {
            for (p, value) in training.jacobian_row(row).iter().enumerate() {
                jacobian[p * (rows + STEP) + row] = *value;
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
                let lever = if training.inputs[joint].kind == InputKind::Angle { 1.0 } else { ANGLE_ARM };
                own[joint] = Some((p, lever));
            }
        }
        let constant = training.columns.iter().enumerate().filter(|(_, column)| column.constant > 0.0);
        let mut groups: Vec<Group> = Vec::new();
        for (p, column) in training.columns.iter().enumerate() {
            let (class, driven) = (Class::of(column.parameter).index(), column.driven);
            let constant = column.constant.powi(2);
            let is_alike = |group: &&mut Group| {
                (group.class, group.driven) == (class, driven) && group.constant == constant
            };
            match groups.iter_mut().find(is_alike) {
                Some(group) => group.columns.push(p),
                None => groups.push(Group { class, driven, constant, columns: vec![p] }),
            }
        }
        Self {
            rows,
            jacobian,
            pose: (0..training.pose_count())
                .flat_map(|pose| training.rows(pose).map(move |_| pose))
                .collect(),
            driven: [of_class(Class::Theta), of_class(Class::Angle), of_class(Class::Length)],
            own,
            has_curve: (0..training.inputs.len()).map(|input| training.has_curve(input)).collect(),
            joint: (0..training.inputs.len()).map(|input| training.joint_of(input)).collect(),
            constant: constant.map(|(p, column)| (p, column.constant.powi(2))).collect(),
            groups,
        }
    }

    /// Entry of a row.
    #[inline(always)]
    pub fn entry(&self, p: usize, row: usize) -> f64 {
        self.jacobian[p * (self.rows + STEP) + row]
    }

    /// A step of column `p` from row `first` on, which is none behind the last; zeros behind the rows.
    #[inline(always)]
    pub fn step(&self, p: usize, first: usize) -> Step {
        let start = p * (self.rows + STEP) + first;
        step_at(&self.jacobian[start..start + STEP], 0)
    }

    /// Sums over the parameters of each class of the entries of a row times those of a step of rows from `first` on.
    #[inline(always)]
    pub fn class_sums<I: Isa>(&self, row: usize, first: usize) -> ClassSums {
        let mut sums = ClassSums { constants: [NOTHING; 3], classes: [NOTHING; 3] };
        for group in &self.groups {
            let mut sum = NOTHING;
            for &p in &group.columns {
                add_scaled::<I>(&mut sum, self.entry(p, row), &self.step(p, first));
            }
            add_scaled::<I>(&mut sums.constants[group.class], group.constant, &sum);
            if group.driven {
                add_scaled::<I>(&mut sums.classes[group.class], 1.0, &sum);
            }
        }
        sums
    }
}

/// Sums over the parameters of each class for one row c and a step of rows r.
pub struct ClassSums {
    /// Weighed with the prior variances of the constants.
    pub constants: [Step; 3],
    /// Of what blocks drive.
    pub classes: [Step; 3],
}

/// A step of numbers of whole steps.
#[inline(always)]
pub fn step_at(values: &[f64], start: usize) -> Step {
    let mut step = NOTHING;
    for (lane, values) in step.iter_mut().zip(values[start..start + STEP].as_chunks().0) {
        *lane = Lane(*values);
    }
    step
}

/// Writes a step of numbers of whole steps.
#[inline(always)]
pub fn write_step(out: &mut [f64], start: usize, step: &Step) {
    for (out, lane) in out[start..start + STEP].as_chunks_mut().0.iter_mut().zip(step) {
        *out = lane.0;
    }
}

/// `sum += factor values`.
#[inline(always)]
pub fn add_scaled<I: Isa>(sum: &mut Step, factor: f64, values: &Step) {
    for (sum, value) in sum.iter_mut().zip(values) {
        *sum = I::mul_add(Lane::splat(factor), *value, *sum);
    }
}

/// `sum += scale a b`.
#[inline(always)]
pub fn add_products<I: Isa>(sum: &mut Step, scale: f64, a: &Step, b: &Step) {
    for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
        *sum = I::mul_add(*a * scale, *b, *sum);
    }
}

/// Prior covariances of one pose with the rows from its first on, by what they multiply.
#[derive(Default)]
struct RowFactors {
    classes: [Vec<f64>; 3],
    own: Vec<Vec<f64>>,
    by_pose: Vec<f64>,
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
        let by_pose = &mut self.by_pose;
        for (class, factors) in self.classes.iter_mut().enumerate() {
            let smooth = hyper.smooth[class].powi(2);
            by_pose.clear();
            by_pose.extend(table.smooth.iter().map(|kernel| smooth * kernel));
            for (product, kernels) in hyper.products.iter().zip(&table.products) {
                let variance = product.amplitudes[class].powi(2);
                by_pose.iter_mut().zip(kernels).for_each(|(sum, kernel)| *sum += variance * kernel);
            }
            repeat(by_pose, poses, pose, factors);
        }
        self.own.resize(by_column.own.len(), Vec::new());
        let tables = table.own.iter().zip(&table.sag);
        let joints = self.own.iter_mut().zip(tables).zip(&by_column.own).enumerate();
        for (joint, ((factors, (kernels, loads)), own)) in joints {
            let Some((_, lever)) = own else { continue };
            let (variance, sag) = ((hyper.own * lever).powi(2), (hyper.sag * lever).powi(2));
            by_pose.clear();
            by_pose.extend(kernels.iter().zip(loads).map(|(kernel, load)| variance * kernel + sag * load));
            if by_column.has_curve[joint] {
                by_pose[0] += (hyper.repeatability_of(by_column.joint[joint]) * lever).powi(2);
            }
            let waves = hyper.waves.iter().zip(&table.waves).filter(|(wave, _)| wave.joint == joint);
            for (wave, kernels) in waves {
                let variance = (wave.amplitude * lever).powi(2);
                by_pose.iter_mut().zip(kernels).for_each(|(sum, kernel)| *sum += variance * kernel);
            }
            repeat(by_pose, poses, pose, factors);
        }
    }
}

/// Values of poses from `first` on, for each row the one of its pose; in whole steps.
fn repeat(values: &[f64], poses: &[usize], first: usize, out: &mut Vec<f64>) {
    out.clear();
    out.extend(poses.iter().map(|pose| values[pose - first]));
    out.resize(poses.len().next_multiple_of(STEP), 0.0);
}

struct PoseColumns<'a> {
    training: &'a Training,
    by_column: &'a ByColumn,
    hyper: &'a Hyper,
    factors: &'a RowFactors,
    pose: usize,
    out: MatMut<'a, f64>,
}

impl Kernel for PoseColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let rows = self.training.rows(self.pose);
        let (first, count) = (rows.start, self.by_column.rows - rows.start);
        let room = count.next_multiple_of(STEP);
        let mut columns = Columns::zeros(rows.len(), room);
        for start in (0..room).step_by(STEP) {
            for (row, column) in rows.clone().zip(columns.iter_mut()) {
                write_step(column, start, &self.step::<I>(row, (first, start)));
            }
        }
        let mut out = self.out;
        for (k, column) in columns.iter().enumerate() {
            let mut out = out.rb_mut().col_mut(k).subrows_mut(first, count);
            out.copy_from(ColRef::from_slice(&column[..count]));
        }
    }
}

impl PoseColumns<'_> {
    /// Covariances of a row with a step of rows, from that many behind the pose's first one on.
    #[inline(always)]
    fn step<I: Isa>(&self, row: usize, (first, start): (usize, usize)) -> Step {
        let Self { by_column, hyper, factors, .. } = self;
        let sums = by_column.class_sums::<I>(row, first + start);
        let mut total = NOTHING;
        for (sums, factor) in sums.constants.iter().zip(&hyper.constant) {
            add_scaled::<I>(&mut total, factor * factor, sums);
        }
        for (sums, factors) in sums.classes.iter().zip(&factors.classes) {
            add_products::<I>(&mut total, 1.0, sums, &step_at(factors, start));
        }
        for (own, factors) in by_column.own.iter().zip(&factors.own) {
            let Some((p, _)) = own else { continue };
            let entries = by_column.step(*p, first + start);
            add_products::<I>(&mut total, by_column.entry(*p, row), &entries, &step_at(factors, start));
        }
        total
    }
}

/// Writes the rows' covariance with noise on its diagonal, (R, R), into the lower triangle of `matrix`.
pub fn write_covariance(
    training: &Training,
    by_column: &ByColumn,
    hyper: &Hyper,
    kernels: &impl PairKernels,
    mut matrix: MatMut<f64>,
) {
    let scratch = || (PairTable::default(), RowFactors::default());
    let rows = (0..training.pose_count()).map(|pose| training.rows(pose).len());
    let own = by_pose(matrix.rb_mut(), rows).into_par_iter().enumerate();
    own.filter(|(_, out)| out.ncols() > 0).for_each_init(scratch, |(table, factors), (pose, out)| {
        kernels.fill(pose, table);
        factors.fill(by_column, hyper, table, (pose, training.rows(pose).start));
        dispatch(PoseColumns { training, by_column, hyper, factors, pose, out });
    });
    for row in 0..by_column.rows {
        matrix[(row, row)] += training.noise_variance(row, hyper.noise);
    }
}

/// Columns of a matrix pose by pose, each as many as its pose has rows.
pub fn by_pose(matrix: MatMut<f64>, rows: impl Iterator<Item = usize>) -> Vec<MatMut<f64>> {
    let mut rest = matrix;
    let mut parts = Vec::new();
    for count in rows {
        let (head, tail) = rest.split_at_col_mut(count);
        parts.push(head);
        rest = tail;
    }
    parts
}
