//! Packs of layers, mixtures, carbon and ground against what is known without
//! the library: identities, limits and closed forms.
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::mean_free_distance_m;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::{Carbon, CarbonLaw, ImpurityMass, ice_density_kg_m3};
use splitsnow::spectrum::Table;
use splitsnow::transport::{
    Absorption, Bounce, Coefficients, Component, Entry, Ground, Illumination, Joining, Layer,
    Model, Pack, Snow, Walker,
};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::assert_close;
use crate::snow::{AIR, NORMAL, TRANSPARENT, beam, dry, ends, proportion, snow, spheres, walker};

const NM: [f64; 3] = [450.0, 850.0, 1250.0];

/// What is asked for, but for rays and seed.
#[derive(Clone)]
struct Case {
    engine: Engine,
    pack: Pack,
    model: Model,
    thicknesses_m: Vec<f64>,
    light: Illumination,
    nm: Vec<f64>,
}

impl Case {
    fn new(pack: impl Into<Pack>, thickness_m: f64) -> Self {
        Self {
            engine: Engine::Spectral,
            pack: pack.into(),
            model: Model::default(),
            thicknesses_m: vec![thickness_m],
            light: beam(30.0),
            nm: NM.to_vec(),
        }
    }

    fn of(&self, engine: Engine) -> Self {
        Self {
            engine,
            ..self.clone()
        }
    }

    fn cascade(&self) -> Self {
        let mut case = self.clone();
        case.model.joining = Joining::Cascade;
        case
    }

    fn run_all(&self, rays: u64, seed: u64) -> Vec<Spectrum> {
        let request = Request {
            pack: &self.pack,
            thicknesses_m: &self.thicknesses_m,
            illuminations: &[self.light],
            resolution: Resolution::default(),
            max_error: MaxError::default(),
            wavelengths_nm: &self.nm,
            model: &self.model,
            rays,
            seed,
            cell: 0,
        };
        let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
        let cache = Cache::default();
        let control = Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &cache,
        };
        let spectra = self.engine.run(&request, &control).unwrap();
        assert_eq!(
            rays_done.into_inner(),
            self.engine.walks(&request).unwrap(),
            "walks are not as many as told"
        );
        spectra
    }

    fn run(&self, rays: u64, seed: u64) -> Spectrum {
        self.run_all(rays, seed).remove(0)
    }
}

/// Asserts that two spectra agree within the errors of both.
fn assert_same(what: &str, a: &Spectrum, b: &Spectrum) {
    let both = [
        ("R", &a.reflectance, &b.reflectance),
        ("T", &a.transmittance, &b.transmittance),
    ];
    for (quantity, a, b) in both {
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            let what = format!("{what}, {quantity} {i}");
            assert_close(&what, a.value, a.se.hypot(b.se), b.value);
        }
    }
}

/// Wet snow with carbon in ice and pores.
fn dirty() -> Snow {
    Snow {
        black_carbon: Some(Carbon {
            sedimentation: 0.4,
            ..Carbon::black(800.0)
        }),
        brown_carbon: Some(Carbon {
            sedimentation: 0.7,
            ..Carbon::brown(500.0)
        }),
        ..snow((300.0, 750.0), 0.3, 275.0, 0.1)
    }
}

fn over(snow: Snow, ground: Ground) -> Pack {
    Pack {
        ground,
        ..snow.into()
    }
}

/// Snow on another, `below_m` thick.
fn on(surface: Snow, below: Snow, below_m: f64) -> Pack {
    Pack {
        surface,
        below: vec![Layer {
            snow: below,
            thickness_m: below_m,
        }],
        ground: Ground::Black,
    }
}

/// A ground that changes with wavelength.
fn spectral_ground() -> Ground {
    let text = "wavelength_nm,reflectance\n400,0.1\n800,0.9\n1300,0.3\n";
    Ground::Spectrum {
        table: Table::parse("g", text, &["wavelength_nm", "reflectance"]).unwrap(),
        path: "g.csv".into(),
    }
}

#[test]
fn a_pack_cut_into_equal_layers_is_the_pack() {
    let whole = Case::new(over(dirty(), Ground::Grey(0.3)), 0.01);
    let layer = Layer {
        snow: dirty(),
        thickness_m: 0.0013,
    };
    let cut = Case {
        pack: Pack {
            below: vec![layer; 6],
            ..whole.pack.clone()
        },
        ..whole.clone()
    };
    for (engine, rays) in [(Engine::Spectral, 300_000), (Engine::Reference, 100_000)] {
        let [a, b] = [&whole, &cut].map(|case| case.of(engine).run(rays, 1));
        assert_same(&format!("cut, {}", engine.name()), &a, &b);
    }
}

#[test]
fn a_mixture_of_a_type_with_itself_is_the_type() {
    let pure = dirty();
    let part = |fraction| Component {
        fraction,
        ..pure.grains[0]
    };
    let mixed = Snow {
        grains: vec![part(0.2), part(0.0), part(0.5), part(0.3)],
        ..pure.clone()
    };
    let [a, b] = [pure, mixed].map(|snow| Case::new(snow, 0.01).run(300_000, 2));
    assert_same("mixed with itself", &a, &b);
}

/// The parts of a mixture are met in proportion to their surface, and the mean
/// free distance follows from the sum of their rates.
#[test]
fn rates_of_a_mixture_add_up() {
    let [a, b] = [spheres(200.0, 300.0), spheres(1000.0, 300.0)];
    let mixed = Snow {
        grains: vec![
            Component {
                fraction: 0.25,
                ..a.grains[0]
            },
            Component {
                fraction: 0.75,
                ..b.grains[0]
            },
        ],
        ..a.clone()
    };
    let [rate_a, rate_b] = [&a, &b].map(|snow| 1.0 / snow.mean_free_distance_m());
    let rate = 0.25 * rate_a + 0.75 * rate_b;
    assert!((mixed.mean_free_distance_m() * rate - 1.0).abs() < 1e-14);
    // five times as many surfaces per volume: 0.25 * 5 against 0.75
    let shares = mixed.meeting_shares();
    assert!((shares[0] - 1.25 / 2.0).abs() < 1e-12, "{shares:?}");
    assert!((shares[0] + shares[1] - 1.0).abs() < 1e-14);
}

#[test]
fn nothing_added_is_nothing_changed() {
    let bare = Case::new(dry(), 0.01);
    let none = |carbon: Carbon| Some(carbon);
    let clean = Snow {
        black_carbon: none(Carbon::black(0.0)),
        brown_carbon: none(Carbon::brown(0.0)),
        ..dry()
    };
    for engine in [Engine::Spectral, Engine::Reference] {
        let expected = bare.of(engine).run(20_000, 3);
        for pack in [over(dry(), Ground::Grey(0.0)), clean.clone().into()] {
            assert_eq!(Case::new(pack, 0.01).of(engine).run(20_000, 3), expected);
        }
    }
}

/// Nothing is lost between a perfect ground and snow that does not absorb.
#[test]
fn perfect_ground_sends_everything_back() {
    let bounce = Bounce {
        reflected: 1.0,
        transmitted: 0.0,
    };
    let transparent = walker(&dry(), Entry::Uniform, 1.31, TRANSPARENT).over(bounce);
    let counts = ends(&transparent, 0.01, beam(40.0), 20_000, 300);
    assert_eq!(counts.reflected + counts.lost, 20_000);
    assert!(counts.lost < 20, "{counts:?}");
    // ice absorbs 6e-4 per m at 400 nm, and light goes some 3 cm in it
    for engine in [Engine::Spectral, Engine::Reference] {
        let mut case = Case::new(over(dry(), Ground::Grey(1.0)), 0.01).of(engine);
        case.nm = vec![400.0];
        let spectrum = case.run(50_000, 4);
        let (r, t) = (
            spectrum.reflectance[0].value,
            spectrum.transmittance[0].value,
        );
        let few = if engine == Engine::Spectral {
            1e-4
        } else {
            6e-4
        };
        println!("{}: R = {r:.6}", engine.name());
        assert!(
            (1.0 - few - spectrum.lost[0]..=1.0 + 1e-12).contains(&r),
            "{r}"
        );
        assert_eq!(t, 0.0);
    }
}

#[test]
fn little_carbon_has_half_the_effect_of_twice_as_little() {
    let case = |ng_g| {
        let sooty = Snow {
            black_carbon: Some(Carbon {
                sedimentation: 0.5,
                ..Carbon::black(ng_g)
            }),
            ..dry()
        };
        Case::new(sooty, 0.02).run(50_000, 5)
    };
    let (clean, once, twice) = (case(0.0), case(0.5), case(1.0));
    // beyond the visible other walks end early, and the two do not share their errors
    let of = |s: &Spectrum| [s.reflectance[0].value, s.transmittance[0].value];
    for (i, what) in ["R", "T"].iter().enumerate() {
        let [zero, one, two] = [&clean, &once, &twice].map(|s| of(s)[i]);
        let ratio = (zero - two) / (zero - one);
        println!(
            "{what}: {:.3e} and {:.3e}, ratio {ratio:.5}",
            zero - one,
            zero - two
        );
        assert!(zero > one && (ratio - 2.0).abs() < 0.01, "{what}: {ratio}");
    }
}

/// Invisible spheres (n = 1) far apart: light goes straight, meets h / d grains
/// on average, and a chord s c in each with c uniform. So soot in the ice leaves
/// exp(-(h / d) (1 - (1 - exp(-alpha s)) / (alpha s))), and soot in the pores
/// exp(-alpha h).
#[test]
fn soot_absorbs_as_by_hand() {
    let (rays, h, density, nm) = (400_000, 0.1, 0.1, 440.0);
    let snow = spheres(100.0, density);
    let d = mean_free_distance_m(&snow.grains[0].grain, density, -1.0);
    // M (880 / 440)^1 D C: 16.619 m2/g * 2 * 100 g/m3 * C
    let per_concentration = 16.619 * 2.0 * 100.0;
    let ice_share = density / ice_density_kg_m3(-1.0);
    let transmitted = |sedimentation, ng_g, mass, cell| {
        let sooty = Snow {
            black_carbon: Some(Carbon {
                sedimentation,
                ..Carbon::black(ng_g)
            }),
            ..snow.clone()
        };
        let pack = sooty.into();
        let model = Model {
            impurity_mass: mass,
            ..Model::default()
        };
        let absorption = Absorption {
            coefficients: Coefficients::at(nm, (AIR, AIR), &Pack::exponents(&pack)),
            ..TRANSPARENT
        };
        let walker = Walker::new(&pack, &model, (AIR, AIR), absorption);
        let counts = ends(&walker, h, NORMAL, rays, cell);
        assert_eq!((counts.reflected, counts.lost), (0, 0));
        proportion(counts.transmitted, rays)
    };
    let in_grains = |alpha: f64| {
        let x = alpha * 1e-4;
        (-(h / d) * (1.0 + (-x).exp_m1() / x)).exp()
    };
    // 2e4 per m in the ice, by a mass that fills the snow or one squeezed into it
    let c = 2e4 / per_concentration;
    let t = transmitted(1.0, c * 1e9, ImpurityMass::Varsa2025, 310);
    assert_close("soot in ice", t.value, t.se, in_grains(2e4));
    let t = transmitted(1.0, c * 1e9 * ice_share, ImpurityMass::Conserved, 311);
    assert_close("soot in ice, conserved", t.value, t.se, in_grains(2e4));
    // 5 per m in the pores
    let c = 5.0 / per_concentration;
    for (mass, cell) in [
        (ImpurityMass::Varsa2025, 312),
        (ImpurityMass::Conserved, 313),
    ] {
        let t = transmitted(0.0, c * 1e9, mass, cell);
        assert_close("soot in pores", t.value, t.se, (-5.0 * h).exp());
    }
}

/// Above 1 nm the printed law makes brown carbon vanish; the corrected one
/// darkens the blue the more, the larger the exponent.
#[test]
fn the_trend_with_the_exponent_inverts() {
    let blue = |exponent, law| {
        let brown = Snow {
            brown_carbon: Some(Carbon {
                angstrom_exponent: exponent,
                ..Carbon::brown(500.0)
            }),
            ..dry()
        };
        let mut case = Case::new(brown, 0.05);
        case.model.carbon_law = law;
        case.nm = vec![400.0];
        case.run(20_000, 6).reflectance[0].value
    };
    let clean = Case {
        nm: vec![400.0],
        ..Case::new(dry(), 0.05)
    };
    let clean = clean.run(20_000, 6).reflectance[0].value;
    let [power, printed] =
        [CarbonLaw::Power, CarbonLaw::Varsa2025].map(|law| [1.0, 1.5, 2.0].map(|a| blue(a, law)));
    println!("clean {clean:.4}, power {power:.4?}, printed {printed:.4?}");
    assert!(power[0] > power[1] + 0.01 && power[1] > power[2] + 0.01);
    assert!(printed[0] < printed[1] - 0.01 && printed[2] > clean - 0.01);
    assert!((power[0] - printed[0]).abs() < 1e-12);
}

#[test]
fn thicknesses_at_once_are_those_alone_in_packs() {
    let coarse = snow((1000.0, 2500.0), 0.2, 400.0, 0.0);
    let mut all = Case::new(on(dirty(), coarse, 0.006), 0.0);
    all.pack.ground = Ground::Grey(0.4);
    all.thicknesses_m = vec![0.0075, 0.009, 0.0091, 0.014];
    for (joined, what) in [(all.clone(), "continuous"), (all.cascade(), "cascade")] {
        let together = joined.run_all(300_000, 7);
        for (h, shared) in joined.thicknesses_m.iter().zip(&together) {
            let alone = Case {
                thicknesses_m: vec![*h],
                ..joined.clone()
            };
            let alone = alone.run(300_000, 8);
            assert_same(&format!("{what}, {h} m"), shared, &alone);
        }
    }
}

#[test]
fn spectral_over_a_ground_is_reference_over_it() {
    let layered = Pack {
        ground: spectral_ground(),
        ..on(dirty(), dry(), 0.004)
    };
    let homogeneous = over(dirty(), spectral_ground());
    for (what, pack) in [("layers", layered), ("one layer", homogeneous)] {
        for case in [
            Case::new(pack.clone(), 0.008),
            Case::new(pack, 0.008).cascade(),
        ] {
            let a = case.run(200_000, 9);
            let b = case.of(Engine::Reference).run(200_000, 10);
            assert_same(&format!("{what}, {}", case.model.joining.name()), &a, &b);
        }
    }
}

/// A cascade puts a layer on a Lambertian ground: that of its lower pack.
#[test]
fn a_cascade_is_a_layer_on_a_ground() {
    let below_m = 0.01;
    let lower = Case {
        light: NORMAL,
        nm: vec![850.0],
        ..Case::new(dirty(), below_m)
    };
    let lower = lower.run(400_000, 11).reflectance[0];
    let mut cascade = Case::new(on(dry(), dirty(), below_m), 0.005 + below_m).cascade();
    cascade.nm = vec![850.0];
    let grounded = Case {
        nm: vec![850.0],
        ..Case::new(over(dry(), Ground::Grey(lower.value)), 0.005)
    };
    let (a, b) = (cascade.run(200_000, 12), grounded.run(200_000, 13));
    let (a, b) = (a.reflectance[0], b.reflectance[0]);
    // dR / d rho is at most 1
    let se = a.se.hypot(b.se).hypot(lower.se);
    assert_close("cascade and ground", a.value, se, b.value);
}

/// What the cascade neglects: that light comes out of the lower pack where and
/// as it went in, and that grains reach across. It vanishes over a lower pack
/// that sends back nothing or everything, but for grains at the plane.
#[test]
fn how_far_cascades_are_off() {
    let black = Snow {
        black_carbon: Some(Carbon::black(1e9)),
        ..dry()
    };
    let fine = |density| snow((60.0, 140.0), 0.5, density, 0.0);
    let basal = snow((900.0, 1000.0), 0.1, 375.0, 0.0);
    let rays = 20_000;
    let apart = |what: &str, pack: Pack, thickness_m, deg| {
        let case = Case {
            light: beam(deg),
            ..Case::new(pack, thickness_m)
        };
        let (a, b) = (case.run(rays, 14), case.cascade().run(rays, 15));
        let differences = a.reflectance.iter().zip(&b.reflectance);
        let differences: Vec<Measured> = differences
            .map(|(a, b)| Measured {
                value: b.value - a.value,
                se: a.se.hypot(b.se),
            })
            .collect();
        println!("cascade - continuous, {what}, {deg} degrees: {differences:.4?}");
        differences
            .iter()
            .map(|d| d.value.abs())
            .fold(0.0, f64::max)
    };
    assert!(apart("on black", on(dry(), black, 0.02), 0.03, 0.0) < 0.01);
    let perfect = apart(
        "visible, on much fine snow",
        on(fine(300.0), fine(300.0), 0.2),
        0.21,
        0.0,
    );
    let mut most = perfect;
    for deg in [0.0, 60.0] {
        for surface_m in [0.002, 0.005, 0.01] {
            let pack = on(fine(225.0), basal.clone(), 0.1);
            let what = format!("{} mm on basal", surface_m * 1e3);
            most = most.max(apart(&what, pack, 0.1 + surface_m, deg));
        }
    }
    println!("cascades are off by {most:.4} at most");
    assert!(most < 0.05);
}

#[test]
fn energy_is_conserved() {
    let soot = Snow {
        black_carbon: Some(Carbon::black(1e7)),
        ..dry()
    };
    for ground in [Ground::Black, Ground::Grey(1.0), spectral_ground()] {
        for (surface, below) in [
            (dirty(), dry()),
            (soot.clone(), dirty()),
            (dry(), soot.clone()),
        ] {
            let layers = Pack {
                ground: ground.clone(),
                ..on(surface, below, 0.004)
            };
            let case = Case {
                thicknesses_m: vec![0.006, 0.012],
                ..Case::new(layers, 0.0)
            };
            for case in [case.cascade(), case.of(Engine::Reference), case] {
                for spectrum in case.run_all(4096, 16) {
                    let both = spectrum.reflectance.iter().zip(&spectrum.transmittance);
                    for (r, t) in both {
                        let (r, t) = (r.value, t.value);
                        assert!((0.0..=1.0 + 1e-12).contains(&r), "R = {r}");
                        assert!((0.0..=1.0 + 1e-12).contains(&t), "T = {t}");
                        assert!(r + t <= 1.0 + 1e-12, "R + T = {}", r + t);
                    }
                }
            }
        }
    }
}

/// Scatter over seeds in units of the standard errors: chi-square. The errors
/// of `spectral` over a ground take R and T of the bare pack for independent,
/// although what one gains the other loses: they may be too large.
#[test]
fn standard_errors_are_those_of_the_scatter() {
    const SEEDS: u64 = 24;
    let chi = ChiSquared::new((SEEDS - 1) as f64).unwrap();
    let (low, high) = (chi.inverse_cdf(1e-6), chi.inverse_cdf(1.0 - 1e-6));
    let ground = Case {
        nm: vec![850.0],
        ..Case::new(over(dry(), Ground::Grey(0.5)), 0.005)
    };
    let cascade = Case {
        nm: vec![850.0],
        ..Case::new(on(dry(), dirty(), 0.003), 0.008).cascade()
    };
    for (what, case) in [("ground", ground), ("cascade", cascade)] {
        for engine in [Engine::Reference, Engine::Spectral] {
            let spectra: Vec<Spectrum> = (0..SEEDS)
                .map(|seed| case.of(engine).run(4096, 100 + seed))
                .collect();
            for (quantity, of) in [
                ("R", (|s| s.reflectance[0]) as fn(&Spectrum) -> Measured),
                ("T", |s| s.transmittance[0]),
            ] {
                let all: Vec<Measured> = spectra.iter().map(of).collect();
                let mean = all.iter().map(|m| m.value).sum::<f64>() / SEEDS as f64;
                let sum: f64 = all.iter().map(|m| ((m.value - mean) / m.se).powi(2)).sum();
                let name = engine.name();
                println!("{what}, {name}, {quantity}: chi2 = {sum:.1} in [{low:.1}, {high:.1}]");
                assert!(sum < high, "{what}, {name}, {quantity}: {sum}");
                // half the error claimed at least
                let least = if engine == Engine::Spectral {
                    low / 4.0
                } else {
                    low
                };
                assert!(sum > least, "{what}, {name}, {quantity}: {sum}");
            }
        }
    }
}
