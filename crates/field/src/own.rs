//! The kernel of `own` blocks: what an encoder or a drive leaves over its joint.
//!
//! Along a turn such errors ripple: a ring's poles and a bearing's rollers come round so many times, never quite alike. The
//! kernel is a Matern kernel times a cosine of the difference, `cos(n d)` for whole cycles n and between them the weighted mean of
//! the neighbours, which keeps it positive definite on the circle. Where cycles times length scale are far below one it is as good as
//! the Matern kernel alone.

use truearm_bank::{InputKind, Shape};
use truearm_kinematics::{Isa, Kernel, Lane, dispatch};

use crate::hyper::Hyper;

/// Cycles a turn at which nothing ripples.
pub const UNRIPPLED: f64 = 0.0;

/// The kernel under given hyper-parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnKernel {
    length: f64,
    cycles: f64,
}

/// Kernels of eight distances and their derivatives by the logarithms of length scale and cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnValue {
    pub kernel: Lane,
    pub by_log_length: Lane,
    pub by_log_cycles: Lane,
}

impl OwnKernel {
    /// Of inputs of a kind: only angles come round.
    pub fn of(hyper: &Hyper, kind: InputKind) -> Self {
        let cycles = if kind == InputKind::Angle { hyper.own_cycles } else { UNRIPPLED };
        Self { length: hyper.own_length, cycles }
    }

    /// The length of a Matern kernel that bends as much at zero.
    pub fn finest_scale(self) -> f64 {
        // Second derivatives at zero: 5 / (3 l^2) and n^2.
        self.length / (1.0 + 0.6 * (self.cycles * self.length).powi(2)).sqrt()
    }

    /// Kernels of eight distances `1 - cos d`.
    #[inline(always)]
    pub fn of_lane<I: Isa>(self, distance: Lane) -> OwnValue {
        let plain = Shape::Matern.of::<I>(distance, self.length);
        let [below, above] = cosines::<I>(self.cycles as usize, Lane::splat(1.0) - distance);
        let part = Lane::splat(self.cycles.fract());
        let ripple = I::mul_add(part, above - below, below);
        OwnValue {
            kernel: plain.kernel * ripple,
            by_log_length: plain.by_log_length * ripple,
            by_log_cycles: plain.kernel * (above - below) * self.cycles,
        }
    }

    /// The kernel of one distance.
    pub fn at(self, distance: f64) -> f64 {
        dispatch(Of { kernel: self, distance }).kernel.0[0]
    }
}

/// `cos(n d)` and `cos((n + 1) d)` from `cos d`, by Chebyshev's recurrence.
#[inline(always)]
fn cosines<I: Isa>(n: usize, cosine: Lane) -> [Lane; 2] {
    let twice = cosine * 2.0;
    let (mut below, mut above) = (Lane::splat(1.0), cosine);
    for _ in 0..n {
        (below, above) = (above, I::mul_add(twice, above, -below));
    }
    [below, above]
}

struct Of {
    kernel: OwnKernel,
    distance: f64,
}

impl Kernel for Of {
    type Output = OwnValue;

    #[inline(always)]
    fn run<I: Isa>(self) -> OwnValue {
        self.kernel.of_lane::<I>(Lane::splat(self.distance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use truearm_bank::Input;
    use truearm_estimate::dense::Cholesky;

    const CYCLES: [f64; 6] = [0.0, 0.4, 1.0, 3.7, 12.0, 31.6];

    #[test]
    fn derivatives_match_finite_differences() {
        let step = 1e-6_f64;
        for cycles in CYCLES.map(|cycles| cycles + 0.01) {
            for distance in [0.0, 1e-4, 0.03, 0.7, 2.0] {
                let kernel = OwnKernel { length: 0.37, cycles };
                let found = dispatch(Of { kernel, distance });
                let slope = |a: OwnKernel, b: OwnKernel| (a.at(distance) - b.at(distance)) / (2.0 * step);
                let of_length = |by: f64| OwnKernel { length: 0.37 * by.exp(), ..kernel };
                let of_cycles = |by: f64| OwnKernel { cycles: cycles * by.exp(), ..kernel };
                let by_length = slope(of_length(step), of_length(-step));
                let by_cycles = slope(of_cycles(step), of_cycles(-step));
                assert!((by_length - found.by_log_length.0[3]).abs() < 1e-8, "{cycles} {distance}");
                assert!((by_cycles - found.by_log_cycles.0[3]).abs() < 1e-7, "{cycles} {distance}");
            }
        }
    }

    #[test]
    fn whole_cycles_are_cosines() {
        let plain = |distance| Shape::Matern.at(distance, 0.5);
        for cycles in [0.0, 1.0, 7.0, 40.0] {
            for angle in [0.0, 0.01, 0.3, 1.0, 3.0] {
                let distance = Input::ANGLE.distance(angle, 0.0);
                let found = OwnKernel { length: 0.5, cycles }.at(distance);
                assert!((found - plain(distance) * (cycles * angle).cos()).abs() < 1e-11, "{cycles} {angle}");
            }
        }
    }

    #[test]
    fn a_turn_of_values_has_a_positive_definite_covariance() {
        let angle = |k: usize| std::f64::consts::TAU * k as f64 / 60.0;
        for cycles in CYCLES {
            for length in [0.05, 0.5, 3.0] {
                let kernel = OwnKernel { length, cycles };
                let covariance = faer::Mat::from_fn(60, 60, |i, j| {
                    let noise = if i == j { 1e-9 } else { 0.0 };
                    kernel.at(Input::ANGLE.distance(angle(i), angle(j))) + noise
                });
                assert!(Cholesky::new(covariance, faer::Par::Seq).is_some(), "{cycles} cycles, {length} rad");
            }
        }
    }

    #[test]
    fn the_finest_scale_bends_as_much_at_zero() {
        for cycles in [0.0, 1.0, 12.0] {
            let kernel = OwnKernel { length: 0.2, cycles };
            let (near, plain) = (1e-7, kernel.finest_scale());
            let bends = (1.0 - kernel.at(near)) / (1.0 - Shape::Matern.at(near, plain));
            assert!((bends - 1.0).abs() < 1e-3, "{cycles}: {bends}");
        }
    }
}
