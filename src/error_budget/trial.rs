//! Where a database is tried.
//!
//! - **Anywhere**: random snow of the regions, each at four random thicknesses
//!   and two random angles. Uniform along each axis, but for the thickness, whose
//!   logarithm is.
//! - **Along an axis**: nodes in all axes but one, which is random: the error
//!   that this axis alone makes.
//! - **On nodes**: the error of the simulation alone.
//!
//! Facetness takes a few values only, since each needs tables of its own.
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};

use super::Patch;
use crate::parameter::{Axes, Parameter, Point, Region, Role};

/// Points of a patch anywhere, thicknesses and angles: of snow that varies, and
/// of snow that does not.
const ANYWHERE: [(usize, usize); 2] = [(4, 2), (16, 8)];
/// Values of the facetness.
const FACETS: usize = 16;
/// Snows per axis tried alone.
const ALONG: usize = 8;

/// What a point of a patch tells about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Anywhere,
    /// Off the nodes in this axis alone.
    Along(Parameter),
    /// Off the nodes in thickness and angle, of snow on the nodes: only there for
    /// the walks that it shares.
    Slab,
    Nodes,
}

/// A patch, and what each of its points tells about.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub(super) patch: Patch,
    pub(super) kinds: Vec<Kind>,
}

/// Random numbers of `purpose`: by their hash none of those that made a database.
fn random(seed: u64, purpose: &str) -> Xoshiro256PlusPlus {
    let mut hash = Sha256::new();
    hash.update(b"splitsnow certificate 1 ");
    hash.update(purpose);
    hash.update(seed.to_le_bytes());
    Xoshiro256PlusPlus::from_seed(hash.finalize().into())
}

/// Seed of the simulations.
pub(super) fn simulation_seed(seed: u64) -> u64 {
    random(seed, "simulation").next_u64()
}

struct Draw(Xoshiro256PlusPlus);

impl Draw {
    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * f64::EPSILON / 2.0
    }

    fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n - 1)
    }

    /// In a range of `parameter`, to five digits.
    fn within(&mut self, parameter: Parameter, [first, last]: [f64; 2]) -> f64 {
        if parameter.record().role != Role::Thickness || first <= 0.0 {
            return self.evenly([first, last]);
        }
        let value = first * (last / first).powf(self.unit());
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.clamp(first, last)
    }

    /// A node of each of these axes.
    fn node_of_each<'a>(&mut self, axes: impl Iterator<Item = (Parameter, &'a [f64])>) -> Point {
        axes.map(|(parameter, nodes)| (parameter, nodes[self.below(nodes.len())]))
            .collect()
    }

    /// Uniform between these, to five digits.
    fn evenly(&mut self, [first, last]: [f64; 2]) -> f64 {
        let value = first + (last - first) * self.unit();
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.clamp(first, last)
    }

    /// `n` different values, increasing; one if there is but one.
    fn several(&mut self, parameter: Parameter, range: [f64; 2], n: usize) -> Vec<f64> {
        let n = if range[0] == range[1] { 1 } else { n };
        let mut values: Vec<f64> = (0..n).map(|_| self.within(parameter, range)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    }

    /// `n` different nodes, increasing.
    fn nodes(&mut self, nodes: &[f64], n: usize) -> Vec<f64> {
        let mut values: Vec<f64> = (0..n).map(|_| nodes[self.below(nodes.len())]).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    }
}

/// Whether a file has an answer for grains of a size, um, in a thickness, cm.
pub(super) type Covered<'a> = &'a dyn Fn(f64, f64) -> bool;

impl Trial {
    /// Its points that the file answers, if there are any.
    pub(super) fn within(mut self, covered: Covered<'_>) -> Option<Self> {
        let angles = self.patch.angle_deg.len();
        let size = self.patch.snow[Parameter::GrainSize];
        let there = self.patch.thickness_cm.iter().map(|cm| covered(size, *cm));
        let there: Vec<bool> = there.collect();
        let mut points = there
            .iter()
            .flat_map(|there| std::iter::repeat_n(*there, angles));
        self.kinds.retain(|_| points.next().unwrap_or_default());
        let mut thicknesses = there.iter();
        self.patch
            .thickness_cm
            .retain(|_| thicknesses.next().is_some_and(|there| *there));
        (!self.kinds.is_empty()).then_some(self)
    }
}

/// Some `points` points anywhere in the `regions` that the file answers, and how many
/// were drawn that it does not.
pub(super) fn anywhere(
    regions: &[Region],
    points: usize,
    seed: u64,
    covered: Covered<'_>,
) -> (Vec<Trial>, usize) {
    let mut draw = Draw(random(seed, "anywhere"));
    let facets: Vec<f64> = (0..FACETS)
        .map(|i| (i as f64 + draw.unit()) / FACETS as f64)
        .collect();
    let mut trials: Vec<Trial> = Vec::new();
    let (mut count, mut drawn, mut unanswered) = (0, 0, 0);
    // every region has its turn; a scene of one point is one patch
    while drawn < regions.len() || (count < points && drawn < points) {
        let region = &regions[drawn % regions.len()];
        let ends = |parameter| region.get(parameter).unwrap_or_default();
        let snow = region.iter().filter(|(p, _)| p.record().role == Role::Snow);
        let (optional, core): (Vec<_>, Vec<_>) = snow.partition(|(p, _)| p.is_optional());
        let mut snow = core.iter().chain(&optional);
        let fixed = snow.all(|(_, [first, last])| first == last);
        let (thicknesses, angles) = ANYWHERE[usize::from(fixed)];
        let facet = facets[drawn / regions.len() % FACETS];
        let value = |draw: &mut Draw, (parameter, range): (Parameter, [f64; 2])| {
            let [first, last] = range;
            if parameter != Parameter::Facetness {
                return (parameter, draw.within(parameter, range));
            }
            let value = first + (last - first) * facet;
            let value: f64 = format!("{value:.4}").parse().unwrap_or(value);
            (parameter, value.clamp(first, last))
        };
        let core: Point = core.into_iter().map(|of| value(&mut draw, of)).collect();
        let (h, a) = (Parameter::Thickness, Parameter::Incidence);
        let thickness_cm = draw.several(h, ends(h), thicknesses);
        let angle_deg = draw.several(a, ends(a), angles);
        let optional: Point = optional
            .into_iter()
            .map(|of| value(&mut draw, of))
            .collect();
        let patch = Patch {
            snow: core.and(optional),
            thickness_cm,
            angle_deg,
        };
        drawn += 1;
        let kinds = vec![Kind::Anywhere; patch.len()];
        unanswered += patch.len();
        if let Some(trial) = (Trial { patch, kinds }).within(covered) {
            unanswered -= trial.patch.len();
            count += trial.patch.len();
            trials.push(trial);
        }
    }
    (trials, unanswered)
}

/// Points on the nodes of `axes` and off them in one axis each.
pub(super) fn along(axes: &Axes, seed: u64) -> Vec<Trial> {
    let mut draw = Draw(random(seed, "along"));
    let mut trials = Vec::new();
    let (h, a) = (Parameter::Thickness, Parameter::Incidence);
    let ends = |parameter: Parameter| axes.region().get(parameter).unwrap_or_default();
    let snow = axes.iter().filter(|(p, _)| p.record().role == Role::Snow);
    let core = snow.clone().filter(|(p, _)| !p.is_optional());
    let optional = snow.clone().filter(|(p, _)| p.is_optional());
    let all = core.clone().chain(optional.clone());
    for (parameter, _) in all.filter(|(_, nodes)| nodes.len() > 1) {
        for _ in 0..ALONG {
            let mut snow = draw.node_of_each(core.clone());
            if !parameter.is_optional() {
                snow.set(parameter, draw.within(parameter, ends(parameter)));
            }
            let thickness_cm = draw.nodes(axes.values(h), 3);
            let angle_deg = draw.nodes(axes.values(a), 2);
            snow = snow.and(draw.node_of_each(optional.clone()));
            if parameter.is_optional() {
                snow.set(parameter, draw.within(parameter, ends(parameter)));
            }
            let patch = Patch {
                snow,
                thickness_cm,
                angle_deg,
            };
            let kinds = vec![Kind::Along(parameter); patch.len()];
            trials.push(Trial { patch, kinds });
        }
    }
    for _ in 0..ALONG {
        let snow = draw.node_of_each(core.clone());
        // nodes and others side by side: they share their walks
        let mut mixed = |parameter: Parameter| -> Vec<(f64, bool)> {
            let all = axes.values(parameter);
            let nodes = draw.nodes(all, 3).into_iter().map(|v| (v, true));
            let mut values: Vec<_> = nodes.collect();
            if all.len() > 1 {
                let others = draw.several(parameter, ends(parameter), 3).into_iter();
                let others = others.filter(|v| !all.contains(v));
                values.extend(others.map(|v| (v, false)));
            }
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            values
        };
        let (thicknesses, angles) = (mixed(h), mixed(a));
        let patch = Patch {
            snow: snow.and(draw.node_of_each(optional.clone())),
            thickness_cm: thicknesses.iter().map(|(v, _)| *v).collect(),
            angle_deg: angles.iter().map(|(v, _)| *v).collect(),
        };
        let kinds = thicknesses.iter().flat_map(|(_, on_h)| {
            angles.iter().map(move |(_, on_a)| match (on_h, on_a) {
                (true, true) => Kind::Nodes,
                (false, true) => Kind::Along(h),
                (true, false) => Kind::Along(a),
                (false, false) => Kind::Slab,
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
        let (trials, unanswered) = anywhere(&regions, 512, 1, &|_, _| true);
        assert_eq!(unanswered, 0);
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
        // what the file does not answer is not tried, and there are as many points
        let thick = |size: f64, thickness: f64| thickness >= size / 20.0;
        let (trials, unanswered) = anywhere(&[wide], 500, 2, &thick);
        assert!(unanswered > 0);
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
                    Kind::Nodes => assert!(off.is_empty()),
                    Kind::Along(parameter) => {
                        assert_eq!(off, [*parameter]);
                        seen.insert(*parameter);
                    }
                    Kind::Slab => assert_eq!(off, [Parameter::Thickness, Parameter::Incidence]),
                    Kind::Anywhere => panic!("{point} is not along an axis"),
                }
            }
        }
        let several = axes.iter().filter(|(_, nodes)| nodes.len() > 1);
        assert!(seen.into_iter().eq(several.map(|(p, _)| p)));
    }
}
