//! All numbers of a text, and which of its lines are equal but for them.

use std::collections::HashMap;

use memchr::memchr;
use rayon::prelude::*;

use crate::error::TextError;
use crate::piece::Piece;

/// Bytes of the longest text whose offsets the columns hold.
const LONGEST: usize = i32::MAX as usize;
/// Bytes that are scanned at a time; the result does not depend on it.
const PIECE: usize = 1 << 18;

/// The lines of a text and their numbers.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// First byte of each line, and the length of the text.
    pub starts: Vec<i32>,
    /// For each line, which of the different lines it is, numbers apart.
    pub skeleton: Vec<i32>,
    /// For each different line, the first line that is so.
    pub representative: Vec<i32>,
    /// For each line, its first number; and how many numbers there are.
    pub first_number: Vec<i32>,
    /// First byte of each number, its sign included.
    pub numbers: Vec<i32>,
}

/// Find the lines and the numbers of a text.
///
/// Digits within names are no numbers. A sign belongs to its number unless something that it could be
/// subtracted from stands before it.
///
/// # Errors
/// If the text has 2 GiB or more.
pub fn scan_lines(text: &[u8]) -> Result<Lines, TextError> {
    if text.len() > LONGEST {
        return Err(TextError::TooLong { length: text.len(), most: LONGEST });
    }
    let threads = rayon::current_num_threads().max(1);
    let mut lines = if threads == 1 { scan_whole(text) } else { scan_in_pieces(text, threads) };
    lines.starts.push(text.len() as i32);
    lines.first_number.push(lines.numbers.len() as i32);
    Ok(lines)
}

/// The lines of a text, read by one thread.
fn scan_whole(text: &[u8]) -> Lines {
    let mut piece = Piece::default();
    piece.fill(text, 0, text.len());
    piece.lines
}

/// The same, read by several threads.
fn scan_in_pieces(text: &[u8], threads: usize) -> Lines {
    let (mut lines, spans) = (Lines::default(), pieces(text));
    let mut known: HashMap<Vec<u8>, i32> = HashMap::new();
    let mut room: Vec<Piece> = (0..threads).map(|_| Piece::default()).collect();
    for batch in spans.chunks(room.len()) {
        room.par_iter_mut().zip(batch).for_each(|(piece, &(start, end))| piece.fill(text, start, end));
        for piece in &room[..batch.len()] {
            lines.append(piece, &mut known);
        }
        if let Some(&(_, done)) = batch.last() {
            lines.reserve_for(text.len(), done);
        }
    }
    lines
}

impl Lines {
    pub(crate) fn clear(&mut self) {
        for column in [
            &mut self.starts,
            &mut self.skeleton,
            &mut self.representative,
            &mut self.first_number,
            &mut self.numbers,
        ] {
            column.clear();
        }
    }

    /// Add the lines of the next piece of the text.
    fn append(&mut self, piece: &Piece, known: &mut HashMap<Vec<u8>, i32>) {
        let (line, number) = (self.skeleton.len() as i32, self.numbers.len() as i32);
        let mut ids = Vec::with_capacity(piece.lines.representative.len());
        for (skeleton, first) in piece.skeletons().zip(&piece.lines.representative) {
            let fresh = self.representative.len() as i32;
            let id = known.get(skeleton).copied().unwrap_or(fresh);
            if id == fresh {
                known.insert(skeleton.to_vec(), fresh);
                self.representative.push(first + line);
            }
            ids.push(id);
        }
        self.starts.extend_from_slice(&piece.lines.starts);
        self.skeleton.extend(piece.lines.skeleton.iter().map(|&id| ids[id as usize]));
        self.first_number.extend(piece.lines.first_number.iter().map(|first| first + number));
        self.numbers.extend_from_slice(&piece.lines.numbers);
    }

    /// Make room for the whole of a text of which `done` bytes were read, as if it went on alike.
    pub(crate) fn reserve_for(&mut self, length: usize, done: usize) {
        let more = |count: usize| (count as u128 * (length - done) as u128 / done.max(1) as u128) as usize;
        let (lines, numbers) = (more(self.skeleton.len()), more(self.numbers.len()));
        for column in [&mut self.starts, &mut self.skeleton, &mut self.first_number] {
            column.reserve(lines);
        }
        self.numbers.reserve(numbers);
    }
}

/// Spans of the text, each of whole lines.
fn pieces(text: &[u8]) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut start = 0;
    while start < text.len() {
        let near = (start + PIECE).min(text.len());
        let end = memchr(b'\n', &text[near..]).map_or(text.len(), |place| near + place + 1);
        found.push((start, end));
        start = end;
    }
    found
}
