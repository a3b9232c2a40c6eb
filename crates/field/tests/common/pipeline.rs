//! From measurements to constants to a field, as the product does it.

use truearm_estimate::{
    ConstantFit, ConstantOptions, FrameMode, MeasurementSet, Point, Prior, Problem, fit_constant,
    identifiability, residuals,
};
use truearm_field::{Begin, FieldError, FieldFit, FieldOptions, fit_field};
use truearm_kinematics::Cancel;

use super::Arm;

/// Both fits with the options of the second.
pub struct Fitted {
    pub constant: ConstantFit,
    pub field: FieldFit,
    pub options: FieldOptions,
}

pub fn problem<'a>(arm: &'a Arm, set: &'a MeasurementSet, columns: &'a [usize]) -> Problem<'a> {
    Problem { chain: &arm.chain, measurements: set, columns, frame: FrameMode::Free }
}

/// Constants that the poses determine, and the options of a field on top of them.
pub fn options(arm: &Arm, set: &MeasurementSet) -> Result<(ConstantFit, FieldOptions), FieldError> {
    let nominal = fit_constant(&problem(arm, set, &[]), &ConstantOptions::default())?;
    let candidates = arm.constant_columns();
    let found = identifiability(&problem(arm, set, &candidates), &arm.chain.nominal(), &nominal.setup)?;
    let determined: Vec<usize> = found.determined.iter().map(|&k| candidates[k]).collect();
    let prior = Prior::default();
    let constant = fit_constant(
        &problem(arm, set, &determined),
        &ConstantOptions { prior: Some(prior), ..ConstantOptions::default() },
    )?;
    let position = |column: &usize| arm.columns.iter().position(|other| other == column).unwrap();
    let options = FieldOptions {
        degree: 2,
        prior,
        determined: determined.iter().map(position).collect(),
        driven: (0..arm.columns.len()).collect(),
        features: Vec::new(),
        payloads: Vec::new(),
        feature_values: Vec::new(),
        drives: None,
        begin: Begin::Anew,
        rough: false,
        cancel: Cancel::default(),
    };
    Ok((constant, options))
}

/// The whole way.
pub fn fit(arm: &Arm, set: &MeasurementSet) -> Result<Fitted, FieldError> {
    let (constant, options) = options(arm, set)?;
    fit_from(arm, set, constant, options)
}

/// The field alone, with options of one's own.
pub fn fit_from(
    arm: &Arm,
    set: &MeasurementSet,
    constant: ConstantFit,
    options: FieldOptions,
) -> Result<Fitted, FieldError> {
    let field = fit_field(&problem(arm, set, &arm.columns), &constant, &options)?;
    Ok(Fitted { constant, field, options })
}

/// Calibrated parameters (n, 5 L) at inputs (n, I).
pub fn fitted(field: &FieldFit, inputs: &[f64]) -> Vec<f64> {
    let poses = inputs.len() / field.bank.input_count;
    let mut parameters: Vec<f64> = std::iter::repeat_n(&field.parameters, poses).flatten().copied().collect();
    field.bank.add(inputs, &mut parameters).unwrap();
    parameters
}

/// Residuals (n, m) of other measurements in the fit's groups: by constants alone, and with the field.
pub fn deviations(arm: &Arm, fit: &Fitted, set: &MeasurementSet) -> (Vec<f64>, Vec<f64>) {
    let problem = problem(arm, set, &arm.columns);
    let constant = Point { parameters: &fit.constant.parameters, setup: &fit.constant.setup };
    let varying = fitted(&fit.field, &set.joints);
    let field = Point { parameters: &varying, setup: &fit.field.setup };
    (residuals(&problem, constant).unwrap(), residuals(&problem, field).unwrap())
}

pub fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// Largest minus smallest.
pub fn spans(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
}
