//! The points at which a database is tested.
//!
//! - **Anywhere**: random snow of the regions, each at four random thicknesses and two random
//!   incidence angles. The distribution is uniform along each axis, except for the thickness,
//!   whose logarithm is uniform.
//! - **Along an axis**: nodes in all axes but one, where the value is random. This gives the
//!   error of that axis alone.
//! - **At nodes**: gives the error of the simulation alone.
//!
//! Only a few values of facetness are drawn, because each value needs its own grain tables.
use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::Patch;
use crate::parameter::{Axes, Parameter, Point, Region, Role};
use crate::sampling::CheckStream;

/// Number of thicknesses and incidence angles of a random patch: in a region whose snow
/// varies, and in a region with one fixed snow.
const ANYWHERE: [(usize, usize); 2] = [(4, 2), (16, 8)];
/// Number of facetness values drawn.
const FACETS: usize = 16;
/// Number of snows for each axis that is tested alone.
const ALONG: usize = 8;

/// The error that a point of a patch measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PointKind {
    /// A random point: the whole chain.
    Anywhere,
    /// Off the nodes in this axis only: the interpolation error of the axis.
    Along(Parameter),
    /// Off the nodes in both thickness and incidence angle, with snow at nodes. Not
    /// evaluated; simulated because it shares the walks of its patch.
    Slab,
    /// At a node: the error of the simulation.
    Nodes,
}

/// A patch, and the kind of each of its points.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub(super) patch: Patch,
    pub(super) kinds: Vec<PointKind>,
}

/// The seed of the fresh simulations.
pub(super) fn simulation_seed(seed: u64) -> u64 {
    CheckStream::ErrorBudget
        .stream("simulation", seed)
        .next_u64()
}

/// Draws random values and nodes.
struct Sampler(Xoshiro256PlusPlus);

impl Sampler {
    /// A uniform random number in [0, 1).
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * f64::EPSILON / 2.0
    }

    /// A uniform random integer from 0 to n - 1.
    fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n - 1)
    }

    /// A random value of `parameter` in the range, to five digits; thickness is drawn
    /// uniformly in its logarithm.
    fn within(&mut self, parameter: Parameter, [first, last]: [f64; 2]) -> f64 {
        if parameter.record().role != Role::Thickness || first <= 0.0 {
            return self.evenly([first, last]);
        }
        let value = first * (last / first).powf(self.unit());
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.clamp(first, last)
    }

    /// A random node of each axis.
    fn node_of_each<'a>(&mut self, axes: impl Iterator<Item = (Parameter, &'a [f64])>) -> Point {
        axes.map(|(parameter, nodes)| (parameter, nodes[self.below(nodes.len())]))
            .collect()
    }

    /// A uniform random value in the range, to five digits.
    fn evenly(&mut self, [first, last]: [f64; 2]) -> f64 {
        let value = first + (last - first) * self.unit();
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.clamp(first, last)
    }

    /// `n` random values in increasing order, without duplicates; one value if the range is a
    /// single value.
    fn several(&mut self, parameter: Parameter, range: [f64; 2], n: usize) -> Vec<f64> {
        let n = if range[0] == range[1] { 1 } else { n };
        let mut values: Vec<f64> = (0..n).map(|_| self.within(parameter, range)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    }

    /// `n` random nodes in increasing order, without duplicates.
    fn nodes(&mut self, nodes: &[f64], n: usize) -> Vec<f64> {
        let mut values: Vec<f64> = (0..n).map(|_| nodes[self.below(nodes.len())]).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    }
}

/// Whether a file has a curve for a grain size (um) and a thickness (cm).
pub(super) type IsCovered<'a> = &'a dyn Fn(f64, f64) -> bool;

impl Trial {
    /// The trial without the points that the file does not cover; `None` if none remains.
    pub(super) fn within(mut self, is_covered: IsCovered<'_>) -> Option<Self> {
        let angles = self.patch.angle_deg.len();
        let size = self.patch.snow[Parameter::GrainSize];
        let thickness_cm = self.patch.thickness_cm.iter();
        let covered: Vec<bool> = thickness_cm.map(|cm| is_covered(size, *cm)).collect();
        let mut points = covered
            .iter()
            .flat_map(|covered| std::iter::repeat_n(*covered, angles));
        self.kinds.retain(|_| points.next().unwrap_or_default());
        let mut thicknesses = covered.iter();
        self.patch
            .thickness_cm
            .retain(|_| thicknesses.next().is_some_and(|covered| *covered));
        (!self.kinds.is_empty()).then_some(self)
    }
}

/// About `points` random points in the `regions` that the file covers, and the number of
/// points drawn that it does not cover.
pub(super) fn anywhere(
    regions: &[Region],
    points: usize,
    seed: u64,
    is_covered: IsCovered<'_>,
) -> (Vec<Trial>, usize) {
    let mut sampler = Sampler(CheckStream::ErrorBudget.stream("anywhere", seed));
    let facets: Vec<f64> = (0..FACETS)
        .map(|i| (i as f64 + sampler.unit()) / FACETS as f64)
        .collect();
    let mut trials: Vec<Trial> = Vec::new();
    let (mut count, mut drawn, mut uncovered) = (0, 0, 0);
    // Each region is drawn at least once; a scene of single points has one point per patch.
    while drawn < regions.len() || (count < points && drawn < points) {
        let region = &regions[drawn % regions.len()];
        let ends = |parameter| region.get(parameter).unwrap_or_default();
        let snow = region.iter().filter(|(p, _)| p.record().role == Role::Snow);
        let (optional, core): (Vec<_>, Vec<_>) = snow.partition(|(p, _)| p.is_optional());
        let mut snow = core.iter().chain(&optional);
        let fixed = snow.all(|(_, [first, last])| first == last);
        let (thicknesses, angles) = ANYWHERE[usize::from(fixed)];
        let facet = facets[drawn / regions.len() % FACETS];
        let draw = |sampler: &mut Sampler, (parameter, range): (Parameter, [f64; 2])| {
            let [first, last] = range;
            if parameter != Parameter::Facetness {
                return (parameter, sampler.within(parameter, range));
            }
            let value = first + (last - first) * facet;
            let value: f64 = format!("{value:.4}").parse().unwrap_or(value);
            (parameter, value.clamp(first, last))
        };
        let core: Point = core
            .into_iter()
            .map(|axis| draw(&mut sampler, axis))
            .collect();
        let (h, a) = (Parameter::Thickness, Parameter::Incidence);
        let thickness_cm = sampler.several(h, ends(h), thicknesses);
        let angle_deg = sampler.several(a, ends(a), angles);
        let optional: Point = optional
            .into_iter()
            .map(|axis| draw(&mut sampler, axis))
            .collect();
        let patch = Patch {
            snow: core.and(optional),
            thickness_cm,
            angle_deg,
        };
        drawn += 1;
        let kinds = vec![PointKind::Anywhere; patch.len()];
        uncovered += patch.len();
        if let Some(trial) = (Trial { patch, kinds }).within(is_covered) {
            uncovered -= trial.patch.len();
            count += trial.patch.len();
            trials.push(trial);
        }
    }
    (trials, uncovered)
}

/// Points at the nodes of `axes`, and points off the nodes in one axis each.
pub(super) fn along(axes: &Axes, seed: u64) -> Vec<Trial> {
    let mut sampler = Sampler(CheckStream::ErrorBudget.stream("along", seed));
    let mut trials = Vec::new();
    let (h, a) = (Parameter::Thickness, Parameter::Incidence);
    let ends = |parameter: Parameter| axes.region().get(parameter).unwrap_or_default();
    let snow = axes.iter().filter(|(p, _)| p.record().role == Role::Snow);
    let core = snow.clone().filter(|(p, _)| !p.is_optional());
    let optional = snow.clone().filter(|(p, _)| p.is_optional());
    let snow_axes = core.clone().chain(optional.clone());
    for (parameter, _) in snow_axes.filter(|(_, nodes)| nodes.len() > 1) {
        for _ in 0..ALONG {
            let mut snow = sampler.node_of_each(core.clone());
            if !parameter.is_optional() {
                snow.set(parameter, sampler.within(parameter, ends(parameter)));
            }
            let thickness_cm = sampler.nodes(axes.values(h), 3);
            let angle_deg = sampler.nodes(axes.values(a), 2);
            snow = snow.and(sampler.node_of_each(optional.clone()));
            if parameter.is_optional() {
                snow.set(parameter, sampler.within(parameter, ends(parameter)));
            }
            let patch = Patch {
                snow,
                thickness_cm,
                angle_deg,
            };
            let kinds = vec![PointKind::Along(parameter); patch.len()];
            trials.push(Trial { patch, kinds });
        }
    }
    for _ in 0..ALONG {
        let snow = sampler.node_of_each(core.clone());
        // Nodes and random values in one patch share their walks.
        let mut mixed = |parameter: Parameter| -> Vec<(f64, bool)> {
            let axis_nodes = axes.values(parameter);
            let nodes = sampler.nodes(axis_nodes, 3).into_iter().map(|v| (v, true));
            let mut values: Vec<_> = nodes.collect();
            if axis_nodes.len() > 1 {
                let others = sampler.several(parameter, ends(parameter), 3).into_iter();
                let others = others.filter(|v| !axis_nodes.contains(v));
                values.extend(others.map(|v| (v, false)));
            }
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            values
        };
        let (thicknesses, angles) = (mixed(h), mixed(a));
        let patch = Patch {
            snow: snow.and(sampler.node_of_each(optional.clone())),
            thickness_cm: thicknesses.iter().map(|(v, _)| *v).collect(),
            angle_deg: angles.iter().map(|(v, _)| *v).collect(),
        };
        let kinds = thicknesses.iter().flat_map(|(_, on_h)| {
            angles.iter().map(move |(_, on_a)| match (on_h, on_a) {
                (true, true) => PointKind::Nodes,
                (false, true) => PointKind::Along(h),
                (true, false) => PointKind::Along(a),
                (false, false) => PointKind::Slab,
            })
        });
        let kinds = kinds.collect();
        trials.push(Trial { patch, kinds });
    }
    trials
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(core: [[f64; 2]; 5]) -> Region {
        Parameter::CORE.into_iter().zip(core).collect()
    }

    #[test]
    fn every_region_is_tried_and_points_stay_inside() {
        let snow = |size: f64| region([[0.3; 2], [size; 2], [250.0; 2], [1.0, 80.0], [0.0, 89.0]]);
        let regions: Vec<Region> = (1..=7).map(|i| snow(100.0 * f64::from(i))).collect();
        let (trials, uncovered) = anywhere(&regions, 512, 1, &|_, _| true);
        assert_eq!(uncovered, 0);
        for region in &regions {
            let mine = |trial: &&Trial| trial.patch.points().all(|p| region.contains(&p));
            assert!(trials.iter().filter(mine).count() > 0);
        }
        let wide = region([
            [0.1, 0.9],
            [100.0, 500.0],
            [200.0, 400.0],
            [1.0, 50.0],
            [0.0, 89.0],
        ]);
        let all = |trials: &[Trial]| -> Vec<Point> {
            trials
                .iter()
                .flat_map(|t| t.patch.points().collect::<Vec<_>>())
                .collect()
        };
        let (trials, _) = anywhere(std::slice::from_ref(&wide), 500, 2, &|_, _| true);
        let points = all(&trials);
        assert!(points.len() >= 500 && points.len() < 520);
        for point in &points {
            assert!(wide.contains(point), "{point}");
        }
        let (other, _) = anywhere(std::slice::from_ref(&wide), 500, 3, &|_, _| true);
        assert_ne!(points[0], all(&other)[0]);
        // a single point
        let one = region([[0.3; 2], [300.0; 2], [250.0; 2], [15.0; 2], [0.0; 2]]);
        let (trials, _) = anywhere(&[one], 16, 1, &|_, _| true);
        assert!(trials.iter().all(|trial| trial.patch.len() == 1));
        // Points that the file does not cover are replaced, so that there are as many points.
        let thick = |size: f64, thickness: f64| thickness >= size / 20.0;
        let (trials, uncovered) = anywhere(&[wide], 500, 2, &thick);
        assert!(uncovered > 0);
        let points = all(&trials);
        assert!(points.len() >= 500 && points.len() < 520);
        let (size, thickness) = (Parameter::GrainSize, Parameter::Thickness);
        assert!(points.iter().all(|p| thick(p[size], p[thickness])));
        assert!(trials.iter().all(|t| t.kinds.len() == t.patch.len()));
    }

    #[test]
    fn along_leaves_the_nodes_in_one_axis_alone() {
        let axes = Axes::from([
            (Parameter::BlackCarbon, vec![0.0, 50.0, 400.0]),
            (Parameter::Facetness, vec![0.1, 0.5]),
            (Parameter::GrainSize, vec![100.0, 300.0]),
            (Parameter::Density, vec![250.0]),
            (Parameter::Thickness, vec![1.0, 5.0]),
            (Parameter::Incidence, vec![0.0, 60.0]),
        ]);
        let mut seen = std::collections::BTreeSet::new();
        for trial in along(&axes, 1) {
            for (point, kind) in trial.patch.points().zip(&trial.kinds) {
                let off = axes.iter().filter(|(p, nodes)| !nodes.contains(&point[*p]));
                let off: Vec<Parameter> = off.map(|(p, _)| p).collect();
                match kind {
                    PointKind::Nodes => assert!(off.is_empty()),
                    PointKind::Along(parameter) => {
                        assert_eq!(off, [*parameter]);
                        seen.insert(*parameter);
                    }
                    PointKind::Slab => {
                        assert_eq!(off, [Parameter::Thickness, Parameter::Incidence]);
                    }
                    PointKind::Anywhere => panic!("{point} is not along an axis"),
                }
            }
        }
        let several = axes.iter().filter(|(_, nodes)| nodes.len() > 1);
        assert!(seen.into_iter().eq(several.map(|(p, _)| p)));
    }
}
