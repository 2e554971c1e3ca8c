//! The substrate under a snowpack, and cascades, in which every layer is a separate
//! slab.
//!
//! Light is reflected back and forth between a Lambertian substrate of reflectance rho
//! and the snowpack. With R0 and T0 of the snowpack over a black substrate, and R' and
//! T' of the same snowpack lit from below by isotropic radiance,
//! R = R0 + T0 rho T' / (1 - rho R') and T = tau T0 / (1 - rho R'), where
//! tau = 1 - rho is the share that stays in the substrate. `reference` walks these
//! reflections instead.
//!
//! In a cascade (Varsa 2025, section 4.4), each layer lies on a substrate with the
//! reflectance and transmittance, at normal incidence, of everything below the layer.
use super::{Control, Engine, EngineError, Request, hybrid, identity, reference, spectral};
use crate::engine::spectral::GrainEvents;
use crate::measurement::{Measured, Spectrum};
use crate::transport::{Illumination, Joining, Layer, Snowpack, Substrate};

const NORMAL: Illumination = Illumination::Collimated {
    polar_angle_rad: 0.0,
};
/// Bits that are flipped in a request's cell to get the cells of auxiliary requests,
/// so that their random streams differ from all others.
const FROM_BELOW: u64 = 1 << 62;
const LOWER_LAYER: u64 = 1 << 54;

/// Reflectance and transmittance of the substrate at one wavelength.
#[derive(Debug, Clone, Copy)]
pub(super) struct SubstrateCoefficients {
    /// Share of the light that is reflected.
    pub(super) reflectance: Measured,
    /// Share of the light that counts as transmitted.
    pub(super) transmittance: Measured,
}

/// Coefficients of the substrate of `request`, per wavelength.
pub(super) fn substrate_coefficients(
    request: &Request,
) -> Result<Vec<SubstrateCoefficients>, EngineError> {
    let exact = |value| Measured { value, se: 0.0 };
    let coefficients_at = |nm: &f64| match (
        request.snowpack.substrate.reflectance(*nm),
        &request.snowpack.substrate,
    ) {
        (None, Substrate::Spectrum { table, .. }) => Err(EngineError::Substrate {
            wavelength_nm: *nm,
            min_nm: table.range().0,
            max_nm: table.range().1,
        }),
        (reflectance, _) => Ok(SubstrateCoefficients {
            reflectance: exact(reflectance.unwrap_or(0.0)),
            transmittance: exact(1.0 - reflectance.unwrap_or(0.0)),
        }),
    };
    request.wavelengths_nm.iter().map(coefficients_at).collect()
}

/// Whether the snowpack is a cascade of several layers.
pub(super) fn is_cascade(request: &Request) -> bool {
    request.model.joining == Joining::Cascade && !request.snowpack.below.is_empty()
}

/// Runs `engine`, which is not `auto`.
pub(super) fn run(
    engine: Engine,
    request: &Request,
    control: &Control,
) -> Result<Vec<Spectrum>, EngineError> {
    match lower_boundary(engine, request, control)? {
        (substrate, None) => over(engine, request, &substrate, control),
        (substrate, Some((snowpack, thicknesses_m))) => {
            let request = Request {
                snowpack: &snowpack,
                thicknesses_m: &thicknesses_m,
                ..request.clone()
            };
            over(engine, &request, &substrate, control)
        }
    }
}

/// Coefficients of the substrate per wavelength and, in a cascade, the surface layer
/// that lies on it, with its thicknesses in m.
pub(super) type LowerBoundary = (Vec<SubstrateCoefficients>, Option<(Snowpack, Vec<f64>)>);

/// The lower boundary of `request`; `engine` computes the lower layers of a cascade.
pub(super) fn lower_boundary(
    engine: Engine,
    request: &Request,
    control: &Control,
) -> Result<LowerBoundary, EngineError> {
    let mut substrate = substrate_coefficients(request)?;
    if !is_cascade(request) {
        return Ok((substrate, None));
    }
    for (i, layer) in request.snowpack.below.iter().enumerate().rev() {
        let snowpack = layer.snow.clone().into();
        let request = lower_layer_request(request, &snowpack, layer, i);
        let spectra = over(engine, &request, &substrate, control)?;
        let as_substrate = |spectrum: &Spectrum| -> Vec<SubstrateCoefficients> {
            let pairs = spectrum.reflectance.iter().zip(&spectrum.transmittance);
            let coefficients = |(r, t): (&Measured, &Measured)| SubstrateCoefficients {
                reflectance: *r,
                transmittance: *t,
            };
            pairs.map(coefficients).collect()
        };
        substrate = spectra.iter().flat_map(as_substrate).collect();
    }
    Ok((substrate, Some(surface_layer(request))))
}

/// The request for the `i`-th layer under the surface layer of a cascade.
fn lower_layer_request<'a>(
    request: &Request<'a>,
    snowpack: &'a Snowpack,
    layer: &'a Layer,
    i: usize,
) -> Request<'a> {
    Request {
        snowpack,
        thicknesses_m: std::slice::from_ref(&layer.thickness_m),
        illuminations: &[NORMAL],
        cell: request.cell ^ LOWER_LAYER.wrapping_mul(i as u64 + 1),
        ..request.clone()
    }
}

/// The surface layer of a cascade and its thicknesses, m.
fn surface_layer(request: &Request) -> (Snowpack, Vec<f64>) {
    let below_m = request.snowpack.below_m();
    let thicknesses_m = request.thicknesses_m.iter().map(|h| h - below_m);
    let snowpack = request.snowpack.surface.clone().into();
    (snowpack, thicknesses_m.collect())
}

/// Runs `engine` for the snowpack of `request` over `substrate`.
fn over(
    engine: Engine,
    request: &Request,
    substrate: &[SubstrateCoefficients],
    control: &Control,
) -> Result<Vec<Spectrum>, EngineError> {
    if engine == Engine::Reference {
        return reference::run(request, substrate, control);
    }
    let thicknesses = request.thicknesses_m.len();
    let (mut spectra, from_below) = if substrate.iter().all(|g| g.reflectance.value == 0.0) {
        (
            bare(engine, request, control)?,
            vec![Spectrum::default(); thicknesses],
        )
    } else if request.snowpack.below.is_empty() {
        // a homogeneous slab is symmetric: diffuse light from above gives R' and T'
        let lights = with_diffuse(request);
        let request = Request {
            illuminations: &lights,
            ..request.clone()
        };
        let mut spectra = bare(engine, &request, control)?;
        let from_below = spectra.iter().skip(lights.len() - 1).step_by(lights.len());
        let from_below = from_below.cloned().collect();
        let mut number = 0;
        spectra.retain(|_| {
            number += 1;
            number % lights.len() != 0
        });
        (spectra, from_below)
    } else {
        let spectrum_from_below = |h: usize| {
            let (snowpack, thickness_m) = flipped(request, h);
            let request = from_below_request(request, &snowpack, &thickness_m);
            Ok(bare(engine, &request, control)?.pop().unwrap_or_default())
        };
        let from_below = (0..thicknesses)
            .map(spectrum_from_below)
            .collect::<Result<_, EngineError>>()?;
        (bare(engine, request, control)?, from_below)
    };
    let lights = request.illuminations.len();
    for (i, spectrum) in spectra.iter_mut().enumerate() {
        put_on_substrate(spectrum, &from_below[i / lights], substrate);
    }
    Ok(spectra)
}

/// The illuminations of `request`, followed by diffuse illumination.
fn with_diffuse(request: &Request) -> Vec<Illumination> {
    let lights = request.illuminations.iter().copied();
    lights.chain([Illumination::Diffuse]).collect()
}

/// The snowpack of the `h`-th thickness upside down.
pub(super) fn flipped(request: &Request, h: usize) -> (Snowpack, f64) {
    let thickness_m = request.thicknesses_m[h];
    let mut layers = request.snowpack.layers(thickness_m);
    layers.reverse();
    let snowpack = Snowpack::of(&layers, Substrate::Black).map(|(snowpack, _)| snowpack);
    // a snowpack has at least one layer
    (
        snowpack.unwrap_or_else(|| request.snowpack.clone()),
        thickness_m,
    )
}

/// The request for the flipped `snowpack` under diffuse illumination.
pub(super) fn from_below_request<'a>(
    request: &Request<'a>,
    snowpack: &'a Snowpack,
    thickness_m: &'a f64,
) -> Request<'a> {
    Request {
        snowpack,
        thicknesses_m: std::slice::from_ref(thickness_m),
        illuminations: &[Illumination::Diffuse],
        cell: identity::with_thickness(request.cell, *thickness_m) ^ FROM_BELOW,
        ..request.clone()
    }
}

/// Runs `engine` for the snowpack of `request` over a black substrate.
fn bare(
    engine: Engine,
    request: &Request,
    control: &Control,
) -> Result<Vec<Spectrum>, EngineError> {
    match engine {
        Engine::Spectral => spectral::run(request, control, GrainEvents::Traced),
        Engine::Tabulated => spectral::run(request, control, GrainEvents::Tabulated),
        _ => hybrid::run(request, control),
    }
}

/// Puts a snowpack on `substrate`. On input, `spectrum` is that over a black substrate;
/// on output, that over `substrate`. `from_below` is the spectrum under isotropic
/// radiance from below. All errors are taken as independent; if those of R0 and T0
/// are correlated, the correlation is negative.
fn put_on_substrate(
    spectrum: &mut Spectrum,
    from_below: &Spectrum,
    substrate: &[SubstrateCoefficients],
) {
    for (l, coefficients) in substrate.iter().enumerate() {
        let (rho, tau) = (coefficients.reflectance, coefficients.transmittance);
        let (r, t) = (&mut spectrum.reflectance[l], &mut spectrum.transmittance[l]);
        let none = Measured::default();
        let value_at = |values: &[Measured]| values.get(l).copied().unwrap_or(none);
        let (r1, t1) = (
            value_at(&from_below.reflectance),
            value_at(&from_below.transmittance),
        );
        let gain = 1.0 / (1.0 - rho.value * r1.value);
        let arrived = t.value * gain;
        let returned = rho.value * t1.value;
        let se = |terms: [f64; 5]| terms.iter().map(|term| term * term).sum::<f64>().sqrt();
        let reflected_se = se([
            r.se,
            gain * returned * t.se,
            arrived * gain * t1.value * rho.se,
            arrived * rho.value * t1.se,
            arrived * gain * rho.value * returned * r1.se,
        ]);
        let transmitted_se = se([
            tau.value * gain * t.se,
            arrived * tau.se,
            tau.value * arrived * gain * r1.value * rho.se,
            tau.value * arrived * gain * rho.value * r1.se,
            0.0,
        ]);
        *r = Measured {
            value: r.value + arrived * returned,
            se: reflected_se,
        };
        *t = Measured {
            value: tau.value * arrived,
            se: transmitted_se,
        };
    }
}

/// Number of walks that [`run`] does.
pub(super) fn walks(engine: Engine, request: &Request) -> Result<u64, EngineError> {
    let is_black = substrate_coefficients(request)?
        .iter()
        .all(|g| g.reflectance.value == 0.0);
    if !is_cascade(request) {
        return walks_over(engine, request, is_black);
    }
    let mut sum = 0_u64;
    for (i, layer) in request.snowpack.below.iter().enumerate().rev() {
        let snowpack = layer.snow.clone().into();
        let is_last = i + 1 == request.snowpack.below.len();
        let request = lower_layer_request(request, &snowpack, layer, i);
        sum = sum.saturating_add(walks_over(engine, &request, is_black && is_last)?);
    }
    let (snowpack, thicknesses_m) = surface_layer(request);
    let request = Request {
        snowpack: &snowpack,
        thicknesses_m: &thicknesses_m,
        ..request.clone()
    };
    Ok(sum.saturating_add(walks_over(engine, &request, false)?))
}

/// Number of walks for the snowpack of `request` over a substrate that is black or not.
fn walks_over(engine: Engine, request: &Request, is_black: bool) -> Result<u64, EngineError> {
    if is_black || engine == Engine::Reference {
        return engine.walks_bare(request);
    }
    if request.snowpack.below.is_empty() {
        let lights = with_diffuse(request);
        return engine.walks_bare(&Request {
            illuminations: &lights,
            ..request.clone()
        });
    }
    let mut sum = engine.walks_bare(request)?;
    for h in 0..request.thicknesses_m.len() {
        let (snowpack, thickness_m) = flipped(request, h);
        let request = from_below_request(request, &snowpack, &thickness_m);
        sum = sum.saturating_add(engine.walks_bare(&request)?);
    }
    Ok(sum)
}
