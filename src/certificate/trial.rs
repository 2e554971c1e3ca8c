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
use std::collections::BTreeMap;

use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use sha2::{Digest, Sha256};

use super::Patch;
use crate::grid::{Conditions, ExtraAxis};

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
    Along(usize),
    /// Off the nodes in this axis beyond the five alone.
    Beyond(ExtraAxis),
    /// Off the nodes in thickness and angle, of snow on the nodes: only there for
    /// the walks that it shares.
    Slab,
    Nodes,
}

/// A box of the axes, lowest and highest value each.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Of the five.
    pub axes: [[f64; 2]; 5],
    /// Of those beyond.
    pub extra: BTreeMap<ExtraAxis, [f64; 2]>,
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

    /// In the range of `axis`, to five digits.
    fn within(&mut self, axis: usize, [first, last]: [f64; 2]) -> f64 {
        if axis != 3 || first <= 0.0 {
            return self.evenly([first, last]);
        }
        let value = first * (last / first).powf(self.unit());
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.clamp(first, last)
    }

    /// Values in these ranges.
    fn conditions(&mut self, ranges: &BTreeMap<ExtraAxis, [f64; 2]>) -> Conditions {
        let ranges = ranges.iter();
        ranges
            .map(|(axis, range)| (*axis, self.evenly(*range)))
            .collect()
    }

    /// Nodes of these axes.
    fn node_of_each(&mut self, axes: &BTreeMap<ExtraAxis, Vec<f64>>) -> Conditions {
        let axes = axes.iter();
        axes.map(|(axis, nodes)| (*axis, nodes[self.below(nodes.len())]))
            .collect()
    }

    /// Uniform between these, to five digits.
    fn evenly(&mut self, [first, last]: [f64; 2]) -> f64 {
        let value = first + (last - first) * self.unit();
        let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
        rounded.clamp(first, last)
    }

    /// `n` different values, increasing; one if there is but one.
    fn several(&mut self, axis: usize, range: [f64; 2], n: usize) -> Vec<f64> {
        let n = if range[0] == range[1] { 1 } else { n };
        let mut values: Vec<f64> = (0..n).map(|_| self.within(axis, range)).collect();
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
        let size = self.patch.snow[1];
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
        let Region { axes, extra } = region;
        let beyond = axes[..3].iter().chain(extra.values());
        let fixed = beyond.into_iter().all(|[first, last]| first == last);
        let (thicknesses, angles) = ANYWHERE[usize::from(fixed)];
        let [first, last] = axes[0];
        let facetness = first + (last - first) * facets[drawn / regions.len() % FACETS];
        let facetness: f64 = format!("{facetness:.4}").parse().unwrap_or(facetness);
        let patch = Patch {
            snow: [
                facetness.clamp(first, last),
                draw.within(1, axes[1]),
                draw.within(2, axes[2]),
            ],
            thickness_cm: draw.several(3, axes[3], thicknesses),
            angle_deg: draw.several(4, axes[4], angles),
            conditions: draw.conditions(extra),
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
pub(super) fn along(
    axes: &[Vec<f64>; 5],
    extra: &BTreeMap<ExtraAxis, Vec<f64>>,
    seed: u64,
) -> Vec<Trial> {
    let mut draw = Draw(random(seed, "along"));
    let mut trials = Vec::new();
    let ends = |axis: usize| [axes[axis][0], axes[axis][axes[axis].len() - 1]];
    for axis in (0..3).filter(|axis| axes[*axis].len() > 1) {
        for _ in 0..ALONG {
            let mut snow = [0, 1, 2].map(|other: usize| axes[other][draw.below(axes[other].len())]);
            snow[axis] = draw.within(axis, ends(axis));
            let patch = Patch {
                snow,
                thickness_cm: draw.nodes(&axes[3], 3),
                angle_deg: draw.nodes(&axes[4], 2),
                conditions: draw.node_of_each(extra),
            };
            let kinds = vec![Kind::Along(axis); patch.len()];
            trials.push(Trial { patch, kinds });
        }
    }
    for (axis, nodes) in extra.iter().filter(|(_, nodes)| nodes.len() > 1) {
        for _ in 0..ALONG {
            let mut conditions = draw.node_of_each(extra);
            conditions.insert(*axis, draw.evenly([nodes[0], nodes[nodes.len() - 1]]));
            let patch = Patch {
                snow: [0, 1, 2].map(|axis: usize| axes[axis][draw.below(axes[axis].len())]),
                thickness_cm: draw.nodes(&axes[3], 3),
                angle_deg: draw.nodes(&axes[4], 2),
                conditions,
            };
            let kinds = vec![Kind::Beyond(*axis); patch.len()];
            trials.push(Trial { patch, kinds });
        }
    }
    for _ in 0..ALONG {
        let snow = [0, 1, 2].map(|axis: usize| axes[axis][draw.below(axes[axis].len())]);
        // nodes and others side by side: they share their walks
        let mut mixed = |axis: usize| -> Vec<(f64, bool)> {
            let nodes = draw.nodes(&axes[axis], 3).into_iter().map(|v| (v, true));
            let mut values: Vec<_> = nodes.collect();
            if axes[axis].len() > 1 {
                let others = draw.several(axis, ends(axis), 3).into_iter();
                let others = others.filter(|v| !axes[axis].contains(v));
                values.extend(others.map(|v| (v, false)));
            }
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            values
        };
        let (thicknesses, angles) = (mixed(3), mixed(4));
        let patch = Patch {
            snow,
            thickness_cm: thicknesses.iter().map(|(v, _)| *v).collect(),
            angle_deg: angles.iter().map(|(v, _)| *v).collect(),
            conditions: draw.node_of_each(extra),
        };
        let kinds = thicknesses.iter().flat_map(|(_, h)| {
            angles.iter().map(move |(_, a)| match (h, a) {
                (true, true) => Kind::Nodes,
                (false, true) => Kind::Along(3),
                (true, false) => Kind::Along(4),
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

    #[test]
    fn every_region_is_tried_and_points_stay_inside() {
        let region = |axes| Region {
            axes,
            extra: BTreeMap::new(),
        };
        let snow = |size: f64| region([[0.3; 2], [size; 2], [250.0; 2], [1.0, 80.0], [0.0, 89.0]]);
        let regions: Vec<Region> = (1..=7).map(|i| snow(100.0 * f64::from(i))).collect();
        let (trials, unanswered) = anywhere(&regions, 512, 1, &|_, _| true);
        assert_eq!(unanswered, 0);
        for region in &regions {
            let mine = |trial: &&Trial| trial.patch.snow[1] == region.axes[1][0];
            assert!(trials.iter().filter(mine).count() > 0);
        }
        let wide = [
            [0.1, 0.9],
            [100.0, 500.0],
            [200.0, 400.0],
            [1.0, 50.0],
            [0.0, 89.0],
        ];
        let (trials, _) = anywhere(&[region(wide)], 500, 2, &|_, _| true);
        let points: Vec<_> = trials.iter().flat_map(|t| t.patch.points()).collect();
        assert!(points.len() >= 500 && points.len() < 520);
        for point in &points {
            for (value, [first, last]) in point.coordinates().into_iter().zip(wide) {
                assert!((first..=last).contains(&value), "{point}");
            }
        }
        assert_ne!(
            points[0],
            anywhere(&[region(wide)], 500, 3, &|_, _| true).0[0]
                .patch
                .points()
                .next()
                .unwrap_or(points[0])
        );
        // a single point
        let one = [[0.3; 2], [300.0; 2], [250.0; 2], [15.0; 2], [0.0; 2]];
        let (trials, _) = anywhere(&[region(one)], 16, 1, &|_, _| true);
        assert!(trials.iter().all(|trial| trial.patch.len() == 1));
        // what the file does not answer is not tried, and there are as many points
        let thick = |size: f64, thickness: f64| thickness >= size / 20.0;
        let (trials, unanswered) = anywhere(&[region(wide)], 500, 2, &thick);
        assert!(unanswered > 0);
        let points: Vec<_> = trials.iter().flat_map(|t| t.patch.points()).collect();
        assert!(points.len() >= 500 && points.len() < 520);
        assert!(
            points
                .iter()
                .all(|p| thick(p.grain_size_um, p.thickness_cm))
        );
        assert!(trials.iter().all(|t| t.kinds.len() == t.patch.len()));
    }

    #[test]
    fn along_leaves_the_nodes_in_one_axis_alone() {
        let axes = [
            vec![0.1, 0.5],
            vec![100.0, 300.0],
            vec![250.0],
            vec![1.0, 5.0],
            vec![0.0, 60.0],
        ];
        let mut seen = [0; 5];
        let extra = BTreeMap::from([(ExtraAxis::BlackCarbon, vec![0.0, 50.0, 400.0])]);
        let mut beyond = 0;
        for trial in along(&axes, &extra, 1) {
            let carbon = trial.patch.conditions[&ExtraAxis::BlackCarbon];
            let on_node = extra[&ExtraAxis::BlackCarbon].contains(&carbon);
            let alone = |kind: &Kind| matches!(kind, Kind::Beyond(_));
            assert_eq!(on_node, !trial.kinds.iter().any(alone));
            for (point, kind) in trial.patch.points().zip(&trial.kinds) {
                let coordinates = point.coordinates();
                let off = |axis: &usize| !axes[*axis].contains(&coordinates[*axis]);
                let off: Vec<usize> = (0..5).filter(off).collect();
                match kind {
                    Kind::Nodes => assert!(off.is_empty()),
                    Kind::Beyond(axis) => {
                        assert_eq!((*axis, off.len()), (ExtraAxis::BlackCarbon, 0));
                        beyond += 1;
                    }
                    Kind::Along(axis) => {
                        assert_eq!(off, [*axis]);
                        seen[*axis] += 1;
                    }
                    Kind::Slab => assert_eq!(off, [3, 4]),
                    Kind::Anywhere => panic!("{point} is not along an axis"),
                }
            }
        }
        assert!(beyond > 0);
        assert!(seen[0] > 0 && seen[1] > 0 && seen[2] == 0 && seen[3] > 0 && seen[4] > 0);
    }
}
