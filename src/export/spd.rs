//! SPD: a spectrum in the format of pbrt-v4 and Mitsuba 3.
use std::fmt::Write;

/// Wavelengths that both renderers sample: first and last, nm.
pub const RANGE_NM: [f64; 2] = [360.0, 830.0];

/// A spectrum as lines `wavelength value` after `comments`, each on a line that begins with #;
/// both renderers skip comment lines.
///
/// pbrt reads numbers of fewer than 32 characters, so values below 1e-4 are written with a power
/// of ten, which both renderers read. pbrt also ignores a number at the end of the file, so the
/// last line ends with a newline.
///
/// Both renderers take a spectrum as zero outside its wavelengths. If the wavelengths do not
/// cover [`RANGE_NM`], the first or last value is therefore repeated at the end of this range.
#[must_use]
pub fn spd(comments: &[String], wavelengths_nm: &[f64], values: &[f32]) -> String {
    let mut text = String::new();
    for comment in comments {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# {}", comment.replace(['\n', '\r'], " "));
    }
    let [first, last] = RANGE_NM;
    let pairs = wavelengths_nm.iter().copied().zip(values.iter().copied());
    let before = pairs.clone().next().filter(|(nm, _)| *nm > first);
    let after = pairs.clone().next_back().filter(|(nm, _)| *nm < last);
    let before = before.map(|(_, value)| (first, value));
    let after = after.map(|(_, value)| (last, value));
    for (nm, value) in before.into_iter().chain(pairs).chain(after) {
        let _ = match value {
            0.0 | 1e-4.. => writeln!(text, "{nm} {value}"),
            _ => writeln!(text, "{nm} {value:e}"),
        };
    }
    text
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn pairs_read_back_and_are_short() {
        let values = [
            0.0,
            1.0,
            0.365_475_42,
            1e-4,
            9.999e-5,
            1e-30,
            f32::MIN_POSITIVE,
            -0.25,
        ];
        let nm: Vec<f64> = (0..8).map(|i| 350.5 + 70.0 * f64::from(i)).collect();
        let text = spd(&["two\nlines".into(), "49° µm".into()], &nm, &values);
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("# two lines"));
        assert_eq!(lines.next(), Some("# 49° µm"));
        for (line, (nm, value)) in lines.clone().zip(nm.iter().zip(&values)) {
            let (first, second) = line.split_once(' ').unwrap();
            assert_eq!(first.parse(), Ok(*nm));
            assert_eq!(second.parse(), Ok(*value));
            assert!(first.len() < 32 && second.len() < 32, "{line}");
        }
        assert_eq!(lines.count(), 8);
        assert!(text.ends_with('\n'));
    }

    #[test]
    fn ends_are_held() {
        let lines = |nm: &[f64], values: &[f32]| -> Vec<String> {
            spd(&[], nm, values).lines().map(str::to_owned).collect()
        };
        assert_eq!(
            lines(&[400.0, 700.0], &[0.25, 0.5]),
            ["360 0.25", "400 0.25", "700 0.5", "830 0.5"]
        );
        assert_eq!(
            lines(&[550.0], &[0.25]),
            ["360 0.25", "550 0.25", "830 0.25"]
        );
        let wide = ["360 0.25", "830 0.5"];
        assert_eq!(lines(&[360.0, 830.0], &[0.25, 0.5]), wide);
    }
}
