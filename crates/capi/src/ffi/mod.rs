//! The C functions.

mod correct;
mod guard;
mod handles;
mod load;
mod status;
mod stream;
mod types;

pub use correct::*;
pub use handles::{Calibration, CorrectorHandle, StreamHandle, WorkspaceHandle};
pub use load::*;
pub use status::*;
pub use stream::*;
pub use types::{CorrectorOptions, StreamSettings, StreamState, Waypoint};
