//! How sharply the evidence bends with the logarithms of the hyper-parameters.
//!
//! The average information `1/2 alpha^T dK_i P dK_j alpha`, with `alpha = P r` and dK_i the slope of the covariance by a
//! logarithm, is the mean of what the negative second derivatives are and of what they are expected to be, but for how the
//! covariance itself bends, which adds nothing to what is expected (Gilmour, Thompson and Cullis 1995). It is never
//! indefinite, and asks for products of matrices with vectors alone. With positions alone it is singular: nothing tells of
//! the noise of orientations.

use faer::{Mat, MatRef};
use rayon::prelude::*;
use truearm_bank::InputKind;
use truearm_estimate::dense::{Cholesky, add_product, product, symmetric_product, transposed_product};

use crate::continuous::{Continuous, Pairing, exponent_factors};
use crate::hyper::{
    AT_CONSTANT, AT_OWN, AT_OWN_CYCLES, AT_OWN_LENGTH, AT_REPEATABILITY, AT_SAG, AT_SMOOTH, AT_SMOOTH_LENGTH,
    AT_SMOOTH_LINE_LENGTH, Hyper, Product,
};
use crate::pairs::ByColumn;
use crate::training::{Class, Training};

/// What the slopes of the rows' covariance K at a point are made of.
pub struct Slopes<'a> {
    pub training: &'a Training,
    pub by_column: &'a ByColumn,
    pub pairings: &'a [Pairing],
    pub hyper: &'a Hyper,
    pub kernels: &'a Continuous<'a>,
    /// P r, (R,).
    pub alpha: &'a [f64],
}

/// A kernel between all poses, or its derivative by the logarithm of a length scale or of cycles.
#[derive(Clone, Copy)]
enum Slope {
    Own(usize),
    OwnByLength(usize),
    OwnByCycles(usize),
    Sag(usize),
    Smooth,
    SmoothByLength,
    SmoothByLineLength,
    Product(usize),
    /// Of a product, by which of its lengths.
    ProductByLength(usize, usize),
}

/// Values of rows, (R,), and the hyper-parameter whose slope they are a part of.
type Share = (usize, Vec<f64>);

impl Slopes<'_> {
    /// The average information (H, H), given the factor of K and Q (s, R) with `P = K^-1 - Q^T Q`.
    pub fn information(&self, factor: &Cholesky, root: MatRef<f64>) -> Mat<f64> {
        let mut slopes = self.times_alpha();
        let common = product(root, slopes.as_ref());
        factor.solve_lower(slopes.as_mut());
        let mut information = transposed_product(slopes.as_ref(), slopes.as_ref());
        add_product(information.as_mut(), common.transpose(), common.as_ref(), -1.0);
        information *= faer::Scale(0.5);
        information
    }

    /// The derivatives of K by the logarithms of the hyper-parameters, times alpha: (R, H).
    fn times_alpha(&self) -> Mat<f64> {
        let (poses, pulls) = (self.training.pose_count(), self.pulls());
        let shares: Vec<Vec<Share>> = self
            .with_kernels()
            .into_par_iter()
            .map_init(|| Mat::zeros(poses, poses), |room, slope| self.shares(slope, &pulls, room))
            .collect();
        let mut out = Mat::zeros(self.by_column.rows, self.hyper.count());
        for (position, values) in shares.into_iter().flatten().chain(self.without_kernels(&pulls)) {
            out.col_as_slice_mut(position).iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        out
    }

    /// `J[r, p] alpha[r]` summed over the rows of each pose, (n, P).
    fn pulls(&self) -> Mat<f64> {
        let mut pulls = Mat::zeros(self.training.pose_count(), self.training.columns.len());
        for p in 0..self.training.columns.len() {
            let pulls = pulls.col_as_slice_mut(p);
            for (row, (pose, alpha)) in self.by_column.pose.iter().zip(self.alpha).enumerate() {
                pulls[*pose] += self.by_column.entry(p, row) * alpha;
            }
        }
        pulls
    }

    fn with_kernels(&self) -> Vec<Slope> {
        let mut slopes = vec![Slope::Smooth, Slope::SmoothByLength];
        if self.training.inputs.iter().any(|input| input.kind == InputKind::Line) {
            slopes.push(Slope::SmoothByLineLength);
        }
        for (m, product) in self.hyper.products.iter().enumerate() {
            slopes.push(Slope::Product(m));
            slopes.extend((0..product.joints.len()).map(|k| Slope::ProductByLength(m, k)));
        }
        for (joint, _, _) in self.by_column.curved() {
            slopes.extend([Slope::Own(joint), Slope::OwnByLength(joint), Slope::OwnByCycles(joint)]);
        }
        let bears = |&joint: &usize| self.by_column.own[joint].is_some();
        slopes.extend((0..self.training.geometry.joint_count()).filter(bears).map(Slope::Sag));
        slopes
    }

    /// What a kernel brings to the derivatives times alpha; `room` is (n, n).
    fn shares(&self, slope: Slope, pulls: &Mat<f64>, room: &mut Mat<f64>) -> Vec<Share> {
        let columns = self.columns(slope);
        let right = Mat::from_fn(pulls.nrows(), columns.len(), |pose, k| pulls[(pose, columns[k])]);
        let found = self.times(slope, right.as_ref(), room);
        let share = |(position, factors): (usize, [f64; 3])| {
            let mut out = vec![0.0; self.by_column.rows];
            for (k, &p) in columns.iter().enumerate() {
                let factor = factors[self.class(p)];
                if factor != 0.0 {
                    self.add_rows(p, factor, found.col_as_slice(k), &mut out);
                }
            }
            (position, out)
        };
        self.parts(slope).into_iter().map(share).collect()
    }

    /// Columns of the Jacobian that are driven through a kernel.
    fn columns(&self, slope: Slope) -> Vec<usize> {
        match slope {
            Slope::Own(joint) | Slope::OwnByLength(joint) | Slope::OwnByCycles(joint) | Slope::Sag(joint) => {
                self.by_column.own[joint].iter().map(|(p, _)| *p).collect()
            }
            _ => self.by_column.driven.iter().flatten().copied().collect(),
        }
    }

    fn class(&self, p: usize) -> usize {
        Class::of(self.training.columns[p].parameter).index()
    }

    /// Hyper-parameters whose slopes a kernel belongs to, and what it is multiplied with by the class of the column.
    fn parts(&self, slope: Slope) -> Vec<(usize, [f64; 3])> {
        let hyper = self.hyper;
        let squares = |amplitudes: [f64; 3], factor: f64| amplitudes.map(|a| factor * a * a);
        let each = |first: usize, amplitudes: [f64; 3]| -> Vec<(usize, [f64; 3])> {
            let factors = squares(amplitudes, 2.0);
            let of = |class| std::array::from_fn(|k| if k == class { factors[k] } else { 0.0 });
            (0..3).map(|class| (first + class, of(class))).collect()
        };
        let of_joint = |joint: usize, amplitude: f64, factor: f64| {
            let lever = self.by_column.own[joint].map_or(1.0, |(_, lever)| lever);
            squares([amplitude * lever; 3], factor)
        };
        match slope {
            Slope::Own(joint) => vec![(AT_OWN, of_joint(joint, hyper.own, 2.0))],
            Slope::OwnByLength(joint) => vec![(AT_OWN_LENGTH, of_joint(joint, hyper.own, 1.0))],
            Slope::OwnByCycles(joint) => vec![(AT_OWN_CYCLES, of_joint(joint, hyper.own, 1.0))],
            Slope::Sag(joint) => vec![(AT_SAG, of_joint(joint, hyper.sag, 2.0))],
            Slope::Smooth => each(AT_SMOOTH, hyper.smooth),
            Slope::SmoothByLength => vec![(AT_SMOOTH_LENGTH, squares(hyper.smooth, 1.0))],
            Slope::SmoothByLineLength => vec![(AT_SMOOTH_LINE_LENGTH, squares(hyper.smooth, 1.0))],
            Slope::Product(m) => each(hyper.at_product(m), hyper.products[m].amplitudes),
            Slope::ProductByLength(m, k) => {
                let product = &hyper.products[m];
                let of_length = exponent_factors(product).skip(k).take(1);
                let part = |(_, factor)| {
                    (hyper.at_product(m) + Product::AMPLITUDES + k, squares(product.amplitudes, 2.0 * factor))
                };
                of_length.map(part).collect()
            }
        }
    }

    /// Writes what a kernel is between pose `j` and the poses from it on, (n - j,).
    fn write(&self, slope: Slope, j: usize, out: &mut [f64]) {
        let (pairing, kernels) = (&self.pairings[j], &self.kernels.poses[j]);
        let values = match slope {
            Slope::Own(joint) => kernels.own_of(joint).kernel,
            Slope::OwnByLength(joint) => kernels.own_of(joint).by_log_length,
            Slope::OwnByCycles(joint) => kernels.own_of(joint).by_log_cycles,
            Slope::Sag(joint) => &pairing.loads[joint],
            Slope::Smooth => kernels.smooth().kernel,
            Slope::SmoothByLength => kernels.smooth().by_log_length,
            Slope::SmoothByLineLength => kernels.smooth().by_log_line_length,
            Slope::Product(m) | Slope::ProductByLength(m, _) => kernels.products.get(m),
        };
        out.copy_from_slice(&values[..out.len()]);
        if let Slope::ProductByLength(m, k) = slope {
            let distances = &pairing.distances[self.hyper.products[m].joints[k]];
            out.iter_mut().zip(distances).for_each(|(kernel, distance)| *kernel *= distance);
        }
    }

    /// A kernel between all poses times `right` (n, w).
    fn times(&self, slope: Slope, right: MatRef<f64>, room: &mut Mat<f64>) -> Mat<f64> {
        for j in 0..room.ncols() {
            self.write(slope, j, &mut room.col_as_slice_mut(j)[j..]);
        }
        symmetric_product(room.as_ref(), right)
    }

    /// `out[r] += factor J[r, p] of_pose[pose of r]`.
    fn add_rows(&self, p: usize, factor: f64, of_pose: &[f64], out: &mut [f64]) {
        for (row, (pose, out)) in self.by_column.pose.iter().zip(out).enumerate() {
            *out += factor * self.by_column.entry(p, row) * of_pose[*pose];
        }
    }

    /// Constants, what joints do not repeat, and noise.
    fn without_kernels(&self, pulls: &Mat<f64>) -> Vec<Share> {
        let hyper = self.hyper;
        let share = |position: usize, p: usize, factor: f64, of_pose: &[f64]| {
            let mut out = vec![0.0; self.by_column.rows];
            self.add_rows(p, factor, of_pose, &mut out);
            (position, out)
        };
        let constants = self.by_column.constant.iter().map(|&(p, variance)| {
            let all = vec![pulls.col_as_slice(p).iter().sum(); pulls.nrows()];
            let class = self.class(p);
            share(AT_CONSTANT + class, p, 2.0 * hyper.constant[class].powi(2) * variance, &all)
        });
        let anew = self.by_column.curved().flat_map(|(input, p, lever)| {
            let joint = self.by_column.joint[input];
            let factor = 2.0 * (hyper.repeatability_of(joint) * lever).powi(2);
            let (_, shared) = share(AT_REPEATABILITY, p, factor, pulls.col_as_slice(p));
            let own =
                (joint < hyper.unevenness.len()).then(|| (hyper.at_unevenness() + joint, shared.clone()));
            own.into_iter().chain([(AT_REPEATABILITY, shared)])
        });
        let first = hyper.at_noise();
        let noise = (0..hyper.noise.len()).map(|kind| {
            let slope = |(row, alpha): (usize, &f64)| {
                let counts = usize::from(self.training.is_orientation[row]) == kind;
                if counts { 2.0 * self.training.noise_slope(row, hyper.noise) * alpha } else { 0.0 }
            };
            (first + kind, self.alpha.iter().enumerate().map(slope).collect())
        });
        constants.chain(anew).chain(noise).collect()
    }
}
