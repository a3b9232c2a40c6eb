//! Drives that turn several joints: what they leave may go with their readings.
//!
//! On arms whose joints are coupled, joint values are `q = C r` of the readings r. Behind a parallel link the motor of
//! reading k turns all joints by column k of C, and what its gear or its encoder leaves is a function of r_k, which is no
//! joint's value. Whether curves and waves go with joint values or with readings the evidence tells (docs/decisions/0038).

use std::borrow::Cow;

use faer::Mat;
use truearm_bank::{Block, Grid, Input};
use truearm_estimate::dense::inverse_of_square;

use crate::model::BlockPlan;
use crate::training::{Column, Training};

/// The drives of an arm that turn several joints, or whose readings are sums of several joint values.
#[derive(Debug, Clone, PartialEq)]
pub struct Drives {
    drives: Vec<Drive>,
}

/// One of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Which reading it is of, from 0; the joint of this number has no curve of its own beside it.
    pub reading: usize,
    /// The reading by joint values, (N,).
    pub from_joints: Vec<f64>,
    /// Joints that it turns, and how far for a radian of its reading.
    pub turned: Vec<(usize, f64)>,
}

impl Drives {
    /// Of the matrix (N, N), row-major, that makes joint values of readings.
    ///
    /// `None` where no joints are coupled, where one of those that are slides, and where readings do not follow from joint values.
    pub fn of(coupling: &[f64], slides: impl Fn(usize) -> bool) -> Option<Self> {
        let count = coupling.len().isqrt();
        let entry = |joint: usize, reading: usize| coupling[joint * count + reading];
        let met = |k: usize, j: usize| entry(j, k) != 0.0 || entry(k, j) != 0.0;
        let coupled = |&k: &usize| (0..count).any(|j| j != k && met(k, j));
        let readings: Vec<usize> = (0..count).filter(coupled).collect();
        if readings.is_empty() || readings.iter().any(|&k| slides(k)) {
            return None;
        }
        let inverse = inverse_of_square(&Mat::from_fn(count, count, entry));
        let drive = |reading: usize| Drive {
            reading,
            from_joints: (0..count).map(|joint| inverse[(reading, joint)]).collect(),
            turned: (0..count).map(|j| (j, entry(j, reading))).filter(|turned| turned.1 != 0.0).collect(),
        };
        let drives: Vec<Drive> = readings.into_iter().map(drive).collect();
        let sound = drives.iter().flat_map(|drive| &drive.from_joints).all(|factor| factor.is_finite());
        sound.then_some(Self { drives })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.drives.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.drives.is_empty()
    }
}

/// A sum of joint values.
pub fn reading_of(from_joints: &[f64], joints: &[f64]) -> f64 {
    from_joints.iter().zip(joints).map(|(factor, joint)| factor * joint).sum()
}

impl Training {
    /// The same where curves and waves of coupled joints go with readings: these are inputs, and what their drives turn is
    /// columns, behind all others. As it is where no joints are coupled, or where they do so already.
    pub fn by_readings(mut self) -> Self {
        let Some(drives) = self.drives.clone().filter(|_| !self.by_readings) else { return self };
        self.values = self.with_readings(&self.values, &drives);
        self.jacobian = self.with_turned(&self.jacobian, &drives);
        for drive in &drives.drives {
            let parts = self.parts(drive);
            self.columns.push(Column {
                parameter: parts.first().map_or(0, |&(p, _)| self.columns[p].parameter),
                constant: 0.0,
                driven: false,
                own: (!parts.is_empty()).then_some(self.inputs.len()),
            });
            self.inputs.push(Input::ANGLE);
        }
        self.by_readings = true;
        self
    }

    /// Drives with whose readings curves go here.
    pub(crate) fn in_use(&self) -> &[Drive] {
        self.drives.as_ref().filter(|_| self.by_readings).map_or(&[], |drives| &drives.drives)
    }

    /// Joints and features, I.
    pub fn input_count(&self) -> usize {
        self.inputs.len() - self.in_use().len()
    }

    /// Columns of the problem, P.
    pub fn column_count(&self) -> usize {
        self.columns.len() - self.in_use().len()
    }

    /// Whether what an input's drive leaves goes with that input.
    pub fn has_curve(&self, input: usize) -> bool {
        self.in_use().iter().all(|drive| drive.reading != input)
    }

    /// The joint whose drive an input is of: readings are numbered as joints are.
    pub fn joint_of(&self, input: usize) -> usize {
        let drive = input.checked_sub(self.input_count()).map(|k| self.in_use()[k].reading);
        drive.unwrap_or(input)
    }

    /// Inputs (n, I), with the readings that are inputs here.
    pub fn with_own_inputs<'a>(&self, values: &'a [f64]) -> Cow<'a, [f64]> {
        match &self.drives {
            Some(drives) if self.by_readings => Cow::Owned(self.with_readings(values, drives)),
            _ => Cow::Borrowed(values),
        }
    }

    /// Rows (n, P) of a Jacobian, with the columns that there are here.
    pub fn with_own_columns<'a>(&self, jacobian: &'a [f64]) -> Cow<'a, [f64]> {
        match &self.drives {
            Some(drives) if self.by_readings => Cow::Owned(self.with_turned(jacobian, drives)),
            _ => Cow::Borrowed(jacobian),
        }
    }

    /// Values of joints and features alone, (n, I).
    pub fn without_readings(&self) -> Cow<'_, [f64]> {
        if self.in_use().is_empty() {
            return Cow::Borrowed(&self.values);
        }
        let of_pose = self.values.chunks_exact(self.inputs.len());
        of_pose.flat_map(|values| &values[..self.input_count()]).copied().collect()
    }

    fn with_readings(&self, values: &[f64], drives: &Drives) -> Vec<f64> {
        let mut out = Vec::new();
        for values in values.chunks_exact(self.input_count()) {
            out.extend_from_slice(values);
            out.extend(drives.drives.iter().map(|drive| reading_of(&drive.from_joints, values)));
        }
        out
    }

    fn with_turned(&self, jacobian: &[f64], drives: &Drives) -> Vec<f64> {
        let parts: Vec<_> = drives.drives.iter().map(|drive| self.parts(drive)).collect();
        let mut out = Vec::new();
        for row in jacobian.chunks_exact(self.column_count()) {
            out.extend_from_slice(row);
            let turned = |parts: &Vec<(usize, f64)>| parts.iter().map(|&(p, by)| by * row[p]).sum::<f64>();
            out.extend(parts.iter().map(turned));
        }
        out
    }

    /// Columns of the angles that a drive turns, and by how much.
    pub(crate) fn parts(&self, drive: &Drive) -> Vec<(usize, f64)> {
        let column = |joint: usize| self.columns.iter().position(|column| column.own == Some(joint));
        drive.turned.iter().filter_map(|&(joint, by)| Some((column(joint)?, by))).collect()
    }

    /// A block with weights (cells, driven columns): what a drive turns are the angles of its joints.
    pub fn block(&self, plan: &BlockPlan, grid: Grid, weights: Vec<f64>) -> Block {
        let name = plan.name.to_owned();
        let drive = grid.inputs[0].checked_sub(self.input_count()).map(|k| &self.in_use()[k]);
        let Some(drive) = drive else {
            let outputs = plan.driven.iter().map(|&(p, _)| self.columns[p].parameter).collect();
            return Block { name, grid, outputs, weights, reading: None };
        };
        let parts = self.parts(drive);
        let weights =
            weights.iter().flat_map(|weight| parts.iter().map(move |(_, by)| by * weight)).collect();
        Block {
            name,
            grid: Grid { inputs: vec![drive.reading], axes: grid.axes },
            outputs: parts.iter().map(|&(p, _)| self.columns[p].parameter).collect(),
            weights,
            reading: Some(drive.from_joints.clone()),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;

    /// Joint 3 is read against the horizon, joint 4 counts the other way.
    const COUPLING: [f64; 16] =
        [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0];

    #[test]
    fn drives_of_coupled_joints_turn_what_their_readings_turn() {
        let found = Drives::of(&COUPLING, |_| false).unwrap();
        let [second, third] = found.drives.as_slice() else { panic!("{found:?}") };
        assert_eq!((second.reading, third.reading), (1, 2));
        assert_eq!(second.turned, [(1, 1.0), (2, 1.0)]);
        assert_eq!(third.turned, [(2, 1.0)]);
        let (readings, joints) = ([0.1, 0.5, -0.2, 0.7], [0.1, 0.5, 0.3, -0.7]);
        for drive in &found.drives {
            let reading = reading_of(&drive.from_joints, &joints);
            assert!((reading - readings[drive.reading]).abs() < 1e-15, "{drive:?}");
        }
    }

    #[test]
    fn there_are_none_where_joints_are_their_own_or_slide() {
        let turned = [1.0, 0.0, 0.0, -1.0];
        assert_eq!(Drives::of(&turned, |_| false), None);
        assert_eq!(Drives::of(&COUPLING, |joint| joint == 2), None);
        assert!(Drives::of(&COUPLING, |joint| joint == 0).is_some());
        assert_eq!(Drives::of(&[1.0, 1.0, 1.0, 1.0], |_| false), None);
    }
}
