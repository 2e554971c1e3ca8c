//! A user's illuminant: a table of its relative power.
//!
//! The table is a file, read as measured spectra are (docs/formats.md, "Illuminants
//! from files"), or its numbers. Two tables are the same light if their numbers are the
//! same where the observer sees, whatever their names. A table serves wavelengths if it
//! reaches over those of them within 380-780 nm, where all built-in tables have values.
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::{Illuminant, observer};
use crate::spectrum::Table;
use crate::spectrum::measured::{self, Content, Curve, Report, Request, SpectrumError};

/// Wavelengths that a table must reach over where spectra have them, nm.
const NEEDED_NM: (f64, f64) = (380.0, 780.0);
/// Rows of a file that are looked at, nm: the observer's wavelengths and neighbours.
const READ_NM: (f64, f64) = (200.0, 1000.0);

/// Relative power over wavelength.
#[derive(Debug, Clone)]
pub struct PowerTable {
    name: String,
    table: Table,
}

/// By content: the name does not count.
impl PartialEq for PowerTable {
    fn eq(&self, other: &Self) -> bool {
        self.table == other.table
    }
}

/// Why a table cannot be an illuminant.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum IlluminantError {
    /// Neither a name nor a file.
    #[error(
        "no illuminant is named `{name}` and no such file can be read ({reason})\n  help: give one of {names}, or the path of a table of relative power", names = Illuminant::NAMES.join(", ")
    )]
    Unknown {
        /// What was given.
        name: String,
        /// What the system said.
        reason: String,
    },
    /// The file holds no spectrum of power.
    #[error("{}", .0.without_choices())]
    Spectrum(#[from] SpectrumError),
    /// A row that has none or less than none, within 380-780 nm.
    #[error(
        "{file}:{line}: {} at {nm} nm: a light needs a power of 0 or more in every row within 380-780 nm\n  help: mend the row, or leave it out", .value.map_or("no power".to_owned(), |value| format!("a power of {value}"))
    )]
    Power {
        /// The file.
        file: String,
        /// Line of the row, from 1.
        line: usize,
        /// Wavelength, nm.
        nm: f64,
        /// What it has.
        value: Option<f64>,
    },
    /// Numbers that are no table.
    #[error(
        "{name}: {what}\n  help: give at least two wavelengths in nm, finite and strictly increasing, and for each a power of 0 or more"
    )]
    Numbers {
        /// Name of the table.
        name: String,
        /// What is wrong with them.
        what: String,
    },
    /// No white.
    #[error(
        "{name}: it has no power where the observer sees red, green and blue, so that nothing is white under it\n  help: give a light with some power between 380 and 650 nm"
    )]
    Dark {
        /// Name of the table.
        name: String,
    },
    /// It does not reach as far as the wavelengths.
    #[error(
        "{name} covers {} to {} nm, but the wavelengths need {} to {} nm of it\n  help: extend the table, or choose other wavelengths; beyond 380-780 nm none is needed", .covered.0, .covered.1, .needed.0, .needed.1
    )]
    Short {
        /// Name of the table.
        name: String,
        /// First and last wavelength that it has, nm.
        covered: (f64, f64),
        /// First and last wavelength that is needed, nm.
        needed: (f64, f64),
    },
}

impl PowerTable {
    /// The table of `power`, in any unit, at `wavelengths_nm`, nm.
    ///
    /// # Errors
    /// [`IlluminantError::Numbers`], [`IlluminantError::Dark`].
    pub fn new(name: &str, wavelengths_nm: &[f64], power: &[f64]) -> Result<Self, IlluminantError> {
        let refuse = |what: String| IlluminantError::Numbers {
            name: name.to_owned(),
            what,
        };
        let (rows, values) = (wavelengths_nm.len(), power.len());
        if rows != values {
            let what = format!("{rows} wavelengths and {values} powers");
            return Err(refuse(what));
        }
        let mut before = f64::NEG_INFINITY;
        for nm in wavelengths_nm {
            if !(nm.is_finite() && *nm > before) {
                return Err(refuse(format!("a wavelength of {nm} nm after {before} nm")));
            }
            before = *nm;
        }
        // What the observer does not see is no part of the light.
        let (low, high) = observer::RANGE_NM;
        let begin = wavelengths_nm.partition_point(|nm| *nm <= low);
        let begin = begin.saturating_sub(1);
        let end = wavelengths_nm.partition_point(|nm| *nm < high);
        let kept = begin..(end + 1).min(rows).max(begin);
        let (nm, power) = (&wavelengths_nm[kept.clone()], &power[kept]);
        let mut pairs = nm.iter().zip(power);
        if let Some((nm, value)) = pairs.find(|(_, power)| !(power.is_finite() && **power >= 0.0)) {
            return Err(refuse(format!("a power of {value} at {nm} nm")));
        }
        let table = Table::of(nm, power).ok_or_else(|| {
            let (low, high) = observer::RANGE_NM;
            refuse(format!("fewer than two rows within {low}-{high} nm"))
        })?;
        if !observer::sees_white(&table) {
            let name = name.to_owned();
            return Err(IlluminantError::Dark { name });
        }
        Ok(Self {
            name: name.to_owned(),
            table,
        })
    }

    /// Its name: that of its file, without the folder.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Wavelengths, nm, strictly increasing: those that the observer sees, and at
    /// either end one beyond.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        self.table.abscissae()
    }

    /// Relative power at each of them.
    #[must_use]
    pub fn power(&self) -> &[f64] {
        self.table.column(0)
    }

    pub(super) fn table(&self) -> &Table {
        &self.table
    }

    /// Eight hexadecimal digits of its content.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let mut digest = Sha256::new();
        for value in self.wavelengths_nm().iter().chain(self.power()) {
            digest.update(value.to_le_bytes());
        }
        let digest = digest.finalize();
        digest[..4].iter().map(|b| format!("{b:02x}")).collect()
    }

    /// # Errors
    /// [`IlluminantError::Short`].
    pub(super) fn covers(&self, wavelengths_nm: &[f64]) -> Result<(), IlluminantError> {
        let (low, high) = NEEDED_NM;
        let needed = |nm: &&f64| (low..=high).contains(*nm);
        let mut wanted = wavelengths_nm.iter().filter(needed);
        let (Some(&first), last) = (wanted.next(), wanted.next_back()) else {
            return Ok(());
        };
        let last = last.copied().unwrap_or(first);
        let (min, max) = self.table.range();
        if min <= first && last <= max {
            return Ok(());
        }
        Err(IlluminantError::Short {
            name: self.name.clone(),
            covered: (min, max),
            needed: (first, last),
        })
    }
}

impl Illuminant {
    /// The illuminant of a name; else the table at that path, relative to `directory`,
    /// and what was found in it and done.
    ///
    /// # Errors
    /// See [`IlluminantError`].
    pub fn find(
        name_or_path: &str,
        directory: &Path,
    ) -> Result<(Self, Option<Report>), IlluminantError> {
        if let Ok(named) = name_or_path.parse() {
            return Ok((named, None));
        }
        let path = directory.join(name_or_path);
        if let Err(error) = std::fs::metadata(&path) {
            return Err(IlluminantError::Unknown {
                name: name_or_path.to_owned(),
                reason: error.to_string(),
            });
        }
        let (table, report) = Self::read(&path)?;
        Ok((table, Some(report)))
    }

    /// The table of relative power in a file (docs/formats.md, "Illuminants from
    /// files"), and what was found in it and done.
    ///
    /// # Errors
    /// See [`IlluminantError`].
    pub fn read(path: &Path) -> Result<(Self, Report), IlluminantError> {
        let curve = measured::read(path, &request())?;
        Self::of_curve(&path.display().to_string(), curve)
    }

    /// The same from the content of a file; `file` is its path in messages, and its
    /// name.
    ///
    /// # Errors
    /// See [`IlluminantError`].
    pub fn parse(file: &str, bytes: &[u8]) -> Result<(Self, Report), IlluminantError> {
        let curve = measured::parse(file, bytes, &request())?;
        Self::of_curve(file, curve)
    }

    fn of_curve(file: &str, curve: Curve) -> Result<(Self, Report), IlluminantError> {
        let (low, high) = NEEDED_NM;
        for row in &curve.report.masked {
            if let Some(nm) = row.wavelength_nm.filter(|nm| (low..=high).contains(nm)) {
                return Err(IlluminantError::Power {
                    file: file.to_owned(),
                    line: row.line,
                    nm,
                    value: row.value,
                });
            }
        }
        let name = Path::new(file).file_name();
        let name = name.map_or(file.to_owned(), |name| name.to_string_lossy().into_owned());
        let (nm, power): (Vec<f64>, Vec<f64>) =
            curve.samples.iter().map(|row| (row.nm, row.value)).unzip();
        let table = PowerTable::new(&name, &nm, &power)?;
        Ok((Self::Table(Arc::new(table)), curve.report))
    }
}

fn request() -> Request {
    Request {
        range_nm: READ_NM,
        ..Request::of(Some(Content::Power), (0.0, f64::INFINITY))
    }
}
