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
const ROOM: usize = 24;

/// Write `value` with `decimals` digits behind the point; no sign at a zero.
///
/// `plus` asks for a sign before positive numbers. The text is the nearest one within a hundredth of its last
/// digit.
pub fn write_fixed(out: &mut Vec<u8>, value: f64, decimals: u32, plus: bool) {
    let magnitude = value.abs();
    let scaled = POWERS.get(decimals as usize).map(|power| magnitude * power);
    let Some(scaled) = scaled.filter(|scaled| *scaled < EXACT) else {
        return write_slowly(out, value, decimals, plus);
    };
    let rest = scaled.round() as u64;
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
    if plus && value >= 0.0 {
        out.push(b'+');
    }
    // Writing to memory cannot fail.
    let _ = write!(out, "{value:.*}", decimals as usize);
    let nothing = out[start..].iter().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if nothing && out.get(start) == Some(&b'-') {
        out.remove(start);
    }
}
