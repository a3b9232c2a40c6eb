//! Results written in whole cache lines.
//!
//! A large result is not read again before the caches are full of newer rows, and a plain store first fetches the
//! line that it overwrites. Rows are therefore put together in a small buffer and streamed line by line.

use crate::isa::Isa;
use crate::lane::{LANES, Lane};

/// Takes the rows of a result in order; what is given to [`LineWriter::room`] ends up in `out`.
pub(crate) struct LineWriter<'a> {
    out: &'a mut [f64],
    buffer: Vec<Lane>,
    /// Numbers in the buffer.
    held: usize,
    /// Numbers at the start of the buffer that stand before `out`, so that its lines are the buffer's.
    skew: usize,
}

impl<'a> LineWriter<'a> {
    /// A writer into `out` by at most `most` numbers at a time.
    pub fn new(out: &'a mut [f64], most: usize) -> Self {
        let skew = out.as_ptr().addr() / size_of::<f64>() % LANES;
        Self { out, buffer: vec![Lane::ZERO; most / LANES + 3], held: skew, skew }
    }

    /// Room for the next `count` numbers.
    #[inline(always)]
    pub fn room(&mut self, count: usize) -> &mut [f64] {
        &mut Lane::numbers(&mut self.buffer)[self.held..][..count]
    }

    /// Write out the lines that `count` more numbers in the buffer complete.
    #[inline(always)]
    pub fn commit<I: Isa>(&mut self, count: usize) {
        self.held += count;
        let mut line = 0;
        if self.skew > 0 && self.held >= LANES {
            self.advance(self.skew, LANES);
            self.skew = 0;
            line = 1;
        }
        let out = std::mem::take(&mut self.out);
        let whole = self.held / LANES - line;
        let (lines, rest) = out.split_at_mut(whole * LANES);
        for (to, from) in lines.as_chunks_mut().0.iter_mut().zip(&self.buffer[line..]) {
            I::stream(from, to);
        }
        self.out = rest;
        self.buffer[0] = self.buffer[line + whole];
        self.held -= (line + whole) * LANES;
    }

    /// Write what is left.
    pub fn finish<I: Isa>(mut self) {
        self.advance(self.skew, self.held);
        I::fence();
    }

    /// Write the numbers from `first` to `last` of the buffer plainly.
    fn advance(&mut self, first: usize, last: usize) {
        let out = std::mem::take(&mut self.out);
        let (now, rest) = out.split_at_mut(last - first);
        now.copy_from_slice(&Lane::numbers(&mut self.buffer)[first..last]);
        self.out = rest;
    }
}
