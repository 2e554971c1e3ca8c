//! Measured values that are averages over the bands of a sensor.
use splitsnow_retrieval::Emulator;

use super::EmulatorError;
use crate::lookup::Database;
use crate::sensor::{BandAverages, Sensor, SensorError, SolarSpectrum, SpectralResponse};

/// Mean wavelengths are rounded to multiples of 1/1000 nm, and bands are as far apart at least.
const PER_NM: f64 = 1000.0;

/// The bands of a sensor, which take the place of the wavelengths of a compact file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredBands {
    names: Vec<String>,
    centres_nm: Vec<f64>,
    averages: BandAverages,
}

impl MeasuredBands {
    /// The bands of `sensor` under `sun`, by increasing mean wavelength, for spectra of `database`.
    ///
    /// # Errors
    /// A [`SensorError`] if the wavelengths of the file do not cover the bands.
    pub fn new(
        sensor: &Sensor,
        sun: &SolarSpectrum,
        database: &Database,
    ) -> Result<Self, SensorError> {
        let mut bands: Vec<&SpectralResponse> = sensor.bands().iter().collect();
        bands.sort_by(|a, b| a.centre_nm().total_cmp(&b.centre_nm()));
        let names: Vec<&str> = bands.iter().map(|band| band.name()).collect();
        let averages = BandAverages::new(&sensor.only(&names)?, sun, database.wavelengths_nm())?;
        let mut places: Vec<u64> = Vec::new();
        for band in &bands {
            let least = places.last().map_or(0, |last| last + 1);
            places.push(((band.centre_nm() * PER_NM).round() as u64).max(least));
        }
        Ok(Self {
            names: names.into_iter().map(str::to_owned).collect(),
            centres_nm: places.iter().map(|place| *place as f64 / PER_NM).collect(),
            averages,
        })
    }

    /// Mean wavelengths, nm, strictly increasing.
    #[must_use]
    pub fn centres_nm(&self) -> &[f64] {
        &self.centres_nm
    }

    /// The averages of spectra at the wavelengths of the file.
    #[must_use]
    pub fn averages(&self) -> &BandAverages {
        &self.averages
    }

    /// `emulator` averaged over the bands; `error` becomes the error of the averages.
    pub(super) fn averaged(&self, emulator: Emulator, error: &mut EmulatorError) -> Emulator {
        error.sd = self.averages.errors(&error.sd, false);
        emulator.over_bands(self.averages.weights(), &self.centres_nm)
    }

    /// The text of a table whose rows begin with the name of a band, with the mean wavelength in
    /// place of the name; other rows stay. `None` if no row begins with the name of a band.
    #[must_use]
    pub fn with_wavelengths(&self, text: &str) -> Option<String> {
        let mut found = false;
        let mut row = |line: &str| {
            let end = line.find([',', ';', '\t', '|']);
            let end = end
                .or_else(|| line.trim_end().find(' '))
                .unwrap_or(line.len());
            let (first, rest) = line.split_at(end);
            let name = first.trim().trim_matches('"');
            let mut names = self.names.iter();
            match names.position(|band| band.eq_ignore_ascii_case(name)) {
                Some(band) => {
                    found = true;
                    // no decimal sign: the table may have points or commas
                    let place = (self.centres_nm[band] * PER_NM).round();
                    format!("{place}e-3{rest}\n")
                }
                None => format!("{line}\n"),
            }
        };
        let replaced: String = text
            .trim_start_matches('\u{feff}')
            .lines()
            .map(&mut row)
            .collect();
        found.then_some(replaced)
    }

    /// The names of the bands, with commas.
    #[must_use]
    pub fn names(&self) -> String {
        self.names.join(", ")
    }
}
