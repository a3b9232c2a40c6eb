//! The candidates' Jacobians in lanes of eight, and what an added or removed pose changes for all of them.

use faer::{Mat, Par};
use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch};

use crate::dense::Cholesky;

/// Jacobians of N candidates with M rows each, scaled, and A_j = J_j V J_j^T for the present inverse V.
pub struct Pool<const M: usize> {
    /// Candidates, N.
    pub count: usize,
    /// Columns, P.
    pub width: usize,
    /// (groups of eight, P, M).
    lanes: Vec<[Lane; M]>,
    /// A_j, (groups of eight), the lower triangle's use alone.
    inner: Vec<[[Lane; M]; M]>,
    /// det(I + A_j), (N,): what adding the candidate multiplies the determinant with.
    pub gains: Vec<f64>,
}

/// What changes all candidates: a matrix W (P, M) with A_j += sign (J_j W)(J_j W)^T.
struct Update<'a, const M: usize> {
    pool: &'a mut Pool<M>,
    /// (P, M).
    w: &'a [[f64; M]],
    sign: f64,
}

impl<const M: usize> Pool<M> {
    /// Candidates (N, M, P) of row-major scaled Jacobians of `rows` rows, `rows` at most M.
    pub fn new(jacobian: &[f64], rows: usize, width: usize) -> Self {
        let count = jacobian.len() / (rows * width).max(1);
        let groups = count.div_ceil(LANES);
        let mut lanes = vec![[Lane::ZERO; M]; groups * width];
        for (at, value) in jacobian.iter().enumerate() {
            let (pose, row, column) = (at / (rows * width), at / width % rows, at % width);
            lanes[pose / LANES * width + column][row].0[pose % LANES] = *value;
        }
        Self {
            count,
            width,
            lanes,
            inner: vec![[[Lane::ZERO; M]; M]; groups],
            gains: vec![0.0; groups * LANES],
        }
    }

    /// Jacobian of one candidate, (M, P).
    pub fn jacobian(&self, candidate: usize) -> Mat<f64> {
        let (group, lane) = (candidate / LANES, candidate % LANES);
        Mat::from_fn(M, self.width, |i, j| self.lanes[group * self.width + j][i].0[lane])
    }

    /// I + sign A of one candidate.
    fn block(&self, candidate: usize, sign: f64) -> Mat<f64> {
        let (group, lane) = (candidate / LANES, candidate % LANES);
        let entry = |i: usize, j: usize| sign * self.inner[group][i.max(j)][i.min(j)].0[lane];
        Mat::from_fn(M, M, |i, j| entry(i, j) + f64::from(u8::from(i == j)))
    }

    /// det(I - A) of one candidate: what removing it multiplies the determinant with.
    pub fn loss(&self, candidate: usize) -> f64 {
        let factor = Cholesky::new(self.block(candidate, -1.0), Par::Seq);
        factor.map_or(0.0, |factor| factor.log_determinant().exp())
    }

    /// A_j of all candidates for a new inverse V (P, P).
    pub fn renew(&mut self, inverse: &Mat<f64>) {
        let Some(factor) = Cholesky::new(inverse.clone(), Par::Seq) else { return };
        let lower = factor.lower();
        self.inner.fill([[Lane::ZERO; M]; M]);
        for first in (0..self.width).step_by(M) {
            let entry = |i: usize, k: usize| if first + k < self.width { lower[(i, first + k)] } else { 0.0 };
            let w: Vec<[f64; M]> = (0..self.width).map(|i| std::array::from_fn(|k| entry(i, k))).collect();
            dispatch(Update { pool: self, w: &w, sign: 1.0 });
        }
    }

    /// Adds (sign 1) or removes (sign -1) a candidate, in the inverse V and in all A_j, by a change of rank M.
    ///
    /// `None` where removing it would leave a singular matrix.
    pub fn exchange(&mut self, inverse: &mut Mat<f64>, candidate: usize, sign: f64) -> Option<()> {
        let factor = Cholesky::new(self.block(candidate, sign), Par::Seq)?;
        let mut w = self.jacobian(candidate) * &*inverse;
        factor.solve_lower(w.as_mut());
        for i in 0..self.width {
            for j in 0..self.width {
                let change: f64 = (0..M).map(|k| w[(k, i)] * w[(k, j)]).sum();
                inverse[(i, j)] -= sign * change;
            }
        }
        let w: Vec<[f64; M]> = (0..self.width).map(|i| std::array::from_fn(|k| w[(k, i)])).collect();
        dispatch(Update { pool: self, w: &w, sign: -sign });
        Some(())
    }

    /// sum over k of weights[k] |J_j q_k|^2 for every candidate, with directions q (K, P).
    pub fn score(&self, directions: &[(f64, Vec<f64>)]) -> Vec<f64> {
        dispatch(Score { pool: self, directions })
    }
}

impl<const M: usize> Kernel for Update<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { pool, w, sign } = self;
        let sign = Lane::splat(sign);
        let groups = pool.lanes.chunks_exact(pool.width).zip(&mut pool.inner);
        for ((jacobian, inner), gains) in groups.zip(pool.gains.as_chunks_mut::<LANES>().0) {
            let mut b = [[Lane::ZERO; M]; M];
            for (column, w) in jacobian.iter().zip(w) {
                for i in 0..M {
                    for k in 0..M {
                        b[i][k] = I::mul_add(column[i], Lane::splat(w[k]), b[i][k]);
                    }
                }
            }
            for i in 0..M {
                for j in 0..=i {
                    let mut sum = Lane::ZERO;
                    for k in 0..M {
                        sum = I::mul_add(b[i][k], b[j][k], sum);
                    }
                    inner[i][j] = I::mul_add(sign, sum, inner[i][j]);
                }
            }
            *gains = determinant::<I, M>(inner).0;
        }
    }
}

/// det(I + A) by the factors L D L^T.
#[inline(always)]
fn determinant<I: Isa, const M: usize>(inner: &[[Lane; M]; M]) -> Lane {
    let mut a = *inner;
    let mut product = Lane::splat(1.0);
    for k in 0..M {
        let pivot = a[k][k] + Lane::splat(1.0);
        product = product * pivot;
        let mut inverse = [0.0; LANES];
        for i in 0..LANES {
            inverse[i] = 1.0 / pivot.0[i];
        }
        for i in k + 1..M {
            let factor = -(a[i][k] * Lane(inverse));
            for j in k + 1..=i {
                a[i][j] = I::mul_add(factor, a[j][k], a[i][j]);
            }
        }
    }
    product
}

struct Score<'a, const M: usize> {
    pool: &'a Pool<M>,
    directions: &'a [(f64, Vec<f64>)],
}

impl<const M: usize> Kernel for Score<'_, M> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<f64> {
        let mut scores = vec![0.0; self.pool.gains.len()];
        let groups = self.pool.lanes.chunks_exact(self.pool.width);
        for (jacobian, scores) in groups.zip(scores.as_chunks_mut::<LANES>().0) {
            let mut total = Lane::ZERO;
            for (weight, direction) in self.directions {
                let mut moved = [Lane::ZERO; M];
                for (column, part) in jacobian.iter().zip(direction) {
                    for i in 0..M {
                        moved[i] = I::mul_add(column[i], Lane::splat(*part), moved[i]);
                    }
                }
                for lane in moved {
                    total = I::mul_add(lane * lane, Lane::splat(*weight), total);
                }
            }
            *scores = total.0;
        }
        scores.truncate(self.pool.count);
        scores
    }
}
