//! The exponential of eight numbers.

use crate::isa::Isa;
use crate::lane::{LANES, Lane};

/// Added and taken away, rounds to the nearest integer and leaves it in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts, the first of 33 bits.
const LN_2: [f64; 2] = [0.693_147_180_485_539_1, 7.440_617_110_012_397e-11];
/// Beyond these the result is no normal number: arguments count as the nearest of them.
const RANGE: (f64, f64) = (-708.0, 709.0);
/// 1 / k! from k = 2 on; between -ln 2 / 2 and ln 2 / 2 what is left out is below 1e-17.
const TAYLOR: [f64; 12] = [
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

/// e to the power of eight numbers, with a relative error below 4e-16; arguments below -708 give e^-708 (never zero),
/// above 709 e^709, NaN gives NaN.
#[inline(always)]
pub fn exp<I: Isa>(x: Lane) -> Lane {
    let mut within = [0.0; LANES];
    for i in 0..LANES {
        // By comparisons, which keep what is no number.
        let above = if x.0[i] < RANGE.0 { RANGE.0 } else { x.0[i] };
        within[i] = if above > RANGE.1 { RANGE.1 } else { above };
    }
    let shifted = I::mul_add(Lane(within), Lane::splat(std::f64::consts::LOG2_E), Lane::splat(ROUND));
    let halvings = shifted - Lane::splat(ROUND);
    let mut r = Lane(within);
    for part in LN_2 {
        r = I::mul_add(halvings, Lane::splat(-part), r);
    }
    let mut sum = Lane::splat(TAYLOR[TAYLOR.len() - 1]);
    for k in (0..TAYLOR.len() - 1).rev() {
        sum = I::mul_add(sum, r, Lane::splat(TAYLOR[k]));
    }
    let small = I::mul_add(sum * r, r, r) + Lane::splat(1.0);
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        let power = f64::from_bits(shifted.0[i].to_bits().wrapping_add(1023) << 52);
        out[i] = small.0[i] * power;
    }
    Lane(out)
}
