//! Fresh simulations at random points within the box of the axes: how well the
//! bases of the compact file express spectra they were not made from.
//!
//! Only the projection is measured: what compression does to a new spectrum.
//! Interpolation between nodes is not part of it. A fresh spectrum carries
//! noise that no basis expresses, so each is simulated in independent parts,
//! and the standard error of what the projection leaves out (as a vector over
//! wavelengths, or as the colour difference it makes) is measured from how the parts disagree, however
//! the noise of wavelengths goes together. A bound is broken only where an
//! error exceeds it by more than about ten such standard errors.
use rand::Rng;

use super::compact::{stated, summary};
use super::fresh::{Simulations, random, uniform};
use super::{Check, FALSE_ALARM, Figure, Subject, VerifyError};
use crate::colour::Colorimeter;
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
    colour: Option<&Colorimeter>,
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
    for quantity in Quantity::ALL {
        let mut measures = [Measure::default(), Measure::default()];
        for parts in &fresh {
            project(database, quantity, parts, colour, &mut measures)?;
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

/// Adds the errors of one point, given its parts, to those in RMSE and Delta-E.
fn project(
    database: &Database,
    quantity: Quantity,
    parts: &[Spectrum],
    colour: Option<&Colorimeter>,
    [rmse, delta_e]: &mut [Measure; 2],
) -> Result<(), VerifyError> {
    let project = |spectrum: &[f64]| -> Result<Vec<f64>, VerifyError> {
        let rebuilt = database.project(quantity, spectrum)?;
        Ok(rebuilt.into_iter().map(f64::from).collect())
    };
    let originals: Vec<Vec<f64>> = parts
        .iter()
        .map(|part| part.of(quantity).iter().map(|m| m.value).collect())
        .collect();
    let mean = mean(&originals);
    // What the projection leaves out of each part.
    let mut left_out = Vec::new();
    for original in &originals {
        let rebuilt = project(original)?;
        left_out.push(original.iter().zip(&rebuilt).map(|(a, b)| a - b).collect());
    }
    let error: CurveError = database.projection_error(quantity, &mean, colour)?;
    rmse.error.push(error.rmse);
    rmse.noise
        .push(standard_error(&left_out) / (mean.len() as f64).sqrt());
    if let (Some(error), Some(colour)) = (error.delta_e, colour) {
        delta_e.error.push(error);
        delta_e
            .noise
            .push(colour_standard_error(&project(&mean)?, &left_out, colour));
    }
    Ok(())
}

fn mean(vectors: &[Vec<f64>]) -> Vec<f64> {
    let mut mean = vec![0.0; vectors.first().map_or(0, Vec::len)];
    for vector in vectors {
        for (mean, value) in mean.iter_mut().zip(vector) {
            *mean += value / vectors.len() as f64;
        }
    }
    mean
}

/// Standard error of the mean of `left_out`, as the difference it makes to the
/// colour of `expressed`: to first order that of the colours themselves.
fn colour_standard_error(expressed: &[f64], left_out: &[Vec<f64>], colour: &Colorimeter) -> f64 {
    let n = left_out.len() as f64;
    let with =
        |part: &[f64]| -> Vec<f64> { expressed.iter().zip(part).map(|(e, p)| e + p).collect() };
    let centre = with(&mean(left_out));
    let differences = left_out
        .iter()
        .map(|part| colour.difference(&with(part), &centre));
    let squares: f64 = differences.map(|d| d * d).sum();
    (squares / (n - 1.0) / n).sqrt()
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

    /// Greys above the linear part of CIELAB: L* = 116 Y^(1/3) - 16, so that a
    /// small change dY makes 116 / 3 Y^(-2/3) dY.
    #[test]
    #[allow(clippy::unwrap_used)]
    fn the_standard_error_of_greys_is_that_of_their_lightness() {
        let nm: Vec<f64> = (40..=70).map(|i| f64::from(i) * 10.0).collect();
        let colour = Colorimeter::new(&nm).unwrap().unwrap();
        let parts = [1e-4, 2e-4, 6e-4].map(|change| vec![change; 31]);
        let found = colour_standard_error(&[0.4; 31], &parts, &colour);
        let expected = standard_error(&[vec![1e-4], vec![2e-4], vec![6e-4]]);
        let slope = 116.0 / 3.0 * (0.4 + 3e-4_f64).powf(-2.0 / 3.0);
        assert!((found / (slope * expected) - 1.0).abs() < 1e-3, "{found}");
    }

    #[test]
    fn standard_error_by_hand() {
        // Means 1 and 5; variances 1 and 4 with n - 1; (1 + 4) / 3.
        let vectors = [vec![0.0, 5.0], vec![1.0, 3.0], vec![2.0, 7.0]];
        assert!((standard_error(&vectors) - (5.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    }
}
