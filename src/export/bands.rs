//! Tables of band averages: the axis of wavelengths becomes one of bands.
use ndarray::{ArrayD, ArrayView1, Axis};

use super::{ExportError, ExportTable, ExportVariable};
use crate::sensor::{BandAverages, Sensor, SensorError, SolarSpectrum, SpectralResponse};
use crate::store::{Variable, WAVELENGTH};

impl ExportTable {
    /// The averages over the bands of `sensor` under `sun`. The axis `wavelength_nm` then holds the
    /// response-weighted mean wavelengths of the bands, which are sorted by them; the attributes
    /// `bands`, `bands_sensor` and `bands_sun` say what they are. Standard errors are upper bounds
    /// for any correlation between wavelengths. Anisotropy factors are the ratio of the averages.
    ///
    /// # Errors
    /// [`ExportError::Sensor`] if the wavelengths do not cover the bands,
    /// [`ExportError::SameCentre`] if two bands have the same mean wavelength.
    pub fn over_bands(mut self, sensor: &Sensor, sun: &SolarSpectrum) -> Result<Self, ExportError> {
        let mut bands: Vec<&SpectralResponse> = sensor.bands().iter().collect();
        bands.sort_by(|a, b| a.centre_nm().total_cmp(&b.centre_nm()));
        for pair in bands.windows(2) {
            if pair[0].centre_nm() >= pair[1].centre_nm() {
                return Err(ExportError::SameCentre {
                    sensor: sensor.name().to_owned(),
                    bands: [0, 1].map(|i| pair[i].name().to_owned()),
                    centre_nm: pair[0].centre_nm(),
                });
            }
        }
        let names: Vec<&str> = bands.iter().map(|band| band.name()).collect();
        let Some(position) = self.axes.iter().position(|(name, _)| *name == WAVELENGTH) else {
            return Ok(self);
        };
        let averages = BandAverages::new(&sensor.only(&names)?, sun, &self.axes[position].1)?;
        let average = |variable: ExportVariable, array: &ArrayD<f32>| {
            let is_error = matches!(variable, ExportVariable::Stored(v) if v.is_error);
            over_bands(array, Axis(position), &averages, is_error)
        };
        let mut averaged: Vec<(ExportVariable, ArrayD<f32>)> = Vec::new();
        for (variable, array) in &self.quantities {
            let values = match *variable {
                ExportVariable::AnisotropyFactor { is_diffuse } => {
                    let of = |variable: Variable| {
                        let variable = ExportVariable::Stored(Variable {
                            is_diffuse,
                            ..variable
                        });
                        averaged.iter().find(|(other, _)| *other == variable)
                    };
                    let factors = of(Variable::REFLECTANCE.toward_views());
                    match factors.zip(of(Variable::REFLECTANCE)) {
                        Some(((_, factors), (_, totals))) => factors / totals,
                        None => continue,
                    }
                }
                ExportVariable::Stored(_) => average(*variable, array),
            };
            averaged.push((*variable, values));
        }
        self.quantities = averaged;
        self.axes[position].1 = bands.iter().map(|band| band.centre_nm()).collect();
        for (key, value) in [
            ("bands", names.join(",")),
            ("bands_sensor", sensor.name().to_owned()),
            ("bands_sun", sun.name().to_owned()),
        ] {
            self.attributes.insert(key.to_owned(), value);
        }
        Ok(self)
    }

    /// Names and mean wavelengths, nm, of the bands of [`Self::over_bands`].
    #[must_use]
    pub fn bands(&self) -> Vec<(&str, f64)> {
        let names = self.attributes.get("bands").map(|names| names.split(','));
        let axis = self.axes.iter().find(|(name, _)| *name == WAVELENGTH);
        let both = names.zip(axis);
        both.map_or(Vec::new(), |(names, (_, nm))| {
            names.zip(nm.iter().copied()).collect()
        })
    }
}

/// `array` with bands in place of the wavelengths on `axis`.
fn over_bands(
    array: &ArrayD<f32>,
    axis: Axis,
    averages: &BandAverages,
    is_error: bool,
) -> ArrayD<f32> {
    let mut shape = array.raw_dim();
    shape[axis.0] = averages.weights().len();
    let mut out = ArrayD::zeros(shape);
    let average = |lane: ArrayView1<f32>| {
        let lane: Vec<f64> = lane.iter().copied().map(f64::from).collect();
        match is_error {
            true => averages.errors(&lane, false),
            false => averages.values(&lane),
        }
    };
    for (mut to, from) in out.lanes_mut(axis).into_iter().zip(array.lanes(axis)) {
        for (to, value) in to.iter_mut().zip(average(from)) {
            *to = value as f32;
        }
    }
    out
}

impl From<SensorError> for ExportError {
    fn from(error: SensorError) -> Self {
        Self::Sensor(Box::new(error))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::export::table::tests::database;

    fn sensor(table: &str) -> Sensor {
        Sensor::parse("mine", format!("band,from_nm,to_nm\n{table}").as_bytes()).unwrap()
    }

    #[test]
    fn bands_are_averages_at_every_node() {
        let table = ExportTable::of_compact(&database()).unwrap();
        // wide gaps are refused, so the wavelengths are taken as 400, 410, 420 and 430 nm
        let mut close = table.clone();
        close.axes.last_mut().unwrap().1 = vec![400.0, 410.0, 420.0, 430.0];
        let sun = SolarSpectrum::find("equal_energy").unwrap();
        let bands = sensor("late,410,430\nearly,400,410\n");
        let found = close.clone().over_bands(&bands, &sun).unwrap();
        assert_eq!(found.bands(), [("early", 405.0), ("late", 420.0)]);
        assert_eq!(found.attributes["bands_sensor"], "mine");
        for ((_, before), (_, after)) in close.quantities.iter().zip(&found.quantities) {
            let lanes = before.lanes(Axis(6)).into_iter();
            for (before, after) in lanes.zip(after.lanes(Axis(6))) {
                assert!((after[0] - (before[0] + before[1]) / 2.0).abs() < 1e-7);
                let late = (before[1] + 2.0 * before[2] + before[3]) / 4.0;
                assert!((after[1] - late).abs() < 1e-7);
            }
        }
        let same = close.over_bands(&sensor("a,400,420\nb,405,415\n"), &sun);
        let message = same.unwrap_err().to_string();
        assert!(message.contains("a and b"), "{message}");
        let gaps = table.over_bands(&bands, &sun).unwrap_err().to_string();
        assert!(gaps.contains("do not cover early, late"), "{gaps}");
    }
}
