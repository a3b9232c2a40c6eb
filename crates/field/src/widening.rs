//! What amplitudes that the evidence leaves open mean for standard deviations.
//!
//! The field is the one under the most probable amplitudes. Where data hardly tells an amplitude, its posterior is wide and the
//! variance it stands for is larger than the most probable amplitude's square: with a log-normal posterior of
//! standard deviation s about the mode a, `E[amplitude^2] = a^2 exp(2 s^2)`. s comes from the curvature of evidence and
//! prior at the mode (Laplace; Rasmussen and Williams 2006, sec. 3.4), each amplitude by itself.

use crate::FieldError;
use crate::evidence::Evidence;
use crate::hyper::Hyper;
use crate::hyper_prior::HyperPrior;

/// Step of the finite difference, in the logarithm: large against the evidence's rounding, small against the change of its
/// curvature.
const STEP: f64 = 0.02;

/// The same hyper-parameters with the widening of each amplitude.
///
/// # Errors
/// [`FieldError`] of the evidence.
pub fn with_widenings(evidence: &Evidence, hyper: &Hyper) -> Result<Hyper, FieldError> {
    let (logs, prior) = (hyper.to_logs(), HyperPrior::new(hyper));
    let here = evidence.score(hyper)?.gradient;
    let mut widenings = Vec::new();
    for k in hyper.amplitude_positions() {
        let mut moved = logs.clone();
        moved[k] += STEP;
        let curvature = (here[k] - evidence.score(&hyper.with_logs(&moved))?.gradient[k]) / STEP;
        // The evidence never widens what the prior says.
        widenings.push(curvature.max(prior.precision_of(k)).recip().exp());
    }
    Ok(hyper.with_widenings(&widenings))
}
