//! Lines of which only the digits of their numbers may be others: told by whole machine words.

/// Bytes of a machine word.
const WORD: usize = 8;
/// Longest number whose value needs no looking at to tell that it is one: none of so few digits is infinite.
const LONGEST: usize = 24;
const HIGH_BITS: u64 = 0x8080_8080_8080_8080;
/// What added to a byte sets its high bit unless it is zero.
const NOTHING_ELSE: u8 = 0x7f;
/// What added to a byte sets its high bit unless it is at most nine.
const ANY_DIGIT: u8 = 0x76;

/// A line by its bytes, where the digits of numbers stand for any digits.
#[derive(Debug)]
pub(crate) struct Shape {
    length: usize,
    /// The line in words, the last one at its end; digits of numbers are zeros.
    bytes: Vec<u64>,
    /// What added to the difference from these sets a high bit in words that are not alike.
    beyond: Vec<u64>,
}

impl Shape {
    /// The shape of a line with numbers at `spans`; None if others of it need not have their numbers there.
    pub(crate) fn of(line: &[u8], spans: &[(i32, i32)]) -> Option<Self> {
        let (mut bytes, mut beyond) = (line.to_vec(), vec![NOTHING_ELSE; line.len()]);
        for &(start, end) in spans {
            let number = start as usize..end as usize;
            if number.len() > LONGEST {
                return None;
            }
            for place in number {
                if line[place].is_ascii_digit() {
                    (bytes[place], beyond[place]) = (b'0', ANY_DIGIT);
                } else if line[place].is_ascii_alphabetic() {
                    // An exponent.
                    return None;
                }
            }
        }
        let last = line.len().checked_sub(WORD)?;
        let places = || (0..last).step_by(WORD).chain([last]);
        let words = |bytes: &[u8]| places().filter_map(|place| word(&bytes[place..])).collect();
        Some(Self { length: line.len(), bytes: words(&bytes), beyond: words(&beyond) })
    }

    /// The length of the line that `text` begins with, if it is of this shape.
    #[inline]
    pub(crate) fn fits(&self, text: &[u8]) -> Option<usize> {
        let line = text.get(..self.length)?;
        let (words, _) = line.as_chunks();
        let mut other = 0;
        for ((word, bytes), beyond) in words.iter().zip(&self.bytes).zip(&self.beyond) {
            other |= differs(u64::from_le_bytes(*word), *bytes, *beyond);
        }
        let (last, bytes, beyond) = (line.last_chunk()?, self.bytes.last()?, self.beyond.last()?);
        other |= differs(u64::from_le_bytes(*last), *bytes, *beyond);
        (other & HIGH_BITS == 0).then_some(self.length)
    }
}

/// High bits where bytes differ by more than they may.
#[inline]
fn differs(word: u64, bytes: u64, beyond: u64) -> u64 {
    let difference = word ^ bytes;
    // A sum that carries into the next byte has the high bit set before.
    difference | difference.wrapping_add(beyond)
}

fn word(bytes: &[u8]) -> Option<u64> {
    bytes.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
}
