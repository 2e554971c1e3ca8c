//! `hybrid`: deterministic transport inside the snow, walks only next to its
//! surfaces.
//!
//! Far from the planes, grains act like points: light spreads through them as
//! through points that scatter alike, with the mean free path of
//! [`crate::table::Event::effective_mean_free_path_m`], and [`crate::slab`]
//! solves that exactly. Next to a plane they do not, because grains must fit
//! under it. So a slab is taken as two boundary layers and what is between:
//!
//! 1. **Boundary layer**, as thick as [`LAYER`] says: walks with tabulated
//!    grains ([`crate::table::Region`]), from every light above and every stream
//!    below, give the shares that leave through the surface and, by Legendre
//!    moments, into every stream going down. Paths in ice and water are kept in
//!    a histogram, so that one set of walks serves all wavelengths. A ray from
//!    below is on a flight that began a free path further down; if its grain
//!    does not fit under the surface it goes back there.
//! 2. **Inside**: reflection and transmission of the plane-parallel solver with
//!    the kernel of the same grains at the same absorption. Its grains are a
//!    mixture of all types in air and in water, each weakened by the mean
//!    survival of a flight through what absorbs there, 1/(1 + alpha d).
//! 3. **Adding** the three, in homogeneous snow with the upper boundary layer's
//!    mirror image as the lower one, gives every thickness and illumination at
//!    once.
//!
//! Layers inside a snowpack are added as the points they scatter like, and what is next
//! to the planes between them, across which grains carry light, is walked too. A
//! boundary layer may hold several.
//!
//! Slabs of up to three boundary layers are walked from plane to plane.
//!
//! **Dispersion** as in `spectral`: tables, kernels and walks exist at a few
//! index nodes, and each wavelength mixes those of its two nodes.
//!
//! **Errors.** Tables, kernels and walks come in independent parts. At every
//! wavelength the scatter of the results with one part left out at a time (the
//! jackknife) gives the standard errors. They hold nothing of the method's own
//! error: see docs/stability.md.
mod cut;
mod inside;
mod planes;
mod solve;
mod tally;
mod walks;

use crate::engine::nodes::mixes;
use crate::engine::tables::PARTS;
use crate::engine::{Control, EngineError, Request, indices};
use crate::math::legendre;
use crate::measurement::Spectrum;
use crate::slab::Streams;
use cut::Plan;
use tally::Layout;

pub(super) use walks::{CacheKey, Walks};

/// Thickness of a boundary layer: the larger of this many mean free distances
/// and that many of the largest grains.
const LAYER: (f64, f64) = (2.0, 1.8);
/// Slabs up to so many boundary layers thick are walked from plane to plane:
/// less than one such layer between two is too little to forget the grains.
const THIN: f64 = 3.0;
/// Walks from each stream below per walk from each light: all lights share the
/// streams, and each stream carries but a part of the light.
const FROM_BELOW: f64 = 0.25;

/// Walks from each stream next to a plane between layers, which lies deeper.
const JOINT: f64 = 0.125;

/// What a request comes to.
struct Run<'a> {
    request: &'a Request<'a>,
    streams: Streams,
    plan: Plan,
    layout: Layout,
    /// Per stream, what it gets per moment of the light that is spread over streams.
    into_streams: Vec<Vec<f64>>,
}

impl<'a> Run<'a> {
    fn new(request: &'a Request) -> Result<Self, EngineError> {
        let streams = Streams::new(request.resolution.streams)?;
        let plan = Plan::new(request, &streams);
        let n = streams.count();
        let layout = Layout::new(&plan, request.snowpack.snows().count(), n);
        let into = |(mu, weight): (&f64, &f64)| {
            let mut basis = vec![0.0; n];
            legendre(2.0 * mu - 1.0, &mut basis);
            let terms = basis.into_iter().enumerate();
            terms
                .map(|(l, p)| weight * (2 * l + 1) as f64 * p)
                .collect()
        };
        let pairs = streams.cosines().iter().zip(streams.weights());
        let into_streams = pairs.map(into).collect();
        Ok(Self {
            request,
            streams,
            plan,
            layout,
            into_streams,
        })
    }
}

pub(super) fn run(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let run = Run::new(request)?;
    let indices = indices(request)?;
    let (nodes, mixes) = mixes(&indices, request.snowpack.is_wet());
    let walks = nodes.iter().map(|&node| Walks::of(&run, control, node));
    let walks: Vec<_> = walks.collect::<Result<_, _>>()?;
    run.spectra(control, &walks, &indices, &mixes)
}

/// How many walks a request takes.
pub(super) fn walks(request: &Request) -> Result<u64, EngineError> {
    let run = Run::new(request)?;
    let (nodes, _) = mixes(&indices(request)?, request.snowpack.is_wet());
    let rays: u64 = run.plan.tasks.iter().map(|task| task.rays).sum();
    Ok(rays.saturating_mul((PARTS * nodes.len()) as u64))
}
