//! Matrix products whose bits do not depend on the number of threads.
//!
//! faer splits a product with a single column by the threads at hand, and sums in another order with each; such
//! products are therefore done by one thread. Wider ones do not depend on the threads.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatMut, MatRef, Par};

use super::{column, parallelism, to_vec};

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

/// `left^T right`, by one thread: tall matrices of few columns gain nothing by more, and sum in another order with each.
pub fn transposed_product(left: MatRef<f64>, right: MatRef<f64>) -> Mat<f64> {
    let mut out = Mat::zeros(left.ncols(), right.ncols());
    matmul(out.as_mut(), Accum::Replace, left.transpose(), right, 1.0, Par::Seq);
    out
}

/// Adds `factor left right` to `out`, by one thread.
pub fn add_product(out: MatMut<f64>, left: MatRef<f64>, right: MatRef<f64>, factor: f64) {
    matmul(out, Accum::Add, left, right, factor, Par::Seq);
}

/// Adds `factor left right` to the lower triangle of a square.
pub fn add_to_lower(out: MatMut<f64>, left: MatRef<f64>, right: MatRef<f64>, factor: f64, par: Par) {
    let (triangle, whole) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(out, triangle, Accum::Add, left, whole, right, whole, factor, par);
}

/// The product of a symmetric matrix, of which the lower triangle is given, with `right`, by one thread.
pub fn symmetric_product(lower: MatRef<f64>, right: MatRef<f64>) -> Mat<f64> {
    let mut out = Mat::zeros(right.nrows(), right.ncols());
    for (half, structure) in
        [(lower, BlockStructure::TriangularLower), (lower.transpose(), BlockStructure::StrictTriangularUpper)]
    {
        let (out, whole) = (out.as_mut(), BlockStructure::Rectangular);
        triangular::matmul(out, whole, Accum::Add, half, structure, right, whole, 1.0, Par::Seq);
    }
    out
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
