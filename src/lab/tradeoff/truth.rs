//! Converged spectra (truths) against which errors are measured, stored in files.
use std::fmt::Write;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::measure::{Bench, Tables, failed, request};
use super::{Metrics, NamedSample, Setting, SpectralDomain, TradeoffError};
use crate::atomic;
use crate::colour::Colorimeter;
use crate::engine::{Engine, Resolution};
use crate::measurement::{Quantity, Spectrum};
use crate::optics::data_files;

/// Number of independent runs that make up one truth, with equal numbers of rays. Their scatter
/// gives the standard error of the truth in every measure, including correlations between
/// wavelengths.
const PARTS: u64 = 8;
/// Seed of the truth; measured runs have the seeds 1, 2, ...
const SEED: u64 = 1 << 32;
/// Rays of the run that measures the cost of a ray.
const PILOT_RAYS: u64 = 256;
/// Smallest and largest number of rays chosen automatically.
const RAYS: (u64, u64) = (1 << 10, 1 << 26);

/// The truth of one sample in one band.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Truth {
    /// All inputs that determine the truth, except the number of rays.
    inputs: String,
    /// Rays of all parts together.
    pub(super) rays: u64,
    /// Reflectance, `[part][wavelength]`.
    reflectance: Vec<Vec<f64>>,
    /// Transmittance, `[part][wavelength]`.
    transmittance: Vec<Vec<f64>>,
}

impl Truth {
    /// The spectra of the parts, `[part][wavelength]`.
    fn parts(&self, quantity: Quantity) -> &[Vec<f64>] {
        match quantity {
            Quantity::Transmittance => &self.transmittance,
            Quantity::Reflectance => &self.reflectance,
        }
    }

    /// The spectrum, the mean of the parts.
    pub(super) fn of(&self, quantity: Quantity) -> Vec<f64> {
        let parts = self.parts(quantity);
        let wavelengths = parts.first().map_or(0, Vec::len);
        let mean = |l| parts.iter().map(|part| part[l]).sum::<f64>() / parts.len() as f64;
        (0..wavelengths).map(mean).collect()
    }

    /// Standard error of the spectrum in each measure, from the scatter of the parts; smaller
    /// errors cannot be resolved. Exact for the RMSE, of first order for the others.
    pub(super) fn standard_error(
        &self,
        quantity: Quantity,
        colour: Option<&Colorimeter>,
    ) -> Metrics {
        let (parts, mean) = (self.parts(quantity), self.of(quantity));
        let distances: Vec<_> = parts
            .iter()
            .map(|part| Metrics::between(part, &mean, colour))
            .collect();
        // The mean square distance of n values from their mean is n - 1 times the variance of
        // that mean.
        Metrics::rms(&distances).scaled((parts.len() as f64 - 1.0).powf(-0.5))
    }
}

/// The settings of truths and the folder that stores them.
pub(super) struct Truths<'a> {
    pub(super) bench: &'a Bench<'a>,
    pub(super) engine: Engine,
    /// Rays requested; `None` for as many as [`Truths::SHARE`] of the budget allows.
    pub(super) rays: Option<u64>,
    pub(super) folder: PathBuf,
}

impl Truths<'_> {
    /// Share of the budget that may be spent when the truths have been computed.
    pub(super) const SHARE: f64 = 0.45;

    /// The truth of every sample in each band: `[sample][band]`.
    pub(super) fn all(
        &self,
        samples: &[NamedSample],
        say: &dyn Fn(&str),
    ) -> Result<Vec<Vec<Truth>>, TradeoffError> {
        let (rays, required) = match self.rays {
            Some(rays) => (rays, rays),
            None => {
                let rays = self.affordable(samples)?;
                // A stored truth with half as many rays is accepted, because the measured cost of a
                // ray varies from run to run.
                (rays, rays / 2)
            }
        };
        let truths_of = |sample| {
            let truth = |band| self.truth(sample, band, rays, required, say);
            SpectralDomain::ALL.into_iter().map(truth).collect()
        };
        samples.iter().map(truths_of).collect()
    }

    /// The largest power of two of rays, the same for all truths, within the share of the budget.
    fn affordable(&self, samples: &[NamedSample]) -> Result<u64, TradeoffError> {
        let cases: Vec<_> = samples
            .iter()
            .flat_map(|sample| SpectralDomain::ALL.map(|band| (sample, band)))
            .collect();
        let seconds = self.bench.map(&cases, |&(sample, band)| {
            let run = self.part(sample, band, PILOT_RAYS, 0)?;
            Ok(run.1)
        })?;
        let per_ray = seconds.iter().sum::<f64>() / PILOT_RAYS as f64;
        let rays = self.bench.left_of(Self::SHARE) / per_ray.max(f64::MIN_POSITIVE);
        let exponent = rays.max(1.0).log2().floor();
        Ok((exponent.exp2() as u64).clamp(RAYS.0, RAYS.1))
    }

    /// The stored truth if it has at least `required` rays, else a new one with `rays` rays, which
    /// is then stored.
    fn truth(
        &self,
        sample: &NamedSample,
        band: SpectralDomain,
        rays: u64,
        required: u64,
        say: &dyn Fn(&str),
    ) -> Result<Truth, TradeoffError> {
        let inputs = self.inputs(sample, band)?;
        let mut name = format!("{}-{}-", sample.name, band.name());
        for byte in Sha256::digest(&inputs).iter().take(4) {
            let _ = write!(name, "{byte:02x}");
        }
        let path = self.folder.join(name + ".json");
        if let Some(truth) = stored_truth(&path, &inputs, required) {
            return Ok(truth);
        }
        say(&format!("truth of {}, {}", sample.name, band.name()));
        let per_part = rays.div_ceil(PARTS);
        let parts: Vec<u64> = (0..PARTS).collect();
        let spectra = self.bench.map(&parts, |&part| {
            Ok(self.part(sample, band, per_part, part)?.0)
        })?;
        let parts_of = |quantity| spectra.iter().map(|s| values(s, quantity)).collect();
        let truth = Truth {
            inputs,
            rays: per_part * PARTS,
            reflectance: parts_of(Quantity::Reflectance),
            transmittance: parts_of(Quantity::Transmittance),
        };
        let written = serde_json::to_vec(&truth)
            .map_err(io::Error::from)
            .and_then(|bytes| atomic::write(&path, &bytes));
        written.map_err(|source| TradeoffError::Io { path, source })?;
        Ok(truth)
    }

    /// One run with its own random streams; returns the spectrum and the CPU seconds.
    fn part(
        &self,
        sample: &NamedSample,
        band: SpectralDomain,
        rays: u64,
        part: u64,
    ) -> Result<(Spectrum, f64), TradeoffError> {
        let setting = self.setting(rays);
        let nm = band.wavelengths_nm();
        let thickness = [sample.file.thickness_m];
        // Every part has its own seed, because tables depend on the seed but not on the cell.
        let request = request(&setting, sample, &thickness, &nm, SEED + part);
        let mut run = self
            .bench
            .run(&setting, &request, &Tables::default())
            .map_err(|error| failed(sample, &setting, error))?;
        Ok((run.spectra.pop().unwrap_or_default(), run.cpu_seconds))
    }

    /// The setting of the truth's engine with `rays` rays.
    fn setting(&self, rays: u64) -> Setting {
        Setting {
            engine: self.engine,
            rays,
            resolution: Resolution::default(),
        }
    }

    /// All inputs that determine a truth, except the number of rays, as text.
    fn inputs(&self, sample: &NamedSample, band: SpectralDomain) -> Result<String, TradeoffError> {
        let file = &sample.file;
        let wet = file.snowpack.is_wet();
        let longest_nm = band.wavelengths_nm().last().copied().unwrap_or_default();
        let water = wet.then_some(&file.model.water);
        let data = data_files(file.model.ice, water, longest_nm)
            .map_err(|error| failed(sample, &self.setting(0), error.into()))?;
        let mut inputs = format!(
            "splitsnow {}\nengine {}\nresolution {:?}\nseed {SEED}, {PARTS} parts\nwavelengths_nm {:?}\n",
            env!("CARGO_PKG_VERSION"),
            self.engine.name(),
            Resolution::default(),
            band.wavelengths_nm(),
        );
        for file in data {
            let digest = Sha256::digest(&file.bytes);
            let _ = writeln!(inputs, "{} {:?}", file.name, &digest[..]);
        }
        Ok(inputs + file.to_toml())
    }
}

/// The values of `quantity` without their standard errors.
pub(super) fn values(spectrum: &Spectrum, quantity: Quantity) -> Vec<f64> {
    spectrum.of(quantity).iter().map(|m| m.value).collect()
}

/// The truth of `inputs` in the file at `path`; `None` if the file is missing, incomplete, of
/// other inputs, or has fewer than `rays` rays.
fn stored_truth(path: &Path, inputs: &str, rays: u64) -> Option<Truth> {
    let truth: Truth = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
    let wavelengths = truth.transmittance.first()?.len();
    let is_complete = |parts: &[Vec<f64>]| {
        parts.len() as u64 == PARTS && parts.iter().all(|part| part.len() == wavelengths)
    };
    let matches = truth.inputs == inputs && truth.rays >= rays;
    let complete =
        wavelengths > 0 && is_complete(&truth.transmittance) && is_complete(&truth.reflectance);
    (matches && complete).then_some(truth)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn truth() -> Truth {
        let parts = |sign: f64| {
            (0..PARTS as u32)
                .map(|i| vec![0.5 + sign * 0.01 * f64::from(i), 0.25])
                .collect()
        };
        Truth {
            inputs: "these".into(),
            rays: 800,
            reflectance: parts(1.0),
            transmittance: parts(-1.0),
        }
    }

    /// The standard error of the mean of 0, ..., 7 is sqrt(6 / 8).
    #[test]
    fn the_standard_error_is_that_of_the_mean() {
        let truth = truth();
        let mean = truth.of(Quantity::Reflectance);
        assert!((mean[0] - 0.535).abs() < 1e-15 && mean[1] == 0.25);
        let found = truth.standard_error(Quantity::Reflectance, None);
        let expected = 0.01 * 0.75_f64.sqrt();
        assert!((found.max_abs - expected).abs() < 1e-15, "{found:?}");
        assert!((found.rmse - expected / 2.0_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_file_is_used_only_if_it_matches_and_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.json");
        assert_eq!(stored_truth(&path, "these", 1), None);
        let write = |truth: &Truth| fs::write(&path, serde_json::to_vec(truth).unwrap()).unwrap();
        write(&truth());
        assert_eq!(stored_truth(&path, "these", 800), Some(truth()));
        assert_eq!(stored_truth(&path, "these", 801), None);
        assert_eq!(stored_truth(&path, "those", 1), None);
        let mut torn = truth();
        torn.reflectance.pop();
        write(&torn);
        assert_eq!(stored_truth(&path, "these", 1), None);
        let mut ragged = truth();
        ragged.transmittance[3].pop();
        write(&ragged);
        assert_eq!(stored_truth(&path, "these", 1), None);
        fs::write(&path, "{").unwrap();
        assert_eq!(stored_truth(&path, "these", 1), None);
    }
}
