//! Normal equations accumulated over lanes: no Jacobian is ever stored whole.

use truearm_kinematics::{Isa, Lane};

/// Columns of a chunk of rows: `width` columns (the last is the residual) of `height` lanes each.
pub struct Columns {
    pub width: usize,
    pub height: usize,
    lanes: Vec<Lane>,
}

impl Columns {
    /// Zeroed columns.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, lanes: vec![Lane::ZERO; width * height] }
    }

    /// One entry.
    #[inline(always)]
    pub fn set(&mut self, column: usize, row: usize, value: Lane) {
        self.lanes[column * self.height + row] = value;
    }

    /// One entry.
    #[inline(always)]
    pub fn get(&self, column: usize, row: usize) -> Lane {
        self.lanes[column * self.height + row]
    }

    #[inline(always)]
    fn column(&self, column: usize) -> &[Lane] {
        &self.lanes[column * self.height..(column + 1) * self.height]
    }

    /// Adds the lower triangle of columns^T columns to `gram` (width, width) row-major.
    ///
    /// `rows` is how many of the lanes of each column are filled.
    #[inline(always)]
    pub fn add_gram<I: Isa>(&self, rows: usize, gram: &mut [f64]) {
        if I::MANY_REGISTERS {
            self.add_tiles::<I, 4, 4>(rows, gram);
        } else {
            self.add_tiles::<I, 3, 2>(rows, gram);
        }
    }

    /// The same in tiles of so many columns from either side, whose sums stay in registers.
    #[inline(always)]
    fn add_tiles<I: Isa, const A: usize, const B: usize>(&self, rows: usize, gram: &mut [f64]) {
        for first in (0..self.width).step_by(A) {
            for second in (0..(first + A).min(self.width)).step_by(B) {
                self.add_tile::<I, A, B>(rows, first, second, gram);
            }
        }
    }

    #[inline(always)]
    fn add_tile<I: Isa, const A: usize, const B: usize>(
        &self,
        rows: usize,
        first: usize,
        second: usize,
        gram: &mut [f64],
    ) {
        // Columns past the end repeat the last one; their sums are dropped.
        let last = self.width - 1;
        let (mut left, mut right) = ([&self.lanes[..0]; A], [&self.lanes[..0]; B]);
        for (k, column) in left.iter_mut().enumerate() {
            *column = &self.column((first + k).min(last))[..rows];
        }
        for (k, column) in right.iter_mut().enumerate() {
            *column = &self.column((second + k).min(last))[..rows];
        }
        let mut sums = [[Lane::ZERO; B]; A];
        for row in 0..rows {
            for (line, a) in sums.iter_mut().zip(left) {
                for (sum, b) in line.iter_mut().zip(right) {
                    *sum = I::mul_add(a[row], b[row], *sum);
                }
            }
        }
        for (i, line) in sums.iter().enumerate().take(self.width - first) {
            for (j, sum) in line.iter().enumerate().take(self.width - second) {
                gram[(first + i) * self.width + second + j] += sum.sum();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use truearm_kinematics::{Kernel, LANES, dispatch};

    struct Grams<'a>(&'a Columns, [&'a mut [f64]; 3]);

    impl Kernel for Grams<'_> {
        type Output = ();
        #[inline(always)]
        fn run<I: Isa>(self) {
            let [chosen, large, small] = self.1;
            self.0.add_gram::<I>(5, chosen);
            self.0.add_tiles::<I, 4, 4>(5, large);
            self.0.add_tiles::<I, 3, 2>(5, small);
        }
    }

    #[test]
    fn gram_equals_the_dot_products() {
        let (width, height) = (11, 6);
        let value = |c: usize, r: usize, l: usize| ((c * 31 + r * 7 + l) as f64).sin();
        let mut columns = Columns::new(width, height);
        for c in 0..width {
            for r in 0..height {
                columns.set(c, r, Lane(std::array::from_fn(|l| value(c, r, l))));
            }
        }
        let mut grams = [(); 3].map(|()| vec![0.0; width * width]);
        dispatch(Grams(&columns, grams.each_mut().map(Vec::as_mut_slice)));
        for i in 0..width {
            for j in 0..=i {
                let expected: f64 =
                    (0..5).flat_map(|r| (0..LANES).map(move |l| value(i, r, l) * value(j, r, l))).sum();
                for gram in &grams {
                    assert!((gram[i * width + j] - expected).abs() < 1e-12);
                }
            }
        }
    }
}
