//! Numbers in the text of a program: found, and replaced with every other byte kept.

mod error;
mod format;
mod number;
mod piece;
mod room;
mod scan;
mod shape;
mod splice;
mod values;

pub use error::TextError;
pub use format::write_fixed;
pub use number::Number;
pub use scan::{Lines, scan_lines};
pub use splice::{Numbers, Words, splice_in_pieces};
pub use values::{Values, read_numbers};

/// Where `word` stands in a text for the first time.
#[must_use]
pub fn find(text: &[u8], word: &[u8]) -> Option<usize> {
    memchr::memmem::find(text, word)
}
