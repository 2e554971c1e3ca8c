//! Averages of spectra over bands. A spectrum must have wavelengths at most 30 nm apart within a
//! band, and cover 99 % of its weight.
use super::{Sensor, SensorError, SolarSpectrum, SpectralResponse, error};

/// Largest distance between two wavelengths of a spectrum within a band, nm: over wider gaps a
/// straight line could hide an absorption band of ice.
pub const MAX_GAP_NM: f64 = 30.0;
/// Smallest share of the weight of a band that the wavelengths of a spectrum must cover.
const MIN_COVERED: f64 = 0.99;

/// Weights that turn a spectrum into the values of bands.
#[derive(Debug, Clone, PartialEq)]
pub struct BandAverages {
    /// For each band, the weight of each wavelength; they add up to 1.
    weights: Vec<Vec<f64>>,
}

impl BandAverages {
    /// The weights of the bands of `sensor` under `sun`, for spectra at `wavelengths_nm`, nm,
    /// increasing.
    ///
    /// # Errors
    /// [`SensorError::Uncovered`] if the wavelengths do not reach over 99 % of the weight of a
    /// band, or leave a gap of more than [`MAX_GAP_NM`] in it; [`SensorError::DarkSun`] if the
    /// solar spectrum does not cover a band.
    pub fn new(
        sensor: &Sensor,
        sun: &SolarSpectrum,
        wavelengths_nm: &[f64],
    ) -> Result<Self, SensorError> {
        let (mut weights, mut missing, mut covered) = (Vec::new(), Vec::new(), Vec::new());
        for band in sensor.bands() {
            match band_weights(band, sun, wavelengths_nm)? {
                Some(row) => {
                    weights.push(row);
                    covered.push(band.name());
                }
                None => missing.push(band),
            }
        }
        if missing.is_empty() {
            return Ok(Self { weights });
        }
        let ends = missing.iter().map(|band| band.range_nm());
        let names = missing.iter().map(|band| band.name());
        Err(SensorError::Uncovered {
            sensor: sensor.name().to_owned(),
            missing: error::listed(names),
            given_nm: match wavelengths_nm {
                [] | [_] => wavelengths_nm.first().map(|nm| (*nm, *nm, None)),
                [first, .., last] => {
                    let steps = wavelengths_nm.windows(2).map(|pair| pair[1] - pair[0]);
                    let widest = steps.fold(0.0, f64::max);
                    Some((*first, *last, (widest > MAX_GAP_NM).then_some(widest)))
                }
            },
            needed_nm: ends.fold((f64::INFINITY, 0.0_f64), |(from, to), band| {
                (from.min(band.0), to.max(band.1))
            }),
            covered: (!covered.is_empty()).then(|| covered.join(",")),
        })
    }

    /// For each band, the weight of each wavelength; they add up to 1.
    #[must_use]
    pub fn weights(&self) -> &[Vec<f64>] {
        &self.weights
    }

    /// The values of the bands.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per wavelength.
    #[must_use]
    pub fn values(&self, spectrum: &[f64]) -> Vec<f64> {
        let of = |row: &Vec<f64>| {
            assert_eq!(row.len(), spectrum.len(), "one value per wavelength");
            row.iter().zip(spectrum).map(|(w, v)| w * v).sum()
        };
        self.weights.iter().map(of).collect()
    }

    /// Standard errors of the values of the bands, from those of a spectrum. Where the errors of
    /// wavelengths are `independent`, their squares are added. Otherwise they come from the same
    /// walks and are mostly positively correlated; then the errors themselves are added, which is an upper
    /// bound for any correlation.
    #[must_use]
    pub fn errors(&self, errors: &[f64], independent: bool) -> Vec<f64> {
        if !independent {
            return self.values(errors);
        }
        let of = |row: &Vec<f64>| {
            let squares = row.iter().zip(errors).map(|(w, se)| (w * se) * (w * se));
            squares.sum::<f64>().sqrt()
        };
        self.weights.iter().map(of).collect()
    }
}

/// The weights of a band; `None` if the wavelengths do not cover it.
fn band_weights(
    band: &SpectralResponse,
    sun: &SolarSpectrum,
    wavelengths_nm: &[f64],
) -> Result<Option<Vec<f64>>, SensorError> {
    let (response, power) = (band.table(), sun.table());
    let (from, to) = band.range_nm();
    let dark = || SensorError::DarkSun {
        sun: sun.name().to_owned(),
        band: band.name().to_owned(),
        needed_nm: (from, to),
        given_nm: sun.range_nm(),
    };
    let (sun_from, sun_to) = sun.range_nm();
    if from < sun_from || sun_to < to {
        return Err(dark());
    }
    let nodes = [response.abscissae(), power.abscissae(), wavelengths_nm];
    let nodes = nodes.into_iter().flatten().copied();
    let mut nm: Vec<f64> = nodes.filter(|nm| (from..=to).contains(nm)).collect();
    nm.sort_by(f64::total_cmp);
    nm.dedup();

    let mut weights = vec![0.0; wavelengths_nm.len()];
    let (mut whole, mut used) = (0.0, 0.0);
    let density = |nm: f64| {
        let both = response.linear(0, nm).zip(power.linear(0, nm));
        both.map_or(0.0, |(response, power)| response * power)
    };
    for cell in nm.windows(2) {
        let (a, b) = (cell[0], cell[1]);
        // Simpson's rule is exact: all three are linear within the cell
        let middle = f64::midpoint(a, b);
        let parts = [(a, 1.0), (middle, 4.0), (b, 1.0)];
        let parts = parts.map(|(nm, factor)| (nm, factor * (b - a) / 6.0 * density(nm)));
        let sum: f64 = parts.iter().map(|(_, part)| part).sum();
        whole += sum;
        let above = wavelengths_nm.partition_point(|nm| *nm <= middle);
        let Some((&next, below)) = wavelengths_nm.get(above).zip(above.checked_sub(1)) else {
            continue;
        };
        let here = wavelengths_nm[below];
        if next - here > MAX_GAP_NM {
            return Ok(None);
        }
        used += sum;
        for (nm, part) in parts {
            let t = (nm - here) / (next - here);
            weights[below] += (1.0 - t) * part;
            weights[above] += t * part;
        }
    }
    if whole <= 0.0 {
        return Err(dark());
    }
    if used < MIN_COVERED * whole {
        return Ok(None);
    }
    let total: f64 = weights.iter().sum();
    Ok(Some(weights.iter().map(|weight| weight / total).collect()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn one(band: Result<SpectralResponse, String>) -> Sensor {
        Sensor::new("s", vec![band.unwrap()]).unwrap()
    }

    fn sun(nm: &[f64], power: &[f64]) -> SolarSpectrum {
        SolarSpectrum::new("sun", nm, power).unwrap()
    }

    /// Spectrum x, sun x, response x from 0 at 1 to 1 at 2, by hand: with y = x - 1 in [0, 1],
    /// the integral of (1 + y) (1 + y) y over that of (1 + y) y, (17/12) / (5/6).
    #[test]
    fn products_of_lines_are_integrated_exactly() {
        let response = SpectralResponse::new("b", &[10.0, 20.0], &[0.0, 1.0]);
        let sensor = one(response);
        let sun = sun(&[10.0, 20.0], &[1.0, 2.0]);
        let averages = BandAverages::new(&sensor, &sun, &[5.0, 14.0, 25.0]).unwrap();
        let value = averages.values(&[0.5, 1.4, 2.5])[0];
        assert!((value - 17.0 / 12.0 * 6.0 / 5.0).abs() < 1e-14, "{value}");
    }

    #[test]
    fn constants_stay_and_narrow_bands_are_the_spectrum() {
        let nm: Vec<f64> = (0..=430).map(|i| 350.0 + 5.0 * f64::from(i)).collect();
        let spectrum: Vec<f64> = nm.iter().map(|nm| 0.5 + 0.4 * (nm / 90.0).sin()).collect();
        for name in SolarSpectrum::NAMES {
            let sun = SolarSpectrum::find(name).unwrap();
            for sensor in Sensor::NAMES {
                let sensor = Sensor::find(sensor).unwrap();
                let averages = BandAverages::new(&sensor, &sun, &nm).unwrap();
                for value in averages.values(&vec![0.7; nm.len()]) {
                    assert!((value - 0.7).abs() < 1e-12);
                }
            }
            let narrow = one(SpectralResponse::gaussian("b", 1000.0, 0.1));
            let averages = BandAverages::new(&narrow, &sun, &nm).unwrap();
            let value = averages.values(&spectrum)[0];
            assert!((value - spectrum[130]).abs() < 1e-4, "{name}: {value}");
        }
    }

    #[test]
    fn errors_add_up() {
        let sensor = one(SpectralResponse::rectangle("b", 400.0, 420.0));
        let sun = SolarSpectrum::find("equal_energy").unwrap();
        let averages = BandAverages::new(&sensor, &sun, &[400.0, 420.0]).unwrap();
        assert_eq!(averages.weights()[0], [0.5, 0.5]);
        assert!((averages.errors(&[0.3, 0.4], false)[0] - 0.35).abs() < 1e-15);
        assert!((averages.errors(&[0.3, 0.4], true)[0] - 0.25).abs() < 1e-15);
    }

    #[test]
    fn bands_beyond_the_wavelengths_are_refused() {
        let sensor = Sensor::find("sentinel2a").unwrap();
        let sun = SolarSpectrum::find("astm_global").unwrap();
        let nm: Vec<f64> = (0..=30).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
        let message = BandAverages::new(&sensor, &sun, &nm)
            .unwrap_err()
            .to_string();
        assert_eq!(
            message,
            "sentinel2a: the wavelengths (400 to 700 nm) do not cover B5, B6, B7, B8, B8A, B9, B10, B11, B12; needed are 695 to 2316 nm in steps of at most 30 nm\n  help: give such wavelengths, or choose bands that are covered: sentinel2a:B1,B2,B3,B4"
        );
        let sparse = BandAverages::new(&sensor, &sun, &[400.0, 700.0, 2500.0]);
        assert!(matches!(
            sparse,
            Err(SensorError::Uncovered { covered: None, .. })
        ));
        assert!(BandAverages::new(&sensor, &sun, &[]).is_err());
        let short = SolarSpectrum::new("sun", &[400.0, 500.0], &[1.0, 1.0]).unwrap();
        let error = BandAverages::new(&sensor, &short, &nm).unwrap_err();
        assert!(matches!(error, SensorError::DarkSun { .. }), "{error}");
    }
}
