//! Where the table of a text is: its separator, its header, its rows.
use super::error::{Problem, quoted};

/// What stands between the cells of a row. Decimal points and commas are told apart
/// cell by cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Tab,
    Semicolon,
    Comma,
    Bar,
    Spaces,
}

/// What a cell holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell {
    Number {
        value: f64,
        /// The decimal sign, where it has one.
        decimal: Option<char>,
        /// Whether a percent sign follows.
        percent: bool,
    },
    /// No measurement.
    Missing,
    Text,
}

/// Written by libraries and programs where there is no measurement.
const MISSING: [&str; 16] = [
    "", "nan", "na", "n/a", "#n/a", "null", "none", "missing", "-", "--", ".", "*", "#div/0!",
    "#value!", "#num!", "-1.#ind",
];
/// The same as numbers; USGS libraries write -1.23e34.
const FILLS: [f64; 5] = [-99.0, -999.0, -9999.0, -99_999.0, -32_768.0];
const HUGE: f64 = 1e30;

impl Cell {
    pub(super) fn of(text: &str) -> Self {
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
    /// All, the surer ones first.
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

    /// The cells of a line, without the quotes that some programs put around them.
    pub(super) fn cells(self, line: &str) -> Vec<&str> {
        let by = match self {
            Self::Tab => '\t',
            Self::Semicolon => ';',
            Self::Comma => ',',
            Self::Bar => '|',
            Self::Spaces => {
                let cells = line.split_whitespace();
                return cells.map(|cell| cell.trim_matches('"')).collect();
            }
        };
        let mut within = false;
        let cells = line.split(|c| {
            within ^= c == '"';
            c == by && !within
        });
        cells
            .map(|cell| cell.trim().trim_matches('"').trim())
            .collect()
    }
}

/// The table of a text.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) separator: Separator,
    /// Number of the line of the header, from 1, and its names.
    pub(super) header: Option<(usize, Vec<String>)>,
    /// Index of the line of the first row.
    pub(super) first: usize,
    /// Share of the rows with a number or nothing there, by column.
    pub(super) numeric: Vec<f64>,
}

/// Whether a line counts for nothing.
pub(super) fn skipped(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#') || line == "\u{1a}"
}

/// Finds the table in `lines`.
///
/// # Errors
/// [`Problem::NoTable`].
pub(super) fn layout(lines: &[&str]) -> Result<Layout, Problem> {
    let separator = separator(lines).ok_or_else(|| {
        let first = lines.iter().find(|line| !line.trim().is_empty());
        Problem::NoTable(quoted(first.copied().unwrap_or_default()))
    })?;
    let rows = |lines: &[&str]| -> Vec<Vec<Cell>> {
        let lines = lines.iter().filter(|line| !skipped(line));
        lines
            .map(|line| separator.cells(line).into_iter().map(Cell::of).collect())
            .filter(|cells: &Vec<Cell>| numbers(cells) >= 1 && cells.len() >= 2)
            .collect()
    };
    // Text before the first column of numbers names samples.
    let all = rows(lines);
    let lead = (0..width(&all)).find(|c| share(&all, *c, Cell::is_number) > 0.5);
    let lead = lead.unwrap_or_default();
    let is_row = |line: &str| {
        let cells = separator.cells(line);
        cells.len() >= 2
            && cells
                .get(lead)
                .is_some_and(|cell| Cell::of(cell).is_number())
    };
    let told: Vec<usize> = (0..lines.len()).filter(|i| !skipped(lines[*i])).collect();
    let starts = |n: usize| {
        is_row(lines[told[n]]) && told.get(n + 1).is_none_or(|next| is_row(lines[*next]))
    };
    let start = (0..told.len()).find(|n| starts(*n));
    // A lone row among text.
    let start = start.or_else(|| (0..told.len()).find(|n| is_row(lines[told[*n]])));
    let first = start.map(|n| told[n]).unwrap_or_default();
    let plain = start.and_then(|n| n.checked_sub(1)).map(|n| told[n]);
    let body = rows(&lines[first..]);
    let numeric = (0..width(&body)).map(|c| share(&body, c, |cell| cell != Cell::Text));
    Ok(Layout {
        separator,
        header: header(lines, separator, first, plain),
        first,
        numeric: numeric.collect(),
    })
}

fn width(rows: &[Vec<Cell>]) -> usize {
    rows.iter().map(Vec::len).max().unwrap_or_default()
}

/// Share of the rows whose cell in a column is such.
fn share(rows: &[Vec<Cell>], column: usize, held: fn(Cell) -> bool) -> f64 {
    let cells = rows.iter().filter_map(|row| row.get(column));
    cells.filter(|cell| held(**cell)).count() as f64 / rows.len() as f64
}

fn numbers(cells: &[Cell]) -> usize {
    cells.iter().filter(|cell| cell.is_number()).count()
}

/// The separator that makes most lines rows: those of numbers alone count most.
fn separator(lines: &[&str]) -> Option<Separator> {
    let mut best = (0, None);
    for separator in Separator::ALL {
        let score = lines.iter().filter(|line| !skipped(line)).map(|line| {
            let cells: Vec<Cell> = separator.cells(line).into_iter().map(Cell::of).collect();
            match numbers(&cells) {
                0 => 0,
                _ if cells.len() < 2 => 0,
                _ if !cells.contains(&Cell::Text) => 3,
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

/// The names above the row `first`: of the line `plain`, or in a comment.
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
        // `Owner: somebody` and `factors= 1, 1` are no names of columns.
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

/// Names that spaces separate, one for each of `width` columns: `(nm)` belongs to the
/// word before it, and rows of R begin with a name or number that the header has not.
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
    fn cells_are_numbers_in_many_ways() {
        let number = |text: &str| match Cell::of(text) {
            Cell::Number { value, .. } => Some(value),
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
            assert_eq!(Cell::of(text), Cell::Missing, "{text}");
        }
        for text in ["1,2,3", "350,", "1.0,5", "snow", "0x1"] {
            assert_eq!(Cell::of(text), Cell::Text, "{text}");
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
