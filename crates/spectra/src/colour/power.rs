//! A user's illuminant: a table of relative spectral power.
//!
//! The table comes from a file in any format of measured spectra (docs/formats.md,
//! "Illuminants from files"), or from numbers. Two tables are equal if their numbers in the
//! range of the observer are equal; names do not count. A table can be used for spectra if
//! it covers their wavelengths within 380-780 nm, where all built-in tables have values.
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};
use thiserror::Error;

use super::{Illuminant, observer};
use crate::spectrum::Table;
use crate::spectrum::measured::{self, Content, Curve, ReadOptions, ReadReport, SpectrumError};

/// Range within which a table must cover the wavelengths of the spectra, nm.
const NEEDED_NM: (f64, f64) = (380.0, 780.0);
/// Range of the rows read from a file, nm: the range of the observer with a margin.
const READ_NM: (f64, f64) = (200.0, 1000.0);

/// Relative spectral power over wavelength.
#[derive(Debug, Clone)]
pub struct PowerTable {
    name: String,
    table: Table,
}

/// Compares the content; the name does not count.
impl PartialEq for PowerTable {
    fn eq(&self, other: &Self) -> bool {
        self.table == other.table
    }
}

/// An error in reading a table as an illuminant.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum IlluminantError {
    /// Neither the name of a built-in illuminant nor a readable file.
    #[error(
        "no illuminant is named `{name}` and no such file can be read ({reason})\n  help: give one of {names}, or the path of a table of relative power", names = Illuminant::NAMES.join(", ")
    )]
    Unknown {
        /// The name or path given.
        name: String,
        /// The error of the operating system.
        reason: String,
    },
    /// The file does not hold a readable spectrum.
    #[error("{}", .0.without_choices())]
    Spectrum(#[from] SpectrumError),
    /// A row within 380-780 nm without a power, or with a negative one.
    #[error(
    "{file}:{line}: {} at {nm} nm: an illuminant needs a power of 0 or more in every row within 380-780 nm\n  help: correct the row, or remove it", .value.map_or("no power".to_owned(), |value| format!("a power of {value}"))
    )]
    Power {
        /// The file.
        file: String,
        /// Line of the row, from 1.
        line: usize,
        /// Wavelength, nm.
        nm: f64,
        /// Its power; `None` if the row has none.
        value: Option<f64>,
    },
    /// Numbers that do not form a valid table.
    #[error(
        "{name}: {reason}\n  help: give at least two wavelengths in nm, finite and strictly increasing, and for each a power of 0 or more"
    )]
    Numbers {
        /// Name of the table.
        name: String,
        /// The defect.
        reason: String,
    },
    /// X, Y or Z of white is 0.
    #[error(
        "{name}: it has no power where the observer sees red, green and blue, so white is not defined\n  help: give an illuminant with some power between 380 and 650 nm"
    )]
    Dark {
        /// Name of the table.
        name: String,
    },
    /// The table does not cover the wavelengths of the spectra.
    #[error(
        "{name} covers {} to {} nm, but the wavelengths need {} to {} nm\n  help: extend the table, or choose other wavelengths; none is needed outside 380-780 nm", .covered.0, .covered.1, .needed.0, .needed.1
    )]
    Short {
        /// Name of the table.
        name: String,
        /// First and last wavelength of the table, nm.
        covered: (f64, f64),
        /// First and last wavelength needed, nm.
        needed: (f64, f64),
    },
}

impl PowerTable {
    /// A table of `power`, in any unit, at `wavelengths_nm`, nm.
    ///
    /// # Errors
    /// [`IlluminantError::Numbers`] if the numbers do not form a valid table,
    /// [`IlluminantError::Dark`] if white is not defined under it.
    pub fn new(name: &str, wavelengths_nm: &[f64], power: &[f64]) -> Result<Self, IlluminantError> {
        let refuse = |reason: String| IlluminantError::Numbers {
            name: name.to_owned(),
            reason,
        };
        let (rows, values) = (wavelengths_nm.len(), power.len());
        if rows != values {
            let reason = format!("{rows} wavelengths and {values} powers");
            return Err(refuse(reason));
        }
        let mut before = f64::NEG_INFINITY;
        for nm in wavelengths_nm {
            if !(nm.is_finite() && *nm > before) {
                return Err(refuse(format!("a wavelength of {nm} nm after {before} nm")));
            }
            before = *nm;
        }
        // Drop rows outside the range of the observer, except one neighbour at each end.
        let (low, high) = observer::RANGE_NM;
        let begin = wavelengths_nm.partition_point(|nm| *nm <= low);
        let begin = begin.saturating_sub(1);
        let end = wavelengths_nm.partition_point(|nm| *nm < high);
        let visible = begin..(end + 1).min(rows).max(begin);
        let (nm, power) = (&wavelengths_nm[visible.clone()], &power[visible]);
        let mut pairs = nm.iter().zip(power);
        if let Some((nm, value)) = pairs.find(|(_, power)| !(power.is_finite() && **power >= 0.0)) {
            return Err(refuse(format!("a power of {value} at {nm} nm")));
        }
        let table = Table::from_column(nm, power).ok_or_else(|| {
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

    /// The name: the file name without the folder.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Wavelengths, nm, strictly increasing: those in the range of the observer, and one
    /// beyond each end.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        self.table.abscissae()
    }

    /// Relative power at each wavelength.
    #[must_use]
    pub fn power(&self) -> &[f64] {
        self.table.column(0)
    }

    pub(super) fn table(&self) -> &Table {
        &self.table
    }

    /// Eight hexadecimal digits of a hash of the content.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let mut digest = Sha256::new();
        for value in self.wavelengths_nm().iter().chain(self.power()) {
            digest.update(value.to_le_bytes());
        }
        let digest = digest.finalize();
        digest[..4].iter().map(|b| format!("{b:02x}")).collect()
    }

    /// Checks that the table covers those of `wavelengths_nm` within 380-780 nm.
    ///
    /// # Errors
    /// [`IlluminantError::Short`] if it does not.
    pub(super) fn covers(&self, wavelengths_nm: &[f64]) -> Result<(), IlluminantError> {
        let (low, high) = NEEDED_NM;
        let in_range = |nm: &&f64| (low..=high).contains(*nm);
        let mut needed = wavelengths_nm.iter().filter(in_range);
        let (Some(&first), last) = (needed.next(), needed.next_back()) else {
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
    /// The built-in illuminant of this name; otherwise the table at this path, relative to
    /// `directory`, with the report of reading it.
    ///
    /// # Errors
    /// An [`IlluminantError`] if it is neither, or the table cannot be used.
    pub fn find(
        name_or_path: &str,
        directory: &Path,
    ) -> Result<(Self, Option<ReadReport>), IlluminantError> {
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

    /// The table of relative power in a file (docs/formats.md, "Illuminants from files"),
    /// and the report of reading it.
    ///
    /// # Errors
    /// An [`IlluminantError`] if the file cannot be read or used as an illuminant.
    pub fn read(path: &Path) -> Result<(Self, ReadReport), IlluminantError> {
        let curve = measured::read(path, &request())?;
        Self::of_curve(&path.display().to_string(), curve)
    }

    /// As [`Illuminant::read`], from the content of a file. `file` is the path used in
    /// messages; its last component is the name of the table.
    ///
    /// # Errors
    /// An [`IlluminantError`] if the content cannot be used as an illuminant.
    pub fn parse(file: &str, bytes: &[u8]) -> Result<(Self, ReadReport), IlluminantError> {
        let curve = measured::parse(file, bytes, &request())?;
        Self::of_curve(file, curve)
    }

    fn of_curve(file: &str, curve: Curve) -> Result<(Self, ReadReport), IlluminantError> {
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

fn request() -> ReadOptions {
    ReadOptions {
        range_nm: READ_NM,
        ..ReadOptions::new(Some(Content::Power), (0.0, f64::INFINITY))
    }
}
