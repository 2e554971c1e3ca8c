//! The operating point of the thesis: analog walks with 1e5 rays per wavelength (Varsa 2025),
//! which is `reference` with that many rays.
//!
//! The baseline is extrapolated, because a run would take long. The error is binomial: every
//! wavelength has its own rays, each of which is reflected, transmitted or neither. The cost is
//! linear in the number of batches of rays. One batch is measured, at every wavelength in the
//! near infrared and at every fifth in visible light, where the cost varies little.
use super::measure::{Bench, Tables, failed, request};
use super::truth::Truth;
use super::{Metrics, NamedSample, Row, RowKind, Setting, SpectralDomain, TradeoffError};
use crate::colour::Colorimeter;
use crate::engine::{BATCH, Engine, Resolution};
use crate::measurement::Quantity;

/// Rays per wavelength of the baseline.
pub const BASELINE_RAYS: u64 = 100_000;
/// Step of the numerical derivatives of a colour; the colour is nearly linear over it.
const STEP: f64 = 1e-6;
/// Number of steps of the integral for the largest error, over 8 standard errors.
const STEPS: usize = 800;

/// The rows of the baseline. There are none if `reference` was not `measured`, or if measuring
/// the cost would exceed the whole budget. `truths` is `[sample][band]`.
pub(super) fn rows(
    bench: &Bench,
    measured: &[Row],
    samples: &[NamedSample],
    truths: &[Vec<Truth>],
) -> Result<Vec<Row>, TradeoffError> {
    let is_reference = |row: &&Row| row.setting.engine == Engine::Reference;
    let most_rays = measured
        .iter()
        .filter(is_reference)
        .map(|r| r.setting.rays)
        .max();
    let Some(rays) = most_rays else {
        return Ok(Vec::new());
    };
    let known: Vec<&Row> = measured
        .iter()
        .filter(is_reference)
        .filter(|row| row.setting.rays == rays && row.quantity == Quantity::Transmittance)
        .collect();
    let batches = BATCH as f64 / rays as f64;
    let expected = known
        .iter()
        .map(|row| batches * row.cpu_seconds[0] / stride(row.band) as f64);
    if expected.sum::<f64>() > bench.budget() {
        return Ok(Vec::new());
    }
    let mut rows = Vec::new();
    for (sample, truths) in samples.iter().zip(truths) {
        for (band, truth) in SpectralDomain::ALL.into_iter().zip(truths) {
            let same = |row: &&&Row| row.sample == sample.name && row.band == band;
            let Some(known) = known.iter().find(same) else {
                continue;
            };
            let seconds = BASELINE_RAYS as f64 / BATCH as f64 * batch_seconds(bench, sample, band)?;
            let colour = band.colorimeter()?;
            rows.extend(Quantity::ALL.map(|quantity| Row {
                setting: setting(BASELINE_RAYS),
                kind: RowKind::Extrapolated,
                seeds: 0,
                quantity,
                cpu_seconds: [seconds; 3],
                error: binomial(&truth.of(quantity), BASELINE_RAYS, colour.as_ref()),
                floor: truth.standard_error(quantity, colour.as_ref()),
                ..(*known).clone()
            }));
        }
    }
    Ok(rows)
}

/// The setting of `reference` with `rays` rays.
fn setting(rays: u64) -> Setting {
    Setting {
        engine: Engine::Reference,
        rays,
        resolution: Resolution::default(),
    }
}

/// One of this many wavelengths is timed.
fn stride(band: SpectralDomain) -> usize {
    match band {
        SpectralDomain::Visible => 5,
        SpectralDomain::NearInfrared => 1,
    }
}

/// CPU seconds of one batch of rays at each wavelength of `band`.
fn batch_seconds(
    bench: &Bench,
    sample: &NamedSample,
    band: SpectralDomain,
) -> Result<f64, TradeoffError> {
    let (setting, thickness) = (setting(BATCH), [sample.file.thickness_m]);
    let wavelengths_nm = band.wavelengths_nm();
    let timed: Vec<f64> = wavelengths_nm
        .iter()
        .copied()
        .step_by(stride(band))
        .collect();
    let seconds = bench.map(&timed, |&nm| {
        let nm = [nm];
        let request = request(&setting, sample, &thickness, &nm, 1);
        let run = bench.run(&setting, &request, &Tables::default());
        let run = run.map_err(|error| failed(sample, &setting, error))?;
        Ok(run.cpu_seconds)
    })?;
    Ok(seconds.iter().sum::<f64>() * wavelengths_nm.len() as f64 / timed.len() as f64)
}

/// Root mean square of each error measure for a spectrum of binomial shares of `rays` rays, with
/// independent rays at each wavelength. The RMSE is exact, the Delta-E is of first order, and the
/// largest error is that of normal variates.
fn binomial(truth: &[f64], rays: u64, colour: Option<&Colorimeter>) -> Metrics {
    let variances: Vec<f64> = truth
        .iter()
        .map(|p| (p * (1.0 - p)).max(0.0) / rays as f64)
        .collect();
    let mean = variances.iter().sum::<f64>() / variances.len() as f64;
    Metrics {
        rmse: mean.sqrt(),
        max_abs: largest_of_normal(&variances),
        delta_e: colour.map(|colour| {
            let slopes = slopes_sq(truth, colour);
            let squares = slopes.iter().zip(&variances).map(|(s, v)| s * v);
            squares.sum::<f64>().sqrt()
        }),
    }
}

/// Square of the colour difference per unit change at each wavelength, to first order.
fn slopes_sq(spectrum: &[f64], colour: &Colorimeter) -> Vec<f64> {
    let changed = |l: usize, step: f64| {
        let mut changed = spectrum.to_vec();
        changed[l] += step;
        changed
    };
    let slope = |l| colour.difference(&changed(l, STEP), &changed(l, -STEP)) / (2.0 * STEP);
    (0..spectrum.len()).map(|l| slope(l).powi(2)).collect()
}

/// Root mean square of the largest magnitude among independent normal variates with these
/// variances: the integral of 2 x P(some magnitude is above x).
fn largest_of_normal(variances: &[f64]) -> f64 {
    let largest_sd = variances.iter().copied().fold(0.0, f64::max).sqrt();
    let step = 8.0 * largest_sd / STEPS as f64;
    let above = |x: f64| {
        let within = |v: &f64| libm::erf(x / (2.0 * v).sqrt());
        let positive = variances.iter().filter(|v| **v > 0.0);
        1.0 - positive.map(within).product::<f64>()
    };
    let midpoint = |i: usize| step * (i as f64 + 0.5);
    let sum: f64 = (0..STEPS).map(midpoint).map(|x| 2.0 * x * above(x)).sum();
    (sum * step).sqrt()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::rng::{Key, Stream};

    #[test]
    fn one_normal_variate_has_its_own_standard_deviation() {
        assert!((largest_of_normal(&[4.0]) - 2.0).abs() < 1e-4);
        assert_eq!(largest_of_normal(&[0.0, 0.0]), 0.0);
        assert!((largest_of_normal(&[4.0, 0.0]) - 2.0).abs() < 1e-4);
        // E max(X^2, Y^2) of two unit normals is 1 + 2/pi.
        let two = largest_of_normal(&[1.0, 1.0]);
        let expected = 1.0 + 2.0 / std::f64::consts::PI;
        assert!((two * two - expected).abs() < 1e-4, "{two}");
    }

    /// Against rays drawn one by one.
    #[test]
    fn the_error_is_that_of_counted_rays() {
        const RAYS: u64 = 1000;
        const RUNS: u64 = 400;
        let band = SpectralDomain::Visible;
        let colour = band.colorimeter().unwrap();
        let nm = band.wavelengths_nm();
        let truth: Vec<f64> = nm.iter().map(|nm| 0.9 - nm / 1000.0).collect();
        let key = |batch| Key {
            seed: 1,
            cell: 0,
            purpose: [7, 7, 7],
            batch,
        };
        let run = |batch| {
            let mut stream = Stream::new(key(batch));
            let mut share = |p: f64| {
                let drawn = (0..RAYS / 8).flat_map(|_| stream.uniform().to_array());
                drawn.filter(|u| *u < p).count() as f64 / RAYS as f64
            };
            let counted: Vec<f64> = truth.iter().map(|p| share(*p)).collect();
            Metrics::between(&counted, &truth, colour.as_ref())
        };
        let runs: Vec<_> = (0..RUNS).map(run).collect();
        let found = Metrics::rms(&runs);
        let expected = binomial(&truth, RAYS, colour.as_ref());
        // A root mean square over n runs has a relative standard error of
        // sqrt((kurtosis - 1) / 4n). One normal variate per run, the worst case,
        // has kurtosis 3: 0.035. Four of them, and 2 % for what is of first order.
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 0.16, "{a} {b}");
        close(found.rmse, expected.rmse);
        close(found.max_abs, expected.max_abs);
        close(found.delta_e.unwrap(), expected.delta_e.unwrap());
    }
}
