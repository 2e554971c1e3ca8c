//! Curves at all nodes that a database might have, and how well some of them
//! give the others.
use ndarray::{Array2, Axis as Dimension};
use rayon::prelude::*;

use super::TailorError;
use super::wavelengths::Wavelengths;
use crate::colour::Colorimeter;
use crate::engine::Control;
use crate::error_budget::{Patch, Simulation};
use crate::grid::Grid;
use crate::lookup::{Database, Lookup, SubstrateKind};
use crate::measurement::Quantity;
use crate::parameter::{Axes, Parameter, Point, Region, Role};
use crate::scene::Scene;

/// Points that a choice of nodes is judged by, at most.
const JUDGES: usize = 3000;
/// Points that a choice of wavelengths is judged by, at most.
const WAVELENGTH_JUDGES: usize = 400;
/// Share of the bound for the lines between wavelengths.
const WAVELENGTHS: f64 = 0.1;
/// Power mean of the errors that a choice is to lower: near the largest, but
/// felt by all.
const POWER: f64 = 8.0;

/// Positions of nodes among the candidates of each axis, increasing; axes in
/// storage order.
pub(super) type Nodes = Vec<Vec<usize>>;

/// Errors of the look-up at the judging points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Score {
    pub(super) max: f64,
    pub(super) typical: f64,
}

impl Score {
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

/// A candidate and the row of its curve.
struct Judge {
    row: usize,
    point: Point,
}

pub(super) struct Training<'a> {
    scene: &'a Scene,
    /// Of the scene's wavelengths.
    colour: &'a Colorimeter,
    /// Those that databases have.
    pub(super) wavelengths: Wavelengths,
    parameters: Vec<Parameter>,
    substrate: SubstrateKind,
    /// Values of the candidates, in storage order.
    pub(super) axes: Vec<Vec<f64>>,
    /// `[s, l]` per quantity of the scene, at its wavelengths.
    curves: Vec<(Quantity, Array2<f64>)>,
    /// Candidates that the scene asks for, thinned out.
    judges: Vec<Judge>,
}

/// Values between the ends of `ranges`: the ends, and those that `between` spreads
/// over all of them where they differ.
fn candidates(ranges: &[[f64; 2]], between: impl Fn([f64; 2]) -> Vec<f64>) -> Vec<f64> {
    let mut values: Vec<f64> = ranges.iter().flatten().copied().collect();
    let first = values.iter().copied().fold(f64::INFINITY, f64::min);
    let last = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if ranges.iter().any(|[min, max]| min < max) {
        values.extend(between([first, last]));
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
        colour: &'a Colorimeter,
        rays: u64,
        control: &Control,
    ) -> Result<Self, TailorError> {
        let regions = &scene.regions;
        let of = |parameter: Parameter| -> Vec<f64> {
            let record = parameter.record();
            let ranges = regions.iter().filter_map(|region| region.get(parameter));
            let ranges: Vec<[f64; 2]> = ranges.collect();
            candidates(&ranges, |ends| record.scale.spread(ends, record.candidates))
        };
        // all regions have the same parameters
        let parameters = regions.first().into_iter().flat_map(Region::iter);
        let axes: Axes = parameters.map(|(p, _)| (p, of(p))).collect();
        let snow = axes.iter().filter(|(p, _)| p.record().role == Role::Snow);
        let snow: Axes = snow.map(|(p, values)| (p, values.to_vec())).collect();
        let patch = |number| Patch {
            snow: snow.point(number),
            thickness_cm: axes.values(Parameter::Thickness).to_vec(),
            angle_deg: axes.values(Parameter::Incidence).to_vec(),
        };
        let patches: Vec<Patch> = (0..snow.count()).map(patch).collect();
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
        let points = patches.iter().flat_map(Patch::points);
        let judges = points.enumerate().map(|(row, point)| Judge { row, point });
        let wanted = |judge: &Judge| regions.iter().any(|region| region.contains(&judge.point));
        let judges: Vec<_> = judges.filter(wanted).collect();
        let step = stride(judges.len(), JUDGES);
        let judges: Vec<Judge> = judges.into_iter().step_by(step).collect();
        let step = stride(judges.len(), WAVELENGTH_JUDGES);
        let seen = curves.iter().flat_map(|(_, curves)| {
            let judges = judges.iter().step_by(step);
            judges.map(|judge| curves.row(judge.row).to_vec())
        });
        let bound = WAVELENGTHS * scene.max_delta_e;
        let seen: Vec<Vec<f64>> = seen.collect();
        let wavelengths = Wavelengths::choose(&scene.wavelengths_nm, colour, &seen, bound);
        Ok(Self {
            scene,
            colour,
            wavelengths,
            parameters: axes.iter().map(|(parameter, _)| parameter).collect(),
            substrate: grid.substrate(),
            axes: axes.iter().map(|(_, values)| values.to_vec()).collect(),
            curves,
            judges,
        })
    }

    /// The values of `nodes`.
    pub(super) fn axes_of(&self, nodes: &Nodes) -> Axes {
        let chosen = nodes.iter().zip(&self.axes);
        let values = chosen.map(|(nodes, values)| nodes.iter().map(|i| values[*i]).collect());
        self.parameters.iter().copied().zip(values).collect()
    }

    /// The curves at `nodes` and the wavelengths chosen, `[s, l]`.
    pub(super) fn curves_of(&self, nodes: &Nodes, quantity: Quantity) -> Array2<f64> {
        let mut rows = vec![0];
        for (nodes, values) in nodes.iter().zip(&self.axes) {
            let next = |row: usize| nodes.iter().map(move |node| row * values.len() + node);
            rows = rows.into_iter().flat_map(next).collect();
        }
        let all = self.curves.iter().find(|(q, _)| *q == quantity);
        let there = all.map(|(_, curves)| curves.select(Dimension(0), &rows));
        there
            .map(|curves| curves.select(Dimension(1), &self.wavelengths.kept))
            .unwrap_or_default()
    }

    /// A database of exactly the curves at `nodes`.
    pub(super) fn exact(&self, nodes: &Nodes) -> Database {
        let curves = |quantity| {
            let asked = self.scene.quantities.contains(&quantity);
            asked.then(|| self.curves_of(nodes, quantity))
        };
        Database::from_curves(
            self.substrate == SubstrateKind::Black,
            &self.axes_of(nodes),
            &self.wavelengths.nm,
            curves(Quantity::Transmittance).as_ref(),
            curves(Quantity::Reflectance).as_ref(),
        )
    }

    /// How far the answers of `database` are from the curves at all candidates.
    pub(super) fn judge(&self, database: &Database) -> Result<Score, TailorError> {
        let mut errors = Vec::new();
        for (quantity, curves) in &self.curves {
            // judges of the same snow stand together, but for what every database has
            let optional = |judge: &Judge| judge.point.optional();
            for judges in self.judges.chunk_by(|a, b| optional(a) == optional(b)) {
                let Some(first) = judges.first() else {
                    continue;
                };
                let lookup = Lookup::new(&database.at(optional(first))?, *quantity)?;
                let of_one: Result<Vec<f64>, TailorError> = judges
                    .par_iter()
                    .with_min_len(64)
                    .map_init(
                        || vec![0.0; lookup.wavelengths()],
                        |found, judge| {
                            lookup.spectrum(judge.point, found)?;
                            let found: Vec<f64> = found.iter().map(|v| f64::from(*v)).collect();
                            let truth = curves.row(judge.row).to_vec();
                            let few = &self.wavelengths.colour;
                            Ok(self.colour.difference_across(&truth, few, &found))
                        },
                    )
                    .collect();
                errors.extend(of_one?);
            }
        }
        Ok(Score::of(errors.into_iter()))
    }
}

#[cfg(test)]
mod tests {
    use super::{Parameter, candidates};

    fn spreading(parameter: Parameter, ranges: &[[f64; 2]], n: usize) -> Vec<f64> {
        candidates(ranges, |ends| parameter.record().scale.spread(ends, n))
    }

    #[test]
    fn ends_are_candidates_and_nothing_is_twice() {
        assert_eq!(spreading(Parameter::Facetness, &[[0.3, 0.3]], 7), [0.3]);
        assert_eq!(
            spreading(Parameter::GrainSize, &[[100.0, 100.0], [300.0, 300.0]], 9),
            [100.0, 300.0]
        );
        let found = spreading(Parameter::Thickness, &[[1.0, 50.0]], 17);
        assert_eq!((found.len(), found[0], found[16]), (17, 1.0, 50.0));
        assert!(found.is_sorted());
        let found = spreading(Parameter::GrainSize, &[[100.0, 400.0], [250.0, 250.0]], 9);
        assert!(
            found.contains(&250.0) && (9..=10).contains(&found.len()),
            "{found:?}"
        );
    }
}
