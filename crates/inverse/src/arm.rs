//! What an arm's inverse kinematics is made of.

use truearm_kinematics::Chain;

use crate::readings::Readings;

/// A plain arm: its chain from base to flange over joint values, and what its readings are.
#[derive(Debug, Clone)]
pub struct Arm {
    /// Base to flange.
    pub chain: Chain,
    /// Coupling and limits.
    pub readings: Readings,
}
