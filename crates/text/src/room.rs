//! Bytes that are written one behind the other, short ones as whole machine words.

use crate::format::{ROOM, write_fixed, write_short};

/// Bytes that are always free, for words whose ends are written over by what comes next.
const SLACK: usize = WORD + ROOM;
/// Spans up to this length are copied as one word.
const WORD: usize = 16;

/// Memory for one text after the other.
pub(crate) struct Room {
    bytes: Vec<u8>,
    end: usize,
}

impl Room {
    /// Room for about so many bytes.
    pub(crate) fn with_capacity(bytes: usize) -> Self {
        Self { bytes: vec![0; bytes + SLACK], end: 0 }
    }

    /// Copy the bytes of `text` from `start` to `end`.
    pub(crate) fn copy(&mut self, text: &[u8], start: usize, end: usize) {
        self.make_room(end - start);
        let behind = self.end + (end - start);
        self.bytes[self.end..behind].copy_from_slice(&text[start..end]);
        self.end = behind;
    }

    /// Copy the bytes of `text` from `start` to `end` and write a number as [`write_fixed`] does.
    #[inline(always)]
    pub(crate) fn copy_with_number(
        &mut self,
        text: &[u8],
        (start, end): (usize, usize),
        (value, decimals, plus): (f64, u32, bool),
    ) {
        let mut length = end - start;
        if length > WORD {
            self.copy(text, start, end);
            length = 0;
        }
        let free = self.bytes.get_mut(self.end..).and_then(<[u8]>::first_chunk_mut::<SLACK>);
        let word = text.get(start..).and_then(<[u8]>::first_chunk::<WORD>);
        if let Some((free, word)) = free.zip(word) {
            if length > 0 {
                free[..WORD].copy_from_slice(word);
            }
            let behind =
                free[length..].first_chunk_mut().and_then(|free| write_short(free, value, decimals, plus));
            if let Some(written) = behind {
                self.end += length + written;
                return;
            }
        }
        self.copy(text, end - length, end);
        self.any_number(value, decimals, plus);
    }

    /// Write a number as [`write_fixed`] does.
    #[inline(never)]
    fn any_number(&mut self, value: f64, decimals: u32, plus: bool) {
        let mut text = Vec::new();
        write_fixed(&mut text, value, decimals, plus);
        self.copy(&text, 0, text.len());
    }

    /// What was written; the next text begins anew.
    pub(crate) fn take(&mut self) -> Vec<u8> {
        let written = self.bytes[..self.end].to_vec();
        self.end = 0;
        written
    }

    #[inline]
    fn make_room(&mut self, length: usize) {
        let least = self.end + length + SLACK;
        if self.bytes.len() < least {
            self.bytes.resize(least + least / 2, 0);
        }
    }
}
