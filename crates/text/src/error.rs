//! What can be wrong with places in a text.

use thiserror::Error;

/// Places that do not fit the text.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TextError {
    /// A span reaches past the end, ends before it begins, or begins before the last one ends.
    #[error("the span {start}..{end} does not fit behind {after} in a text of {length} bytes")]
    Span {
        /// First byte.
        start: usize,
        /// Behind the last byte.
        end: usize,
        /// End of the span before.
        after: usize,
        /// Bytes of the text.
        length: usize,
    },
    /// A value that has no digits.
    #[error("the number for byte {start} is {value}, it must be finite")]
    NotFinite {
        /// First byte of the span.
        start: usize,
        /// The value.
        value: f64,
    },
    /// A place that is said to be a number's.
    #[error("no number begins at byte {start}")]
    NoNumber {
        /// The place.
        start: i32,
    },
    /// Columns of one table that differ in length.
    #[error("the columns of a table have {first} and {other} rows, they must have the same number")]
    Lengths {
        /// Rows of the first column.
        first: usize,
        /// Rows of another one.
        other: usize,
    },
    /// More bytes than offsets can count.
    #[error("the text has {length} bytes, it may have {most}")]
    TooLong {
        /// Bytes of the text.
        length: usize,
        /// Bytes that it may have.
        most: usize,
    },
}
