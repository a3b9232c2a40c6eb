//! Numbers with a fixed count of decimals.

use std::io::Write;

/// Up to here a number times its power of ten is rounded by less than a hundredth.
const EXACT: f64 = 1e13;
const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
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
    let mut rest = scaled.round() as u64;
    if value < 0.0 && rest > 0 {
        out.push(b'-');
    } else if plus {
        out.push(b'+');
    }
    let mut digits = [b'0'; ROOM];
    let (mut place, mut left) = (ROOM, decimals);
    while rest > 0 || left > 0 {
        place -= 1;
        digits[place] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if left == 1 {
            place -= 1;
            digits[place] = b'.';
        }
        left = left.saturating_sub(1);
    }
    if digits.get(place).is_none_or(|&digit| digit == b'.') {
        out.push(b'0');
    }
    out.extend_from_slice(&digits[place..]);
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
