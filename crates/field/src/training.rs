//! Linearised measurements that a field is inferred from.

use truearm_bank::{Input, Levers};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::drives::Drives;
use crate::hyper::Hyper;

/// Poses that are chosen between two looks at whether the work was cancelled.
const BETWEEN_LOOKS: usize = 16;

/// What a driven parameter is; each class has amplitudes of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// The joint's own angle.
    Theta,
    /// alpha or beta.
    Angle,
    /// d or a.
    Length,
}

impl Class {
    /// Class of the parameter with index 5 * link + (theta, d, a, alpha, beta).
    pub fn of(parameter: usize) -> Self {
        match parameter % 5 {
            0 => Class::Theta,
            1 | 2 => Class::Length,
            _ => Class::Angle,
        }
    }

    /// Position in arrays over the classes.
    pub fn index(self) -> usize {
        match self {
            Class::Theta => 0,
            Class::Angle => 1,
            Class::Length => 2,
        }
    }
}

/// One column of the Jacobian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Index 5 * link + (theta, d, a, alpha, beta).
    pub parameter: usize,
    /// Prior standard deviation of its constant, m or rad; zero where the constant is held.
    pub constant: f64,
    /// Whether blocks drive it.
    pub driven: bool,
    /// The joint whose `own` block drives it.
    pub own: Option<usize>,
}

/// A measured value, and its share of the mean that a row holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot {
    /// Its place among the residuals (n, m) of all measurements.
    pub place: usize,
    /// Shares of a row's shots add up to one.
    pub share: f64,
}

/// Rows of `n` poses: `residual = jacobian CEP + setup s + noise`.
#[derive(Debug, Clone)]
pub struct Training {
    /// Columns of the Jacobian, P.
    pub columns: Vec<Column>,
    /// Parameters of the chain, 5 L.
    pub parameter_count: usize,
    /// Inputs of the field: the joints in order, then features, I of these, then readings where they are inputs.
    pub inputs: Vec<Input>,
    /// Values of the inputs, (n, I).
    pub values: Vec<f64>,
    /// Drives that turn several joints; none where joints are not coupled.
    pub drives: Option<Drives>,
    /// Whether what they leave goes with their readings, which are inputs then, behind the others.
    pub by_readings: bool,
    /// The arm's levers, L.
    pub geometry: Levers,
    /// The levers of each pose, (n, L).
    pub levers: Vec<f64>,
    /// First row of each pose, (n + 1,).
    pub offsets: Vec<usize>,
    /// (R, P).
    pub jacobian: Vec<f64>,
    /// Set-up columns, (R, s), scaled to the order of one.
    pub setup: Vec<f64>,
    /// Set-up columns, s.
    pub setup_width: usize,
    /// Prior precision of the steps of the set-up (s,).
    pub setup_precision: Vec<f64>,
    /// (R,), m or rad.
    pub residual: Vec<f64>,
    /// Variance that each row has of its own, (R,).
    pub variance: Vec<f64>,
    /// Weight of each row, (R,): the noise variance is divided by it.
    pub weight: Vec<f64>,
    /// Variance of what shots of a pose differ by, of positions and orientations; zero where all poses have one.
    pub shot: [f64; 2],
    /// The shots whose mean each row is, (R,).
    pub source: Vec<Vec<Shot>>,
    /// Whether a row is an orientation (else a position), (R,).
    pub is_orientation: Vec<bool>,
}

impl Training {
    /// Poses, n.
    pub fn pose_count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Rows, R.
    pub fn row_count(&self) -> usize {
        self.residual.len()
    }

    /// Rows of a pose.
    pub fn rows(&self, pose: usize) -> std::ops::Range<usize> {
        self.offsets[pose]..self.offsets[pose + 1]
    }

    /// Weight of a pose's rows; none where it has no rows.
    pub fn weight_of(&self, pose: usize) -> Option<f64> {
        self.rows(pose).next().map(|row| self.weight[row])
    }

    /// Values of a pose's inputs, (I,).
    pub fn values_of(&self, pose: usize) -> &[f64] {
        &self.values[pose * self.inputs.len()..(pose + 1) * self.inputs.len()]
    }

    /// Levers of a pose, (L,).
    pub fn levers_of(&self, pose: usize) -> &[f64] {
        &self.levers[pose * self.geometry.len()..(pose + 1) * self.geometry.len()]
    }

    /// Row of the Jacobian, (P,).
    pub fn jacobian_row(&self, row: usize) -> &[f64] {
        &self.jacobian[row * self.columns.len()..(row + 1) * self.columns.len()]
    }

    /// For each of the first `count` residuals the place of the first one of its pose, of whatever shot; its own where it
    /// took no part.
    pub fn first_shots(&self, count: usize) -> Vec<usize> {
        let mut first: Vec<usize> = (0..count).collect();
        for pose in 0..self.pose_count() {
            let places = || self.source[self.rows(pose)].iter().flatten().map(|shot| shot.place);
            let Some(least) = places().min() else { continue };
            places().filter(|&place| place < count).for_each(|place| first[place] = least);
        }
        first
    }

    /// Part of a single shot's variance that the mean in a row keeps: `1 / n` of n alike.
    pub fn kept(&self, row: usize) -> f64 {
        self.source[row].iter().map(|shot| shot.share * shot.share).sum()
    }

    /// Variance of a row's noise, given the noise that single shots of positions and orientations have; it is not less than
    /// what the shots of poses differ by.
    pub fn noise_variance(&self, row: usize, noise: [f64; 2]) -> f64 {
        let shot = self.shot[usize::from(self.is_orientation[row])];
        let lost = shot * (1.0 - self.kept(row));
        let square = noise[usize::from(self.is_orientation[row])].powi(2).max(shot);
        (square - lost + self.variance[row]) / self.weight[row]
    }

    /// What it grows by with the logarithm of the noise's variance.
    pub fn noise_slope(&self, row: usize, noise: [f64; 2]) -> f64 {
        let square = noise[usize::from(self.is_orientation[row])].powi(2);
        let counts = square > self.shot[usize::from(self.is_orientation[row])];
        if counts { square / self.weight[row] } else { 0.0 }
    }

    /// The same with levers of heights along `up`, a direction in the base frame.
    ///
    /// # Errors
    /// [`FieldError::Kinematics`] if it is no direction.
    pub fn lifted(mut self, up: [f64; 3]) -> Result<Training, FieldError> {
        if up != self.geometry.up() {
            self.geometry = self.geometry.along(up)?;
            let poses = 0..self.pose_count();
            self.levers = poses.flat_map(|pose| self.geometry.at(self.values_of(pose))).collect();
        }
        Ok(self)
    }

    /// The same as hyper-parameters have it: which way is up, and what curves go with.
    ///
    /// # Errors
    /// [`FieldError::Kinematics`] if up is no direction.
    pub fn under(self, hyper: &Hyper) -> Result<Training, FieldError> {
        let lifted = self.lifted(hyper.up)?;
        Ok(if hyper.by_readings { lifted.by_readings() } else { lifted })
    }

    /// All poses, with the rows of some of them (ascending) alone.
    pub fn only(&self, kept: &[usize]) -> Training {
        let mut thinned = self.select(kept);
        let mut rows = kept.iter().map(|&pose| (pose, self.rows(pose).len())).peekable();
        let mut offsets = vec![0];
        for pose in 0..self.pose_count() {
            let own = rows.next_if(|entry| entry.0 == pose).map_or(0, |entry| entry.1);
            offsets.push(offsets[pose] + own);
        }
        thinned.offsets = offsets;
        thinned.values.clone_from(&self.values);
        thinned.levers.clone_from(&self.levers);
        thinned
    }

    /// Poses that have rows among `all` of the same poses, and none here.
    pub fn aside(&self, all: &Training) -> Vec<usize> {
        let is_aside = |&pose: &usize| self.rows(pose).is_empty() && !all.rows(pose).is_empty();
        (0..all.pose_count()).filter(is_aside).collect()
    }

    /// The rows of some poses, in the given order.
    pub fn select(&self, poses: &[usize]) -> Training {
        let rows: Vec<Vec<usize>> = poses.iter().map(|&pose| self.rows(pose).collect()).collect();
        self.with_rows(poses, &rows)
    }

    /// Some poses, in the given order, with these rows each.
    pub fn with_rows(&self, poses: &[usize], rows: &[Vec<usize>]) -> Training {
        let mut offsets = vec![0];
        for rows in rows {
            offsets.push(offsets[offsets.len() - 1] + rows.len());
        }
        let rows = rows.concat();
        let take = |values: &[f64], width: usize| -> Vec<f64> {
            rows.iter().flat_map(|&row| &values[row * width..(row + 1) * width]).copied().collect()
        };
        Training {
            columns: self.columns.clone(),
            parameter_count: self.parameter_count,
            inputs: self.inputs.clone(),
            values: poses.iter().flat_map(|&pose| self.values_of(pose)).copied().collect(),
            drives: self.drives.clone(),
            by_readings: self.by_readings,
            geometry: self.geometry.clone(),
            levers: poses.iter().flat_map(|&pose| self.levers_of(pose)).copied().collect(),
            offsets,
            jacobian: take(&self.jacobian, self.columns.len()),
            setup: take(&self.setup, self.setup_width),
            setup_width: self.setup_width,
            setup_precision: self.setup_precision.clone(),
            residual: take(&self.residual, 1),
            variance: take(&self.variance, 1),
            weight: take(&self.weight, 1),
            shot: self.shot,
            source: rows.iter().map(|&row| self.source[row].clone()).collect(),
            is_orientation: rows.iter().map(|&row| self.is_orientation[row]).collect(),
        }
    }

    /// At most `count` poses that fill the space of inputs: each the farthest from those before it.
    ///
    /// # Errors
    /// [`FieldError::Estimate`] where it is cancelled.
    pub fn fill_space(&self, count: usize, cancel: &Cancel) -> Result<Vec<usize>, FieldError> {
        let width: usize = self.inputs.iter().map(|input| input.place(0.0).len()).sum();
        let places: Vec<f64> = (0..self.pose_count())
            .flat_map(|pose| {
                self.inputs.iter().zip(self.values_of(pose)).flat_map(|(input, x)| input.place(*x))
            })
            .collect();
        let mut nearest = vec![f64::INFINITY; self.pose_count()];
        let (mut kept, mut farthest) = (Vec::new(), 0);
        while kept.len() < count.min(self.pose_count()) {
            if kept.len().is_multiple_of(BETWEEN_LOOKS) {
                cancel.check()?;
            }
            kept.push(farthest);
            let here = places[farthest * width..][..width].to_vec();
            nearest[farthest] = f64::NEG_INFINITY;
            for (least, place) in nearest.iter_mut().zip(places.chunks_exact(width)) {
                let squared: f64 = place.iter().zip(&here).map(|(x, y)| (x - y) * (x - y)).sum();
                *least = least.min(squared);
            }
            farthest = (0..nearest.len())
                .fold(0, |best, pose| if nearest[pose] > nearest[best] { pose } else { best });
        }
        kept.sort_unstable();
        Ok(kept)
    }

    /// Checks lengths once.
    ///
    /// # Errors
    /// [`FieldError::Length`].
    pub fn check(&self) -> Result<(), FieldError> {
        let rows = self.row_count();
        let length = |what, found, expected| {
            if found == expected { Ok(()) } else { Err(FieldError::Length { what, found, expected }) }
        };
        length("values", self.values.len(), self.pose_count() * self.inputs.len())?;
        length("jacobian", self.jacobian.len(), rows * self.columns.len())?;
        length("setup", self.setup.len(), rows * self.setup_width)?;
        length("variance", self.variance.len(), rows)?;
        length("weight", self.weight.len(), rows)?;
        length("source", self.source.len(), rows)?;
        length("is_orientation", self.is_orientation.len(), rows)
    }
}
