//! The distribution of the unknowns: on nested cells for up to four unknowns, else by a sampler.
//! Cells are halved where the mass is; a narrow part that no cell of an earlier level shows is
//! missed.
use std::collections::BTreeSet;

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::{Inverse, Optimum, Scratch, sampler};

/// Largest number of unknowns of the grid.
const MOST_UNKNOWNS: usize = 4;
/// Largest number of cells at one level.
const MOST_CELLS: usize = 300_000;
/// Cells whose cost is above that of the best by more than this have no part: e^-9 of the density.
const NEGLIGIBLE: f64 = 18.0;
/// Largest side of a cell at the end, in standard deviations of the best determined combination,
/// by the number of unknowns. Sums over such cells are as good as integrals: a Gaussian loses less
/// than 1e-8.
const RESOLUTION: [f64; MOST_UNKNOWNS] = [0.3, 0.4, 0.9, 0.9];
/// Largest number of halvings.
const MOST_LEVELS: u32 = 12;

/// How the distribution was computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PosteriorMethod {
    /// On nested cells.
    Grid {
        /// Number of cells with a part of the mass.
        cells: usize,
        /// Their side along each unknown, as a place; 0 beyond the unknowns.
        sides: [f64; MOST_UNKNOWNS],
    },
    /// By an affine-invariant sampler.
    Sampler {
        /// Number of walkers.
        walkers: usize,
        /// Number of moves of each after those that were left out.
        steps: usize,
        /// Integrated autocorrelation time, moves; the largest of all unknowns.
        autocorrelation: f64,
    },
}

/// Median and the ends of the central 68 and 95 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CredibleInterval {
    /// Median.
    pub median: f64,
    /// Ends of the central 68 %.
    pub p68: [f64; 2],
    /// Ends of the central 95 %.
    pub p95: [f64; 2],
}

/// Points with weights that represent the distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// Places of the unknowns at each point.
    pub points: Vec<Vec<f64>>,
    /// Weights, of sum 1.
    pub weights: Vec<f64>,
    /// How it was computed.
    pub method: PosteriorMethod,
}

impl Posterior {
    /// The distribution around `optimum`. `seed` is that of the sampler.
    #[must_use]
    pub fn new(inverse: &Inverse<'_>, optimum: &Optimum, seed: u64) -> Self {
        Self::grid(inverse, optimum).unwrap_or_else(|| Self::sampled(inverse, optimum, seed))
    }

    /// By the affine-invariant sampler, for any number of unknowns.
    #[must_use]
    pub fn sampled(inverse: &Inverse<'_>, optimum: &Optimum, seed: u64) -> Self {
        sampler::sample(inverse, optimum, seed)
    }

    /// On equal cells, which are halved where the mass is, along each unknown until they are
    /// narrower than the best determined combination. `None` for more than four unknowns, or if
    /// there would be too many cells.
    #[must_use]
    pub fn grid(inverse: &Inverse<'_>, optimum: &Optimum) -> Option<Self> {
        let n = inverse.unknowns().len();
        if n > MOST_UNKNOWNS {
            return None;
        }
        let precision = optimum.precision(inverse);
        // in units in which each unknown alone has the precision 1
        let scale: Vec<f64> = (0..n).map(|i| precision[(i, i)].max(1.0).sqrt()).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| precision[(i, j)] / (scale[i] * scale[j]));
        let steepest = scaled.symmetric_eigenvalues().max().max(1.0).sqrt();
        let is_fine = |i: usize, divisions: u32| {
            steepest * scale[i] / f64::from(divisions) <= RESOLUTION[n - 1]
        };
        let mut divisions = vec![[64, 16, 8, 8][n - 1]; n];
        let mut cells = all_cells(&divisions);
        for _ in 0..MOST_LEVELS {
            let sides: Vec<f64> = divisions.iter().map(|d| 1.0 / f64::from(*d)).collect();
            let costs = costs(inverse, &cells, &sides);
            let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
            // at the end of a range the cost may rise by more than NEGLIGIBLE within half a cell
            let lowest = best.min(optimum.chi_square + optimum.prior_square);
            let best = if lowest + NEGLIGIBLE < best {
                best
            } else {
                lowest
            };
            let coarse: Vec<usize> = (0..n).filter(|i| !is_fine(*i, divisions[*i])).collect();
            if coarse.is_empty() {
                return Some(Self::of_cells(&cells, &costs, best, &sides));
            }
            // the cost within a cell may be below that in its middle by this, about twice
            let within = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
            let within = within.map(|(i, j)| precision[(i, j)].abs() * sides[i] * sides[j]);
            let limit = best + NEGLIGIBLE + 0.5 * within.sum::<f64>();
            let kept = cells.iter().zip(&costs).filter(|(_, cost)| **cost <= limit);
            let kept: Vec<&Vec<u32>> = kept.map(|(cell, _)| cell).collect();
            if kept.len() << coarse.len() > MOST_CELLS {
                return None;
            }
            cells = kept
                .into_iter()
                .flat_map(|cell| halves(cell, &coarse))
                .collect();
            coarse.iter().for_each(|i| divisions[*i] *= 2);
            if (0..n).all(|i| is_fine(i, divisions[i])) {
                // the mass may reach into cells that were left out
                let mut known: BTreeSet<Vec<u32>> = cells.iter().cloned().collect();
                for cell in &cells {
                    known.extend(neighbours(cell, &divisions));
                }
                cells = known.into_iter().collect();
            }
        }
        None
    }

    /// The cells that are not negligible.
    fn of_cells(cells: &[Vec<u32>], costs: &[f64], best: f64, sides: &[f64]) -> Self {
        let kept = cells.iter().zip(costs);
        let kept = kept.filter(|(_, cost)| **cost <= best + NEGLIGIBLE);
        let (points, mut weights): (Vec<Vec<f64>>, Vec<f64>) = kept
            .map(|(cell, cost)| (middle(cell, sides), libm::exp(-0.5 * (cost - best))))
            .unzip();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        let side = |i: usize| sides.get(i).copied().unwrap_or(0.0);
        Self {
            method: PosteriorMethod::Grid {
                cells: points.len(),
                sides: std::array::from_fn(side),
            },
            points,
            weights,
        }
    }

    /// Half the side of a cell along unknown `i`; 0 for draws of the sampler.
    fn half(&self, i: usize) -> f64 {
        match self.method {
            PosteriorMethod::Grid { sides, .. } => 0.5 * sides[i],
            PosteriorMethod::Sampler { .. } => 0.0,
        }
    }

    /// Means of the places.
    #[must_use]
    pub fn mean(&self) -> Vec<f64> {
        let unknowns = self.points.first().map_or(0, Vec::len);
        (0..unknowns).map(|i| self.average(|u| u[i])).collect()
    }

    /// Mean of a function of the places.
    pub fn average(&self, value: impl Fn(&[f64]) -> f64) -> f64 {
        let pairs = self.points.iter().zip(&self.weights);
        pairs.map(|(u, weight)| weight * value(u)).sum()
    }

    /// Median and credible intervals of a function of the places that is monotone in each.
    pub fn interval(&self, value: impl Fn(&[f64]) -> f64) -> CredibleInterval {
        // a cell is spread over the values between its ends in the unknown that matters most
        let mut parts: Vec<[f64; 3]> = Vec::with_capacity(self.points.len());
        for (u, weight) in self.points.iter().zip(&self.weights) {
            let here = value(u);
            let mut reach: f64 = 0.0;
            let mut moved = u.clone();
            for i in 0..u.len() {
                let half = self.half(i);
                if half > 0.0 {
                    moved[i] = u[i] + half;
                    reach = reach.max((value(&moved) - here).abs());
                    moved[i] = u[i];
                }
            }
            parts.push([here - reach, here + reach, *weight]);
        }
        let share = |x: f64| -> f64 {
            let part = |[low, high, weight]: &[f64; 3]| match high > low {
                true => weight * ((x - low) / (high - low)).clamp(0.0, 1.0),
                false => weight * f64::from(u8::from(x >= *low)),
            };
            parts.iter().map(part).sum()
        };
        let low = parts
            .iter()
            .map(|part| part[0])
            .fold(f64::INFINITY, f64::min);
        let high = parts
            .iter()
            .map(|part| part[1])
            .fold(f64::NEG_INFINITY, f64::max);
        let quantile = |p: f64| {
            let mut range = [low, high];
            for _ in 0..40 {
                let x = 0.5 * (range[0] + range[1]);
                range[usize::from(share(x) >= p)] = x;
            }
            0.5 * (range[0] + range[1])
        };
        CredibleInterval {
            median: quantile(0.5),
            p68: [quantile(0.16), quantile(0.84)],
            p95: [quantile(0.025), quantile(0.975)],
        }
    }

    /// Numbers of about `count` points that stand for equal shares of the mass.
    #[must_use]
    pub fn draws(&self, count: usize) -> Vec<usize> {
        let (mut sum, mut next) = (0.0, 0.5 / count as f64);
        let mut drawn = Vec::with_capacity(count);
        for (i, weight) in self.weights.iter().enumerate() {
            sum += weight;
            while next < sum && drawn.len() < count {
                drawn.push(i);
                next += 1.0 / count as f64;
            }
        }
        drawn
    }
}

/// All cells of a level.
fn all_cells(divisions: &[u32]) -> Vec<Vec<u32>> {
    let mut cells = vec![Vec::new()];
    for count in divisions {
        let longer = |cell: Vec<u32>| (0..*count).map(move |i| [&cell[..], &[i]].concat());
        cells = cells.into_iter().flat_map(longer).collect();
    }
    cells
}

/// The halves of a cell along the unknowns `along`.
fn halves(cell: &[u32], along: &[usize]) -> Vec<Vec<u32>> {
    let corner = |number: usize| {
        let mut half = cell.to_vec();
        for (bit, i) in along.iter().enumerate() {
            half[*i] = 2 * cell[*i] + (number >> bit & 1) as u32;
        }
        half
    };
    (0..1 << along.len()).map(corner).collect()
}

/// The cells beside `cell`.
fn neighbours(cell: &[u32], divisions: &[u32]) -> Vec<Vec<u32>> {
    let mut found = Vec::new();
    for i in 0..cell.len() {
        for at in [cell[i].checked_sub(1), Some(cell[i] + 1)] {
            if let Some(at) = at.filter(|at| *at < divisions[i]) {
                let mut beside = cell.to_vec();
                beside[i] = at;
                found.push(beside);
            }
        }
    }
    found
}

/// The places of the middle of a cell.
fn middle(cell: &[u32], sides: &[f64]) -> Vec<f64> {
    let pairs = cell.iter().zip(sides);
    pairs
        .map(|(at, side)| (f64::from(*at) + 0.5) * side)
        .collect()
}

/// The cost at the middle of each cell.
fn costs(inverse: &Inverse<'_>, cells: &[Vec<u32>], sides: &[f64]) -> Vec<f64> {
    let values = inverse.values();
    let memory = || (Scratch::default(), vec![0.0; values]);
    cells
        .par_iter()
        .map_init(memory, |(scratch, out), cell| {
            inverse.cost(&middle(cell, sides), scratch, out)
        })
        .collect()
}

impl Posterior {
    /// About `count` points of equal weight, or the same points if there are no more than that.
    #[must_use]
    pub fn thinned(&self, count: usize) -> Self {
        if self.points.len() <= count {
            return self.clone();
        }
        let drawn = self.draws(count);
        Self {
            points: drawn.iter().map(|i| self.points[*i].clone()).collect(),
            weights: vec![1.0 / drawn.len() as f64; drawn.len()],
            method: self.method,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use splitsnow_lookup::{Axes, Database, Parameter, Point};
    use splitsnow_spectra::Quantity;

    use super::*;
    use crate::{Emulator, NoiseModel, Observation, Prior, StartTable, Unknown, Whitening};

    const NM: [f64; 9] = [
        400.0, 500.0, 600.0, 800.0, 900.0, 1030.0, 1100.0, 1240.0, 1300.0,
    ];
    const NOISE: NoiseModel = NoiseModel {
        value: 0.01,
        level: 0.0,
        correlated: 0.01,
        length_nm: 100.0,
    };

    /// Reflectance of deep snow of an invented ice, sqrt-law in size and facetness, with carbon.
    fn database() -> Database {
        let axes = Axes::from([
            (Parameter::BlackCarbon, vec![0.0, 30.0, 100.0, 200.0]),
            (Parameter::Facetness, vec![0.1, 0.3, 0.6, 0.9]),
            (
                Parameter::GrainSize,
                vec![100.0, 150.0, 220.0, 320.0, 470.0, 700.0],
            ),
            (Parameter::Density, vec![300.0]),
            (Parameter::Thickness, vec![1e6]),
            (Parameter::Incidence, vec![0.0]),
        ]);
        let curve = |row: usize, l: usize| {
            let point = axes.point(row as u64);
            let ice = ((NM[l] - 400.0) / 600.0_f64).powi(3);
            let soot = 2e-4 * point[Parameter::BlackCarbon] * 400.0 / NM[l];
            let shape = 1.0 - 0.4 * (1.0 - (-point[Parameter::Facetness] / 0.3_f64).exp());
            let absorbed = (point[Parameter::GrainSize] / 300.0) * shape * (0.02 + ice + soot);
            (-0.5 * absorbed.sqrt()).exp()
        };
        let curves =
            ndarray::Array2::from_shape_fn((axes.count() as usize, NM.len()), |(r, l)| curve(r, l));
        Database::from_curves(false, &axes, &NM, None, Some(&curves))
    }

    fn unknowns() -> [Unknown; 3] {
        [
            Unknown::new(Parameter::GrainSize, [100.0, 700.0], Prior::Flat),
            Unknown::new(Parameter::Facetness, [0.1, 0.9], Prior::Flat),
            Unknown::new(Parameter::BlackCarbon, [0.0, 200.0], Prior::Flat),
        ]
    }

    fn known() -> Point {
        Point::from([
            (Parameter::Density, 300.0),
            (Parameter::Thickness, 1e6),
            (Parameter::Incidence, 0.0),
        ])
    }

    /// A standard normal number: the sum of twelve uniform ones.
    fn normal(random: &mut Xoshiro256PlusPlus) -> f64 {
        let sum: f64 = (0..12).map(|_| uniform(random)).sum();
        sum - 6.0
    }

    fn uniform(random: &mut Xoshiro256PlusPlus) -> f64 {
        (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A problem with noise of the stated covariance, and the places of its truth.
    fn draw<'a>(
        (emulator, whitening, unknowns): (&'a Emulator, &'a Whitening, &'a [Unknown]),
        indices: &'a [usize],
        random: &mut Xoshiro256PlusPlus,
    ) -> (Inverse<'a>, Vec<f64>) {
        let u: Vec<f64> = unknowns.iter().map(|_| uniform(random)).collect();
        let blank = Observation::new(emulator, whitening, indices, known(), vec![0.0; 9]);
        let inverse = Inverse::new(unknowns, vec![blank]);
        let mut values = vec![0.0; NM.len()];
        assert!(inverse.model(&u, &mut Scratch::default(), &mut values));
        // an error of each value, and one that is exponentially correlated
        let mut shared = normal(random);
        for l in 0..NM.len() {
            if l > 0 {
                let near = f64::exp((NM[l - 1] - NM[l]) / NOISE.length_nm);
                shared = near * shared + (1.0 - near * near).sqrt() * normal(random);
            }
            values[l] += NOISE.correlated * shared + NOISE.value * normal(random);
        }
        let observation = Observation::new(emulator, whitening, indices, known(), values);
        (Inverse::new(unknowns, vec![observation]), u)
    }

    #[test]
    fn open_axes_are_interpolated_as_by_the_database() {
        let database = database();
        let emulator = Emulator::new(&database, Quantity::Reflectance, Point::default()).unwrap();
        for (carbon, facetness) in [(0.0, 0.1), (47.0, 0.37), (200.0, 0.9)] {
            let soot = Point::from([(Parameter::BlackCarbon, carbon)]);
            let at = database.at(soot).unwrap();
            let lookup = splitsnow_lookup::Lookup::new(&at, Quantity::Reflectance).unwrap();
            let point = known()
                .with(Parameter::GrainSize, 260.0)
                .with(Parameter::Facetness, facetness);
            let mut expected = vec![0.0; NM.len()];
            lookup.spectrum(point, &mut expected).unwrap();
            let (mut single, mut found) = (Vec::new(), Vec::new());
            emulator
                .spectrum(point.and(soot), &mut single, &mut found)
                .unwrap();
            for (a, b) in expected.iter().zip(&found) {
                assert!((f64::from(*a) - b).abs() < 2e-6, "{a} {b}");
            }
        }
    }

    /// In 500 problems, 68 % of the intervals hold the truth: on the grid exactly, and by Laplace
    /// roughly.
    #[test]
    fn intervals_hold_the_truth() {
        let (database, unknowns) = (database(), unknowns());
        let emulator = Emulator::new(&database, Quantity::Reflectance, Point::default()).unwrap();
        let whitening = Whitening::new(&NM, &[NOISE.value; 9], &[0.0; 9], &NOISE).unwrap();
        let indices: Vec<usize> = (0..NM.len()).collect();
        let parts = (&emulator, &whitening, &unknowns[..]);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
        let (mut held, mut wide, mut laplace) = ([0; 3], [0; 3], [0; 3]);
        let mut chi_square = 0.0;
        for _ in 0..500 {
            let (inverse, truth) = draw(parts, &indices, &mut random);
            let optimum = inverse.best().unwrap();
            assert!(optimum.converged);
            chi_square += optimum.chi_square / 500.0;
            let posterior = Posterior::grid(&inverse, &optimum).unwrap();
            for i in 0..3 {
                let CredibleInterval { p68, p95, .. } = posterior.interval(|u| u[i]);
                held[i] += i32::from((p68[0]..=p68[1]).contains(&truth[i]));
                wide[i] += i32::from((p95[0]..=p95[1]).contains(&truth[i]));
                let [low, high] = optimum.interval(&inverse, i, 0.68);
                laplace[i] += i32::from((low..=high).contains(&truth[i]));
            }
        }
        eprintln!(
            "68 %: {held:?}, 95 %: {wide:?}, Laplace: {laplace:?} of 500; chi-square {chi_square:.2}"
        );
        for i in 0..3 {
            assert!((315..=365).contains(&held[i]), "{held:?}");
            assert!((460..=490).contains(&wide[i]), "{wide:?}");
            assert!((275..=425).contains(&laplace[i]), "{laplace:?}");
        }
        // 9 values determine between one and three combinations
        assert!((6.0..8.5).contains(&chi_square), "{chi_square}");
    }

    #[test]
    fn sampler_and_grid_agree() {
        let (database, unknowns) = (database(), unknowns());
        let emulator = Emulator::new(&database, Quantity::Reflectance, Point::default()).unwrap();
        let whitening = Whitening::new(&NM, &[NOISE.value; 9], &[0.0; 9], &NOISE).unwrap();
        let indices: Vec<usize> = (0..NM.len()).collect();
        let parts = (&emulator, &whitening, &unknowns[..]);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(9);
        let (inverse, _) = draw(parts, &indices, &mut random);
        let optimum = inverse.best().unwrap();
        let grid = Posterior::grid(&inverse, &optimum).unwrap();
        let sampled = Posterior::sampled(&inverse, &optimum, 1);
        assert_eq!(sampled, Posterior::sampled(&inverse, &optimum, 1));
        for i in 0..3 {
            let [a, b] = [&grid, &sampled].map(|p| p.interval(|u| u[i]));
            let sd = 0.5 * (a.p68[1] - a.p68[0]);
            for (a, b) in [
                (a.median, b.median),
                (a.p68[0], b.p68[0]),
                (a.p68[1], b.p68[1]),
            ] {
                assert!(
                    (a - b).abs() < 0.2 * sd,
                    "{i}: {a} {b} {sd} {:?}",
                    sampled.method
                );
            }
        }
        // the shared coarse grid leads to the same optimum
        let table = StartTable::new(&inverse);
        let again = inverse.best_from(&table, &mut Scratch::default()).unwrap();
        assert!((again.chi_square - optimum.chi_square).abs() < 1e-3);
    }

    #[test]
    fn a_gaussian_prior_without_data_is_returned() {
        let database = database();
        let emulator = Emulator::new(&database, Quantity::Reflectance, Point::default()).unwrap();
        let huge = NoiseModel {
            value: 1e3,
            level: 0.0,
            correlated: 0.0,
            length_nm: 1.0,
        };
        let whitening = Whitening::new(&NM, &[1e3; 9], &[0.0; 9], &huge).unwrap();
        let indices: Vec<usize> = (0..NM.len()).collect();
        let point = known()
            .with(Parameter::Facetness, 0.3)
            .with(Parameter::BlackCarbon, 0.0);
        let observation = Observation::new(&emulator, &whitening, &indices, point, vec![0.5; 9]);
        let prior = Prior::Normal { mean: 5.5, sd: 0.1 };
        let unknowns = [Unknown::new(Parameter::GrainSize, [100.0, 700.0], prior)];
        let inverse = Inverse::new(&unknowns, vec![observation]);
        let optimum = inverse.best().unwrap();
        assert!((unknowns[0].value(optimum.u[0]).ln() - 5.5).abs() < 1e-3);
        let posterior = Posterior::grid(&inverse, &optimum).unwrap();
        let found = posterior.interval(|u| unknowns[0].value(u[0]).ln());
        assert!(
            (found.median - 5.5).abs() < 1e-3 && (found.p68[1] - 5.59945).abs() < 2e-3,
            "{found:?}"
        );
    }
}
