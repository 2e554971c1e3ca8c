//! Fresh simulations at nodes of the grid against what is stored there.
//!
//! z is the difference in combined standard errors. Two results of the same
//! snow from as many rays differ by a sum of exchangeable scores, and such a
//! sum over its own root sum of squares has Gaussian tails or lighter ones
//! whatever the law of the scores (Efron 1969): P(|z| >= x) <= 2 exp(-x^2/2).
//! So few or skewed scores raise no false alarm. Nothing is assumed about how
//! wavelengths go together (in `spectral` they share their walks): the largest
//! |z| is corrected for their number (Bonferroni), and means over them are
//! bounded as one of them would be. Nodes are of different jobs, which are
//! independent. For z_c, the mean of z over the wavelengths of curve c of N,
//!
//! - P(|sum z_c| / sqrt(N) >= x) <= 2 exp(-x^2/2) (a shift common to all),
//! - P(mean z^2 >= x) <= exp(-N (x - 1 - ln x) / 2) for x > 1 (chi-square).
//!
//! The three tests of both quantities share the false alarms equally.
use super::fresh::{Simulations, random};
use super::{Check, FALSE_ALARM, Figure, Subject, VerifyError};
use crate::engine::Control;
use crate::grid::Grid;
use crate::measurement::{Measured, Quantity, Spectrum};
use crate::parameter::{Parameter, Point};
use rand::Rng;
use rand::seq::index;

const TESTS: f64 = 6.0;

/// A node and the row of its curve.
struct Node {
    point: Point,
    row: usize,
}

pub(super) fn simulations(subject: &Subject<'_>) -> Simulations {
    let (nodes, seed) = choose(subject);
    Simulations {
        points: nodes.into_iter().map(|node| node.point).collect(),
        parts: 1,
        rays: subject.options.rays.unwrap_or(subject.grid.run.rays),
        seed,
    }
}

/// The check, and how many nodes of how many there was no time for.
pub(super) fn check(
    subject: &Subject<'_>,
    control: &Control<'_>,
) -> Result<(Check, [usize; 2]), VerifyError> {
    let (nodes, _) = choose(subject);
    let total = nodes.len();
    let simulations = simulations(subject);
    let fresh = simulations.run(subject.grid, control)?;
    let done = nodes.into_iter().zip(fresh);
    let done = done.filter_map(|(node, fresh)| Some((node, fresh?)));
    let (nodes, fresh): (Vec<Node>, Vec<Vec<Spectrum>>) = done.unzip();
    let mut check = Check::new("fresh simulations at nodes of the grid");
    check.notes.push(format!(
        "{} nodes of different jobs, {} rays; z is the difference in standard errors; false alarms: {FALSE_ALARM:e}",
        nodes.len(),
        simulations.rays,
    ));
    let left = [total - nodes.len(), total];
    if nodes.is_empty() {
        return Ok((check, left));
    }
    for quantity in Quantity::ALL {
        let [values, errors] = subject.curves(quantity, false)?;
        let mut tally = Tally::default();
        for (node, spectrum) in nodes.iter().zip(&fresh) {
            let measured = spectrum.iter().flat_map(|part| part.of(quantity));
            let stored = values.row(node.row);
            let stored = stored.iter().zip(errors.row(node.row));
            let z = measured
                .zip(stored)
                .map(|(&fresh, (&value, &se))| z(fresh, Measured { value, se }));
            tally.add(node, &z.collect::<Vec<f64>>(), &subject.grid.wavelengths_nm);
        }
        check.figures.extend(tally.figures(quantity, subject.grid));
    }
    Ok((check, left))
}

/// Nodes of different jobs, and the seed of their simulations.
fn choose(subject: &Subject<'_>) -> (Vec<Node>, u64) {
    let mut random = random(subject, "nodes");
    let seed = random.next_u64();
    let jobs = subject.store.jobs();
    let axes = subject.store.axes();
    let count = jobs.count() as usize;
    let all = index::sample(&mut random, count, count);
    let along = |parameter| axes.iter().position(|(other, _)| other == parameter);
    let [size, thickness] = [Parameter::GrainSize, Parameter::Thickness].map(along);
    // every database has both
    let (size, thickness) = (size.unwrap_or_default(), thickness.unwrap_or_default());
    // some jobs have no node that exists
    let nodes = all.into_iter().filter_map(|job| {
        let mut node = jobs.origin(job as u64).ok()?;
        for ((index, length), (parameter, _)) in node.iter_mut().zip(jobs.block()).zip(axes.iter())
        {
            if !parameter.is_optional() {
                *index += random.next_u64() % length;
            }
        }
        // where grains do not fit, the thinnest slab of the job that holds them
        let absent = subject.store.absent().get(node[size] as usize).copied();
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
    (nodes.take(subject.options.samples).collect(), seed)
}

/// The difference in combined standard errors; the store's rounding to f32 is
/// the least error there is.
fn z(fresh: Measured, stored: Measured) -> f64 {
    // what is below the least f32 is stored as 0
    let rounding = f64::from(f32::EPSILON * stored.value.abs() as f32 + f32::MIN_POSITIVE);
    let variance = fresh.se.powi(2) + stored.se.powi(2) + rounding.powi(2);
    if variance == 0.0 && fresh.value == stored.value {
        return 0.0;
    }
    (fresh.value - stored.value) / variance.sqrt()
}

/// Sums over the curves of one quantity.
#[derive(Default)]
struct Tally {
    curves: f64,
    sum: f64,
    sum_sq: f64,
    max: f64,
    at: String,
}

impl Tally {
    fn add(&mut self, node: &Node, z: &[f64], wavelengths_nm: &[f64]) {
        self.curves += 1.0;
        self.sum += z.iter().sum::<f64>() / z.len() as f64;
        self.sum_sq += z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
        for (z, nm) in z.iter().zip(wavelengths_nm) {
            // Not a number is worse than any number.
            if self.at.is_empty() || z.abs().total_cmp(&self.max).is_gt() {
                (self.max, self.at) = (z.abs(), format!("{nm} nm, {}", node.point));
            }
        }
    }

    fn figures(self, quantity: Quantity, grid: &Grid) -> [Figure; 3] {
        let allowed = FALSE_ALARM / TESTS;
        let gaussian = |comparisons: f64| (2.0 * (2.0 * comparisons / allowed).ln()).sqrt();
        let figure = |measure, value, bound, at| Figure {
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
            figure("largest |z|", self.max, gaussian(comparisons), self.at),
            figure(
                "|sum of z| / sqrt(nodes)",
                shift,
                gaussian(1.0),
                String::new(),
            ),
            figure("mean z^2", mean_sq, chi_square, String::new()),
        ]
    }
}

/// The x above 1 with exp(-n (x - 1 - ln x) / 2) = `allowed`.
fn chi_square_bound(n: f64, allowed: f64) -> f64 {
    let target = -2.0 * allowed.ln() / n;
    // x = 1 + ln x + target contracts, for its slope 1/x is below 1.
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
