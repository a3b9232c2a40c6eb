//! The lines of a part of a text, read by one thread.

use std::collections::HashMap;

use memchr::memchr;

use crate::number::{Class, class, expected_end, number_at};
use crate::scan::Lines;
use crate::shape::Shape;

/// Stands for a number in a skeleton. No text has it: readers refuse texts with this byte.
const PLACEHOLDER: u8 = 0;
/// Bytes after which it is known how many lines and numbers are to be expected.
const SAMPLE: usize = 1 << 18;

/// Lines that are equal but for their numbers.
struct Kind {
    skeleton: Vec<u8>,
    /// Which kind came behind it last.
    behind: usize,
    /// Where the last line that was read had its numbers, and how long it was.
    spans: Vec<(i32, i32)>,
    length: usize,
    /// What the last two lines were that were read, where they differed in digits only.
    shape: Option<Shape>,
}

/// The lines of a part of the text, and the different lines among them, numbers apart.
#[derive(Default)]
pub(crate) struct Piece {
    pub(crate) lines: Lines,
    kinds: Vec<Kind>,
    known: HashMap<Vec<u8>, i32>,
    scratch: Vec<u8>,
    /// Numbers of the line that is read: where they begin and end in it.
    spans: Vec<(i32, i32)>,
}

impl Piece {
    /// The lines from `start` to `end`, in place of what was here.
    pub(crate) fn fill(&mut self, text: &[u8], start: usize, end: usize) {
        self.lines.clear();
        self.kinds.clear();
        self.known.clear();
        let (mut at, mut last, mut reserved) = (start, None, false);
        while at < end {
            let rest = &text[at..end];
            self.lines.starts.push(at as i32);
            self.lines.first_number.push(self.lines.numbers.len() as i32);
            let guess = last.map(|last: usize| self.kinds[last].behind);
            let (kind, length) =
                guess.and_then(|kind| self.expected(rest, kind)).unwrap_or_else(|| self.scanned(rest));
            self.lines.skeleton.push(kind as i32);
            let numbers = self.kinds[kind].spans.iter().map(|span| span.0 + at as i32);
            self.lines.numbers.extend(numbers);
            if let Some(last) = last {
                self.kinds[last].behind = kind;
            }
            last = Some(kind);
            at += length;
            if !reserved && at - start >= SAMPLE {
                self.lines.reserve_for(end - start, at - start);
                reserved = true;
            }
        }
    }

    /// The skeletons of the different lines.
    pub(crate) fn skeletons(&self) -> impl Iterator<Item = &[u8]> {
        self.kinds.iter().map(|kind| kind.skeleton.as_slice())
    }

    /// The kind and the length of the line that `text` begins with, if it is of the kind that is guessed.
    fn expected(&mut self, text: &[u8], kind: usize) -> Option<(usize, usize)> {
        let guess = &mut self.kinds[kind];
        if let Some(length) = guess.shape.as_ref().and_then(|shape| shape.fits(text)) {
            return Some((kind, length));
        }
        let length = alike(text, &guess.skeleton, &mut self.spans)?;
        guess.note(&text[..length], &mut self.spans);
        Some((kind, length))
    }

    /// The kind and the length of the line that `text` begins with.
    fn scanned(&mut self, text: &[u8]) -> (usize, usize) {
        let length = memchr(b'\n', text).map_or(text.len(), |place| place + 1);
        scan_line(&text[..length], &mut self.scratch, &mut self.spans);
        let known = self.known.get(&self.scratch).map(|&kind| kind as usize);
        let kind = known.unwrap_or_else(|| self.add_kind());
        self.kinds[kind].note(&text[..length], &mut self.spans);
        (kind, length)
    }

    /// A kind with the skeleton in `scratch`, and the line that is read for its first.
    fn add_kind(&mut self) -> usize {
        let fresh = self.kinds.len();
        self.known.insert(self.scratch.clone(), fresh as i32);
        self.lines.representative.push(self.lines.skeleton.len() as i32);
        let skeleton = self.scratch.clone();
        self.kinds.push(Kind { skeleton, behind: fresh, spans: Vec::new(), length: 0, shape: None });
        fresh
    }
}

impl Kind {
    /// Take note of a line that was read; `spans` are swapped for those of the line before.
    fn note(&mut self, line: &[u8], spans: &mut Vec<(i32, i32)>) {
        let again = self.length == line.len() && self.spans == *spans;
        self.shape = if again { Shape::of(line, spans) } else { None };
        self.length = line.len();
        std::mem::swap(&mut self.spans, spans);
    }
}

/// The length of the line that `text` begins with, and its numbers into `spans`; None where reading it might find
/// another skeleton than this one.
fn alike(text: &[u8], skeleton: &[u8], spans: &mut Vec<(i32, i32)>) -> Option<usize> {
    spans.clear();
    let mut at = 0;
    for &byte in skeleton {
        if byte == PLACEHOLDER {
            let end = expected_end(text, at)?;
            spans.push((at as i32, end as i32));
            at = end;
        } else if text.get(at) == Some(&byte) {
            at += 1;
        } else {
            return None;
        }
    }
    skeleton.ends_with(b"\n").then_some(at)
}

/// The skeleton of one line into `scratch`, its numbers into `spans`.
fn scan_line(line: &[u8], scratch: &mut Vec<u8>, spans: &mut Vec<(i32, i32)>) {
    scratch.clear();
    spans.clear();
    let (mut at, mut copied) = (0, 0);
    while let Some(&byte) = line.get(at) {
        match class(byte) {
            Class::Other => at += 1,
            Class::Name => at = end_of_name(line, at),
            Class::Digit | Class::Point => {
                let Some((start, end)) = number_at(line, at) else {
                    at = end_of_name(line, at);
                    continue;
                };
                scratch.extend_from_slice(&line[copied..start]);
                scratch.push(PLACEHOLDER);
                (at, copied) = (end, end);
                spans.push((start as i32, end as i32));
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
