//! Numbers quoted in the documentation that are simulated, with their standard errors.
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

/// Number of walks of `hybrid`.
const WALKS: u64 = 65_536;

/// Simulations with one seed, and the rows computed from them.
pub(crate) struct Bench {
    seed: u64,
    cache: Cache,
    rows: Vec<Quoted>,
}

/// Computes all numbers, in some minutes.
pub(crate) fn measured(seed: u64) -> Vec<Quoted> {
    let mut bench = Bench {
        seed,
        cache: Cache::default(),
        rows: vec![],
    };
    for (topic, measure) in [
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
        let start = cpu_time::ProcessTime::now();
        measure(&mut bench);
        eprintln!("{topic}: {:.0} CPU-s", start.elapsed().as_secs_f64());
    }
    bench.rows
}

impl Bench {
    fn add(&mut self, name: &str, Measured { value, se }: Measured, setting: &str) {
        self.rows.push(Quoted::new(name, value, se, setting));
    }

    fn run(&self, case: &Case, engine: Engine, rays: u64) -> Vec<Spectrum> {
        let spectra = case.run(engine, rays, Resolution::default(), &self.cache, self.seed);
        spectra.unwrap_or_else(|error| panic!("{}: {error}", case.name))
    }

    /// Largest e-folding depth of light in any snow that a config allows.
    fn half_space(&mut self) {
        let constant = |x: f64| [x, x, x, 0.0];
        let clear = snow([6000.0; 2], constant(0.0), constant(1.0), 50.0);
        let mut case = Case::new("half space", clear, 0.0, &[], &[380.0, 390.0, 400.0]);
        case.thicknesses_m = vec![1000.0, 2000.0];
        let spectra = self.run(&case, Engine::Hybrid, 1024);
        let decays = (0..3).map(|l| {
            let [near, far] = [0, 1].map(|h| spectra[h].transmittance[l]);
            let rate = (near.value / far.value).ln() / 1000.0;
            let error = (near.se / near.value).hypot(far.se / far.value) / 1000.0;
            Measured {
                value: 1.0 / rate,
                se: error / (rate * rate),
            }
        });
        let deepest = decays.max_by(|a, b| a.value.total_cmp(&b.value));
        self.add("deepest decay", deepest.unwrap(), "e-fold, m");
    }

    /// Reflectance with brown carbon by the two laws.
    fn carbon(&mut self) {
        let reflectance = |bench: &Self, carbon, law| {
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
                let r = reflectance(self, Some(carbon), law);
                self.add(name, r, &format!("R at 400 nm, exponent {exponent}"));
            }
        }
        let clean = reflectance(self, None, CarbonLaw::Power);
        self.add("brown carbon none", clean, "R at 400 nm");
    }

    /// Difference in reflectance between the layers of one snowpack and a cascade.
    fn cascade(&mut self) {
        let fine = snow([60.0, 140.0], [0.4, 0.6, 0.5, 0.072], SPHERICITY, 225.0);
        let basal = snow([900.0, 1000.0], [0.0, 0.2, 0.1, 0.072], SPHERICITY, 375.0);
        let mut differences = vec![];
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
                    let difference = Measured {
                        value: a.value - b.value,
                        se: a.se.hypot(b.se),
                    };
                    let mm = 1e3 * surface_m;
                    differences.push((
                        surface_m,
                        difference,
                        format!("{mm} mm, {degrees} degrees, {nm} nm"),
                    ));
                }
            }
        }
        for (name, is_thin) in [("cascade on 2 mm", true), ("cascade from 5 mm", false)] {
            let selected = differences.iter().filter(|(h, ..)| (*h < 0.003) == is_thin);
            let largest = selected.max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs()));
            let (_, difference, setting) = largest.unwrap();
            self.add(name, *difference, &format!("R less, {setting}"));
        }
    }

    /// Transmittance across a plane between fine and coarse grains.
    fn planes(&mut self) {
        let snowpack = over(fresh(), &[(coarse(), 3.0)], Substrate::Black);
        let mut case = Case::new("planes", snowpack, 0.0, &[], &[550.0]);
        case.thicknesses_m = vec![0.04];
        for (name, engine, rays) in [
            ("fine on coarse spectral", Engine::Spectral, 200_000),
            ("fine on coarse hybrid", Engine::Hybrid, 2 * WALKS),
        ] {
            let t = self.run(&case, engine, rays)[0].transmittance[0];
            self.add(name, t, "T of 1 cm on 3 cm, 550 nm");
        }
    }

    /// Difference of `hybrid` from `spectral` where little light is left.
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
            let spectral = self.run(&case, Engine::Spectral, rays);
            let hybrid = self.run(&case, Engine::Hybrid, 4 * WALKS);
            for ((a, b), depth) in hybrid.iter().zip(&spectral).zip(depths) {
                let (a, b) = (a.transmittance[0], b.transmittance[0]);
                let ratio = a.value / b.value;
                let excess = Measured {
                    value: 100.0 * (ratio - 1.0),
                    se: 100.0 * ratio * (a.se / a.value).hypot(b.se / b.value),
                };
                self.add(
                    name,
                    excess,
                    &format!("T of hybrid more, %, {depth} free distances"),
                );
            }
        }
        for k in [1e-3, 0.1] {
            let mut case = absorbing(k, 0.5);
            case.thicknesses_m = vec![case.thicknesses_m[3]];
            let t = self.run(&case, Engine::Hybrid, WALKS)[0].transmittance[0];
            self.add("black water", t, &format!("T of hybrid, k = {k:.0e}"));
        }
    }

    /// The jump of reflectance at facetness 0.
    fn facetness(&mut self) {
        for f in [0.0, 1e-4, 0.01, 0.03, 0.1] {
            let law: Law = [f, f, f, 0.0];
            let snow = snow([300.0, 750.0], law, SPHERICITY, 275.0);
            let mut case = Case::new("facetness", snow, 0.0, &[], &[1030.0]);
            case.thicknesses_m = vec![0.12];
            let r = self.run(&case, Engine::Tabulated, 100_000)[0].reflectance[0];
            self.add(&format!("facetness {f}"), r, "R at 1030 nm");
        }
    }

    /// Standard errors of sensors at increasingly grazing incidence.
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
            self.add("grazing R", exits.reflectance, &setting);
            for (name, is_inner) in [("grazing within 80", true), ("grazing beyond 80", false)] {
                let squares = (0..sensors.len())
                    .filter(|s| (sensors.centre_rad(*s)[0] < 80_f64.to_radians()) == is_inner)
                    .map(|s| (exits.reflected[s].se / exits.reflected[s].value).powi(2));
                let squares: Vec<f64> = squares.collect();
                let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
                // standard errors from 32 parts are known to 13 %
                let error = Measured {
                    value: 100.0 * rms,
                    se: 13.0 * rms,
                };
                self.add(name, error, &format!("standard error, %, {setting}"));
            }
            if degrees == 60.0 || degrees == 89.9 {
                let values = exits.reflected.iter();
                let peak = values.max_by(|a, b| a.value.total_cmp(&b.value)).unwrap();
                self.add("grazing peak", *peak, &format!("per sr, {setting}"));
            }
        }
    }

    /// Scatter of the results of `hybrid` over seeds.
    fn noise(&mut self) {
        let snow = snow([450.0, 550.0], FACETNESS, SPHERICITY, 200.0);
        let mut case = Case::new("noise", snow, 0.0, &[], &[550.0]);
        case.thicknesses_m = vec![0.02];
        let seeds = 8;
        let results: Vec<Measured> = (0..seeds)
            .map(|i| {
                let (cache, seed) = (Cache::default(), 100 * self.seed + i);
                let spectra = case.run(
                    Engine::Hybrid,
                    2 * WALKS,
                    Resolution::default(),
                    &cache,
                    seed,
                );
                spectra.unwrap()[0].transmittance[0]
            })
            .collect();
        let n = seeds as f64;
        let mean = results.iter().map(|m| m.value).sum::<f64>() / n;
        let squares: f64 = results.iter().map(|m| (m.value - mean).powi(2)).sum();
        let scatter = (squares / (n - 1.0)).sqrt();
        let se = scatter / (2.0 * (n - 1.0)).sqrt();
        self.add(
            "noise of hybrid",
            Measured { value: scatter, se },
            "T, scatter over seeds",
        );
        let se = scatter / n.sqrt();
        self.add("noise of hybrid at", Measured { value: mean, se }, "T");
    }

    /// Interpolation errors along the optional axes, with y = -ln T and -ln(1 - R)
    /// interpolated linearly between the ends, and with one more node between them.
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
        for (name, nodes, coordinate, inverse, snowpack) in axes {
            let spectra = |bench: &Self, x: f64| {
                let nm: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
                let spectra_at = |degrees| {
                    let mut case = Case::new(name, snowpack(x), degrees, &[], &nm);
                    case.thicknesses_m = vec![0.02, 0.05, 0.1, 0.3];
                    bench.run(&case, Engine::Hybrid, WALKS)
                };
                [spectra_at(0.0), spectra_at(60.0)].concat()
            };
            let at_nodes = nodes.map(|x| (x, spectra(self, x)));
            let [first, _, last] = nodes.map(coordinate);
            // sixths of the way between the ends
            let between =
                [1.0, 2.0, 3.0, 4.0, 5.0].map(|i| inverse(first + (last - first) * i / 6.0));
            let simulated = between.map(|x| (x, spectra(self, x)));
            self.interpolation_errors(
                &format!("axis {name}"),
                &at_nodes,
                &simulated,
                coordinate,
                Transform::Logarithm,
            );
            if name == "black carbon" {
                let name = "axis black carbon linear in c";
                self.interpolation_errors(name, &at_nodes, &simulated, |c| c, Transform::Logarithm);
                let name = "axis black carbon T itself";
                self.interpolation_errors(
                    name,
                    &at_nodes,
                    &simulated,
                    coordinate,
                    Transform::Identity,
                );
            }
        }
    }

    /// Interpolation errors between the ends, and with one more node between them.
    fn interpolation_errors(
        &mut self,
        name: &str,
        at_nodes: &[(f64, Vec<Spectrum>); 3],
        simulated: &[(f64, Vec<Spectrum>)],
        coordinate: fn(f64) -> f64,
        transform: Transform,
    ) {
        let ends = [at_nodes[0].clone(), at_nodes[2].clone()];
        for (nodes, count) in [(&ends[..], "ends"), (&at_nodes[..], "three nodes")] {
            for (quantity, letter) in [(0, "T"), (1, "R")] {
                let errors = lightness_errors(nodes, simulated, coordinate, quantity, transform);
                for (error, which) in errors.into_iter().zip(["mean", "largest"]) {
                    let setting = format!("{which} difference in L* of {letter}, {count}");
                    self.add(name, error, &setting);
                }
            }
        }
    }
}

/// Snow for the optional axes.
fn base() -> Snow {
    snow([250.0, 350.0], FACETNESS, SPHERICITY, 275.0)
}

/// Function of R or T that is interpolated linearly.
#[derive(Clone, Copy, PartialEq)]
enum Transform {
    /// -ln T or -ln(1 - R).
    Logarithm,
    /// T or R.
    Identity,
}

/// Mean and largest difference in lightness between interpolated and simulated spectra.
/// Standard errors are upper bounds: the errors of all wavelengths, and for the mean those
/// of all spectra, are taken as fully correlated.
fn lightness_errors(
    nodes: &[(f64, Vec<Spectrum>)],
    simulated: &[(f64, Vec<Spectrum>)],
    coordinate: fn(f64) -> f64,
    quantity: usize,
    transform: Transform,
) -> [Measured; 2] {
    let nm: Vec<f64> = (40..=70).map(|i| 10.0 * f64::from(i)).collect();
    let colour = Colorimeter::new(&nm).unwrap().unwrap();
    // values plus `errors` standard errors
    let shifted = |spectrum: &Spectrum, errors: f64| -> Vec<f64> {
        let values = [&spectrum.transmittance, &spectrum.reflectance][quantity];
        values.iter().map(|m| m.value + errors * m.se).collect()
    };
    let forward = |x: f64| match (transform, quantity) {
        (Transform::Identity, _) => x,
        (_, 0) => -x.ln(),
        _ => -(1.0 - x).ln(),
    };
    let inverse = |y: f64| match (transform, quantity) {
        (Transform::Identity, _) => y,
        (_, 0) => (-y).exp(),
        _ => 1.0 - (-y).exp(),
    };
    let mut differences: Vec<Measured> = vec![];
    for (x, spectra) in simulated {
        let upper = (1..nodes.len() - 1).find(|i| nodes[*i].0 > *x);
        let upper = upper.unwrap_or(nodes.len() - 1);
        let [(a, low), (b, high)] = [&nodes[upper - 1], &nodes[upper]];
        let t = (coordinate(*x) - coordinate(*a)) / (coordinate(*b) - coordinate(*a));
        for ((low, high), exact) in low.iter().zip(high).zip(spectra) {
            let lightness = |low_errors: f64, high_errors: f64, exact_errors: f64| {
                let pairs = shifted(low, low_errors).into_iter();
                let pairs = pairs.zip(shifted(high, high_errors));
                let interpolated: Vec<f64> = pairs
                    .map(|(a, b)| inverse((1.0 - t) * forward(a) + t * forward(b)))
                    .collect();
                colour.lab(&interpolated).l - colour.lab(&shifted(exact, exact_errors)).l
            };
            let value = lightness(0.0, 0.0, 0.0);
            let shifts = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let squares = shifts.map(|[a, b, c]| (lightness(a, b, c) - value).powi(2));
            differences.push(Measured {
                value: value.abs(),
                se: squares.iter().sum::<f64>().sqrt(),
            });
        }
    }
    let n = differences.len() as f64;
    let mean = Measured {
        value: differences.iter().map(|m| m.value).sum::<f64>() / n,
        se: differences.iter().map(|m| m.se).sum::<f64>() / n,
    };
    let largest = differences
        .into_iter()
        .max_by(|a, b| a.value.total_cmp(&b.value));
    [mean, largest.unwrap()]
}
