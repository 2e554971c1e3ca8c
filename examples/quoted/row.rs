//! The rows of docs/quoted.csv.
use std::error::Error;
use std::path::Path;

/// A number quoted in the documentation: one row of the file. A quotation of several
/// numbers refers to all rows of one name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quoted {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) standard_error: f64,
    pub(crate) setting: String,
}

impl Quoted {
    pub(crate) fn new(name: &str, value: f64, standard_error: f64, setting: &str) -> Self {
        Self {
            name: name.to_owned(),
            value,
            standard_error,
            setting: setting.to_owned(),
        }
    }
}

/// Reads the rows of the file.
pub(crate) fn read(path: &Path) -> Result<Vec<Quoted>, Box<dyn Error>> {
    let mut reader = csv::Reader::from_path(path)?;
    let rows = reader.records().map(|row| {
        let row = row?;
        let [value, se] = [row[1].parse()?, row[2].parse()?];
        Ok(Quoted::new(&row[0], value, se, &row[3]))
    });
    rows.collect()
}
