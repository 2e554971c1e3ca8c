//! Finds the table in a text: its separator, header and rows.
use super::error::{ReadProblem, quoted};

/// The separator between the cells of a row. Whether a comma is a decimal sign is decided
/// per cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Tab,
    Semicolon,
    Comma,
    Bar,
    Spaces,
}

/// The content of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CellValue {
    Number {
        value: f64,
        /// The decimal sign, if there is one.
        decimal: Option<char>,
        /// Whether a percent sign follows.
        percent: bool,
    },
    /// No measurement.
    Missing,
    Text,
}

/// Texts that libraries and programs write for a missing measurement.
const MISSING: [&str; 16] = [
    "", "nan", "na", "n/a", "#n/a", "null", "none", "missing", "-", "--", ".", "*", "#div/0!",
    "#value!", "#num!", "-1.#ind",
];
/// Numbers that stand for a missing measurement.
const FILLS: [f64; 5] = [-99.0, -999.0, -9999.0, -99_999.0, -32_768.0];
/// Magnitude from which a number stands for a missing measurement; USGS libraries write
/// -1.23e34.
const HUGE: f64 = 1e30;

impl CellValue {
    pub(super) fn parse(text: &str) -> Self {
        let (number, percent) = match text.strip_suffix('%') {
            Some(number) => (number.trim_end(), true),
            None => (text, false),
        };
        let commas = number.matches(',').count();
        let decimal = match number.contains('.') {
            true => Some('.'),
            false if commas == 1 && !number.ends_with(',') => Some(','),
            false => None,
        };
        let parsed = match decimal {
            Some(',') => number.replace(',', ".").parse::<f64>(),
            _ => number.parse::<f64>(),
        };
        match parsed {
            Ok(value) if !value.is_finite() || value.abs() >= HUGE || FILLS.contains(&value) => {
                Self::Missing
            }
            Ok(value) => Self::Number {
                value,
                decimal,
                percent,
            },
            Err(_) if MISSING.iter().any(|word| word.eq_ignore_ascii_case(text)) => Self::Missing,
            Err(_) => Self::Text,
        }
    }

    pub(super) fn is_number(self) -> bool {
        matches!(self, Self::Number { .. })
    }
}

impl Separator {
    /// All separators, the less ambiguous ones first.
    const ALL: [Self; 5] = [
        Self::Tab,
        Self::Semicolon,
        Self::Comma,
        Self::Bar,
        Self::Spaces,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Tab => "tabs",
            Self::Semicolon => "semicolons",
            Self::Comma => "commas",
            Self::Bar => "bars",
            Self::Spaces => "spaces",
        }
    }

    /// The cells of a line, without surrounding quotes.
    pub(super) fn cells(self, line: &str) -> Vec<&str> {
        let separator = match self {
            Self::Tab => '\t',
            Self::Semicolon => ';',
            Self::Comma => ',',
            Self::Bar => '|',
            Self::Spaces => {
                let cells = line.split_whitespace();
                return cells.map(|cell| cell.trim_matches('"')).collect();
            }
        };
        let mut in_quotes = false;
        let cells = line.split(|c| {
            in_quotes ^= c == '"';
            c == separator && !in_quotes
        });
        cells
            .map(|cell| cell.trim().trim_matches('"').trim())
            .collect()
    }
}

/// The layout of the table in a text.
#[derive(Debug)]
pub(super) struct TextLayout {
    pub(super) separator: Separator,
    /// Line number of the header, from 1, and its names.
    pub(super) header: Option<(usize, Vec<String>)>,
    /// Index of the line of the first row.
    pub(super) first: usize,
    /// For each column, the fraction of the rows whose cell is a number or missing.
    pub(super) numeric: Vec<f64>,
}

/// Whether a line is ignored: blank, a comment or an end-of-file mark.
pub(super) fn skipped(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#') || line == "\u{1a}"
}

/// Finds the table in `lines`.
///
/// # Errors
/// [`ReadProblem::NoTable`] if no line has a wavelength and a value.
pub(super) fn layout(lines: &[&str]) -> Result<TextLayout, ReadProblem> {
    let separator = separator(lines).ok_or_else(|| {
        let first = lines.iter().find(|line| !line.trim().is_empty());
        ReadProblem::NoTable(quoted(first.copied().unwrap_or_default()))
    })?;
    // Text columns before the first column of numbers hold sample names.
    let kinds = Kinds::of(lines, separator);
    let lead = kinds
        .numbers()
        .position(|share| share > 0.5)
        .unwrap_or_default();
    let is_row = |line: &str| {
        let cells = separator.cells(line);
        cells.len() >= 2
            && cells
                .get(lead)
                .is_some_and(|cell| CellValue::parse(cell).is_number())
    };
    let relevant: Vec<usize> = (0..lines.len()).filter(|i| !skipped(lines[*i])).collect();
    let starts = |n: usize| {
        is_row(lines[relevant[n]]) && relevant.get(n + 1).is_none_or(|next| is_row(lines[*next]))
    };
    let start = (0..relevant.len()).find(|n| starts(*n));
    // Otherwise a single row among text.
    let start = start.or_else(|| (0..relevant.len()).find(|n| is_row(lines[relevant[*n]])));
    let first = start.map(|n| relevant[n]).unwrap_or_default();
    let plain = start.and_then(|n| n.checked_sub(1)).map(|n| relevant[n]);
    let body = Kinds::of(&lines[first..], separator);
    Ok(TextLayout {
        separator,
        header: header(lines, separator, first, plain),
        first,
        numeric: body.numeric().collect(),
    })
}

/// What the cells of each column are, of the rows that have a number. Rows are counted, not kept.
#[derive(Debug, Default)]
struct Kinds {
    rows: usize,
    /// Per column, the rows whose cell is a number, and those whose cell is a number or missing.
    counts: Vec<[usize; 2]>,
}

impl Kinds {
    fn of(lines: &[&str], separator: Separator) -> Self {
        let mut kinds = Self::default();
        for line in lines.iter().filter(|line| !skipped(line)) {
            let cells = separator.cells(line).into_iter();
            let cells: Vec<CellValue> = cells.map(CellValue::parse).collect();
            if numbers(&cells) == 0 || cells.len() < 2 {
                continue;
            }
            kinds.rows += 1;
            kinds
                .counts
                .resize(kinds.counts.len().max(cells.len()), [0; 2]);
            for ([number, known], cell) in kinds.counts.iter_mut().zip(&cells) {
                *number += usize::from(cell.is_number());
                *known += usize::from(*cell != CellValue::Text);
            }
        }
        kinds
    }

    /// Per column, the fraction of the rows whose cell is a number.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let share = |[number, _]: &[usize; 2]| *number as f64 / self.rows as f64;
        self.counts.iter().map(share)
    }

    /// Per column, the fraction of the rows whose cell is a number or missing.
    fn numeric(&self) -> impl Iterator<Item = f64> {
        let share = |[_, known]: &[usize; 2]| *known as f64 / self.rows as f64;
        self.counts.iter().map(share)
    }
}

fn numbers(cells: &[CellValue]) -> usize {
    cells.iter().filter(|cell| cell.is_number()).count()
}

/// The separator that splits most lines into rows of numbers. Rows of numbers only count
/// more than rows that also have text.
fn separator(lines: &[&str]) -> Option<Separator> {
    let mut best = (0, None);
    for separator in Separator::ALL {
        let score = lines.iter().filter(|line| !skipped(line)).map(|line| {
            let cells: Vec<CellValue> = separator
                .cells(line)
                .into_iter()
                .map(CellValue::parse)
                .collect();
            match numbers(&cells) {
                0 => 0,
                _ if cells.len() < 2 => 0,
                _ if !cells.contains(&CellValue::Text) => 3,
                1 => 0,
                _ => 1,
            }
        });
        let score: usize = score.sum();
        if score > best.0 {
            best = (score, Some(separator));
        }
    }
    best.1
}

/// The column names above the row `first`: from line `plain`, else from a comment.
fn header(
    lines: &[&str],
    separator: Separator,
    first: usize,
    plain: Option<usize>,
) -> Option<(usize, Vec<String>)> {
    let width = separator.cells(lines[first]).len();
    let names = |text: &str| -> Vec<String> {
        let cells = separator.cells(text).into_iter();
        cells.map(str::to_owned).collect()
    };
    if let Some(i) = plain {
        let cells = names(lines[i]);
        let key = match separator {
            Separator::Spaces => lines[i],
            _ => cells.first().map_or("", String::as_str),
        };
        // `Owner: somebody` and `factors= 1, 1` are not column names.
        if cells.len() < 2 || key.contains([':', '=']) {
            return None;
        }
        return match separator {
            Separator::Spaces => aligned(cells, width).map(|cells| (i + 1, cells)),
            _ => Some((i + 1, cells)),
        };
    }
    let i = (0..first).rev().find(|i| lines[*i].starts_with('#'))?;
    let cells = names(lines[i].trim_start_matches('#'));
    let has_wavelength = cells.iter().any(|name| super::columns::is_wavelength(name));
    (cells.len() == width && has_wavelength).then_some((i + 1, cells))
}

/// Names separated by spaces, one for each of `width` columns. A word such as `(nm)` belongs
/// to the word before it. Tables written by R may lack the name of the first column.
fn aligned(words: Vec<String>, width: usize) -> Option<Vec<String>> {
    let mut names: Vec<String> = Vec::new();
    for word in words {
        match names.last_mut() {
            Some(last) if word.starts_with(['(', '[']) => *last += &format!(" {word}"),
            _ => names.push(word),
        }
    }
    if names.len() + 1 == width {
        names.insert(0, String::new());
    }
    (names.len() == width).then_some(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_parsed() {
        let number = |text: &str| match CellValue::parse(text) {
            CellValue::Number { value, .. } => Some(value),
            _ => None,
        };
        for (text, value) in [
            ("350", 350.0),
            ("350,5", 350.5),
            (" 7e-1".trim(), 0.7),
            ("+.5", 0.5),
            ("97,4 %", 97.4),
            ("-1", -1.0),
        ] {
            assert_eq!(number(text), Some(value), "{text}");
        }
        for text in ["", "NaN", "-999", "-1.23e34", "N/A", "inf", "#DIV/0!"] {
            assert_eq!(CellValue::parse(text), CellValue::Missing, "{text}");
        }
        for text in ["1,2,3", "350,", "1.0,5", "snow", "0x1"] {
            assert_eq!(CellValue::parse(text), CellValue::Text, "{text}");
        }
    }

    #[test]
    fn separators_are_found() {
        for (row, separator) in [
            ("350,0.9", Separator::Comma),
            ("350;0,9;0,8", Separator::Semicolon),
            ("350,5\t0,9", Separator::Tab),
            (" 350.0   0.9", Separator::Spaces),
            ("350 , 0.9", Separator::Comma),
            ("350|0.9", Separator::Bar),
            ("\"350,0\",\"0,9\"", Separator::Comma),
            ("350,0 0,9", Separator::Spaces),
            ("S1;350;0,9", Separator::Semicolon),
        ] {
            assert_eq!(super::separator(&[row, row]), Some(separator), "{row}");
        }
        assert_eq!(super::separator(&["a", "350", "snow, 1"]), None);
    }
}
