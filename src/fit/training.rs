//! Curves at all nodes that a database might have, and how well some of them
//! give the others.
use ndarray::{Array2, Axis};
use rayon::prelude::*;

use super::FitError;
use super::wavelengths::Wavelengths;
use crate::certificate::{Patch, Region, Simulation};
use crate::colour::Colorimeter;
use crate::engine::Control;
use crate::grid::{Axes, Grid};
use crate::lookup::{Database, Lookup, Point, spread};
use crate::measurement::Quantity;
use crate::scene::Scene;

/// Candidates per axis, where the scene has a range.
const CANDIDATES: [usize; 5] = [7, 9, 4, 17, 13];
/// Points that a choice of nodes is judged by, at most.
const JUDGES: usize = 3000;
/// Points that a choice of wavelengths is judged by, at most.
const WAVELENGTH_JUDGES: usize = 400;
/// Share of the bound for the lines between wavelengths.
const WAVELENGTHS: f64 = 0.1;
/// Power mean of the errors that a choice is to lower: near the largest, but
/// felt by all.
const POWER: f64 = 8.0;

/// Positions of nodes among the candidates of each axis, increasing.
pub(super) type Nodes = [Vec<usize>; 5];

/// Errors of the look-up at the judging points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judgement {
    pub(super) max: f64,
    pub(super) typical: f64,
}

impl Judgement {
    pub(super) fn of(errors: impl ExactSizeIterator<Item = f64>) -> Self {
        let (mut max, mut sum, count) = (0.0_f64, 0.0, errors.len() as f64);
        for error in errors {
            max = max.max(error);
            sum += error.powf(POWER);
        }
        let typical = (sum / count).powf(1.0 / POWER);
        Self { max, typical }
    }
}

pub(super) struct Training<'a> {
    scene: &'a Scene,
    /// Of the scene's wavelengths.
    colour: &'a Colorimeter,
    /// Those that databases have.
    pub(super) wavelengths: Wavelengths,
    /// Values of the candidates.
    pub(super) axes: [Vec<f64>; 5],
    /// `[s, l]` per quantity of the scene, at its wavelengths.
    curves: Vec<(Quantity, Array2<f64>)>,
    /// Candidates that the scene asks for, thinned out: row and point.
    judges: Vec<(usize, Point)>,
}

/// Values between the ends of `ranges`: the ends, and `n` in all where they differ.
fn candidates(axis: usize, ranges: &[[f64; 2]], n: usize) -> Vec<f64> {
    let mut values: Vec<f64> = ranges.iter().flatten().copied().collect();
    let first = values.iter().copied().fold(f64::INFINITY, f64::min);
    let last = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if ranges.iter().any(|[min, max]| min < max) {
        values.extend(spread(axis, [first, last], n));
    }
    values.sort_by(f64::total_cmp);
    // an end beside which a candidate fell is enough
    let close = (last - first) * 1e-3;
    let mut kept: Vec<f64> = Vec::new();
    for value in values {
        match kept.last_mut() {
            Some(before) if value - *before <= close => {
                if ranges.iter().flatten().any(|end| *end == value) {
                    *before = value;
                }
            }
            _ => kept.push(value),
        }
    }
    kept
}

/// Every which of `n` to take for at most `most` or so: one that shares no factor
/// with the axes' lengths visits all of them alike.
fn stride(n: usize, most: usize) -> usize {
    match n.div_ceil(most) {
        0 | 1 => 1,
        step => step | 1,
    }
}

impl<'a> Training<'a> {
    /// Simulates all candidates, and chooses the wavelengths.
    pub(super) fn new(
        scene: &'a Scene,
        grid: &'a Grid,
        regions: &[Region],
        colour: &'a Colorimeter,
        rays: u64,
        control: &Control,
    ) -> Result<Self, FitError> {
        let axes: [Vec<f64>; 5] = std::array::from_fn(|axis| {
            let ranges: Vec<[f64; 2]> = regions.iter().map(|region| region[axis]).collect();
            candidates(axis, &ranges, CANDIDATES[axis])
        });
        let mut patches = Vec::new();
        for &facetness in &axes[0] {
            for &size in &axes[1] {
                for &density in &axes[2] {
                    patches.push(Patch {
                        snow: [facetness, size, density],
                        thickness_cm: axes[3].clone(),
                        angle_deg: axes[4].clone(),
                    });
                }
            }
        }
        let seed = scene.seed;
        let spectra = Simulation { grid, rays, seed }.run(&patches, control)?;
        let l = grid.wavelengths_nm.len();
        let curves = |quantity: Quantity| {
            let values = spectra.iter().flatten();
            let values: Vec<f64> = values
                .flat_map(|spectrum| spectrum.of(quantity).iter().map(|m| m.value))
                .collect();
            // every spectrum has l values
            Array2::from_shape_vec((values.len() / l, l), values).unwrap_or_default()
        };
        let curves: Vec<(Quantity, Array2<f64>)> =
            scene.quantities.iter().map(|q| (*q, curves(*q))).collect();
        let wanted = |point: &Point| {
            let coordinates = point.coordinates();
            regions.iter().any(|region| {
                let inside = |([min, max], value): (&[f64; 2], f64)| (*min..=*max).contains(&value);
                region.iter().zip(coordinates).all(inside)
            })
        };
        let points = patches.iter().flat_map(|patch| patch.points());
        let judges: Vec<_> = points.enumerate().filter(|(_, p)| wanted(p)).collect();
        let step = stride(judges.len(), JUDGES);
        let judges: Vec<(usize, Point)> = judges.into_iter().step_by(step).collect();
        let step = stride(judges.len(), WAVELENGTH_JUDGES);
        let seen = curves.iter().flat_map(|(_, curves)| {
            let judges = judges.iter().step_by(step);
            judges.map(|(row, _)| curves.row(*row).to_vec())
        });
        let bound = WAVELENGTHS * scene.max_delta_e;
        let seen: Vec<Vec<f64>> = seen.collect();
        let wavelengths = Wavelengths::choose(&scene.wavelengths_nm, colour, &seen, bound);
        Ok(Self {
            scene,
            colour,
            wavelengths,
            axes,
            curves,
            judges,
        })
    }

    /// The values of `nodes`.
    pub(super) fn axes_of(&self, nodes: &Nodes) -> Axes {
        let [
            facetness,
            grain_size_um,
            density_kg_m3,
            thickness_cm,
            angle_deg,
        ] = std::array::from_fn(|axis: usize| {
            let values = nodes[axis].iter().map(|i| self.axes[axis][*i]);
            values.collect()
        });
        Axes {
            facetness,
            grain_size_um,
            density_kg_m3,
            thickness_cm,
            angle_deg,
        }
    }

    /// The curves at `nodes` and the wavelengths chosen, `[s, l]`.
    pub(super) fn curves_of(&self, nodes: &Nodes, quantity: Quantity) -> Array2<f64> {
        let mut rows = vec![0];
        for (nodes, values) in nodes.iter().zip(&self.axes) {
            let next = |row: usize| nodes.iter().map(move |node| row * values.len() + node);
            rows = rows.into_iter().flat_map(next).collect();
        }
        let all = self.curves.iter().find(|(q, _)| *q == quantity);
        let there = all.map(|(_, curves)| curves.select(Axis(0), &rows));
        there
            .map(|curves| curves.select(Axis(1), &self.wavelengths.kept))
            .unwrap_or_default()
    }

    /// A database of exactly the curves at `nodes`.
    pub(super) fn exact(&self, nodes: &Nodes) -> Database {
        let curves = |quantity| {
            let asked = self.scene.quantities.contains(&quantity);
            asked.then(|| self.curves_of(nodes, quantity))
        };
        Database::from_curves(
            &self.axes_of(nodes),
            &self.wavelengths.nm,
            curves(Quantity::Transmittance).as_ref(),
            curves(Quantity::Reflectance).as_ref(),
        )
    }

    /// How far the answers of `database` are from the curves at all candidates.
    pub(super) fn judge(&self, database: &Database) -> Result<Judgement, FitError> {
        let mut errors = Vec::new();
        for (quantity, curves) in &self.curves {
            let lookup = Lookup::new(database, *quantity)?;
            let of_one: Result<Vec<f64>, FitError> = self
                .judges
                .par_iter()
                .with_min_len(64)
                .map_init(
                    || vec![0.0; lookup.wavelengths()],
                    |found, (row, point)| {
                        lookup.spectrum(*point, found)?;
                        let found: Vec<f64> = found.iter().map(|v| f64::from(*v)).collect();
                        let truth = curves.row(*row).to_vec();
                        let few = &self.wavelengths.colour;
                        Ok(self.colour.difference_across(&truth, few, &found))
                    },
                )
                .collect();
            errors.extend(of_one?);
        }
        Ok(Judgement::of(errors.into_iter()))
    }
}

#[cfg(test)]
mod tests {
    use super::candidates;

    #[test]
    fn ends_are_candidates_and_nothing_is_twice() {
        assert_eq!(candidates(0, &[[0.3, 0.3]], 7), [0.3]);
        assert_eq!(
            candidates(1, &[[100.0, 100.0], [300.0, 300.0]], 9),
            [100.0, 300.0]
        );
        let found = candidates(3, &[[1.0, 50.0]], 17);
        assert_eq!((found.len(), found[0], found[16]), (17, 1.0, 50.0));
        assert!(found.is_sorted());
        let found = candidates(1, &[[100.0, 400.0], [250.0, 250.0]], 9);
        assert!(
            found.contains(&250.0) && (9..=10).contains(&found.len()),
            "{found:?}"
        );
    }
}
