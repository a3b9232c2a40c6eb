//! Bytes that are written one behind the other, short ones as whole machine words.

use crate::format::{ROOM, write_fixed, write_short};

/// Bytes that are always free, for words whose ends are written over by what comes next.
const SLACK: usize = 32;
/// Spans up to this length are copied as one word.
const WORD: usize = 16;

/// A growing text.
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
    #[inline]
    pub(crate) fn copy(&mut self, text: &[u8], start: usize, end: usize) {
        let length = end - start;
        self.make_room(length);
        match text.get(start..start + WORD).filter(|_| length <= WORD) {
            Some(word) => self.bytes[self.end..self.end + WORD].copy_from_slice(word),
            None => self.bytes[self.end..self.end + length].copy_from_slice(&text[start..end]),
        }
        self.end += length;
    }

    /// Write a number as [`write_fixed`] does.
    #[inline]
    pub(crate) fn number(&mut self, value: f64, decimals: u32, plus: bool) {
        self.make_room(0);
        let free = self.bytes[self.end..].first_chunk_mut::<ROOM>();
        if let Some(length) = free.and_then(|free| write_short(free, value, decimals, plus)) {
            self.end += length;
            return;
        }
        let mut text = Vec::new();
        write_fixed(&mut text, value, decimals, plus);
        self.copy(&text, 0, text.len());
    }

    /// What was written.
    pub(crate) fn into_bytes(mut self) -> Vec<u8> {
        self.bytes.truncate(self.end);
        self.bytes
    }

    #[inline]
    fn make_room(&mut self, length: usize) {
        let least = self.end + length + SLACK;
        if self.bytes.len() < least {
            self.bytes.resize(least + least / 2, 0);
        }
    }
}
