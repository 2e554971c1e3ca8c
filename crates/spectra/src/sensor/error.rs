//! Errors of sensors, solar spectra and band averages.
use thiserror::Error;

use super::{MAX_GAP_NM, Sensor, SolarSpectrum};
use crate::spectrum::measured::SpectrumError;

/// A sensor or solar spectrum that cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SensorError {
    /// Neither the name of a built-in sensor nor a readable file.
    #[error(
        "no sensor is named `{name}` and no such file can be read ({reason})\n  help: give one of {}, or the path of a table of responses; NAME:BAND,BAND chooses bands", Sensor::NAMES.join(", ")
    )]
    UnknownSensor {
        /// The name or path given.
        name: String,
        /// The error of the operating system.
        reason: String,
    },
    /// Neither the name of a built-in solar spectrum nor a readable file.
    #[error(
        "no solar spectrum is named `{name}` and no such file can be read ({reason})\n  help: give one of {}, or the path of a table of power", SolarSpectrum::NAMES.join(", ")
    )]
    UnknownSun {
        /// The name or path given.
        name: String,
        /// The error of the operating system.
        reason: String,
    },
    /// The file does not hold readable numbers.
    #[error("{}", .0.without_choices())]
    Spectrum(#[from] SpectrumError),
    /// Numbers that do not form a sensor.
    #[error(
        "{file}{}: {reason}\n  help: give wavelengths in nm and a column of responses for each band; or rows of band,wavelength_nm,response, of band,centre_nm,fwhm_nm, or of band,from_nm,to_nm", .line.map_or(String::new(), |line| format!(":{line}"))
    )]
    Malformed {
        /// Name of the file or sensor.
        file: String,
        /// Line of the problem, from 1.
        line: Option<u64>,
        /// The defect.
        reason: String,
    },
    /// Numbers that do not form a solar spectrum.
    #[error(
        "{name}: a solar spectrum needs at least two wavelengths, increasing, and a power of 0 or more at each\n  help: give a table with wavelengths in nm and a column of power"
    )]
    Sun {
        /// Name of the file or spectrum.
        name: String,
    },
    /// The sensor has no such band.
    #[error("{sensor} has no band `{band}`; its bands are {bands}")]
    NoBand {
        /// Name of the sensor.
        sensor: String,
        /// The band asked for.
        band: String,
        /// Names of its bands.
        bands: String,
    },
    /// The wavelengths of a spectrum do not cover the bands.
    #[error(
        "{sensor}: the wavelengths ({}) do not cover {missing}; needed are {} to {} nm in steps of at most {MAX_GAP_NM} nm\n  help: give such wavelengths{}", .given_nm.map_or("none".into(), |(from, to, apart)| format!("{from} to {to} nm{}", apart.map_or(String::new(), |nm| format!(", up to {nm} nm apart")))), .needed_nm.0, .needed_nm.1, .covered.as_ref().map_or(String::new(), |bands| format!(", or choose bands that are covered: {sensor}:{bands}"))
    )]
    Uncovered {
        /// Name of the sensor.
        sensor: String,
        /// The bands that are not covered, as text.
        missing: String,
        /// Range of the spectrum, and its widest step if that is too wide.
        given_nm: Option<(f64, f64, Option<f64>)>,
        /// Range of the bands that are not covered.
        needed_nm: (f64, f64),
        /// Names of the other bands, with commas.
        covered: Option<String>,
    },
    /// The solar spectrum does not cover a band, or has no power in it.
    #[error(
        "{sun}: no power at all wavelengths of the band {band}, {} to {} nm; the table has {} to {} nm\n  help: choose another solar spectrum, or other bands", .needed_nm.0, .needed_nm.1, .given_nm.0, .given_nm.1
    )]
    DarkSun {
        /// Name of the solar spectrum.
        sun: String,
        /// The band.
        band: String,
        /// Range of the band.
        needed_nm: (f64, f64),
        /// Range of the table.
        given_nm: (f64, f64),
    },
}

impl SensorError {
    pub(super) fn malformed(file: &str, line: Option<u64>, reason: String) -> Self {
        Self::Malformed {
            file: file.to_owned(),
            line,
            reason,
        }
    }
}

/// Names with commas; of many, the first.
pub(super) fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 24;
    let more = names.len().saturating_sub(SHOWN);
    let shown: Vec<_> = names.take(SHOWN).collect();
    match more {
        0 => shown.join(", "),
        _ => format!("{} and {more} more", shown.join(", ")),
    }
}
