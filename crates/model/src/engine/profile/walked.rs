//! Profiles from walks of the whole snowpack, grain by grain, in independent parts
//! (docs/methods.md, "Light inside the snow"). Depths in m, fluxes per incident flux. Where few
//! walks arrive, deep or dark, the standard errors are rough.
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Profile;
use crate::engine::nodes::{Mix, Spacing, mixes, nodes};
use crate::engine::spectral::DEFERRED;
use crate::engine::{Control, Engine, EngineError, Request, batches, coefficients, engine_error};
use crate::engine::{exits, indices};
use crate::math::Vec3;
use crate::optics::Index;
use crate::rng::{Key, Stream};
use crate::transport::{
    Absorption, Bounce, CROSSING_SCORES, Coefficients, End, Leg, Path, PlaneFluxes, Planes, Sink,
    Walk, Walker,
};

/// Number of independent parts.
const PARTS: u64 = exits::PARTS;
/// Largest probability that a walk is reflected by the substrate, so that none goes on for ever.
const MOST_REFLECTED: f64 = 0.999;

/// Walks at one pair of refractive indices, scored at the wavelengths of `span`.
struct ProfileNode {
    number: usize,
    indices: (Index, Index),
    span: Range<usize>,
}

/// Scores of the crossings of one part: `[wavelength][plane]`.
struct CrossingSums<'a> {
    planes: &'a Planes,
    absorption: Absorption,
    coefficients: &'a [Coefficients],
    /// Reflectance of the substrate per wavelength, and the probability that a walk is reflected.
    substrate: (&'a [f64], f64),
    sums: Vec<Vec<PlaneFluxes>>,
    lost: u64,
    cancel: &'a AtomicBool,
}

impl Sink for CrossingSums<'_> {
    fn end(&mut self, _: Range<usize>, end: End, _: &Path, _: Vec3) {
        self.lost += u64::from(end == End::Lost);
    }

    fn follows(&self) -> bool {
        true
    }

    fn leg(&mut self, leg: &Leg, budget: f64) {
        let (reflectance, bounce) = self.substrate;
        for crossing in self.planes.crossings(leg) {
            if self.absorption.coefficients.depth(&crossing.path) >= budget {
                continue;
            }
            let wavelengths = self.coefficients.iter().zip(reflectance);
            for (sums, (coefficients, reflectance)) in self.sums.iter_mut().zip(wavelengths) {
                let mut weight = self.absorption.weight(&crossing.path, coefficients);
                for _ in 0..crossing.path.bounces {
                    weight *= reflectance / bounce;
                }
                let sums = sums[crossing.plane].iter_mut();
                sums.zip(crossing.scores)
                    .for_each(|(sum, score)| *sum += weight * score);
            }
        }
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

/// The profile at `depths_m`, increasing, on a substrate of this `reflectance` per wavelength.
/// `reference` walks every wavelength on its own, with analog absorption.
pub(super) fn run(
    engine: Engine,
    request: &Request,
    depths_m: &[f64],
    reflectance: &[f64],
    control: &Control,
) -> Result<Profile, EngineError> {
    let indices = indices(request)?;
    let (purpose, deferred) = match engine {
        Engine::Reference => (32, 0.0),
        _ => (33, DEFERRED),
    };
    let (all_nodes, mixes) = match engine {
        Engine::Reference => separate(&indices),
        _ => shared(&indices, request.snowpack.is_wet()),
    };
    let coefficients = coefficients(request, &indices);
    let planes = Planes::new(depths_m, request.thicknesses_m[0]);
    let (tracers, rays) = (request.tracers(), request.rays.div_ceil(PARTS));
    let walk = |(node, part): (&ProfileNode, u64)| {
        let coefficients = &coefficients[node.span.clone()];
        let absorption = Absorption {
            coefficients: Coefficients::least(coefficients),
            deferred,
        };
        let reflectance = &reflectance[node.span.clone()];
        let largest = reflectance.iter().copied().fold(0.0, f64::max);
        let bounce = largest.min(MOST_REFLECTED);
        let scene = (request.snowpack, request.model);
        let walker = Walker::with_tracers(scene, &tracers, node.indices, absorption);
        let walker = walker.over(Bounce {
            reflected: bounce,
            transmitted: 1.0 - bounce,
        });
        let mut crossings = CrossingSums {
            planes: &planes,
            absorption,
            coefficients,
            substrate: (reflectance, bounce),
            sums: vec![vec![[0.0; CROSSING_SCORES]; planes.len()]; coefficients.len()],
            lost: 0,
            cancel: control.cancel,
        };
        let stream = Stream::new(Key {
            seed: request.seed,
            cell: request.cell,
            purpose: [purpose, node.number as u32, 0],
            batch: part,
        });
        let (thicknesses_m, light) = (request.thicknesses_m, request.illuminations[0]);
        walker
            .walk(thicknesses_m, light, rays, stream, &mut crossings)
            .map_err(|error| engine_error(request, error))?;
        control.rays_done.fetch_add(rays, Ordering::Relaxed);
        let CrossingSums { mut sums, lost, .. } = crossings;
        let scores = sums.iter_mut().flatten().flatten();
        scores.for_each(|sum| *sum /= rays as f64);
        Ok((sums, lost))
    };
    let items = all_nodes
        .iter()
        .flat_map(|node| (0..PARTS).map(move |part| (node, part)));
    let walked = batches::map(control, items.collect(), walk)?;
    let lost = walked.iter().map(|(_, lost)| *lost).max().unwrap_or(0);
    let parts_at = |(l, mix): (usize, &Mix)| {
        let part = |part: u64| {
            let [a, b] = mix.nodes.map(|node| {
                let (sums, _) = &walked[node * PARTS as usize + part as usize];
                &sums[l - all_nodes[node].span.start]
            });
            mixed(a, b, mix.share)
        };
        estimates(&(0..PARTS).map(part).collect::<Vec<_>>())
    };
    let wavelengths = mixes.iter().enumerate().map(parts_at).collect();
    Ok(Profile {
        lost: lost as f64 / rays as f64,
        least_se: 1.0 / (rays * PARTS) as f64,
        ..Profile::of(depths_m, wavelengths)
    })
}

/// Number of walks of [`run`].
pub(super) fn walks(engine: Engine, request: &Request) -> Result<u64, EngineError> {
    let indices = indices(request)?;
    let nodes = match engine {
        Engine::Reference => indices.len(),
        _ => nodes(&indices, request.snowpack.is_wet(), Spacing::FINE).len(),
    };
    let rays = request.rays.div_ceil(PARTS).saturating_mul(PARTS);
    Ok(rays.saturating_mul(nodes as u64))
}

/// One node per wavelength.
fn separate(indices: &[(Index, Index)]) -> (Vec<ProfileNode>, Vec<Mix>) {
    let node = |(l, indices): (usize, &(Index, Index))| ProfileNode {
        number: l,
        indices: *indices,
        span: l..l + 1,
    };
    let mix = |l| Mix {
        nodes: [l; 2],
        share: 0.0,
    };
    (
        indices.iter().enumerate().map(node).collect(),
        (0..indices.len()).map(mix).collect(),
    )
}

/// The nodes that the wavelengths share. The span of a node reaches from the node before it to the
/// node after it.
fn shared(indices: &[(Index, Index)], wet: bool) -> (Vec<ProfileNode>, Vec<Mix>) {
    let positions = nodes(indices, wet, Spacing::FINE);
    let (nodes, mixes) = mixes(indices, wet, Spacing::FINE);
    let node = |(number, indices): (usize, (Index, Index))| {
        let last = positions[(number + 1).min(positions.len() - 1)];
        ProfileNode {
            number,
            indices,
            span: positions[number.saturating_sub(1)]..last + 1,
        }
    };
    (nodes.into_iter().enumerate().map(node).collect(), mixes)
}

/// `1 - share` of `a` and `share` of `b`.
fn mixed(a: &[PlaneFluxes], b: &[PlaneFluxes], share: f64) -> Vec<PlaneFluxes> {
    let pairs = a.iter().zip(b);
    let mix = |(a, b): (&PlaneFluxes, &PlaneFluxes)| {
        std::array::from_fn(|i| (1.0 - share) * a[i] + share * b[i])
    };
    pairs.map(mix).collect()
}

/// The means of all `parts`, and then of all but one.
fn estimates(parts: &[Vec<PlaneFluxes>]) -> Vec<Vec<PlaneFluxes>> {
    let n = parts.len() as f64;
    let combined = |left_out: Option<&Vec<PlaneFluxes>>| -> Vec<PlaneFluxes> {
        let at = |depth: usize| {
            std::array::from_fn(|i| {
                let sum: f64 = parts.iter().map(|part| part[depth][i]).sum();
                left_out.map_or(sum / n, |part| (sum - part[depth][i]) / (n - 1.0))
            })
        };
        (0..parts.first().map_or(0, Vec::len)).map(at).collect()
    };
    let others = parts.iter().map(|part| combined(Some(part)));
    std::iter::once(combined(None)).chain(others).collect()
}
