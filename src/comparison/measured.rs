//! A measured spectrum: its file, and its values at other wavelengths.
use std::path::Path;

use super::error::MeasuredError;
use super::exclusion::{Exclusion, excluded};
use crate::measurement::Quantity;
use crate::spectrum::measured::{
    self, Column, Content, Curve, Report, Request, Sample, Scale, Unit,
};

/// Wavelengths that are used, nm, both included: those of the model.
pub const RANGE_NM: (f64, f64) = (350.0, 2500.0);
/// Values taken. Noise takes dark snow below 0; a white reference in other light or at
/// another angle than the snow takes reflectance factors of bright snow above 1, under
/// a low sun to 1.4. What is further off is noise, or another quantity.
pub const VALUES: (f64, f64) = (-0.05, 1.5);
/// Rows further apart than this, nm, have no values between them: absorption bands
/// of ice are some 100 nm wide.
pub(super) const MAX_GAP_NM: f64 = 30.0;

/// What the caller knows of a file; what it leaves out is guessed and told.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hints {
    /// What was measured.
    pub quantity: Option<Quantity>,
    /// Column of the values.
    pub column: Option<Column>,
    /// Unit of the wavelengths.
    pub unit: Option<Unit>,
    /// Scale of the values.
    pub scale: Option<Scale>,
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
    curve: Curve,
}

impl MeasuredSpectrum {
    /// Reads a file (docs/formats.md, "Measured spectra: what is read"). In
    /// `exclusions`, where spectrometers often see nothing but noise, any number is
    /// taken and none is missed.
    ///
    /// # Errors
    /// [`MeasuredError::Spectrum`].
    pub fn read(
        path: &Path,
        hints: &Hints,
        exclusions: &[Exclusion],
    ) -> Result<Self, MeasuredError> {
        let curve = measured::read(path, &request(hints, exclusions))?;
        Ok(Self::of(&path.display().to_string(), curve, exclusions))
    }

    /// The same from the content of a file; `file` is its name in messages.
    ///
    /// # Errors
    /// [`MeasuredError::Spectrum`].
    pub fn parse(
        file: &str,
        bytes: &[u8],
        hints: &Hints,
        exclusions: &[Exclusion],
    ) -> Result<Self, MeasuredError> {
        let curve = measured::parse(file, bytes, &request(hints, exclusions))?;
        Ok(Self::of(file, curve, exclusions))
    }

    fn of(file: &str, curve: Curve, exclusions: &[Exclusion]) -> Self {
        Self {
            file: file.to_owned(),
            quantity: match curve.report.content {
                Content::Transmittance => Quantity::Transmittance,
                Content::Reflectance | Content::Power => Quantity::Reflectance,
            },
            exclusions: exclusions.to_vec(),
            curve,
        }
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

    /// What was found in the file and done with it.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.curve.report
    }

    /// Wavelengths within [`RANGE_NM`] that have a value.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.curve.samples.len()
    }

    /// Rows outside it, which are not used.
    #[must_use]
    pub fn ignored(&self) -> usize {
        self.curve.report.outside
    }

    /// The values at those of `wavelengths_nm` (increasing) that lie on a row, or
    /// between two rows at most 30 nm apart: linearly interpolated. Where
    /// wavelengths count, only rows that count are used.
    ///
    /// # Errors
    /// [`MeasuredError::Overlap`] if fewer than 2 that count remain.
    pub fn at(&self, wavelengths_nm: &[f64]) -> Result<Vec<Matched>, MeasuredError> {
        let rows = &self.curve.samples;
        let out = |row: &&Sample| !excluded(&self.exclusions, row.nm);
        let counted: Vec<Sample> = rows.iter().filter(out).copied().collect();
        let matched = |(index, &nm): (usize, &f64)| {
            let excluded = excluded(&self.exclusions, nm);
            let row = interpolated(if excluded { rows } else { &counted }, nm)?;
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
        let nm = |row: &Sample| row.nm;
        Err(MeasuredError::Overlap {
            file: self.file.clone(),
            common,
            sample_nm: ends(
                wavelengths_nm.first().copied(),
                wavelengths_nm.last().copied(),
            ),
            file_nm: ends(rows.first().map(nm), rows.last().map(nm)),
            excluded: listed(&self.exclusions),
        })
    }
}

/// `exclusions` as text: `1750-2000, 2350-2500`, or `none`.
#[must_use]
pub fn listed(exclusions: &[Exclusion]) -> String {
    let texts: Vec<_> = exclusions.iter().map(ToString::to_string).collect();
    match texts.is_empty() {
        true => "none".to_owned(),
        false => texts.join(", "),
    }
}

fn request(hints: &Hints, exclusions: &[Exclusion]) -> Request {
    let bands = exclusions.iter().map(|band| (band.from_nm, band.to_nm));
    Request {
        content: hints.quantity.map(|quantity| match quantity {
            Quantity::Reflectance => Content::Reflectance,
            Quantity::Transmittance => Content::Transmittance,
        }),
        column: hints.column.clone(),
        unit: hints.unit,
        scale: hints.scale,
        range_nm: RANGE_NM,
        possible: VALUES,
        excluded_nm: bands.collect(),
    }
}

/// What `rows` say of a wavelength; `None` beyond them and in wide gaps.
fn interpolated(rows: &[Sample], nm: f64) -> Option<Sample> {
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
    Some(Sample {
        nm,
        value: mix(a.value, b.value),
        // Not less than at the rows: neighbours mostly err alike.
        uncertainty: a.uncertainty.zip(b.uncertainty).map(|(a, b)| mix(a, b)),
    })
}
