//! Columns of numbers of one length, in one piece of memory: they are made by the hundred at every point of a search.

/// Columns, all of one length.
#[derive(Debug, Clone)]
pub struct Columns {
    length: usize,
    values: Vec<f64>,
}

impl Columns {
    /// So many columns of so many zeros, which is one at least.
    pub fn zeros(count: usize, length: usize) -> Self {
        let length = length.max(1);
        Self { length, values: vec![0.0; count * length] }
    }

    /// Column `k`.
    #[inline(always)]
    pub fn get(&self, k: usize) -> &[f64] {
        &self.values[k * self.length..(k + 1) * self.length]
    }

    /// Column `k`, to be written to.
    #[inline(always)]
    pub fn get_mut(&mut self, k: usize) -> &mut [f64] {
        &mut self.values[k * self.length..(k + 1) * self.length]
    }

    /// All columns in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.length)
    }

    /// The same, to be written to.
    pub fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = &mut [f64]> {
        self.values.chunks_exact_mut(self.length)
    }

    /// So many columns at a time, to be written to.
    pub fn iter_mut_by<const N: usize>(&mut self) -> impl Iterator<Item = [&mut [f64]; N]> {
        let length = self.length;
        self.values.chunks_exact_mut(N * length).map(move |some| {
            let mut columns = some.chunks_exact_mut(length);
            std::array::from_fn(|_| columns.next().unwrap_or_default())
        })
    }
}
