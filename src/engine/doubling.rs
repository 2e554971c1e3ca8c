//! `doubling`: no walk in the bulk of the snow.
use std::sync::Arc;

use crate::engine::spectral::{Mix, mixes};
use crate::engine::tables::{self, Outcomes, PARTS};
use crate::engine::{Control, EngineError, Request, batches, engine_error, indices};
use crate::math::legendre;
use crate::measurement::{Measured, Spectrum};
use crate::rng::{Key, Stream};
use crate::slab::{Matrix, Medium, Streams};
use crate::table::{Event, Layer, Lower, Scores, Source, TableSnow};
use crate::transport::Illumination;

/// Thickness of a boundary layer in mean free distances and in largest grains.
const LAYER: (f64, f64) = (2.0, 1.8);
/// Wavelengths at which the standard error is found from independent parts.
const ANCHORS: usize = 5;

/// Walks at one pair of indices: per part.
struct Node {
    outcomes: [Arc<Outcomes>; 2],
    /// Walks in the boundary layer: per part, from each stream below, then
    /// from each light above.
    layer: Vec<Vec<Scores>>,
    /// Walks through slabs too thin for two boundary layers: per part, for
    /// each thickness and light.
    thin: Vec<Vec<Scores>>,
}

/// What a boundary layer does to light, and the snow between two of them.
struct Couplings {
    /// From streams below, up, to streams down.
    inner: Matrix,
    /// From streams below out through the surface.
    escape: Vec<f64>,
    /// From each light to streams down: [stream][light].
    entry: Matrix,
    /// Share of each light that leaves again.
    reflected: Vec<f64>,
    event: Event,
}

struct Run<'a> {
    request: &'a Request<'a>,
    streams: Streams,
    mean_free_distance_m: f64,
    layer_m: f64,
    /// Number of thicknesses, thinnest first, without an inside.
    thin: usize,
}

pub(super) fn run(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let indices = indices(request)?;
    let (nodes, mixes) = mixes(&indices, request.snow);
    let layer_m = layer_m(request);
    let heights = request.thicknesses_m;
    let run = Run {
        request,
        streams: Streams::new(request.resolution.streams)?,
        mean_free_distance_m: request.snow.mean_free_distance_m(),
        layer_m,
        thin: heights.partition_point(|h| *h <= 2.0 * layer_m),
    };
    let nodes: Vec<Node> = nodes
        .iter()
        .enumerate()
        .map(|(number, &node)| {
            let outcomes = tables::outcomes(request, control, node)?;
            run.walk(control, number, outcomes)
        })
        .collect::<Result<_, _>>()?;
    run.solve(&nodes, &indices, &mixes)
}

/// How many walks a request takes.
pub(super) fn walks(request: &Request) -> Result<u64, EngineError> {
    let (nodes, _) = mixes(&indices(request)?, request.snow);
    let layer_m = layer_m(request);
    let thin = request
        .thicknesses_m
        .partition_point(|h| *h <= 2.0 * layer_m);
    let lights = request.illuminations.len();
    let mut sources = thin * lights;
    if thin < request.thicknesses_m.len() {
        sources += request.resolution.streams + lights;
    }
    let rays = request.rays.div_ceil(PARTS as u64) * PARTS as u64;
    Ok(rays.saturating_mul((sources * nodes.len()) as u64))
}

/// Thickness of a boundary layer, m.
fn layer_m(request: &Request) -> f64 {
    let (distances, grains) = LAYER;
    let largest_m = request.snow.grain.size.max_m();
    (distances * request.snow.mean_free_distance_m()).max(grains * largest_m)
}

impl Run<'_> {
    fn walk(
        &self,
        control: &Control,
        number: usize,
        outcomes: [Arc<Outcomes>; 2],
    ) -> Result<Node, EngineError> {
        let request = self.request;
        let tables = outcomes.each_ref().map(|outcomes| &outcomes.table);
        let snow = TableSnow::new(request.snow, tables);
        let below = self.streams.cosines().iter().map(|x| Source::Below(*x));
        let above = request.illuminations.iter().map(|light| match light {
            Illumination::Collimated { polar_angle_rad } => {
                Source::Above(libm::cos(*polar_angle_rad))
            }
            Illumination::Diffuse => Source::Diffuse,
        });
        let above: Vec<Source> = above.collect();
        let inside = self.thin < request.thicknesses_m.len();
        let sources: Vec<Source> = if inside {
            below.chain(above.iter().copied()).collect()
        } else {
            Vec::new()
        };
        let moments = self.streams.count();
        // (kind, layer, source, moments)
        let mut tasks = Vec::new();
        for part in 0..PARTS {
            for (i, source) in sources.iter().enumerate() {
                tasks.push((
                    part,
                    [4, i as u32],
                    self.layer_m,
                    Lower::Open,
                    *source,
                    moments,
                ));
            }
            for (h, thickness_m) in request.thicknesses_m[..self.thin].iter().enumerate() {
                for (i, source) in above.iter().enumerate() {
                    let number = (h * above.len() + i) as u32;
                    tasks.push((part, [5, number], *thickness_m, Lower::Plane, *source, 1));
                }
            }
        }
        let per_part = tasks.len() / PARTS;
        let rays = request.rays.div_ceil(PARTS as u64);
        let mut scores = batches::map(
            control,
            tasks,
            |(part, [kind, i], thickness_m, lower, source, moments)| {
                if control.cancel.load(std::sync::atomic::Ordering::Relaxed) {
                    return Err(EngineError::Cancelled);
                }
                let key = Key {
                    seed: request.seed,
                    cell: request.cell,
                    // the same for all nodes, so that dispersion is not buried in noise
                    purpose: [kind, i, 0],
                    batch: part as u64,
                };
                let layer = Layer {
                    snow,
                    thickness_m,
                    lower,
                };
                let scores = layer.walk(source, rays, moments, Stream::new(key));
                control
                    .rays_done
                    .fetch_add(rays, std::sync::atomic::Ordering::Relaxed);
                scores.map_err(|error| engine_error(request, error))
            },
        )?;
        let _ = number;
        let mut node = Node {
            outcomes,
            layer: Vec::new(),
            thin: Vec::new(),
        };
        for _ in 0..PARTS {
            let rest = scores.split_off(per_part);
            let thin = scores.split_off(sources.len());
            node.layer.push(std::mem::replace(&mut scores, rest));
            node.thin.push(thin);
        }
        Ok(node)
    }

    fn solve(
        &self,
        nodes: &[Node],
        indices: &[(crate::optics::Index, crate::optics::Index)],
        mixes: &[Mix],
    ) -> Result<Vec<Spectrum>, EngineError> {
        let request = self.request;
        let lights = request.illuminations.len();
        let curves = request.thicknesses_m.len() * lights;
        let wavelengths = indices.len();
        let mut spectra = vec![Spectrum::default(); curves];
        let all: Vec<usize> = (0..PARTS).collect();
        let absorption = |l: usize| {
            let nm = request.wavelengths_nm[l];
            [
                indices[l].0.absorption_per_m(nm),
                indices[l].1.absorption_per_m(nm),
            ]
        };
        for l in 0..wavelengths {
            let values = self.curves(nodes, &mixes[l], absorption(l), &all)?;
            for (spectrum, [r, t]) in spectra.iter_mut().zip(values) {
                spectrum.reflectance.push(Measured { value: r, se: 0.0 });
                spectrum.transmittance.push(Measured { value: t, se: 0.0 });
                spectrum.lost.push(0.0);
            }
        }
        // standard errors relative to the values, at some wavelengths
        let anchors = ANCHORS.min(wavelengths);
        let at: Vec<usize> = (0..anchors)
            .map(|i| {
                if anchors > 1 {
                    i * (wavelengths - 1) / (anchors - 1)
                } else {
                    0
                }
            })
            .collect();
        let mut relative = Vec::new();
        for &l in &at {
            let parts: Vec<Vec<[f64; 2]>> = (0..PARTS)
                .map(|part| self.curves(nodes, &mixes[l], absorption(l), &[part]))
                .collect::<Result<_, _>>()?;
            let of = |curve: usize, quantity: usize| {
                let values = parts.iter().map(|part| part[curve][quantity]);
                let mean = values.clone().sum::<f64>() / PARTS as f64;
                let variance =
                    values.map(|v| (v - mean).powi(2)).sum::<f64>() / (PARTS * (PARTS - 1)) as f64;
                if mean > 0.0 {
                    variance.sqrt() / mean
                } else {
                    0.0
                }
            };
            relative.push(
                (0..curves)
                    .map(|c| [of(c, 0), of(c, 1)])
                    .collect::<Vec<_>>(),
            );
        }
        for (c, spectrum) in spectra.iter_mut().enumerate() {
            for l in 0..wavelengths {
                let i = at.partition_point(|a| *a < l).min(at.len() - 1);
                let j = i.saturating_sub(1);
                let f = if i == j {
                    0.0
                } else {
                    (l - at[j]) as f64 / (at[i] - at[j]) as f64
                };
                let f = f.clamp(0.0, 1.0);
                let se = |q: usize| (1.0 - f) * relative[j][c][q] + f * relative[i][c][q];
                spectrum.reflectance[l].se = se(0) * spectrum.reflectance[l].value;
                spectrum.transmittance[l].se = se(1) * spectrum.transmittance[l].value;
            }
        }
        Ok(spectra)
    }

    /// [R, T] of every thickness and light at one wavelength, from some parts.
    fn curves(
        &self,
        nodes: &[Node],
        mix: &Mix,
        absorption: [f64; 2],
        parts: &[usize],
    ) -> Result<Vec<[f64; 2]>, EngineError> {
        let request = self.request;
        let lights = request.illuminations.len();
        let mut curves = Vec::with_capacity(request.thicknesses_m.len() * lights);
        let [a, b] = mix.nodes;
        let blend = |x: f64, y: f64| (1.0 - mix.share) * x + mix.share * y;
        for i in 0..self.thin * lights {
            let one = |node: &Node| {
                let mut sums = [0.0; 3];
                let mut rays = 0.0;
                let (mut out, mut through) = ([0.0], [0.0, 0.0]);
                for &part in parts {
                    let scores = &node.thin[part][i];
                    scores.out.weighted(absorption[0], absorption[1], &mut out);
                    scores
                        .through
                        .weighted(absorption[0], absorption[1], &mut through);
                    sums[0] += out[0];
                    sums[1] += through[0];
                    rays += scores.rays as f64;
                }
                [sums[0] / rays, sums[1] / rays]
            };
            let (p, q) = (one(&nodes[a]), one(&nodes[b]));
            curves.push([blend(p[0], q[0]), blend(p[1], q[1])]);
        }
        if self.thin == request.thicknesses_m.len() {
            return Ok(curves);
        }
        let c = self.couplings(nodes, mix, absorption, parts);
        let medium = Medium::delta_m(&self.streams, &c.event.moments)?;
        let mean_free_path_m = c
            .event
            .effective_mean_free_path_m(self.flight_m(absorption[1]));
        let n = self.streams.count();
        for thickness_m in &request.thicknesses_m[self.thin..] {
            let bulk = medium.operators((thickness_m - 2.0 * self.layer_m) / mean_free_path_m)?;
            let (fr, ft) = (&bulk.reflection, &bulk.transmission);
            let down = (&Matrix::identity(n) - &(fr * &c.inner)).solve(ft.clone())?;
            let lower = fr + &(&(ft * &c.inner) * &down);
            let entered = (&Matrix::identity(n) - &(&c.inner * &lower)).solve(c.entry.clone())?;
            let arrived = &down * &entered;
            let returned = &lower * &entered;
            for light in 0..lights {
                let escape =
                    |m: &Matrix| -> f64 { (0..n).map(|i| c.escape[i] * m.row(i)[light]).sum() };
                curves.push([c.reflected[light] + escape(&returned), escape(&arrived)]);
            }
        }
        Ok(curves)
    }

    /// Mean length, and root of half the mean square, of flights that light
    /// survives; those through water that absorbs are shorter, m.
    fn flight_m(&self, water_per_m: f64) -> [f64; 2] {
        let (d, wet) = (
            self.mean_free_distance_m,
            self.request.snow.water_saturation,
        );
        let survival = 1.0 / (1.0 + water_per_m * d);
        let moment = |n| 1.0 - wet + wet * survival.powi(n);
        [
            d * moment(2) / moment(1),
            d * (moment(3) / moment(1)).sqrt(),
        ]
    }

    fn couplings(
        &self,
        nodes: &[Node],
        mix: &Mix,
        [ice_per_m, water_per_m]: [f64; 2],
        parts: &[usize],
    ) -> Couplings {
        let n = self.streams.count();
        let request = self.request;
        let lights = request.illuminations.len();
        let mut out = vec![0.0; n + lights];
        let mut moments = vec![vec![0.0; n + 1]; n + lights];
        let mut event: Option<Event> = None;
        let saturation = request.snow.water_saturation;
        let [min, max] = [
            request.snow.grain.size.min_m(),
            request.snow.grain.size.max_m(),
        ];
        let (mut left, mut through) = ([0.0], vec![0.0; n + 1]);
        let survival = 1.0 / (1.0 + water_per_m * self.mean_free_distance_m);
        let arriving = 1.0 - saturation + saturation * survival;
        for (node, share) in mix.nodes.iter().zip([1.0 - mix.share, mix.share]) {
            if share == 0.0 {
                continue;
            }
            let node = &nodes[*node];
            for source in 0..n + lights {
                let rays: u64 = parts.iter().map(|p| node.layer[*p][source].rays).sum();
                let share = share / rays as f64;
                // light from below is what survived its flight up to the layer
                let share = if source < n { share / arriving } else { share };
                for &part in parts {
                    let scores = &node.layer[part][source];
                    scores.out.weighted(ice_per_m, water_per_m, &mut left);
                    scores
                        .through
                        .weighted(ice_per_m, water_per_m, &mut through);
                    out[source] += share * left[0];
                    let sums = moments[source].iter_mut().zip(&through);
                    sums.for_each(|(sum, score)| *sum += share * score);
                }
            }
            let of = |outcomes: &Outcomes| match parts {
                [part] => outcomes.parts[*part].event([min, max], ice_per_m),
                _ => outcomes.kernel.event([min, max], ice_per_m),
            };
            let mut one = of(&node.outcomes[0]);
            if saturation > 0.0 {
                one = one.mix(&of(&node.outcomes[1]).attenuated(survival), saturation);
            }
            event = Some(match event {
                None => one,
                Some(first) => first.mix(&one, share),
            });
        }
        // probabilities of the streams from the moments of their directions
        let (x, w) = (self.streams.cosines(), self.streams.weights());
        let spread = |stream: usize, source: usize| {
            let mut p = vec![0.0; n];
            legendre(2.0 * x[stream] - 1.0, &mut p);
            let terms = p.iter().zip(&moments[source]).enumerate();
            let sum: f64 = terms.map(|(l, (p, m))| (2 * l + 1) as f64 * m * p).sum();
            w[stream] * sum
        };
        Couplings {
            inner: Matrix::from_fn(n, n, |i, j| spread(i, j)),
            escape: out[..n].to_vec(),
            entry: Matrix::from_fn(n, lights, |i, j| spread(i, n + j)),
            reflected: out[n..].to_vec(),
            event: event.unwrap_or(Event {
                moments: Vec::new(),
                displacement_m: [0.0; 2],
                displacement_sq_m2: 0.0,
            }),
        }
    }
}
