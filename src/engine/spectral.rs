//! `spectral`: one walk serves all wavelengths and all thicknesses.
//!
//! **Absorption** is an expected weight: the walk records its paths in ice and
//! water and every wavelength scores exp(-alpha L). Beyond [`DEFERRED`] optical
//! depths of the least absorbed wavelength a walk is absorbed as an analog walk
//! of that wavelength would be, and the weights of those that survive make up
//! for it, so no walk goes on for nothing and every estimate is unbiased.
//!
//! **Dispersion.** Paths depend on the refractive indices, so walks are done
//! at a few *index nodes*, at (or, outermost, somewhat beyond) some of the
//! wavelengths asked for, chosen so that every other one lies close to the straight line between its two nodes in
//! the plane of (n, k) of ice (and of water, in wet snow). Each wavelength's
//! result is the linear mix of what the walks of its two nodes give it with
//! its own absorption. What remains is the curvature of R and T over one
//! interval of at most [`SPACING`] in index: below 0.1 % of transmittance, as
//! `tests/engines.rs` measures against walks at every wavelength's own index.
//!
//! **Thicknesses.** One walk serves them all, exactly (see
//! [`crate::transport::Walker`]): it is resumed for the next thickness where
//! the lower plane first had a say. All thicknesses cost about as much as the
//! largest alone, and curves against thickness come out smooth because their
//! errors are correlated.
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::engine::{Control, EngineError, Request, batches, indices, tables};
use crate::math::Vec3;
use crate::measurement::{Estimate, Measured, Spectrum};
use crate::optics::Index;
use crate::table::{TableSnow, TableWalker};
use crate::transport::{Absorption, End, Path, Sink, Snow, Walker};

/// Largest distance of two neighbouring nodes in refractive index.
pub(super) const SPACING: f64 = 0.0135;
/// How far the outermost nodes lie outside, in parts of the way to the next.
const STRETCH: f64 = 0.2;
/// Optical depth of the least absorbed wavelength that every walk survives.
const DEFERRED: f64 = 3.0;
/// Largest distance of a wavelength's indices from the line between its nodes.
const DEVIATION: f64 = 5e-4;
/// Weight of k against n in those distances: k changes the mean internal
/// reflectance of ice by about 3.7 per unit, n by about 1.
const K_WEIGHT: f64 = 4.0;

/// Absorption coefficients of one wavelength, 1/m.
#[derive(Clone, Copy)]
struct Coefficients {
    ice_per_m: f64,
    water_per_m: f64,
}

/// Estimates of one node: [thickness][wavelength of its span].
#[derive(Clone)]
struct NodeScores<'a> {
    reflected: Vec<Estimate>,
    transmitted: Vec<Estimate>,
    lost: Vec<u64>,
    absorption: Absorption,
    coefficients: &'a [Coefficients],
    weights: Vec<f64>,
    cancel: &'a AtomicBool,
}

impl Sink for NodeScores<'_> {
    fn end(&mut self, thicknesses: Range<usize>, end: End, path: &Path, _: Vec3) {
        let estimates = match end {
            End::Reflected => &mut self.reflected,
            End::Transmitted => &mut self.transmitted,
            End::Lost => {
                self.lost[thicknesses]
                    .iter_mut()
                    .for_each(|lost| *lost += 1);
                return;
            }
            End::Absorbed => return,
        };
        for (weight, a) in self.weights.iter_mut().zip(self.coefficients) {
            *weight = self.absorption.weight(path, a.ice_per_m, a.water_per_m);
        }
        let width = self.weights.len();
        let rows = &mut estimates[thicknesses.start * width..thicknesses.end * width];
        for row in rows.chunks_exact_mut(width) {
            row.iter_mut()
                .zip(&self.weights)
                .for_each(|(estimate, weight)| estimate.add(*weight));
        }
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

impl batches::Scores for NodeScores<'_> {
    fn merge(&mut self, other: &Self) {
        let pairs = self.reflected.iter_mut().zip(&other.reflected);
        pairs.for_each(|(a, b)| a.merge(b));
        let pairs = self.transmitted.iter_mut().zip(&other.transmitted);
        pairs.for_each(|(a, b)| a.merge(b));
        self.lost
            .iter_mut()
            .zip(&other.lost)
            .for_each(|(a, b)| *a += b);
    }
}

/// Coordinates in which nodes are placed; vacuum stands for absent water.
fn coordinates(&(ice, water): &(Index, Index), snow: &Snow) -> [f64; 4] {
    let wet = if snow.water_saturation > 0.0 {
        1.0
    } else {
        0.0
    };
    [
        ice.n,
        K_WEIGHT * ice.k,
        wet * water.n,
        wet * K_WEIGHT * water.k,
    ]
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Where `p` lies between `a` and `b`: fraction of the way, squared distance from the line.
fn project(p: [f64; 4], a: [f64; 4], b: [f64; 4]) -> (f64, f64) {
    let (ab, ap) = (minus(b, a), minus(p, a));
    let length_sq = dot(ab, ab);
    let t = if length_sq > 0.0 {
        (dot(ap, ab) / length_sq).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off: [f64; 4] = std::array::from_fn(|i| ap[i] - t * ab[i]);
    (t, dot(off, off))
}

/// Positions in the wavelength list at which walks are done, increasing; the
/// first and last wavelength are always among them.
pub(super) fn nodes(indices: &[(Index, Index)], snow: &Snow) -> Vec<usize> {
    let points: Vec<_> = indices.iter().map(|i| coordinates(i, snow)).collect();
    let mut nodes = vec![0];
    let mut from = 0;
    while from + 1 < points.len() {
        let holds = |to: &usize| {
            let ab = minus(points[*to], points[from]);
            dot(ab, ab) <= SPACING * SPACING
                && points[from..=*to]
                    .iter()
                    .all(|p| project(*p, points[from], points[*to]).1 <= DEVIATION * DEVIATION)
        };
        // neighbours are always a valid pair: both are nodes and nothing lies between
        let to = (from + 2..points.len())
            .take_while(|to| holds(to))
            .last()
            .unwrap_or(from + 1);
        nodes.push(to);
        from = to;
    }
    nodes
}

/// What the walks of one node give the wavelengths from `first` on.
struct NodeResult {
    first: usize,
    /// [thickness][wavelength]
    reflectance: Vec<Measured>,
    transmittance: Vec<Measured>,
    /// [thickness]
    lost: Vec<f64>,
    width: usize,
}

/// Refractive indices at the nodes: those of their wavelengths, but the first
/// and last are moved outward by [`STRETCH`] of the way to their neighbour if
/// there are wavelengths in between. Two independent values weigh least in the
/// variance of their mix halfway between them, so this saves walks.
fn node_indices(nodes: &[usize], indices: &[(Index, Index)]) -> Vec<(Index, Index)> {
    let beyond = |a: Index, b: Index| Index {
        n: a.n + STRETCH * (a.n - b.n),
        k: (a.k + STRETCH * (a.k - b.k)).max(0.0),
    };
    let moved = |node: usize, neighbour: usize| {
        let (a, b) = (indices[node], indices[neighbour]);
        if node.abs_diff(neighbour) > 1 {
            (beyond(a.0, b.0), beyond(a.1, b.1))
        } else {
            a
        }
    };
    let mut at: Vec<_> = nodes.iter().map(|&node| indices[node]).collect();
    if let [first, second, ..] = nodes {
        at[0] = moved(*first, *second);
    }
    if let [.., before, last] = nodes {
        at[nodes.len() - 1] = moved(*last, *before);
    }
    at
}

/// Where grain events come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Grains {
    /// Rays are followed through every grain.
    Followed,
    /// Outcomes are drawn from tables.
    Tabulated,
}

pub(super) fn run(
    request: &Request,
    control: &Control,
    grains: Grains,
) -> Result<Vec<Spectrum>, EngineError> {
    let indices = indices(request)?;
    let lights = request.illuminations.len();
    let mut spectra = vec![Spectrum::default(); request.thicknesses_m.len() * lights];
    for light in 0..lights {
        let lit = run_lit(request, control, grains, &indices, light)?;
        for (h, spectrum) in lit.into_iter().enumerate() {
            spectra[h * lights + light] = spectrum;
        }
    }
    Ok(spectra)
}

/// Spectra per thickness under one light.
fn run_lit(
    request: &Request,
    control: &Control,
    grains: Grains,
    indices: &[(Index, Index)],
    light: usize,
) -> Result<Vec<Spectrum>, EngineError> {
    let nodes = nodes(indices, request.snow);
    let node_indices = node_indices(&nodes, indices);
    let mixes = mix_of_nodes(&nodes, &node_indices, indices, request.snow);
    // the wavelengths a node serves reach from the node before it to the node after it
    let results = batches::map(control, (0..nodes.len()).collect(), |i| {
        let last = nodes[(i + 1).min(nodes.len() - 1)];
        let span = nodes[i.saturating_sub(1)]..last + 1;
        walk_node(
            request,
            control,
            (grains, light),
            indices,
            (i, node_indices[i]),
            span,
        )
    })?;
    let mut spectra = vec![Spectrum::default(); request.thicknesses_m.len()];
    for (l, mix) in mixes.iter().enumerate() {
        let ([j, i], t) = (mix.nodes, mix.share);
        let (a, b) = (&results[j], &results[i]);
        for (h, spectrum) in spectra.iter_mut().enumerate() {
            let (p, q) = (h * a.width + l - a.first, h * b.width + l - b.first);
            let mix = |a: Measured, b: Measured| if i == j { a } else { a.mix(b, t) };
            spectrum
                .reflectance
                .push(mix(a.reflectance[p], b.reflectance[q]));
            spectrum
                .transmittance
                .push(mix(a.transmittance[p], b.transmittance[q]));
            spectrum.lost.push((1.0 - t) * a.lost[h] + t * b.lost[h]);
        }
    }
    Ok(spectra)
}

/// Which nodes a wavelength lies between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mix {
    /// Positions in the list of nodes; the same twice for a single node.
    pub(super) nodes: [usize; 2],
    /// Share of the second.
    pub(super) share: f64,
}

/// Refractive indices of the nodes, and what nodes each wavelength mixes.
pub(super) fn mixes(indices: &[(Index, Index)], snow: &Snow) -> (Vec<(Index, Index)>, Vec<Mix>) {
    let nodes = nodes(indices, snow);
    let node_indices = node_indices(&nodes, indices);
    let mixes = mix_of_nodes(&nodes, &node_indices, indices, snow);
    (node_indices, mixes)
}

fn mix_of_nodes(
    nodes: &[usize],
    node_indices: &[(Index, Index)],
    indices: &[(Index, Index)],
    snow: &Snow,
) -> Vec<Mix> {
    let mix = |(l, index): (usize, &(Index, Index))| {
        // between nodes i - 1 and i; a single node stands alone
        let i = nodes
            .partition_point(|&node| node < l)
            .max(1)
            .min(nodes.len() - 1);
        let j = i.saturating_sub(1);
        let [p, a, b] = [*index, node_indices[j], node_indices[i]].map(|i| coordinates(&i, snow));
        Mix {
            nodes: [j, i],
            share: project(p, a, b).0,
        }
    };
    indices.iter().enumerate().map(mix).collect()
}

/// The walks at one index node, scored for the wavelengths of its span.
fn walk_node(
    request: &Request,
    control: &Control,
    (grains, light): (Grains, usize),
    indices: &[(Index, Index)],
    (number, node): (usize, (Index, Index)),
    span: Range<usize>,
) -> Result<NodeResult, EngineError> {
    let coefficients: Vec<Coefficients> = span
        .clone()
        .map(|l| Coefficients {
            ice_per_m: indices[l].0.absorption_per_m(request.wavelengths_nm[l]),
            water_per_m: indices[l].1.absorption_per_m(request.wavelengths_nm[l]),
        })
        .collect();
    let least =
        |of: fn(&Coefficients) -> f64| coefficients.iter().map(of).fold(f64::INFINITY, f64::min);
    let absorption = Absorption {
        ice_per_m: least(|a| a.ice_per_m),
        water_per_m: least(|a| a.water_per_m),
        deferred: DEFERRED,
    };
    let (heights, width) = (request.thicknesses_m.len(), span.len());
    let empty = NodeScores {
        reflected: vec![Estimate::default(); heights * width],
        transmitted: vec![Estimate::default(); heights * width],
        lost: vec![0; heights],
        absorption,
        coefficients: &coefficients,
        weights: vec![0.0; width],
        cancel: control.cancel,
    };
    let heights_m = request.thicknesses_m;
    let scores = match grains {
        Grains::Followed => {
            let walker = Walker::new(request.snow, request.model.entry, node, absorption);
            let purpose = [1, number as u32, 0];
            batches::run(request, control, &walker, heights_m, light, purpose, &empty)?
        }
        Grains::Tabulated => {
            let outcomes = tables::outcomes(request, control, node)?;
            let tables = outcomes.each_ref().map(|outcomes| &outcomes.table);
            let snow = TableSnow::new(request.snow, tables);
            let walker = TableWalker { snow, absorption };
            let purpose = [3, number as u32, 0];
            batches::run(request, control, &walker, heights_m, light, purpose, &empty)?
        }
    };
    let measured = |estimates: &[Estimate]| {
        estimates
            .iter()
            .map(|estimate| estimate.measured(request.rays))
            .collect()
    };
    Ok(NodeResult {
        first: span.start,
        reflectance: measured(&scores.reflected),
        transmittance: measured(&scores.transmitted),
        lost: scores
            .lost
            .iter()
            .map(|&lost| lost as f64 / request.rays as f64)
            .collect(),
        width,
    })
}
