//! What a field is once it is fitted: a bank of fuzzy association cells (FCMAC blocks), and how far it may be off.
//!
//! Configurations in, CEPs out, eight at once, as a controller evaluates them: this crate finds nothing and factors no matrix.
//! A block is a grid of cells over a few inputs, whose B-spline memberships weigh the cells' CEPs; a sag goes with the levers
//! of what hangs behind each joint. A [`Conservative`] bounds the standard deviation.

mod bank;
mod cells;
mod compiled;
mod compiled_axis;
mod compiled_table;
mod conservative;
mod error;
mod kernel;
mod leverage;
mod sag;
mod spline;

pub use bank::{Bank, Block};
pub use cells::{Active, Axis, CellKernel, Grid, MOST_ACTIVE, MOST_AXES, StoredAxis, range};
pub use compiled::{Compiled, FieldScratch};
pub use conservative::{BOUNDED, Conservative, ConservativeParts, ConservativeScratch};
pub use error::BankError;
pub use kernel::{Input, InputKind, Shape, Value};
pub use leverage::{FACTOR_COLUMNS, Leverage, LeverageScratch, MOVED, moved_with_setup, squared};
pub use sag::{Levers, Sag, SagScratch, UPRIGHT, alike};
pub use spline::{Number, cubic, linear, quadratic};
