//! Tests of what the crate keeps to itself, on the arms and scenes of the integration tests.

mod distances;
mod identifiability;
mod normal_equations;
mod weights;
