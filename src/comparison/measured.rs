//! A measured spectrum: its file, and its values at other wavelengths.
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::error::{MeasuredError, Problem};
use super::exclusion::{Exclusion, excluded};
use crate::measurement::Quantity;

/// Longest file read, bytes: several hundred thousand rows.
pub(super) const MAX_BYTES: u64 = 1 << 24;
/// Wavelengths that are used, nm, both included: those of the model.
pub const RANGE_NM: (f64, f64) = (350.0, 2500.0);
/// Values allowed. Noise takes dark snow below 0; a white reference in other light
/// or at another angle than the snow takes bright snow above 1. What is further off
/// is no share of the light, but percents or another quantity.
pub(super) const VALUES: (f64, f64) = (-0.05, 1.2);
/// Rows further apart than this, nm, have no values between them: absorption bands
/// of ice are some 100 nm wide.
pub(super) const MAX_GAP_NM: f64 = 30.0;
/// Longest text of the file quoted in a message, characters.
const MAX_QUOTED: usize = 60;

/// One row of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    nm: f64,
    value: f64,
    uncertainty: Option<f64>,
}

/// A measured value at one of the wavelengths of a simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// Number of the wavelength in the list of the simulation.
    pub index: usize,
    /// The wavelength, nm.
    pub nm: f64,
    /// Reflectance or transmittance.
    pub value: f64,
    /// Its standard uncertainty, if the file states it.
    pub uncertainty: Option<f64>,
    /// Whether it does not count.
    pub excluded: bool,
}

/// A measured spectrum and what of it counts.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredSpectrum {
    file: String,
    quantity: Quantity,
    exclusions: Vec<Exclusion>,
    /// By wavelength; at least one.
    rows: Vec<Row>,
    ignored: usize,
}

impl MeasuredSpectrum {
    /// Reads a CSV file (docs/formats.md). `quantity` is what a column `value`
    /// holds. In `exclusions`, where spectrometers often see nothing but noise, any
    /// finite value is taken.
    ///
    /// # Errors
    /// See [`Problem`].
    pub fn read(
        path: &Path,
        quantity: Option<Quantity>,
        exclusions: &[Exclusion],
    ) -> Result<Self, MeasuredError> {
        let file = path.display().to_string();
        let mut bytes = Vec::new();
        File::open(path)
            .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
            .map_err(|error| refuse(&file, None, Problem::Read(error.to_string())))?;
        Self::parse(&file, &bytes, quantity, exclusions)
    }

    /// The same from the content of a file; `file` is its name in messages.
    ///
    /// # Errors
    /// See [`Problem`].
    pub fn parse(
        file: &str,
        bytes: &[u8],
        quantity: Option<Quantity>,
        exclusions: &[Exclusion],
    ) -> Result<Self, MeasuredError> {
        if bytes.len() as u64 > MAX_BYTES {
            return Err(refuse(file, None, Problem::Length));
        }
        let text = std::str::from_utf8(bytes).map_err(|_| refuse(file, None, Problem::Encoding))?;
        // What spreadsheets write before UTF-8.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let told = |line: &(usize, &str)| !line.1.trim().is_empty() && !line.1.starts_with('#');
        let mut lines = (1..).zip(text.lines()).filter(told);
        let Some((line, names)) = lines.next() else {
            return Err(refuse(file, None, Problem::Header(String::new())));
        };
        let (quantity, columns) =
            header(names, quantity).map_err(|problem| refuse(file, Some(line), problem))?;
        let (mut rows, mut ignored, mut last_nm) = (Vec::new(), 0, f64::NEG_INFINITY);
        for (line, text) in lines {
            let row = row(text, columns, last_nm, exclusions)
                .map_err(|problem| refuse(file, Some(line), problem))?;
            last_nm = row.nm;
            match used(row.nm) {
                true => rows.push(row),
                false => ignored += 1,
            }
        }
        if rows.is_empty() {
            return Err(refuse(file, None, Problem::Empty { rows: ignored }));
        }
        Ok(Self {
            file: file.to_owned(),
            quantity,
            exclusions: exclusions.to_vec(),
            rows,
            ignored,
        })
    }

    /// The file as it was named by the caller.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// What was measured.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// The bands that do not count.
    #[must_use]
    pub fn exclusions(&self) -> &[Exclusion] {
        &self.exclusions
    }

    /// Rows within [`RANGE_NM`].
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Rows outside it, which are not used.
    #[must_use]
    pub fn ignored(&self) -> usize {
        self.ignored
    }

    /// The values at those of `wavelengths_nm` (increasing) that lie on a row, or
    /// between two rows at most 30 nm apart: linearly interpolated. Where
    /// wavelengths count, only rows that count are used.
    ///
    /// # Errors
    /// [`Problem::Overlap`] if fewer than 2 that count remain.
    pub fn at(&self, wavelengths_nm: &[f64]) -> Result<Vec<Matched>, MeasuredError> {
        let out = |row: &&Row| !excluded(&self.exclusions, row.nm);
        let counted: Vec<Row> = self.rows.iter().filter(out).copied().collect();
        let matched = |(index, &nm): (usize, &f64)| {
            let excluded = excluded(&self.exclusions, nm);
            let row = interpolated(if excluded { &self.rows } else { &counted }, nm)?;
            Some(Matched {
                index,
                nm,
                value: row.value,
                uncertainty: row.uncertainty,
                excluded,
            })
        };
        let all: Vec<Matched> = wavelengths_nm
            .iter()
            .enumerate()
            .filter_map(matched)
            .collect();
        let common = all.iter().filter(|matched| !matched.excluded).count();
        if common >= 2 {
            return Ok(all);
        }
        let ends = |first: Option<f64>, last: Option<f64>| {
            (first.unwrap_or(f64::NAN), last.unwrap_or(f64::NAN))
        };
        let nm = |row: &Row| row.nm;
        let overlap = Problem::Overlap {
            common,
            sample_nm: ends(
                wavelengths_nm.first().copied(),
                wavelengths_nm.last().copied(),
            ),
            file_nm: ends(self.rows.first().map(nm), self.rows.last().map(nm)),
            excluded: listed(&self.exclusions),
        };
        Err(refuse(&self.file, None, overlap))
    }
}

/// `exclusions` as text: `1750-2000, 2350-2500`, or `none`.
pub(crate) fn listed(exclusions: &[Exclusion]) -> String {
    let texts: Vec<_> = exclusions.iter().map(ToString::to_string).collect();
    match texts.is_empty() {
        true => "none".to_owned(),
        false => texts.join(", "),
    }
}

fn refuse(file: &str, line: Option<usize>, problem: Problem) -> MeasuredError {
    let file = file.to_owned();
    MeasuredError {
        file,
        line,
        problem,
    }
}

fn used(nm: f64) -> bool {
    (RANGE_NM.0..=RANGE_NM.1).contains(&nm)
}

/// The cells of a line. Some programs put names in quotes.
fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split(',').map(|cell| cell.trim().trim_matches('"'))
}

fn quoted(text: &str) -> String {
    text.chars()
        .take(MAX_QUOTED)
        .flat_map(char::escape_debug)
        .collect()
}

/// What the header says was measured, and the number of columns.
fn header(line: &str, asked: Option<Quantity>) -> Result<(Quantity, usize), Problem> {
    let names: Vec<&str> = cells(line).take(4).collect();
    let name = match names[..] {
        ["wavelength_nm", name] | ["wavelength_nm", name, "uncertainty"] => name,
        _ => return Err(Problem::Header(quoted(line))),
    };
    let found = Quantity::ALL
        .into_iter()
        .find(|quantity| quantity.name() == name);
    let quantity = match (found, asked) {
        (Some(found), Some(asked)) if found != asked => {
            let (found, asked) = (found.name(), asked.name());
            return Err(Problem::OtherQuantity { found, asked });
        }
        (Some(found), _) => found,
        (None, _) if name != "value" => return Err(Problem::Header(quoted(line))),
        (None, asked) => asked.ok_or(Problem::Unnamed)?,
    };
    Ok((quantity, names.len()))
}

fn row(line: &str, columns: usize, last_nm: f64, exclusions: &[Exclusion]) -> Result<Row, Problem> {
    let number = |cell: &str| match cell.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(Problem::Number(quoted(cell))),
    };
    let cells: Vec<&str> = cells(line).collect();
    let (nm, value, rest) = match cells[..] {
        [nm, value, ref rest @ ..] if cells.len() == columns => (nm, value, rest),
        _ => {
            let (found, expected) = (cells.len(), columns);
            return Err(Problem::Columns { found, expected });
        }
    };
    let (nm, value) = (number(nm)?, number(value)?);
    let uncertainty = rest.first().map(|cell| number(cell)).transpose()?;
    if nm <= last_nm {
        return Err(Problem::Order(nm));
    }
    if used(nm) && !excluded(exclusions, nm) {
        if !(VALUES.0..=VALUES.1).contains(&value) {
            return Err(Problem::Value(value));
        }
        if let Some(wrong) = uncertainty.filter(|u| !(0.0..=1.0).contains(u)) {
            return Err(Problem::Uncertainty(wrong));
        }
    }
    Ok(Row {
        nm,
        value,
        uncertainty,
    })
}

/// What `rows` say of a wavelength; `None` beyond them and in wide gaps.
fn interpolated(rows: &[Row], nm: f64) -> Option<Row> {
    let above = rows.partition_point(|row| row.nm < nm);
    let b = rows.get(above)?;
    if b.nm == nm {
        return Some(*b);
    }
    let a = rows.get(above.checked_sub(1)?)?;
    if b.nm - a.nm > MAX_GAP_NM {
        return None;
    }
    let t = (nm - a.nm) / (b.nm - a.nm);
    // Rounding neither overshoots nor overflows.
    let mix = |a: f64, b: f64| (a * (1.0 - t) + b * t).clamp(a.min(b), a.max(b));
    Some(Row {
        nm,
        value: mix(a.value, b.value),
        // Not less than at the rows: neighbours mostly err alike.
        uncertainty: a.uncertainty.zip(b.uncertainty).map(|(a, b)| mix(a, b)),
    })
}
