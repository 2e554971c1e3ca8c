//! A measured spectrum from a file, and its values at the wavelengths of a simulation.
use std::path::Path;

use super::error::MeasuredError;
use super::exclusion::{Exclusion, excluded};
use crate::measurement::Quantity;
use crate::optics::MODEL_RANGE_NM;
use crate::spectrum::measured::{
    self, Column, Content, Curve, MeasuredValue, ReadOptions, ReadReport, Unit, ValueScale,
};

/// Wavelengths that are used by default, nm, both ends included. [`Hints::longest_nm`] gives
/// another end.
pub const RANGE_NM: (f64, f64) = (350.0, 2500.0);
/// Smallest and largest value accepted. Noise can make values of dark snow negative.
/// Reflectance factors of bright snow can exceed 1, up to 1.4 under a low sun, if the white
/// reference was measured in other light or at another angle than the snow. Values outside this
/// range are noise or another quantity.
pub const VALUES: (f64, f64) = (-0.05, 1.5);
/// Largest distance between two rows over which values are interpolated, nm. Absorption bands
/// of ice are about 100 nm wide.
pub(super) const MAX_GAP_NM: f64 = 30.0;

/// The caller's knowledge of a file. `None` means that the file states it or it is guessed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Hints {
    /// The measured quantity.
    pub quantity: Option<Quantity>,
    /// The column of the values.
    pub column: Option<Column>,
    /// The unit of the wavelengths.
    pub unit: Option<Unit>,
    /// The scale of the values.
    pub scale: Option<ValueScale>,
    /// Longest wavelength that is used, nm, up to that of the model; `None` is that of
    /// [`RANGE_NM`].
    pub longest_nm: Option<f64>,
}

/// The longest wavelength of a file that is used for a simulation at these wavelengths
/// (increasing), nm: that of the model if they go beyond [`RANGE_NM`].
#[must_use]
pub fn longest_nm(wavelengths_nm: &[f64]) -> f64 {
    match wavelengths_nm.last() {
        Some(last) if *last > RANGE_NM.1 => MODEL_RANGE_NM.1,
        _ => RANGE_NM.1,
    }
}

/// A measured value at one of the wavelengths of a simulation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// Index of the wavelength in the list of the simulation.
    pub index: usize,
    /// The wavelength, nm.
    pub nm: f64,
    /// The measured reflectance or transmittance.
    pub value: f64,
    /// Its standard uncertainty; `None` if the file does not state it.
    pub uncertainty: Option<f64>,
    /// Whether the wavelength is excluded from the statistics.
    pub excluded: bool,
}

/// A measured spectrum with the bands that are excluded from the statistics.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredSpectrum {
    file: String,
    quantity: Quantity,
    exclusions: Vec<Exclusion>,
    range_nm: (f64, f64),
    curve: Curve,
}

impl MeasuredSpectrum {
    /// Reads a file (docs/formats.md, "Measured spectra: what is read"). In `exclusions`, where
    /// spectrometers often record only noise, any number is accepted and values may be missing.
    ///
    /// # Errors
    /// [`MeasuredError::Spectrum`] if the file cannot be read as a spectrum.
    pub fn read(
        path: &Path,
        hints: &Hints,
        exclusions: &[Exclusion],
    ) -> Result<Self, MeasuredError> {
        let request = request(hints, exclusions);
        let curve = measured::read(path, &request)?;
        let file = path.display().to_string();
        Ok(Self::of(&file, curve, exclusions, request.range_nm))
    }

    /// Reads the content of a file; `file` is its name in messages. See [`Self::read`].
    ///
    /// # Errors
    /// [`MeasuredError::Spectrum`] if the content cannot be read as a spectrum.
    pub fn parse(
        file: &str,
        bytes: &[u8],
        hints: &Hints,
        exclusions: &[Exclusion],
    ) -> Result<Self, MeasuredError> {
        let request = request(hints, exclusions);
        let curve = measured::parse(file, bytes, &request)?;
        Ok(Self::of(file, curve, exclusions, request.range_nm))
    }

    fn of(file: &str, curve: Curve, exclusions: &[Exclusion], range_nm: (f64, f64)) -> Self {
        Self {
            file: file.to_owned(),
            quantity: match curve.report.content {
                Content::Transmittance => Quantity::Transmittance,
                Content::Reflectance | Content::Power => Quantity::Reflectance,
            },
            exclusions: exclusions.to_vec(),
            range_nm,
            curve,
        }
    }

    /// The path as the caller gave it.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The measured quantity.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// The bands that are excluded from the statistics.
    #[must_use]
    pub fn exclusions(&self) -> &[Exclusion] {
        &self.exclusions
    }

    /// The report on the file: columns, unit and scale, and how they were read.
    #[must_use]
    pub fn report(&self) -> &ReadReport {
        &self.curve.report
    }

    /// The range of wavelengths that are used, nm, both ends included.
    #[must_use]
    pub fn range_nm(&self) -> (f64, f64) {
        self.range_nm
    }

    /// Whether rows within the range of the model are not used, because they are beyond
    /// [`Self::range_nm`].
    #[must_use]
    pub fn goes_on(&self) -> bool {
        let report = &self.curve.report;
        let longest = report.outside_nm.map_or(0.0, |(_, longest)| longest);
        self.range_nm.1 < MODEL_RANGE_NM.1 && longest > self.range_nm.1
    }

    /// The rows within [`Self::range_nm`] with a value, by increasing wavelength.
    #[must_use]
    pub fn samples(&self) -> &[MeasuredValue] {
        &self.curve.samples
    }

    /// Number of wavelengths within [`Self::range_nm`] with a value.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.curve.samples.len()
    }

    /// Number of rows outside [`Self::range_nm`], which are not used.
    #[must_use]
    pub fn ignored(&self) -> usize {
        self.curve.report.outside
    }

    /// The values at those of `wavelengths_nm` (increasing) that coincide with a row or lie
    /// between two rows at most 30 nm apart, linearly interpolated. Outside the excluded bands,
    /// only rows outside these bands are used.
    ///
    /// # Errors
    /// [`MeasuredError::Overlap`] if fewer than 2 wavelengths outside the excluded bands remain.
    pub fn at(&self, wavelengths_nm: &[f64]) -> Result<Vec<Matched>, MeasuredError> {
        let rows = &self.curve.samples;
        let is_counted = |row: &&MeasuredValue| !excluded(&self.exclusions, row.nm);
        let counted: Vec<MeasuredValue> = rows.iter().filter(is_counted).copied().collect();
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
        let matches: Vec<Matched> = wavelengths_nm
            .iter()
            .enumerate()
            .filter_map(matched)
            .collect();
        let common = matches.iter().filter(|matched| !matched.excluded).count();
        if common >= 2 {
            return Ok(matches);
        }
        let ends = |first: Option<f64>, last: Option<f64>| {
            (first.unwrap_or(f64::NAN), last.unwrap_or(f64::NAN))
        };
        let nm = |row: &MeasuredValue| row.nm;
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

fn request(hints: &Hints, exclusions: &[Exclusion]) -> ReadOptions {
    let bands = exclusions.iter().map(|band| (band.from_nm, band.to_nm));
    ReadOptions {
        content: hints.quantity.map(|quantity| match quantity {
            Quantity::Reflectance => Content::Reflectance,
            Quantity::Transmittance => Content::Transmittance,
        }),
        column: hints.column.clone(),
        unit: hints.unit,
        scale: hints.scale,
        range_nm: (RANGE_NM.0, hints.longest_nm.unwrap_or(RANGE_NM.1)),
        possible: VALUES,
        excluded_nm: bands.collect(),
    }
}

/// The values at `nm`, linearly interpolated; `None` outside `rows` and in gaps wider than
/// [`MAX_GAP_NM`].
fn interpolated(rows: &[MeasuredValue], nm: f64) -> Option<MeasuredValue> {
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
    // The clamp removes overshoot by rounding.
    let mix = |a: f64, b: f64| (a * (1.0 - t) + b * t).clamp(a.min(b), a.max(b));
    Some(MeasuredValue {
        nm,
        value: mix(a.value, b.value),
        // Interpolated linearly, because the errors of neighbouring rows are mostly correlated.
        uncertainty: a.uncertainty.zip(b.uncertainty).map(|(a, b)| mix(a, b)),
    })
}
