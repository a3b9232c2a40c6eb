//! What is found in texts and what is written over it.

use proptest::prelude::*;
use truearm_text::{
    Lines, Number, Numbers, TextError, Values, Words, find, read_numbers, scan_lines, splice_in_pieces,
    write_fixed,
};

fn fixed(value: f64, decimals: u32, plus: bool) -> String {
    let mut out = Vec::new();
    write_fixed(&mut out, value, decimals, plus);
    String::from_utf8_lossy(&out).into_owned()
}

/// A line with its numbers taken out.
fn skeleton(line: &[u8]) -> Result<Vec<u8>, TextError> {
    let mut rest = line.to_vec();
    for number in scanned(line)?.1.iter().rev() {
        rest.splice(number.start..number.end, [0]);
    }
    Ok(rest)
}

/// The lines of a text and what their numbers say.
fn scanned(text: &[u8]) -> Result<(Lines, Vec<Number>), TextError> {
    let lines = scan_lines(text)?;
    let count = lines.numbers.len();
    let (mut ends, mut values, mut decimals) = (vec![0; count], vec![0.0; count], vec![0; count]);
    let out = Values { ends: &mut ends, values: &mut values, decimals: &mut decimals };
    read_numbers(text, &lines.numbers, out)?;
    let number = |(row, &start): (usize, &i32)| Number {
        start: start as usize,
        end: ends[row] as usize,
        value: values[row],
        decimals: decimals[row],
    };
    let numbers = lines.numbers.iter().enumerate().map(number).collect();
    Ok((lines, numbers))
}

fn found(text: &str) -> Result<Vec<(&str, f64, i16)>, TextError> {
    let (_, numbers) = scanned(text.as_bytes())?;
    Ok(numbers.iter().map(|n| (&text[n.start..n.end], n.value, n.decimals)).collect())
}

fn splice(text: &[u8], numbers: Numbers<'_>, words: &[Words<'_>]) -> Result<Vec<u8>, TextError> {
    Ok(splice_in_pieces(text, numbers, words)?.concat())
}

#[test]
fn numbers_of_a_line() {
    assert_eq!(
        found("movej([-0.5, +1., .25,1E-3], a=2)").unwrap(),
        [("-0.5", -0.5, 1), ("+1.", 1.0, 0), (".25", 0.25, 2), ("1E-3", 1e-3, 3), ("2", 2.0, 0)]
    );
}

#[test]
fn digits_of_names_are_no_numbers() {
    assert_eq!(found("p12 _3 $4 6DOF 1.2.3 \u{e4}5 x2.5").unwrap(), []);
}

#[test]
fn a_sign_behind_an_operand_is_an_operator() {
    assert_eq!(
        found("a-1 b - 2 (3)-4 [-5").unwrap(),
        [("1", 1.0, 0), ("2", 2.0, 0), ("3", 3.0, 0), ("4", 4.0, 0), ("-5", -5.0, 0)]
    );
}

#[test]
fn lines_that_differ_in_numbers_only_are_alike() {
    let lines = scan_lines(b"mov 1,-2\r\n# x\r\nmov 3,4.5\r\nlast").unwrap();
    assert_eq!(lines.skeleton, [0, 1, 0, 2]);
    assert_eq!(lines.representative, [0, 1, 3]);
    assert_eq!(lines.first_number, [0, 2, 2, 4, 4]);
    assert_eq!(lines.starts, [0, 10, 15, 26, 30]);
}

#[test]
fn words_go_between_numbers() {
    let numbers = Numbers { starts: &[2, 6], ends: &[3, 8], values: &[10.25, -3.0], decimals: &[1, 0] };
    let words = [Words { start: 0, end: 0, bytes: b"# mark\n" }, Words { start: 4, end: 5, bytes: b"!" }];
    let out = splice(b"a 1 b 22 c", numbers, &words).unwrap();
    assert_eq!(String::from_utf8(out).unwrap(), "# mark\na 10.3 ! -3 c");
}

#[test]
fn overlapping_spans_and_nan_are_refused() {
    let overlapping = Numbers { starts: &[0, 1], ends: &[2, 3], values: &[1.0, 2.0], decimals: &[0, 0] };
    assert!(matches!(splice(b"1234", overlapping, &[]), Err(TextError::Span { start: 1, .. })));
    let nan = Numbers { starts: &[0], ends: &[1], values: &[f64::NAN], decimals: &[0] };
    assert!(matches!(splice(b"1", nan, &[]), Err(TextError::NotFinite { start: 0, .. })));
    let inside = Numbers { starts: &[0], ends: &[3], values: &[1.0], decimals: &[0] };
    let over = [Words { start: 0, end: 2, bytes: b"x" }];
    assert!(
        splice(b"123", Numbers { starts: &[1], ends: &[3], values: &[1.0], decimals: &[0] }, &over).is_err()
    );
    assert!(splice(b"123", inside, &[Words { start: 1, end: 1, bytes: b"x" }]).is_err());
}

#[test]
fn a_place_without_a_number_is_refused() {
    let out = Values { ends: &mut [0], values: &mut [0.0], decimals: &mut [0] };
    assert_eq!(read_numbers(b"a 1", &[0], out), Err(TextError::NoNumber { start: 0 }));
    let out = Values { ends: &mut [0], values: &mut [], decimals: &mut [0] };
    assert_eq!(read_numbers(b"a 1", &[2], out), Err(TextError::Lengths { first: 1, other: 0 }));
}

#[test]
fn ties_are_written_away_from_zero() {
    assert_eq!(fixed(0.5, 0, false), "1");
    assert_eq!(fixed(1.5, 0, false), "2");
    assert_eq!(fixed(2.5, 0, false), "3");
    assert_eq!(fixed(-0.125, 2, false), "-0.13");
    assert_eq!(fixed(0.375, 2, false), "0.38");
    assert_eq!(fixed(0.499_999_999_999_999_94, 0, false), "0");
}

#[test]
fn zeros_and_signs() {
    assert_eq!(fixed(-0.00001, 3, false), "0.000");
    assert_eq!(fixed(-0.0006, 3, false), "-0.001");
    assert_eq!(fixed(0.5, 2, true), "+0.50");
    assert_eq!(fixed(12.0, 0, false), "12");
    assert_eq!(fixed(0.0, 0, false), "0");
    assert_eq!(fixed(-1e-30, 20, false), "0.00000000000000000000");
    for value in [0.0, -0.0, -1e-30] {
        assert_eq!(fixed(value, 3, true), "+0.000");
        assert_eq!(fixed(value, 17, true), "+0.00000000000000000");
    }
    assert_eq!(fixed(-1e30, 2, true), "-1000000000000000019884624838656.00");
}

#[test]
fn long_texts_are_read_and_written_in_pieces() {
    let text: String =
        (0..60_000).map(|i| format!("mov {i}.25, -{i}e-1 ; {}\n", ["a", "b"][i % 2])).collect();
    let (lines, found) = scanned(text.as_bytes()).unwrap();
    assert_eq!(lines.representative, [0, 1]);
    assert_eq!(lines.skeleton[59_999], 1);
    assert_eq!(lines.first_number[60_000], 120_000);
    assert!(found.iter().step_by(2).enumerate().all(|(i, n)| n.value == i as f64 + 0.25));
    let decimals = vec![2; 120_000];
    let ends: Vec<i32> = found.iter().map(|n| n.end as i32).collect();
    let values: Vec<f64> = found.iter().map(|n| n.value).collect();
    let numbers = Numbers { starts: &lines.numbers, ends: &ends, values: &values, decimals: &decimals };
    let words = [Words { start: text.len(), end: text.len(), bytes: b"end" }];
    let out = String::from_utf8(splice(text.as_bytes(), numbers, &words).unwrap()).unwrap();
    let wanted: String = (0..60_000)
        .map(|i| format!("mov {i}.25, {:.2} ; {}\n", -(i as f64) / 10.0, ["a", "b"][i % 2]))
        .collect();
    assert_eq!(out, wanted.replacen("-0.00", "0.00", 1) + "end");
}

proptest! {
    #[test]
    fn values_are_those_of_the_text(value in any::<f64>(), decimals in 0..20_usize) {
        let text = format!("[{value:.decimals$}");
        let (_, numbers) = scanned(text.as_bytes()).unwrap();
        let wanted: Vec<f64> = text[1..].parse().ok().filter(|v: &f64| v.is_finite()).into_iter().collect();
        let found: Vec<f64> = numbers.iter().map(|n| n.value).collect();
        if value.is_finite() {
            prop_assert_eq!(found.iter().map(|v| v.to_bits()).collect::<Vec<_>>(), wanted.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
        }
    }

    #[test]
    fn written_numbers_are_within_half_a_digit(value in -1e6..1e6_f64, decimals in 0..9_u32) {
        let back: f64 = fixed(value, decimals, false).parse().unwrap();
        prop_assert!((back - value).abs() <= 0.51 * 10_f64.powi(-(decimals as i32)));
        let text = fixed(value, decimals, false);
        prop_assert_eq!(text.split('.').nth(1).map_or(0, str::len), decimals as usize);
    }

    #[test]
    fn any_text_is_scanned(text in any::<Vec<u8>>()) {
        let (lines, numbers) = scanned(&text).unwrap();
        prop_assert_eq!(lines.starts.len(), lines.skeleton.len() + 1);
        let mut after = 0;
        for number in numbers {
            prop_assert!(after <= number.start && number.start < number.end && number.end <= text.len());
            prop_assert!(number.value.is_finite());
            after = number.end;
        }
    }

    #[test]
    fn numbers_written_over_themselves_say_the_same(values in prop::collection::vec(-1e3..1e3_f64, 1..20)) {
        let text: String = values.iter().map(|v| format!("x({v:.4}) ")).collect();
        let (lines, found) = scanned(text.as_bytes()).unwrap();
        let ends: Vec<i32> = found.iter().map(|n| n.end as i32).collect();
        let same: Vec<f64> = found.iter().map(|n| n.value).collect();
        let decimals: Vec<i16> = found.iter().map(|n| n.decimals).collect();
        let numbers = Numbers { starts: &lines.numbers, ends: &ends, values: &same, decimals: &decimals };
        let out = String::from_utf8(splice(text.as_bytes(), numbers, &[]).unwrap()).unwrap();
        prop_assert_eq!(out.replace("-0.0000", "0.0000"), text.replace("-0.0000", "0.0000"));
    }

    #[test]
    fn a_line_is_read_alike_alone_and_among_others(
        lines in prop::collection::vec("[-+ .,ae1(\\[]{0,12}", 1..4),
        order in prop::collection::vec((0..4_usize, "[-+]?[0-9]{0,3}\\.?[0-9]?(e[-+]?[0-9])?"), 1..30),
    ) {
        // Ones stand for numbers, so that lines come again with others in them.
        let texts: Vec<String> =
            order.iter().map(|(line, number)| lines[line % lines.len()].replace('1', number) + "\n").collect();
        let whole = texts.concat();
        let (_, together) = scanned(whole.as_bytes()).unwrap();
        let mut offset = 0;
        let mut alone = Vec::new();
        for text in &texts {
            for number in scanned(text.as_bytes()).unwrap().1 {
                alone.push(Number { start: number.start + offset, end: number.end + offset, ..number });
            }
            offset += text.len();
        }
        prop_assert_eq!(together, alone);
    }

    #[test]
    fn lines_of_one_shape_are_told_from_others(
        patterns in prop::collection::vec("[-+ .,ae1(\\[#]{6,16}", 1..4),
        order in prop::collection::vec((0..3_usize, prop::collection::vec("[0-9]", 4), 2..5_usize), 1..20),
    ) {
        // The same pattern with other digits several times over, so that its shape is known, and then another.
        let digits = |pattern: &str, digits: &[String]| {
            let mut next = digits.iter().cycle();
            let spelled = |c: char| if c == '1' { next.next().cloned().unwrap_or_default() } else { c.to_string() };
            pattern.chars().map(spelled).collect::<String>() + "\n"
        };
        let texts: Vec<String> = order
            .iter()
            .flat_map(|(line, others, times)| vec![digits(&patterns[line % patterns.len()], others); *times])
            .collect();
        let whole = texts.concat();
        let (lines, together) = scanned(whole.as_bytes()).unwrap();
        let (mut offset, mut alone) = (0, Vec::new());
        for (line, text) in texts.iter().enumerate() {
            prop_assert_eq!(lines.starts[line], offset as i32);
            prop_assert_eq!(lines.first_number[line], alone.len() as i32);
            let same = |other: &String| skeleton(other.as_bytes()) == skeleton(text.as_bytes());
            let first = texts.iter().position(same).unwrap();
            prop_assert_eq!(lines.representative[lines.skeleton[line] as usize], first as i32);
            for number in scanned(text.as_bytes()).unwrap().1 {
                alone.push(Number { start: number.start + offset, end: number.end + offset, ..number });
            }
            offset += text.len();
        }
        prop_assert_eq!(together, alone);
    }

    #[test]
    fn words_are_found_where_they_first_stand(text in "[ab]{0,40}", word in "[ab]{1,4}") {
        prop_assert_eq!(find(text.as_bytes(), word.as_bytes()), text.find(&word));
    }

    #[test]
    fn numbers_of_any_length_are_read(whole in "[0-9]{0,12}", behind in "[0-9]{0,12}", sign in "[-+]?", end in "[ ,)\n]") {
        let text = format!("({sign}{whole}.{behind}{end}");
        let (_, numbers) = scanned(text.as_bytes()).unwrap();
        let wanted = format!("{sign}{whole}.{behind}").parse::<f64>().ok();
        prop_assert_eq!(numbers.first().map(|n| n.value.to_bits()), wanted.map(f64::to_bits));
        prop_assert!(numbers.iter().all(|n| n.end == text.len() - 1 && n.decimals as usize == behind.len()));
    }

    #[test]
    fn exact_decimals_are_written_as_they_are(digits in -2_000_000_000_i64..2_000_000_000, decimals in 0..9_u32) {
        let (sign, magnitude) = (if digits < 0 { "-" } else { "" }, digits.abs());
        let power = 10_i64.pow(decimals);
        let (whole, rest) = (magnitude / power, magnitude % power);
        let behind = if decimals == 0 { String::new() } else { format!(".{rest:0width$}", width = decimals as usize) };
        prop_assert_eq!(fixed(digits as f64 / power as f64, decimals, false), format!("{sign}{whole}{behind}"));
    }
}
