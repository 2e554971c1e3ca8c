//! Profiles: balance of energy, limits, and agreement of the engines.
use std::sync::atomic::{AtomicBool, AtomicU64};

use super::*;
use crate::engine::{Cache, MaxError, Resolution};
use crate::grain::{GrainType, Shape, SizeRange, TruncatedNormal};
use crate::optics::Carbon;
use crate::transport::{Illumination, Joining, Layer, Model, Snow, Snowpack, Substrate};

/// Largest deviation in standard errors: with eight parts the jackknife knows an error to 27 %, so
/// a normal distribution is not wide enough. Student's t with 7 degrees of freedom exceeds it with
/// a probability of 2.1e-4, for each of some 500 comparisons that are mostly not independent.
const Z: f64 = 7.0;
/// Deviation allowed to `hybrid` besides noise.
const SYSTEMATIC: f64 = 0.02;

fn snow(size_um: f64, density_kg_m3: f64) -> Snow {
    let grain = GrainType {
        size: SizeRange::new((size_um - 50.0) * 1e-6, (size_um + 50.0) * 1e-6).unwrap(),
        facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
        shape: Shape::Spheroid,
        proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
    };
    Snow::dry(grain, density_kg_m3, -1.0)
}

fn sooty(snow: Snow) -> Snow {
    Snow {
        black_carbon: Some(Carbon {
            sedimentation: 0.5,
            ..Carbon::black(500.0)
        }),
        ..snow
    }
}

fn layered(substrate: Substrate) -> Snowpack {
    Snowpack {
        surface: snow(200.0, 200.0),
        below: vec![Layer {
            snow: sooty(snow(500.0, 350.0)),
            thickness_m: 0.02,
        }],
        substrate,
    }
}

const DIFFUSE: Illumination = Illumination::Diffuse;
const SLANT: Illumination = Illumination::Collimated {
    polar_angle_rad: 1.0,
};

/// What a profile is made of, besides the engine and the number of rays.
struct ProfileCase {
    snowpack: Snowpack,
    thickness_m: f64,
    light: Illumination,
    nm: Vec<f64>,
    depths_m: Vec<f64>,
}

impl ProfileCase {
    fn new(snowpack: impl Into<Snowpack>, light: Illumination) -> Self {
        Self {
            snowpack: snowpack.into(),
            thickness_m: 0.03,
            light,
            nm: vec![450.0, 950.0, 1250.0],
            depths_m: vec![
                2e-4, 1e-3, 2e-3, 4e-3, 9e-3, 0.01, 0.0115, 0.018, 0.029, 0.0297,
            ],
        }
    }

    fn with<T>(&self, rays: u64, run: impl Fn(&Request, &Control) -> T) -> T {
        let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
        let request = Request {
            snowpack: &self.snowpack,
            thicknesses_m: &[self.thickness_m],
            illuminations: &[self.light],
            wavelengths_nm: &self.nm,
            model: &Model::default(),
            rays,
            max_error: MaxError::default(),
            resolution: Resolution::for_rays(rays),
            seed: 5,
            cell: 0,
        };
        let control = Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &Cache::default(),
        };
        run(&request, &control)
    }

    fn run(&self, engine: Engine, rays: u64) -> Profile {
        self.with(rays, |request, control| {
            let profile = super::run(engine, request, &self.depths_m, control).unwrap();
            let done = control.rays_done.load(std::sync::atomic::Ordering::Relaxed);
            assert_eq!(done, walks(engine, request, &self.depths_m).unwrap());
            profile
        })
    }
}

/// The largest deviation of `a` from `b` in units of what is allowed: [`Z`] standard errors and
/// the share `systematic`.
fn largest_deviation(a: &Profile, b: &Profile, systematic: f64) -> f64 {
    let mut largest: f64 = 0.0;
    for wavelength in 0..a.wavelengths() {
        for depth in 0..a.depths_m().len() {
            let [x, y] = [a, b].map(|profile| profile.at(wavelength, depth));
            let pairs = [
                (x.downwelling, y.downwelling),
                (x.upwelling, y.upwelling),
                (x.actinic, y.actinic),
                (
                    x.absorbed_per_m.unwrap_or_default(),
                    y.absorbed_per_m.unwrap_or_default(),
                ),
            ];
            for (i, (x, y)) in pairs.into_iter().enumerate() {
                let allowed = systematic * y.value.abs() + Z * x.se.hypot(y.se) + 1e-9;
                let deviation = (x.value - y.value).abs() / allowed;
                let at_m = a.depths_m()[depth];
                println!(
                    "{wavelength} {at_m:.4} {i}: {:.5} +- {:.5}, {:.5} +- {:.5}: {deviation:.2}",
                    x.value, x.se, y.value, y.se
                );
                largest = largest.max(deviation);
            }
        }
    }
    largest
}

/// `profile` begins with the incident flux and ends with the reflectance and transmittance of
/// `engine`, and absorbs what is left.
fn assert_balanced(case: &ProfileCase, engine: Engine, rays: u64, profile: &Profile) {
    let spectrum = case.with(rays, |request, control| {
        engine.run(request, control).unwrap().remove(0)
    });
    let last = profile.depths_m().len() - 1;
    for (l, (r, t)) in spectrum
        .reflectance
        .iter()
        .zip(&spectrum.transmittance)
        .enumerate()
    {
        let (surface, base) = (profile.at(l, 0), profile.at(l, last));
        assert!((surface.downwelling.value - 1.0).abs() < 1e-9);
        let through = base.downwelling.value - base.upwelling.value;
        let close = |a: f64, se: f64, b: Measured| {
            assert!(
                (a - b.value).abs() < Z * se.hypot(b.se) + 1e-9,
                "{l}: {a} {se} {b:?}"
            );
        };
        close(surface.upwelling.value, surface.upwelling.se, *r);
        close(through, base.downwelling.se, *t);
        let depths_m = profile.depths_m();
        let absorbed = (0..last).map(|i| {
            let per_m = profile.at(l, i).absorbed_per_m.unwrap();
            assert!(per_m.value > -Z * per_m.se - 1e-9, "{l} {i}: {per_m:?}");
            per_m.value * (depths_m[i + 1] - depths_m[i])
        });
        let left = 1.0 - surface.upwelling.value - through;
        assert!((absorbed.sum::<f64>() - left).abs() < 1e-9, "{l}: {left}");
    }
}

#[test]
fn energy_is_balanced() {
    let case = ProfileCase::new(layered(Substrate::Grey(0.6)), DIFFUSE);
    for (engine, rays) in [(Engine::Spectral, 2048), (Engine::Hybrid, 4096)] {
        assert_balanced(&case, engine, rays, &case.run(engine, rays));
    }
    let case = ProfileCase::new(layered(Substrate::Black), SLANT);
    let profile = case.run(Engine::Hybrid, 4096);
    assert_balanced(&case, Engine::Hybrid, 4096, &profile);
    // R and T are those of `hybrid`, from the same walks
    let spectrum = case.with(4096, |request, control| {
        Engine::Hybrid.run(request, control).unwrap().remove(0)
    });
    let surface = profile.at(0, 0);
    assert!((surface.upwelling.value - spectrum.reflectance[0].value).abs() < 1e-12);
    // nothing comes up from a black base
    let base = profile.at(0, profile.depths_m().len() - 1);
    assert_eq!(base.upwelling.value, 0.0);
    assert!((base.downwelling.value - spectrum.transmittance[0].value).abs() < 1e-12);
}

/// Analog absorption at each wavelength and weights of shared walks give the same profile.
#[test]
fn spectral_agrees_with_reference() {
    let mut case = ProfileCase::new(layered(Substrate::Grey(0.6)), SLANT);
    case.nm = vec![500.0, 1250.0];
    let [reference, spectral] =
        [Engine::Reference, Engine::Spectral].map(|engine| case.run(engine, 4096));
    assert!(largest_deviation(&spectral, &reference, 0.0) < 1.0);
}

#[test]
fn hybrid_agrees_with_walks_in_clean_sooty_and_layered_snow() {
    let cases = [
        ProfileCase::new(snow(400.0, 300.0), DIFFUSE),
        ProfileCase::new(sooty(snow(400.0, 300.0)), SLANT),
        ProfileCase::new(layered(Substrate::Grey(0.6)), DIFFUSE),
    ];
    for case in cases {
        let hybrid = case.run(Engine::Hybrid, 1 << 15);
        let walked = case.run(Engine::Spectral, 1 << 13);
        assert!(largest_deviation(&hybrid, &walked, SYSTEMATIC) < 1.0);
    }
}

/// In snow that hardly absorbs, the net flux is the same at all depths: the absorbed share of the
/// light is at most the absorption coefficient times the mean path, 2 h in a slab under diffuse
/// light.
#[test]
fn net_flux_is_constant_without_absorption() {
    let mut case = ProfileCase::new(snow(400.0, 300.0), DIFFUSE);
    case.nm = vec![390.0];
    for (engine, rays) in [(Engine::Spectral, 4096), (Engine::Hybrid, 4096)] {
        let profile = case.run(engine, rays);
        let net = |depth: usize| {
            let light = profile.at(0, depth);
            light.downwelling.value - light.upwelling.value
        };
        for depth in 0..profile.depths_m().len() {
            // 0.0007 per metre
            assert!((net(depth) - net(0)).abs() < 2e-4, "{} {depth}", net(depth));
        }
    }
}

/// Deep in thick snow, all fluxes fall by the same factor over equal distances.
#[test]
fn deep_light_falls_exponentially() {
    let mut case = ProfileCase::new(snow(400.0, 300.0), SLANT);
    case.thickness_m = 0.3;
    case.nm = vec![700.0, 950.0];
    case.depths_m = vec![0.05, 0.06, 0.07];
    let profile = case.run(Engine::Hybrid, 4096);
    for l in 0..2 {
        let [a, b, c] = [1, 2, 3].map(|depth| profile.at(l, depth));
        let columns: [fn(&LightAtDepth) -> f64; 3] = [
            |light| light.downwelling.value,
            |light| light.upwelling.value,
            |light| light.actinic.value,
        ];
        let factors = columns.map(|column| [column(&b) / column(&a), column(&c) / column(&b)]);
        let first = factors[0][0];
        assert!(first < 0.9, "{first}");
        for factor in factors.as_flattened() {
            assert!((factor / first - 1.0).abs() < 1e-3, "{factors:?}");
        }
    }
}

#[test]
fn what_cannot_be_computed_is_refused() {
    let case = ProfileCase::new(layered(Substrate::Black), SLANT);
    let refused = |engine, depths_m: &[f64], model: &Model| {
        case.with(64, |request, control| {
            let request = Request {
                model,
                ..request.clone()
            };
            super::run(engine, &request, depths_m, control).unwrap_err()
        })
    };
    let model = Model::default();
    let error = refused(Engine::Hybrid, &[0.01, 0.04], &model);
    assert_eq!(
        error.to_string(),
        "the depth 4 cm is not in the snowpack; give depths from 0 to 3 cm"
    );
    assert!(matches!(
        refused(Engine::Spectral, &[f64::NAN], &model),
        EngineError::Depth { .. }
    ));
    assert!(matches!(
        refused(Engine::Tabulated, &[], &model),
        EngineError::Unable { .. }
    ));
    let cascade = Model {
        joining: Joining::Cascade,
        ..model
    };
    assert_eq!(
        refused(Engine::Hybrid, &[], &cascade),
        EngineError::CascadeProfile
    );
}
