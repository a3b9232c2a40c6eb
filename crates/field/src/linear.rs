//! From measurements to rows that a field is inferred from.

use truearm_bank::{Input, Levers, range};
use truearm_estimate::{Layout, Linearised, Point, Problem, linearise, setup_precision, turn_to_device};

use crate::FieldError;
use crate::options::FieldOptions;
use crate::training::{Column, Shot, Training};

/// Rows of a problem linearised at a point, the constants' prior centred on the nominal arm.
///
/// # Errors
/// [`FieldError::Estimate`] where the point is another problem's, [`FieldError::Length`].
pub fn training(problem: &Problem, point: Point, options: &FieldOptions) -> Result<Training, FieldError> {
    let set = problem.measurements;
    let layout = Layout::new(problem);
    let nominal = problem.chain.nominal();
    let mut linear = linearise(problem, point)?;
    let widths = [layout.arm, layout.group_width(), 1];
    let parts = [&mut linear.arm, &mut linear.setup, &mut linear.residual];
    parts.into_iter().zip(widths).for_each(|(part, width)| turn_to_device(set, point.setup, part, width));
    let columns = columns(problem, options);
    let inputs: Vec<Input> =
        joint_inputs(problem).into_iter().chain(options.features.iter().copied()).collect();
    let own = layout.len() - layout.arm;
    let values = input_values(problem, options);
    let geometry = Levers::new(problem.chain).carrying(payloads(problem, options));
    let mut training = Training {
        columns,
        parameter_count: problem.chain.parameter_count(),
        levers: values.chunks_exact(inputs.len()).flat_map(|values| geometry.at(values)).collect(),
        inputs,
        values,
        drives: options.drives.clone(),
        by_readings: false,
        geometry,
        offsets: vec![0],
        jacobian: Vec::new(),
        setup: Vec::new(),
        setup_width: own,
        setup_precision: setup_precision(problem, point.setup)?,
        residual: Vec::new(),
        variance: Vec::new(),
        weight: Vec::new(),
        shot: [0.0; 2],
        source: Vec::new(),
        is_orientation: Vec::new(),
    };
    for pose in 0..set.pose_count() {
        for row in 0..linear.rows {
            let target = row / 3;
            let orientation = target >= set.target_count;
            let measured = if orientation { set.has_rotation(pose) } else { set.has_target(pose, target) };
            if measured && set.weight[pose] > 0.0 {
                push_row(&mut training, problem, &linear, (pose, row, orientation), &nominal, point);
            }
        }
        training.offsets.push(training.residual.len());
    }
    training.check()?;
    Ok(training)
}

fn push_row(
    training: &mut Training,
    problem: &Problem,
    linear: &Linearised,
    (pose, row, orientation): (usize, usize, bool),
    nominal: &[f64],
    point: Point,
) {
    let set = problem.measurements;
    let layout = Layout::new(problem);
    let at = pose * linear.rows + row;
    let jacobian = &linear.arm[at * layout.arm..(at + 1) * layout.arm];
    let known = by_constants(jacobian, &training.columns, nominal, point);
    training.jacobian.extend(jacobian);
    let width = layout.group_width();
    let mut setup = vec![0.0; training.setup_width];
    let start = layout.group(set.group[pose]).start - layout.arm;
    setup[start..start + width].copy_from_slice(&linear.setup[at * width..(at + 1) * width]);
    training.setup.extend(setup);
    training.residual.push(linear.residual[at] + known);
    training.variance.push(set.own_sigma(pose, row).powi(2));
    training.weight.push(set.weight[pose]);
    training.source.push(vec![Shot { place: at, share: 1.0 }]);
    training.is_orientation.push(orientation);
}

/// What the constants of a point explain of a row's residual from the nominal arm, by its Jacobian (P,).
fn by_constants(jacobian: &[f64], columns: &[Column], nominal: &[f64], point: Point) -> f64 {
    jacobian
        .iter()
        .zip(columns)
        .filter(|(_, column)| column.constant > 0.0)
        .map(|(entry, column)| entry * (point.parameters[column.parameter] - nominal[column.parameter]))
        .sum()
}

/// What the constants of a point leave of the residuals of rows linearised there, (R,).
pub fn left_by_constants(problem: &Problem, point: Point, training: &Training) -> Vec<f64> {
    let nominal = problem.chain.nominal();
    let left = |(row, residual): (usize, &f64)| {
        residual - by_constants(training.jacobian_row(row), &training.columns, &nominal, point)
    };
    training.residual.iter().enumerate().map(left).collect()
}

fn columns(problem: &Problem, options: &FieldOptions) -> Vec<Column> {
    let own = |parameter| problem.chain.joint_columns().iter().position(|&column| column == parameter);
    let column = |(k, &parameter): (usize, &usize)| {
        let driven = options.driven.contains(&k);
        Column {
            parameter,
            constant: if options.determined.contains(&k) { options.prior.of(parameter) } else { 0.0 },
            driven,
            own: if driven { own(parameter) } else { None },
        }
    };
    problem.columns.iter().enumerate().map(column).collect()
}

/// Ways of a slide up to this one, m, are what its readings jitter by where it stands still: as far from it as ever, nothing
/// tells of what it does.
pub const STILL: f64 = 5e-4;

fn joint_inputs(problem: &Problem) -> Vec<Input> {
    let set = problem.measurements;
    let input = |k| {
        if !problem.chain.slides(k) {
            return Input::ANGLE;
        }
        let (low, high) = range(set.joints.iter().skip(k).step_by(set.joint_count));
        Input::line(if high - low > STILL { high - low } else { 0.0 })
    };
    (0..problem.chain.joint_count()).map(input).collect()
}

/// The input of each payload, and the largest one: as heavy as a link, give or take, whatever its unit.
fn payloads(problem: &Problem, options: &FieldOptions) -> Vec<(usize, f64)> {
    let (joints, features) = (problem.chain.joint_count(), options.features.len());
    let largest = |k: usize| {
        let values = options.feature_values.iter().skip(k).step_by(features);
        let largest = values.fold(0.0, |most: f64, value| most.max(value.abs()));
        if largest > 0.0 { largest } else { 1.0 }
    };
    options.payloads.iter().map(|&k| (joints + k, largest(k))).collect()
}

/// Joint values, then features, of every pose, (n, I).
pub fn input_values(problem: &Problem, options: &FieldOptions) -> Vec<f64> {
    let set = problem.measurements;
    let features = options.features.len();
    (0..set.pose_count())
        .flat_map(|pose| {
            let joints = &set.joints[pose * set.joint_count..(pose + 1) * set.joint_count];
            joints.iter().chain(&options.feature_values[pose * features..(pose + 1) * features]).copied()
        })
        .collect()
}
