//! One number as programs write it.

/// Behind these a sign is an operator.
const ENDS_AN_OPERAND: &[u8] = b")]}";

/// A number in a line, its sign included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    /// First byte.
    pub start: usize,
    /// Behind the last byte.
    pub end: usize,
    /// What it says.
    pub value: f64,
    /// Digits behind the point, a negative exponent counted.
    pub decimals: i32,
}

/// Whether a byte can be in a name; bytes of other alphabets can.
pub(crate) fn in_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'$' || byte >= 0x80
}

/// The number whose first digit or point is at `at`; None where digits are part of something else.
pub(crate) fn number_at(line: &[u8], at: usize) -> Option<Number> {
    let (mut end, mut digits, mut decimals) = (at, 0_usize, 0_i32);
    while line.get(end).is_some_and(u8::is_ascii_digit) {
        (end, digits) = (end + 1, digits + 1);
    }
    if line.get(end) == Some(&b'.') && line.get(end + 1) != Some(&b'.') {
        end += 1;
        while line.get(end).is_some_and(u8::is_ascii_digit) {
            (end, digits, decimals) = (end + 1, digits + 1, decimals.saturating_add(1));
        }
    }
    if digits == 0 {
        return None;
    }
    let (end, exponent) = exponent_at(line, end);
    if line.get(end).is_some_and(|&byte| in_name(byte) || byte == b'.') {
        return None;
    }
    let start = sign_before(line, at).unwrap_or(at);
    let value = value_of(&line[start..end])?;
    Some(Number { start, end, value, decimals: decimals.saturating_sub(exponent).max(0) })
}

/// End and value of the exponent that may begin at `at`.
fn exponent_at(line: &[u8], at: usize) -> (usize, i32) {
    if !matches!(line.get(at), Some(b'e' | b'E')) {
        return (at, 0);
    }
    let negative = line.get(at + 1) == Some(&b'-');
    let first = if matches!(line.get(at + 1), Some(b'+' | b'-')) { at + 2 } else { at + 1 };
    let (mut end, mut exponent) = (first, 0_i32);
    while let Some(digit) = line.get(end).filter(|byte| byte.is_ascii_digit()) {
        exponent = exponent.saturating_mul(10).saturating_add(i32::from(digit - b'0'));
        end += 1;
    }
    if end == first { (at, 0) } else { (end, if negative { -exponent } else { exponent }) }
}

/// Where the sign of the number at `at` is; None if there is none or it is an operator.
fn sign_before(line: &[u8], at: usize) -> Option<usize> {
    let sign = at.checked_sub(1).filter(|&place| matches!(line[place], b'+' | b'-'))?;
    let before = line[..sign].iter().rev().find(|byte| !matches!(byte, b' ' | b'\t'));
    let operator = before.is_some_and(|&byte| in_name(byte) || ENDS_AN_OPERAND.contains(&byte));
    (!operator).then_some(sign)
}

/// The value of a number's text; None if it is out of range.
fn value_of(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?;
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}
