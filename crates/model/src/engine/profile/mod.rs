//! Profiles: light inside a snowpack against depth (docs/methods.md).
//!
//! `reference` and `spectral` walk the whole snowpack from grain to grain and count the crossings
//! of horizontal planes ([`crate::transport::Planes`]). `hybrid` takes the light in its streams
//! where grains act like points, and counts crossings next to the planes of the snowpack. Absorbed
//! power is the difference of net fluxes, so energy is balanced to rounding.
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::print_stdout)]
mod tests;
mod walked;

use serde::{Deserialize, Serialize};

use super::{Control, Engine, EngineError, Request, divided, hybrid, substrate};
use crate::measurement::Measured;
use crate::transport::{CROSSING_SCORES, PlaneFluxes};

/// Relative standard error of the mean of ten equal scores.
const FEW: f64 = 0.3;

/// Light inside a snowpack at several depths and wavelengths (or bands), per incident flux.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    depths_m: Vec<f64>,
    /// Fluxes from all parts of the walks and then with one part left out at a time:
    /// `[estimate][wavelength][depth]`.
    estimates: Vec<Vec<Vec<PlaneFluxes>>>,
    /// Largest share of the rays that hit an event limit.
    pub lost: f64,
    /// Standard error of a flux to which few walks or none contribute: one score that may have
    /// been missed.
    least_se: f64,
}

/// Light at one depth and wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightAtDepth {
    /// Flux that crosses the depth downward, per incident flux.
    pub downwelling: Measured,
    /// Flux that crosses the depth upward, per incident flux.
    pub upwelling: Measured,
    /// Actinic flux (spherical irradiance: radiance integrated over all directions), per incident
    /// flux through a horizontal area.
    pub actinic: Measured,
    /// Mean power absorbed per volume between this depth and the next, per incident flux, 1/m;
    /// `None` at the base.
    pub absorbed_per_m: Option<Measured>,
}

impl Profile {
    /// Depths below the surface, m: those asked for, and always the surface and the base.
    #[must_use]
    pub fn depths_m(&self) -> &[f64] {
        &self.depths_m
    }

    /// Number of wavelengths or bands.
    #[must_use]
    pub fn wavelengths(&self) -> usize {
        self.estimates.first().map_or(0, Vec::len)
    }

    /// The light at a depth and a wavelength, both given by their positions.
    ///
    /// # Panics
    /// If there is no such depth or wavelength.
    #[must_use]
    pub fn at(&self, wavelength: usize, depth: usize) -> LightAtDepth {
        let flux = |number: usize| self.measured(|fluxes| fluxes[wavelength][depth][number], 1.0);
        let next = self.depths_m.get(depth + 1);
        let absorbed_per_m = next.map(|next_m| {
            let thickness_m = next_m - self.depths_m[depth];
            let net = |[down, up, _]: PlaneFluxes| down - up;
            let absorbed = |fluxes: &Vec<Vec<PlaneFluxes>>| {
                let column = &fluxes[wavelength];
                (net(column[depth]) - net(column[depth + 1])) / thickness_m
            };
            self.measured(absorbed, 1.0 / thickness_m)
        });
        LightAtDepth {
            downwelling: flux(0),
            upwelling: flux(1),
            actinic: flux(2),
            absorbed_per_m,
        }
    }

    /// The averages over bands, each given by the weights of all wavelengths. Their standard errors
    /// include that wavelengths share walks.
    ///
    /// # Panics
    /// If a band does not have one weight per wavelength.
    #[must_use]
    pub fn averaged(&self, bands: &[Vec<f64>]) -> Self {
        let average = |spectra: &Vec<Vec<PlaneFluxes>>, weights: &Vec<f64>| {
            assert_eq!(weights.len(), spectra.len(), "one weight per wavelength");
            let at = |depth: usize| {
                let terms = weights.iter().zip(spectra);
                terms.fold([0.0; CROSSING_SCORES], |mut sums, (weight, column)| {
                    let pairs = sums.iter_mut().zip(column[depth]);
                    pairs.for_each(|(sum, flux)| *sum += weight * flux);
                    sums
                })
            };
            (0..self.depths_m.len()).map(at).collect()
        };
        let of_bands = |spectra: &Vec<Vec<PlaneFluxes>>| {
            let bands = bands.iter();
            bands.map(|weights| average(spectra, weights)).collect()
        };
        Self {
            estimates: self.estimates.iter().map(of_bands).collect(),
            ..self.clone()
        }
    }

    /// A quantity with its standard error: the jackknife with one part left out at a time (Tukey
    /// 1958). If it exceeds [`FEW`] of the value, few walks contribute, and it is at least that of
    /// a score of `one` that may have been missed.
    fn measured(&self, quantity: impl Fn(&Vec<Vec<PlaneFluxes>>) -> f64, one: f64) -> Measured {
        let (all, others) = (&self.estimates[0], &self.estimates[1..]);
        let others: Vec<f64> = others.iter().map(&quantity).collect();
        let n = others.len() as f64;
        let mean = others.iter().sum::<f64>() / n;
        let squares: f64 = others.iter().map(|x| (x - mean) * (x - mean)).sum();
        let (value, se) = (quantity(all), (squares * (n - 1.0) / n).sqrt());
        let missed = if se > FEW * value.abs() || value == 0.0 {
            self.least_se * one
        } else {
            0.0
        };
        Measured {
            value,
            se: se.max(missed),
        }
    }

    /// Appends the wavelengths of `further`.
    fn extend(&mut self, further: Self) {
        let pairs = self.estimates.iter_mut().zip(further.estimates);
        pairs.for_each(|(ours, theirs)| ours.extend(theirs));
        self.lost = self.lost.max(further.lost);
    }

    /// A profile from its estimates per wavelength: `[wavelength][estimate][depth]`.
    fn of(depths_m: &[f64], wavelengths: Vec<Vec<Vec<PlaneFluxes>>>) -> Self {
        let estimates = wavelengths.first().map_or(0, Vec::len);
        let mut turned = vec![Vec::new(); estimates];
        for wavelength in wavelengths {
            let pairs = turned.iter_mut().zip(wavelength);
            pairs.for_each(|(estimate, depths)| estimate.push(depths));
        }
        Self {
            depths_m: depths_m.to_vec(),
            estimates: turned,
            lost: 0.0,
            least_se: 0.0,
        }
    }

    /// Adds what a Lambertian substrate returns, given the profile `from_below` of the snowpack
    /// upside down under diffuse light: with its reflectance R' and the transmittance T, the
    /// substrate of `reflectance` rho sends up T rho / (1 - rho R').
    fn put_on_substrate(&mut self, from_below: &Self, reflectance: &[f64]) {
        let last = self.depths_m.len() - 1;
        for (ours, theirs) in self.estimates.iter_mut().zip(&from_below.estimates) {
            for ((ours, theirs), rho) in ours.iter_mut().zip(theirs).zip(reflectance) {
                let [transmitted, ..] = ours[last];
                let [_, returned, _] = theirs[0];
                let rising = transmitted * rho / (1.0 - rho * returned);
                let pairs = ours.iter_mut().zip(theirs.iter().rev());
                for ([down, up, actinic], [their_down, their_up, their_actinic]) in pairs {
                    *down += rising * their_up;
                    *up += rising * their_down;
                    *actinic += rising * their_actinic;
                }
            }
        }
    }
}

/// The engine that computes profiles: `engine`, or the one that `auto` chooses.
#[must_use]
pub fn engine(engine: Engine, request: &Request) -> Engine {
    match engine {
        Engine::Auto if Engine::Hybrid.check(request).is_ok() => Engine::Hybrid,
        Engine::Auto => Engine::Spectral,
        engine => engine,
    }
}

/// Number of walks of [`run`].
///
/// # Errors
/// [`EngineError::Optics`] and [`EngineError::Substrate`] as in [`run`].
pub fn walks(engine: Engine, request: &Request, depths_m: &[f64]) -> Result<u64, EngineError> {
    if let Some(parts) = divided::parts(request) {
        let walks = parts.iter().map(|part| walks(engine, part, depths_m));
        return walks.sum();
    }
    match self::engine(engine, request) {
        Engine::Hybrid => {
            let depths_m = depths(depths_m, request.thicknesses_m[0])?;
            let mut sum = hybrid::walks_to(request, &depths_m)?;
            if is_bright(&reflectance(request)?) {
                let (snowpack, thickness_m) = substrate::flipped(request, 0);
                let below = substrate::from_below_request(request, &snowpack, &thickness_m);
                sum = sum.saturating_add(hybrid::walks_to(&below, &flipped(&depths_m))?);
            }
            Ok(sum)
        }
        engine => walked::walks(engine, request),
    }
}

/// Reflectance of the substrate per wavelength.
fn reflectance(request: &Request) -> Result<Vec<f64>, EngineError> {
    let coefficients = substrate::substrate_coefficients(request)?;
    Ok(coefficients.iter().map(|g| g.reflectance.value).collect())
}

fn is_bright(reflectance: &[f64]) -> bool {
    reflectance.iter().any(|rho| *rho > 0.0)
}

/// Light at `depths_m` (m, from 0 to the thickness) in the first thickness of `request` under its
/// first illumination. The depths are sorted, and the surface and the base are added.
///
/// # Errors
/// [`EngineError::Depth`] if a depth is not in the snowpack; [`EngineError::CascadeProfile`];
/// [`EngineError::Unable`] for `tabulated`; see [`EngineError`] for all others.
pub fn run(
    engine: Engine,
    request: &Request,
    depths_m: &[f64],
    control: &Control,
) -> Result<Profile, EngineError> {
    if request.rays == 0 {
        return Err(EngineError::NoRays);
    }
    let request = &Request {
        thicknesses_m: &request.thicknesses_m[..1],
        illuminations: &request.illuminations[..1],
        ..request.clone()
    };
    let depths_m = depths(depths_m, request.thicknesses_m[0])?;
    if substrate::is_cascade(request) {
        return Err(EngineError::CascadeProfile);
    }
    let engine = self::engine(engine, request);
    let of_part =
        |part: &Request, control: &Control| run_undivided(engine, part, &depths_m, control);
    let kind = format!("profile {} {depths_m:?}", engine.name());
    let Some(parts) = divided::run(&kind, request, control, of_part)? else {
        return run_undivided(engine, request, &depths_m, control);
    };
    let joined = parts.into_iter().reduce(|mut whole, part| {
        whole.extend(part);
        whole
    });
    Ok(joined.unwrap_or_else(|| Profile::of(&depths_m, Vec::new())))
}

fn run_undivided(
    engine: Engine,
    request: &Request,
    depths_m: &[f64],
    control: &Control,
) -> Result<Profile, EngineError> {
    let reflectance = reflectance(request)?;
    match engine {
        Engine::Reference | Engine::Spectral => {
            Engine::Spectral.check(request)?;
            walked::run(engine, request, depths_m, &reflectance, control)
        }
        Engine::Hybrid => {
            engine.check(request)?;
            let solved = |request: &Request, depths_m: &[f64]| {
                let fluxes = hybrid::profile(request, depths_m, control)?;
                Ok::<_, EngineError>(Profile::of(depths_m, fluxes))
            };
            let mut profile = solved(request, depths_m)?;
            if is_bright(&reflectance) {
                let (snowpack, thickness_m) = substrate::flipped(request, 0);
                let request = substrate::from_below_request(request, &snowpack, &thickness_m);
                let from_below = solved(&request, &flipped(depths_m))?;
                profile.put_on_substrate(&from_below, &reflectance);
            }
            Ok(profile)
        }
        engine => Err(EngineError::Unable {
            engine,
            quantity: "light inside the snow",
            instead: Engine::Hybrid,
        }),
    }
}

/// Distances from the base, m, of `depths_m`, of which the last is the base.
fn flipped(depths_m: &[f64]) -> Vec<f64> {
    let thickness_m = depths_m.last().copied().unwrap_or(0.0);
    depths_m.iter().rev().map(|z_m| thickness_m - z_m).collect()
}

/// `depths_m` in order, with the surface and the base.
fn depths(depths_m: &[f64], thickness_m: f64) -> Result<Vec<f64>, EngineError> {
    let outside = |z_m: &&f64| !(0.0..=thickness_m).contains(*z_m);
    if let Some(depth_m) = depths_m.iter().find(outside) {
        return Err(EngineError::Depth {
            depth_m: *depth_m,
            thickness_m,
        });
    }
    let mut all: Vec<f64> = depths_m.to_vec();
    all.extend([0.0, thickness_m]);
    all.sort_by(f64::total_cmp);
    all.dedup();
    Ok(all)
}
