//! CMAC and FCMAC networks as in section 5 and the appendix of the paper: inputs excite cells of sensors, a
//! combination of cells, one of each sensor, is an association cell, and the output is the mean of the active
//! cells' weights, weighted with their excitation.
//!
//! Weights come from training by the paper's rule (A5), on patterns or on measurements, or from linear least
//! squares on the measurements with a roughness penalty.

mod evaluate;
mod excited;
mod fit;
mod gain;
mod network;
mod roughness;
mod sensor;
mod table;
#[cfg(test)]
mod tests;
mod training;

pub use fit::{FitOptions, NetworkFit, Scales};
pub use gain::LinearRows;
pub use network::{Composition, Network, NetworkOptions};
pub use sensor::{Membership, Sensor};
pub use training::{Patterns, Rate, Trained, TrainingEnd, TrainingOptions};
