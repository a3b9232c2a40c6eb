//! An arm as somebody believes it to be: where readings put its flange.

use truearm_bank::Compiled;
use truearm_kinematics::{Chain, SharedParameters};

use crate::coupling::Coupling;
use crate::error::{CompensateError, check_finite, check_length};
use crate::spread::Spread;

/// An arm's kinematics over readings: plain, or with parameters that vary.
///
/// Parameters are ordered by link, within a link theta, d, a, alpha, beta (rad and m).
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) chain: Chain,
    pub(crate) constants: Vec<f64>,
    pub(crate) shared: SharedParameters,
    pub(crate) coupling: Coupling,
    pub(crate) field: Option<Compiled>,
    pub(crate) feature_count: usize,
    pub(crate) spread: Option<Spread>,
}

impl Model {
    /// A model with one set of parameters.
    ///
    /// `chain` ends at the flange; `constants` are 5 L absolute parameters; `coupling` (N, N), row-major, makes
    /// Denavit-Hartenberg joint values of readings.
    ///
    /// # Errors
    /// [`CompensateError::Length`] and [`CompensateError::NotFinite`].
    pub fn new(chain: Chain, constants: &[f64], coupling: &[f64]) -> Result<Model, CompensateError> {
        let joints = chain.joint_count();
        check_length("the constants", constants.len(), chain.parameter_count())?;
        check_length("the coupling", coupling.len(), joints * joints)?;
        check_finite("the constants", constants)?;
        check_finite("the coupling", coupling)?;
        Ok(Model {
            shared: SharedParameters::new(constants),
            coupling: Coupling::new(coupling, joints),
            constants: constants.to_vec(),
            chain,
            field: None,
            feature_count: 0,
            spread: None,
        })
    }

    /// The same with a field added to the constants, over the joint values and so many features.
    ///
    /// # Errors
    /// [`CompensateError::Length`] if the field is not of this arm.
    pub fn with_field(self, field: Compiled, feature_count: usize) -> Result<Model, CompensateError> {
        let inputs = self.chain.joint_count() + feature_count;
        check_length("the field's inputs", field.input_count(), inputs)?;
        check_length("the field's parameters", field.parameter_count(), self.chain.parameter_count())?;
        Ok(Model { field: Some(field), feature_count, ..self })
    }

    /// The same with what is known of its uncertainty.
    ///
    /// # Errors
    /// [`CompensateError::Length`] and [`CompensateError::NotFinite`] if it is not of this arm.
    pub fn with_spread(self, spread: Spread) -> Result<Model, CompensateError> {
        spread.check(&self)?;
        Ok(Model { spread: Some(spread), ..self })
    }

    /// Number of joints, N.
    pub fn joint_count(&self) -> usize {
        self.chain.joint_count()
    }

    /// Number of features that the field depends on beside the joints, F.
    pub fn feature_count(&self) -> usize {
        self.feature_count
    }

    /// The chain to the flange.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }
}
