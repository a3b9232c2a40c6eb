//! The variable calibration from start to end: linearise, choose, weigh, infer, judge outliers, relinearise.

use truearm_estimate::{
    Cancel, ConstantFit, Layout, Linearised, Point, Prior, Problem, Setup, linearise, residuals,
};

use crate::FieldError;
use crate::bank::Bank;
use crate::evidence::Evidence;
use crate::hyper::Hyper;
use crate::kernel::Input;
use crate::optimise::Limits;
use crate::outliers::{self, Judgement};
use crate::posterior::{Posterior, Solution};
use crate::select::{Found, prune_major, refine, select_major};
use crate::training::{Column, Training};

/// How the field is fitted.
#[derive(Debug, Clone)]
pub struct FieldOptions {
    /// Degree of the memberships, 2 or 3.
    pub degree: usize,
    /// Prior of the constants.
    pub prior: Prior,
    /// Columns (indices into the problem's) whose constants the data determines.
    pub determined: Vec<usize>,
    /// Columns that blocks drive.
    pub driven: Vec<usize>,
    /// Further inputs of the field (features), and their values (n, F).
    pub features: Vec<Input>,
    /// Values of the features, (n, F) row-major.
    pub feature_values: Vec<f64>,
    /// Hyper-parameters to use instead of searching for them.
    pub hyper: Option<Hyper>,
    /// Looked at between evaluations.
    pub cancel: Cancel,
}

/// A variable calibration.
pub struct FieldFit {
    /// Constants: absolute link parameters (5 L,).
    pub parameters: Vec<f64>,
    /// What varies.
    pub bank: Bank,
    /// Frames and targets, re-estimated with the field.
    pub setup: Setup,
    /// Hyper-parameters of the evidence's maximum.
    pub hyper: Hyper,
    /// Logarithm of evidence and priors there, on the poses it was evaluated on.
    pub evidence: f64,
    /// Evaluations of the evidence.
    pub evaluations: usize,
    /// Residuals of all poses (n, m), base frame.
    pub residuals: Vec<f64>,
    /// Judgement of every pose by the others.
    pub judgement: Judgement,
    /// For standard deviations.
    pub posterior: Posterior,
}

/// Rows that hyper-parameters are chosen on: the evidence costs their cube.
const ROWS_FOR_SELECTION: usize = 540;
const ROWS_FOR_HYPER: usize = 900;
const ROWS_FOR_POLISH: usize = 1200;
const SEARCH: Limits = Limits { evaluations: 60, gain: 0.02 };
const POLISH: Limits = Limits { evaluations: 12, gain: 0.05 };
/// Reweightings of outliers at the most.
const REWEIGHTINGS: usize = 2;
/// Gauss-Newton steps on the exact model after the linear solution.
const RELINEARISATIONS: usize = 2;
/// The field leaves this share of the constants' residual to noise at the start of the search.
const NOISE_SHARE: f64 = 0.3;

/// Fits constants, field and set-up together, starting from a constant calibration.
///
/// # Errors
/// [`FieldError`].
pub fn fit_field(
    problem: &Problem,
    constant: &ConstantFit,
    options: &FieldOptions,
) -> Result<FieldFit, FieldError> {
    let point = Point { parameters: &constant.parameters, setup: &constant.setup };
    let mut training = training(problem, point, options)?;
    let noise = [constant.noise.position * NOISE_SHARE, constant.noise.orientation * NOISE_SHARE];
    let mut search = Search { problem, options, evidence: f64::NAN, evaluations: 0 };
    let mut hyper = search.first(&training, noise)?;
    let mut judged = search.judge(&training, &hyper)?;
    for _ in 0..REWEIGHTINGS {
        if !judged.judgement.reweigh(&mut training) {
            break;
        }
        hyper = search.again(&training, hyper)?;
        judged = search.judge(&training, &hyper)?;
    }
    let Judged { posterior, solution, judgement } = judged;
    let refined = relinearised(problem, point, &posterior, solution)?;
    Ok(FieldFit {
        parameters: refined.parameters,
        bank: refined.bank,
        setup: refined.setup,
        hyper,
        evidence: search.evidence,
        evaluations: search.evaluations,
        residuals: refined.residuals,
        judgement,
        posterior,
    })
}

/// The posterior of known hyper-parameters, for standard deviations without a fit.
///
/// # Errors
/// [`FieldError`].
pub fn restore(
    problem: &Problem,
    point: Point,
    options: &FieldOptions,
    hyper: Hyper,
) -> Result<Posterior, FieldError> {
    Posterior::new(training(problem, point, options)?, hyper, options.degree)
}

struct Judged {
    posterior: Posterior,
    solution: Solution,
    judgement: Judgement,
}

struct Search<'a> {
    problem: &'a Problem<'a>,
    options: &'a FieldOptions,
    evidence: f64,
    evaluations: usize,
}

impl Search<'_> {
    fn first(&mut self, training: &Training, noise: [f64; 2]) -> Result<Hyper, FieldError> {
        if let Some(hyper) = &self.options.hyper {
            return Ok(hyper.clone());
        }
        let joints = self.problem.measurements.joint_count;
        let small = training.select(&spread_poses(training, ROWS_FOR_SELECTION));
        let chosen = select_major(&small, joints, noise, &self.options.cancel)?;
        let middle = training.select(&spread_poses(training, ROWS_FOR_HYPER));
        let evidence = Evidence::new(&middle, &self.options.cancel);
        let mut found = refine(&evidence, chosen.hyper, SEARCH)?;
        found.evaluations += chosen.evaluations;
        let mut found = prune_major(&evidence, found)?;
        found = refine_more(&evidence, found, POLISH)?;
        self.note(&found);
        if training.row_count() > middle.row_count() {
            return self.again(training, found.hyper);
        }
        Ok(found.hyper)
    }

    /// Hyper-parameters from present ones, on as many rows as can be afforded.
    fn again(&mut self, training: &Training, hyper: Hyper) -> Result<Hyper, FieldError> {
        if self.options.hyper.is_some() {
            return Ok(hyper);
        }
        let large = training.select(&spread_poses(training, ROWS_FOR_POLISH));
        let found = refine(&Evidence::new(&large, &self.options.cancel), hyper, POLISH)?;
        self.note(&found);
        Ok(found.hyper)
    }

    fn note(&mut self, found: &Found) {
        self.evidence = found.value;
        self.evaluations += found.evaluations;
    }

    fn judge(&self, training: &Training, hyper: &Hyper) -> Result<Judged, FieldError> {
        self.options.cancel.check()?;
        let posterior = Posterior::new(training.clone(), hyper.clone(), self.options.degree)?;
        self.options.cancel.check()?;
        let solution = posterior.solve(&training.residual);
        let judgement = outliers::judge(&posterior, &solution)?;
        Ok(Judged { posterior, solution, judgement })
    }
}

fn refine_more(evidence: &Evidence, found: Found, limits: Limits) -> Result<Found, FieldError> {
    let better = refine(evidence, found.hyper, limits)?;
    Ok(Found { evaluations: found.evaluations + better.evaluations, ..better })
}

/// Poses spread evenly over the training set (and so over its groups) with at most `rows` rows.
fn spread_poses(training: &Training, rows: usize) -> Vec<usize> {
    let poses = training.pose_count();
    let per_pose = (training.row_count() as f64 / poses.max(1) as f64).max(1.0);
    let wanted = ((rows as f64 / per_pose) as usize).clamp(1, poses);
    (0..wanted).map(|k| k * poses / wanted).collect()
}

/// Rows of a problem linearised at a point, the constants' prior centred on the nominal arm.
fn training(problem: &Problem, point: Point, options: &FieldOptions) -> Result<Training, FieldError> {
    let set = problem.measurements;
    let layout = Layout::new(problem);
    let nominal = problem.chain.nominal();
    let linear = linearise(problem, point);
    let columns = columns(problem, options);
    let inputs: Vec<Input> =
        joint_inputs(problem).into_iter().chain(options.features.iter().copied()).collect();
    let own = layout.len() - layout.arm;
    let mut training = Training {
        columns,
        parameter_count: problem.chain.parameter_count(),
        inputs,
        values: input_values(problem, options),
        offsets: vec![0],
        jacobian: Vec::new(),
        setup: Vec::new(),
        setup_width: own,
        residual: Vec::new(),
        variance: Vec::new(),
        weight: Vec::new(),
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
    let known: f64 = jacobian
        .iter()
        .zip(&training.columns)
        .filter(|(_, column)| column.constant > 0.0)
        .map(|(entry, column)| entry * (point.parameters[column.parameter] - nominal[column.parameter]))
        .sum();
    training.jacobian.extend(jacobian);
    let width = layout.group_width();
    let mut setup = vec![0.0; training.setup_width];
    let start = layout.group(set.group[pose]).start - layout.arm;
    setup[start..start + width].copy_from_slice(&linear.setup[at * width..(at + 1) * width]);
    training.setup.extend(setup);
    training.residual.push(linear.residual[at] + known);
    training.variance.push(if orientation { 0.0 } else { set.sigma[pose].powi(2) });
    training.weight.push(set.weight[pose]);
    training.is_orientation.push(orientation);
}

fn columns(problem: &Problem, options: &FieldOptions) -> Vec<Column> {
    let mut joint_of_link = vec![None; problem.chain.link_count()];
    let mut joint = 0;
    for (link, slot) in problem.chain.links().iter().zip(&mut joint_of_link) {
        if link.joint != truearm_kinematics::Joint::Fixed {
            *slot = Some((joint, link.joint));
            joint += 1;
        }
    }
    let own = |parameter: usize| match joint_of_link[parameter / 5] {
        Some((joint, truearm_kinematics::Joint::Revolute)) if parameter % 5 == 0 => Some(joint),
        Some((joint, truearm_kinematics::Joint::Prismatic)) if parameter % 5 == 1 => Some(joint),
        _ => None,
    };
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

fn joint_inputs(problem: &Problem) -> Vec<Input> {
    let set = problem.measurements;
    let kinds = problem.chain.links().iter().map(|link| link.joint);
    let moving = kinds.filter(|&joint| joint != truearm_kinematics::Joint::Fixed);
    moving
        .enumerate()
        .map(|(k, joint)| match joint {
            truearm_kinematics::Joint::Prismatic => {
                let values = set.joints.iter().skip(k).step_by(set.joint_count);
                let (low, high) = values
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
                Input::line(high - low)
            }
            _ => Input::ANGLE,
        })
        .collect()
}

/// Joint values, then features, of every pose.
fn input_values(problem: &Problem, options: &FieldOptions) -> Vec<f64> {
    let set = problem.measurements;
    let features = options.features.len();
    (0..set.pose_count())
        .flat_map(|pose| {
            let joints = &set.joints[pose * set.joint_count..(pose + 1) * set.joint_count];
            joints.iter().chain(&options.feature_values[pose * features..(pose + 1) * features]).copied()
        })
        .collect()
}

struct Refined {
    parameters: Vec<f64>,
    bank: Bank,
    setup: Setup,
    residuals: Vec<f64>,
}

/// Gauss-Newton on the exact model with the factor of the linear one: the remainder is of second order in the CEPs.
fn relinearised(
    problem: &Problem,
    point: Point,
    posterior: &Posterior,
    mut solution: Solution,
) -> Result<Refined, FieldError> {
    let mut refined = apply(problem, point, posterior, &solution)?;
    for _ in 0..RELINEARISATIONS {
        let explained = explained(posterior, &solution)?;
        let rows = problem.measurements.rows_per_pose();
        let exact = present_rows(problem, &refined.residuals, rows);
        let linear: Vec<f64> = exact.iter().zip(&explained).map(|(a, b)| a + b).collect();
        solution = posterior.solve(&linear);
        refined = apply(problem, point, posterior, &solution)?;
    }
    Ok(refined)
}

/// Residuals of the rows that the training holds, out of (n, m).
fn present_rows(problem: &Problem, residuals: &[f64], rows: usize) -> Vec<f64> {
    let set = problem.measurements;
    let mut out = Vec::new();
    for pose in (0..set.pose_count()).filter(|&pose| set.weight[pose] > 0.0) {
        for row in 0..rows {
            let target = row / 3;
            let measured = if target >= set.target_count {
                set.has_rotation(pose)
            } else {
                set.has_target(pose, target)
            };
            if measured {
                out.push(residuals[pose * rows + row]);
            }
        }
    }
    out
}

/// What constants, field and set-up of a solution explain of the training's residual, (R,).
fn explained(posterior: &Posterior, solution: &Solution) -> Result<Vec<f64>, FieldError> {
    let training = &posterior.training;
    let mut ceps = vec![0.0; training.pose_count() * training.parameter_count];
    solution.bank.add(&training.values, &mut ceps)?;
    let mut out = Vec::with_capacity(training.row_count());
    for pose in 0..training.pose_count() {
        let ceps = &ceps[pose * training.parameter_count..(pose + 1) * training.parameter_count];
        for row in training.rows(pose) {
            let arm: f64 = training
                .jacobian_row(row)
                .iter()
                .zip(training.columns.iter().zip(&solution.constant))
                .map(|(entry, (column, constant))| entry * (constant + ceps[column.parameter]))
                .sum();
            let setup = &training.setup[row * training.setup_width..(row + 1) * training.setup_width];
            out.push(arm + setup.iter().zip(&solution.setup).map(|(a, b)| a * b).sum::<f64>());
        }
    }
    Ok(out)
}

/// Constants, field and set-up of a solution, with the exact residuals they leave.
fn apply(
    problem: &Problem,
    point: Point,
    posterior: &Posterior,
    solution: &Solution,
) -> Result<Refined, FieldError> {
    let training = &posterior.training;
    let mut parameters = problem.chain.nominal();
    for (column, constant) in training.columns.iter().zip(&solution.constant) {
        parameters[column.parameter] += constant;
    }
    let layout = Layout::new(problem);
    let mut step = vec![0.0; layout.arm];
    step.extend(&solution.setup);
    let setup = layout.step_setup(point.setup, &step);
    let poses = problem.measurements.pose_count();
    let mut varying: Vec<f64> = std::iter::repeat_n(&parameters, poses).flatten().copied().collect();
    solution.bank.add(&training.values, &mut varying)?;
    let residuals = residuals(problem, Point { parameters: &varying, setup: &setup })?;
    Ok(Refined { parameters, bank: solution.bank.clone(), setup, residuals })
}
