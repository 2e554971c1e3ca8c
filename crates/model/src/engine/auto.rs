//! `auto`: the cheapest engine whose error is within what the user allows.
//!
//! An engine's error has two parts. The systematic error of its method, found by
//! comparison with converged walks (docs/stability.md), does not depend on the
//! number of walks. The noise falls with the square root of that number. `auto`
//! takes the cheapest engine that accepts the request and whose systematic error
//! is below the error allowed. It then does enough walks to keep the noise within
//! the rest of the error allowed.
//!
//! The choice is made for each illumination separately, from the snow, the
//! wavelengths and the error allowed. Other illuminations and thicknesses in the
//! request do not affect it, so a database that grows keeps its spectra.
use super::{Control, Engine, EngineError, Request, identity};
use crate::measurement::Spectrum;
use crate::transport::{Illumination, Snow};

/// Error allowed in a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaxError {
    /// Delta-E*ab (CIE 1976) from the true spectrum, D65, 2 degree observer.
    pub delta_e: f64,
    /// Root-mean-square error of reflectance or transmittance over the
    /// wavelengths of a spectrum, one standard error.
    pub rmse: f64,
}

/// Start of the near infrared, nm. Beyond it snow absorbs so much that light
/// hardly spreads.
pub const NEAR_INFRARED_NM: f64 = 780.0;
/// Standard deviation per walk: in `hybrid`, for one illumination and many walks, in 1 cm of coarse
/// snow (docs/performance.md), more than in most snow; and an upper bound in the other engines, whose
/// walks score at most 1.
const NOISE: [f64; 2] = [0.058, 0.5];
/// Number of walks of `hybrid` at which the variance is twice what [`NOISE`] gives: fewer
/// walks cover the states of rays less evenly.
const UNEVEN_WALKS: f64 = 2500.0;

/// The engines that `auto` chooses from, the cheapest first, with their systematic
/// errors: Delta-E, RMSE in the visible, RMSE in the near infrared.
const CANDIDATES: [(Engine, [f64; 3]); 3] = [
    (Engine::Hybrid, [0.1, 3.5e-4, 1.5e-3]),
    (Engine::Tabulated, [0.05, 2e-4, 3e-4]),
    (Engine::Spectral, [0.0; 3]),
];

/// [`MaxError::default_for`] for visible wavelengths.
impl Default for MaxError {
    fn default() -> Self {
        Self::default_for(&[])
    }
}

/// Ratios above which the error of `hybrid` is up to [`CROWDED_ERROR`]: largest to
/// smallest grain length, and largest grain length to mean free distance.
const CROWDING_LIMITS: [f64; 2] = [4.0, 1.9];
/// Error of R and T of `hybrid` above [`CROWDING_LIMITS`] (docs/stability.md).
const CROWDED_ERROR: f64 = 7e-3;

/// Systematic error of an engine for the snow of `request`: Delta-E, RMSE in the
/// visible, RMSE in the near infrared. `errors` are those from [`CANDIDATES`].
fn systematic_error(engine: Engine, errors: [f64; 3], request: &Request) -> [f64; 3] {
    let largest =
        |ratio: &dyn Fn(&Snow) -> f64| request.snowpack.snows().map(ratio).fold(0.0, f64::max);
    let ratios = [
        largest(&|snow| snow.sizes_m()[1] / snow.sizes_m()[0]),
        largest(&|snow| snow.sizes_m()[1] / snow.mean_free_distance_m()),
    ];
    let is_crowded = ratios
        .iter()
        .zip(CROWDING_LIMITS)
        .any(|(value, limit)| *value > limit);
    match (engine, errors) {
        (Engine::Hybrid, [delta_e, ..]) if is_crowded => [delta_e, CROWDED_ERROR, CROWDED_ERROR],
        _ => errors,
    }
}

/// [`systematic_error`] of an engine; `reference` has none, as it is the model itself.
pub(super) fn systematic_error_of(engine: Engine, request: &Request) -> [f64; 3] {
    let mut candidates = CANDIDATES.into_iter();
    let errors = candidates.find_map(|(other, errors)| (other == engine).then_some(errors));
    systematic_error(engine, errors.unwrap_or_default(), request)
}

/// Implements [`Engine::noise_allowed`].
pub(super) fn noise_allowed(engine: Engine, request: &Request) -> Result<f64, EngineError> {
    let noise = |engine| {
        let systematic = systematic_error_of(engine, request);
        request
            .max_error
            .allowed_noise(systematic, request.wavelengths_nm)
    };
    noise(engine).ok_or_else(|| {
        let others = CANDIDATES.map(|(other, _)| other);
        EngineError::Inaccurate {
            engine,
            max_error: request.max_error,
            instead: others
                .into_iter()
                .find(|other| noise(*other).is_some())
                .unwrap_or(Engine::Reference),
        }
    })
}

impl MaxError {
    /// Default error allowed: a Delta-E of 0.3, which is not visible, and an RMSE
    /// that `hybrid` meets at these wavelengths.
    #[must_use]
    pub fn default_for(wavelengths_nm: &[f64]) -> Self {
        let has_infrared = wavelengths_nm.iter().any(|nm| *nm > NEAR_INFRARED_NM);
        Self {
            delta_e: 0.3,
            rmse: if has_infrared { 2e-3 } else { 6e-4 },
        }
    }

    /// Number of walks with which the total error of `hybrid` is within this one.
    #[must_use]
    pub fn rays(&self, wavelengths_nm: &[f64]) -> u64 {
        let (_, errors) = CANDIDATES[0];
        let noise = self
            .allowed_noise(errors, wavelengths_nm)
            .unwrap_or(self.rmse);
        // noise^2 = NOISE^2 / walks (1 + UNEVEN_WALKS / walks)
        let half = 0.5 * (NOISE[0] / noise).powi(2);
        let walks = half + (half * (half + 2.0 * UNEVEN_WALKS)).sqrt();
        let walks = walks.ceil() as u64;
        // a round number, at most an eighth more
        let step = (walks.next_power_of_two() / 16).max(1);
        walks.div_ceil(step).saturating_mul(step)
    }

    /// Noise (RMSE) allowed in addition to the systematic error of an engine;
    /// `None` if the systematic error alone is too large.
    fn allowed_noise(
        &self,
        [delta_e, visible, infrared]: [f64; 3],
        wavelengths_nm: &[f64],
    ) -> Option<f64> {
        let has_infrared = wavelengths_nm.iter().any(|nm| *nm > NEAR_INFRARED_NM);
        let systematic = if has_infrared { infrared } else { visible };
        let noise = (self.rmse * self.rmse - systematic * systematic)
            .max(0.0)
            .sqrt();
        (delta_e <= self.delta_e && systematic < self.rmse).then_some(noise)
    }
}

/// The engine for `request` under `light` and its number of walks. `hybrid` does
/// the number in the request. The other engines do as many walks as the noise
/// allowed requires, but no more than would give the noise of `hybrid`.
pub(super) fn choose(request: &Request, light: &Illumination) -> (Engine, u64) {
    let accepted = |(engine, errors): (Engine, [f64; 3])| {
        let systematic = systematic_error(engine, errors, request);
        let noise = request
            .max_error
            .allowed_noise(systematic, request.wavelengths_nm)?;
        let rays = match engine {
            Engine::Hybrid => request.rays,
            _ => {
                let as_hybrid = request.rays as f64 * (NOISE[1] / NOISE[0]).powi(2);
                (NOISE[1] / noise).powi(2).min(as_hybrid).ceil() as u64
            }
        };
        let request = Request {
            rays,
            // the limits on thickness are the same in all engines
            thicknesses_m: &[],
            illuminations: std::slice::from_ref(light),
            ..request.clone()
        };
        engine.check(&request).is_ok().then_some((engine, rays))
    };
    let choice = CANDIDATES.into_iter().find_map(accepted);
    choice.unwrap_or((Engine::Spectral, request.rays))
}

/// The illuminations of a request that one engine computes.
struct EngineShare {
    engine: Engine,
    rays: u64,
    cell: u64,
    /// Positions in the request's list of illuminations.
    lights: Vec<usize>,
    illuminations: Vec<Illumination>,
}

/// Splits `request` by engine. All illuminations that `hybrid` computes form one
/// share, because `hybrid` gives them separate random streams; every other
/// illumination is a share of its own.
fn shares(request: &Request) -> Vec<EngineShare> {
    let mut shares: Vec<EngineShare> = Vec::new();
    for (i, light) in request.illuminations.iter().enumerate() {
        let (engine, rays) = choose(request, light);
        let is_hybrid = |share: &&mut EngineShare| share.engine == Engine::Hybrid;
        match shares.iter_mut().find(is_hybrid) {
            Some(share) if engine == Engine::Hybrid => {
                share.lights.push(i);
                share.illuminations.push(*light);
            }
            _ => shares.push(EngineShare {
                engine,
                rays,
                cell: match engine {
                    Engine::Hybrid => request.cell,
                    _ => identity::with_light(request.cell, light),
                },
                lights: vec![i],
                illuminations: vec![*light],
            }),
        }
    }
    shares
}

impl EngineShare {
    /// The request for this share of `request`.
    fn request<'a>(&'a self, request: &Request<'a>) -> Request<'a> {
        Request {
            rays: self.rays,
            cell: self.cell,
            illuminations: &self.illuminations,
            ..request.clone()
        }
    }
}

/// Implements [`Engine::run_unchecked`].
pub(super) fn run(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let lights = request.illuminations.len();
    let mut spectra = vec![Spectrum::default(); request.thicknesses_m.len() * lights];
    for share in shares(request) {
        let computed = share
            .engine
            .run_unchecked(&share.request(request), control)?;
        for (i, spectrum) in computed.into_iter().enumerate() {
            let (h, light) = (i / share.lights.len(), i % share.lights.len());
            spectra[h * lights + share.lights[light]] = spectrum;
        }
    }
    Ok(spectra)
}

/// Implements [`Engine::walks`].
pub(super) fn walks(request: &Request) -> Result<u64, EngineError> {
    let mut walks = 0_u64;
    for share in shares(request) {
        walks = walks.saturating_add(share.engine.walks(&share.request(request))?);
    }
    Ok(walks)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::engine::Resolution;
    use crate::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
    use crate::transport::Model;

    fn chosen(size_um: [f64; 2], angle_deg: f64, rmse: f64, nm: f64) -> (Engine, u64) {
        let grain = GrainType {
            size: SizeRange::new(size_um[0] * 1e-6, size_um[1] * 1e-6).unwrap(),
            facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
            shape: Shape::Spheroid,
            proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        };
        let snowpack = Snow::dry(grain, 275.0, -1.0).into();
        let delta_e = 0.3;
        let light = Illumination::Collimated {
            polar_angle_rad: angle_deg.to_radians(),
        };
        let request = Request {
            snowpack: &snowpack,
            thicknesses_m: &[0.1],
            illuminations: &[light],
            wavelengths_nm: &[nm],
            model: &Model::default(),
            rays: 1 << 17,
            max_error: MaxError { delta_e, rmse },
            resolution: Resolution::default(),
            seed: 1,
            cell: 0,
        };
        choose(&request, &light)
    }

    #[test]
    fn the_cheapest_valid_engine_is_chosen() {
        let usual = [300.0, 750.0];
        assert_eq!(chosen(usual, 0.0, 6e-4, 550.0).0, Engine::Hybrid);
        // the systematic error leaves no room for noise
        assert_eq!(chosen(usual, 0.0, 3e-4, 550.0).0, Engine::Tabulated);
        assert_eq!(chosen(usual, 0.0, 1e-4, 550.0).0, Engine::Spectral);
        assert_eq!(chosen(usual, 0.0, 1e-3, 1030.0).0, Engine::Tabulated);
        assert_eq!(chosen(usual, 0.0, 2e-3, 1030.0).0, Engine::Hybrid);
        // crowded grains
        let (engine, rays) = chosen([50.0, 3000.0], 0.0, 2e-3, 550.0);
        assert_eq!(engine, Engine::Tabulated);
        assert!((0.5 / (rays as f64).sqrt() - 2e-3).abs() < 2e-5, "{rays}");
        assert_eq!(chosen([50.0, 3000.0], 0.0, 1e-2, 550.0).0, Engine::Hybrid);
        // hardly any grain of the table fits under the surface
        assert_eq!(chosen(usual, 89.97, 6e-4, 550.0).0, Engine::Spectral);
    }
}
