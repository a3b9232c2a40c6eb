//! All numbers of a text, and which of its lines are equal but for them.

use std::collections::HashMap;

use crate::number::{Number, in_name, number_at};

/// Stands for a number in a skeleton. No text has it: readers refuse texts with this byte.
const PLACEHOLDER: u8 = 0;

/// The lines of a text and their numbers.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// First byte of each line, and the length of the text.
    pub starts: Vec<usize>,
    /// For each line, which of the different lines it is, numbers apart.
    pub skeleton: Vec<u32>,
    /// For each different line, the first line that is so.
    pub representative: Vec<usize>,
    /// For each line, its first number; and how many numbers there are.
    pub first_number: Vec<usize>,
    /// The numbers, at places in the whole text.
    pub numbers: Vec<Number>,
}

/// Find the lines and the numbers of a text.
///
/// Digits within names are no numbers. A sign belongs to its number unless something that it could be
/// subtracted from stands before it.
pub fn scan_lines(text: &[u8]) -> Lines {
    let mut lines = Lines::default();
    let mut known: HashMap<Vec<u8>, u32> = HashMap::new();
    let (mut scratch, mut last, mut last_id) = (Vec::new(), Vec::new(), None);
    let mut start = 0;
    for line in text.split_inclusive(|&byte| byte == b'\n') {
        lines.starts.push(start);
        lines.first_number.push(lines.numbers.len());
        scan_line(line, start, &mut scratch, &mut lines.numbers);
        let id = match last_id {
            Some(id) if scratch == last => id,
            _ => {
                let fresh = lines.representative.len() as u32;
                let id = *known.entry(scratch.clone()).or_insert(fresh);
                if id == fresh {
                    lines.representative.push(lines.skeleton.len());
                }
                std::mem::swap(&mut scratch, &mut last);
                id
            }
        };
        last_id = Some(id);
        lines.skeleton.push(id);
        start += line.len();
    }
    lines.starts.push(start);
    lines.first_number.push(lines.numbers.len());
    lines
}

/// The skeleton of one line into `scratch`, its numbers, at `offset` more, behind `numbers`.
fn scan_line(line: &[u8], offset: usize, scratch: &mut Vec<u8>, numbers: &mut Vec<Number>) {
    scratch.clear();
    let (mut at, mut copied) = (0, 0);
    while at < line.len() {
        let byte = line[at];
        if in_name(byte) && !byte.is_ascii_digit() {
            at = end_of_name(line, at);
            continue;
        }
        if !byte.is_ascii_digit() && byte != b'.' {
            at += 1;
            continue;
        }
        let Some(number) = number_at(line, at) else {
            at = end_of_name(line, at);
            continue;
        };
        scratch.extend_from_slice(&line[copied..number.start]);
        scratch.push(PLACEHOLDER);
        at = number.end;
        copied = at;
        numbers.push(Number { start: number.start + offset, end: number.end + offset, ..number });
    }
    scratch.extend_from_slice(&line[copied..]);
}

/// Behind the name, or the digits that are none of ours, at `at`.
fn end_of_name(line: &[u8], at: usize) -> usize {
    let rest = &line[at + 1..];
    at + 1 + rest.iter().position(|&byte| !in_name(byte) && byte != b'.').unwrap_or(rest.len())
}
