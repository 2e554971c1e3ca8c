//! Numbers that pages quote. In a page `<!-- = NAME -->` follows the number, or the numbers,
//! that NAME stands for: it is not seen where the page is read, and tells a test which
//! number is which.
//!
//! A number is compared as it is written: with its decimals, with or without the 0 before
//! the point, with an exponent, with the standard error of the last digits in brackets, or
//! with one after `+-`.
use std::ops::Range;
use std::path::PathBuf;

/// The text of a page, by its path below the repository.
pub(crate) fn page(path: &str) -> String {
    std::fs::read_to_string(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// A name, and where in the page the numbers of its paragraph before it are.
pub(crate) struct Mark {
    pub(crate) name: String,
    pub(crate) numbers: Vec<Range<usize>>,
}

/// All marks of a page.
pub(crate) fn marks(text: &str) -> Vec<Mark> {
    const BEGIN: &str = "<!-- = ";
    const END: &str = " -->";
    let (mut marks, mut from) = (vec![], 0);
    while let Some(at) = text[from..].find(BEGIN) {
        let at = from + at;
        let end = at + text[at..].find(END).unwrap();
        let paragraph = text[..at].rfind("\n\n").unwrap_or(0);
        marks.push(Mark {
            name: text[at + BEGIN.len()..end].to_owned(),
            numbers: numbers_in(text, paragraph.max(from)..at),
        });
        from = end + END.len();
    }
    marks
}

/// Where numbers stand in a range of a text, with their sign, exponent and bracket.
fn numbers_in(text: &str, range: Range<usize>) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let digit = |i: usize| i < range.end && bytes[i].is_ascii_digit();
    let (mut found, mut i) = (vec![], range.start);
    while i < range.end {
        let before = i.checked_sub(1).map_or(b' ', |i| bytes[i]);
        let joined = before.is_ascii_alphanumeric() || b"._^".contains(&before);
        if joined || !(digit(i) || bytes[i] == b'.' && digit(i + 1)) {
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

/// The last `N` numbers before a name in a page.
pub(crate) fn numbers<const N: usize>(path: &str, name: &str) -> [f64; N] {
    let text = page(path);
    let mark = marks(&text).into_iter().find(|mark| mark.name == name);
    let mark = mark.unwrap_or_else(|| panic!("{path} has no <!-- = {name} -->"));
    let first = mark.numbers.len().checked_sub(N);
    let first = first.unwrap_or_else(|| panic!("{path}: less than {N} numbers before {name}"));
    std::array::from_fn(|i| number(&text[mark.numbers[first + i].clone()]))
}

/// What a number as written is, without its bracket.
pub(crate) fn number(text: &str) -> f64 {
    let plain = text.split('(').next().unwrap();
    plain
        .parse()
        .unwrap_or_else(|_| panic!("no number: {text}"))
}

/// A value as a page writes it: like `written`.
pub(crate) fn like(written: &str, value: f64, se: f64) -> String {
    assert!(
        !written.contains(','),
        "{written}: thousands are not compared"
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

/// Asserts that the page's numbers are those found, rounded as it rounds.
pub(crate) fn assert_says<const N: usize>(path: &str, name: &str, found: [f64; N]) {
    let text = page(path);
    let said = numbers::<N>(path, name);
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
            "{path}, {name}: {said:?}, found {found:?}"
        );
    }
}

/// So many decimals, no 0 before the point.
pub(crate) fn fixed(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.split_once('.') {
        Some(("0", rest)) => format!(".{rest}"),
        Some(("-0", rest)) => format!("-.{rest}"),
        _ => text,
    }
}

/// The standard error of the last digits in brackets: two if it begins with 1, else one.
pub(crate) fn bracketed(value: f64, se: f64) -> String {
    assert!(se > 0.0 && se < 1e3, "a standard error of {se}");
    let first = se.log10().floor();
    let digits = if se / 10_f64.powf(first) < 2.0 {
        1.0
    } else {
        0.0
    };
    let decimals = (digits - first).max(0.0);
    let error = (se * 10_f64.powf(decimals)).round();
    format!("{}({error})", fixed(value, decimals as usize))
}

#[test]
fn numbers_are_found_and_written_as_they_were() {
    let text = "300-750 um, p95 of 10^7: -2.5 % and .0401(5)<!-- = a --> (.078 +- .003<!-- = b -->";
    let marks = marks(text);
    let found: Vec<_> = marks[0].numbers.iter().map(|r| &text[r.clone()]).collect();
    assert_eq!(found, ["300", "750", "10", "-2.5", ".0401(5)"]);
    let found: Vec<_> = marks[1].numbers.iter().map(|r| &text[r.clone()]).collect();
    assert_eq!((marks[1].name.as_str(), found), ("b", vec![".078", ".003"]));
    for (written, value, se, like_it) in [
        ("1.15", 1.146, 0.0, "1.15"),
        (".30", 0.25, 0.0, ".25"),
        ("0.3", 0.25, 0.0, "0.2"),
        ("-2.5", -3.04, 0.0, "-3.0"),
        ("3e-4", 2.61e-4, 0.0, "3e-4"),
        (".04(1)", 0.040_12, 5.2e-4, ".0401(5)"),
        ("7", 8.4, 0.0, "8"),
    ] {
        assert_eq!(like(written, value, se), like_it);
    }
}
