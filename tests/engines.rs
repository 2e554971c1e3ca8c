//! Comparison of `spectral` with `reference`, and of `reference` with a naive
//! implementation of the model that shares no physics code with the library.
//!
//! Every comparison is a z-test with the standard errors of both sides. The
//! significance level of the whole file is 1e-4. With fewer than 2000 comparisons
//! (Bonferroni), this requires |z| < 5.5. Seeds are fixed, so a failure is due to a
//! change of the code.
#![allow(missing_docs, clippy::unwrap_used)]

use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::naive::{self, Naive};
use nalgebra::Complex;
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{
    Facets, GrainType, Shape, SizeRange, TruncatedNormal, mean_free_distance_m,
};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Carbon;
use splitsnow::transport::{
    Component, Entry, Illumination, Layer, Model, Snow, Snowpack, Substrate,
};

const Z_LIMIT: f64 = 5.5;

/// Snow of given sizes in um, facetness, sphericity, density in kg/m3 and water saturation.
fn snow(size: [f64; 2], f: naive::Law, psi: naive::Law, density: f64, saturation: f64) -> Snow {
    let law = |l: naive::Law| TruncatedNormal::new(l[0], l[1], l[2], l[3]).unwrap();
    Snow {
        water_saturation: saturation,
        ..Snow::dry(
            GrainType {
                size: SizeRange::new(size[0] * 1e-6, size[1] * 1e-6).unwrap(),
                facetness: law(f),
                shape: Shape::Spheroid,
                proportion: law(psi),
            },
            density,
            -1.0,
        )
    }
}

const FACETNESS: naive::Law = [0.2, 0.4, 0.3, 0.072];
const SPHERICITY: naive::Law = [0.6, 0.95, 0.798, 0.064];

fn angle(degrees: f64) -> Illumination {
    Illumination::Collimated {
        polar_angle_rad: degrees.to_radians(),
    }
}

#[derive(Clone)]
struct Case {
    name: &'static str,
    snowpack: Snowpack,
    illumination: Illumination,
    thickness_m: f64,
    entry: Entry,
    facets: Facets,
}

/// Three layers: a wet, sooty surface, a layer thinner than its grains, and a dry base with
/// soot in the pores.
fn layered(substrate: f64) -> Snowpack {
    let layer = |snow, thickness_m| Layer { snow, thickness_m };
    let surface = Snow {
        black_carbon: Some(Carbon {
            sedimentation: 0.3,
            ..Carbon::black(3000.0)
        }),
        ..snow([300.0, 750.0], FACETNESS, SPHERICITY, 275.0, 0.1)
    };
    let base = Snow {
        brown_carbon: Some(Carbon {
            sedimentation: 0.0,
            ..Carbon::brown(2000.0)
        }),
        ..snow([500.0, 1000.0], FACETNESS, SPHERICITY, 350.0, 0.0)
    };
    let middle = snow([1000.0, 2500.0], [0.0; 4], [1.0; 4], 400.0, 0.3);
    Snowpack {
        surface,
        below: vec![layer(middle, 6e-4), layer(base, 5e-3)],
        substrate: Substrate::Grey(substrate),
    }
}

/// Large, round, smooth grains mixed with small, long, faceted ones.
fn mixture() -> Snow {
    let component = |fraction, snow: Snow| Component {
        fraction,
        ..snow.grains[0]
    };
    let large = snow(
        [800.0, 1200.0],
        [0.01, 0.2, 0.1, 0.05],
        [0.8, 0.99, 0.9, 0.064],
        275.0,
        0.0,
    );
    let small = snow(
        [200.0, 400.0],
        [0.7, 0.9, 0.8, 0.5],
        [0.3, 0.7, 0.5, 0.1],
        275.0,
        0.05,
    );
    Snow {
        grains: vec![component(0.7, large), component(0.3, small.clone())],
        ..small
    }
}

/// `snow` with grains of another shape.
fn shaped(shape: Shape, [min, max, mean, sd]: [f64; 4], snow: &Snow) -> Snow {
    let mut snow = snow.clone();
    let grain = &mut snow.grains[0].grain;
    grain.shape = shape;
    grain.proportion = TruncatedNormal::new(min, max, mean, sd).unwrap();
    snow
}

/// The cases to compare. They include the corners of the parameter space. Coarse grains
/// in thin slabs keep the walks short.
fn cases() -> Vec<Case> {
    let case = |name, snow: &Snow, illumination, thickness_m| Case {
        name,
        snowpack: snow.clone().into(),
        illumination,
        thickness_m,
        entry: Entry::Uniform,
        facets: Facets::Varsa2025,
    };
    let representative = &snow([300.0, 750.0], FACETNESS, SPHERICITY, 275.0, 0.0);
    let sooty = Snow {
        black_carbon: Some(Carbon {
            sedimentation: 0.0,
            ..Carbon::black(5000.0)
        }),
        brown_carbon: Some(Carbon {
            sedimentation: 0.6,
            ..Carbon::brown(4000.0)
        }),
        ..representative.clone()
    };
    let on_substrate = |snow: &Snow, substrate| Snowpack {
        substrate: Substrate::Grey(substrate),
        ..snow.clone().into()
    };
    vec![
        case("representative, normal", representative, angle(0.0), 0.01),
        case("representative, grazing", representative, angle(89.0), 0.01),
        case(
            "representative, diffuse",
            representative,
            Illumination::Diffuse,
            0.01,
        ),
        case(
            "wet",
            &snow([300.0, 750.0], FACETNESS, SPHERICITY, 275.0, 0.3),
            angle(30.0),
            0.01,
        ),
        case(
            "soaked",
            &snow([800.0, 1600.0], FACETNESS, SPHERICITY, 450.0, 0.5),
            angle(0.0),
            0.02,
        ),
        case(
            "smooth spheres",
            &snow([900.0; 2], [0.0; 4], [1.0; 4], 300.0, 0.0),
            angle(60.0),
            0.01,
        ),
        case(
            "needles",
            &snow(
                [2000.0, 3000.0],
                [0.0, 0.2, 0.1, 0.05],
                [0.2, 0.4, 0.3, 0.05],
                150.0,
                0.0,
            ),
            angle(45.0),
            0.03,
        ),
        case(
            "rough",
            &snow(
                [10.0, 100.0],
                [0.8, 0.99, 0.9, 0.5],
                [0.3, 0.9, 0.5, 0.15],
                225.0,
                0.0,
            ),
            angle(0.0),
            0.001,
        ),
        case(
            "barely thicker than its grains",
            &snow([1000.0, 2500.0], FACETNESS, SPHERICITY, 400.0, 0.1),
            angle(20.0),
            0.003,
        ),
        Case {
            entry: Entry::Projected,
            ..case("projected entry", representative, angle(50.0), 0.01)
        },
        Case {
            facets: Facets::Visible,
            ..case("visible facets", representative, angle(50.0), 0.01)
        },
        Case {
            entry: Entry::Projected,
            facets: Facets::VGroove,
            ..case("V-grooves", representative, angle(50.0), 0.01)
        },
        Case {
            facets: Facets::VGroove,
            ..case(
                "deep V-grooves in water",
                &snow([100.0, 200.0], [0.7, 0.9, 0.8, 0.1], SPHERICITY, 275.0, 0.3),
                angle(0.0),
                0.003,
            )
        },
        Case {
            entry: Entry::Projected,
            ..case(
                "hexagonal columns",
                &shaped(Shape::Hexagonal, [1.0, 3.0, 2.0, 0.5], representative),
                angle(30.0),
                0.01,
            )
        },
        Case {
            entry: Entry::Projected,
            facets: Facets::VGroove,
            ..case(
                "wet hexagonal plates",
                &Snow {
                    water_saturation: 0.1,
                    ..shaped(Shape::Hexagonal, [0.1, 0.3, 0.2, 0.05], representative)
                },
                angle(60.0),
                0.01,
            )
        },
        case(
            "hexagonal plates, uniform entry",
            &shaped(Shape::Hexagonal, [0.2, 0.5, 0.3, 0.1], representative),
            angle(30.0),
            0.01,
        ),
        case(
            "oblate",
            &shaped(Shape::Oblate, [0.4, 0.7, 0.5, 0.1], representative),
            angle(50.0),
            0.01,
        ),
        case("mixture", &mixture(), angle(40.0), 0.01),
        case("sooty", &sooty, angle(0.0), 0.01),
        Case {
            snowpack: on_substrate(representative, 0.5),
            ..case(
                "grey substrate",
                representative,
                Illumination::Diffuse,
                0.01,
            )
        },
        Case {
            snowpack: layered(0.0),
            ..case("layers", representative, angle(20.0), 0.01)
        },
        Case {
            snowpack: layered(0.5),
            entry: Entry::Projected,
            ..case(
                "layers on grey substrate",
                representative,
                angle(60.0),
                0.01,
            )
        },
        Case {
            snowpack: on_substrate(&mixture(), 0.9),
            entry: Entry::Projected,
            ..case(
                "mixture on bright substrate",
                representative,
                angle(0.0),
                0.01,
            )
        },
    ]
}

fn run(engine: Engine, case: &Case, wavelengths_nm: &[f64], rays: u64, seed: u64) -> Spectrum {
    run_all(
        engine,
        case,
        &[case.thickness_m],
        wavelengths_nm,
        rays,
        seed,
    )
    .pop()
    .unwrap()
}

fn run_all(
    engine: Engine,
    case: &Case,
    thicknesses_m: &[f64],
    wavelengths_nm: &[f64],
    rays: u64,
    seed: u64,
) -> Vec<Spectrum> {
    let model = Model {
        entry: case.entry,
        facets: case.facets,
        ..Model::default()
    };
    let request = Request {
        snowpack: &case.snowpack,
        thicknesses_m,
        illuminations: &[case.illumination],
        resolution: Resolution::for_rays(rays),
        max_error: MaxError::default(),
        wavelengths_nm,
        model: &model,
        rays,
        seed,
        cell: 0,
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let cache = Cache::default();
    engine
        .run(
            &request,
            &Control {
                parallel: true,
                cancel: &cancel,
                rays_done: &rays_done,
                cache: &cache,
            },
        )
        .unwrap()
}

fn z(a: Measured, b: Measured) -> f64 {
    (a.value - b.value) / (a.se * a.se + b.se * b.se).sqrt()
}

fn assert_agree(name: &str, a: &Spectrum, b: &Spectrum) {
    let pairs = |x: &[Measured], y: &[Measured]| -> Vec<f64> {
        x.iter().zip(y).map(|(x, y)| z(*x, *y)).collect()
    };
    for (quantity, zs) in [
        ("reflectance", pairs(&a.reflectance, &b.reflectance)),
        ("transmittance", pairs(&a.transmittance, &b.transmittance)),
    ] {
        assert!(
            zs.iter().all(|z| z.abs() < Z_LIMIT),
            "{name}, {quantity}: z = {zs:.2?}"
        );
    }
}

/// Converts a layer for the naive implementation.
fn naive_layer(layer: &Layer, nm: f64) -> naive::Layer {
    let Snow {
        density_kg_m3,
        black_carbon,
        brown_carbon,
        ..
    } = &layer.snow;
    let law = |l: TruncatedNormal| [l.min(), l.max(), l.mean(), l.sd()];
    let grain = |Component { fraction, grain }: &Component| naive::Grain {
        size_m: [grain.size.min_m(), grain.size.max_m()],
        facetness: law(grain.facetness),
        shape: grain.shape,
        proportion: law(grain.proportion),
        distance_m: mean_free_distance_m(grain, *density_kg_m3, -1.0) / fraction,
    };
    let mut soot_per_m = [0.0; 2];
    for (carbon, exponent) in [(black_carbon, 1), (brown_carbon, 2)] {
        if let Some(carbon) = carbon {
            // the mass absorption efficiency is 16.619 m2/g at 880 nm
            let grams_per_m3 = density_kg_m3 * 1e3 * carbon.concentration_ng_g * 1e-9;
            let absorption_per_m = 16.619 * (880.0 / nm).powi(exponent) * grams_per_m3;
            soot_per_m[0] += carbon.sedimentation * absorption_per_m;
            soot_per_m[1] += (1.0 - carbon.sedimentation) * absorption_per_m;
        }
    }
    naive::Layer {
        grains: layer.snow.grains.iter().map(grain).collect(),
        saturation: layer.snow.water_saturation,
        thickness_m: layer.thickness_m,
        soot_per_m,
    }
}

#[test]
fn reference_agrees_with_the_naive_model() {
    compare_reference_with_naive(4_000, 10_000);
}

#[test]
#[ignore = "long: five times as many walks, about 30 CPU-s"]
fn reference_agrees_with_the_naive_model_closely() {
    compare_reference_with_naive(20_000, 50_000);
}

fn compare_reference_with_naive(rays: u64, reference_rays: u64) {
    for case in cases() {
        for (i, nm) in [450.0, 1030.0, 2000.0].into_iter().enumerate() {
            let model = Model::default();
            let index = |i: splitsnow::optics::Index| Complex::new(i.n, i.k);
            let naive = Naive {
                layers: case
                    .snowpack
                    .layers(case.thickness_m)
                    .iter()
                    .map(|l| naive_layer(l, nm))
                    .collect(),
                ice: index(model.ice.at(nm).unwrap()),
                water: index(model.water.load().unwrap().at(nm).unwrap()),
                wavelength_m: nm * 1e-9,
                angle: match case.illumination {
                    Illumination::Collimated { polar_angle_rad } => Some(polar_angle_rad),
                    Illumination::Diffuse => None,
                },
                projected: case.entry == Entry::Projected,
                facets: case.facets,
                substrate: case.snowpack.substrate.reflectance(nm).unwrap(),
            };
            let [reflected, transmitted, lost] = naive.run(rays, i as u64);
            let measured = |count: u64| {
                let p = count as f64 / rays as f64;
                // the lower limit applies if none or all of the rays were counted
                let se = (p * (1.0 - p) / rays as f64).sqrt().max(1.0 / rays as f64);
                vec![Measured { value: p, se }]
            };
            let naive = Spectrum {
                reflectance: measured(reflected),
                transmittance: measured(transmitted),
                lost: vec![lost as f64 / rays as f64],
            };
            let reference = run(Engine::Reference, &case, &[nm], reference_rays, 3);
            assert_agree(&format!("{} at {nm} nm", case.name), &reference, &naive);
        }
    }
}

#[test]
fn spectral_agrees_with_reference_up_to_2500_nm() {
    compare_spectral_with_reference(3_000, 2_000);
}

#[test]
#[ignore = "long: about 15 times as many walks, about 60 CPU-s"]
fn spectral_agrees_with_reference_up_to_2500_nm_closely() {
    compare_spectral_with_reference(40_000, 30_000);
}

fn compare_spectral_with_reference(spectral_rays: u64, reference_rays: u64) {
    // wavelengths between the index nodes of the full list, and at its ends
    let wavelengths: Vec<f64> = (0..=86).map(|i| 350.0 + 25.0 * f64::from(i)).collect();
    let checked = [0, 4, 10, 18, 27, 38, 44, 48, 57, 63, 66, 74, 86];
    for case in cases() {
        let spectral = run(Engine::Spectral, &case, &wavelengths, spectral_rays, 5);
        let pick = |v: &[Measured]| checked.map(|i| v[i]).to_vec();
        let spectral = Spectrum {
            reflectance: pick(&spectral.reflectance),
            transmittance: pick(&spectral.transmittance),
            lost: vec![],
        };
        let reference = run(
            Engine::Reference,
            &case,
            &checked.map(|i| wavelengths[i]),
            reference_rays,
            6,
        );
        assert_agree(case.name, &spectral, &reference);
    }
}

#[test]
fn thicknesses_that_share_walks_agree_with_separate_runs() {
    compare_shared_with_separate_walks(3_000);
}

#[test]
#[ignore = "long: about 15 times as many walks, about 60 CPU-s"]
fn thicknesses_that_share_walks_agree_with_separate_runs_closely() {
    compare_shared_with_separate_walks(50_000);
}

fn compare_shared_with_separate_walks(rays: u64) {
    let thicknesses = [0.008, 0.012, 0.013, 0.03];
    for case in cases().into_iter().filter(|c| c.thickness_m == 0.01) {
        let shared = run_all(
            Engine::Spectral,
            &case,
            &thicknesses,
            &[450.0, 1030.0],
            rays,
            7,
        );
        for (thickness_m, shared) in thicknesses.into_iter().zip(&shared) {
            let case = Case {
                thickness_m,
                ..case.clone()
            };
            let separate = run(Engine::Spectral, &case, &[450.0, 1030.0], rays, 8);
            assert_agree(&format!("{} {thickness_m} m", case.name), shared, &separate);
        }
        // with common walks, T decreases and R increases with thickness without noise
        let homogeneous =
            case.snowpack.below.is_empty() && case.snowpack.substrate == Substrate::Black;
        for pair in shared.windows(2).filter(|_| homogeneous) {
            assert!(pair[0].transmittance[0].value > pair[1].transmittance[0].value);
            assert!(pair[0].reflectance[0].value < pair[1].reflectance[0].value);
        }
    }
}

/// Transmission through a large optical depth of ice. Walks of low weight are terminated at
/// random (Russian roulette), and the weights of the others compensate for this.
#[test]
fn random_termination_of_walks_is_unbiased() {
    let case = Case {
        name: "dark",
        snowpack: snow([1000.0, 2000.0], FACETNESS, SPHERICITY, 300.0, 0.0).into(),
        illumination: angle(0.0),
        thickness_m: 0.04,
        entry: Entry::Uniform,
        facets: Facets::Varsa2025,
    };
    let spectral = run(Engine::Spectral, &case, &[1270.0], 1_000_000, 21);
    let reference = run(Engine::Reference, &case, &[1270.0], 1_000_000, 22);
    assert_agree(case.name, &spectral, &reference);
    let t = reference.transmittance[0];
    assert!(t.value > 10.0 * t.se, "the test has no power: {t:?}");
}

/// The bias of interpolation between two index nodes, relative to walks with the refractive
/// index of each wavelength. Grains are coarse, so that walks are short.
#[test]
#[ignore = "long: fewer walks cannot detect the bias, 20 CPU-s"]
fn bias_of_index_nodes_is_below_the_noise() {
    let case = Case {
        name: "coarse",
        snowpack: snow([1000.0, 2000.0], FACETNESS, SPHERICITY, 275.0, 0.0).into(),
        illumination: angle(0.0),
        thickness_m: 0.02,
        entry: Entry::Uniform,
        facets: Facets::Varsa2025,
    };
    let visible: Vec<f64> = (40..=70).map(|l| f64::from(l) * 10.0).collect();
    let interpolated = run(Engine::Spectral, &case, &visible, 1_500_000, 11);
    let (mut bias, mut variance) = (0.0, 0.0);
    // wavelengths far from the index nodes at 400 and 700 nm
    let middle = [6, 8, 10, 12];
    for l in middle {
        let exact = run(
            Engine::Spectral,
            &case,
            &[visible[l]],
            400_000,
            12 + l as u64,
        );
        let (a, b) = (interpolated.transmittance[l], exact.transmittance[0]);
        bias += (a.value / b.value - 1.0) / middle.len() as f64;
        variance += (b.se / b.value / middle.len() as f64).powi(2);
    }
    // the interpolated values share their walks, so their errors do not average out
    let se = (variance
        + (interpolated.transmittance[9].se / interpolated.transmittance[9].value).powi(2))
    .sqrt();
    assert!(
        bias.abs() < 0.002 + 4.0 * se,
        "relative bias {bias:.5} +- {se:.5}"
    );
    assert!(se < 0.0015, "the test has no power: {se:.5}");
}

/// With few walks `hybrid` has a third of the index nodes. The mean of many such runs agrees with
/// runs of many walks, whose nodes are close.
#[test]
fn few_walks_at_few_index_nodes_have_no_bias() {
    let case = Case {
        name: "wet",
        snowpack: snow([300.0, 750.0], FACETNESS, SPHERICITY, 275.0, 0.1).into(),
        illumination: angle(0.0),
        thickness_m: 0.05,
        entry: Entry::Uniform,
        facets: Facets::Varsa2025,
    };
    let nm: Vec<f64> = (0..=43).map(|i| 350.0 + 50.0 * f64::from(i)).collect();
    let mean = |rays, seeds: std::ops::Range<u64>| {
        let n = (seeds.end - seeds.start) as f64;
        let mut sums = vec![(0.0, 0.0); nm.len()];
        for seed in seeds {
            let spectrum = run(Engine::Hybrid, &case, &nm, rays, seed);
            for (sum, r) in sums.iter_mut().zip(spectrum.reflectance) {
                *sum = (sum.0 + r.value / n, sum.1 + (r.se / n).powi(2));
            }
        }
        sums
    };
    let (few, many) = (mean(2048, 0..32), mean(131_072, 100..102));
    let (mut bias, mut noise) = (0.0, 0.0);
    for (a, b) in few.iter().zip(&many) {
        bias += (a.0 - b.0).powi(2) / nm.len() as f64;
        noise += (a.1 + b.1) / nm.len() as f64;
    }
    let [bias, noise] = [bias, noise].map(f64::sqrt);
    assert!(noise < 5e-4, "the test has no power: {noise:.5}");
    assert!(bias < 2.0 * noise, "bias {bias:.5}, noise {noise:.5}");
}

#[test]
fn results_do_not_depend_on_threads() {
    let case = &cases()[3];
    let wavelengths = [500.0, 900.0, 1500.0];
    let results = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        Engine::ALL.map(|engine| pool.install(|| run(engine, case, &wavelengths, 9000, 1)))
    };
    assert_eq!(results(1), results(3));
}
