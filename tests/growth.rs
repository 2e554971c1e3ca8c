//! Growth of a database: a build that reuses nodes of other databases writes the same
//! bytes as a build from scratch. This requires that the result of a node does not depend
//! on the other nodes of the grid.
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
use splitsnow::batch::{self, BatchError, BatchOptions, BatchSummary, ReuseSource};
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

/// A simulation of one snowpack, of which thicknesses and incidence angles can be chosen.
struct Setup {
    engine: Engine,
    snowpack: Snowpack,
    model: Model,
    nm: Vec<f64>,
    max_error: MaxError,
}

impl Setup {
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

    /// Asserts that random subsets of the thicknesses and angles give the same spectra as
    /// the full lists, to the bit. With `all_slabs`, only the angles are subsets.
    fn assert_independent_nodes(&self, thicknesses_m: &[f64], angles_deg: &[f64], all_slabs: bool) {
        let whole = self.run(thicknesses_m, angles_deg);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        for _ in 0..5 {
            let mut random_subset = |n: usize| -> Vec<usize> {
                let mut chosen: Vec<usize> = (0..n).filter(|_| rng.random::<f64>() < 0.5).collect();
                if chosen.is_empty() {
                    chosen.push(n - 1);
                }
                chosen
            };
            let mut slab_indices = random_subset(thicknesses_m.len());
            let angle_indices = random_subset(angles_deg.len());
            if all_slabs {
                slab_indices = (0..thicknesses_m.len()).collect();
            }
            let some_thicknesses: Vec<f64> =
                slab_indices.iter().map(|i| thicknesses_m[*i]).collect();
            let some_angles: Vec<f64> = angle_indices.iter().map(|i| angles_deg[*i]).collect();
            let found = self.run(&some_thicknesses, &some_angles);
            let mut found = found.iter();
            for slab in &slab_indices {
                for angle in &angle_indices {
                    let expected = &whole[slab * angles_deg.len() + angle];
                    let node = (thicknesses_m[*slab], angles_deg[*angle]);
                    assert!(found.next() == Some(expected), "{:?} {node:?}", self.engine);
                }
            }
        }
    }
}

/// Dry snow on a black substrate; a layer of wet, sooty snow over dense snow on a grey
/// substrate, with both models of layering.
fn snowpacks() -> [(Snowpack, Model); 3] {
    let grid = grid(Engine::Hybrid);
    let job = grid.job(&grid.jobs().unwrap(), 0).unwrap();
    let dry = job.snowpack;
    let mut surface = dry.surface.clone();
    surface.water_saturation = 0.05;
    surface.black_carbon = Some(Carbon::black(50.0));
    let mut snow = dry.surface.clone();
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
        (dry, Model::default()),
        (layered.clone(), Model::default()),
        (layered, cascade),
    ]
}

/// `hybrid` traces whole walks through the thin slabs, but not through the thick ones.
const THICKNESSES_M: [f64; 4] = [0.006, 0.008, 0.03, 0.1];

#[test]
fn nodes_of_hybrid_are_independent() {
    for (snowpack, model) in snowpacks() {
        let setup = Setup {
            engine: Engine::Hybrid,
            snowpack,
            model,
            nm: vec![500.0, 900.0],
            max_error: MaxError::default(),
        };
        setup.assert_independent_nodes(&THICKNESSES_M, &[0.0, 40.0, 75.0], false);
    }
}

/// `auto` uses hybrid for most nodes, and walks alone at grazing incidence.
#[test]
fn nodes_of_auto_are_independent() {
    let (snowpack, model) = snowpacks()[0].clone();
    let setup = Setup {
        engine: Engine::Auto,
        snowpack,
        model,
        nm: vec![500.0],
        max_error: MaxError {
            delta_e: 5.0,
            rmse: 0.2,
        },
    };
    setup.assert_independent_nodes(&THICKNESSES_M, &[0.0, 75.0], false);
    setup.assert_independent_nodes(&[0.006, 0.02], &[0.0, 75.0, 89.7], true);
}

/// A fake engine. Its results identify the node. It counts the nodes that it simulates.
struct FakeEngine {
    engine: Engine,
    /// Number of nodes simulated.
    nodes: Mutex<u64>,
    /// Number of requests after which the engine reports an interruption.
    max_requests: u64,
    requests: AtomicU64,
}

impl FakeEngine {
    fn new(engine: Engine, max_requests: u64) -> Self {
        Self {
            engine,
            nodes: Mutex::new(0),
            max_requests,
            requests: AtomicU64::new(0),
        }
    }

    fn simulate(&self, request: &Request<'_>) -> Result<Vec<Spectrum>, EngineError> {
        if self.requests.fetch_add(1, Ordering::Relaxed) >= self.max_requests {
            return Err(EngineError::Cancelled);
        }
        // engines whose walks serve all thicknesses depend on the list of thicknesses
        let thickness_sum: f64 = match self.engine.has_independent_thicknesses() {
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
                let base = share(request.cell) + thickness_m + light + thickness_sum;
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

    fn build(&self, dir: &Path, grid: &Grid, from: &[&Path]) -> Result<BatchSummary, BatchError> {
        let file = Path::new("g.toml");
        let open = |path: &&Path| ReuseSource::open(path, grid, &inputs(), file);
        let sources: Vec<_> = from.iter().map(open).collect::<Result<_, _>>()?;
        let store = Store::build(dir, grid, &inputs(), Access::Exclusive)?;
        let options = BatchOptions {
            threads: 1,
            ..BatchOptions::default()
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

/// Builds a grid, with `from` as sources. Returns its directory and the numbers of nodes
/// simulated and reused.
fn build(grid: &Grid, from: &[&Path]) -> (tempfile::TempDir, u64, u64) {
    let dir = tempfile::tempdir().unwrap();
    let engine = FakeEngine::new(grid.run.engine, u64::MAX);
    let summary = engine.build(dir.path(), grid, from).unwrap();
    let nodes = *engine.nodes.lock().unwrap();
    (dir, nodes, summary.reused)
}

/// Values may be added to any axis or to several axes, and optional axes may be added.
#[test]
fn a_grown_database_equals_one_built_from_scratch() {
    type Change = (&'static str, fn(&mut Grid));
    let changes: [Change; 11] = [
        ("nothing", |_| ()),
        ("thickness", |g| {
            g.axes.values_mut(Parameter::Thickness).insert(1, 1.5)
        }),
        ("thinner", |g| {
            g.axes.set(Parameter::Thickness, vec![2.0]);
        }),
        // the larger grains do not fit into 2 mm
        ("absent curves", |g| {
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
        ("several axes", |g| {
            g.axes.set(Parameter::Thickness, vec![0.7, 1.0, 5.0, 9.0]);
            g.axes.set(Parameter::Incidence, vec![0.0, 30.0, 60.0]);
            g.axes.set(Parameter::GrainSize, vec![100.0, 150.0]);
        }),
    ];
    for engine in [Engine::Reference, Engine::Spectral, Engine::Hybrid] {
        let small = grid(engine);
        let (source, ..) = build(&small, &[]);
        for (name, change) in changes {
            let for_every_engine = matches!(name, "thickness" | "angle" | "several axes");
            if engine != Engine::Hybrid && !for_every_engine {
                continue;
            }
            let mut grown = small.clone();
            change(&mut grown);
            let (scratch, ..) = build(&grown, &[]);
            let (dir, simulated, reused) = build(&grown, &[source.path()]);
            let case = format!("{name}, {}", engine.name());
            assert_same(&dir_bytes(scratch.path()), &dir_bytes(dir.path()));
            let nodes = match name {
                "absent curves" => 24 + 4,
                "diffuse" => 24 + 12,
                _ => grown.jobs().unwrap().curves(),
            };
            assert_eq!(simulated + reused, nodes, "{case}");
            let expected = match (name, engine) {
                // all thicknesses share their walks, so a new thickness changes all nodes
                ("thickness" | "several axes", Engine::Spectral) => 0,
                // lost rays are counted per job: if a job has lost rays, its nodes can only be
                // reused together
                ("thinner", Engine::Hybrid) => 0,
                ("several axes", Engine::Hybrid) => 0,
                // the new grid keeps 2 thicknesses, 2 angles, 1 size and 2 facetnesses
                ("several axes", _) => 2 * 2 * 2,
                _ => 24,
            };
            assert_eq!(reused, expected, "{case}");
        }
        // a damaged job of the source is simulated again
        let chunk = source
            .path()
            .join("database.zarr/reflectance/c.0.0.0.0.0.0");
        let mut bytes = fs::read(&chunk).unwrap();
        bytes[5] ^= 1;
        fs::write(&chunk, bytes).unwrap();
        let (scratch, ..) = build(&small, &[]);
        let database = source.path().join("database.zarr");
        let (dir, simulated, _) = build(&small, &[&database]);
        assert_same(&dir_bytes(scratch.path()), &dir_bytes(dir.path()));
        assert_eq!(simulated, small.jobs().unwrap().curves_per_job());
    }
}

/// A build with two sources is interrupted again and again.
#[test]
fn interrupted_growth_continues() {
    let small = grid(Engine::Hybrid);
    let mut other = small.clone();
    other.axes.set(Parameter::Facetness, vec![0.2, 0.5]);
    let mut grown = small.clone();
    grown.axes.set(Parameter::Facetness, vec![0.05, 0.2, 0.5]);
    grown.axes.values_mut(Parameter::Incidence).push(75.0);
    let ((first, ..), (second, ..), (scratch, ..)) =
        (build(&small, &[]), build(&other, &[]), build(&grown, &[]));
    let sources = [first.path(), second.path()];
    let dir = tempfile::tempdir().unwrap();
    let mut interruptions = 0;
    for requests in 0.. {
        let engine = FakeEngine::new(Engine::Hybrid, requests % 3);
        match engine.build(dir.path(), &grown, &sources) {
            Ok(_) => break,
            Err(BatchError::Interrupted { .. }) => interruptions += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(interruptions > 3, "{interruptions}");
    assert_same(&dir_bytes(scratch.path()), &dir_bytes(dir.path()));
}

#[test]
fn sources_with_other_settings_are_refused() {
    let small = grid(Engine::Hybrid);
    let (source, ..) = build(&small, &[]);
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
        let engine = FakeEngine::new(other.run.engine, 0);
        let error = engine.build(dir.path(), &other, &[source.path()]);
        let error = error.unwrap_err().to_string();
        assert!(error.contains(&format!("with {key} = ")), "{key}: {error}");
        assert!(fs::read_dir(dir.path()).unwrap().next().is_none());
    }
}

/// The program adds one thickness to a finished database. It simulates only the new node.
/// The files equal those of a build from scratch.
#[test]
fn the_program_adds_a_thickness() {
    let dir = tempfile::tempdir().unwrap();
    let text = |thicknesses: &str| {
        format!(
            "version = 1\n[axes]\nfacetness = [0.3]\ngrain_size_um = [300]\ndensity_kg_m3 = [300]\nthickness_cm = [{thicknesses}]\nincidence_angle_deg = [0]\n[wavelengths]\nstart_nm = 400\nstop_nm = 700\nstep_nm = 50\n[run]\nrays = 1000\n"
        )
    };
    fs::write(dir.path().join("small.toml"), text("2, 5, 10")).unwrap();
    fs::write(dir.path().join("grown.toml"), text("2, 5, 10, 20")).unwrap();
    let run = |args: &str| {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command.current_dir(dir.path());
        let output = command.args(args.split_whitespace()).output().unwrap();
        let text = [output.stdout.as_slice(), &output.stderr].concat();
        (output.status.success(), String::from_utf8(text).unwrap())
    };
    let build = |args: &str| {
        let (success, text) = run(args);
        assert!(success, "{text}");
        text
    };
    build("build small.toml");
    let (success, text) = run("build grown.toml --out out/small");
    assert!(!success && text.contains("--from out/small"), "{text}");
    let (success, text) = run("build small.toml --fresh --from out/small");
    assert!(
        !success && text.contains("--fresh would delete out/small"),
        "{text}"
    );
    let text = build("build grown.toml --from out/small");
    assert!(text.contains("reused 3 of 4 nodes"), "{text}");
    build("build grown.toml --out out/scratch");
    let bytes = |name: &str| dir_bytes(&dir.path().join(name));
    assert_same(&bytes("out/scratch"), &bytes("out/grown"));
}
