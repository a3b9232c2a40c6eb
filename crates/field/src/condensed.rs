//! The same evidence of fewer rows.
//!
//! All targets of a pose move with one rigid body, by no more than six motions. An orthogonal transformation of a pose's
//! positions, whose noise is alike, leaves six rows that tell of the arm, and others that tell of the set-up and of the noise
//! alone. Of these another one leaves as many as the set-up has unknowns and one more, and rows of zeros, which count in the
//! noise's favour only. Neither changes the restricted likelihood, and its cost falls with the cube of the rows.

use faer::{Mat, MatRef};
use truearm_estimate::dense::{Eigen, Orthogonal, product};

use crate::training::{Shot, Training};

/// Motions of a rigid body.
const MOTIONS: usize = 6;
/// Share of the largest singular value of a pose's rows below which one is rounding.
const ROUNDING: f64 = 1e-7;

/// Rows of a training set, and what they stand for beside themselves.
pub struct Condensed {
    /// The rows; those of no pose's motion are of a last pose that no parameter moves.
    pub training: Training,
    /// A row that rows of zeros have the noise of, and how many these are.
    pub silent: Vec<(usize, usize)>,
    /// What the logarithm of the likelihood gained by rows of another weight that became alike.
    pub gained: f64,
}

/// Positions without motion whose noise is alike, of weight one.
struct Still {
    variance: f64,
    source: Vec<Shot>,
    kept: f64,
    /// Set-up columns and residuals, (N, s + 1) row-major.
    rows: Vec<f64>,
}

impl Condensed {
    /// Of a training set; none where no row is saved.
    pub fn of(training: &Training) -> Option<Self> {
        let most = (0..training.pose_count()).map(|pose| training.rows(pose).len()).max()?;
        if most <= MOTIONS {
            return None;
        }
        let mut building = Building::new(training);
        for pose in 0..training.pose_count() {
            building.add(pose)?;
        }
        let condensed = building.finished();
        (condensed.training.row_count() < training.row_count()).then_some(condensed)
    }
}

struct Building<'a> {
    of: &'a Training,
    into: Training,
    still: Vec<Still>,
    gained: f64,
}

impl<'a> Building<'a> {
    fn new(of: &'a Training) -> Self {
        let mut into = of.select(&[]);
        into.offsets = vec![0];
        Self { of, into, still: Vec::new(), gained: 0.0 }
    }

    /// Adds the rows of a pose; none where their motions cannot be told.
    fn add(&mut self, pose: usize) -> Option<()> {
        let mut left: Vec<usize> = self.of.rows(pose).collect();
        while let Some(&first) = left.first() {
            let (alike, others): (Vec<usize>, Vec<usize>) =
                left.iter().partition(|&&row| row == first || self.are_alike(first, row));
            if alike.len() > MOTIONS && !self.of.is_orientation[first] {
                self.add_turned(&alike)?;
            } else {
                alike.into_iter().for_each(|row| self.add_row(row));
            }
            left = others;
        }
        self.into.values.extend(self.of.values_of(pose));
        self.into.levers.extend(self.of.levers_of(pose));
        self.into.offsets.push(self.into.row_count());
        Some(())
    }

    fn are_alike(&self, a: usize, b: usize) -> bool {
        let of = |row: usize| {
            (self.of.is_orientation[row], self.of.variance[row], self.of.weight[row], self.of.kept(row))
        };
        of(a) == of(b)
    }

    fn add_row(&mut self, row: usize) {
        let numbers = (self.of.jacobian_row(row), self.of.setup_row(row), self.of.residual[row]);
        self.into.push(numbers, self.of, row);
    }

    /// Adds rows whose noise is alike, turned: those of the motions, then what is left of no motion.
    fn add_turned(&mut self, rows: &[usize]) -> Option<()> {
        let of = self.of;
        let (columns, width) = (of.columns.len(), of.setup_width + 1);
        let jacobian = Mat::from_fn(rows.len(), columns, |i, p| of.jacobian_row(rows[i])[p]);
        let others = Mat::from_fn(rows.len(), width, |i, k| {
            of.setup_row(rows[i]).get(k).copied().unwrap_or(of.residual[rows[i]])
        });
        let Eigen { values, vectors } = Eigen::new(&product(jacobian.as_ref(), jacobian.transpose()))?;
        let least = values.last()? * ROUNDING * ROUNDING;
        let still = values.iter().filter(|value| **value <= least).count();
        let turned = [jacobian.as_ref(), others.as_ref()].map(|part| product(vectors.transpose(), part));
        let row = |matrix: &Mat<f64>, i: usize| -> Vec<f64> { matrix.row(i).iter().copied().collect() };
        for i in still..rows.len() {
            let (jacobian, others) = (row(&turned[0], i), row(&turned[1], i));
            self.into.push((&jacobian, &others[..width - 1], others[width - 1]), of, rows[0]);
        }
        let weight = of.weight[rows[0]];
        self.gained += 0.5 * still as f64 * weight.ln();
        let into = self.still_like(rows[0]);
        for i in 0..still {
            into.rows.extend(row(&turned[1], i).iter().map(|value| value * weight.sqrt()));
        }
        Some(())
    }

    /// Rows without motion that have the noise of a row, but for its weight.
    fn still_like(&mut self, row: usize) -> &mut Still {
        let (variance, kept) = (self.of.variance[row], self.of.kept(row));
        let alike = |still: &Still| (still.variance, still.kept) == (variance, kept);
        let place = self.still.iter().position(alike).unwrap_or(self.still.len());
        if place == self.still.len() {
            let source = self.of.source[row].clone();
            self.still.push(Still { variance, source, kept, rows: Vec::new() });
        }
        &mut self.still[place]
    }

    /// With the rows of no motion as those of a last pose.
    fn finished(mut self) -> Condensed {
        let width = self.of.setup_width + 1;
        let nothing = vec![0.0; self.of.columns.len()];
        let mut silent = Vec::new();
        for still in &self.still {
            let count = still.rows.len() / width;
            let rows = MatRef::from_row_major_slice(&still.rows, count, width);
            let upper =
                if count > width { Orthogonal::new(rows.to_owned()).upper() } else { rows.to_owned() };
            silent.push((self.into.row_count(), count - upper.nrows()));
            for row in upper.row_iter() {
                let row: Vec<f64> = row.iter().copied().collect();
                self.into.push_like(
                    (&nothing, &row[..width - 1], row[width - 1]),
                    still.variance,
                    &still.source,
                );
            }
        }
        let last = self.of.pose_count() - 1;
        self.into.values.extend(self.of.values_of(last));
        self.into.levers.extend(self.of.levers_of(last));
        self.into.offsets.push(self.into.row_count());
        Condensed { training: self.into, silent, gained: self.gained }
    }
}

impl Training {
    fn setup_row(&self, row: usize) -> &[f64] {
        &self.setup[row * self.setup_width..(row + 1) * self.setup_width]
    }

    /// Adds a row: Jacobian, set-up columns and residual, with the noise of a row of `other`.
    fn push(&mut self, numbers: (&[f64], &[f64], f64), other: &Training, row: usize) {
        self.push_like(numbers, other.variance[row], &other.source[row]);
        let last = self.row_count() - 1;
        (self.weight[last], self.is_orientation[last]) = (other.weight[row], other.is_orientation[row]);
    }

    /// Adds a position of weight one.
    fn push_like(
        &mut self,
        (jacobian, setup, residual): (&[f64], &[f64], f64),
        variance: f64,
        source: &[Shot],
    ) {
        self.jacobian.extend(jacobian);
        self.setup.extend(setup);
        self.residual.push(residual);
        self.variance.push(variance);
        self.weight.push(1.0);
        self.source.push(source.to_vec());
        self.is_orientation.push(false);
    }
}
