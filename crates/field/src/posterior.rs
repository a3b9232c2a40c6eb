//! The posterior of weights, constants and set-up: exact Gaussian inference in whichever space is smaller.

use std::borrow::Cow;
use std::ops::Range;

use faer::{Mat, MatRef};
use rayon::prelude::*;
use truearm_bank::Bank;
use truearm_estimate::dense::{Cholesky, column, to_vec};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::beyond::Beyond;
use crate::data_space::DataSpace;
use crate::drives::Drives;
use crate::hyper::Hyper;
use crate::model::Model;
use crate::training::Training;
use crate::unknowns;
use crate::weight_space::WeightSpace;

/// Rows up to which data space is always affordable: half a gigabyte and seconds.
const FEW_ROWS: usize = 6000;
/// Rows or weights that can be afforded at all.
const AFFORDABLE: usize = 12_000;
/// Poses that are kept where neither rows nor weights can be afforded.
const SPACE_FILLING: usize = 4000;

/// What the rows say of constants, field and set-up together.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Correction of each column's constant, (P,).
    pub constant: Vec<f64>,
    /// The field.
    pub bank: Bank,
    /// Set-up step, (s,).
    pub setup: Vec<f64>,
}

/// The posterior of one training set under given hyper-parameters.
pub enum Posterior {
    /// The rows' covariance is factored.
    Data(Box<DataSpace>),
    /// The weights' normal equations are factored.
    Weight(Box<WeightSpace>),
}

/// Configurations whose covariance is asked for.
pub struct Query<'a> {
    /// Inputs, (n, I).
    pub values: Cow<'a, [f64]>,
    /// (n, m, P).
    pub jacobian: Cow<'a, [f64]>,
    /// Set-up columns (n, m, s), or the arm's part alone.
    pub setup: Option<&'a [f64]>,
    /// Rows of each, m.
    pub rows: usize,
    /// Inputs, I, and columns, P.
    pub widths: (usize, usize),
}

impl Query<'_> {
    /// Configurations, n.
    pub fn poses(&self) -> usize {
        self.values.len() / self.widths.0
    }

    /// Inputs (I,) of a configuration.
    pub fn values_of(&self, pose: usize) -> &[f64] {
        &self.values[pose * self.widths.0..(pose + 1) * self.widths.0]
    }

    /// Rows (m, P) of a configuration.
    pub fn jacobian_of(&self, pose: usize) -> &[f64] {
        let size = self.rows * self.widths.1;
        &self.jacobian[pose * size..(pose + 1) * size]
    }

    /// Prior covariance of rows i and j of a configuration, given the columns' variances there.
    pub fn prior(&self, pose: usize, (i, j): (usize, usize), variances: &[f64]) -> f64 {
        let rows = self.jacobian_of(pose);
        let columns = self.widths.1;
        weighted(&rows[i * columns..(i + 1) * columns], &rows[j * columns..(j + 1) * columns], variances)
    }

    /// Prior covariance (m, m) of the rows of two configurations, given the columns' covariances between them.
    pub fn cross(&self, (a, b): (usize, usize), covariances: &[f64]) -> Vec<f64> {
        let (left, right) = (self.jacobian_of(a), self.jacobian_of(b));
        let columns = self.widths.1;
        let pairs = left.chunks_exact(columns).flat_map(|x| right.chunks_exact(columns).map(move |y| (x, y)));
        pairs.map(|(x, y)| weighted(x, y, covariances)).collect()
    }

    /// The columns of some configurations' rows, among those (u, n m) of all.
    pub fn part<'m>(&self, whole: &'m Mat<f64>, poses: &Range<usize>) -> MatRef<'m, f64> {
        whole.as_ref().subcols(poses.start * self.rows, poses.len() * self.rows)
    }

    /// Whether all arrays have the lengths that they need.
    fn check(&self, setup_width: usize) -> Result<(), FieldError> {
        check_rows(self.rows)?;
        let length = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(FieldError::Length { what, found, expected }) }
        };
        length("values", self.values.len(), self.poses() * self.widths.0)?;
        length("jacobian", self.jacobian.len(), self.poses() * self.rows * self.widths.1)?;
        self.setup
            .map_or(Ok(()), |setup| length("setup", setup.len(), self.poses() * self.rows * setup_width))
    }
}

/// Refuses configurations without rows.
fn check_rows(rows: usize) -> Result<(), FieldError> {
    let rule = "a Jacobian (n, m, P) needs one at least: three for a position, six for a pose";
    if rows > 0 { Ok(()) } else { Err(FieldError::Option { what: "the number of rows m", value: 0, rule }) }
}

/// `sum of a b v`.
fn weighted(a: &[f64], b: &[f64], variances: &[f64]) -> f64 {
    a.iter().zip(b).zip(variances).map(|((x, y), v)| x * y * v).sum()
}

impl Posterior {
    /// Infers in data space where rows are few or fewer than weights, else in weight space; where neither can be
    /// afforded, from poses that fill the space.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Hyper`], and [`FieldError::Kinematics`] if `up` is no direction.
    pub fn new(training: Training, hyper: Hyper, degree: usize, cancel: &Cancel) -> Result<Self, FieldError> {
        let drives = training.drives.as_ref().map_or(0, Drives::len);
        hyper.check(&training.inputs[..training.input_count()], training.geometry.joint_count(), drives)?;
        let rows = training.row_count();
        let model = Model::new(training.under(&hyper)?, hyper, degree);
        if rows <= FEW_ROWS {
            return Ok(Self::Data(Box::new(DataSpace::new(model, cancel)?)));
        }
        let weights = unknowns::size(&model).ok_or(FieldError::NotPositiveDefinite { rows })?;
        if weights <= rows && weights <= AFFORDABLE {
            return Ok(Self::Weight(Box::new(WeightSpace::new(model, cancel)?)));
        }
        if rows <= AFFORDABLE {
            return Ok(Self::Data(Box::new(DataSpace::new(model, cancel)?)));
        }
        let per_pose = rows.div_ceil(model.training.pose_count());
        let kept = model.training.fill_space(SPACE_FILLING.min(AFFORDABLE / per_pose), cancel)?;
        let model = Model::new(model.training.only(&kept), model.hyper, degree);
        Ok(Self::Data(Box::new(DataSpace::new(model, cancel)?)))
    }

    /// The same posterior with the weights of `all` poses, which its training set may be a part of.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn reweighed(self, all: &Training, cancel: &Cancel) -> Result<Self, FieldError> {
        let own = self.training();
        let took_part = (0..all.pose_count()).filter(|&pose| !own.rows(pose).is_empty());
        let weight = took_part.flat_map(|pose| &all.weight[all.rows(pose)]).copied().collect();
        match self {
            Self::Weight(space) => Ok(Self::Weight(Box::new(space.reweighed(weight)?))),
            Self::Data(space) => {
                let DataSpace { mut model, projection, .. } = *space;
                // Gigabytes where rows are many.
                drop(projection);
                model.training.weight = weight;
                Ok(Self::Data(Box::new(DataSpace::new(model, cancel)?)))
            }
        }
    }

    /// The posterior under amplitudes as wide as the evidence leaves them, for standard deviations.
    ///
    /// None in weight space: there rows outnumber weights, amplitudes hardly matter and a second solution costs much.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn widened(&self, degree: usize, cancel: &Cancel) -> Result<Option<Self>, FieldError> {
        let Self::Data(space) = self else { return Ok(None) };
        let model = Model::new(space.model.training.clone(), space.model.hyper.widened(), degree);
        Ok(Some(Self::Data(Box::new(DataSpace::new(model, cancel)?))))
    }

    /// The prior model.
    pub fn model(&self) -> &Model {
        match self {
            Self::Data(space) => &space.model,
            Self::Weight(space) => &space.model,
        }
    }

    /// The rows that it was inferred from.
    pub fn training(&self) -> &Training {
        &self.model().training
    }

    /// Constants, field and set-up from residuals (R,).
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn solve(&self, residual: &[f64]) -> Result<Solution, FieldError> {
        match self {
            Self::Data(space) => Ok(space.solve(residual)),
            Self::Weight(space) => space.solve(residual),
        }
    }

    /// What each pose's residual would be if it had taken no part.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`], [`FieldError::Estimate`] where it is cancelled.
    pub fn leave_one_out(&self, residual: &[f64]) -> Result<LeaveOneOut, FieldError> {
        match self {
            Self::Data(space) => space.leave_one_out(residual),
            Self::Weight(space) => space.leave_one_out(residual),
        }
    }

    /// Covariance (n, m, m) of `J* CEP(q*)`, or of `J* CEP(q*) + S* s` where set-up columns are given.
    ///
    /// # Errors
    /// [`FieldError::Length`], [`FieldError::Option`] where there are no rows.
    pub fn covariance(
        &self,
        values: &[f64],
        jacobian: &[f64],
        setup: Option<&[f64]>,
        rows: usize,
    ) -> Result<Vec<f64>, FieldError> {
        let query = self.query(values, jacobian, setup, rows)?;
        let mut covariance = match self {
            Self::Data(space) => space.covariance(&query),
            Self::Weight(space) => space.covariance(&query),
        };
        covariance.par_chunks_exact_mut(rows * rows).enumerate().for_each(|(pose, block)| {
            let beyond = Beyond::new(&self.model().cells, query.values_of(pose));
            if !beyond.is_nothing() {
                let here = (query.values_of(pose), &beyond);
                let beyond = self.model().beyond_between(here, here);
                let entry = |k: usize| query.prior(pose, (k / rows, k % rows), &beyond);
                block.iter_mut().enumerate().for_each(|(k, value)| *value += entry(k));
            }
        });
        let scale = self.model().hyper.extrapolation.powi(2);
        covariance.iter_mut().for_each(|value| *value *= scale);
        Ok(covariance)
    }

    /// Covariance (n m, n m) of the same rows of all configurations with one another, row-major.
    ///
    /// # Errors
    /// [`FieldError::Length`], [`FieldError::Option`] where there are no rows.
    pub fn joint_covariance(
        &self,
        values: &[f64],
        jacobian: &[f64],
        setup: Option<&[f64]>,
        rows: usize,
    ) -> Result<Vec<f64>, FieldError> {
        let query = self.query(values, jacobian, setup, rows)?;
        let all = 0..query.poses();
        Ok(self.row_major(&self.joint(&query, all.clone(), all)))
    }

    /// Covariance (k m, (n - k) m) of the rows of the first k configurations with those of the others, row-major.
    ///
    /// # Errors
    /// [`FieldError::Length`] where there are fewer configurations, [`FieldError::Option`] where there are no rows.
    pub fn cross_covariance(
        &self,
        first: usize,
        values: &[f64],
        jacobian: &[f64],
        setup: Option<&[f64]>,
        rows: usize,
    ) -> Result<Vec<f64>, FieldError> {
        let query = self.query(values, jacobian, setup, rows)?;
        let all = query.poses();
        if first > all {
            return Err(FieldError::Length { what: "values", found: all, expected: first });
        }
        Ok(self.row_major(&self.joint(&query, 0..first, first..all)))
    }

    fn joint(&self, query: &Query, left: Range<usize>, right: Range<usize>) -> Mat<f64> {
        let mut joint = match self {
            Self::Data(space) => space.joint(query, left.clone(), right.clone()),
            Self::Weight(space) => space.joint(query, left.clone(), right.clone()),
        };
        self.add_beyond(query, (left, right), &mut joint);
        joint
    }

    /// Adds what configurations of a query that lie beyond the cells have in common there.
    fn add_beyond(&self, query: &Query, (left, right): (Range<usize>, Range<usize>), joint: &mut Mat<f64>) {
        let (model, rows) = (self.model(), query.rows);
        let places: Vec<(&[f64], Beyond)> = (0..query.poses())
            .map(|pose| (query.values_of(pose), Beyond::new(&model.cells, query.values_of(pose))))
            .collect();
        let outside = |poses: &Range<usize>| -> Vec<usize> {
            poses.clone().filter(|&pose| !places[pose].1.is_nothing()).collect()
        };
        let place = |pose: usize| (places[pose].0, &places[pose].1);
        let others = outside(&right);
        for a in outside(&left) {
            for &b in &others {
                let block = query.cross((a, b), &model.beyond_between(place(a), place(b)));
                let (first, across) = ((a - left.start) * rows, (b - right.start) * rows);
                block.iter().enumerate().for_each(|(k, value)| {
                    joint[(first + k / rows, across + k % rows)] += value;
                });
            }
        }
    }

    /// Entries of a covariance, row by row, as wide as extrapolation has it.
    fn row_major(&self, covariance: &Mat<f64>) -> Vec<f64> {
        let scale = self.model().hyper.extrapolation.powi(2);
        let width = covariance.ncols();
        (0..covariance.nrows() * width).map(|k| scale * covariance[(k / width, k % width)]).collect()
    }

    /// Covariance (P, P) of the columns' constants alone, whatever varies beside them, row-major.
    pub fn constants(&self) -> Vec<f64> {
        let covariance = match self {
            Self::Data(space) => space.constants(),
            Self::Weight(space) => space.constants(),
        };
        let size = self.training().column_count();
        (0..size * size).map(|k| covariance[(k / size, k % size)]).collect()
    }

    fn query<'a>(
        &self,
        values: &'a [f64],
        jacobian: &'a [f64],
        setup: Option<&'a [f64]>,
        rows: usize,
    ) -> Result<Query<'a>, FieldError> {
        let training = self.training();
        let widths = (training.input_count(), training.column_count());
        let query =
            Query { values: Cow::Borrowed(values), jacobian: Cow::Borrowed(jacobian), setup, rows, widths };
        query.check(training.setup_width)?;
        Ok(Query {
            values: training.with_own_inputs(values),
            jacobian: training.with_own_columns(jacobian),
            widths: (training.inputs.len(), training.columns.len()),
            ..query
        })
    }

    /// Variances of `J* CEP(q*)` before any measurement, (n, m).
    ///
    /// # Errors
    /// [`FieldError::Length`], [`FieldError::Option`] where there are no rows.
    pub fn prior(&self, values: &[f64], jacobian: &[f64], rows: usize) -> Result<Vec<f64>, FieldError> {
        let model = self.model();
        let query = self.query(values, jacobian, None, rows)?;
        let scale = model.hyper.extrapolation.powi(2);
        let mut out = vec![0.0; query.poses() * rows];
        out.par_chunks_exact_mut(rows).enumerate().for_each(|(pose, out)| {
            let values = query.values_of(pose);
            let mut variances = model.variances(&model.cells.excite(values));
            variances.iter_mut().zip(model.beyond(values)).for_each(|(variance, more)| *variance += more);
            let own = (0..rows).map(|i| scale * query.prior(pose, (i, i), &variances));
            out.iter_mut().zip(own).for_each(|(out, variance)| *out = variance);
        });
        Ok(out)
    }

    /// Covariance (n, m, m) of what joints do not repeat, carried to rows of a Jacobian (n, m, P).
    ///
    /// # Errors
    /// [`FieldError::Option`] where it has no rows, [`FieldError::Length`] where it is not of whole configurations.
    pub fn repeatability(&self, jacobian: &[f64], rows: usize) -> Result<Vec<f64>, FieldError> {
        check_rows(rows)?;
        let model = self.model();
        let size = rows * model.training.column_count();
        let (poses, found) = (jacobian.len() / size, jacobian.len());
        if poses * size != found {
            return Err(FieldError::Length { what: "jacobian", found, expected: poses * size });
        }
        let jacobian = model.training.with_own_columns(jacobian);
        let mut out = Vec::with_capacity(poses * rows * rows);
        for pose in 0..poses {
            let noise = model.noise_covariance(&jacobian, pose * rows..(pose + 1) * rows);
            (0..rows * rows).for_each(|k| out.push(noise[(k / rows, k % rows)]));
        }
        Ok(out)
    }
}

/// Residuals (m,) by the lower factor of their covariance (m, m).
///
/// # Errors
/// [`FieldError::NotPositiveDefinite`].
pub fn standardised(covariance: Mat<f64>, residual: &[f64]) -> Result<Vec<f64>, FieldError> {
    let error = FieldError::NotPositiveDefinite { rows: residual.len() };
    let mut standardised = column(residual);
    Cholesky::new(covariance, faer::Par::Seq).ok_or(error)?.solve_lower(standardised.as_mut());
    Ok(to_vec(standardised.as_ref()))
}

/// Leave-one-pose-out residuals.
#[derive(Debug, Clone)]
pub struct LeaveOneOut {
    /// (R,), m or rad.
    pub residual: Vec<f64>,
    /// (R,), standard normal if the model is right.
    pub standardised: Vec<f64>,
    /// Whether a row belongs to the sample that stands for all, (R,).
    pub sampled: Vec<bool>,
}

impl LeaveOneOut {
    /// Of so many rows, all of them sampled.
    pub fn zeros(rows: usize) -> Self {
        Self { residual: vec![0.0; rows], standardised: vec![0.0; rows], sampled: vec![true; rows] }
    }

    /// A pose's left-out residual and its covariance, judged as if its rows had their full weight.
    ///
    /// # Errors
    /// [`FieldError::NotPositiveDefinite`].
    pub fn set(
        &mut self,
        model: &Model,
        pose: usize,
        residual: &[f64],
        covariance: Mat<f64>,
    ) -> Result<(), FieldError> {
        let rows = model.training.rows(pose);
        let mut covariance = covariance;
        for (i, row) in rows.clone().enumerate() {
            let noise = model.training.noise_variance(row, model.hyper.noise);
            covariance[(i, i)] -= noise * (1.0 - model.training.weight[row]);
        }
        self.residual[rows.clone()].copy_from_slice(residual);
        self.standardised[rows].copy_from_slice(&standardised(covariance, residual)?);
        Ok(())
    }

    /// The fit's own residuals, which are no larger, of a pose that is far from any suspicion.
    pub fn approximate(&mut self, rows: Range<usize>, residual: &[f64], standardised: &[f64]) {
        self.residual[rows.clone()].copy_from_slice(residual);
        self.standardised[rows.clone()].copy_from_slice(standardised);
        self.sampled[rows].fill(false);
    }

    /// Keeps a suspicious pose out of the sample.
    pub fn suspect(&mut self, rows: Range<usize>) {
        self.sampled[rows].fill(false);
    }
}
