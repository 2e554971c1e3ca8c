//! Where light leaves a snowpack: by direction (the goniophotometer) and by
//! distance from where it entered (the radial profile of the BSSRDF).
//!
//! `reference` and `spectral` count walks where they end. `tabulated` scores at
//! every grain event the light that would leave from there in all directions
//! ([`crate::table::EscapeWalker`]): for sensors it is much the cheapest.
//! Standard errors are those of independent parts, with tables of their own.
//!
//! What is scored at events adds up to R and T with more noise than a count has, and
//! all sensors share it: walks that last long score much everywhere. So these
//! sensors are scaled to the R and T of `hybrid` where `auto` would take that
//! (`normal`).
//! Counts stay as they are: they add up as well as so many walks can tell, and
//! are what the rest is tested against.
mod counting;
mod escapes;
mod normal;
mod parts;

use std::ops::Range;

use super::nodes::{mixes, nodes};
use super::substrate::{self, SubstrateCoefficients};
use super::{Control, Engine, EngineError, Request, indices};
use crate::measurement::{Measured, Radii, Sensors};
use crate::optics::Index;
use crate::transport::{Illumination, Snowpack};

/// Light of one wavelength that leaves a snowpack under one illumination.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Exits {
    /// Per sensor, 1/sr, or per radial bin, share of the incident power:
    /// through the surface.
    pub reflected: Vec<Measured>,
    /// Into the substrate.
    pub transmitted: Vec<Measured>,
    /// Sum of what is reflected: reflectance. Its error is shared by all that is.
    pub reflectance: Measured,
    /// Sum of what is transmitted: transmittance, with an error shared in the same way.
    pub transmittance: Measured,
    /// Share of the rays that hit an event limit.
    pub lost: f64,
    /// Whether values were scaled so that their sums are R and T of `hybrid`.
    pub normalised: bool,
}

impl Exits {
    /// `1 - t` of this and `t` of an independent other.
    fn mix(&self, other: &Self, t: f64) -> Self {
        let mix = |a: &[Measured], b: &[Measured]| {
            let pairs = a.iter().zip(b);
            pairs.map(|(a, b)| a.mix(*b, t)).collect()
        };
        Self {
            reflected: mix(&self.reflected, &other.reflected),
            transmitted: mix(&self.transmitted, &other.transmitted),
            reflectance: self.reflectance.mix(other.reflectance, t),
            transmittance: self.transmittance.mix(other.transmittance, t),
            lost: (1.0 - t) * self.lost + t * other.lost,
            normalised: self.normalised && other.normalised,
        }
    }
}

/// The engine that scores sensors for `request`: itself, or what `auto` chooses.
#[must_use]
pub fn goniometer_engine(engine: Engine, request: &Request) -> Engine {
    match engine {
        Engine::Auto if escapes::check(request).is_ok() => Engine::Tabulated,
        Engine::Auto => Engine::Spectral,
        engine => engine,
    }
}

/// The engine that follows distances: itself, or what `auto` chooses.
#[must_use]
pub fn radial_engine(engine: Engine) -> Engine {
    match engine {
        Engine::Auto => Engine::Spectral,
        engine => engine,
    }
}

/// How many walks an engine does, if that is known beforehand.
///
/// # Errors
/// [`EngineError::Optics`].
pub fn walks(engine: Engine, request: &Request) -> Result<Option<u64>, EngineError> {
    let indices = indices(request)?;
    let per_ray = match engine {
        Engine::Reference => indices.len(),
        _ => mixes(&indices, request.snowpack.is_wet()).0.len(),
    };
    let curves = request.thicknesses_m.len() * request.illuminations.len();
    let mut walks = request.rays.saturating_mul((per_ray * curves) as u64);
    if engine == Engine::Tabulated && normal::holds(request) {
        walks = walks.saturating_add(Engine::Hybrid.walks(&normal::request(request))?);
    }
    Ok((!substrate::is_cascade(request)).then_some(walks))
}

/// BRDF and BTDF, 1/sr (Varsa 2025, eq. 6.1), on `sensors` on either side of the
/// snowpack: per thickness, illumination and wavelength, the last running fastest.
/// The products of values and projected solid angles add up to reflectance and
/// transmittance. In `tabulated` these are those of `hybrid`, where it holds.
///
/// # Errors
/// See [`EngineError`]; `hybrid` knows no azimuths.
pub fn goniometer(
    engine: Engine,
    request: &Request,
    sensors: &Sensors,
    control: &Control,
) -> Result<Vec<Exits>, EngineError> {
    let engine = goniometer_engine(engine, request);
    let mut all = match engine {
        Engine::Tabulated => {
            escapes::check(request)?;
            let normals = normal::spectra(request, control)?;
            let normalised = normals.is_some();
            let mut all = each(engine, normalised, request, control, &|scene| {
                escapes::run(scene, sensors)
            })?;
            if let Some(normals) = normals {
                let mut all = all.iter_mut();
                for normal in &normals {
                    let pairs = normal.reflectance.iter().zip(&normal.transmittance);
                    for ((r, t), exits) in pairs.zip(&mut all) {
                        exits.normalise(*r, *t);
                    }
                }
            }
            all
        }
        Engine::Reference | Engine::Spectral => each(engine, false, request, control, &|scene| {
            counting::run(scene, sensors)
        })?,
        engine => {
            return Err(EngineError::Unable {
                engine,
                what: "azimuths",
                instead: Engine::Tabulated,
            });
        }
    };
    for exits in &mut all {
        for side in [&mut exits.reflected, &mut exits.transmitted] {
            for (sensor, measured) in side.iter_mut().enumerate() {
                let projected_sr = sensors.projected_sr(sensor);
                measured.value /= projected_sr;
                measured.se /= projected_sr;
            }
        }
    }
    Ok(all)
}

/// Shares of the incident power that leave within the bins of `radii` about the
/// point where it entered: per thickness, illumination and wavelength, the last
/// running fastest. `auto` is `spectral`.
///
/// # Errors
/// See [`EngineError`]; engines that use tables do not follow distances.
pub fn radial_profile(
    engine: Engine,
    request: &Request,
    radii: &Radii,
    control: &Control,
) -> Result<Vec<Exits>, EngineError> {
    let engine = radial_engine(engine);
    if !matches!(engine, Engine::Reference | Engine::Spectral) {
        return Err(EngineError::Unable {
            engine,
            what: "how far light travels along the surface",
            instead: Engine::Spectral,
        });
    }
    each(engine, false, request, control, &|scene| {
        counting::run(scene, radii)
    })
}

/// One snowpack of known thickness under one light.
struct Scene<'a> {
    engine: Engine,
    /// Whether sums are to be replaced: errors of bins are then those of shares.
    normalised: bool,
    request: &'a Request<'a>,
    control: &'a Control<'a>,
    snowpack: &'a Snowpack,
    substrate: &'a [SubstrateCoefficients],
    /// Position in the list of thicknesses, and the thickness in m.
    thickness: (usize, f64),
    /// Position in the list of lights.
    light: usize,
}

impl Scene<'_> {
    fn illumination(&self) -> Illumination {
        self.request.illuminations[self.light]
    }

    /// Whether it looks the same from all azimuths.
    fn is_axial(&self) -> bool {
        match self.illumination() {
            Illumination::Collimated { polar_angle_rad } => polar_angle_rad == 0.0,
            Illumination::Diffuse => true,
        }
    }
}

/// `run` of all thicknesses and lights.
fn each(
    engine: Engine,
    normalised: bool,
    request: &Request,
    control: &Control,
    run: &dyn Fn(&Scene) -> Result<Vec<Exits>, EngineError>,
) -> Result<Vec<Exits>, EngineError> {
    // the walks themselves compute any snowpack that `spectral` does
    Engine::Spectral.check(request)?;
    let below = match engine {
        Engine::Reference => Engine::Reference,
        _ => Engine::Spectral,
    };
    let (substrate, top) = substrate::lower_boundary(below, request, control)?;
    let (snowpack, thicknesses_m) = match &top {
        Some((snowpack, thicknesses_m)) => (snowpack, thicknesses_m.as_slice()),
        None => (request.snowpack, request.thicknesses_m),
    };
    let mut all = Vec::new();
    for thickness in thicknesses_m.iter().copied().enumerate() {
        for light in 0..request.illuminations.len() {
            let scene = Scene {
                engine,
                normalised,
                request,
                control,
                snowpack,
                substrate: &substrate,
                thickness,
                light,
            };
            all.extend(run(&scene)?);
        }
    }
    Ok(all)
}

/// Exits at every wavelength from what `at` gives for walks at an index node,
/// scored at the wavelengths of a span.
fn at_nodes(
    scene: &Scene,
    at: impl Fn(Node) -> Result<Vec<Exits>, EngineError>,
) -> Result<Vec<Exits>, EngineError> {
    let (indices, wet) = (indices(scene.request)?, scene.request.snowpack.is_wet());
    let places = nodes(&indices, wet);
    let (nodes, mixes) = mixes(&indices, wet);
    let mut found = Vec::new();
    for (number, node) in nodes.into_iter().enumerate() {
        // the wavelengths a node serves reach from the node before it to the node after it
        let last = places[(number + 1).min(places.len() - 1)];
        let span = places[number.saturating_sub(1)]..last + 1;
        let first = span.start;
        let indices = node;
        let exits = at(Node {
            number,
            indices,
            span,
        })?;
        found.push((first, exits));
    }
    let mixed = mixes.iter().enumerate().map(|(l, mix)| {
        let [a, b] = mix.nodes.map(|node| &found[node].1[l - found[node].0]);
        if mix.nodes[0] == mix.nodes[1] {
            a.clone()
        } else {
            a.mix(b, mix.share)
        }
    });
    Ok(mixed.collect())
}

/// A pair of refractive indices at which rays are walked.
struct Node {
    number: usize,
    /// Of ice and water.
    indices: (Index, Index),
    /// Positions of the wavelengths it serves.
    span: Range<usize>,
}
