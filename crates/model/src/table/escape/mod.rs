//! Walks through a snowpack that score at every grain event the light that would leave
//! from there in all directions (the local estimate of neutron transport, for grains of
//! finite size).
//!
//! At the end of a flight, several outcomes of the grain event are drawn besides the one
//! with which the walk continues. Each is rotated to eight azimuths about the ray, which
//! are equally likely because grain axes are isotropic. A fixed number of the outcomes has no
//! path in ice: these are few, but the brightest where ice absorbs. If such a grain fits between
//! the planes, the ray would leave it in some direction, and its next flight leaves the
//! snowpack with probability exp(-tau). This probability is scored in that direction. The
//! sum over the flights of a walk has the same mean as a count of the flights that do
//! leave. Flights that are drawn again because a grain did not fit count with their
//! probability, which is tabulated (module `rejections`). No outcome is tilted, moved or
//! replaced, so the only errors of the estimate are those of its tables.
mod bands;
mod layer;
mod outcomes;
mod rejections;
mod supply;
mod walk;

use splitsnow_spectra::simd::{F64x8, Simd, SimdKernel, dispatch};

use crate::math::Vec3x8;
use crate::rng::Stream;
use crate::transport::{
    Absorption, Coefficients, Entry, Illumination, Layer, Model, TRACERS, Tracers, WalkError,
};
use bands::BandLanes;
use layer::EscapeLayer;
pub use outcomes::EscapeTable;
use rejections::Rejections;
use supply::Supply;
use walk::EscapeWalk;

/// Rays between calls of [`EscapeSink::stop`].
const RAYS_BETWEEN_CHECKS: u64 = 64;

/// Receives the escaping light.
pub trait EscapeSink {
    /// The bins of those of eight directions whose bits are set in `lanes`: unit vectors that point
    /// upward if z < 0.
    fn bins<S: Simd>(&self, direction: &Vec3x8<S>, lanes: u32) -> [usize; 8];

    /// Light leaves in a bin, with `chance` times these weights per band, in groups of eight. In
    /// the last group, the last band is repeated.
    fn catch<S: Simd>(&mut self, bin: usize, chance: f64, weights: &[F64x8<S>]);

    /// A ray reached an event limit.
    fn lost(&mut self);

    /// Whether to stop early. Called at intervals.
    fn stop(&self) -> bool;
}

/// Light at one wavelength.
#[derive(Debug, Clone, Copy)]
pub struct EscapeBand {
    /// Absorption coefficients.
    pub coefficients: Coefficients,
    /// Fraction of the light arriving at the substrate that is reflected.
    pub reflected: f64,
    /// Fraction that counts as transmitted.
    pub transmitted: f64,
}

/// [`EscapeWalker::walk`] as a SIMD kernel.
struct Walking<'a, C> {
    walker: &'a EscapeWalker<'a>,
    illumination: Illumination,
    rays: u64,
    rng: Stream,
    sink: &'a mut C,
}

impl<C: EscapeSink> SimdKernel for Walking<'_, C> {
    type Output = Result<(), WalkError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let rng = self.rng.on::<S>();
        self.walker
            .walk_on(self.illumination, self.rays, rng, self.sink)
    }
}

/// A snowpack prepared for such walks.
#[derive(Debug)]
pub struct EscapeWalker<'a> {
    /// From the surface down.
    layers: Vec<EscapeLayer<'a>>,
    rejections: Rejections,
    thickness_m: f64,
    wet: bool,
    absorbing_pores: bool,
    absorption: Absorption,
    bands: Vec<BandLanes>,
    entry: Entry,
    /// Probability of being reflected by the substrate: the largest of all bands.
    bounce: f64,
}

impl<'a> EscapeWalker<'a> {
    /// `layers` from the surface down (at least one), with the outcomes of each grain type
    /// in `tables`. `absorption` has the smallest coefficients of all `bands`.
    #[must_use]
    pub fn new(
        layers: &[Layer],
        tables: &'a [Vec<[EscapeTable; 2]>],
        (tracers, model): (&Tracers, &Model),
        bands: &[EscapeBand],
        absorption: Absorption,
    ) -> Self {
        let mut top_m = 0.0;
        let prepared = layers.iter().zip(tables).map(|(layer, tables)| {
            let prepared = EscapeLayer::new(layer, top_m, tables, bands, (tracers, model));
            top_m = prepared.base_m;
            prepared
        });
        let prepared: Vec<_> = prepared.collect();
        let sooty = prepared.iter().any(|s| s.in_pores != [0.0; TRACERS]);
        let wet = prepared.iter().any(|s| s.water_saturation > 0.0);
        let bounce = bands.iter().map(|band| band.reflected).fold(0.0, f64::max);
        Self {
            thickness_m: top_m,
            wet,
            absorbing_pores: wet || sooty,
            rejections: Rejections::new(&prepared, top_m),
            layers: prepared,
            absorption,
            bands: BandLanes::all(bands, bounce),
            entry: model.entry,
            bounce,
        }
    }

    /// Walks `rays` rays.
    ///
    /// # Errors
    /// [`WalkError`].
    pub fn walk(
        &self,
        illumination: Illumination,
        rays: u64,
        rng: Stream,
        sink: &mut impl EscapeSink,
    ) -> Result<(), WalkError> {
        dispatch(Walking {
            walker: self,
            illumination,
            rays,
            rng,
            sink,
        })
    }

    #[inline(always)]
    fn walk_on<S: Simd>(
        &self,
        illumination: Illumination,
        rays: u64,
        rng: Stream<S>,
        sink: &mut impl EscapeSink,
    ) -> Result<(), WalkError> {
        let bands = self.bands.len();
        let mut walk = EscapeWalk {
            walker: self,
            random: Supply::new(rng),
            base: vec![F64x8::ZERO; bands],
            copies: 1.0,
            weights: vec![F64x8::ZERO; bands],
            left: vec![F64x8::ZERO; bands],
            crossed_m: vec![F64x8::ZERO; self.layers.len()],
            sink,
        };
        for ray in 0..rays {
            if ray % RAYS_BETWEEN_CHECKS == 0 && walk.sink.stop() {
                return Err(WalkError::Stopped);
            }
            let mu = match illumination {
                Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
                Illumination::Diffuse => walk.diffuse_cosine(0),
            };
            // the first flights of all rays are stratified
            let tau = walk.random.exponential_in(ray, rays);
            walk.ray(mu, tau)?;
        }
        Ok(())
    }

    /// The layer at a depth.
    #[inline(always)]
    fn layer_at(&self, z_m: f64) -> usize {
        let above_last = self.layers[..self.layers.len() - 1].iter();
        above_last.take_while(|layer| layer.base_m < z_m).count()
    }

    /// Integral of `per_m` (a value per length in each layer) along the vertical, from the
    /// depths `z_m` to the upper plane or, where `down` is set, to the lower plane.
    #[inline(always)]
    fn vertical<S: Simd>(
        &self,
        z_m: F64x8<S>,
        down: F64x8<S>,
        per_m: impl Fn(&EscapeLayer) -> f64,
    ) -> F64x8<S> {
        // a loop, since a closure may be compiled without the instruction set
        let mut sum = F64x8::ZERO;
        for layer in &self.layers {
            sum += layer.part_m(z_m, down) * F64x8::splat(per_m(layer));
        }
        sum
    }
}
