//! Light that leaves a snowpack by direction (the goniophotometer) and by distance
//! from the point where it entered (the radial profile of the BSSRDF).
//!
//! `reference` and `spectral` score walks where they end. `tabulated` scores at
//! every grain event the light that would leave from there in all directions
//! ([`crate::table::EscapeWalker`]), which is by far the cheapest for sensors.
//! Standard errors come from the scatter of independent parts, each with its own
//! tables.
//!
//! Scores at events add up to R and T with more noise than counted walks do. All
//! sensors share this noise, because long walks score much on every sensor. These
//! sensors are therefore scaled to R and T of `hybrid` wherever `auto` would choose
//! `hybrid` (module `normal`). Counted walks are not scaled: their sums have only the
//! noise of the number of walks, and the scaled sensors are tested against them.
mod counting;
mod escapes;
mod normal;
mod parts;

use std::f64::consts::PI;
use std::ops::Range;

use counting::DirectionBins;
pub use parts::PARTS;

use serde::{Deserialize, Serialize};

use super::nodes::{Spacing, mixes, nodes};
use super::substrate::{self, SubstrateCoefficients};
use super::{Control, Engine, EngineError, Request, divided, identity, indices};
use crate::measurement::{Measured, Radii, Sensors, Spectrum, ViewFactors, Views};
use crate::optics::Index;
use crate::transport::{Illumination, Snowpack};

/// Light of one wavelength that leaves a snowpack under one illumination.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Exits {
    /// Light that leaves through the surface: per sensor or view, BRDF in 1/sr; or per radial
    /// bin, share of the incident power.
    pub reflected: Vec<Measured>,
    /// Light that leaves into the substrate, in the same units.
    pub transmitted: Vec<Measured>,
    /// Reflectance: the sum of the reflected light. Its error is common to all bins.
    pub reflectance: Measured,
    /// Transmittance: the sum of the transmitted light. Its error is common to all
    /// bins.
    pub transmittance: Measured,
    /// Share of the rays that hit an event limit.
    pub lost: f64,
    /// Whether the values were scaled so that their sums are R and T of `hybrid`.
    pub normalised: bool,
}

impl Exits {
    /// pi times the reflected light of each sensor or view: the bidirectional reflectance factor
    /// (BRF), or under diffuse light the hemispherical-directional reflectance factor (HDRF;
    /// Schaepman-Strub et al. 2006). A Lambertian surface that reflects all light has 1.
    #[must_use]
    pub fn reflectance_factors(&self) -> Vec<Measured> {
        scaled(&self.reflected, PI)
    }

    /// pi times the transmitted light of each sensor or view.
    #[must_use]
    pub fn transmittance_factors(&self) -> Vec<Measured> {
        scaled(&self.transmitted, PI)
    }

    /// Anisotropy factors: the reflectance factors over the reflectance (Dumont et al. 2010). A
    /// Lambertian surface has 1.
    #[must_use]
    pub fn anisotropy_factors(&self) -> Vec<Measured> {
        scaled(&self.reflected, PI / self.reflectance.value)
    }

    /// Interpolates between `self` (weight `1 - t`) and an independent `other` (weight
    /// `t`).
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

fn scaled(values: &[Measured], factor: f64) -> Vec<Measured> {
    let scale = |measured: &Measured| Measured {
        value: factor * measured.value,
        se: factor * measured.se,
    };
    values.iter().map(scale).collect()
}

/// The engine that scores sensors for `request`: `engine`, or the one that `auto`
/// chooses.
#[must_use]
pub fn goniometer_engine(engine: Engine, request: &Request) -> Engine {
    match engine {
        Engine::Auto if escapes::check(request).is_ok() => Engine::Tabulated,
        Engine::Auto => Engine::Spectral,
        engine => engine,
    }
}

/// The engine that computes radial profiles: `engine`, or the one that `auto` chooses.
#[must_use]
pub fn radial_engine(engine: Engine) -> Engine {
    match engine {
        Engine::Auto => Engine::Spectral,
        engine => engine,
    }
}

/// Number of walks of an engine; `None` for a cascade, where it is not known
/// beforehand.
///
/// # Errors
/// [`EngineError::Optics`] if an optical table cannot be read or does not cover a
/// wavelength.
pub fn walks(engine: Engine, request: &Request) -> Result<Option<u64>, EngineError> {
    let indices = indices(request)?;
    let per_ray = match engine {
        Engine::Reference => indices.len(),
        _ => {
            let is_shares = engine == Engine::Tabulated && normal::is_valid(request);
            nodes(&indices, request.snowpack.is_wet(), spacing(is_shares)).len()
        }
    };
    let curves = request.thicknesses_m.len() * request.illuminations.len();
    let mut walks = request.rays.saturating_mul((per_ray * curves) as u64);
    if engine == Engine::Tabulated && normal::is_valid(request) {
        walks = walks.saturating_add(Engine::Hybrid.walks(&normal::hybrid_request(request))?);
    }
    Ok((!substrate::is_cascade(request)).then_some(walks))
}

/// BRDF and BTDF, 1/sr (Varsa 2025, eq. 6.1), on `sensors` on either side of the
/// snowpack: per thickness, illumination and wavelength, the last running fastest.
/// The products of values and projected solid angles add up to reflectance and
/// transmittance. With `tabulated`, these are R and T of `hybrid` where `hybrid` is
/// valid.
///
/// # Errors
/// [`EngineError::Unable`] for `hybrid`, which does not compute azimuths; see
/// [`EngineError`] for all others.
pub fn goniometer(
    engine: Engine,
    request: &Request,
    sensors: &Sensors,
    control: &Control,
) -> Result<Vec<Exits>, EngineError> {
    let mut curves = directions(engine, request, sensors, control)?;
    for exits in &mut curves {
        for side in [&mut exits.reflected, &mut exits.transmitted] {
            for (sensor, measured) in side.iter_mut().enumerate() {
                let projected_sr = sensors.projected_sr(sensor);
                measured.value /= projected_sr;
                measured.se /= projected_sr;
            }
        }
    }
    Ok(curves)
}

/// BRDF and BTDF, 1/sr, toward each of `views`: per thickness, illumination and wavelength, the last
/// running fastest. [`Exits::reflectance_factors`] and [`Exits::anisotropy_factors`] are derived from
/// them. Light that a thin slab transmits unscattered is spread over the views around the beam.
///
/// # Errors
/// See [`goniometer`].
pub fn views(
    engine: Engine,
    request: &Request,
    views: &Views,
    control: &Control,
) -> Result<Vec<Exits>, EngineError> {
    directions(engine, request, views, control)
}

/// The engine of [`view_factors`] in a database of `engine`.
#[must_use]
pub fn view_engine(engine: Engine, request: &Request) -> Engine {
    match engine {
        Engine::Hybrid => goniometer_engine(Engine::Auto, request),
        engine => goniometer_engine(engine, request),
    }
}

/// Factors toward each of `views` with `rays` walks for every curve: per thickness and
/// illumination, the last running fastest. They are scaled so that they add up to `spectra`, R and
/// T of the curves in the same order. Where too few walks leave on a side, the light there counts
/// as Lambertian, with a standard error of its value.
///
/// Random streams depend on the snowpack, the thickness and the illumination of the curve, not on
/// the other curves of `request`. `hybrid` does not compute azimuths, so that [`view_engine`] runs
/// instead. A curve is a unit of the checkpoint.
///
/// # Errors
/// See [`EngineError`].
///
/// # Panics
/// If there are fewer spectra than curves.
pub fn view_factors(
    engine: Engine,
    request: &Request,
    (views, rays): (&Views, u64),
    spectra: &[Spectrum],
    control: &Control,
) -> Result<Vec<ViewFactors>, EngineError> {
    let lights = request.illuminations.len();
    let curve = |number: usize| {
        let thickness_m = &request.thicknesses_m[number / lights..][..1];
        let light = &request.illuminations[number % lights..][..1];
        let cell = identity::with_light(identity::of_snowpack(request.snowpack), &light[0]);
        let request = Request {
            thicknesses_m: thickness_m,
            illuminations: light,
            rays,
            cell: identity::with_thickness(cell, thickness_m[0]),
            ..request.clone()
        };
        let name = format!("views {:x}", request.cell);
        if let Some(factors) = control.cache.units.take(&name) {
            return Ok(factors);
        }
        let factors = factors_of_curve(engine, &request, views, &spectra[number], control)?;
        control.cache.units.add(&name, &factors)?;
        Ok(factors)
    };
    let curves = request.thicknesses_m.len() * lights;
    (0..curves).map(curve).collect()
}

/// [`view_factors`] of a request with a single curve.
fn factors_of_curve(
    engine: Engine,
    request: &Request,
    views: &Views,
    spectrum: &Spectrum,
    control: &Control,
) -> Result<ViewFactors, EngineError> {
    let engine = view_engine(engine, request);
    let mut exits = match engine {
        Engine::Tabulated => {
            escapes::check(request)?;
            each(engine, true, request, control, &|scene| {
                escapes::run(scene, views)
            })?
        }
        _ => each(engine, true, request, control, &|scene| {
            counting::run(scene, views)
        })?,
    };
    let pairs = spectrum.reflectance.iter().zip(&spectrum.transmittance);
    for ((r, t), exits) in pairs.zip(&mut exits) {
        exits.normalise(*r, *t, |view| views.lambertian(view));
    }
    let by_view = |factors: fn(&Exits) -> Vec<Measured>| {
        let columns: Vec<_> = exits.iter().map(factors).collect();
        let rows = (0..views.len()).map(|view| columns.iter().map(move |column| column[view]));
        rows.flatten().collect()
    };
    Ok(ViewFactors {
        reflected: by_view(Exits::reflectance_factors),
        transmitted: by_view(Exits::transmittance_factors),
    })
}

/// The results of `bins`.
fn directions(
    engine: Engine,
    request: &Request,
    bins: &impl DirectionBins,
    control: &Control,
) -> Result<Vec<Exits>, EngineError> {
    let engine = goniometer_engine(engine, request);
    let curves = match engine {
        Engine::Tabulated => {
            escapes::check(request)?;
            let spectra = normal::spectra(request, control)?;
            let normalised = spectra.is_some();
            let mut curves = each(engine, normalised, request, control, &|scene| {
                escapes::run(scene, bins)
            })?;
            if let Some(spectra) = spectra {
                let mut remaining = curves.iter_mut();
                for spectrum in &spectra {
                    let pairs = spectrum.reflectance.iter().zip(&spectrum.transmittance);
                    for ((r, t), exits) in pairs.zip(&mut remaining) {
                        exits.normalise(*r, *t, |result| bins.lambertian(result));
                    }
                }
            }
            curves
        }
        Engine::Reference | Engine::Spectral => each(engine, false, request, control, &|scene| {
            counting::run(scene, bins)
        })?,
        engine => {
            return Err(EngineError::Unable {
                engine,
                quantity: "azimuths",
                instead: Engine::Tabulated,
            });
        }
    };
    Ok(curves)
}

/// Share of the incident power that leaves within each bin of `radii` about the
/// point where the light entered: per thickness, illumination and wavelength, the last
/// running fastest. `auto` uses `spectral`.
///
/// # Errors
/// [`EngineError::Unable`] for engines that use tables, which do not follow distances;
/// see [`EngineError`] for all others.
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
            quantity: "how far light travels along the surface",
            instead: Engine::Spectral,
        });
    }
    each(engine, false, request, control, &|scene| {
        counting::run(scene, radii)
    })
}

/// One snowpack of known thickness under one light.
struct ExitScene<'a> {
    engine: Engine,
    /// Whether the sums will be replaced by R and T of `hybrid`. The errors of the bins
    /// are then those of their shares.
    normalised: bool,
    request: &'a Request<'a>,
    control: &'a Control<'a>,
    snowpack: &'a Snowpack,
    substrate: &'a [SubstrateCoefficients],
    /// Position in the list of thicknesses, and the thickness in m.
    thickness: (usize, f64),
    /// Position in the list of illuminations.
    light: usize,
}

impl ExitScene<'_> {
    fn illumination(&self) -> Illumination {
        self.request.illuminations[self.light]
    }

    /// Whether the illumination is symmetric about the normal.
    fn is_axial(&self) -> bool {
        match self.illumination() {
            Illumination::Collimated { polar_angle_rad } => polar_angle_rad == 0.0,
            Illumination::Diffuse => true,
        }
    }
}

/// Calls `run` for all thicknesses and illuminations, and concatenates the results.
fn each(
    engine: Engine,
    normalised: bool,
    request: &Request,
    control: &Control,
    run: &dyn Fn(&ExitScene) -> Result<Vec<Exits>, EngineError>,
) -> Result<Vec<Exits>, EngineError> {
    let of_part = |part: &Request, control: &Control| each(engine, normalised, part, control, run);
    let kind = format!("exits {} {normalised}", engine.name());
    if let Some(parts) = divided::run(&kind, request, control, of_part)? {
        let mut parts: Vec<_> = parts.into_iter().map(Vec::into_iter).collect();
        let curves = request.thicknesses_m.len() * request.illuminations.len();
        let lengths: Vec<usize> = parts.iter().map(|part| part.len() / curves).collect();
        let rows = (0..curves).flat_map(|_| {
            let parts = parts.iter_mut().zip(&lengths);
            parts
                .flat_map(|(part, length)| part.take(*length).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        });
        return Ok(rows.collect());
    }
    // the walks are valid for any snowpack for which `spectral` is valid
    Engine::Spectral.check(request)?;
    let engine_below = match engine {
        Engine::Reference => Engine::Reference,
        _ => Engine::Spectral,
    };
    let (substrate, top) = substrate::lower_boundary(engine_below, request, control)?;
    let (snowpack, thicknesses_m) = match &top {
        Some((snowpack, thicknesses_m)) => (snowpack, thicknesses_m.as_slice()),
        None => (request.snowpack, request.thicknesses_m),
    };
    let mut curves = Vec::new();
    for thickness in thicknesses_m.iter().copied().enumerate() {
        for light in 0..request.illuminations.len() {
            let scene = ExitScene {
                engine,
                normalised,
                request,
                control,
                snowpack,
                substrate: &substrate,
                thickness,
                light,
            };
            curves.extend(run(&scene)?);
        }
    }
    Ok(curves)
}

/// How close index nodes are; `is_shares` says whether walks give only the shares of directions.
fn spacing(is_shares: bool) -> Spacing {
    if is_shares {
        Spacing::COARSE
    } else {
        Spacing::FINE
    }
}

/// Exits at every wavelength, interpolated between index nodes. `walk` does the walks
/// at one index node and scores them at the wavelengths of the node's span.
fn at_nodes(
    scene: &ExitScene,
    walk: impl Fn(IndexNode) -> Result<Vec<Exits>, EngineError>,
) -> Result<Vec<Exits>, EngineError> {
    let (indices, wet) = (indices(scene.request)?, scene.request.snowpack.is_wet());
    let spacing = spacing(scene.normalised && scene.engine == Engine::Tabulated);
    let positions = nodes(&indices, wet, spacing);
    let (nodes, mixes) = mixes(&indices, wet, spacing);
    let mut node_exits = Vec::new();
    for (number, indices) in nodes.into_iter().enumerate() {
        // the span of a node reaches from the node before it to the node after it
        let last = positions[(number + 1).min(positions.len() - 1)];
        let span = positions[number.saturating_sub(1)]..last + 1;
        let first = span.start;
        let exits = walk(IndexNode {
            number,
            indices,
            span,
        })?;
        node_exits.push((first, exits));
    }
    let mixed = mixes.iter().enumerate().map(|(l, mix)| {
        let [a, b] = mix.nodes.map(|node| {
            let (first, exits) = &node_exits[node];
            &exits[l - first]
        });
        if mix.nodes[0] == mix.nodes[1] {
            a.clone()
        } else {
            a.mix(b, mix.share)
        }
    });
    Ok(mixed.collect())
}

/// An index node: a pair of refractive indices at which rays are walked.
struct IndexNode {
    number: usize,
    /// Refractive indices of ice and water.
    indices: (Index, Index),
    /// Positions of the wavelengths that use this node.
    span: Range<usize>,
}
