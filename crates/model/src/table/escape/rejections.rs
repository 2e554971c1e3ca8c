//! Probability that a flight is drawn again because the grain at its end crosses a plane, as a
//! table over depth (m) and cosine.
//!
//! Toward the plane that a ray of cosine mu flies to, this probability p changes with depth by
//! (p - c) / (l |mu|), where l is the mean free distance (m) and c the share of grains that cross a
//! plane where they are met. At that plane p is 0; the equation is solved backward from there. The
//! mean number of flights is 1 / (1 - p), a geometric series. Valid for any layers and grain types
//! whose sizes are uniform; shapes are those of grains in air. Interpolation leaves errors of some
//! .01, largest for grazing rays.
use std::f64::consts::TAU;

use splitsnow_spectra::simd::{F64x8, Simd, SimdKernel, dispatch};

use super::layer::{EscapeKind, EscapeLayer};
use super::walk::{RayFrame, exp};
use crate::grain::Down;
use crate::math::{exp_neg, set_lanes};
use crate::table::PackedTable;
use crate::transport::REJECTION_LIMIT;

/// Intervals of depth in the zone next to a plane. They grow with the distance from the plane.
const DEPTHS: usize = 24;
/// Intervals of the cosine, growing from grazing to vertical.
const COSINES: usize = 12;
/// Grains of each type that are placed at every depth.
const GRAINS: usize = 2048;
/// The golden ratio less one: its multiples are spread evenly over the circle.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Values at `[depth][upward, downward][cosine]` in the zone next to a plane.
type Zone = [[[f64; COSINES + 1]; 2]; DEPTHS + 1];

/// The table. Grains cross the planes only in the two zones next to them, which are as deep as the
/// longest grain or half of the snowpack.
#[derive(Debug)]
pub(super) struct Rejections {
    /// Depth of both zones, m.
    zone_m: f64,
    thickness_m: f64,
    /// Optical depths of both zones along the vertical.
    zone_tau: [f64; 2],
    /// Next to the surface, and next to the base.
    zones: Box<[Zone; 2]>,
}

/// A piece of the vertical in one layer.
struct Piece {
    layer: usize,
    /// Depth of its middle, m.
    middle_m: f64,
    /// Optical depth.
    tau: f64,
}

/// The cosine at a position of the table.
fn cosine(position: usize) -> f64 {
    (position as f64 / COSINES as f64).powi(2)
}

/// The pieces of the vertical between two depths, one for each layer there.
fn pieces(layers: &[EscapeLayer], [from_m, to_m]: [f64; 2]) -> Vec<Piece> {
    let piece = |(layer, snow): (usize, &EscapeLayer)| {
        let (top_m, base_m) = (snow.top_m.max(from_m), snow.base_m.min(to_m));
        (top_m < base_m).then(|| Piece {
            layer,
            middle_m: 0.5 * (top_m + base_m),
            tau: (base_m - top_m) / snow.mean_free_distance_m,
        })
    };
    layers.iter().enumerate().filter_map(piece).collect()
}

/// Grains of one type, eight side by side: the inverse of how far they reach upward and downward
/// from the point that the ray meets, in units of their size.
type Reach<S> = Vec<[F64x8<S>; 2]>;

/// The reach of grains of a table, one for each of `azimuths` (a multiple of 8), for rays with the
/// downward cosine `mu`.
#[inline(always)]
fn reach<S: Simd>(table: &PackedTable, azimuths: &[[f64; 2]], mu: f64) -> Reach<S> {
    let across = (1.0 - mu * mu).sqrt();
    let grains = azimuths.len();
    let mut all = Vec::with_capacity(grains / 8);
    for (group, azimuths) in azimuths.chunks_exact(8).enumerate() {
        let mut reach = [[0.0; 8]; 2];
        for (lane, [cos, sin]) in azimuths.iter().enumerate() {
            let down = RayFrame {
                along: mu,
                across,
                cos: *cos,
                sin: *sin,
            };
            let row = (8 * group + lane) * table.len() / grains;
            let (centre, body) = table.grain(row);
            let (centre, half) = (down.down(centre), 0.5 * body.half_height(&down));
            (reach[0][lane], reach[1][lane]) = (half - centre, half + centre);
        }
        let least = F64x8::splat(1e-12);
        all.push(reach.map(|reach| F64x8::ONE / F64x8::new(reach).max(least)));
    }
    all
}

/// Probability that a grain of this type with one of these reaches crosses a plane `up_m` above or
/// `down_m` below the point that the ray meets.
#[inline(always)]
fn crossing<S: Simd>(kind: &EscapeKind, reach: &Reach<S>, up_m: f64, down_m: f64) -> f64 {
    let [min_m, max_m] = kind.size_m;
    // grains of a single size have a range of no width
    let per_width = 1.0 / (max_m - min_m).max(1e-9 * max_m);
    let [up_m, down_m, max_m, per_width] = [up_m, down_m, max_m, per_width].map(F64x8::splat);
    let mut sum = F64x8::ZERO;
    for [per_up, per_down] in reach {
        let fitting_m = (up_m * *per_up).min(down_m * *per_down);
        let crosses = (max_m - fitting_m) * per_width;
        sum += crosses.max(F64x8::ZERO).min(F64x8::ONE);
    }
    sum.to_array().iter().sum::<f64>() / (8 * reach.len()) as f64
}

/// Fills a table, as a SIMD kernel.
struct Filling<'a> {
    table: &'a mut Rejections,
    layers: &'a [EscapeLayer<'a>],
    /// The pieces of the vertical between depths of the table, from the surface down.
    pieces: &'a [Vec<Piece>],
    /// Cosine and sine of the azimuth of every grain.
    azimuths: &'a [[f64; 2]],
}

impl SimdKernel for Filling<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        for position in 0..=COSINES {
            self.march::<S>(position, false);
            self.march::<S>(position, true);
        }
    }
}

impl Filling<'_> {
    /// Fills the column of one direction: follows rays backward, from the plane to which they fly.
    #[inline(always)]
    fn march<S: Simd>(&mut self, position: usize, down: bool) {
        let mu = if down {
            cosine(position)
        } else {
            -cosine(position)
        };
        let (zone_m, thickness_m) = (self.table.zone_m, self.table.thickness_m);
        let mut reaches: Vec<Vec<Reach<S>>> = Vec::new();
        for layer in self.layers {
            let mut of_kinds = Vec::new();
            if layer.top_m < zone_m || layer.base_m > thickness_m - zone_m {
                for kind in &layer.kinds {
                    of_kinds.push(reach(kind.tables[0], self.azimuths, mu));
                }
            }
            reaches.push(of_kinds);
        }
        let mut chance = 0.0;
        for step in 0..=self.pieces.len() {
            // the depth that is reached, and the interval that was passed on the way to it
            let (depth, interval) = if down {
                (self.pieces.len() - step, self.pieces.len() - step)
            } else {
                (step, step.wrapping_sub(1))
            };
            if step > 0 {
                let passed = &self.pieces[interval];
                for i in 0..passed.len() {
                    let piece = &passed[if down { passed.len() - 1 - i } else { i }];
                    let local = match interval {
                        DEPTHS => 0.0,
                        _ => self.local(piece, &reaches[piece.layer]),
                    };
                    chance = local + (chance - local) * exp_neg(piece.tau / mu.abs());
                }
            }
            let [zone, i] = if depth <= DEPTHS {
                [0, depth]
            } else {
                [1, 2 * DEPTHS + 1 - depth]
            };
            // no flight is drawn again more often than walks allow
            let most = 1.0 - 1.0 / f64::from(REJECTION_LIMIT);
            self.table.zones[zone][i][usize::from(down)][position] = chance.min(most);
        }
    }

    /// Probability that the grain at the end of a flight in this piece crosses a plane.
    #[inline(always)]
    fn local<S: Simd>(&self, piece: &Piece, reaches: &[Reach<S>]) -> f64 {
        let (up_m, down_m) = (piece.middle_m, self.table.thickness_m - piece.middle_m);
        let (mut sum, mut before) = (0.0, 0.0);
        for (kind, reach) in self.layers[piece.layer].kinds.iter().zip(reaches) {
            sum += (kind.cumulative - before) * crossing(kind, reach, up_m, down_m);
            before = kind.cumulative;
        }
        sum
    }
}

impl Rejections {
    /// The table of a snowpack of these layers, from the surface down.
    pub(super) fn new(layers: &[EscapeLayer], thickness_m: f64) -> Self {
        Self::of_grains(layers, thickness_m, GRAINS)
    }

    /// The table for this number of grains of each type, a multiple of 8.
    fn of_grains(layers: &[EscapeLayer], thickness_m: f64, grains: usize) -> Self {
        let longest_m = layers.iter().map(|layer| layer.longest_grain_m);
        let zone_m = longest_m.fold(0.0, f64::max).min(0.5 * thickness_m);
        let mut depths_m: Vec<f64> = (0..=DEPTHS)
            .map(|i| zone_m * (i as f64 / DEPTHS as f64).powi(2))
            .collect();
        if thickness_m.is_finite() {
            let of_base = depths_m.iter().rev().map(|depth_m| thickness_m - depth_m);
            depths_m = depths_m.iter().copied().chain(of_base).collect();
        }
        let pieces: Vec<_> = depths_m
            .windows(2)
            .map(|ends_m| pieces(layers, [ends_m[0], ends_m[1]]))
            .collect();
        let tau = |pieces: &[Vec<Piece>]| pieces.iter().flatten().map(|piece| piece.tau).sum();
        let mut table = Self {
            zone_m,
            thickness_m,
            zone_tau: [
                tau(&pieces[..DEPTHS]),
                tau(&pieces[pieces.len() - DEPTHS..]),
            ],
            zones: Box::new([[[[0.0; COSINES + 1]; 2]; DEPTHS + 1]; 2]),
        };
        let azimuth = |grain: usize| {
            let azimuth = TAU * (grain as f64 * GOLDEN).fract();
            [libm::cos(azimuth), libm::sin(azimuth)]
        };
        let azimuths: Vec<_> = (0..grains).map(azimuth).collect();
        dispatch(Filling {
            table: &mut table,
            layers,
            pieces: &pieces,
            azimuths: &azimuths,
        });
        table
    }

    /// The probability at depths `z_m` for rays with the downward cosines `mu`, where `tau` is the
    /// optical depth along the vertical to the plane that they fly to; 0 on all but the given lanes.
    #[inline(always)]
    pub(super) fn chance<S: Simd>(
        &self,
        z_m: F64x8<S>,
        mu: F64x8<S>,
        tau: F64x8<S>,
        lanes: u32,
    ) -> F64x8<S> {
        let (zero, one) = (F64x8::ZERO, F64x8::ONE);
        let zone_m = F64x8::splat(self.zone_m);
        let below_m = F64x8::splat(self.thickness_m) - z_m;
        let (up, down) = (z_m.le(zone_m), mu.gt(zero));
        let is_between = z_m.gt(zone_m) & below_m.gt(zone_m);
        // beyond the zones, the flight must reach the zone that it flies to
        let [above, under] = self.zone_tau.map(F64x8::splat);
        let beyond = (tau - down.select(under, above)).max(zero);
        let secant = one / mu.abs().max(F64x8::splat(1e-12));
        let reached = is_between.select(exp(beyond * secant), one);
        let in_upper = is_between.select(down.select(zero, one), up.select(one, zero));
        let distance_m = up.select(z_m, below_m).max(zero).min(zone_m);
        let place = (distance_m / zone_m).sqrt() * F64x8::splat(DEPTHS as f64);
        let column = mu.abs().min(one).sqrt() * F64x8::splat(COSINES as f64);
        let mut chance = F64x8::ZERO;
        for lane in set_lanes(lanes) {
            let [place, column] = [place, column].map(|v| v.as_array()[lane]);
            let i = (place as usize).min(DEPTHS - 1);
            let j = (column as usize).min(COSINES - 1);
            let (s, t) = (place - i as f64, column - j as f64);
            let zone = &self.zones[usize::from(in_upper.as_array()[lane] == 0.0)];
            let side = usize::from(mu.as_array()[lane] > 0.0);
            let along = |row: &[f64; COSINES + 1]| row[j] + t * (row[j + 1] - row[j]);
            let (near, far) = (along(&zone[i][side]), along(&zone[i + 1][side]));
            chance.as_mut_array()[lane] = reached.as_array()[lane] * (near + s * (far - near));
        }
        chance
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::grain::{Facets, GrainType, Shape, SizeRange, Surface, TruncatedNormal};
    use crate::optics::Index;
    use crate::rng::{Key, Stream};
    use crate::table::{EscapeTable, draw, draw_reflected};
    use crate::transport::{Component, Entry, Layer, Model, Snow, Tracers};
    use splitsnow_spectra::simd::Portable;

    fn stream(purpose: u32) -> Stream {
        Stream::new(Key {
            seed: 1,
            cell: 0,
            purpose: [purpose, 0, 0],
            batch: 0,
        })
    }

    fn grain([min_m, max_m]: [f64; 2], shape: Shape) -> GrainType {
        GrainType {
            size: SizeRange::new(min_m, max_m).unwrap(),
            facetness: TruncatedNormal::new(0.0, 0.0, 0.0, 0.1).unwrap(),
            shape,
            proportion: TruncatedNormal::new(0.5, 0.9, 0.7, 0.1).unwrap(),
        }
    }

    fn table(grain: &GrainType) -> [EscapeTable; 2] {
        let [ice, water] = [1.31, 1.0].map(|n| Index { n, k: 0.0 });
        let [surface, _] = Surface::in_air_and_water(ice, water, false);
        let event = (Entry::Uniform, Facets::Varsa2025);
        let drawn = draw(grain, event, surface, 8192, stream(0));
        let reflected = draw_reflected(grain, event, surface, 64, stream(1));
        let table = EscapeTable::new(&drawn, &reflected, 8192, &mut stream(2));
        [table.clone(), table]
    }

    /// The share of `flights` from a start that end at a grain that crosses a plane.
    fn counted(
        layers: &[EscapeLayer],
        thickness_m: f64,
        [start_m, mu]: [f64; 2],
        flights: u32,
    ) -> f64 {
        let mut rng = stream(3);
        let mut uniform = || rng.uniform().as_array()[0];
        let mut crossing = 0;
        for _ in 0..flights {
            let mut tau = -uniform().ln();
            let mut z_m = start_m;
            let layer = loop {
                let at = |layer: &&EscapeLayer| match mu > 0.0 {
                    true => layer.top_m <= z_m && z_m < layer.base_m,
                    false => layer.top_m < z_m && z_m <= layer.base_m,
                };
                let Some(layer) = layers.iter().find(at) else {
                    break None;
                };
                let plane_m = if mu > 0.0 { layer.base_m } else { layer.top_m };
                let reached = (plane_m - z_m) / mu / layer.mean_free_distance_m;
                if tau < reached {
                    z_m += tau * layer.mean_free_distance_m * mu;
                    break Some(layer);
                }
                tau -= reached;
                z_m = plane_m;
            };
            let Some(layer) = layer else { continue };
            let u = uniform();
            let kind = layer.kinds.iter().find(|kind| u < kind.cumulative).unwrap();
            let azimuth = TAU * uniform();
            let down = RayFrame {
                along: mu,
                across: (1.0 - mu * mu).sqrt(),
                cos: azimuth.cos(),
                sin: azimuth.sin(),
            };
            let grains = kind.tables[0];
            let (centre, body) = grains.grain((uniform() * grains.len() as f64) as usize);
            let [min_m, max_m] = kind.size_m;
            let size_m = min_m + (max_m - min_m) * uniform();
            let (centre, half) = (down.down(centre), 0.5 * body.half_height(&down));
            let ends_m = [centre - half, centre + half].map(|end| z_m + size_m * end);
            if ends_m[0] < 0.0 || ends_m[1] > thickness_m {
                crossing += 1;
            }
        }
        f64::from(crossing) / f64::from(flights)
    }

    #[test]
    fn chances_are_those_of_counted_flights() {
        const FLIGHTS: u32 = 40_000;
        // what the intervals of the table and 8192 grains at one azimuth each leave
        const BIAS: f64 = 0.01;
        let coarse = grain([2e-4, 6e-4], Shape::Spheroid);
        let fine = grain([1e-4, 1e-4], Shape::Hexagonal);
        let of = |grains: &[GrainType], density_kg_m3: f64| Snow {
            grains: grains
                .iter()
                .map(|grain| Component {
                    fraction: 1.0 / grains.len() as f64,
                    grain: *grain,
                })
                .collect(),
            ..Snow::dry(grains[0], density_kg_m3, -1.0)
        };
        let packs: [(&str, Vec<(Snow, f64)>); 4] = [
            ("half space", vec![(of(&[coarse], 300.0), f64::INFINITY)]),
            ("slab", vec![(of(&[coarse, fine], 200.0), 3e-3)]),
            (
                "thinner than two grains",
                vec![(of(&[coarse], 400.0), 8e-4)],
            ),
            (
                "fine on coarse",
                vec![(of(&[fine], 150.0), 2.5e-4), (of(&[coarse], 350.0), 2e-3)],
            ),
        ];
        for (name, pack) in packs {
            let tables: Vec<Vec<_>> = pack
                .iter()
                .map(|(snow, _)| snow.grains.iter().map(|c| table(&c.grain)).collect())
                .collect();
            let (tracers, model) = (Tracers::Laws(Vec::new()), Model::default());
            let mut thickness_m = 0.0;
            let layers: Vec<_> = pack
                .iter()
                .zip(&tables)
                .map(|((snow, thick_m), tables)| {
                    let layer = Layer {
                        snow: snow.clone(),
                        thickness_m: *thick_m,
                    };
                    let layer =
                        EscapeLayer::new(&layer, thickness_m, tables, &[], (&tracers, &model));
                    thickness_m = layer.base_m;
                    layer
                })
                .collect();
            let rejections = Rejections::of_grains(&layers, thickness_m, 8192);
            let deepest_m = thickness_m.min(2e-3);
            let mut largest = 0.0_f64;
            for part in [0.01, 0.1, 0.3, 0.5, 0.8, 0.99] {
                for mu in [-1.0, -0.6, -0.25, -0.08, 0.08, 0.25, 0.6, 1.0] {
                    let z_m = part * deepest_m;
                    let tau: f64 = layers
                        .iter()
                        .map(|layer| {
                            let down = F64x8::<Portable>::mask(mu > 0.0);
                            let [z, down] = [z_m, down].map(F64x8::<Portable>::splat);
                            layer.part_m(z, down).as_array()[0] / layer.mean_free_distance_m
                        })
                        .sum();
                    let [z, mu_lanes, tau] = [z_m, mu, tau].map(F64x8::<Portable>::splat);
                    let [found, ..] = rejections.chance(z, mu_lanes, tau, 1).to_array();
                    let expected = counted(&layers, thickness_m, [z_m, mu], FLIGHTS);
                    let se = (found.max(1e-4) * (1.0 - found) / f64::from(FLIGHTS)).sqrt();
                    assert!(
                        (found - expected).abs() < 5.0 * se + BIAS,
                        "{name}, {z_m} m, {mu}: {found}, counted {expected}"
                    );
                    largest = largest.max(expected);
                }
            }
            assert!(largest > 0.1, "{name}: {largest}");
        }
    }
}
