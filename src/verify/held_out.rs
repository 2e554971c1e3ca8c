//! Fresh simulations at random points within the box of the axes: how well the
//! bases of the compact file express spectra they were not made from.
//!
//! Only the projection is measured: what compression does to a new spectrum.
//! Interpolation between nodes is not part of it. A fresh spectrum carries
//! noise that no basis expresses, so each is simulated in independent parts,
//! and the standard error of what the projection leaves out (as a vector, over
//! wavelengths or over Lab) is measured from how the parts disagree, however
//! the noise of wavelengths goes together. A bound is broken only where an
//! error exceeds it by more than about ten such standard errors.
use rand::Rng;

use super::compact::{stated, summary};
use super::fresh::{Simulations, random, uniform};
use super::{Check, FALSE_ALARM, Figure, Subject, VerifyError};
use crate::compress::CurveError;
use crate::engine::Control;
use crate::lookup::{Database, Point};
use crate::measurement::{Quantity, Spectrum};

/// Independent parts of one simulation.
const PARTS: u64 = 16;
/// Random points lie on this many steps along each axis, so that a message
/// tells them in few digits.
const STEPS: f64 = 1000.0;

/// How many standard errors a bound must be exceeded by, so that one of
/// `points` does so by chance with about [`FALSE_ALARM`]: Student's t of 15
/// degrees of freedom exceeds 10 with a probability of 2.5e-8, which 4 x 12
/// comparisons of 12 points add up to that, and falls off by about its 14th power.
fn margin(points: usize) -> f64 {
    10.0 * (points as f64 / 12.0).powf(1.0 / 14.0)
}

pub(super) fn simulations(subject: &Subject<'_>) -> Simulations {
    let mut random = random(subject, "held out");
    let seed = random.next_u64();
    let axes = subject.store.axes().named();
    let point = |_| {
        Point::from_coordinates(axes.map(|(_, values)| {
            let first = values.first().copied().unwrap_or_default();
            let last = values.last().copied().unwrap_or_default();
            first + (last - first) * (STEPS * uniform(&mut random)).round() / STEPS
        }))
    };
    let points = (0..subject.options.samples).map(point).collect();
    let rays = subject.options.rays.unwrap_or(subject.grid.run.rays);
    Simulations {
        points,
        parts: PARTS,
        rays: rays.div_ceil(PARTS),
        seed,
    }
}

pub(super) fn check(
    subject: &Subject<'_>,
    database: &Database,
    control: &Control<'_>,
) -> Result<Check, VerifyError> {
    let simulations = simulations(subject);
    let fresh = simulations.run(subject.grid, control)?;
    let mut check =
        Check::new("fresh simulations off the nodes, expressed by the compact file's bases");
    check.notes.push(format!(
        "{} random points, {PARTS} x {} rays; noise: standard error of the part not expressed; beyond noise: less {:.1} times that; false alarms: about {FALSE_ALARM:e}",
        simulations.points.len(),
        simulations.rays,
        margin(simulations.points.len()),
    ));
    for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
        let mut measures = [Measure::default(), Measure::default()];
        for parts in &fresh {
            let [rmse, delta_e] = &mut measures;
            project(subject, database, quantity, parts, rmse, delta_e)?;
        }
        let bounds = stated(database, quantity).unwrap_or_default();
        let [rmse, delta_e] = measures;
        let names = [
            "RMSE mean",
            "RMSE max",
            "RMSE noise, mean",
            "RMSE max beyond noise",
        ];
        check
            .figures
            .extend(rmse.figures(quantity, names, bounds.max_rmse, &simulations.points));
        let names = [
            "Delta-E mean",
            "Delta-E max",
            "Delta-E noise, mean",
            "Delta-E max beyond noise",
        ];
        check.figures.extend(delta_e.figures(
            quantity,
            names,
            bounds.max_delta_e,
            &simulations.points,
        ));
    }
    Ok(check)
}

/// One error, and its noise, of every point.
#[derive(Default)]
struct Measure {
    error: Vec<f64>,
    noise: Vec<f64>,
}

impl Measure {
    fn figures(
        self,
        quantity: Quantity,
        [mean_name, max_name, noise_name, beyond_name]: [&'static str; 4],
        bound: Option<f64>,
        points: &[Point],
    ) -> Vec<Figure> {
        let at = |worst: usize| points.get(worst).map_or(String::new(), Point::to_string);
        let pairs = self.error.iter().zip(&self.noise);
        let beyond: Vec<f64> = pairs
            .map(|(e, noise)| (e - margin(points.len()) * noise).max(0.0))
            .collect();
        let all = [&self.error, &self.noise, &beyond].map(|values| summary(values));
        let [
            Some((mean, max, worst)),
            Some((noise, ..)),
            Some((_, excess, worst_excess)),
        ] = all
        else {
            return Vec::new();
        };
        let figure = |measure, value, bound, at| Figure {
            quantity,
            measure,
            value,
            bound,
            at,
        };
        let mut figures = vec![
            figure(mean_name, mean, None, String::new()),
            figure(max_name, max, None, at(worst)),
            figure(noise_name, noise, None, String::new()),
        ];
        if bound.is_some() {
            let at = if excess > 0.0 {
                at(worst_excess)
            } else {
                String::new()
            };
            figures.push(figure(beyond_name, excess, bound, at));
        }
        figures
    }
}

/// Adds the errors of one point, given its parts.
fn project(
    subject: &Subject<'_>,
    database: &Database,
    quantity: Quantity,
    parts: &[Spectrum],
    rmse: &mut Measure,
    delta_e: &mut Measure,
) -> Result<(), VerifyError> {
    let colour = subject.colour.as_ref();
    let mut mean = vec![0.0; subject.grid.wavelengths_nm.len()];
    // What the projection leaves out of each part: spectra, and colours.
    let (mut spectra, mut colours) = (Vec::new(), Vec::new());
    for part in parts {
        let original: Vec<f64> = part.of(quantity).iter().map(|m| m.value).collect();
        let rebuilt: Vec<f64> = database
            .project(quantity, &original)?
            .into_iter()
            .map(f64::from)
            .collect();
        for (mean, value) in mean.iter_mut().zip(&original) {
            *mean += value / parts.len() as f64;
        }
        if let Some(colour) = colour {
            let (a, b) = (colour.lab(&original), colour.lab(&rebuilt));
            colours.push(vec![a.l - b.l, a.a - b.a, a.b - b.b]);
        }
        spectra.push(original.iter().zip(&rebuilt).map(|(a, b)| a - b).collect());
    }
    let error: CurveError = database.projection_error(quantity, &mean, colour)?;
    rmse.error.push(error.rmse);
    rmse.noise
        .push(standard_error(&spectra) / (mean.len() as f64).sqrt());
    if let Some(error) = error.delta_e {
        delta_e.error.push(error);
        delta_e.noise.push(standard_error(&colours));
    }
    Ok(())
}

/// Length of the standard error of the mean of `vectors`.
fn standard_error(vectors: &[Vec<f64>]) -> f64 {
    let n = vectors.len() as f64;
    let length = vectors.first().map_or(0, Vec::len);
    let mut variance = 0.0;
    for component in 0..length {
        let values = || vectors.iter().filter_map(|v| v.get(component));
        let mean = values().sum::<f64>() / n;
        variance += values().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    }
    (variance / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    #[test]
    #[allow(clippy::unwrap_used)]
    fn the_margin_keeps_the_false_alarms() {
        let t = StudentsT::new(0.0, 1.0, PARTS as f64 - 1.0).unwrap();
        for points in [1, 12, 1000] {
            let alarms = 4.0 * points as f64 * t.sf(margin(points));
            assert!(alarms < 1.5 * FALSE_ALARM, "{points}: {alarms}");
        }
    }

    #[test]
    fn standard_error_by_hand() {
        // Means 1 and 5; variances 1 and 4 with n - 1; (1 + 4) / 3.
        let vectors = [vec![0.0, 5.0], vec![1.0, 3.0], vec![2.0, 7.0]];
        assert!((standard_error(&vectors) - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    }
}
