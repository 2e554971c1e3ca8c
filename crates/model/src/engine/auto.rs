//! `auto`: the cheapest engine whose error is within what the user allows.
//!
//! An engine's error has two parts. Its method's own, from comparison with
//! converged walks (docs/stability.md), does not depend on the number of
//! walks; its noise falls with their square root. `auto` takes the cheapest
//! engine that accepts the request and whose own error leaves room for noise,
//! with as many walks as keep the noise within that room.
//!
//! It chooses for each light by itself, from the snow, the wavelengths and the
//! error allowed: what else is asked for, be it other lights or thicknesses, has
//! no say, and a database that grows keeps the spectra it has.
use super::{Control, Engine, EngineError, Request, identity};
use crate::measurement::Spectrum;
use crate::transport::{Illumination, Snow};

/// What error of a spectrum is allowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaxError {
    /// Delta-E*ab (CIE 1976) from the true spectrum, D65, 2 degree observer.
    pub delta_e: f64,
    /// Root-mean-square error of reflectance or transmittance over the
    /// wavelengths of a spectrum, one standard error.
    pub rmse: f64,
}

/// From here on, nm, snow absorbs so much that light hardly spreads.
const NEAR_INFRARED_NM: f64 = 780.0;
/// Noise of a value from one walk, at most: from one light in `hybrid`, whose
/// walks follow a lattice, and of a walk that leaves or not in the others.
const NOISE: [f64; 2] = [0.12, 0.5];

/// The engines that `auto` chooses from, the cheapest first, with their own
/// errors: Delta-E, RMSE in the visible and in the near infrared.
const CANDIDATES: [(Engine, [f64; 3]); 3] = [
    (Engine::Hybrid, [0.1, 3.5e-4, 1.5e-3]),
    (Engine::Tabulated, [0.05, 2e-4, 3e-4]),
    (Engine::Spectral, [0.0; 3]),
];

/// [`MaxError::usual`] in the visible.
impl Default for MaxError {
    fn default() -> Self {
        Self::usual(&[])
    }
}

/// Grains of so different length, largest over smallest, or so close together,
/// largest over mean free distance, that `hybrid` is off by up to
/// [`CROWDED`].
const CROWDS: [f64; 2] = [4.0, 1.9];
/// Error of R and T of `hybrid` there (docs/stability.md).
const CROWDED: f64 = 7e-3;

/// Delta-E and RMSE, in the visible and in the near infrared, of an engine by
/// itself for this snow.
fn own(engine: Engine, errors: [f64; 3], request: &Request) -> [f64; 3] {
    let most = |of: &dyn Fn(&Snow) -> f64| request.snowpack.snows().map(of).fold(0.0, f64::max);
    let crowds = [
        most(&|snow| snow.sizes_m()[1] / snow.sizes_m()[0]),
        most(&|snow| snow.sizes_m()[1] / snow.mean_free_distance_m()),
    ];
    let crowded = crowds
        .iter()
        .zip(CROWDS)
        .any(|(value, limit)| *value > limit);
    match (engine, errors) {
        (Engine::Hybrid, [delta_e, ..]) if crowded => [delta_e, CROWDED, CROWDED],
        _ => errors,
    }
}

impl MaxError {
    /// What is asked for where the user names nothing: 0.3 in Delta-E, which
    /// nobody sees, and an RMSE that `hybrid` holds at these wavelengths.
    #[must_use]
    pub fn usual(wavelengths_nm: &[f64]) -> Self {
        let infrared_too = wavelengths_nm.iter().any(|nm| *nm > NEAR_INFRARED_NM);
        Self {
            delta_e: 0.3,
            rmse: if infrared_too { 2e-3 } else { 6e-4 },
        }
    }

    /// Walks of `hybrid` that keep its noise within this error.
    #[must_use]
    pub fn rays(&self, wavelengths_nm: &[f64]) -> u64 {
        let (_, own) = CANDIDATES[0];
        let room = self.room(own, wavelengths_nm).unwrap_or(self.rmse);
        ((NOISE[0] / room).powi(2).ceil() as u64).next_power_of_two()
    }

    /// Noise allowed beside the own error of an engine, if it leaves any.
    fn room(&self, [delta_e, visible, infrared]: [f64; 3], wavelengths_nm: &[f64]) -> Option<f64> {
        let infrared_too = wavelengths_nm.iter().any(|nm| *nm > NEAR_INFRARED_NM);
        let own = if infrared_too { infrared } else { visible };
        let room = (self.rmse * self.rmse - own * own).max(0.0).sqrt();
        (delta_e <= self.delta_e && own < self.rmse).then_some(room)
    }
}

/// The engine for `request` under `light` and how many walks it is to do: as many
/// as are asked for in `hybrid`; in engines that walk all the way as many as the
/// noise allowed needs, and no more than give the noise that `hybrid` would.
pub(super) fn choose(request: &Request, light: &Illumination) -> (Engine, u64) {
    let holds = |(engine, errors): (Engine, [f64; 3])| {
        let own = own(engine, errors, request);
        let room = request.max_error.room(own, request.wavelengths_nm)?;
        let rays = match engine {
            Engine::Hybrid => request.rays,
            _ => {
                let equal = request.rays as f64 * (NOISE[1] / NOISE[0]).powi(2);
                (NOISE[1] / room).powi(2).min(equal).ceil() as u64
            }
        };
        let asked = Request {
            rays,
            // limits of thickness are those of all engines
            thicknesses_m: &[],
            illuminations: std::slice::from_ref(light),
            ..request.clone()
        };
        engine.check(&asked).is_ok().then_some((engine, rays))
    };
    let found = CANDIDATES.into_iter().find_map(holds);
    found.unwrap_or((Engine::Spectral, request.rays))
}

/// What one engine does of a request.
struct Part {
    engine: Engine,
    rays: u64,
    cell: u64,
    /// Positions in the list of lights, and those.
    lights: Vec<usize>,
    illuminations: Vec<Illumination>,
}

/// The parts of `request`: all lights of `hybrid`, which keeps their streams
/// apart by itself, and every other by itself.
fn parts(request: &Request) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    for (i, light) in request.illuminations.iter().enumerate() {
        let (engine, rays) = choose(request, light);
        let together = |part: &&mut Part| part.engine == Engine::Hybrid;
        match parts.iter_mut().find(together) {
            Some(part) if engine == Engine::Hybrid => {
                part.lights.push(i);
                part.illuminations.push(*light);
            }
            _ => parts.push(Part {
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
    parts
}

impl Part {
    fn of<'a>(&'a self, request: &Request<'a>) -> Request<'a> {
        Request {
            rays: self.rays,
            cell: self.cell,
            illuminations: &self.illuminations,
            ..request.clone()
        }
    }
}

/// As [`Engine::run_unchecked`].
pub(super) fn run(request: &Request, control: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let lights = request.illuminations.len();
    let mut spectra = vec![Spectrum::default(); request.thicknesses_m.len() * lights];
    for part in parts(request) {
        let found = part.engine.run_unchecked(&part.of(request), control)?;
        for (i, spectrum) in found.into_iter().enumerate() {
            let (h, light) = (i / part.lights.len(), i % part.lights.len());
            spectra[h * lights + part.lights[light]] = spectrum;
        }
    }
    Ok(spectra)
}

/// As [`Engine::walks`].
pub(super) fn walks(request: &Request) -> Result<u64, EngineError> {
    let mut walks = 0_u64;
    for part in parts(request) {
        walks = walks.saturating_add(part.engine.walks(&part.of(request))?);
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
            sphericity: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
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
    fn the_cheapest_engine_that_holds() {
        let usual = [300.0, 750.0];
        assert_eq!(chosen(usual, 0.0, 6e-4, 550.0).0, Engine::Hybrid);
        // its own error leaves no room
        assert_eq!(chosen(usual, 0.0, 3e-4, 550.0).0, Engine::Tabulated);
        assert_eq!(chosen(usual, 0.0, 1e-4, 550.0).0, Engine::Spectral);
        assert_eq!(chosen(usual, 0.0, 1e-3, 1030.0).0, Engine::Tabulated);
        assert_eq!(chosen(usual, 0.0, 2e-3, 1030.0).0, Engine::Hybrid);
        // crowded grains
        let (engine, rays) = chosen([50.0, 3000.0], 0.0, 2e-3, 550.0);
        assert_eq!(engine, Engine::Tabulated);
        assert!((0.5 / (rays as f64).sqrt() - 2e-3).abs() < 2e-5, "{rays}");
        assert_eq!(chosen([50.0, 3000.0], 0.0, 1e-2, 550.0).0, Engine::Hybrid);
        // hardly a grain of a table fits
        assert_eq!(chosen(usual, 89.97, 6e-4, 550.0).0, Engine::Spectral);
    }
}
