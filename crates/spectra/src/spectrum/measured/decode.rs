//! Decodes the bytes of a file to text.
use std::borrow::Cow;

use super::error::ReadProblem;
use super::report::Encoding;

/// Decodes `bytes` and removes a byte order mark. UTF-16 is recognised by its mark, or by a
/// zero in every other byte of an ASCII line. Bytes that are neither UTF-16 nor UTF-8 are
/// taken as Latin-1, in which some instruments write the micro sign.
///
/// # Errors
/// [`ReadProblem::NoText`] if the text has control characters, as binary files do.
pub(super) fn decode(bytes: &[u8]) -> Result<(Cow<'_, str>, Encoding), ReadProblem> {
    let (text, encoding) = match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8_or_latin1(rest),
        [0xff, 0xfe, rest @ ..] => (utf16(rest, u16::from_le_bytes), Encoding::Utf16Le),
        [0xfe, 0xff, rest @ ..] => (utf16(rest, u16::from_be_bytes), Encoding::Utf16Be),
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => {
            (utf16(bytes, u16::from_le_bytes), Encoding::Utf16Le)
        }
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => {
            (utf16(bytes, u16::from_be_bytes), Encoding::Utf16Be)
        }
        _ => utf8_or_latin1(bytes),
    };
    // Binary files have control characters in their first lines; text does not.
    let is_binary =
        |c: &char| c.is_control() && !matches!(c, '\t' | '\n' | '\r' | '\u{c}' | '\u{1a}');
    match text.chars().find(is_binary) {
        Some(c) => Err(ReadProblem::NoText(u32::from(c))),
        None => Ok((text, encoding)),
    }
}

fn utf8_or_latin1(bytes: &[u8]) -> (Cow<'_, str>, Encoding) {
    match std::str::from_utf8(bytes) {
        Ok(text) => (text.into(), Encoding::Utf8),
        Err(_) => {
            let text: String = bytes.iter().map(|byte| char::from(*byte)).collect();
            (text.into(), Encoding::Latin1)
        }
    }
}

fn utf16<'a>(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Cow<'a, str> {
    let (pairs, _) = bytes.as_chunks::<2>();
    let units = pairs.iter().map(|pair| unit(*pair));
    let characters = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    characters.collect::<String>().into()
}

/// The lines of `text`; a line may end in LF, CR LF or CR.
pub(super) fn lines(text: &str) -> Vec<&str> {
    let mut lines = Vec::new();
    let mut rest = text;
    while let Some(end) = rest.find(['\n', '\r']) {
        lines.push(&rest[..end]);
        let width = if rest[end..].starts_with("\r\n") {
            2
        } else {
            1
        };
        rest = &rest[end + width..];
    }
    lines.push(rest);
    lines
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_recognised() {
        let text = "Wavelength (\u{b5}m)\r\n0.4,1";
        let wide = |to_bytes: fn(u16) -> [u8; 2]| {
            text.encode_utf16().flat_map(to_bytes).collect::<Vec<u8>>()
        };
        let mut cases = vec![
            (text.as_bytes().to_vec(), Encoding::Utf8),
            ([b"\xef\xbb\xbf", text.as_bytes()].concat(), Encoding::Utf8),
            (text.chars().map(|c| c as u8).collect(), Encoding::Latin1),
        ];
        for (to_bytes, mark, encoding) in [
            (
                u16::to_le_bytes as fn(u16) -> [u8; 2],
                b"\xff\xfe",
                Encoding::Utf16Le,
            ),
            (u16::to_be_bytes, b"\xfe\xff", Encoding::Utf16Be),
        ] {
            cases.push((wide(to_bytes), encoding));
            cases.push(([&mark[..], &wide(to_bytes)].concat(), encoding));
        }
        for (bytes, encoding) in cases {
            let (decoded, detected) = decode(&bytes).unwrap();
            assert_eq!((decoded.as_ref(), detected), (text, encoding));
        }
        assert_eq!(decode(b"PK\x03\x04").unwrap_err(), ReadProblem::NoText(3));
    }

    #[test]
    fn lines_end_in_three_ways() {
        assert_eq!(lines("a\r\nb\rc\n\nd"), ["a", "b", "c", "", "d"]);
    }
}
