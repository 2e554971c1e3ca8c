//! Bands of sensors: spectral responses, solar spectra, and averages of spectra over bands.
//!
//! The value of a band is the integral of spectrum x sun x response over wavelength, divided by
//! the integral of sun x response. Between the wavelengths at which the three are given they are
//! linear, and the integral of their product is exact.
//!
//! ```
//! use splitsnow_spectra::sensor::{BandAverages, Sensor, SolarSpectrum};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let sensor = Sensor::find("sentinel2a:B3,B4")?;
//! let sun = SolarSpectrum::find("astm_global")?;
//! let nm = [500.0, 530.0, 560.0, 590.0, 620.0, 650.0, 680.0, 710.0];
//! let spectrum = nm.map(|nm| 1.0 - nm / 10_000.0);
//! let averages = BandAverages::new(&sensor, &sun, &nm)?;
//! // the response-weighted mean wavelengths are 559.9 and 664.6 nm
//! let [green, red] = averages.values(&spectrum)[..] else { unreachable!() };
//! assert!((green - 0.944).abs() < 1e-3 && (red - 0.9335).abs() < 1e-3);
//! # Ok(())
//! # }
//! ```
mod averages;
mod error;
mod files;
mod response;
mod sun;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::spectrum::measured::MAX_BYTES;

pub use averages::{BandAverages, MAX_GAP_NM};
pub use error::SensorError;
pub use response::SpectralResponse;
pub use sun::SolarSpectrum;

/// The built-in sensors and their tables (`examples/sensors/make.py`).
const BUILT_IN: [(&str, &str); 9] = [
    (
        "sentinel2a",
        include_str!("../../data/sensors/sentinel2a.csv"),
    ),
    (
        "sentinel3_olci",
        include_str!("../../data/sensors/sentinel3_olci.csv"),
    ),
    ("modis", include_str!("../../data/sensors/modis.csv")),
    ("viirs", include_str!("../../data/sensors/viirs.csv")),
    ("landsat8", include_str!("../../data/sensors/landsat8.csv")),
    ("emit", include_str!("../../data/sensors/emit.csv")),
    ("prisma", include_str!("../../data/sensors/prisma.csv")),
    (
        "broadband",
        include_str!("../../data/sensors/broadband.csv"),
    ),
    ("par", include_str!("../../data/sensors/par.csv")),
];

/// A list of bands.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    name: String,
    bands: Vec<SpectralResponse>,
}

impl Sensor {
    /// Names of the built-in sensors. `broadband` has the bands `total` (350-2500 nm), `visible`
    /// (350-700 nm) and `near_infrared` (700-2500 nm), all with the response 1. `par` has one band,
    /// 400-700 nm, with a response proportional to the wavelength, that is, to the number of photons
    /// of an energy (photosynthetically active radiation).
    pub const NAMES: [&'static str; BUILT_IN.len()] = {
        let mut names = [""; BUILT_IN.len()];
        let mut i = 0;
        while i < names.len() {
            names[i] = BUILT_IN[i].0;
            i += 1;
        }
        names
    };

    /// A sensor with at least one band.
    ///
    /// # Errors
    /// [`SensorError::Malformed`] if there is no band, or two have the same name.
    pub fn new(name: &str, bands: Vec<SpectralResponse>) -> Result<Self, SensorError> {
        let refuse = |reason: String| Err(SensorError::malformed(name, None, reason));
        if bands.is_empty() {
            return refuse("it has no band".into());
        }
        for (i, band) in bands.iter().enumerate() {
            if bands[..i].iter().any(|other| other.name() == band.name()) {
                return refuse(format!("two bands have the name `{}`", band.name()));
            }
        }
        Ok(Self {
            name: name.to_owned(),
            bands,
        })
    }

    /// The built-in sensor of this name, or the one in the file at this path (docs/formats.md,
    /// "Sensors from files"). Names of bands after a colon choose these bands: `modis:B1,B5`.
    ///
    /// # Errors
    /// A [`SensorError`] if it is neither, the file cannot be used, or a band does not exist.
    pub fn find(text: &str) -> Result<Self, SensorError> {
        let is_sensor = |name: &str| Self::NAMES.contains(&name) || Path::new(name).is_file();
        match text.rsplit_once(':') {
            Some((name, bands)) if !is_sensor(text) && is_sensor(name) => {
                let bands: Vec<&str> = bands.split(',').map(str::trim).collect();
                Self::whole(name)?.only(&bands)
            }
            _ => Self::whole(text),
        }
    }

    fn whole(name: &str) -> Result<Self, SensorError> {
        if let Some((_, table)) = BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
            return Self::parse(name, table.as_bytes());
        }
        let mut bytes = Vec::new();
        File::open(name)
            .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
            .map_err(|error| SensorError::UnknownSensor {
                name: name.to_owned(),
                reason: error.to_string(),
            })?;
        Self::parse(name, &bytes)
    }

    /// The sensor in the content of a file; `file` is its name in messages.
    ///
    /// # Errors
    /// A [`SensorError`] if the content cannot be used.
    pub fn parse(file: &str, bytes: &[u8]) -> Result<Self, SensorError> {
        Self::new(file, files::bands(file, bytes)?)
    }

    /// The sensor with some of its bands, in the given order.
    ///
    /// # Errors
    /// [`SensorError::NoBand`] if one does not exist, [`SensorError::Malformed`] if one is named
    /// twice.
    pub fn only(&self, names: &[&str]) -> Result<Self, SensorError> {
        let band = |name: &&str| {
            let mut bands = self.bands.iter();
            let found = bands.find(|band| band.name().eq_ignore_ascii_case(name));
            found.cloned().ok_or_else(|| SensorError::NoBand {
                sensor: self.name.clone(),
                band: (*name).to_owned(),
                bands: error::listed(self.bands.iter().map(SpectralResponse::name)),
            })
        };
        let bands: Result<_, SensorError> = names.iter().map(band).collect();
        Self::new(&self.name, bands?)
    }

    /// Its name, or the path of its file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Of a built-in sensor, where its responses are from.
    #[must_use]
    pub fn about(&self) -> Option<&'static str> {
        let mut all = BUILT_IN.iter();
        let (_, table) = all.find(|(name, _)| *name == self.name)?;
        table.lines().next()?.strip_prefix("# ")
    }

    /// Its bands, at least one.
    #[must_use]
    pub fn bands(&self) -> &[SpectralResponse] {
        &self.bands
    }

    /// Wavelengths, nm, that serve to simulate all bands: the multiples of `step_nm` that enclose
    /// the bands, within `range_nm`, whose ends count as multiples.
    #[must_use]
    pub fn wavelengths_nm(&self, step_nm: f64, range_nm: (f64, f64)) -> Vec<f64> {
        let mut steps: Vec<i64> = Vec::new();
        let (first, last) = range_nm;
        for band in &self.bands {
            let (from, to) = band.range_nm();
            let (from, to) = (from.max(first), to.min(last));
            if from > to {
                continue;
            }
            steps.extend((from / step_nm).floor() as i64..=(to / step_nm).ceil() as i64);
        }
        steps.sort_unstable();
        let mut nm: Vec<f64> = steps
            .into_iter()
            .map(|step| (step as f64 * step_nm).clamp(first, last))
            .collect();
        nm.dedup();
        nm
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn built_in_sensors_are_as_published() {
        // number of bands, a band, its mean wavelength as published, and by how much it may be off
        for (name, count, band, centre_nm, within) in [
            // ESA: central wavelengths of S2A
            ("sentinel2a", 13, "B8A", 864.7, 0.2),
            ("sentinel2a", 13, "B12", 2202.4, 0.3),
            ("landsat8", 9, "B5", 864.7, 0.3),
            ("modis", 16, "B5", 1241.6, 1.0),
            ("sentinel3_olci", 21, "Oa21", 1020.0, 1e-9),
            ("viirs", 14, "M8", 1240.0, 1e-9),
            ("emit", 284, "E1", 381.0056, 0.02),
            // channel 160 of 2022-08-17, which is not among those interpolated between
            ("emit", 284, "E155", 1528.6551, 0.02),
            ("prisma", 228, "P1", 406.99, 1e-6),
        ] {
            let sensor = Sensor::find(name).unwrap();
            assert_eq!(sensor.bands().len(), count, "{name}");
            let band = sensor.only(&[band]).unwrap();
            let off = band.bands()[0].centre_nm() - centre_nm;
            assert!(off.abs() < within, "{name} {band:?}: {off}");
        }
        for name in Sensor::NAMES {
            for band in Sensor::find(name).unwrap().bands() {
                let (from, to) = band.range_nm();
                assert!(
                    (350.0..=2500.0).contains(&from) && to <= 2500.0,
                    "{name} {band:?}"
                );
            }
        }
    }

    #[test]
    fn wavelengths_enclose_the_bands() {
        let band = |from, to| SpectralResponse::rectangle("b", from, to).unwrap();
        let sensor = Sensor {
            name: "s".into(),
            bands: vec![
                band(352.0, 358.0),
                band(411.0, 420.0),
                band(2496.0, 900_000.0),
                band(3000.0, 3100.0),
            ],
        };
        assert_eq!(
            sensor.wavelengths_nm(5.0, (350.0, 2498.0)),
            [350.0, 355.0, 360.0, 410.0, 415.0, 420.0, 2495.0, 2498.0]
        );
    }

    #[test]
    fn bands_are_chosen_by_name() {
        let sensor = Sensor::find("viirs:i1,M3").unwrap();
        let names: Vec<_> = sensor.bands().iter().map(SpectralResponse::name).collect();
        assert_eq!(names, ["I1", "M3"]);
        for (text, part) in [
            (
                "viirs:M3,M99",
                "viirs has no band `M99`; its bands are M1, M2,",
            ),
            ("viirs:M3,M3", "two bands have the name `M3`"),
            ("sentinel9", "no sensor is named `sentinel9`"),
        ] {
            let message = Sensor::find(text).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
