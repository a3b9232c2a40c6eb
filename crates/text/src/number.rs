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
/// Numbers below this power of ten are finite.
const SURELY_FINITE: i32 = 300;
/// Bytes of a machine word.
const WORD: usize = 8;
/// Bytes that a short number lies within, and the words that it is read by.
const WINDOW: usize = 24;

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
        while let Some(bytes) = word_at(line, at) {
            let (value, count) = leading_digits(bytes);
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

/// In each byte.
const EACH: u64 = 0x0101_0101_0101_0101;
/// Differ from digits by what these say.
const ZEROS: u64 = EACH * b'0' as u64;

/// How many digits eight bytes begin with, the first byte the lowest.
#[inline]
fn digit_count(bytes: u64) -> usize {
    let digits = bytes ^ ZEROS;
    // The high bit of each byte that is above nine, up to the first; behind it carries may set more.
    let others = (digits.wrapping_add(EACH * 0x76) | digits) & (EACH * 0x80);
    (others.trailing_zeros() / 8) as usize
}

/// The value of eight digits, the first one the lowest byte.
///
/// Neighbours are joined to pairs, pairs to fours and these to eight, all parts of the word at once.
#[inline]
fn value_of(digits: u64) -> u64 {
    let pairs = (digits.wrapping_mul(10).wrapping_add(digits >> 8)) & 0x00ff_00ff_00ff_00ff;
    let fours = (pairs.wrapping_mul(100).wrapping_add(pairs >> 16)) & 0x0000_ffff_0000_ffff;
    (fours.wrapping_mul(10_000).wrapping_add(fours >> 32)) & 0xffff_ffff
}

/// The value of the digits that eight bytes begin with, and how many they are.
///
/// The word is shifted until zeros stand before the digits.
#[inline]
fn leading_digits(bytes: u64) -> (u64, usize) {
    let count = digit_count(bytes);
    let aligned = (bytes ^ ZEROS).checked_shl(64 - 8 * count as u32).unwrap_or(0);
    (value_of(aligned), count)
}

/// Where the number begins and ends whose first digit or point is at `at`; None where digits are of something else.
#[inline]
pub(crate) fn number_at(line: &[u8], at: usize) -> Option<(usize, usize)> {
    let start = sign_before(line, at).unwrap_or(at);
    Some((start, end_from(line, start)?))
}

/// Where the number at `at` ends, sign included, where all before it is known to be read as in another line.
///
/// None where it is not certain that reading from the line's start would find the same: behind what could be
/// part of a name, of a number or of an exponent.
#[inline(always)]
pub(crate) fn expected_end(line: &[u8], at: usize) -> Option<usize> {
    let before = at.checked_sub(1).map(|place| line[place]);
    if before.is_some_and(|byte| class(byte) != Class::Other || matches!(byte, b'+' | b'-')) {
        return None;
    }
    let digits = at + usize::from(is_sign(*line.get(at)?));
    let begins = matches!(class(*line.get(digits)?), Class::Digit | Class::Point);
    let own = digits == at || sign_before(line, digits).is_some();
    if begins && own { end_from(line, at) } else { None }
}

/// The number that begins at `start` with its sign, if it has one; None where digits are part of something else.
#[inline(always)]
pub(crate) fn number_from(text: &[u8], start: usize) -> Option<Number> {
    let Some(Short { whole, rest, before, decimals, length }) = short_from(text, start) else {
        return any_number(text, start);
    };
    let (whole, rest) = ((whole ^ ZEROS) << (64 - 8 * before), (rest ^ ZEROS) << (64 - 8 * decimals));
    let magnitude = to_float(value_of(whole >> (8 * decimals) | rest)) / POWERS[decimals];
    let value = if text[start] == b'-' { -magnitude } else { magnitude };
    Some(Number { start, end: start + length, value, decimals: decimals as i16 })
}

/// Where it ends.
#[inline(always)]
fn end_from(text: &[u8], start: usize) -> Option<usize> {
    match short_from(text, start) {
        Some(short) => Some(start + short.length),
        None => end_of_any(text, start),
    }
}

#[inline]
fn is_sign(byte: u8) -> bool {
    matches!(byte, b'+' | b'-')
}

/// A number of eight digits at most with some on either side of its point, as most are.
struct Short {
    /// Eight bytes from its first digit on, and from behind its point on.
    whole: u64,
    rest: u64,
    /// Digits before and behind the point.
    before: usize,
    decimals: usize,
    /// Bytes of it, its sign included.
    length: usize,
}

/// The number that begins at `start`, if it is such a one.
#[inline(always)]
fn short_from(text: &[u8], start: usize) -> Option<Short> {
    let window: &[u8; WINDOW] = text.get(start..)?.first_chunk()?;
    let first = usize::from(is_sign(window[0]));
    let whole = word_at(window, first)?;
    let before = digit_count(whole);
    let point = first + before;
    let rest = word_at(window, point + 1)?;
    let decimals = digit_count(rest);
    let length = point + 1 + decimals;
    let short = before > 0 && decimals > 0 && before + decimals <= WORD;
    let whole_number = short && window[point] == b'.' && class(window[length]) == Class::Other;
    whole_number.then_some(Short { whole, rest, before, decimals, length })
}

/// An integer below 2^52 as a float; the conversion of processors waits for what was in the register before.
#[inline]
pub(crate) fn to_float(integer: u64) -> f64 {
    const UNIT: f64 = (1_u64 << 52) as f64;
    f64::from_bits(UNIT.to_bits() | integer) - UNIT
}

/// The eight bytes from `at` on, the first one the lowest.
#[inline]
fn word_at(line: &[u8], at: usize) -> Option<u64> {
    line.get(at..)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
}

/// A number as it is written, whatever its length.
struct Spelled {
    digits: Digits,
    /// Power of ten that its digits are to be taken times.
    shift: i32,
    /// Its first digit or point.
    first: usize,
    end: usize,
}

fn spelled_from(text: &[u8], start: usize) -> Option<Spelled> {
    let first = start + usize::from(text.get(start).is_some_and(|&byte| is_sign(byte)));
    let mut digits = Digits::default();
    let mut decimals = 0;
    let mut end = digits.take(text, first);
    if text.get(end) == Some(&b'.') && text.get(end + 1) != Some(&b'.') {
        let before = digits.count;
        end = digits.take(text, end + 1);
        decimals = i32::try_from(digits.count - before).unwrap_or(i32::MAX);
    }
    if digits.count == 0 {
        return None;
    }
    let (end, exponent) = exponent_at(text, end);
    if text.get(end).is_some_and(|&byte| in_name(byte) || byte == b'.') {
        return None;
    }
    Some(Spelled { digits, shift: exponent.saturating_sub(decimals), first, end })
}

/// As [`number_from`].
#[inline(never)]
fn any_number(text: &[u8], start: usize) -> Option<Number> {
    let Spelled { digits, shift, first, end } = spelled_from(text, start)?;
    let magnitude = exact(&digits, shift).or_else(|| parsed(&text[first..end]))?;
    let value = if text[start] == b'-' { -magnitude } else { magnitude };
    let decimals = shift.saturating_neg().clamp(0, MOST_DECIMALS) as i16;
    Some(Number { start, end, value, decimals })
}

/// As [`end_from`]: the value matters only where it may be out of range.
#[inline(never)]
fn end_of_any(text: &[u8], start: usize) -> Option<usize> {
    let Spelled { digits, shift, first, end } = spelled_from(text, start)?;
    let power = i32::try_from(digits.count).unwrap_or(i32::MAX).saturating_add(shift);
    if power > SURELY_FINITE {
        parsed(&text[first..end])?;
    }
    Some(end)
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
