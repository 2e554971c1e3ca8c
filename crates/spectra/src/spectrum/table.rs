//! A CSV table with one abscissa (wavelength in nm, or temperature) and one or more columns,
//! with linear or log-log interpolation between its rows.
use std::path::Path;

use thiserror::Error;

/// A table that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum TableError {
    /// The file cannot be read.
    #[error("cannot read table {name}: {reason}")]
    Read {
        /// File or table name.
        name: String,
        /// The error of the operating system.
        reason: String,
    },
    /// The content is not a valid table.
    #[error(
        "table {name}: {reason}; expected CSV with the header `{header}` and rows of finite numbers, the first column strictly increasing (lines starting with # are comments)"
    )]
    Malformed {
        /// File or table name.
        name: String,
        /// The defect, with the row.
        reason: String,
        /// Header expected.
        header: String,
    },
}

/// Rows of finite numbers sorted by the first column.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    x: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl Table {
    /// Parses `text`, whose header must be `header`; `name` appears in errors.
    ///
    /// # Errors
    /// [`TableError::Malformed`] for a wrong header, a row of the wrong length, a number
    /// that is not finite, an abscissa that does not increase, or fewer than two rows.
    pub fn parse(name: &str, text: &str, header: &[&str]) -> Result<Self, TableError> {
        let malformed = |reason: String| TableError::Malformed {
            name: name.to_owned(),
            reason,
            header: header.join(","),
        };
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let found = reader.headers().map_err(|e| malformed(e.to_string()))?;
        if found != header {
            return Err(malformed(format!("the header is `{}`", found.as_slice())));
        }
        let mut x: Vec<f64> = Vec::new();
        let mut columns = vec![Vec::new(); header.len() - 1];
        for (row, record) in reader.deserialize::<Vec<f64>>().enumerate() {
            let record = record.map_err(|e| malformed(format!("row {}: {e}", row + 1)))?;
            let [first, rest @ ..] = record.as_slice() else {
                return Err(malformed(format!("row {} is empty", row + 1)));
            };
            if record.iter().any(|v| !v.is_finite()) {
                return Err(malformed(format!(
                    "row {} has a number that is not finite",
                    row + 1
                )));
            }
            if x.last().is_some_and(|last| last >= first) {
                return Err(malformed(format!(
                    "row {} is not above the row before it",
                    row + 1
                )));
            }
            x.push(*first);
            for (column, value) in columns.iter_mut().zip(rest) {
                column.push(*value);
            }
        }
        if x.len() < 2 {
            return Err(malformed("fewer than two rows".to_owned()));
        }
        Ok(Self { x, columns })
    }

    /// A table of one column. `None` unless both lists have the same length of at least 2,
    /// all numbers are finite and the abscissae increase strictly.
    #[must_use]
    pub fn from_column(abscissae: &[f64], column: &[f64]) -> Option<Self> {
        let mut numbers = abscissae.iter().chain(column);
        let sorted = abscissae.windows(2).all(|pair| pair[0] < pair[1]);
        let fits = abscissae.len() >= 2 && abscissae.len() == column.len();
        (fits && sorted && numbers.all(|value| value.is_finite())).then(|| Self {
            x: abscissae.to_vec(),
            columns: vec![column.to_vec()],
        })
    }

    /// This table, followed by the rows of `beyond` above its range. Both have the same columns.
    #[must_use]
    pub fn followed_by(&self, beyond: &Self) -> Self {
        let first = beyond.x.partition_point(|x| *x <= self.range().1);
        let join = |a: &[f64], b: &[f64]| [a, &b[first..]].concat();
        let columns = self.columns.iter().zip(&beyond.columns);
        Self {
            x: join(&self.x, &beyond.x),
            columns: columns.map(|(a, b)| join(a, b)).collect(),
        }
    }

    /// Reads and parses a file.
    ///
    /// # Errors
    /// As [`Table::parse`], and [`TableError::Read`] when the file cannot be read.
    pub fn read(path: &Path, header: &[&str]) -> Result<Self, TableError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| TableError::Read {
            name: name.clone(),
            reason: e.to_string(),
        })?;
        Self::parse(&name, &text, header)
    }

    /// First and last abscissa.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        (self.x[0], self.x[self.x.len() - 1])
    }

    /// The abscissae, strictly increasing.
    #[must_use]
    pub fn abscissae(&self) -> &[f64] {
        &self.x
    }

    /// The values of one column (0 is the first after the abscissa).
    #[must_use]
    pub fn column(&self, column: usize) -> &[f64] {
        &self.columns[column]
    }

    /// The row below `x` and the fraction (0 to 1) of the way to the next; `None` outside.
    fn bracket(&self, x: f64) -> Option<(usize, f64)> {
        let (first, last) = self.range();
        if !(first <= x && x <= last) {
            return None;
        }
        let upper = self
            .x
            .partition_point(|&v| v <= x)
            .clamp(1, self.x.len() - 1);
        let (a, b) = (self.x[upper - 1], self.x[upper]);
        Some((upper - 1, (x - a) / (b - a)))
    }

    /// Linear interpolation in column `column`; `None` outside the table.
    #[must_use]
    pub fn linear(&self, column: usize, x: f64) -> Option<f64> {
        let (i, t) = self.bracket(x)?;
        let y = &self.columns[column];
        Some(y[i] + t * (y[i + 1] - y[i]))
    }

    /// Log-log interpolation in column `column`, or linear where a value is not positive;
    /// `None` outside the table.
    #[must_use]
    pub fn log_log(&self, column: usize, x: f64) -> Option<f64> {
        let (i, t) = self.bracket(x)?;
        let (x0, x1) = (self.x[i], self.x[i + 1]);
        let (y0, y1) = (self.columns[column][i], self.columns[column][i + 1]);
        if y0 <= 0.0 || y1 <= 0.0 || x0 <= 0.0 {
            return Some(y0 + t * (y1 - y0));
        }
        let t = libm::log(x / x0) / libm::log(x1 / x0);
        Some(libm::exp(libm::log(y0) * (1.0 - t) + libm::log(y1) * t))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const TEXT: &str = "# source\nwavelength_nm,k\n100,1\n200,4\n400,64\n";

    #[test]
    fn interpolates_linearly_and_in_logarithms() {
        let t = Table::parse("t", TEXT, &["wavelength_nm", "k"]).unwrap();
        assert_eq!(t.linear(0, 150.0), Some(2.5));
        assert_eq!(t.linear(0, 100.0), Some(1.0));
        assert_eq!(t.linear(0, 400.0), Some(64.0));
        // k = (x/100)^2, then k = 4 (x/200)^4
        assert!((t.log_log(0, 150.0).unwrap() - 2.25).abs() < 1e-12);
        assert!((t.log_log(0, 300.0).unwrap() - 20.25).abs() < 1e-11);
        assert_eq!(t.linear(0, 99.9), None);
        assert_eq!(t.log_log(0, 400.1), None);
        assert_eq!(t.linear(0, f64::NAN), None);
    }

    #[test]
    fn a_table_goes_on_with_the_rows_of_another() {
        let table = |text| Table::parse("t", text, &["wavelength_nm", "k"]).unwrap();
        let beyond = table("wavelength_nm,k\n300,9\n400,64\n800,65\n900,66\n");
        let joined = table(TEXT).followed_by(&beyond);
        assert_eq!(joined.abscissae(), [100.0, 200.0, 400.0, 800.0, 900.0]);
        assert_eq!(joined.column(0), [1.0, 4.0, 64.0, 65.0, 66.0]);
    }

    #[test]
    fn invalid_tables_are_refused() {
        for (text, part) in [
            ("wavelength_nm,n\n1,1\n2,1\n", "header"),
            ("wavelength_nm,k\n1,1\n1,1\n", "row 2"),
            ("wavelength_nm,k\n1,NaN\n2,1\n", "not finite"),
            ("wavelength_nm,k\n1,x\n2,1\n", "row 1"),
            ("wavelength_nm,k\n1,1,3\n2,1\n", "row 1"),
            ("wavelength_nm,k\n1,1\n", "two rows"),
            ("", "header"),
        ] {
            let error = Table::parse("t.csv", text, &["wavelength_nm", "k"])
                .unwrap_err()
                .to_string();
            assert!(
                error.contains(part) && error.contains("t.csv"),
                "{text:?}: {error}"
            );
        }
    }
}
