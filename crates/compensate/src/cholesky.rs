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

/// Runs the body for J from 0 up to M, written out, so that everything in it stays in registers.
macro_rules! each_below {
    ($m:ident, $j:ident, $body:block) => {
        each_below!(@ $m, $j, $body, 0 1 2 3 4 5)
    };
    (@ $m:ident, $j:ident, $body:block, $($number:literal)*) => {
        $({
            const $j: usize = $number;
            if $j < $m $body
        })*
    };
}

/// The same downwards.
macro_rules! each_below_reversed {
    ($m:ident, $j:ident, $body:block) => {
        each_below!(@ $m, $j, $body, 5 4 3 2 1 0)
    };
}

/// L D L^T of a matrix: L below the diagonal, D inverted.
pub(crate) struct Factor<const M: usize> {
    lower: [[Lane; M]; M],
    inverse: [Lane; M],
}

impl<const M: usize> Factor<M> {
    /// Of A + damping; `a` holds the lower triangle.
    #[inline(always)]
    pub fn new<I: Isa>(a: &[[Lane; M]; M], damping: Lane) -> Self {
        let mut factor = Self { lower: *a, inverse: [Lane::ZERO; M] };
        let lower = &mut factor.lower;
        each_below!(M, J, {
            let inverse = Lane::splat(1.0) / (lower[J][J] + damping);
            factor.inverse[J] = inverse;
            for i in J + 1..M {
                let scaled = -(lower[i][J] * inverse);
                for k in J + 1..=i {
                    // Of rows from i on, column J still holds L D.
                    lower[i][k] = I::mul_add(scaled, lower[k][J], lower[i][k]);
                }
            }
            for i in J + 1..M {
                lower[i][J] = lower[i][J] * inverse;
            }
        });
        factor
    }

    /// The solution of (A + damping) x = b.
    #[inline(always)]
    pub fn solve<I: Isa>(&self, b: &[Lane; M]) -> [Lane; M] {
        let mut x = *b;
        each_below!(M, J, {
            for i in J + 1..M {
                x[i] = I::mul_add(-self.lower[i][J], x[J], x[i]);
            }
        });
        each_below_reversed!(M, J, {
            let mut sum = x[J] * self.inverse[J];
            for i in J + 1..M {
                sum = I::mul_add(-self.lower[i][J], x[i], sum);
            }
            x[J] = sum;
        });
        x
    }
}
