//! What can be wrong with a chain or with the arrays given to it.

use thiserror::Error;

use crate::transform::RIGID_TOLERANCE;

/// Why a chain could not be made or a batch not be computed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum KinematicsError {
    /// A chain without links.
    #[error("a chain needs at least one link, none was given")]
    NoLinks,
    /// A chain in which nothing moves.
    #[error("none of the {links} links has a joint: make at least one of them revolute or prismatic")]
    NoJoints {
        /// Number of links.
        links: usize,
    },
    /// A link parameter that is NaN or infinite.
    #[error("link {link}: {name} is {value}, it must be a finite number")]
    LinkNotFinite {
        /// Index of the link, from 0.
        link: usize,
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A base or end transform that is no rigid motion.
    #[error(
        "the {name} transform is not rigid: R^T R differs from the identity by {deviation:.1e} (at most {:e} may be left, of numbers in double precision), det R is not +1, or a number is not finite; give an orthonormal rotation",
        RIGID_TOLERANCE
    )]
    NotRigid {
        /// Which transform.
        name: &'static str,
        /// Largest deviation of R^T R from the identity.
        deviation: f64,
    },
    /// A direction that is none.
    #[error("the direction {name} is {value:?}: it must be three finite numbers, not all of them zero")]
    NoDirection {
        /// Which direction.
        name: &'static str,
        /// What was given.
        value: [f64; 3],
    },
    /// An array whose length does not fit.
    #[error("{name} has {got} numbers, {rule}")]
    Length {
        /// Which array.
        name: &'static str,
        /// Its length.
        got: usize,
        /// What the length should be.
        rule: String,
    },
    /// An instruction set nobody knows.
    #[error("TRUEARM_ISA is {0:?}, it must be baseline, avx2 or avx512, or not set")]
    UnknownInstructionSet(String),
}
