//! Numbers in pages that are measured, with their standard errors.
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::colour::Colorimeter;
use splitsnow::engine::exits::goniometer;
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::measurement::{Measured, Sensors, Spectrum};
use splitsnow::optics::{Carbon, CarbonLaw};
use splitsnow::transport::{Model, Snow, Snowpack, Substrate};

use super::cases::{
    Case, FACETNESS, Law, SPHERICITY, absorbing, coarse, fresh, light, ordinary, over, snow, wet,
};
use super::row::Quoted;

/// Walks of `hybrid`.
const WALKS: u64 = 65_536;

/// Everything is measured with the random numbers of one seed.
pub(crate) struct Bench {
    seed: u64,
    cache: Cache,
    all: Vec<Quoted>,
}

/// All of them, in some minutes.
pub(crate) fn measured(seed: u64) -> Vec<Quoted> {
    let mut bench = Bench {
        seed,
        cache: Cache::default(),
        all: vec![],
    };
    for (what, measure) in [
        ("half space", Bench::half_space as fn(&mut Bench)),
        ("carbon", Bench::carbon),
        ("cascade", Bench::cascade),
        ("snowpacks", Bench::planes),
        ("deep absorbing slabs", Bench::deep),
        ("facetness", Bench::facetness),
        ("goniophotometer", Bench::grazing),
        ("noise", Bench::noise),
        ("optional axes", Bench::axes),
    ] {
        let before = cpu_time::ProcessTime::now();
        measure(&mut bench);
        eprintln!("{what}: {:.0} CPU-s", before.elapsed().as_secs_f64());
    }
    bench.all
}

impl Bench {
    fn say(&mut self, name: &str, Measured { value, se }: Measured, setting: &str) {
        self.all.push(Quoted::new(name, value, se, setting));
    }

    fn run(&self, case: &Case, engine: Engine, rays: u64) -> Vec<Spectrum> {
        let all = case.run(engine, rays, Resolution::default(), &self.cache, self.seed);
        all.unwrap_or_else(|error| panic!("{}: {error}", case.name))
    }

    /// Where light goes deepest of all that a config allows.
    fn half_space(&mut self) {
        let one = |x: f64| [x, x, x, 0.0];
        let clear = snow([6000.0; 2], one(0.0), one(1.0), 50.0);
        let mut case = Case::new("half space", clear, 0.0, &[], &[380.0, 390.0, 400.0]);
        case.thicknesses_m = vec![1000.0, 2000.0];
        let found = self.run(&case, Engine::Hybrid, 1024);
        let decays = (0..3).map(|l| {
            let [near, far] = [0, 1].map(|h| found[h].transmittance[l]);
            let rate = (near.value / far.value).ln() / 1000.0;
            let error = (near.se / near.value).hypot(far.se / far.value) / 1000.0;
            Measured {
                value: 1.0 / rate,
                se: error / (rate * rate),
            }
        });
        let deepest = decays.max_by(|a, b| a.value.total_cmp(&b.value));
        self.say("deepest decay", deepest.unwrap(), "e-fold, m");
    }

    /// Brown carbon by the two laws.
    fn carbon(&mut self) {
        let r = |bench: &Self, carbon, law| {
            let snow = Snow {
                brown_carbon: carbon,
                ..ordinary()
            };
            let mut case = Case::new("carbon", snow, 30.0, &[], &[400.0]);
            case.thicknesses_m = vec![0.05];
            case.model.carbon_law = law;
            bench.run(&case, Engine::Hybrid, WALKS)[0].reflectance[0]
        };
        for (name, law) in [
            ("brown carbon power", CarbonLaw::Power),
            ("brown carbon printed", CarbonLaw::Varsa2025),
        ] {
            for exponent in [1.0, 1.5, 2.0] {
                let carbon = Carbon {
                    angstrom_exponent: exponent,
                    ..Carbon::brown(500.0)
                };
                let found = r(self, Some(carbon), law);
                self.say(name, found, &format!("R at 400 nm, exponent {exponent}"));
            }
        }
        let clean = r(self, None, CarbonLaw::Power);
        self.say("brown carbon none", clean, "R at 400 nm");
    }

    /// How much less a cascade reflects than layers of one snowpack.
    fn cascade(&mut self) {
        let fine = snow([60.0, 140.0], [0.4, 0.6, 0.5, 0.072], SPHERICITY, 225.0);
        let basal = snow([900.0, 1000.0], [0.0, 0.2, 0.1, 0.072], SPHERICITY, 375.0);
        let mut found = vec![];
        for surface_m in [0.002, 0.005, 0.01] {
            for degrees in [0.0, 60.0] {
                let snowpack = over(fine.clone(), &[(basal.clone(), 10.0)], Substrate::Black);
                let mut case =
                    Case::new("cascade", snowpack, degrees, &[], &[450.0, 850.0, 1250.0]);
                case.thicknesses_m = vec![0.1 + surface_m];
                let plain = self.run(&case, Engine::Tabulated, 200_000).remove(0);
                let cascade = self.run(&case.cascaded(), Engine::Tabulated, 200_000);
                let pairs = plain.reflectance.iter().zip(&cascade[0].reflectance);
                for ((a, b), nm) in pairs.zip([450.0, 850.0, 1250.0]) {
                    let less = Measured {
                        value: a.value - b.value,
                        se: a.se.hypot(b.se),
                    };
                    let mm = 1e3 * surface_m;
                    found.push((
                        surface_m,
                        less,
                        format!("{mm} mm, {degrees} degrees, {nm} nm"),
                    ));
                }
            }
        }
        for (name, thin) in [("cascade on 2 mm", true), ("cascade from 5 mm", false)] {
            let those = found.iter().filter(|(h, ..)| (*h < 0.003) == thin);
            let most = those.max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs()));
            let (_, less, setting) = most.unwrap();
            self.say(name, *less, &format!("R less, {setting}"));
        }
    }

    /// Light across a plane between fine and coarse grains.
    fn planes(&mut self) {
        let snowpack = over(fresh(), &[(coarse(), 3.0)], Substrate::Black);
        let mut case = Case::new("planes", snowpack, 0.0, &[], &[550.0]);
        case.thicknesses_m = vec![0.04];
        for (name, engine, rays) in [
            ("fine on coarse spectral", Engine::Spectral, 200_000),
            ("fine on coarse hybrid", Engine::Hybrid, 2 * WALKS),
        ] {
            let t = self.run(&case, engine, rays)[0].transmittance[0];
            self.say(name, t, "T of 1 cm on 3 cm, 550 nm");
        }
    }

    /// How far `hybrid` is from `spectral` where little light is left.
    fn deep(&mut self) {
        let ordinary = ordinary();
        for (name, snow, nm, depths, rays) in [
            (
                "deep 1300 nm",
                ordinary.clone(),
                1300.0,
                &[6.0, 10.0, 20.0][..],
                1_000_000,
            ),
            (
                "deep 1850 nm",
                ordinary.clone(),
                1850.0,
                &[6.0, 10.0, 20.0],
                4_000_000,
            ),
            (
                "deep 1450 nm",
                ordinary.clone(),
                1450.0,
                &[6.0, 10.0],
                4_000_000,
            ),
            (
                "deep wet 1300 nm",
                wet(ordinary.clone(), 0.5),
                1300.0,
                &[10.0],
                1_000_000,
            ),
            (
                "deep wet 1450 nm",
                wet(ordinary, 0.5),
                1450.0,
                &[4.1],
                1_000_000,
            ),
        ] {
            let case = Case::new(name, snow, 0.0, depths, &[nm]);
            let exact = self.run(&case, Engine::Spectral, rays);
            let found = self.run(&case, Engine::Hybrid, 4 * WALKS);
            for ((a, b), depth) in found.iter().zip(&exact).zip(depths) {
                let (a, b) = (a.transmittance[0], b.transmittance[0]);
                let ratio = a.value / b.value;
                let more = Measured {
                    value: 100.0 * (ratio - 1.0),
                    se: 100.0 * ratio * (a.se / a.value).hypot(b.se / b.value),
                };
                self.say(
                    name,
                    more,
                    &format!("T of hybrid more, %, {depth} free distances"),
                );
            }
        }
        for k in [1e-3, 0.1] {
            let mut case = absorbing(k, 0.5);
            case.thicknesses_m = vec![case.thicknesses_m[3]];
            let t = self.run(&case, Engine::Hybrid, WALKS)[0].transmittance[0];
            self.say("black water", t, &format!("T of hybrid, k = {k:.0e}"));
        }
    }

    /// The jump at facetness 0.
    fn facetness(&mut self) {
        for f in [0.0, 1e-4, 0.01, 0.03, 0.1] {
            let law: Law = [f, f, f, 0.0];
            let snow = snow([300.0, 750.0], law, SPHERICITY, 275.0);
            let mut case = Case::new("facetness", snow, 0.0, &[], &[1030.0]);
            case.thicknesses_m = vec![0.12];
            let r = self.run(&case, Engine::Tabulated, 100_000)[0].reflectance[0];
            self.say(&format!("facetness {f}"), r, "R at 1030 nm");
        }
    }

    /// Sensors under more and more grazing light.
    fn grazing(&mut self) {
        let sensors = Sensors::new(1000);
        let (snowpack, model): (Snowpack, Model) = (ordinary().into(), Model::default());
        for degrees in [60.0, 80.0, 85.0, 89.0, 89.9] {
            let request = Request {
                snowpack: &snowpack,
                thicknesses_m: &[0.12],
                illuminations: &[light(degrees)],
                wavelengths_nm: &[600.0],
                model: &model,
                rays: 20_000,
                max_error: MaxError::default(),
                resolution: Resolution::default(),
                seed: self.seed,
                cell: 0,
            };
            let control = Control {
                parallel: true,
                cancel: &AtomicBool::new(false),
                rays_done: &AtomicU64::new(0),
                cache: &self.cache,
            };
            let exits = goniometer(Engine::Tabulated, &request, &sensors, &control).unwrap();
            let exits = &exits[0];
            let setting = format!("{degrees} degrees");
            self.say("grazing R", exits.reflectance, &setting);
            for (name, inner) in [("grazing within 80", true), ("grazing beyond 80", false)] {
                let those = (0..sensors.len())
                    .filter(|s| (sensors.centre_rad(*s)[0] < 80_f64.to_radians()) == inner)
                    .map(|s| (exits.reflected[s].se / exits.reflected[s].value).powi(2));
                let squares: Vec<f64> = those.collect();
                let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
                // of 32 parts
                let error = Measured {
                    value: 100.0 * rms,
                    se: 13.0 * rms,
                };
                self.say(name, error, &format!("standard error, %, {setting}"));
            }
            if degrees == 60.0 || degrees == 89.9 {
                let values = exits.reflected.iter();
                let peak = values.max_by(|a, b| a.value.total_cmp(&b.value)).unwrap();
                self.say("grazing peak", *peak, &format!("per sr, {setting}"));
            }
        }
    }

    /// Scatter of `hybrid` over seeds.
    fn noise(&mut self) {
        let snow = snow([450.0, 550.0], FACETNESS, SPHERICITY, 200.0);
        let mut case = Case::new("noise", snow, 0.0, &[], &[550.0]);
        case.thicknesses_m = vec![0.02];
        let seeds = 8;
        let found: Vec<Measured> = (0..seeds)
            .map(|i| {
                let (cache, seed) = (Cache::default(), 100 * self.seed + i);
                let all = case.run(
                    Engine::Hybrid,
                    2 * WALKS,
                    Resolution::default(),
                    &cache,
                    seed,
                );
                all.unwrap()[0].transmittance[0]
            })
            .collect();
        let n = seeds as f64;
        let mean = found.iter().map(|m| m.value).sum::<f64>() / n;
        let squares: f64 = found.iter().map(|m| (m.value - mean).powi(2)).sum();
        let scatter = (squares / (n - 1.0)).sqrt();
        let se = scatter / (2.0 * (n - 1.0)).sqrt();
        self.say(
            "noise of hybrid",
            Measured { value: scatter, se },
            "T, scatter over seeds",
        );
        let se = scatter / n.sqrt();
        self.say("noise of hybrid at", Measured { value: mean, se }, "T");
    }

    /// What straight lines of y = -ln T and -ln(1 - R) leave along the axes beyond the
    /// five, between their ends and with a node between them.
    fn axes(&mut self) {
        let sooty = |x: f64| {
            Snowpack::from(Snow {
                black_carbon: Some(Carbon::black(x)),
                ..base()
            })
        };
        let water = |x: f64| Snowpack::from(wet(base(), x));
        let warm = |x: f64| {
            Snowpack::from(Snow {
                temperature_c: x,
                ..base()
            })
        };
        let round = |x: f64| {
            let law = [x - 0.15, (x + 0.15).min(1.0), x, 0.064];
            Snowpack::from(snow([250.0, 350.0], FACETNESS, law, 275.0))
        };
        let substrate = |x: f64| over(base(), &[], Substrate::Grey(x));
        type Axis<'a> = (
            &'a str,
            [f64; 3],
            fn(f64) -> f64,
            fn(f64) -> f64,
            &'a dyn Fn(f64) -> Snowpack,
        );
        let axes: [Axis; 5] = [
            (
                "black carbon",
                [0.0, 150.0, 400.0],
                |c| (c + 20.0).sqrt(),
                |u| u * u - 20.0,
                &sooty,
            ),
            (
                "water saturation",
                [0.0, 0.1, 0.3],
                |s| -(1.0 - s).ln(),
                |u| 1.0 - (-u).exp(),
                &water,
            ),
            ("temperature", [-30.0, -10.0, 0.0], |t| t, |u| u, &warm),
            ("sphericity", [0.6, 0.8, 0.95], f64::ln, f64::exp, &round),
            (
                "substrate",
                [0.0, 0.5, 0.9],
                |r| -(1.0 - 0.95 * r).ln(),
                |u| (1.0 - (-u).exp()) / 0.95,
                &substrate,
            ),
        ];
        for (name, nodes, place, back, snowpack) in axes {
            let spectra = |bench: &Self, x: f64| {
                let nm: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
                let at = |degrees| {
                    let mut case = Case::new(name, snowpack(x), degrees, &[], &nm);
                    case.thicknesses_m = vec![0.02, 0.05, 0.1, 0.3];
                    bench.run(&case, Engine::Hybrid, WALKS)
                };
                [at(0.0), at(60.0)].concat()
            };
            let known = nodes.map(|x| (x, spectra(self, x)));
            let [first, _, last] = nodes.map(place);
            // sixths of the way between the ends
            let asked = [1.0, 2.0, 3.0, 4.0, 5.0].map(|i| back(first + (last - first) * i / 6.0));
            let truth = asked.map(|x| (x, spectra(self, x)));
            self.lines(
                &format!("axis {name}"),
                &known,
                &truth,
                place,
                Curve::Logarithm,
            );
            if name == "black carbon" {
                let name = "axis black carbon linear in c";
                self.lines(name, &known, &truth, |c| c, Curve::Logarithm);
                let name = "axis black carbon T itself";
                self.lines(name, &known, &truth, place, Curve::Itself);
            }
        }
    }

    /// What straight lines leave between the ends, and with a node between them.
    fn lines(
        &mut self,
        name: &str,
        known: &[(f64, Vec<Spectrum>); 3],
        truth: &[(f64, Vec<Spectrum>)],
        place: fn(f64) -> f64,
        curve: Curve,
    ) {
        let ends = [known[0].clone(), known[2].clone()];
        for (nodes, what) in [(&ends[..], "ends"), (&known[..], "three nodes")] {
            for (quantity, letter) in [(0, "T"), (1, "R")] {
                let found = off(nodes, truth, place, quantity, curve);
                for (found, which) in found.into_iter().zip(["mean", "largest"]) {
                    let setting = format!("{which} difference in L* of {letter}, {what}");
                    self.say(name, found, &setting);
                }
            }
        }
    }
}

/// Snow of the optional axes.
fn base() -> Snow {
    snow([250.0, 350.0], FACETNESS, SPHERICITY, 275.0)
}

/// What is drawn as a straight line.
#[derive(Clone, Copy, PartialEq)]
enum Curve {
    Logarithm,
    Itself,
}

/// Mean and largest difference in lightness of what is linear between nodes from the
/// truth. Errors are as if all wavelengths, and for the mean all spectra, erred together.
fn off(
    nodes: &[(f64, Vec<Spectrum>)],
    truth: &[(f64, Vec<Spectrum>)],
    place: fn(f64) -> f64,
    quantity: usize,
    curve: Curve,
) -> [Measured; 2] {
    let nm: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
    let colour = Colorimeter::new(&nm).unwrap().unwrap();
    // values, moved by some of their standard errors
    let moved = |spectrum: &Spectrum, errors: f64| -> Vec<f64> {
        let all = [&spectrum.transmittance, &spectrum.reflectance][quantity];
        all.iter().map(|m| m.value + errors * m.se).collect()
    };
    let bend = |x: f64| match (curve, quantity) {
        (Curve::Itself, _) => x,
        (_, 0) => -x.ln(),
        _ => -(1.0 - x).ln(),
    };
    let straighten = |y: f64| match (curve, quantity) {
        (Curve::Itself, _) => y,
        (_, 0) => (-y).exp(),
        _ => 1.0 - (-y).exp(),
    };
    let mut all: Vec<Measured> = vec![];
    for (x, spectra) in truth {
        let upper = (1..nodes.len() - 1).find(|i| nodes[*i].0 > *x);
        let upper = upper.unwrap_or(nodes.len() - 1);
        let [(a, low), (b, high)] = [&nodes[upper - 1], &nodes[upper]];
        let t = (place(*x) - place(*a)) / (place(*b) - place(*a));
        for ((low, high), exact) in low.iter().zip(high).zip(spectra) {
            let lightness = |low_errors: f64, high_errors: f64, exact_errors: f64| {
                let pairs = moved(low, low_errors).into_iter();
                let pairs = pairs.zip(moved(high, high_errors));
                let line: Vec<f64> = pairs
                    .map(|(a, b)| straighten((1.0 - t) * bend(a) + t * bend(b)))
                    .collect();
                colour.lab(&line).l - colour.lab(&moved(exact, exact_errors)).l
            };
            let value = lightness(0.0, 0.0, 0.0);
            let by = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let by = by.map(|[a, b, c]| (lightness(a, b, c) - value).powi(2));
            all.push(Measured {
                value: value.abs(),
                se: by.iter().sum::<f64>().sqrt(),
            });
        }
    }
    let n = all.len() as f64;
    let mean = Measured {
        value: all.iter().map(|m| m.value).sum::<f64>() / n,
        se: all.iter().map(|m| m.se).sum::<f64>() / n,
    };
    let largest = all.into_iter().max_by(|a, b| a.value.total_cmp(&b.value));
    [mean, largest.unwrap()]
}
