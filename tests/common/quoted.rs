//! Numbers quoted in pages.
//!
//! A page marks a quoted number with an HTML comment: `<!-- = NAME -->` follows the number
//! or numbers called NAME. Readers of the page do not see the comment. Tests find the
//! numbers by it.
//!
//! A test rounds its value to the format of the quoted number before it compares the two.
//! The format is the number of decimals, the presence of a 0 before the decimal point, the
//! exponent, and the standard error of the last digits in brackets. A standard error may
//! also follow `+-`, as a number of its own.
use std::ops::Range;
use std::path::PathBuf;

/// Reads a page. `path` is relative to the root of the repository.
pub(crate) fn page(path: &str) -> String {
    std::fs::read_to_string(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// A mark `<!-- = NAME -->` in a page.
pub(crate) struct Mark {
    pub(crate) name: String,
    /// Byte ranges of the numbers before the mark, back to the start of the paragraph or to
    /// the previous mark.
    pub(crate) numbers: Vec<Range<usize>>,
}

/// All marks of a page, in order.
pub(crate) fn marks(text: &str) -> Vec<Mark> {
    const BEGIN: &str = "<!-- = ";
    const END: &str = " -->";
    let (mut marks, mut search_start) = (vec![], 0);
    while let Some(offset) = text[search_start..].find(BEGIN) {
        let begin = search_start + offset;
        let end = begin + text[begin..].find(END).unwrap();
        let paragraph = text[..begin].rfind("\n\n").unwrap_or(0);
        marks.push(Mark {
            name: text[begin + BEGIN.len()..end].to_owned(),
            numbers: numbers_in(text, paragraph.max(search_start)..begin),
        });
        search_start = end + END.len();
    }
    marks
}

/// Byte ranges of the numbers in a range of `text`, each with its sign, exponent and
/// bracketed standard error. Digits that belong to a word, such as `p95` or `10^7`, are not
/// numbers.
fn numbers_in(text: &str, range: Range<usize>) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let digit = |i: usize| i < range.end && bytes[i].is_ascii_digit();
    let (mut found, mut i) = (vec![], range.start);
    while i < range.end {
        let before = i.checked_sub(1).map_or(b' ', |i| bytes[i]);
        let in_word = before.is_ascii_alphanumeric() || b"._^".contains(&before);
        if in_word || !(digit(i) || bytes[i] == b'.' && digit(i + 1)) {
            i += 1;
            continue;
        }
        let signed = before == b'-' && (i < 2 || b" (|\n".contains(&bytes[i - 2]));
        let begin = i - usize::from(signed);
        while digit(i) || b".,".contains(&bytes[i]) && digit(i + 1) {
            i += 1;
        }
        if bytes[i] == b'e' && (digit(i + 1) || bytes[i + 1] == b'-' && digit(i + 2)) {
            i += 2;
            while digit(i) {
                i += 1;
            }
        }
        if bytes[i] == b'(' && digit(i + 1) {
            let close = i + text[i..].find(')').unwrap();
            if (i + 1..close).all(digit) {
                i = close + 1;
            }
        }
        found.push(begin..i);
    }
    found
}

/// The last `N` numbers before the mark `name` in a page.
pub(crate) fn numbers<const N: usize>(path: &str, name: &str) -> [f64; N] {
    let text = page(path);
    let mark = marks(&text).into_iter().find(|mark| mark.name == name);
    let mark = mark.unwrap_or_else(|| panic!("{path} has no <!-- = {name} -->"));
    let first = mark.numbers.len().checked_sub(N);
    let first = first.unwrap_or_else(|| panic!("{path}: fewer than {N} numbers before {name}"));
    std::array::from_fn(|i| number(&text[mark.numbers[first + i].clone()]))
}

/// Parses a quoted number and ignores its bracketed standard error.
pub(crate) fn number(text: &str) -> f64 {
    let plain = text.split('(').next().unwrap();
    plain
        .parse()
        .unwrap_or_else(|_| panic!("not a number: {text}"))
}

/// Formats `value` as `written` is formatted. `se` is used only if `written` has a standard
/// error in brackets.
pub(crate) fn like(written: &str, value: f64, se: f64) -> String {
    assert!(
        !written.contains(','),
        "{written}: numbers with thousands separators cannot be compared"
    );
    if written.ends_with(')') {
        return bracketed(value, se);
    }
    let (mantissa, exponent) = written.split_once('e').unwrap_or((written, ""));
    let decimals = mantissa
        .split_once('.')
        .map_or(0, |(_, decimals)| decimals.len());
    if !exponent.is_empty() {
        return format!("{value:.decimals$e}");
    }
    if written.trim_start_matches('-').starts_with('.') {
        return fixed(value, decimals);
    }
    format!("{value:.decimals$}")
}

/// Asserts that the last numbers before the mark `name` equal `found`, after rounding to the
/// decimals that the page shows.
pub(crate) fn assert_says<const N: usize>(path: &str, name: &str, found: [f64; N]) {
    let text = page(path);
    let quoted = numbers::<N>(path, name);
    let mark = marks(&text)
        .into_iter()
        .find(|mark| mark.name == name)
        .unwrap();
    let first = mark.numbers.len() - N;
    for i in 0..N {
        let written = &text[mark.numbers[first + i].clone()];
        let expected = like(written, found[i], f64::NAN);
        assert_eq!(
            written, expected,
            "{path}, {name}: the page quotes {quoted:?}, but the test found {found:?}"
        );
    }
}

/// Formats `x` with a fixed number of decimals and without a 0 before the decimal point.
pub(crate) fn fixed(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.split_once('.') {
        Some(("0", rest)) => format!(".{rest}"),
        Some(("-0", rest)) => format!("-.{rest}"),
        _ => text,
    }
}

/// Formats a value with the standard error of its last digits in brackets. The standard
/// error has two digits if the first is 1, otherwise one.
pub(crate) fn bracketed(value: f64, se: f64) -> String {
    assert!(
        se > 0.0 && se < 1e3,
        "cannot format a standard error of {se}"
    );
    let exponent = se.log10().floor();
    let extra_digits = if se / 10_f64.powf(exponent) < 2.0 {
        1.0
    } else {
        0.0
    };
    let decimals = (extra_digits - exponent).max(0.0);
    let error = (se * 10_f64.powf(decimals)).round();
    format!("{}({error})", fixed(value, decimals as usize))
}

#[test]
fn numbers_are_found_and_formatted_like_the_quoted_ones() {
    let text = "300-750 um, p95 of 10^7: -2.5 % and .0401(5)<!-- = a --> (.078 +- .003<!-- = b -->";
    let marks = marks(text);
    let found: Vec<_> = marks[0].numbers.iter().map(|r| &text[r.clone()]).collect();
    assert_eq!(found, ["300", "750", "10", "-2.5", ".0401(5)"]);
    let found: Vec<_> = marks[1].numbers.iter().map(|r| &text[r.clone()]).collect();
    assert_eq!((marks[1].name.as_str(), found), ("b", vec![".078", ".003"]));
    for (written, value, se, expected) in [
        ("1.15", 1.146, 0.0, "1.15"),
        (".30", 0.25, 0.0, ".25"),
        ("0.3", 0.25, 0.0, "0.2"),
        ("-2.5", -3.04, 0.0, "-3.0"),
        ("3e-4", 2.61e-4, 0.0, "3e-4"),
        (".04(1)", 0.040_12, 5.2e-4, ".0401(5)"),
        ("7", 8.4, 0.0, "8"),
    ] {
        assert_eq!(like(written, value, se), expected);
    }
}
