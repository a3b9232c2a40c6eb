//! Numbers with a fixed count of decimals.

use std::io::Write;

/// Up to here a number times its power of ten is rounded by less than a hundredth.
const EXACT: f64 = 1e13;
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
/// All pairs of digits.
const PAIRS: [u8; 200] = {
    let mut pairs = [b'0'; 200];
    let mut number = 0;
    while number < 100 {
        pairs[2 * number] = b'0' + (number / 10) as u8;
        pairs[2 * number + 1] = b'0' + (number % 10) as u8;
        number += 1;
    }
    pairs
};
/// Digits of the largest integer that is written here.
pub(crate) const ROOM: usize = 24;
/// Integers below are of eight digits, which are found together in one machine word.
const SHORT: f64 = 1e8;
const SHORT_DIGITS: u32 = 8;

/// Write a number of at most eight digits as [`write_fixed`] does to the beginning of `out`, whose rest may be
/// written over as well; its length, None for a longer number.
#[inline(always)]
pub(crate) fn write_short(out: &mut [u8; ROOM], value: f64, decimals: u32, plus: bool) -> Option<usize> {
    let magnitude = value.abs();
    let scaled = magnitude * POWERS.get(decimals as usize).filter(|_| decimals < SHORT_DIGITS)?;
    if scaled >= SHORT - 1.0 || scaled.is_nan() {
        return None;
    }
    let rest = nearest(scaled);
    let digits = eight_digits(rest as u32);
    let written = (SHORT_DIGITS - digits.trailing_zeros() / 8).max(decimals + 1);
    let text = digits + u64::from_ne_bytes([b'0'; 8]);
    let negative = value < 0.0 && rest > 0;
    out[0] = if negative { b'-' } else { b'+' };
    let first = usize::from(negative || plus);
    let point = first + (written - decimals) as usize;
    out[first..first + 8].copy_from_slice(&(text >> (8 * (SHORT_DIGITS - written))).to_le_bytes());
    if decimals == 0 {
        return Some(point);
    }
    // At most seven digits stand behind the point, so that they fit a word with it.
    let behind = (text >> (8 * (SHORT_DIGITS - decimals))) << 8 | u64::from(b'.');
    out[point..point + 8].copy_from_slice(&behind.to_le_bytes());
    Some(point + 1 + decimals as usize)
}

/// The nearest integer, away from zero between two, of a number from 0 to `EXACT`.
#[inline]
fn nearest(scaled: f64) -> u64 {
    // A float of this size has no digits behind the point; between two integers it takes the even one.
    const UNIT: f64 = (1_u64 << 52) as f64;
    let sum = scaled + UNIT;
    sum.to_bits() - UNIT.to_bits() + u64::from(scaled - (sum - UNIT) >= 0.5)
}

/// The decimal digits of a number below 10^8, the first one in the lowest byte.
///
/// Halves, pairs and digits are parted by products with reciprocals, all parts of the word at once.
#[inline]
fn eight_digits(number: u32) -> u64 {
    let halves = u64::from(number / 10_000) | (u64::from(number % 10_000) << 32);
    let hundreds = ((halves * 10_486) >> 20) & 0x0000_007f_0000_007f;
    let pairs = hundreds | ((halves - 100 * hundreds) << 16);
    let tens = ((pairs * 103) >> 10) & 0x000f_000f_000f_000f;
    tens | ((pairs - 10 * tens) << 8)
}

/// Write `value` with `decimals` digits behind the point; no sign at a zero.
///
/// `plus` asks for a sign before positive numbers. The text is the nearest one within a hundredth of its last
/// digit.
pub fn write_fixed(out: &mut Vec<u8>, value: f64, decimals: u32, plus: bool) {
    let mut text = [0; ROOM];
    if let Some(length) = write_short(&mut text, value, decimals, plus) {
        return out.extend_from_slice(&text[..length]);
    }
    let magnitude = value.abs();
    let scaled = POWERS.get(decimals as usize).map(|power| magnitude * power);
    let Some(scaled) = scaled.filter(|scaled| *scaled < EXACT) else {
        return write_slowly(out, value, decimals, plus);
    };
    let rest = nearest(scaled);
    if value < 0.0 && rest > 0 {
        out.push(b'-');
    } else if plus {
        out.push(b'+');
    }
    let decimals = decimals as usize;
    let mut digits = [b'0'; ROOM];
    let first = write_digits(&mut digits, rest).min(ROOM - decimals - 1);
    out.extend_from_slice(&digits[first..ROOM - decimals]);
    if decimals > 0 {
        out.push(b'.');
        out.extend_from_slice(&digits[ROOM - decimals..]);
    }
}

/// Write an integer to the end of `digits`; where it begins.
fn write_digits(digits: &mut [u8; ROOM], mut rest: u64) -> usize {
    let mut place = ROOM;
    while rest >= 10 {
        let pair = 2 * (rest % 100) as usize;
        rest /= 100;
        place -= 2;
        digits[place..place + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
    }
    if rest > 0 {
        place -= 1;
        digits[place] = b'0' + rest as u8;
    }
    place
}

/// The same for numbers that no machine integer holds.
fn write_slowly(out: &mut Vec<u8>, value: f64, decimals: u32, plus: bool) {
    let start = out.len();
    // Writing to memory cannot fail.
    let _ = write!(out, "{:.*}", decimals as usize, value.abs());
    let nothing = out[start..].iter().all(|byte| matches!(byte, b'0' | b'.'));
    if value < 0.0 && !nothing {
        out.insert(start, b'-');
    } else if plus {
        out.insert(start, b'+');
    }
}
