//! Symmetric positive definite systems of eight poses, M x M each.

use truearm_kinematics::{Isa, Lane};

/// J J^T of a Jacobian given by the first M rows of its columns; the lower triangle.
#[inline(always)]
pub(crate) fn gram<I: Isa, const M: usize>(columns: &[[Lane; 6]]) -> [[Lane; M]; M] {
    let mut sum = [[Lane::ZERO; M]; M];
    for column in columns {
        for i in 0..M {
            for j in 0..=i {
                sum[i][j] = I::mul_add(column[i], column[j], sum[i][j]);
            }
        }
    }
    sum
}

/// The solution of (A + damping) x = b by L D L^T; `a` holds the lower triangle.
#[inline(always)]
pub(crate) fn solve<I: Isa, const M: usize>(a: &[[Lane; M]; M], damping: Lane, b: &[Lane; M]) -> [Lane; M] {
    let (mut l, mut x) = (*a, *b);
    let mut inverse = [Lane::ZERO; M];
    for j in 0..M {
        let pivot = l[j][j] + damping;
        inverse[j] = Lane::splat(1.0) / pivot;
        for i in j + 1..M {
            let factor = l[i][j] * inverse[j];
            for k in j + 1..=i {
                // Below the pivot column j still holds L D.
                l[i][k] = I::mul_add(-factor, l[k][j], l[i][k]);
            }
            x[i] = I::mul_add(-factor, x[j], x[i]);
        }
    }
    for j in (0..M).rev() {
        let mut sum = x[j];
        for i in j + 1..M {
            sum = I::mul_add(-l[i][j], x[i], sum);
        }
        x[j] = sum * inverse[j];
    }
    x
}
