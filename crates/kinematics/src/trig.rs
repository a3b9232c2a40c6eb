//! Sine and cosine of eight angles.

use crate::isa::Isa;
use crate::lane::{LANES, Lane};

/// Largest angle reduced here; k of its quarter turns keeps k times a 33-bit part of pi/2 exact.
const LIMIT: f64 = 1.0e6;
/// Added and taken away, rounds to the nearest integer and leaves it in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// pi/2 in three parts: two of 33 bits, and the rest.
const QUARTER: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// Taylor's series does to 1e-17 what is needed between -pi/4 and pi/4; (sin r - r) / r^3 in r^2.
const SINE: [f64; 7] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];
/// (cos r - 1 + r^2 / 2) / r^4 in r^2.
const COSINE: [f64; 7] = [
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

/// Sine and cosine of eight angles (radians).
///
/// The absolute error is below 2.3e-16 for angles up to a million radians; larger ones go to the standard library. NaN and
/// infinite angles give NaN. What an angle gives does not depend on those beside it.
#[inline(always)]
#[allow(clippy::neg_cmp_op_on_partial_ord, reason = "NaN counts as beyond, and this is one comparison")]
pub fn sin_cos<I: Isa>(angle: Lane) -> (Lane, Lane) {
    let (mut sine, mut cosine) = reduced::<I>(angle);
    if angle.0.iter().fold(false, |beyond, x| beyond | !(x.abs() <= LIMIT)) {
        for i in 0..LANES {
            if !(angle.0[i].abs() <= LIMIT) {
                (sine.0[i], cosine.0[i]) = by_library(angle.0[i]);
            }
        }
    }
    (sine, cosine)
}

#[inline(always)]
fn reduced<I: Isa>(angle: Lane) -> (Lane, Lane) {
    let shifted = I::mul_add(angle, Lane::splat(std::f64::consts::FRAC_2_PI), Lane::splat(ROUND));
    let turns = shifted - Lane::splat(ROUND);
    let mut r = angle;
    for part in QUARTER {
        r = I::mul_add(turns, Lane::splat(-part), r);
    }
    let square = r * r;
    let s = I::mul_add(polynomial::<I>(&SINE, square) * square, r, r);
    let c = I::mul_add(polynomial::<I>(&COSINE, square), square * square, Lane::splat(1.0) - square * 0.5);
    (quadrant(shifted, s, c, 0), quadrant(shifted, c, s, 1))
}

/// Polynomials, lowest coefficient first, by Estrin's scheme: half as many steps that wait for each other as Horner's has.
#[inline(always)]
pub fn polynomial<I: Isa>(coefficients: &[f64; 7], x: Lane) -> Lane {
    let c = |i: usize| Lane::splat(coefficients[i]);
    let (x2, pair) = (x * x, |i: usize| I::mul_add(c(i + 1), x, c(i)));
    let (low, high) = (I::mul_add(pair(2), x2, pair(0)), I::mul_add(c(6), x2, pair(4)));
    I::mul_add(high, x2 * x2, low)
}

/// `even` or `odd` by the lowest bit of the quarter turns, with the sign of the second bit; `shift` quarter turns on.
#[inline(always)]
fn quadrant(shifted: Lane, even: Lane, odd: Lane, shift: u64) -> Lane {
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        let turns = shifted.0[i].to_bits();
        let swap = 0u64.wrapping_sub(turns & 1);
        let value = (even.0[i].to_bits() & !swap) | (odd.0[i].to_bits() & swap);
        out[i] = f64::from_bits(value ^ ((turns.wrapping_add(shift) & 2) << 62));
    }
    Lane(out)
}

#[cold]
#[inline(never)]
fn by_library(angle: f64) -> (f64, f64) {
    angle.sin_cos()
}
