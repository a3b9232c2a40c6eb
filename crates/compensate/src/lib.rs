//! Compensation: readings to command so that the real tool goes where the program means it.
//!
//! A program says readings q^n, meant for an arm as the programming model describes it. The calibrated model, whose
//! parameters may vary over the configurations, knows where the real tool goes. [`Corrector`] finds the
//! readings q^c near q^n for which the calibrated model puts the tool where the programming model puts it for q^n,
//! bounds the correction, and refuses what exceeds a bound. [`Inverse`] finds readings for poses.
//!
//! Lengths are metres, angles radians; readings are what the controller shows.

#![allow(clippy::needless_range_loop, reason = "loops over lanes go through several arrays with one index")]

mod aimed;
mod bend;
mod change;
mod cholesky;
mod corrector;
mod coupling;
mod error;
mod inverse;
mod limits;
mod model;
mod newton;
mod path;
mod plan;
mod refusal;
mod spread;
mod stream;
mod task;
mod turn;

pub use corrector::{Correction, Corrector, Options, Workspace};
pub use error::CompensateError;
pub use inverse::{Inverse, Solved};
pub use limits::Limits;
pub use model::Model;
pub use path::{NUMBERS, Path, Run};
pub use refusal::{Reason, Refusal};
pub use spread::{ConstantSpread, Spread};
pub use stream::{Fault, Phase, Step, Stream, StreamOptions};
pub use task::Task;
