//! Numbers in the text of a program: found, and replaced with every other byte kept.

mod error;
mod format;
mod number;
mod room;
mod scan;
mod splice;

pub use error::TextError;
pub use format::write_fixed;
pub use number::Number;
pub use scan::{Found, Lines, scan_lines};
pub use splice::{Numbers, Words, splice, splice_in_pieces};
