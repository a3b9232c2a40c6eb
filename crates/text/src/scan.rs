//! All numbers of a text, and which of its lines are equal but for them.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::error::TextError;
use crate::number::{Class, Number, class, expected_number, number_at};

/// Stands for a number in a skeleton. No text has it: readers refuse texts with this byte.
const PLACEHOLDER: u8 = 0;
/// Bytes of the longest text whose offsets the columns hold.
const LONGEST: usize = i32::MAX as usize;
/// Bytes that are scanned at a time; the result does not depend on it.
const PIECE: usize = 1 << 18;

/// Numbers of a text at places in the whole of it, in columns.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// First byte of each.
    pub starts: Vec<i32>,
    /// Behind the last byte of each.
    pub ends: Vec<i32>,
    /// What they say.
    pub values: Vec<f64>,
    /// Digits behind the point, a negative exponent counted, as in [`Number`].
    pub decimals: Vec<i16>,
}

impl Found {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.starts.is_empty()
    }

    /// They, one by one.
    pub fn iter(&self) -> impl Iterator<Item = Number> + '_ {
        (0..self.len()).map(|row| Number {
            start: self.starts[row] as usize,
            end: self.ends[row] as usize,
            value: self.values[row],
            decimals: self.decimals[row],
        })
    }

    fn truncate(&mut self, count: usize) {
        self.starts.truncate(count);
        self.ends.truncate(count);
        self.values.truncate(count);
        self.decimals.truncate(count);
    }

    fn reserve(&mut self, count: usize) {
        self.starts.reserve(count);
        self.ends.reserve(count);
        self.values.reserve(count);
        self.decimals.reserve(count);
    }

    #[inline]
    fn push(&mut self, number: &Number, offset: usize) {
        self.starts.push((number.start + offset) as i32);
        self.ends.push((number.end + offset) as i32);
        self.values.push(number.value);
        self.decimals.push(number.decimals);
    }

    fn append(&mut self, other: &Self) {
        self.starts.extend_from_slice(&other.starts);
        self.ends.extend_from_slice(&other.ends);
        self.values.extend_from_slice(&other.values);
        self.decimals.extend_from_slice(&other.decimals);
    }
}

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
    /// The numbers.
    pub numbers: Found,
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
        for piece in &mut room[..batch.len()] {
            lines.append(piece, &mut known);
        }
        if let Some(&(_, done)) = batch.last() {
            lines.reserve_for(text.len(), done);
        }
    }
    lines
}

impl Lines {
    fn clear(&mut self) {
        for column in [&mut self.starts, &mut self.skeleton, &mut self.representative, &mut self.first_number]
        {
            column.clear();
        }
        self.numbers.truncate(0);
    }

    /// Add the lines of the next piece of the text.
    fn append(&mut self, piece: &mut Piece, known: &mut HashMap<Vec<u8>, i32>) {
        let (line, number) = (self.skeleton.len() as i32, self.numbers.len() as i32);
        let mut ids = Vec::with_capacity(piece.skeletons.len());
        for (skeleton, first) in piece.skeletons.drain(..).zip(&piece.lines.representative) {
            let fresh = self.representative.len() as i32;
            let id = *known.entry(skeleton).or_insert(fresh);
            if id == fresh {
                self.representative.push(first + line);
            }
            ids.push(id);
        }
        self.starts.extend_from_slice(&piece.lines.starts);
        self.skeleton.extend(piece.lines.skeleton.iter().map(|&id| ids[id as usize]));
        self.first_number.extend(piece.lines.first_number.iter().map(|first| first + number));
        self.numbers.append(&piece.lines.numbers);
    }

    /// Make room for the whole of a text of which `done` bytes were read, as if it went on alike.
    fn reserve_for(&mut self, length: usize, done: usize) {
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
        let rest = text[near..].iter().position(|&byte| byte == b'\n');
        let end = rest.map_or(text.len(), |place| near + place + 1);
        found.push((start, end));
        start = end;
    }
    found
}

/// The lines of a part of the text, and the different lines among them, numbers apart.
#[derive(Default)]
struct Piece {
    lines: Lines,
    skeletons: Vec<Vec<u8>>,
    known: HashMap<Vec<u8>, i32>,
    /// For each different line, which one came behind it last.
    behind: Vec<usize>,
    scratch: Vec<u8>,
}

impl Piece {
    /// The lines from `start` to `end`, in place of what was here.
    fn fill(&mut self, text: &[u8], start: usize, end: usize) {
        self.lines.clear();
        self.skeletons.clear();
        self.known.clear();
        self.behind.clear();
        let (mut at, mut last, mut reserved) = (start, None, false);
        while at < end {
            self.lines.starts.push(at as i32);
            self.lines.first_number.push(self.lines.numbers.len() as i32);
            let guess = last.map(|last: usize| self.behind[last]);
            let (kind, length) = self.expected(&text[at..end], at, guess).unwrap_or_else(|| {
                let rest = &text[at..end];
                let length =
                    rest.iter().position(|&byte| byte == b'\n').map_or(rest.len(), |place| place + 1);
                (self.scanned(&rest[..length], at), length)
            });
            self.lines.skeleton.push(kind as i32);
            if let Some(last) = last {
                self.behind[last] = kind;
            }
            last = Some(kind);
            at += length;
            if !reserved && at - start >= PIECE {
                self.lines.reserve_for(end - start, at - start);
                reserved = true;
            }
        }
    }

    /// The kind and the length of the line that `text` begins with, if it is of the kind that is guessed.
    fn expected(&mut self, text: &[u8], offset: usize, guess: Option<usize>) -> Option<(usize, usize)> {
        let kind = guess?;
        let numbers = &mut self.lines.numbers;
        let count = numbers.len();
        let length = alike(text, &self.skeletons[kind], offset, numbers);
        if length.is_none() {
            numbers.truncate(count);
        }
        Some((kind, length?))
    }

    /// The kind of a line.
    fn scanned(&mut self, line: &[u8], offset: usize) -> usize {
        scan_line(line, offset, &mut self.scratch, &mut self.lines.numbers);
        if let Some(&known) = self.known.get(&self.scratch) {
            return known as usize;
        }
        let fresh = self.skeletons.len();
        self.known.insert(self.scratch.clone(), fresh as i32);
        self.lines.representative.push(self.lines.skeleton.len() as i32);
        self.skeletons.push(self.scratch.clone());
        self.behind.push(fresh);
        fresh
    }
}

/// The length of the line that `text` begins with, and its numbers, at `offset` more, behind `numbers`; None
/// where reading it might find another skeleton than this one.
fn alike(text: &[u8], skeleton: &[u8], offset: usize, numbers: &mut Found) -> Option<usize> {
    let mut at = 0;
    for &byte in skeleton {
        if byte == PLACEHOLDER {
            let number = expected_number(text, at)?;
            numbers.push(&number, offset);
            at = number.end;
        } else if text.get(at) == Some(&byte) {
            at += 1;
        } else {
            return None;
        }
    }
    skeleton.ends_with(b"\n").then_some(at)
}

/// The skeleton of one line into `scratch`, its numbers, at `offset` more, behind `numbers`.
fn scan_line(line: &[u8], offset: usize, scratch: &mut Vec<u8>, numbers: &mut Found) {
    scratch.clear();
    let (mut at, mut copied) = (0, 0);
    while let Some(&byte) = line.get(at) {
        match class(byte) {
            Class::Other => at += 1,
            Class::Name => at = end_of_name(line, at),
            Class::Digit | Class::Point => {
                let Some(number) = number_at(line, at) else {
                    at = end_of_name(line, at);
                    continue;
                };
                scratch.extend_from_slice(&line[copied..number.start]);
                scratch.push(PLACEHOLDER);
                at = number.end;
                copied = at;
                numbers.push(&number, offset);
            }
        }
    }
    scratch.extend_from_slice(&line[copied..]);
}

/// Behind the name, or the digits that are none of ours, at `at`.
fn end_of_name(line: &[u8], at: usize) -> usize {
    let rest = &line[at + 1..];
    at + 1 + rest.iter().position(|&byte| class(byte) == Class::Other).unwrap_or(rest.len())
}
