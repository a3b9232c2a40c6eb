//! How far the links and the tool of an arm stay from a table that carries a panel, at places and on ways.
//!
//! Links are capsules between their origins, the column behind the panel is one too; the tool is a line that
//! may not go through the plate around the panel. Lengths are metres, in the frame of the table.

mod arm;
mod clearance;
mod error;
mod segment;
mod table;
mod way;

pub use arm::{Arm, Place};
pub use clearance::{Clearance, Gaps};
pub use error::ClearanceError;
pub use segment::distance;
pub use table::{Column, Plate};
pub use way::Way;
