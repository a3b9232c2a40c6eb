//! What the tests share: arms whose true parameters vary in a known way, their measurements, and the way from
//! measurements to a fit.
#![allow(
    dead_code,
    missing_docs,
    unused_imports,
    clippy::unwrap_used,
    reason = "each test binary uses a part of it"
)]

#[path = "../../../bank/tests/common/mod.rs"]
mod banks;
mod measuring;
mod pipeline;

pub use banks::{Arm, Random, Truth, scara, seven_axes, six_axes, with_threads};
pub use measuring::{Measure, shots, subset};
pub use pipeline::{Fitted, deviations, fit, fit_from, fitted, options, problem, root_mean_square, spans};
