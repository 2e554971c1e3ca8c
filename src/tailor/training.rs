//! Curves at all candidate nodes, and how accurately a subset of them reproduces the others.
use ndarray::{Array2, Axis as Dimension};
use rayon::prelude::*;

use super::TailorError;
use super::wavelengths::Wavelengths;
use crate::colour::Colorimeter;
use crate::engine::Control;
use crate::error_budget::{Patch, PatchSimulation};
use crate::grid::Grid;
use crate::lookup::{Database, Lookup, SubstrateKind};
use crate::measurement::Quantity;
use crate::parameter::{Axes, Parameter, Point, Region, Role};
use crate::scene::Scene;

/// Largest number of points that score a choice of nodes.
const JUDGES: usize = 3000;
/// Largest number of points that score a choice of wavelengths.
const WAVELENGTH_JUDGES: usize = 400;
/// Share of the bound for linear interpolation between wavelengths.
const WAVELENGTHS: f64 = 0.1;
/// Exponent of the power mean of errors that a choice minimises. The mean is close to the
/// largest error, but every error contributes.
const POWER: f64 = 8.0;

/// Indices of the nodes among the candidates of each axis, increasing; axes in storage order.
pub(super) type Nodes = Vec<Vec<usize>>;

/// Errors of look-ups at the judging points, as Delta-E.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Score {
    /// The largest error.
    pub(super) max: f64,
    /// The power mean of the errors with exponent [`POWER`].
    pub(super) typical: f64,
}

impl Score {
    /// The score of these errors.
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

/// A point that scores choices: a candidate and the row of its curve.
struct JudgingPoint {
    row: usize,
    point: Point,
}

/// The candidates with their curves, and the chosen wavelengths.
pub(super) struct Training<'a> {
    scene: &'a Scene,
    /// Colorimeter for the scene's wavelengths.
    colour: &'a Colorimeter,
    /// The wavelengths that files have.
    pub(super) wavelengths: Wavelengths,
    parameters: Vec<Parameter>,
    substrate: SubstrateKind,
    /// Values of the candidates of each axis, in storage order.
    pub(super) axes: Vec<Vec<f64>>,
    /// Curves of all candidates, `[s, l]` for each quantity of the scene, at its wavelengths.
    curves: Vec<(Quantity, Array2<f64>)>,
    /// Candidates inside the scene's regions, thinned to at most about [`JUDGES`].
    judging_points: Vec<JudgingPoint>,
}

/// The candidates of one axis: the ends of all `ranges`, and, if a range is not a single value,
/// the values that `between` spreads over the interval of all ranges. Nearly equal values are
/// merged; an end of a range is kept.
fn candidates(ranges: &[[f64; 2]], between: impl Fn([f64; 2]) -> Vec<f64>) -> Vec<f64> {
    let mut values: Vec<f64> = ranges.iter().flatten().copied().collect();
    let first = values.iter().copied().fold(f64::INFINITY, f64::min);
    let last = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if ranges.iter().any(|[min, max]| min < max) {
        values.extend(between([first, last]));
    }
    values.sort_by(f64::total_cmp);
    // A spread value next to an end is replaced by the end.
    let close = (last - first) * 1e-3;
    let mut distinct: Vec<f64> = Vec::new();
    for value in values {
        match distinct.last_mut() {
            Some(before) if value - *before <= close => {
                if ranges.iter().flatten().any(|end| *end == value) {
                    *before = value;
                }
            }
            _ => distinct.push(value),
        }
    }
    distinct
}

/// The step that selects about `most` of `n` items. Steps above 1 are odd, so that they share
/// few factors with the lengths of the axes and visit all nodes alike.
fn stride(n: usize, most: usize) -> usize {
    match n.div_ceil(most) {
        0 | 1 => 1,
        step => step | 1,
    }
}

impl<'a> Training<'a> {
    /// Simulates all candidates and chooses the wavelengths.
    ///
    /// # Errors
    /// If a simulation fails or `control` is cancelled.
    pub(super) fn new(
        scene: &'a Scene,
        grid: &'a Grid,
        colour: &'a Colorimeter,
        rays: u64,
        control: &Control,
    ) -> Result<Self, TailorError> {
        let regions = &scene.regions;
        let values_of = |parameter: Parameter| -> Vec<f64> {
            let record = parameter.record();
            let ranges = regions.iter().filter_map(|region| region.get(parameter));
            let ranges: Vec<[f64; 2]> = ranges.collect();
            candidates(&ranges, |ends| record.scale.spread(ends, record.candidates))
        };
        // All regions have the same parameters.
        let parameters = regions.first().into_iter().flat_map(Region::iter);
        let axes: Axes = parameters.map(|(p, _)| (p, values_of(p))).collect();
        let snow = axes.iter().filter(|(p, _)| p.record().role == Role::Snow);
        let snow: Axes = snow.map(|(p, values)| (p, values.to_vec())).collect();
        let patch = |number| Patch {
            snow: snow.point(number),
            thickness_cm: axes.values(Parameter::Thickness).to_vec(),
            angle_deg: axes.values(Parameter::Incidence).to_vec(),
        };
        let patches: Vec<Patch> = (0..snow.count()).map(patch).collect();
        let seed = scene.seed;
        let spectra = PatchSimulation { grid, rays, seed }.run(&patches, control)?;
        let l = grid.wavelengths_nm.len();
        let curves = |quantity: Quantity| {
            let values = spectra.iter().flatten();
            let values: Vec<f64> = values
                .flat_map(|spectrum| spectrum.of(quantity).iter().map(|m| m.value))
                .collect();
            // Every spectrum has l values.
            Array2::from_shape_vec((values.len() / l, l), values).unwrap_or_default()
        };
        let curves: Vec<(Quantity, Array2<f64>)> =
            scene.quantities.iter().map(|q| (*q, curves(*q))).collect();
        let points = patches.iter().flat_map(Patch::points);
        let judging_points = points
            .enumerate()
            .map(|(row, point)| JudgingPoint { row, point });
        let is_in_scene =
            |judge: &JudgingPoint| regions.iter().any(|region| region.contains(&judge.point));
        let judging_points: Vec<_> = judging_points.filter(is_in_scene).collect();
        let step = stride(judging_points.len(), JUDGES);
        let judging_points: Vec<JudgingPoint> = judging_points.into_iter().step_by(step).collect();
        let step = stride(judging_points.len(), WAVELENGTH_JUDGES);
        let sample = curves.iter().flat_map(|(_, curves)| {
            let judges = judging_points.iter().step_by(step);
            judges.map(|judge| curves.row(judge.row).to_vec())
        });
        let bound = WAVELENGTHS * scene.max_delta_e;
        let sample: Vec<Vec<f64>> = sample.collect();
        let wavelengths = Wavelengths::choose(&scene.wavelengths_nm, colour, &sample, bound);
        Ok(Self {
            scene,
            colour,
            wavelengths,
            parameters: axes.iter().map(|(parameter, _)| parameter).collect(),
            substrate: grid.substrate(),
            axes: axes.iter().map(|(_, values)| values.to_vec()).collect(),
            curves,
            judging_points,
        })
    }

    /// The axes with the values of `nodes`.
    pub(super) fn axes_of(&self, nodes: &Nodes) -> Axes {
        let chosen = nodes.iter().zip(&self.axes);
        let values = chosen.map(|(nodes, values)| nodes.iter().map(|i| values[*i]).collect());
        self.parameters.iter().copied().zip(values).collect()
    }

    /// The curves at `nodes` and at the chosen wavelengths, `[s, l]`.
    pub(super) fn curves_of(&self, nodes: &Nodes, quantity: Quantity) -> Array2<f64> {
        let mut rows = vec![0];
        for (nodes, values) in nodes.iter().zip(&self.axes) {
            let next = |row: usize| nodes.iter().map(move |node| row * values.len() + node);
            rows = rows.into_iter().flat_map(next).collect();
        }
        let curves = self.curves.iter().find(|(q, _)| *q == quantity);
        let at_nodes = curves.map(|(_, curves)| curves.select(Dimension(0), &rows));
        at_nodes
            .map(|curves| curves.select(Dimension(1), &self.wavelengths.positions))
            .unwrap_or_default()
    }

    /// A database of the uncompressed curves at `nodes`.
    pub(super) fn exact(&self, nodes: &Nodes) -> Database {
        let curves = |quantity| {
            let is_requested = self.scene.quantities.contains(&quantity);
            is_requested.then(|| self.curves_of(nodes, quantity))
        };
        Database::from_curves(
            self.substrate == SubstrateKind::Black,
            &self.axes_of(nodes),
            &self.wavelengths.nm,
            curves(Quantity::Transmittance).as_ref(),
            curves(Quantity::Reflectance).as_ref(),
        )
    }

    /// The errors of look-ups in `database` at the judging points.
    ///
    /// # Errors
    /// If a look-up fails.
    pub(super) fn score(&self, database: &Database) -> Result<Score, TailorError> {
        let mut errors = Vec::new();
        for (quantity, curves) in &self.curves {
            // Consecutive points with the same values of the optional axes share a look-up.
            let optional = |judge: &JudgingPoint| judge.point.optional();
            let judging_points = &self.judging_points;
            for judges in judging_points.chunk_by(|a, b| optional(a) == optional(b)) {
                let Some(first) = judges.first() else {
                    continue;
                };
                let lookup = Lookup::new(&database.at(optional(first))?, *quantity)?;
                let chunk_errors: Result<Vec<f64>, TailorError> = judges
                    .par_iter()
                    .with_min_len(64)
                    .map_init(
                        || vec![0.0; lookup.wavelengths()],
                        |buffer, judge| {
                            lookup.spectrum(judge.point, buffer)?;
                            let values: Vec<f64> = buffer.iter().map(|v| f64::from(*v)).collect();
                            let truth = curves.row(judge.row).to_vec();
                            let file_colour = &self.wavelengths.colour;
                            Ok(self.colour.difference_across(&truth, file_colour, &values))
                        },
                    )
                    .collect();
                errors.extend(chunk_errors?);
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
