//! A text with other numbers in it.

use rayon::prelude::*;

use crate::error::TextError;
use crate::room::Room;

/// Numbers that are written at a time; the result does not depend on it.
const PIECE: usize = 1 << 14;
/// Bytes that a piece usually has at most.
const ROOM: usize = 1 << 19;

/// Numbers to write over spans of a text, in the order of the text; all columns have the same length.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'a> {
    /// First byte of each.
    pub starts: &'a [i32],
    /// Behind the last byte of each.
    pub ends: &'a [i32],
    /// What to write.
    pub values: &'a [f64],
    /// With how many digits behind the point.
    pub decimals: &'a [i16],
}

/// Bytes to put over a span of a text; over an empty one they are inserted.
#[derive(Clone, Copy, Debug)]
pub struct Words<'a> {
    /// First byte of the span.
    pub start: usize,
    /// Behind its last byte.
    pub end: usize,
    /// What.
    pub bytes: &'a [u8],
}

/// `text` with numbers and words, both in the order of the text, and every other byte as it is: in pieces, which
/// follow one another.
///
/// # Errors
/// If a span does not fit the text or overlaps another one, or a value is not finite.
pub fn splice_in_pieces(
    text: &[u8],
    numbers: Numbers<'_>,
    words: &[Words<'_>],
) -> Result<Vec<Vec<u8>>, TextError> {
    let count = numbers.starts.len();
    for other in [numbers.ends.len(), numbers.values.len(), numbers.decimals.len()] {
        if other != count {
            return Err(TextError::Lengths { first: count, other });
        }
    }
    let pieces: Vec<Result<Vec<u8>, TextError>> = (0..count.div_ceil(PIECE).max(1))
        .into_par_iter()
        .map_init(|| Room::with_capacity(ROOM), |room, piece| spliced(text, numbers, words, piece, room))
        .collect();
    pieces.into_iter().collect()
}

/// Piece number `piece`: from behind the numbers of the one before to behind its own, or to the end.
fn spliced(
    text: &[u8],
    numbers: Numbers<'_>,
    words: &[Words<'_>],
    piece: usize,
    out: &mut Room,
) -> Result<Vec<u8>, TextError> {
    let (first, last) = (piece * PIECE, numbers.starts.len().min((piece + 1) * PIECE));
    let from = if first == 0 { 0 } else { behind(numbers.ends[first - 1], text) };
    let is_last = last == numbers.starts.len();
    let to = if is_last { text.len() } else { behind(numbers.ends[last - 1], text) };
    let skipped = words.iter().take_while(|word| first > 0 && word.start < from).count();
    let waiting = words[skipped..].iter().take_while(|word| is_last || word.start < to);
    let (mut copied, mut row) = (from, first);
    for word in waiting {
        let before =
            numbers.starts[row..last].iter().take_while(|&&start| (start as usize) < word.start).count();
        copied = write_numbers(out, text, copied, numbers.rows(row, row + before))?;
        row += before;
        copied = put(out, text, copied, word)?;
    }
    copied = write_numbers(out, text, copied, numbers.rows(row, last))?;
    if copied > to {
        return Err(TextError::Span { start: to, end: to, after: copied, length: text.len() });
    }
    out.copy(text, copied, to);
    Ok(out.take())
}

/// Numbers with the text before each, from `copied` on; where copying goes on.
fn write_numbers(
    out: &mut Room,
    text: &[u8],
    mut copied: usize,
    numbers: Numbers<'_>,
) -> Result<usize, TextError> {
    let Numbers { starts, ends, values, decimals } = numbers;
    for (((&start, &end), &value), &decimals) in starts.iter().zip(ends).zip(values).zip(decimals) {
        let span = span(start, end, copied, text.len())?;
        if !value.is_finite() {
            return Err(TextError::NotFinite { start: span.0, value });
        }
        let decimals = u32::try_from(decimals).unwrap_or(0);
        out.copy_with_number(text, (copied, span.0), (value, decimals, text[span.0] == b'+'));
        copied = span.1;
    }
    Ok(copied)
}

impl Numbers<'_> {
    /// Those from `first` to before `last`.
    fn rows(&self, first: usize, last: usize) -> Self {
        Self {
            starts: &self.starts[first..last],
            ends: &self.ends[first..last],
            values: &self.values[first..last],
            decimals: &self.decimals[first..last],
        }
    }
}

/// An offset within the text; one that is not is an error where its number is written.
fn behind(end: i32, text: &[u8]) -> usize {
    usize::try_from(end).unwrap_or(0).min(text.len())
}

/// The text from `copied` to a word and the word; where copying goes on.
fn put(out: &mut Room, text: &[u8], copied: usize, word: &Words<'_>) -> Result<usize, TextError> {
    if word.start < copied || word.end < word.start || word.end > text.len() {
        return Err(TextError::Span { start: word.start, end: word.end, after: copied, length: text.len() });
    }
    out.copy(text, copied, word.start);
    out.copy(word.bytes, 0, word.bytes.len());
    Ok(word.end)
}

fn span(start: i32, end: i32, after: usize, length: usize) -> Result<(usize, usize), TextError> {
    let both = usize::try_from(start).ok().zip(usize::try_from(end).ok());
    both.filter(|&(start, end)| after <= start && start < end && end <= length).ok_or(TextError::Span {
        start: usize::try_from(start).unwrap_or(0),
        end: usize::try_from(end).unwrap_or(0),
        after,
        length,
    })
}
