//! Fresh simulations at nodes of the grid, compared with the stored spectra.
//!
//! z is the difference in combined standard errors. The difference between two results for the
//! same snow from equal numbers of rays is a sum of exchangeable scores. Such a sum, divided by
//! its own root sum of squares, has Gaussian or lighter tails, whatever the distribution of the
//! scores (Efron 1969): P(|z| >= x) <= 2 exp(-x^2/2). Few or skewed scores therefore raise no
//! false alarm. Correlations between wavelengths (which share their walks in `spectral`) may be
//! arbitrary: the largest |z| is corrected for the number of wavelengths (Bonferroni), and
//! means over wavelengths are bounded as a single wavelength would be. The nodes are from
//! different jobs, which are independent. With z_c, the mean of z over the wavelengths of curve
//! c of N,
//!
//! - P(|sum z_c| / sqrt(N) >= x) <= 2 exp(-x^2/2) (a shift common to all curves),
//! - P(mean z^2 >= x) <= exp(-N (x - 1 - ln x) / 2) for x > 1 (chi-square).
//!
//! The three tests of both quantities share the probability of false alarms equally.
use super::fresh::Simulations;
use super::{Check, CheckContext, CheckedValue, FALSE_ALARM, VerifyError};
use crate::engine::Control;
use crate::grid::Grid;
use crate::measurement::{Measured, Quantity, Spectrum};
use crate::parameter::{Parameter, Point};
use crate::sampling;
use rand::Rng;
use rand::seq::index;

/// Number of tests that share the false alarms: three for each quantity.
const TESTS: f64 = 6.0;

/// Name of the stream of random numbers of this check.
const NODES: &str = "nodes";

/// A node and the row of its curve.
pub(super) struct Node {
    pub(super) point: Point,
    pub(super) row: usize,
}

/// The fresh simulations at the chosen nodes.
pub(super) fn simulations(context: &CheckContext<'_>) -> Simulations {
    let (nodes, seed) = chosen(context, NODES, context.options.samples);
    Simulations {
        points: nodes.into_iter().map(|node| node.point).collect(),
        parts: 1,
        rays: context.options.rays.unwrap_or(context.grid.run.rays),
        seed,
    }
}

/// Runs the check. Returns it with the number of nodes skipped for lack of time and the number
/// of all nodes.
pub(super) fn check(
    context: &CheckContext<'_>,
    control: &Control<'_>,
) -> Result<(Check, [usize; 2]), VerifyError> {
    let (nodes, _) = chosen(context, NODES, context.options.samples);
    let total = nodes.len();
    let simulations = simulations(context);
    let fresh = simulations.run(context.grid, control)?;
    let ended = nodes.into_iter().zip(fresh);
    let ended = ended.filter_map(|(node, fresh)| Some((node, fresh?)));
    let (nodes, fresh): (Vec<Node>, Vec<Vec<Spectrum>>) = ended.unzip();
    let mut check = Check::new("fresh simulations at nodes of the grid");
    check.notes.push(format!(
        "{} nodes of different jobs, {} rays; z is the difference in standard errors; false alarms: {FALSE_ALARM:e}",
        nodes.len(),
        simulations.rays,
    ));
    let skipped = [total - nodes.len(), total];
    if nodes.is_empty() {
        return Ok((check, skipped));
    }
    for quantity in Quantity::ALL {
        let [values, errors] = context.curves(quantity, false)?;
        let mut scores = ZScores::default();
        for (node, spectrum) in nodes.iter().zip(&fresh) {
            let measured = spectrum.iter().flat_map(|part| part.of(quantity));
            let stored = values.row(node.row);
            let stored = stored.iter().zip(errors.row(node.row));
            let z = measured
                .zip(stored)
                .map(|(&fresh, (&value, &se))| z(fresh, Measured { value, se }));
            scores.add(node, &z.collect::<Vec<f64>>(), &context.grid.wavelengths_nm);
        }
        check.figures.extend(scores.figures(quantity, context.grid));
    }
    Ok((check, skipped))
}

/// At most `most` random nodes of different jobs, and the seed of their simulations. The stream
/// of random numbers has the name of the check.
pub(super) fn chosen(
    context: &CheckContext<'_>,
    name: &'static str,
    most: usize,
) -> (Vec<Node>, u64) {
    let mut random = sampling::CheckStream::Verify.stream(name, context.options.seed);
    let seed = random.next_u64();
    let jobs = context.store.jobs();
    let axes = context.store.axes();
    let count = jobs.count() as usize;
    let shuffled_jobs = index::sample(&mut random, count, count);
    let position = |parameter| axes.iter().position(|(other, _)| other == parameter);
    let [size, thickness] = [Parameter::GrainSize, Parameter::Thickness].map(position);
    // Every database has both axes.
    let (size, thickness) = (size.unwrap_or_default(), thickness.unwrap_or_default());
    // Some jobs have no node with a curve.
    let nodes = shuffled_jobs.into_iter().filter_map(|job| {
        let mut node = jobs.origin(job as u64).ok()?;
        for ((index, length), (parameter, _)) in node.iter_mut().zip(jobs.block()).zip(axes.iter())
        {
            if !parameter.is_optional() {
                *index += random.next_u64() % length;
            }
        }
        // Where grains do not fit, take the thinnest slab of the job in which they do.
        let absent = context.store.absent().get(node[size] as usize).copied();
        node[thickness] = node[thickness].max(absent.unwrap_or_default() as u64);
        let slabs = jobs.nodes(job as u64, Parameter::Thickness).ok()?;
        if !slabs.contains(&(node[thickness] as usize)) {
            return None;
        }
        let row = axes.number(&node);
        Some(Node {
            point: axes.point(row),
            row: row as usize,
        })
    });
    (nodes.take(most).collect(), seed)
}

/// The difference in combined standard errors. The variance includes the rounding of stored
/// values to f32.
pub(super) fn z(fresh: Measured, stored: Measured) -> f64 {
    // Values below the smallest f32 are stored as 0.
    let rounding = f64::from(f32::EPSILON * stored.value.abs() as f32 + f32::MIN_POSITIVE);
    let variance = fresh.se.powi(2) + stored.se.powi(2) + rounding.powi(2);
    if variance == 0.0 && fresh.value == stored.value {
        return 0.0;
    }
    (fresh.value - stored.value) / variance.sqrt()
}

/// Sums of z over the curves of one quantity.
#[derive(Default)]
pub(super) struct ZScores {
    /// Number of curves.
    curves: f64,
    /// Sum over the curves of their mean z.
    sum: f64,
    /// Sum over the curves of their mean z^2.
    sum_sq: f64,
    /// The largest |z|.
    max: f64,
    /// Wavelength and point of the largest |z|.
    at: String,
}

impl ZScores {
    /// Adds the z of a curve at all wavelengths.
    pub(super) fn add(&mut self, node: &Node, z: &[f64], wavelengths_nm: &[f64]) {
        self.curves += 1.0;
        self.sum += z.iter().sum::<f64>() / z.len() as f64;
        self.sum_sq += z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
        for (z, nm) in z.iter().zip(wavelengths_nm) {
            // NaN counts as larger than any number.
            if self.at.is_empty() || z.abs().total_cmp(&self.max).is_gt() {
                (self.max, self.at) = (z.abs(), format!("{nm} nm, {}", node.point));
            }
        }
    }

    /// The test of the largest |z| with its bound, which the two quantities share; `None` without
    /// curves.
    pub(super) fn largest(self, quantity: Quantity, grid: &Grid) -> Option<CheckedValue> {
        let comparisons = self.curves * grid.wavelengths_nm.len() as f64;
        (self.curves > 0.0).then(|| CheckedValue {
            quantity,
            measure: "largest |z|",
            value: self.max,
            bound: Some(gaussian(comparisons, FALSE_ALARM / 2.0)),
            at: self.at,
        })
    }

    /// The three tests with their bounds.
    fn figures(self, quantity: Quantity, grid: &Grid) -> [CheckedValue; 3] {
        let allowed = FALSE_ALARM / TESTS;
        let figure = |measure, value, bound, at| CheckedValue {
            quantity,
            measure,
            value,
            bound: Some(bound),
            at,
        };
        let comparisons = self.curves * grid.wavelengths_nm.len() as f64;
        let shift = self.sum.abs() / self.curves.sqrt();
        let chi_square = chi_square_bound(self.curves, allowed);
        let mean_sq = self.sum_sq / self.curves;
        [
            figure(
                "largest |z|",
                self.max,
                gaussian(comparisons, allowed),
                self.at,
            ),
            figure(
                "|sum of z| / sqrt(nodes)",
                shift,
                gaussian(1.0, allowed),
                String::new(),
            ),
            figure("mean z^2", mean_sq, chi_square, String::new()),
        ]
    }
}

/// The x that one of `comparisons` numbers with Gaussian or lighter tails exceeds with
/// probability `allowed`, at most.
fn gaussian(comparisons: f64, allowed: f64) -> f64 {
    (2.0 * (2.0 * comparisons / allowed).ln()).sqrt()
}

/// The x above 1 with exp(-n (x - 1 - ln x) / 2) = `allowed`.
fn chi_square_bound(n: f64, allowed: f64) -> f64 {
    let target = -2.0 * allowed.ln() / n;
    // The iteration x = 1 + ln x + target converges, because its slope 1/x is below 1.
    (0..200).fold(2.0 + target, |x: f64, _| 1.0 + x.ln() + target)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_of_chi_square_solves_its_equation() {
        for n in [1.0, 12.0, 1000.0] {
            let x = chi_square_bound(n, 1e-7);
            assert!(x > 1.0);
            let p = (-n * (x - 1.0 - x.ln()) / 2.0).exp();
            assert!((p / 1e-7 - 1.0).abs() < 1e-6, "{n}: {p}");
        }
    }

    #[test]
    fn z_by_hand() {
        let measured = |value, se| Measured { value, se };
        assert!((z(measured(0.5, 0.3), measured(0.0, 0.4)) - 1.0).abs() < 1e-12);
        assert_eq!(z(measured(0.0, 0.0), measured(0.0, 0.0)), 0.0);
        assert!(z(measured(f64::NAN, 0.3), measured(0.0, 0.4)).is_nan());
    }
}
