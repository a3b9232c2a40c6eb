//! Matrix products whose bits do not depend on the number of threads.
//!
//! faer splits a product with a single column by the threads at hand, and sums in another order with each; such
//! products are therefore done by one thread. Wider ones do not depend on the threads.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use truearm_estimate::dense::{column, parallelism, to_vec};

/// `left right`.
pub fn product(left: MatRef<f64>, right: MatRef<f64>) -> Mat<f64> {
    let par = if right.ncols() == 1 { Par::Seq } else { parallelism() };
    let mut out = Mat::zeros(left.nrows(), right.ncols());
    matmul(out.as_mut(), Accum::Replace, left, right, 1.0, par);
    out
}

/// `left vector`, (rows of `left`,).
pub fn times(left: MatRef<f64>, vector: &[f64]) -> Vec<f64> {
    to_vec(product(left, column(vector).as_ref()).as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_change_no_bit() {
        let entry = |i: usize, j: usize| ((3 * i + 7 * j) as f64).sin();
        let matrix = Mat::from_fn(2000, 300, entry);
        let vector: Vec<f64> = (0..300).map(|i| entry(i, 1)).collect();
        let by = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let narrow = times(matrix.as_ref(), &vector);
                let tall = times(matrix.transpose(), &narrow);
                let wide = product(matrix.transpose(), matrix.as_ref());
                (narrow, tall, wide)
            })
        };
        let alone = by(1);
        assert!([2, 4].into_iter().all(|threads| by(threads) == alone));
        let expected: f64 = (0..300).map(|j| matrix[(5, j)] * vector[j]).sum();
        assert!((alone.0[5] - expected).abs() < 1e-10);
    }
}
