//! One number as programs write it.

/// Behind these a sign is an operator.
const ENDS_AN_OPERAND: &[u8] = b")]}";
/// Powers of ten that a machine number holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];
/// Powers of ten that shift by as many digits as are read at a time.
const TENS: [u64; 9] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];
/// Up to here integers are exact machine numbers.
const EXACT: u64 = 1 << 53;
/// More digits behind the point than any machine number needs; those of longer ones are counted as so many.
const MOST_DECIMALS: i32 = 400;
/// So many digits fit an integer, whatever they are.
const MOST_DIGITS: usize = 18;

/// A number in a line, its sign included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    /// First byte.
    pub start: usize,
    /// Behind the last byte.
    pub end: usize,
    /// What it says.
    pub value: f64,
    /// Digits behind the point, a negative exponent counted; at most 400.
    pub decimals: i16,
}

/// What a byte can be part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// A name, not as a digit; bytes of other alphabets can.
    Name,
    /// A number or a name.
    Digit,
    /// A number.
    Point,
    /// Neither.
    Other,
}

/// The classes of all bytes.
const CLASSES: [Class; 256] = {
    let mut classes = [Class::Other; 256];
    let mut byte = 0_usize;
    while byte < 256 {
        let letter = byte as u8;
        if letter.is_ascii_digit() {
            classes[byte] = Class::Digit;
        } else if letter == b'.' {
            classes[byte] = Class::Point;
        } else if letter.is_ascii_alphabetic() || letter == b'_' || letter == b'$' || letter >= 0x80 {
            classes[byte] = Class::Name;
        }
        byte += 1;
    }
    classes
};

/// What a byte can be part of.
#[inline]
pub(crate) fn class(byte: u8) -> Class {
    CLASSES[usize::from(byte)]
}

/// Whether a byte can be in a name.
#[inline]
fn in_name(byte: u8) -> bool {
    matches!(class(byte), Class::Name | Class::Digit)
}

/// Digits read so far.
#[derive(Default)]
struct Digits {
    whole: u64,
    count: usize,
}

impl Digits {
    /// Take the digits at `at`; where they end.
    #[inline]
    fn take(&mut self, line: &[u8], mut at: usize) -> usize {
        while let Some(bytes) = line.get(at..).and_then(<[u8]>::first_chunk) {
            let (value, count) = leading_digits(u64::from_le_bytes(*bytes));
            self.whole = self.whole.wrapping_mul(TENS[count]).wrapping_add(value);
            self.count += count;
            at += count;
            if count < 8 {
                return at;
            }
        }
        while let Some(digit) = line.get(at).filter(|byte| byte.is_ascii_digit()) {
            self.whole = self.whole.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
            self.count += 1;
            at += 1;
        }
        at
    }
}

/// The value of the digits that eight bytes begin with, the first byte the lowest, and how many they are.
///
/// The word is shifted until zeros stand before the digits; then neighbours are joined to pairs, pairs to fours and these
/// to eight, all parts of the word at once.
#[inline]
fn leading_digits(bytes: u64) -> (u64, usize) {
    const EACH: u64 = 0x0101_0101_0101_0101;
    let digits = bytes ^ (EACH * u64::from(b'0'));
    // The high bit of each byte that is above nine, up to the first; behind it carries may set more.
    let others = (digits.wrapping_add(EACH * 0x76) | digits) & (EACH * 0x80);
    let count = (others.trailing_zeros() / 8) as usize;
    let aligned = digits.checked_shl(64 - 8 * count as u32).unwrap_or(0);
    let pairs = (aligned.wrapping_mul(10).wrapping_add(aligned >> 8)) & 0x00ff_00ff_00ff_00ff;
    let fours = (pairs.wrapping_mul(100).wrapping_add(pairs >> 16)) & 0x0000_ffff_0000_ffff;
    let eight = (fours.wrapping_mul(10_000).wrapping_add(fours >> 32)) & 0xffff_ffff;
    (eight, count)
}

/// The number whose first digit or point is at `at`; None where digits are part of something else.
#[inline]
pub(crate) fn number_at(line: &[u8], at: usize) -> Option<Number> {
    let mut digits = Digits::default();
    let mut decimals = 0;
    let mut end = digits.take(line, at);
    if line.get(end) == Some(&b'.') && line.get(end + 1) != Some(&b'.') {
        let before = digits.count;
        end = digits.take(line, end + 1);
        decimals = i32::try_from(digits.count - before).unwrap_or(i32::MAX);
    }
    if digits.count == 0 {
        return None;
    }
    let (end, exponent) = exponent_at(line, end);
    if line.get(end).is_some_and(|&byte| in_name(byte) || byte == b'.') {
        return None;
    }
    let start = sign_before(line, at).unwrap_or(at);
    let shift = exponent.saturating_sub(decimals);
    let magnitude = exact(&digits, shift).or_else(|| parsed(&line[at..end]))?;
    let value = if line[start] == b'-' { -magnitude } else { magnitude };
    let decimals = shift.saturating_neg().clamp(0, MOST_DECIMALS) as i16;
    Some(Number { start, end, value, decimals })
}

/// The number at `at`, sign included, where all before it is known to be read as in another line.
///
/// None where it is not certain that reading from the line's start would find the same: behind what could be
/// part of a name, of a number or of an exponent.
#[inline]
pub(crate) fn expected_number(line: &[u8], at: usize) -> Option<Number> {
    let before = at.checked_sub(1).map(|place| line[place]);
    if before.is_some_and(|byte| class(byte) != Class::Other || matches!(byte, b'+' | b'-')) {
        return None;
    }
    let digits = if matches!(line.get(at), Some(b'+' | b'-')) { at + 1 } else { at };
    if !matches!(class(*line.get(digits)?), Class::Digit | Class::Point) {
        return None;
    }
    number_at(line, digits).filter(|number| number.start == at)
}

/// The value of digits times a power of ten where both are exact, so that their quotient is the nearest number.
#[inline]
fn exact(digits: &Digits, shift: i32) -> Option<f64> {
    if digits.count > MOST_DIGITS || digits.whole > EXACT {
        return None;
    }
    let power = POWERS.get(shift.unsigned_abs() as usize)?;
    let whole = digits.whole as f64;
    Some(if shift < 0 { whole / power } else { whole * power })
}

/// End and value of the exponent that may begin at `at`.
#[inline]
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
fn parsed(text: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?;
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}
