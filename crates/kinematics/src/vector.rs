//! Vectors of three: of one pose, and of eight at once.

use crate::isa::Isa;
use crate::lane::Lane;

/// a x b.
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Root of the sum of squares.
pub fn norm(a: [f64; 3]) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

/// a x b for each of eight poses.
#[inline(always)]
pub fn lane_cross<I: Isa>(a: &[Lane; 3], b: &[Lane; 3]) -> [Lane; 3] {
    [
        I::mul_add(a[1], b[2], -(a[2] * b[1])),
        I::mul_add(a[2], b[0], -(a[0] * b[2])),
        I::mul_add(a[0], b[1], -(a[1] * b[0])),
    ]
}
