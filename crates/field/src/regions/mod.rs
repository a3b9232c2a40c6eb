//! The workspace divided into regions, each with a representative set of CEPs (sections 2.2 and 4 of the paper).
//!
//! Regions are boxes in a space of features: joints, or the spherical or Cartesian position of the tool. Halving makes
//! them a binary tree, so that the region of a configuration is found in as many steps as the tree is deep.

mod divide;
mod estimate;
mod recorded;
mod regional;
mod shrink;
mod source;
mod tree;
mod trend;
mod workspace;

pub use divide::{Arm, Division, DivisionOptions, Ended, Halving, Order, divide};
pub use recorded::Recorded;
pub use regional::{Method, RegionalFit, fill_without_data, regional_ceps};
pub use source::{Prepared, RegionRows, Source, Verdict};
pub use tree::{Parts, Regions};
pub use workspace::{Active, Candidates, PoseOptions, Workspace};
