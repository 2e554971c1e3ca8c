//! `hybrid`: deterministic transport inside the snowpack, walks only near its
//! surfaces.
//!
//! Far from the planes that bound it, grains act like point scatterers with the
//! same kernel and the mean free path of
//! [`crate::table::Event::effective_mean_free_path_m`]; [`crate::slab`] solves the
//! transport between points exactly. Near a plane this does not hold, because
//! grains must fit under it. A slab is therefore divided into two boundary layers
//! and the inside between them:
//!
//! 1. **Boundary layers**, with the thickness given by [`LAYER`]. Walks with
//!    tabulated grains ([`crate::table::Region`]) start from every illumination
//!    above and every stream below. They give the shares of light that leave
//!    through the surface and, by Legendre moments, the light that goes down into
//!    every stream. Paths in ice and water are kept in a histogram, so that one set
//!    of walks serves all wavelengths. A ray from below is on a flight that began a
//!    free path further down; if its grain does not fit under the surface, the ray
//!    returns to that point.
//! 2. **Inside**: reflection and transmission operators from the plane-parallel
//!    solver, with the kernel of the same grains at the same absorption. The kernel
//!    is the mixture of all grain types in air and in water, each weakened by the
//!    mean survival 1/(1 + alpha d) of a flight through the absorbing pores.
//! 3. **Adding** the three gives every thickness and illumination at once. In
//!    homogeneous snow the lower boundary layer is the mirror image of the upper
//!    one.
//!
//! Layers inside a snowpack are added as point scatterers. Grains carry light
//! across the planes between layers, so the snow near such a plane is walked too. A
//! boundary layer may contain several layers of the snowpack.
//!
//! Slabs of up to three boundary layers are walked from plane to plane.
//!
//! **Dispersion** as in `spectral`: tables, kernels and walks exist at a few
//! index nodes, and each wavelength mixes those of its two nodes.
//!
//! **Errors.** Tables, kernels and walks come in independent parts. At every
//! wavelength the standard errors follow from the scatter of the results with one
//! part left out at a time (the jackknife). They do not include the systematic
//! error of the method: see docs/stability.md.
mod inside;
mod means;
mod plan;
mod planes;
mod profile;
mod solve;
mod walks;
mod windows;

use crate::engine::nodes::{Spacing, mixes};
use crate::engine::tables::PARTS;
use crate::engine::{Control, EngineError, Request, indices};
use crate::math::legendre;
use crate::measurement::Spectrum;
use crate::slab::Streams;
use means::MeanLayout;
use plan::WalkPlan;
use windows::Window;

pub(super) use profile::profile;
pub(super) use walks::{CacheKey, Walks};

/// Thickness of a boundary layer: the larger of this many mean free distances
/// (first) and this many lengths of the largest grain (second).
const LAYER: (f64, f64) = (2.0, 1.8);
/// Slabs up to this many boundary layers thick are walked from plane to plane: an
/// inside thinner than one boundary layer is too thin for grains to act like points.
const THIN: f64 = 3.0;
/// Number of walks from each stream below a boundary layer, relative to that from
/// each illumination: all illuminations share the streams, and each stream carries
/// only part of the light.
const RAYS_PER_STREAM: f64 = 0.25;

/// Number of walks from each stream next to a plane between layers, relative to that
/// from each illumination: such planes lie deeper.
const RAYS_PER_INTERFACE_STREAM: f64 = 0.125;

/// A request with the plan of its walks.
struct HybridRun<'a> {
    request: &'a Request<'a>,
    streams: Streams,
    plan: WalkPlan,
    /// Where light is counted.
    windows: Vec<Window>,
    layout: MeanLayout,
    /// Per stream, the factors by which the Legendre moments of the light are
    /// multiplied and summed to give the light in the stream.
    into_streams: Vec<Vec<f64>>,
}

impl<'a> HybridRun<'a> {
    /// A run in which light is counted at `depths_m`, increasing, if there are any; then the request
    /// has one thickness and one illumination.
    fn new(request: &'a Request, depths_m: &[f64]) -> Result<Self, EngineError> {
        let streams = Streams::new(request.resolution.streams)?;
        let mut plan = WalkPlan::new(request, &streams);
        let windows = match depths_m {
            [] => Vec::new(),
            depths_m => plan.windows(request, &streams, depths_m),
        };
        let n = streams.count();
        let layout = MeanLayout::new(&plan, request.snowpack.snows().count(), n);
        let factors = |(mu, weight): (&f64, &f64)| {
            let mut basis = vec![0.0; n];
            legendre(2.0 * mu - 1.0, &mut basis);
            let terms = basis.into_iter().enumerate();
            terms
                .map(|(l, p)| weight * (2 * l + 1) as f64 * p)
                .collect()
        };
        let pairs = streams.cosines().iter().zip(streams.weights());
        let into_streams = pairs.map(factors).collect();
        Ok(Self {
            request,
            streams,
            plan,
            windows,
            layout,
            into_streams,
        })
    }
}

pub(super) fn run(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let run = HybridRun::new(request, &[])?;
    let indices = indices(request)?;
    let (nodes, mixes) = mixes(
        &indices,
        request.snowpack.is_wet(),
        Spacing::of_walks(request.rays),
    );
    let units = &control.cache.units;
    let included = nodes.iter().enumerate().filter(|(i, _)| units.include(*i));
    let walks = included.map(|(_, &node)| Walks::cached(&run, control, node));
    let walks: Vec<_> = walks.collect::<Result<_, _>>()?;
    if units.is_share() {
        let count = request.thicknesses_m.len() * request.illuminations.len();
        return Ok(vec![Spectrum::unknown(indices.len()); count]);
    }
    run.spectra(control, &walks, &indices, &mixes)
}

/// Number of walks that a request takes.
pub(super) fn walks(request: &Request) -> Result<u64, EngineError> {
    walks_to(request, &[])
}

/// Number of walks that a profile of `request` at `depths_m` takes.
pub(super) fn walks_to(request: &Request, depths_m: &[f64]) -> Result<u64, EngineError> {
    let run = HybridRun::new(request, depths_m)?;
    let (nodes, _) = mixes(
        &indices(request)?,
        request.snowpack.is_wet(),
        Spacing::of_walks(request.rays),
    );
    let rays: u64 = run.plan.tasks.iter().map(|task| task.rays).sum();
    Ok(rays.saturating_mul((PARTS * nodes.len()) as u64))
}
