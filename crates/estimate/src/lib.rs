//! Identification of constant calibrated error parameters (CEPs) from measurements.
//!
//! The measurement model is that of one group (set-up):
//! `measured target = world_from_base . base . A1 ... AN . flange . target`, with the links' parameters
//! nominal + CEP, and `world_from_base` and the target points unknown in every group. All residuals and
//! Jacobians are taken in the robot's base frame, where isotropic noise stays isotropic; those of a device that is less sure
//! along one of its axes are turned to these where they are weighted.
//!
//! Order of unknowns everywhere: active link parameters (links in order, within a link theta, d, a, alpha,
//! beta), then group by group: translation (3) and rotation (3) of `world_from_base`, target points
//! (3 each), target rotation (3, where orientation is measured), anchors (3 each, of distances).

#![allow(clippy::needless_range_loop, reason = "loops over lanes go through several arrays with one index")]

mod alike;
mod choice;
mod constant;
pub mod dense;
mod device_axes;
mod distance;
mod error;
mod identifiability;
mod layout;
mod measurements;
mod minimise;
mod noise;
mod non_negative;
mod normal;
mod packets;
mod pass;
mod robust;
mod rows;
mod scale;
mod setup;
mod start;

#[cfg(test)]
extern crate self as truearm_estimate;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;
#[cfg(test)]
mod tests;

pub use alike::setup_precision;
pub use choice::{
    Choice, ChoiceOptions, Criterion, Observability, choose_poses, observability, observability_of,
};
pub use constant::{ConstantFit, ConstantOptions, Prior, fit_constant};
pub use device_axes::{own_covariance, turn_to_device};
pub use distance::{Distance, DistanceTo};
pub use error::EstimateError;
pub use identifiability::{Confounded, Identifiability, identifiability, independent_columns};
pub use layout::{Layout, Problem};
pub use measurements::{MeasurementSet, Noise, Sigma};
pub use minimise::Reason;
pub use non_negative::non_negative_least_squares;
pub use robust::Robust;
pub use rows::{Linearised, Point, linearise, residuals};
pub use scale::{PoseRows, column_unit, scaled_jacobian};
pub use setup::{FrameMode, GroupSetup, Setup};
pub use start::initial_setup;
