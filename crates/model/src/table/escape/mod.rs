//! Walks through a snowpack that score, at every grain event, the light that would
//! leave from there in all directions (the local estimate of neutron transport,
//! for grains that take up room).
//!
//! Where a flight ends, several outcomes of the grain event are drawn beside the
//! one with which the walk goes on, each turned to eight azimuths about the ray
//! (grain axes are isotropic, so every turn is as likely). From where such a
//! grain, if it fits between the planes, would send the ray, a flight leaves the
//! snowpack with probability exp(-tau): so much is scored in that direction. The sum
//! over the flights of a walk has the mean of a count of those that do leave.
//! Flights drawn anew, because a grain did not fit, are counted by a trial of
//! them at every score. No outcome is tilted, moved or replaced, so the estimate
//! has no error but that of the table of outcomes.
mod stratum;
mod supply;
mod walk;

use splitsnow_spectra::simd::{F64x8, Kernel, Simd, dispatch};

use crate::math::Vec3x8;
use crate::rng::Stream;
use crate::table::Table;
use crate::transport::{
    Absorption, Coefficients, EXPONENTS, Entry, Illumination, Layer, Model, WalkError,
};
use stratum::Stratum;
use supply::Supply;
use walk::Walk;

/// Rays after which the caller is asked whether to go on.
const RAYS_BETWEEN_CHECKS: u64 = 64;
/// What escaping light is reported to.
pub trait EscapeSink {
    /// Light leaves on the lanes of the mask along unit vectors `direction`
    /// (upward where z < 0), with these weights per wavelength.
    fn catch<S: Simd>(&mut self, lanes: u32, direction: &Vec3x8<S>, weights: &[F64x8<S>]);

    /// A ray hit an event limit.
    fn lost(&mut self);

    /// Asked now and then: whether to give up.
    fn stop(&self) -> bool;
}

/// Light at one wavelength.
#[derive(Debug, Clone, Copy)]
pub struct Band {
    /// Its absorption.
    pub coefficients: Coefficients,
    /// Share of the light arriving at the substrate that comes back.
    pub reflected: f64,
    /// Share that counts as transmitted.
    pub transmitted: f64,
}

/// The work of [`EscapeWalker::walk`].
struct Walking<'a, C> {
    walker: &'a EscapeWalker<'a>,
    illumination: Illumination,
    rays: u64,
    rng: Stream,
    catch: &'a mut C,
}

impl<C: EscapeSink> Kernel for Walking<'_, C> {
    type Output = Result<(), WalkError>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let rng = self.rng.on::<S>();
        self.walker
            .walk_on(self.illumination, self.rays, rng, self.catch)
    }
}

/// A snowpack ready for such walks.
#[derive(Debug)]
pub struct EscapeWalker<'a> {
    /// From the surface down.
    strata: Vec<Stratum<'a>>,
    thickness_m: f64,
    wet: bool,
    absorbing_pores: bool,
    absorption: Absorption,
    bands: &'a [Band],
    entry: Entry,
    /// Chance to survive the substrate.
    bounce: f64,
}

impl<'a> EscapeWalker<'a> {
    /// `layers` from the surface down (at least one), with outcomes per type of
    /// grain in each. `absorption` is the least of all `bands`.
    #[must_use]
    pub fn new(
        layers: &[Layer],
        tables: &'a [Vec<[Table; 2]>],
        (exponents, model): (&[f64], &Model),
        bands: &'a [Band],
        absorption: Absorption,
    ) -> Self {
        let mut top_m = 0.0;
        let strata = layers.iter().zip(tables).map(|(layer, tables)| {
            let stratum = Stratum::new(layer, top_m, tables, bands, (exponents, model));
            top_m = stratum.base_m;
            stratum
        });
        let strata: Vec<_> = strata.collect();
        let sooty = strata.iter().any(|s| s.in_pores != [0.0; EXPONENTS]);
        let wet = strata.iter().any(|s| s.water_saturation > 0.0);
        let bounce = bands.iter().map(|band| band.reflected).fold(0.0, f64::max);
        Self {
            thickness_m: top_m,
            wet,
            absorbing_pores: wet || sooty,
            strata,
            absorption,
            bands,
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
        catch: &mut impl EscapeSink,
    ) -> Result<(), WalkError> {
        dispatch(Walking {
            walker: self,
            illumination,
            rays,
            rng,
            catch,
        })
    }

    #[inline(always)]
    fn walk_on<S: Simd>(
        &self,
        illumination: Illumination,
        rays: u64,
        rng: Stream<S>,
        catch: &mut impl EscapeSink,
    ) -> Result<(), WalkError> {
        let zero = F64x8::ZERO;
        let mut walk = Walk {
            walker: self,
            random: Supply::new(rng),
            base: vec![0.0; self.bands.len()],
            weights: vec![zero; self.bands.len()],
            catch,
        };
        for ray in 0..rays {
            if ray % RAYS_BETWEEN_CHECKS == 0 && walk.catch.stop() {
                return Err(WalkError::Stopped);
            }
            let mu = match illumination {
                Illumination::Collimated { polar_angle_rad } => libm::cos(polar_angle_rad),
                Illumination::Diffuse => walk.diffuse_cosine(0),
            };
            walk.ray(mu)?;
        }
        Ok(())
    }

    /// The layer at a depth.
    #[inline(always)]
    fn stratum(&self, z_m: f64) -> usize {
        let above_last = self.strata[..self.strata.len() - 1].iter();
        above_last
            .take_while(|stratum| stratum.base_m < z_m)
            .count()
    }

    /// Optical thicknesses of the snow between depths `z_m` and the upper plane,
    /// and where `down` the lower one, for vertical light and absorption per
    /// length `per_m` in each layer.
    #[inline(always)]
    fn vertical<S: Simd>(
        &self,
        z_m: F64x8<S>,
        down: F64x8<S>,
        per_m: impl Fn(&Stratum) -> f64,
    ) -> F64x8<S> {
        let zero = F64x8::ZERO;
        let mut sum = zero;
        for stratum in &self.strata {
            let [top, base] = [stratum.top_m, stratum.base_m].map(F64x8::splat);
            let part = down.select(base - z_m, z_m - top);
            let part = part.max(zero).min(base - top);
            sum += part * F64x8::splat(per_m(stratum));
        }
        sum
    }
}
