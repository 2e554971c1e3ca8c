//! Scores on sensors the light that leaves the snowpack from every grain event.
use std::sync::atomic::{AtomicBool, Ordering};

use splitsnow_spectra::simd::{F64x8, Simd};

use super::counting::DirectionBins;
use super::parts::{self, PartScores};
use super::{ExitScene, Exits, IndexNode, at_nodes};
use crate::engine::envelope::{MIN_FITTING_ENTRIES, most_deg};
use crate::engine::spectral::DEFERRED;
use crate::engine::{Engine, EngineError, Request, coefficients, engine_error, indices};
use crate::grain::{GrainType, Surface};
use crate::math::Vec3x8;
use crate::measurement::Sensors;
use crate::table::{EscapeBand, EscapeSink, EscapeTable, EscapeWalker, draw, draw_reflected};
use crate::transport::{Absorption, Coefficients, Illumination};

/// Entries in the table of a part, for each grain type and medium.
const TABLE: usize = 1 << 13;
/// Most outcomes drawn for every entry of the table.
const OVERSAMPLING: usize = 4;
/// Outcomes drawn for every walk of the part, between the size of the table and [`OVERSAMPLING`]
/// times that: with few walks, more do not reduce the error.
const DRAWN_PER_WALK: u64 = 16;
/// Most reflections on the outside of grains from which the entries of that kind are drawn.
const REFLECTED: usize = 1 << 16;
/// Share of [`MIN_FITTING_ENTRIES`] that is enough for the table of one part: the errors of
/// tables differ from part to part and thus show in the scatter.
const PART_OF_FITTING: f64 = 0.125;

/// Checks that tables are valid for the snow and under the illuminations of `request`.
///
/// # Errors
/// [`EngineError::Unable`] if particles in the pores scatter; [`EngineError::Outside`] if too few
/// table entries fit under the surface at grazing incidence.
pub(super) fn check(request: &Request) -> Result<(), EngineError> {
    if request
        .snowpack
        .snows()
        .any(|snow| snow.particles().is_some())
    {
        return Err(EngineError::Unable {
            engine: Engine::Tabulated,
            quantity: "directions of light in snow with particles that scatter",
            instead: Engine::Spectral,
        });
    }
    let flight =
        request.snowpack.surface.mean_free_distance_m() / request.snowpack.surface.sizes_m()[1];
    for light in request.illuminations {
        let Illumination::Collimated { polar_angle_rad } = light else {
            continue;
        };
        let value = 2.0 * libm::cos(*polar_angle_rad) * flight * TABLE as f64;
        let lowest = PART_OF_FITTING * MIN_FITTING_ENTRIES;
        if value < lowest {
            return Err(EngineError::Outside {
                engine: Engine::Tabulated,
                quantity: "number of table entries whose grains fit under the surface at grazing incidence",
                value,
                lowest,
                instead: Some(Engine::Spectral),
                most_deg: most_deg(*polar_angle_rad, value, lowest),
            });
        }
    }
    Ok(())
}

/// Scores of one part on sensors.
struct SensorScores<'a> {
    sensors: &'a Sensors,
    part: PartScores,
    cancel: &'a AtomicBool,
}

impl EscapeSink for SensorScores<'_> {
    #[inline(always)]
    fn bins<S: Simd>(&self, direction: &Vec3x8<S>, lanes: u32) -> [usize; 8] {
        let mut bins = self.sensors.folded_lanes(direction, lanes);
        for (bin, z) in bins.iter_mut().zip(direction.z.as_array()) {
            *bin += usize::from(*z > 0.0) * self.sensors.len();
        }
        bins
    }

    #[inline(always)]
    fn catch<S: Simd>(&mut self, bin: usize, chance: f64, weights: &[F64x8<S>]) {
        let bands = 8 * weights.len();
        let row = bin * bands;
        let (groups, _) = self.part.sums[row..row + bands].as_chunks_mut();
        for (sums, weight) in groups.iter_mut().zip(weights) {
            *sums = (F64x8::new(*sums) + F64x8::splat(chance) * *weight).to_array();
        }
    }

    fn lost(&mut self) {
        self.part.lost += 1;
    }

    fn stop(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

/// Scores `scene` on the sensors of `bins`.
pub(super) fn run(scene: &ExitScene, bins: &impl DirectionBins) -> Result<Vec<Exits>, EngineError> {
    at_nodes(scene, |node| walk(scene, bins, node))
}

fn walk(
    scene: &ExitScene,
    bins: &impl DirectionBins,
    node: IndexNode,
) -> Result<Vec<Exits>, EngineError> {
    let request = scene.request;
    let coefficients = &coefficients(request, &indices(request)?)[node.span.clone()];
    let pairs = coefficients.iter().zip(&scene.substrate[node.span.clone()]);
    let bands: Vec<EscapeBand> = pairs
        .map(|(coefficients, substrate)| EscapeBand {
            coefficients: *coefficients,
            reflected: substrate.reflectance.value,
            transmitted: substrate.transmittance.value,
        })
        .collect();
    let absorption = Absorption {
        coefficients: Coefficients::least(coefficients),
        deferred: DEFERRED,
    };
    let (h, thickness_m) = scene.thickness;
    let (tracers, layers) = (request.tracers(), scene.snowpack.layers(thickness_m));
    // scores come in groups of eight bands
    let padded = bands.len().next_multiple_of(8);
    let mut exits = parts::run(scene, bins, padded, |part, rays| {
        let tables = tables(scene, &node, part, rays);
        let walker = EscapeWalker::new(
            &layers,
            &tables,
            (&tracers, request.model),
            &bands,
            absorption,
        );
        let mut scores = SensorScores {
            sensors: bins.sensors(),
            part: PartScores::empty(bins, padded),
            cancel: scene.control.cancel,
        };
        let rng = parts::stream(scene, [10, h as u32, node.number as u32], part);
        walker
            .walk(scene.illumination(), rays, rng, &mut scores)
            .map_err(|error| engine_error(request, error))?;
        Ok(scores.part)
    })?;
    exits.truncate(bands.len());
    Ok(exits)
}

/// Tables of part number `part`, which has `rays` walks, for every grain type in every layer, in
/// air and in water: `[layer][type][medium]`.
fn tables(scene: &ExitScene, node: &IndexNode, part: u64, rays: u64) -> Vec<Vec<[EscapeTable; 2]>> {
    let most = OVERSAMPLING * TABLE;
    let drawn = (rays.saturating_mul(DRAWN_PER_WALK)).clamp(TABLE as u64, most as u64) as usize;
    let reflected = drawn * (REFLECTED / most);
    let request = scene.request;
    let (ice, water) = node.indices;
    let wet = request.snowpack.is_wet();
    let surfaces = Surface::in_air_and_water(ice, water, wet);
    let event = (request.model.entry, request.model.facets);
    let media = |grain: &GrainType, layer: usize, kind: usize| {
        let stream = |purpose| {
            let purpose = [purpose, node.number as u32, (layer << 8 | kind) as u32];
            parts::stream(scene, purpose, part)
        };
        let table = |surface| {
            let mut rng = stream(11);
            let drawn = draw(grain, event, surface, drawn, rng.clone());
            let reflected = draw_reflected(grain, event, surface, reflected, stream(13));
            EscapeTable::new(&drawn, &reflected, TABLE, &mut rng)
        };
        let air = table(surfaces[0]);
        let water = if wet { table(surfaces[1]) } else { air.clone() };
        [air, water]
    };
    let snows = scene.snowpack.snows().enumerate();
    snows
        .map(|(layer, snow)| {
            let grains = snow.grains.iter().enumerate();
            grains
                .map(|(kind, component)| media(&component.grain, layer, kind))
                .collect()
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::atomic::AtomicU64;

    use super::*;
    use crate::engine::exits::each;
    use crate::engine::{Cache, Control, MaxError, Resolution};
    use crate::grain::{Shape, SizeRange, TruncatedNormal};
    use crate::measurement::Views;
    use crate::transport::{Model, Snow};

    /// Relative standard errors, the root mean square over views, of the shares of views in the
    /// light that leaves smooth grains, at each wavelength.
    fn errors_of_shares(wavelengths_nm: &[f64], rays: u64) -> Vec<f64> {
        let grain = GrainType {
            size: SizeRange::new(4e-4, 6e-4).unwrap(),
            facetness: TruncatedNormal::new(0.0, 0.2, 0.1, 0.072).unwrap(),
            shape: Shape::Spheroid,
            proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        };
        let snowpack = Snow::dry(grain, 300.0, -1.0).into();
        let request = Request {
            snowpack: &snowpack,
            thicknesses_m: &[f64::INFINITY],
            illuminations: &[Illumination::Collimated {
                polar_angle_rad: 60_f64.to_radians(),
            }],
            wavelengths_nm,
            model: &Model::default(),
            rays,
            max_error: MaxError::default(),
            resolution: Resolution::default(),
            seed: 1,
            cell: 0,
        };
        let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
        let cache = Cache::default();
        let control = Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &cache,
        };
        let angles = [0.0, 30.0, 60.0, 75.0].map(|view| [[view, 0.0], [view, 90.0]]);
        let views = Views::new(angles.as_flattened()).unwrap();
        let exits = each(Engine::Tabulated, true, &request, &control, &|scene| {
            run(scene, &views)
        });
        let of_views = |exits: &Exits| {
            let views = exits.reflected.iter();
            let squares = views.map(|view| (view.se / view.value).powi(2));
            (squares.sum::<f64>() / exits.reflected.len() as f64).sqrt()
        };
        exits.unwrap().iter().map(of_views).collect()
    }

    /// Where ice absorbs nearly all light, hardly any but that reflected on the outside of grains
    /// leaves. With outcomes drawn in proportion, the error there is .34.
    #[test]
    fn views_are_precise_where_ice_absorbs() {
        let errors = errors_of_shares(&[1000.0, 2000.0], 4096);
        assert!(errors[0] < 0.04 && errors[1] < 0.15, "{errors:?}");
    }
}
