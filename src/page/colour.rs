//! `colour` and `light`: colours of spectra, and measured spectra of lights.
use std::str::FromStr;
use std::sync::Arc;

use crate::colour::{Colorimeter, Illuminant, PowerTable, Viewing, encoded_srgb};
use serde::{Deserialize, Serialize};

use super::PageEngine;
use super::limits::check;
use super::refused::Refused;

/// A viewing light as the page sends it.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Light {
    Name(String),
    Table(LightTable),
}

#[derive(Debug, Serialize, Deserialize)]
struct LightTable {
    name: String,
    wavelengths_nm: Vec<f64>,
    power: Vec<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct ColourRequest {
    wavelengths_nm: Vec<f64>,
    spectra: Vec<Vec<f64>>,
    light: Light,
    exposure: Option<f64>,
}

#[derive(Debug, Default, Serialize)]
pub(super) struct ColourAnswer {
    xyz: Vec<[f64; 3]>,
    lab: Vec<[f64; 3]>,
    linear: Vec<[f64; 3]>,
    srgb: Vec<[u8; 3]>,
    clipped: Vec<bool>,
}

/// Largest distance from [0, 1] of a component that counts as shown: a third of the step of
/// eight bits in the darkest colours.
const SHOWN: f64 = 1e-4;

impl ColourRequest {
    pub(super) fn answer(self, engine: &PageEngine) -> Result<ColourAnswer, Refused> {
        check(
            "spectra",
            self.spectra.len() as u64,
            engine.limits.spectra as u64,
        )?;
        let illuminant = match self.light {
            Light::Name(name) => Illuminant::from_str(&name).map_err(Refused::new)?,
            Light::Table(table) => {
                let table = PowerTable::new(&table.name, &table.wavelengths_nm, &table.power);
                Illuminant::Table(Arc::new(table.map_err(Refused::new)?))
            }
        };
        let viewing = Viewing {
            illuminants: vec![illuminant],
            ..Viewing::default()
        };
        let colorimeter = Colorimeter::viewing(&self.wavelengths_nm, &viewing);
        let colorimeter = colorimeter.map_err(Refused::new)?.ok_or_else(|| {
            Refused::new(
                "the wavelengths are not those of a colour; choose several from 400 to 700 nm",
            )
        })?;
        let exposure = self.exposure.unwrap_or(1.0);
        if !(exposure.is_finite() && exposure > 0.0) {
            return Err(Refused::new("the exposure must be above 0"));
        }
        let mut answer = ColourAnswer::default();
        for spectrum in &self.spectra {
            if spectrum.len() != self.wavelengths_nm.len() {
                return Err(Refused::new(format!(
                    "a spectrum has {} values for {} wavelengths",
                    spectrum.len(),
                    self.wavelengths_nm.len()
                )));
            }
            let lab = colorimeter.lab(spectrum);
            let linear = colorimeter.linear_srgb(spectrum).map(|c| c * exposure);
            let shown = encoded_srgb(linear.map(|c| c.clamp(0.0, 1.0)));
            answer.xyz.push(colorimeter.xyz(spectrum));
            answer.lab.push([lab.l, lab.a, lab.b]);
            answer.srgb.push(shown.map(|c| (255.0 * c).round() as u8));
            let is_outside = |c: &f64| !(-SHOWN..=1.0 + SHOWN).contains(c);
            answer.clipped.push(linear.iter().any(is_outside));
            answer.linear.push(linear);
        }
        Ok(answer)
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct LightRequest {
    name: String,
    text: String,
}

#[derive(Debug, Serialize)]
pub(super) struct LightAnswer {
    light: LightTable,
    notes: Vec<String>,
}

impl LightRequest {
    pub(super) fn answer(self) -> Result<LightAnswer, Refused> {
        let read = Illuminant::parse(&self.name, self.text.as_bytes());
        let (Illuminant::Table(table), report) = read.map_err(Refused::new)? else {
            return Err(Refused::new("the file is not a table of relative power"));
        };
        Ok(LightAnswer {
            light: LightTable {
                wavelengths_nm: table.wavelengths_nm().to_vec(),
                power: table.power().to_vec(),
                name: self.name.clone(),
            },
            notes: vec![format!("read {}: {report}", self.name)],
        })
    }
}
