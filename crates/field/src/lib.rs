//! Finding error parameters that vary with the configuration: the weights of a bank of fuzzy association cells (FCMAC
//! blocks, `truearm_bank`) are inferred from the measurements themselves.
//!
//! A measured residual is `r = J(q) CEP(q) + noise` with `CEP(q)` the sum of blocks, each a grid of cells over a
//! few inputs whose B-spline memberships weigh the cells' CEPs. Each block's weights have a Gaussian prior
//! (a kernel on its cells), so that fit, evidence and standard deviation are those of exact Gaussian inference.
//!
//! Blocks: `constant` (the constants, kernel one), `own` (theta of a revolute joint, d of a prismatic one, over that
//! joint; where joints are coupled, over a reading, if the evidence has it so), `sag` (the same parameter in proportion to the levers
//! of the links behind the joint, and of what hangs beside the end), `wave` (the angle of a joint by a cosine and a sine of some hundred cycles a turn, where gears, encoders or screws leave one),
//! `smooth` (all CEPs over each input separately), `major` and `wrist` (all CEPs over at most three joints
//! together: those that the evidence chooses, and the last three).

#[cfg(test)]
extern crate self as truearm_field;

mod ascent;
mod beyond;
pub mod cmac;
mod columns;
mod compass;
mod condensed;
mod conservative_fit;
mod continuous;
mod data_space;
mod drift;
mod drives;
mod error;
mod evidence;
mod extrapolation;
mod fit;
mod gram;
mod greedy;
mod hyper;
mod hyper_check;
mod hyper_prior;
mod information;
mod joined;
mod leverage_fit;
mod linear;
mod mixed;
mod model;
mod optimise;
mod options;
mod outliers;
mod own;
mod pairs;
mod posterior;
mod predict;
mod projection;
mod refine;
pub mod regions;
mod select;
#[cfg(test)]
mod tests;
mod training;
mod unknowns;
mod upright;
mod waves;
mod weight_rows;
mod weight_space;
mod widening;

pub use conservative_fit::{ConservativePlan, Samples};
pub use drift::{Drift, Left, find_drift};
pub use drives::Drives;
pub use error::FieldError;
pub use fit::{FieldFit, fit_field, restore};
pub use greedy::{Candidates, Greedy, choose_informative, choose_telling};
pub use hyper::{Hyper, MAJOR_NAME, Product, WRIST_NAME, Wave};
pub use joined::shots_of_poses;
pub use leverage_fit::fit_leverage;
pub use linear::STILL;
pub use options::{Begin, FieldOptions, Start};
pub use outliers::{Judgement, QUANTILE_95};
pub use own::UNRIPPLED;
pub use posterior::Posterior;
pub use predict::measurement_covariance;
pub use training::{Class, Column, Training};
