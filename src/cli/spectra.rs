//! The words of `retrieve` that name measured spectra, and their values.
use std::path::{Path, PathBuf};

use anyhow::{anyhow, ensure};

use super::common;
use crate::comparison::{MeasuredSpectrum, RANGE_NM, excluded};
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::retrieve::{KnownValue, MeasuredBands, MeasuredInput};
use crate::spectrum::measured::{Column, MeasuredValue};

/// A word of the command line: a file and what is known of its spectrum.
#[derive(Debug, Default)]
pub(super) struct SpectrumArg {
    pub(super) file: PathBuf,
    fixed: Vec<KnownValue>,
    pub(super) quantity: Option<Quantity>,
    pub(super) column: Option<Column>,
}

impl SpectrumArg {
    pub(super) fn parse(word: &str) -> anyhow::Result<Self> {
        let parts = word.rsplit_once('@');
        let parts = parts.filter(|(_, rest)| rest.contains('=') && !Path::new(word).exists());
        let Some((file, rest)) = parts else {
            return Ok(Self {
                file: word.into(),
                ..Self::default()
            });
        };
        let mut spectrum = Self {
            file: file.into(),
            ..Self::default()
        };
        for entry in rest.split(',') {
            let wrong = |reason: String| anyhow!("{word}: {reason}");
            match entry.split_once('=') {
                Some(("quantity", name)) => {
                    let found = Quantity::ALL.into_iter().find(|q| q.name() == name);
                    let found = found.ok_or_else(|| {
                        let names = Quantity::ALL.map(Quantity::name).join(" or ");
                        wrong(format!("quantity must be {names}, not {name}"))
                    })?;
                    spectrum.quantity = Some(found);
                }
                Some(("column", name)) => {
                    let column = name.parse();
                    spectrum.column = Some(column.map_err(|e| wrong(format!("column: {e}")))?);
                }
                _ => spectrum.fixed.push(entry.parse().map_err(wrong)?),
            }
        }
        Ok(spectrum)
    }
}

impl SpectrumArg {
    /// What is known of the spectrum, without its values.
    pub(super) fn known(&self, measured: &MeasuredSpectrum) -> MeasuredInput {
        MeasuredInput {
            name: common::one_line(&self.file),
            quantity: measured.quantity(),
            indices: Vec::new(),
            values: Vec::new(),
            uncertainties: Vec::new(),
            fixed: self.fixed.clone(),
        }
    }
}

/// Most wavelengths that are taken from the rows of the files.
const MOST_ROWS: usize = 60;
/// Step of the wavelengths that take the place of more rows, nm.
const STEP_NM: f64 = 25.0;

/// The wavelengths at which measured spectra are compared if nothing else gives them, nm: those of
/// the rows, or of many rows every 25 nm.
pub(super) fn wavelengths_nm<'a>(
    spectra: impl Iterator<Item = &'a MeasuredSpectrum> + Clone,
) -> Vec<f64> {
    let sorted = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let rows = spectra.clone().flat_map(|spectrum| {
        let counted = |row: &&MeasuredValue| !excluded(spectrum.exclusions(), row.nm);
        spectrum.samples().iter().filter(counted).map(|row| row.nm)
    });
    let rows = sorted(rows.collect());
    if rows.len() <= MOST_ROWS {
        return rows;
    }
    let first = RANGE_NM.0;
    let last = spectra.clone().map(|spectrum| spectrum.range_nm().1);
    let last = last.fold(first, f64::max);
    let steps = ((last - first) / STEP_NM) as usize;
    let grid: Vec<f64> = (0..=steps).map(|i| first + STEP_NM * i as f64).collect();
    let covered = spectra.flat_map(|spectrum| {
        let matched = spectrum.at(&grid).unwrap_or_default().into_iter();
        matched.filter(|m| !m.excluded).map(|m| m.nm)
    });
    sorted(covered.collect())
}

/// The values of a measured spectrum at wavelengths of the file.
pub(super) fn input(
    spectrum: SpectrumArg,
    measured: &MeasuredSpectrum,
    database: &Database,
) -> anyhow::Result<MeasuredInput> {
    let matched = measured.at(database.wavelengths_nm())?;
    let counted: Vec<_> = matched.iter().filter(|m| !m.excluded).collect();
    Ok(MeasuredInput {
        name: common::one_line(&spectrum.file),
        quantity: measured.quantity(),
        indices: counted.iter().map(|m| m.index).collect(),
        values: counted.iter().map(|m| m.value).collect(),
        uncertainties: counted.iter().map(|m| m.uncertainty).collect(),
        fixed: spectrum.fixed,
    })
}

/// The values of measured bands, which are read as a spectrum at their mean wavelengths.
pub(super) fn band_input(
    spectrum: SpectrumArg,
    measured: &MeasuredSpectrum,
    bands: &MeasuredBands,
) -> anyhow::Result<MeasuredInput> {
    let mut input = MeasuredInput {
        name: common::one_line(&spectrum.file),
        quantity: measured.quantity(),
        indices: Vec::new(),
        values: Vec::new(),
        uncertainties: Vec::new(),
        fixed: spectrum.fixed,
    };
    for (index, nm) in bands.centres_nm().iter().enumerate() {
        let mut rows = measured.samples().iter();
        let row = rows.find(|row| (row.nm - nm).abs() < 1e-6);
        if let Some(row) = row.filter(|row| !excluded(measured.exclusions(), row.nm)) {
            input.indices.push(index);
            input.values.push(row.value);
            input.uncertainties.push(row.uncertainty);
        }
    }
    ensure!(
        !input.values.is_empty(),
        "{}: no band has a value outside the excluded ranges; --exclude none uses all",
        input.name
    );
    Ok(input)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn files_with_what_is_known() {
        let plain = SpectrumArg::parse("a@b.csv").unwrap();
        assert_eq!((plain.file, plain.fixed.len()), ("a@b.csv".into(), 0));
        let word = "x/a.csv@thickness-cm=2.5,quantity=transmittance,column=T";
        let thin = SpectrumArg::parse(word).unwrap();
        assert_eq!(thin.file, Path::new("x/a.csv"));
        assert_eq!(
            (thin.fixed[0].named.name(), thin.fixed[0].value),
            ("thickness_cm", 2.5)
        );
        assert_eq!(thin.quantity, Some(Quantity::Transmittance));
        assert!(thin.column.is_some());
        for wrong in ["a.csv@y=1", "a.csv@quantity=x", "a.csv@thickness_cm=x"] {
            assert!(SpectrumArg::parse(wrong).is_err(), "{wrong}");
        }
    }
}
