//! Choice of measurement poses from a pool: of so many poses the ones that determine the parameters best.
//!
//! The matrix M of the chosen poses holds their Jacobians, positions in mm (orientations at 300 mm), columns per mm and
//! per 1/300 rad. What is called condition number is kappa(M); the paper's equation (4) means that of M^t M, its square.

mod determinant;
mod exchange;
mod observability;
mod pool;
mod spectral;

pub use exchange::{Choice, ChoiceOptions, choose_poses};
pub use observability::{Criterion, Observability, observability, observability_of};
