//! Solar spectra, relative power per nm over the wavelength in nm, with which bands weight
//! wavelengths: ASTM G173-03 and Bird and Riordan 1986 (docs/bands.md).
use std::path::Path;

use super::SensorError;
use crate::spectrum::Table;
use crate::spectrum::measured::{self, Content, ReadOptions};

/// Relative power of sunlight over wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct SolarSpectrum {
    name: String,
    table: Table,
    /// Whether the table holds practically all sunlight, so that shares of it mean something.
    is_whole: bool,
}

impl SolarSpectrum {
    /// Names of the built-in spectra: global, direct and extraterrestrial of ASTM G173-03, global
    /// in a subarctic winter (crates/spectra/data/suns), and the same power at all wavelengths.
    pub const NAMES: [&'static str; 5] = [
        "astm_global",
        "astm_direct",
        "astm_space",
        "subarctic_winter",
        "equal_energy",
    ];

    /// The built-in spectrum of this name, or the one in the file at this path: a table of power
    /// (docs/formats.md, "Measured spectra: what is read").
    ///
    /// # Errors
    /// A [`SensorError`] if it is neither, or the file cannot be used.
    pub fn find(name_or_path: &str) -> Result<Self, SensorError> {
        const ASTM: (&str, &[&str]) = (
            include_str!("../../data/suns/astm_g173.csv"),
            &["wavelength_nm", "extraterrestrial", "global", "direct"],
        );
        const WINTER: (&str, &[&str]) = (
            include_str!("../../data/suns/subarctic_winter.csv"),
            &["wavelength_nm", "power"],
        );
        let ((text, header), column) = match name_or_path {
            "astm_space" => (ASTM, 0),
            "astm_global" => (ASTM, 1),
            "astm_direct" => (ASTM, 2),
            "subarctic_winter" => (WINTER, 0),
            "equal_energy" => {
                let (nm, power) = ([f64::MIN_POSITIVE, 1e9], [1.0, 1.0]);
                return Self::new(name_or_path, &nm, &power);
            }
            path => return Self::read(path),
        };
        let table = Table::parse(name_or_path, text, header);
        let table = table.map_err(|_| SensorError::Sun {
            name: name_or_path.to_owned(),
        })?;
        let sun = Self::new(name_or_path, table.abscissae(), table.column(column))?;
        Ok(Self {
            is_whole: true,
            ..sun
        })
    }

    fn read(path: &str) -> Result<Self, SensorError> {
        if let Err(error) = std::fs::metadata(path) {
            return Err(SensorError::UnknownSun {
                name: path.to_owned(),
                reason: error.to_string(),
            });
        }
        let request = ReadOptions::new(Some(Content::Power), (0.0, f64::INFINITY));
        let curve = measured::read(Path::new(path), &request)?;
        let rows = curve.samples.iter().map(|row| (row.nm, row.value));
        let (nm, power): (Vec<f64>, Vec<f64>) = rows.unzip();
        Self::new(path, &nm, &power)
    }

    /// A spectrum of `power`, in any unit, at `wavelengths_nm`, nm.
    ///
    /// # Errors
    /// [`SensorError::Sun`] if the wavelengths are not finite and strictly increasing, or a
    /// power is negative or not finite.
    pub fn new(name: &str, wavelengths_nm: &[f64], power: &[f64]) -> Result<Self, SensorError> {
        let table = Table::from_column(wavelengths_nm, power);
        match table.filter(|_| power.iter().all(|power| *power >= 0.0)) {
            Some(table) => Ok(Self {
                name: name.to_owned(),
                table,
                is_whole: false,
            }),
            None => Err(SensorError::Sun {
                name: name.to_owned(),
            }),
        }
    }

    /// Its name, or the path of its file.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// First and last wavelength, nm.
    #[must_use]
    pub fn range_nm(&self) -> (f64, f64) {
        self.table.range()
    }

    /// Share of the energy of a built-in spectrum of the sun between two wavelengths, nm. `None` for a
    /// user's, which may hold a part of sunlight only, and for equal energy.
    #[must_use]
    pub fn share(&self, from_nm: f64, to_nm: f64) -> Option<f64> {
        let energy = |from: f64, to: f64| {
            let (first, last) = self.range_nm();
            let (from, to) = (from.max(first), to.min(last));
            let nodes = self.table.abscissae().iter().copied();
            let inside = nodes.filter(|nm| from < *nm && *nm < to);
            let nm: Vec<f64> = [from].into_iter().chain(inside).chain([to]).collect();
            let power = |nm: f64| self.table.linear(0, nm).unwrap_or(0.0);
            let cells = nm.windows(2);
            let cells = cells.map(|nm| (nm[1] - nm[0]) * (power(nm[0]) + power(nm[1])) / 2.0);
            cells.sum::<f64>()
        };
        let (first, last) = self.range_nm();
        self.is_whole
            .then(|| energy(from_nm, to_nm) / energy(first, last))
    }

    pub(super) fn table(&self) -> &Table {
        &self.table
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// ASTM G173-03: 1000.37 W/m2 global, 900.14 direct, 1347.9 extraterrestrial up to 4000 nm.
    #[test]
    fn astm_spectra_have_the_published_energy() {
        for (name, energy) in [
            ("astm_global", 1000.37),
            ("astm_direct", 900.14),
            ("astm_space", 1347.9),
        ] {
            let sun = SolarSpectrum::find(name).unwrap();
            let (nm, power) = (sun.table.abscissae(), sun.table.column(0));
            let cells = nm.windows(2).zip(power.windows(2));
            let cells = cells.map(|(nm, p)| (nm[1] - nm[0]) * (p[0] + p[1]) / 2.0);
            let sum: f64 = cells.sum();
            assert!((sum / energy - 1.0).abs() < 1e-3, "{name}: {sum}");
            let parts = sun.share(280.0, 700.0).unwrap() + sun.share(700.0, 4000.0).unwrap();
            assert!((parts - 1.0).abs() < 1e-12);
        }
        let winter = SolarSpectrum::find("subarctic_winter").unwrap();
        assert!(winter.share(350.0, 2500.0).unwrap() > 0.97);
        assert_eq!(
            SolarSpectrum::find("equal_energy")
                .unwrap()
                .share(350.0, 700.0),
            None
        );
    }

    #[test]
    fn impossible_spectra_are_refused() {
        for (nm, power) in [
            (vec![400.0, 500.0], vec![1.0, -1.0]),
            (vec![400.0, 400.0], vec![1.0, 1.0]),
            (vec![400.0], vec![1.0]),
        ] {
            assert!(SolarSpectrum::new("sun", &nm, &power).is_err());
        }
        let error = SolarSpectrum::find("moon").unwrap_err().to_string();
        assert!(
            error.contains("no solar spectrum is named `moon`"),
            "{error}"
        );
    }
}
