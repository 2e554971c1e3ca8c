//! `measured`: a measured spectrum beside a simulated one.
use crate::comparison::RANGE_NM;
use crate::comparison::ResidualStatistics;
use crate::comparison::{Band, Comparison, Exclusion, Hints, MeasuredSpectrum, longest_nm};
use crate::measurement::{Measured, Quantity};
use serde::{Deserialize, Serialize};

use super::limits;
use super::refused::Refused;

/// Cells of a file; one with a thousandth of them is fine for any instrument. A cell takes up to
/// 60 bytes of memory while the file is read.
const MOST_CELLS: u32 = 1_000_000;

#[derive(Debug, Deserialize)]
pub(super) struct MeasuredRequest {
    name: String,
    text: String,
    wavelengths_nm: Vec<f64>,
    reflectance: Vec<f64>,
    reflectance_se: Vec<f64>,
    transmittance: Vec<f64>,
    transmittance_se: Vec<f64>,
}

#[derive(Debug, Serialize)]
pub(super) struct MeasuredAnswer {
    quantity: &'static str,
    notes: Vec<String>,
    wavelengths_nm: Vec<f64>,
    values: Vec<f64>,
    residuals: Vec<Residual>,
    overall: Option<Statistics>,
    bands: Vec<BandStatistics>,
}

#[derive(Debug, Serialize)]
struct Residual {
    nm: f64,
    measured: f64,
    simulated: f64,
    residual: f64,
    excluded: bool,
}

#[derive(Debug, Serialize)]
struct Statistics {
    points: usize,
    rmse: f64,
    bias: f64,
}

#[derive(Debug, Serialize)]
struct BandStatistics {
    name: &'static str,
    from_nm: f64,
    to_nm: f64,
    #[serde(flatten)]
    statistics: Statistics,
}

impl From<ResidualStatistics> for Statistics {
    fn from(statistics: ResidualStatistics) -> Self {
        Self {
            points: statistics.points,
            rmse: statistics.rmse,
            bias: statistics.bias,
        }
    }
}

impl MeasuredRequest {
    pub(super) fn answer(self) -> Result<MeasuredAnswer, Refused> {
        let columns = [
            &self.reflectance,
            &self.reflectance_se,
            &self.transmittance,
            &self.transmittance_se,
        ];
        let increasing = self.wavelengths_nm.is_sorted_by(|a, b| a < b);
        if !increasing
            || columns
                .iter()
                .any(|column| column.len() != self.wavelengths_nm.len())
        {
            return Err(Refused::new(
                "the simulated spectrum needs increasing wavelengths and a value for each",
            ));
        }
        let separated = self.text.matches([',', ';', '\t', '|']).count();
        let cells = (self.text.split_whitespace().count() + separated) as u64;
        limits::check("cells of the file", cells, MOST_CELLS)?;
        let bytes = self.text.as_bytes();
        let longest = longest_nm(&self.wavelengths_nm);
        let hints = Hints {
            longest_nm: Some(longest),
            ..Hints::default()
        };
        let exclusions = Exclusion::field(longest);
        let measured =
            MeasuredSpectrum::parse(&self.name, bytes, &hints, exclusions).map_err(Refused::new)?;
        let matched = measured.at(&self.wavelengths_nm).map_err(Refused::new)?;
        let (value, se) = match measured.quantity() {
            Quantity::Reflectance => (&self.reflectance, &self.reflectance_se),
            Quantity::Transmittance => (&self.transmittance, &self.transmittance_se),
        };
        let pairs = value.iter().zip(se);
        let simulated: Vec<Measured> = pairs
            .map(|(value, se)| Measured {
                value: *value,
                se: *se,
            })
            .collect();
        let comparison = Comparison::new(&matched, &simulated);
        let residuals = comparison.points.iter().map(|point| Residual {
            nm: point.matched.nm,
            measured: point.matched.value,
            simulated: point.simulated.value,
            residual: point.residual(),
            excluded: point.matched.excluded,
        });
        let bands = Band::ALL.into_iter().filter_map(|band| {
            let (from_nm, to_nm) = band.range_nm();
            Some(BandStatistics {
                name: band.name(),
                from_nm: from_nm.max(RANGE_NM.0),
                to_nm: to_nm.min(RANGE_NM.1),
                statistics: comparison.band(band)?.into(),
            })
        });
        let samples = measured.samples();
        Ok(MeasuredAnswer {
            quantity: measured.quantity().name(),
            notes: vec![format!("read {}: {}", self.name, measured.report())],
            wavelengths_nm: samples.iter().map(|sample| sample.nm).collect(),
            values: samples.iter().map(|sample| sample.value).collect(),
            residuals: residuals.collect(),
            overall: comparison.overall().map(Statistics::from),
            bands: bands.collect(),
        })
    }
}
