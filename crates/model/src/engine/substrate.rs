//! The substrate under a snowpack, and snowpacks of layers that are slabs of their own.
//!
//! A Lambertian substrate of reflectance rho sends light back and forth between
//! itself and the snowpack: with R0 and T0 of the snowpack over black substrate, and R'
//! and T' of the same snowpack lit from below by isotropic radiance,
//! R = R0 + T0 rho T' / (1 - rho R') and T = tau T0 / (1 - rho R'), where
//! tau = 1 - rho is what stays in the substrate. `reference` walks it instead.
//!
//! In a cascade (Varsa 2025, section 4.4) a layer lies on a substrate with the
//! reflectance and transmittance, at normal incidence, of all below it.
use super::{Control, Engine, EngineError, Request, hybrid, identity, reference, spectral};
use crate::engine::spectral::Grains;
use crate::measurement::{Measured, Spectrum};
use crate::transport::{Illumination, Joining, Layer, Snowpack, Substrate};

const NORMAL: Illumination = Illumination::Collimated {
    polar_angle_rad: 0.0,
};
/// Keep cells of what is computed beside a request from all others.
const FROM_BELOW: u64 = 1 << 62;
const LOWER_LAYER: u64 = 1 << 54;

/// What becomes of light that arrives at the substrate, at one wavelength.
#[derive(Debug, Clone, Copy)]
pub(super) struct SubstrateCoefficients {
    /// Share that comes back.
    pub(super) reflectance: Measured,
    /// Share that counts as transmitted.
    pub(super) transmittance: Measured,
}

/// Those of the substrate of `request`, per wavelength.
fn substrate_coefficients(request: &Request) -> Result<Vec<SubstrateCoefficients>, EngineError> {
    let exact = |value| Measured { value, se: 0.0 };
    let at = |nm: &f64| match (
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
    request.wavelengths_nm.iter().map(at).collect()
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

/// The substrate that light meets, per wavelength, and in a cascade the snowpack on it
/// with its thicknesses: the surface layer.
pub(super) type LowerBoundary = (Vec<SubstrateCoefficients>, Option<(Snowpack, Vec<f64>)>);

/// What light meets in `request`; `engine` computes the layers below a cascade's.
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
        let request = lower(request, &snowpack, layer, i);
        let spectra = over(engine, &request, &substrate, control)?;
        let of = |spectrum: &Spectrum| -> Vec<SubstrateCoefficients> {
            let pairs = spectrum.reflectance.iter().zip(&spectrum.transmittance);
            let coefficients = |(r, t): (&Measured, &Measured)| SubstrateCoefficients {
                reflectance: *r,
                transmittance: *t,
            };
            pairs.map(coefficients).collect()
        };
        substrate = spectra.iter().flat_map(of).collect();
    }
    Ok((substrate, Some(top(request))))
}

/// What is asked of the `i`-th layer under the surface in a cascade.
fn lower<'a>(
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

/// The surface layer of a cascade and its thicknesses.
fn top(request: &Request) -> (Snowpack, Vec<f64>) {
    let below_m = request.snowpack.below_m();
    let left = request.thicknesses_m.iter().map(|h| h - below_m);
    (request.snowpack.surface.clone().into(), left.collect())
}

/// Runs `engine` for a snowpack over this substrate.
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
        // a homogeneous slab is the same from below
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
        let below = |h: usize| {
            let (snowpack, thickness_m) = flipped(request, h);
            let request = from_below(request, &snowpack, &thickness_m);
            Ok(bare(engine, &request, control)?.pop().unwrap_or_default())
        };
        let from_below = (0..thicknesses)
            .map(below)
            .collect::<Result<_, EngineError>>()?;
        (bare(engine, request, control)?, from_below)
    };
    let lights = request.illuminations.len();
    for (i, spectrum) in spectra.iter_mut().enumerate() {
        on_substrate(spectrum, &from_below[i / lights], substrate);
    }
    Ok(spectra)
}

/// The lights of `request`, and isotropic radiance.
fn with_diffuse(request: &Request) -> Vec<Illumination> {
    let lights = request.illuminations.iter().copied();
    lights.chain([Illumination::Diffuse]).collect()
}

/// The snowpack of the `h`-th thickness upside down.
fn flipped(request: &Request, h: usize) -> (Snowpack, f64) {
    let thickness_m = request.thicknesses_m[h];
    let mut layers = request.snowpack.layers(thickness_m);
    layers.reverse();
    let snowpack = Snowpack::of(&layers, Substrate::Black).map(|(snowpack, _)| snowpack);
    // a snowpack has a layer at least
    (
        snowpack.unwrap_or_else(|| request.snowpack.clone()),
        thickness_m,
    )
}

/// What is asked of it.
fn from_below<'a>(
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

/// Runs `engine` for a snowpack over black substrate.
fn bare(
    engine: Engine,
    request: &Request,
    control: &Control,
) -> Result<Vec<Spectrum>, EngineError> {
    match engine {
        Engine::Spectral => spectral::run(request, control, Grains::Followed),
        Engine::Tabulated => spectral::run(request, control, Grains::Tabulated),
        _ => hybrid::run(request, control),
    }
}

/// Puts a snowpack with `spectrum` over black substrate, and `from_below` under
/// isotropic light from there, on this substrate. Errors are taken as independent;
/// those of R0 and T0, if not, lean against each other.
fn on_substrate(
    spectrum: &mut Spectrum,
    from_below: &Spectrum,
    substrate: &[SubstrateCoefficients],
) {
    for (l, coefficients) in substrate.iter().enumerate() {
        let (rho, tau) = (coefficients.reflectance, coefficients.transmittance);
        let (r, t) = (&mut spectrum.reflectance[l], &mut spectrum.transmittance[l]);
        let none = Measured::default();
        let back = |all: &[Measured]| all.get(l).copied().unwrap_or(none);
        let (r1, t1) = (
            back(&from_below.reflectance),
            back(&from_below.transmittance),
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

/// How many walks [`run`] does.
pub(super) fn walks(engine: Engine, request: &Request) -> Result<u64, EngineError> {
    let black = substrate_coefficients(request)?
        .iter()
        .all(|g| g.reflectance.value == 0.0);
    if !is_cascade(request) {
        return walks_over(engine, request, black);
    }
    let mut sum = 0_u64;
    for (i, layer) in request.snowpack.below.iter().enumerate().rev() {
        let snowpack = layer.snow.clone().into();
        let last = i + 1 == request.snowpack.below.len();
        let request = lower(request, &snowpack, layer, i);
        sum = sum.saturating_add(walks_over(engine, &request, black && last)?);
    }
    let (snowpack, thicknesses_m) = top(request);
    let request = Request {
        snowpack: &snowpack,
        thicknesses_m: &thicknesses_m,
        ..request.clone()
    };
    Ok(sum.saturating_add(walks_over(engine, &request, false)?))
}

fn walks_over(engine: Engine, request: &Request, black: bool) -> Result<u64, EngineError> {
    if black || engine == Engine::Reference {
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
        let request = from_below(request, &snowpack, &thickness_m);
        sum = sum.saturating_add(engine.walks_bare(&request)?);
    }
    Ok(sum)
}
