//! A database that grows: nodes depend on nothing but themselves, and what another
//! database has is taken over from there, to the byte of a database built whole.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::common::{assert_same, dir_bytes, grid, share};
use assert_cmd::cargo::cargo_bin;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use splitsnow::batch::{self, BatchError, Options, ReuseSource, Summary};
use splitsnow::engine::{Cache, Control, Engine, EngineError, MaxError, Request, Resolution};
use splitsnow::grid::Grid;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Carbon;
use splitsnow::parameter::Parameter;
use splitsnow::store::{Access, Store};
use splitsnow::transport::{Illumination, Joining, Layer, Model, Snowpack, Substrate};

fn inputs() -> BTreeMap<String, String> {
    BTreeMap::from([("data.ice".to_string(), "0123".to_string())])
}

/// Thicknesses and angles of a snow, and what it was asked for in all.
struct Asked {
    engine: Engine,
    snowpack: Snowpack,
    model: Model,
    nm: Vec<f64>,
    max_error: MaxError,
}

impl Asked {
    fn run(&self, thicknesses_m: &[f64], angles_deg: &[f64]) -> Vec<Spectrum> {
        let light = |deg: &f64| Illumination::Collimated {
            polar_angle_rad: deg.to_radians(),
        };
        let illuminations: Vec<_> = angles_deg.iter().map(light).collect();
        let request = Request {
            snowpack: &self.snowpack,
            thicknesses_m,
            illuminations: &illuminations,
            wavelengths_nm: &self.nm,
            model: &self.model,
            rays: 600,
            max_error: self.max_error,
            resolution: Resolution {
                table: 1 << 12,
                grains: 1 << 13,
                streams: 4,
            },
            seed: 3,
            cell: 11,
        };
        let control = Control {
            parallel: false,
            cancel: &AtomicBool::new(false),
            rays_done: &AtomicU64::new(0),
            cache: &Cache::default(),
        };
        self.engine.run(&request, &control).unwrap()
    }

    /// Random parts of the lists give the same spectra, to the bit.
    fn check(&self, thicknesses_m: &[f64], angles_deg: &[f64], all_slabs: bool) {
        let whole = self.run(thicknesses_m, angles_deg);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        for _ in 0..5 {
            let mut some = |n: usize| -> Vec<usize> {
                let mut chosen: Vec<usize> = (0..n).filter(|_| rng.random::<f64>() < 0.5).collect();
                if chosen.is_empty() {
                    chosen.push(n - 1);
                }
                chosen
            };
            let mut slabs = some(thicknesses_m.len());
            let lights = some(angles_deg.len());
            if all_slabs {
                slabs = (0..thicknesses_m.len()).collect();
            }
            let h: Vec<f64> = slabs.iter().map(|i| thicknesses_m[*i]).collect();
            let a: Vec<f64> = lights.iter().map(|i| angles_deg[*i]).collect();
            let found = self.run(&h, &a);
            let mut found = found.iter();
            for slab in &slabs {
                for light in &lights {
                    let expected = &whole[slab * angles_deg.len() + light];
                    let at = (thicknesses_m[*slab], angles_deg[*light]);
                    assert!(found.next() == Some(expected), "{:?} {at:?}", self.engine);
                }
            }
        }
    }
}

/// Dry snow on black substrate; wet and sooty snow on ice-like snow on grey substrate.
fn snowpacks() -> [(Snowpack, Model); 3] {
    let grid = grid(Engine::Hybrid);
    let job = grid.job(&grid.jobs().unwrap(), 0).unwrap();
    let plain = job.snowpack;
    let mut surface = plain.surface.clone();
    surface.water_saturation = 0.05;
    surface.black_carbon = Some(Carbon::black(50.0));
    let mut snow = plain.surface.clone();
    snow.density_kg_m3 = 400.0;
    let below = vec![Layer {
        snow,
        thickness_m: 0.004,
    }];
    let substrate = Substrate::Grey(0.3);
    let layered = Snowpack {
        surface,
        below,
        substrate,
    };
    let cascade = Model {
        joining: Joining::Cascade,
        ..Model::default()
    };
    [
        (plain, Model::default()),
        (layered.clone(), Model::default()),
        (layered, cascade),
    ]
}

/// Between them are slabs that are walked from plane to plane.
const THICKNESSES_M: [f64; 4] = [0.006, 0.008, 0.03, 0.1];

#[test]
fn nodes_of_hybrid_depend_on_nothing_else() {
    for (snowpack, model) in snowpacks() {
        let asked = Asked {
            engine: Engine::Hybrid,
            snowpack,
            model,
            nm: vec![500.0, 900.0],
            max_error: MaxError::default(),
        };
        asked.check(&THICKNESSES_M, &[0.0, 40.0, 75.0], false);
    }
}

/// Between hybrid and, at grazing incidence, walks all the way.
#[test]
fn nodes_of_auto_depend_on_nothing_else() {
    let (snowpack, model) = snowpacks()[0].clone();
    let asked = Asked {
        engine: Engine::Auto,
        snowpack,
        model,
        nm: vec![500.0],
        max_error: MaxError {
            delta_e: 5.0,
            rmse: 0.2,
        },
    };
    asked.check(&THICKNESSES_M, &[0.0, 75.0], false);
    asked.check(&[0.006, 0.02], &[0.0, 75.0, 89.7], true);
}

/// What stands in for an engine says of each node who it is, and counts it.
struct Counted {
    engine: Engine,
    nodes: Mutex<u64>,
    /// After so many requests it is interrupted.
    most: u64,
    requests: AtomicU64,
}

impl Counted {
    fn new(engine: Engine, most: u64) -> Self {
        Self {
            engine,
            nodes: Mutex::new(0),
            most,
            requests: AtomicU64::new(0),
        }
    }

    fn simulate(&self, request: &Request<'_>) -> Result<Vec<Spectrum>, EngineError> {
        if self.requests.fetch_add(1, Ordering::Relaxed) >= self.most {
            return Err(EngineError::Cancelled);
        }
        let together: f64 = match self.engine.has_independent_thicknesses() {
            true => 0.0,
            false => request.thicknesses_m.iter().sum(),
        };
        let mut spectra = Vec::new();
        for thickness_m in request.thicknesses_m {
            for light in request.illuminations {
                let light = match light {
                    Illumination::Collimated { polar_angle_rad } => *polar_angle_rad,
                    Illumination::Diffuse => 2.0,
                };
                let base = share(request.cell) + thickness_m + light + together;
                let value = |nm: &f64| Measured {
                    value: (base * nm).sin().abs(),
                    se: (base / nm).cos().abs(),
                };
                let nm = request.wavelengths_nm.iter();
                spectra.push(Spectrum {
                    reflectance: nm.clone().map(value).collect(),
                    transmittance: nm.clone().map(|nm| value(&(nm + 1.0))).collect(),
                    lost: nm
                        .map(|_| {
                            if *thickness_m > 0.04 {
                                base * 1e-6
                            } else {
                                0.0
                            }
                        })
                        .collect(),
                });
            }
        }
        *self.nodes.lock().unwrap() += spectra.len() as u64;
        Ok(spectra)
    }

    fn build(&self, dir: &Path, grid: &Grid, from: &[&Path]) -> Result<Summary, BatchError> {
        let file = Path::new("g.toml");
        let open = |path: &&Path| ReuseSource::open(path, grid, &inputs(), file);
        let sources: Vec<_> = from.iter().map(open).collect::<Result<_, _>>()?;
        let store = Store::build(dir, grid, &inputs(), Access::Exclusive)?;
        let options = Options {
            threads: 1,
            ..Options::default()
        };
        let cancel = AtomicBool::new(false);
        batch::run_from(
            grid,
            &store,
            &sources,
            |r, _| self.simulate(r),
            &options,
            &cancel,
        )
    }
}

/// The grid, its directory, and what was simulated for it.
fn built(grid: &Grid, from: &[&Path]) -> (tempfile::TempDir, u64, u64) {
    let dir = tempfile::tempdir().unwrap();
    let engine = Counted::new(grid.run.engine, u64::MAX);
    let summary = engine.build(dir.path(), grid, from).unwrap();
    let nodes = *engine.nodes.lock().unwrap();
    (dir, nodes, summary.reused)
}

/// Any axis may grow, alone or with others, and an optional axis may begin.
#[test]
fn a_grown_database_is_the_one_built_whole() {
    type Change = (&'static str, fn(&mut Grid));
    let changes: [Change; 11] = [
        ("nothing", |_| ()),
        ("thickness", |g| {
            g.axes.values_mut(Parameter::Thickness).insert(1, 1.5)
        }),
        ("thinner", |g| {
            g.axes.set(Parameter::Thickness, vec![2.0]);
        }),
        // 2 mm are too thin for the larger grains
        ("corner", |g| {
            g.axes.values_mut(Parameter::Thickness).insert(0, 0.2)
        }),
        ("diffuse", |g| g.fixed.diffuse = true),
        ("angle", |g| {
            g.axes.values_mut(Parameter::Incidence).push(75.0)
        }),
        ("facetness", |g| {
            g.axes.values_mut(Parameter::Facetness).insert(1, 0.2)
        }),
        ("density", |g| {
            g.axes.values_mut(Parameter::Density).insert(0, 200.0)
        }),
        ("black carbon", |g| {
            let values = vec![0.0, 30.0];
            g.axes.set(Parameter::BlackCarbon, values);
        }),
        ("water", |g| {
            let values = vec![0.0, 0.1];
            g.axes.set(Parameter::WaterSaturation, values);
        }),
        ("all", |g| {
            g.axes.set(Parameter::Thickness, vec![0.7, 1.0, 5.0, 9.0]);
            g.axes.set(Parameter::Incidence, vec![0.0, 30.0, 60.0]);
            g.axes.set(Parameter::GrainSize, vec![100.0, 150.0]);
        }),
    ];
    for engine in [Engine::Reference, Engine::Spectral, Engine::Hybrid] {
        let small = grid(engine);
        let (before, ..) = built(&small, &[]);
        for (name, change) in changes {
            let most = matches!(name, "thickness" | "angle" | "all");
            if engine != Engine::Hybrid && !most {
                continue;
            }
            let mut grown = small.clone();
            change(&mut grown);
            let (whole, ..) = built(&grown, &[]);
            let (dir, simulated, reused) = built(&grown, &[before.path()]);
            let at = format!("{name}, {}", engine.name());
            assert_same(&dir_bytes(whole.path()), &dir_bytes(dir.path()));
            let nodes = match name {
                "corner" => 24 + 4,
                "diffuse" => 24 + 12,
                _ => grown.jobs().unwrap().curves(),
            };
            assert_eq!(simulated + reused, nodes, "{at}");
            let expected = match (name, engine) {
                // one walk serves all thicknesses of a snow under a light
                ("thickness" | "all", Engine::Spectral) => 0,
                // of two thicknesses, one may have lost rays: of which, is not stored
                ("thinner", Engine::Hybrid) => 0,
                // 2 thicknesses, 2 angles, a size, two facetnesses
                ("all", Engine::Hybrid) => 0,
                ("all", _) => 2 * 2 * 2,
                _ => 24,
            };
            assert_eq!(reused, expected, "{at}");
        }
        // a job of a source that is torn is simulated again
        let chunk = before
            .path()
            .join("database.zarr/reflectance/c.0.0.0.0.0.0");
        let mut bytes = fs::read(&chunk).unwrap();
        bytes[5] ^= 1;
        fs::write(&chunk, bytes).unwrap();
        let (whole, ..) = built(&small, &[]);
        let database = before.path().join("database.zarr");
        let (dir, simulated, _) = built(&small, &[&database]);
        assert_same(&dir_bytes(whole.path()), &dir_bytes(dir.path()));
        assert_eq!(simulated, small.jobs().unwrap().curves_per_job());
    }
}

/// Several sources, and an end at any moment.
#[test]
fn growth_goes_on_where_it_stopped() {
    let small = grid(Engine::Hybrid);
    let mut other = small.clone();
    other.axes.set(Parameter::Facetness, vec![0.2, 0.5]);
    let mut grown = small.clone();
    grown.axes.set(Parameter::Facetness, vec![0.05, 0.2, 0.5]);
    grown.axes.values_mut(Parameter::Incidence).push(75.0);
    let ((a, ..), (b, ..), (whole, ..)) =
        (built(&small, &[]), built(&other, &[]), built(&grown, &[]));
    let from = [a.path(), b.path()];
    let dir = tempfile::tempdir().unwrap();
    let mut ends = 0;
    for requests in 0.. {
        let engine = Counted::new(Engine::Hybrid, requests % 3);
        match engine.build(dir.path(), &grown, &from) {
            Ok(_) => break,
            Err(BatchError::Interrupted { .. }) => ends += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(ends > 3, "{ends}");
    assert_same(&dir_bytes(whole.path()), &dir_bytes(dir.path()));
}

#[test]
fn databases_of_other_nodes_are_refused() {
    let small = grid(Engine::Hybrid);
    let (before, ..) = built(&small, &[]);
    type Change = (&'static str, fn(&mut Grid));
    let changes: [Change; 8] = [
        ("run.seed", |g| g.run.seed += 1),
        ("run.rays", |g| g.run.rays += 1),
        ("run.engine", |g| g.run.engine = Engine::Spectral),
        ("wavelengths.values_nm", |g| g.wavelengths_nm.push(800.0)),
        ("spread.facetness_sd", |g| g.spread.facetness_sd = 0.1),
        ("fixed.temperature_c", |g| g.fixed.temperature_c = -5.0),
        ("fixed.substrate", |g| {
            g.fixed.substrate = Substrate::Grey(0.2)
        }),
        ("fixed.black_carbon", |g| {
            g.fixed.black_carbon = Some(Carbon::black(10.0));
        }),
    ];
    for (key, change) in changes {
        let mut other = small.clone();
        change(&mut other);
        let dir = tempfile::tempdir().unwrap();
        let engine = Counted::new(other.run.engine, 0);
        let error = engine.build(dir.path(), &other, &[before.path()]);
        let error = error.unwrap_err().to_string();
        assert!(error.contains(&format!("with {key} = ")), "{key}: {error}");
        assert!(fs::read_dir(dir.path()).unwrap().next().is_none());
    }
}

/// A finished table, then one more thickness, with the program: only the new node
/// is walked, and the files are those of a table built whole.
#[test]
fn one_more_thickness() {
    let dir = tempfile::tempdir().unwrap();
    let text = |thicknesses: &str| {
        format!(
            "version = 1\n[axes]\nfacetness = [0.3]\ngrain_size_um = [300]\ndensity_kg_m3 = [300]\nthickness_cm = [{thicknesses}]\nincidence_angle_deg = [0]\n[wavelengths]\nstart_nm = 400\nstop_nm = 700\nstep_nm = 50\n[run]\nrays = 1000\n"
        )
    };
    fs::write(dir.path().join("odd.toml"), text("2, 5, 10")).unwrap();
    fs::write(dir.path().join("more.toml"), text("2, 5, 10, 20")).unwrap();
    let run = |args: &str| {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command.current_dir(dir.path());
        let output = command.args(args.split_whitespace()).output().unwrap();
        let text = [output.stdout.as_slice(), &output.stderr].concat();
        (output.status.success(), String::from_utf8(text).unwrap())
    };
    let built = |args: &str| {
        let (well, text) = run(args);
        assert!(well, "{text}");
        text
    };
    built("build odd.toml");
    let (well, text) = run("build more.toml --out out/odd");
    assert!(!well && text.contains("--from out/odd"), "{text}");
    let (well, text) = run("build odd.toml --fresh --from out/odd");
    assert!(
        !well && text.contains("--fresh would delete out/odd"),
        "{text}"
    );
    let text = built("build more.toml --from out/odd");
    assert!(text.contains("reused 3 of 4 nodes"), "{text}");
    built("build more.toml --out out/whole");
    let bytes = |name: &str| dir_bytes(&dir.path().join(name));
    assert_same(&bytes("out/whole"), &bytes("out/more"));
}
