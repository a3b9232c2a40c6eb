//! From readings to Denavit-Hartenberg joint values: q_dh = C reading.

use truearm_kinematics::{Isa, Lane, Screw};

/// C, with the case of no coupling apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Coupling {
    /// Readings are joint values.
    None,
    /// N x N, row-major, and N.
    Matrix(Vec<f64>, usize),
}

impl Coupling {
    /// Of a matrix (count, count), row-major, that makes joint values of readings.
    pub fn new(matrix: &[f64], count: usize) -> Self {
        let unit = |(k, &value): (usize, &f64)| value == f64::from(u8::from(k / count == k % count));
        if matrix.iter().enumerate().all(unit) { Self::None } else { Self::Matrix(matrix.to_vec(), count) }
    }

    /// Joint values of N readings.
    #[inline(always)]
    pub fn joints<I: Isa>(&self, readings: &[Lane], joints: &mut [Lane]) {
        match self {
            Self::None => joints.copy_from_slice(readings),
            Self::Matrix(matrix, count) => {
                for (joint, row) in joints.iter_mut().zip(matrix.chunks_exact(*count)) {
                    *joint = Lane::ZERO;
                    for (reading, factor) in readings.iter().zip(row) {
                        *joint = I::mul_add(*reading, Lane::splat(*factor), *joint);
                    }
                }
            }
        }
    }

    /// Motion of the end by reading k, from the motions by all N joint values; what follows them is not theirs.
    #[inline(always)]
    pub fn screw<I: Isa>(&self, screws: &[Screw], k: usize) -> Screw {
        let Self::Matrix(matrix, count) = self else { return screws[k] };
        let mut sum = Screw::ZERO;
        for (screw, row) in screws.iter().zip(matrix.chunks_exact(*count)) {
            let factor = Lane::splat(row[k]);
            for i in 0..3 {
                sum.angular[i] = I::mul_add(screw.angular[i], factor, sum.angular[i]);
                sum.linear[i] = I::mul_add(screw.linear[i], factor, sum.linear[i]);
            }
        }
        sum
    }
}
