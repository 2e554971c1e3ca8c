//! The database on disk: identical bytes for any number of threads, shards and
//! interruptions. Damage is detected, and foreign files are not touched.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use assert_cmd::cargo::cargo_bin;

use crate::common::{assert_same, dir_bytes, grid, share, simulate};
use splitsnow::batch::{self, BatchError, BatchOptions, BatchSummary};
use splitsnow::build::{self, CompressionRequest};
use splitsnow::colour::Viewing;
use splitsnow::compress::{Decomposition, curve_errors};
use splitsnow::engine::{Cache, Engine, EngineError};
use splitsnow::grid::{Grid, Shard};
use splitsnow::optics::Carbon;
use splitsnow::parameter::Parameter;
use splitsnow::store::{self, Access, Store, StoreError, Variable};
use splitsnow::transport::{Layer, Substrate};
use splitsnow::{Database, Quantity};

fn extra() -> BTreeMap<String, String> {
    BTreeMap::from([("data.ice".to_string(), "0123".to_string())])
}

fn open(dir: &Path, grid: &Grid) -> Result<Store, StoreError> {
    Store::build(dir, grid, &extra(), Access::Exclusive)
}

fn run(
    dir: &Path,
    grid: &Grid,
    threads: usize,
    shard: Option<Shard>,
) -> Result<BatchSummary, BatchError> {
    let access = shard.map_or(Access::Exclusive, Access::Shard);
    let store = Store::build(dir, grid, &extra(), access)?;
    let options = BatchOptions {
        threads,
        shard,
        progress: None,
    };
    batch::run(grid, &store, simulate, &options, &AtomicBool::new(false))
}

/// An uninterrupted build on one thread.
fn finished(grid: &Grid) -> (tempfile::TempDir, BTreeMap<String, Vec<u8>>) {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), grid, 1, None).unwrap();
    let bytes = dir_bytes(dir.path());
    (dir, bytes)
}

fn chunk(dir: &Path, array: &str, chunk: &str) -> PathBuf {
    dir.join("database.zarr").join(array).join(chunk)
}

#[test]
fn a_finished_database_can_be_read() {
    // kept for the Python tests, which read it too
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("finished");
    let _ = fs::remove_dir_all(&dir);
    let grid = grid(Engine::Spectral);
    let summary = run(&dir, &grid, 2, None).unwrap();
    assert_eq!((summary.jobs, summary.run, summary.rays), (8, 8, 800));
    let jobs = grid.jobs().unwrap();
    let lost = (0..8).map(|n| share(grid.job(&jobs, n).unwrap().cell) * 1e-6);
    assert_eq!(summary.max_lost_share, lost.clone().fold(0.0, f64::max));
    assert!((summary.mean_lost_share - lost.sum::<f64>() / 8.0).abs() < 1e-18);

    let store = Store::open(&dir).unwrap();
    assert_eq!(store.axes(), &grid.axes);
    assert_eq!(store.wavelengths_nm(), grid.wavelengths_nm);
    assert_eq!(store.config(), grid.to_config());
    assert!(store.verify().unwrap().is_whole());
    let transmittance = store.read(Variable::TRANSMITTANCE).unwrap();
    assert_eq!(transmittance.dim(), (24, 4));
    // curve 9: facetness 0, size 1, density 0, thickness 1, angle 1; part of job 3
    let job = grid.job(&jobs, 3).unwrap();
    let cancel = AtomicBool::new(false);
    let rays_done = AtomicU64::new(0);
    let control = splitsnow::engine::Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &Cache::default(),
    };
    let expected = simulate(&job.request(&grid), &control).unwrap();
    let row: Vec<f64> = transmittance.row(9).iter().map(|v| f64::from(*v)).collect();
    for (found, want) in row.iter().zip(&expected[1].transmittance) {
        assert!((found - want.value).abs() < 1e-7, "{row:?}");
    }
    assert_eq!(
        store.read(Variable::REFLECTANCE.se()).unwrap()[[9, 0]],
        (1e-3 / (8.0 + share(job.cell))) as f32
    );
    assert!(
        store.commit(0, &expected, &[]).is_err(),
        "open for reading only"
    );
}

#[test]
fn threads_and_shards_do_not_change_the_bytes() {
    for engine in Engine::ALL {
        let grid = grid(engine);
        let (_dir, expected) = finished(&grid);
        let dir = tempfile::tempdir().unwrap();
        run(dir.path(), &grid, 2, None).unwrap();
        assert_same(&expected, &dir_bytes(dir.path()));
        for count in 1..=3 {
            let dir = tempfile::tempdir().unwrap();
            std::thread::scope(|scope| {
                for index in 0..count {
                    let shard = Shard::new(index, count).unwrap();
                    let (dir, grid) = (dir.path(), &grid);
                    scope.spawn(move || run(dir, grid, 1, Some(shard)).unwrap());
                }
            });
            assert_eq!(run(dir.path(), &grid, 2, None).unwrap().run, 0);
            assert_same(&expected, &dir_bytes(dir.path()));
        }
    }
}

/// Bytes of a job of `grid` in a file of each array: 3 curves of 4 values, and a checksum.
const CHUNK: usize = 3 * 4 * 4 + 4;
/// The file of the only pack of `grid`, in each array.
const PACK: &str = "c.0.0.0.0.0.0";

/// The arrays with their bytes per job, and the name of their file.
fn per_job() -> impl Iterator<Item = (&'static str, usize, &'static str)> {
    let quantities = Variable::ALL.map(|variable| (variable.name(), CHUNK, PACK));
    let numbers = ["jobs/lost_share", "jobs/committed"].map(|array| (array, 8, "c.0"));
    quantities.into_iter().chain(numbers)
}

/// Damage to job 5 alone, to jobs after it, to a pack, and to what is no job's.
#[test]
fn damage_is_detected_and_repaired() {
    let grid = grid(Engine::Spectral);
    let (_dir, expected) = finished(&grid);
    let other = {
        let mut other = grid.clone();
        other.run.seed = 8;
        finished(&other)
    };
    let copy_from_other = |dir: &Path, array: &str, length: usize, name: &str| {
        let from = fs::read(chunk(other.0.path(), array, name)).unwrap();
        let mut bytes = fs::read(chunk(dir, array, name)).unwrap();
        let job = 5 * length..6 * length;
        bytes[job.clone()].copy_from_slice(&from[job]);
        fs::write(chunk(dir, array, name), bytes).unwrap();
    };
    let flip = |path: PathBuf, position: usize| {
        let mut bytes = fs::read(&path).unwrap();
        bytes[position] ^= 4;
        fs::write(path, bytes).unwrap();
    };
    let shorten = |path: PathBuf, length: usize| {
        let file = fs::File::options().write(true).open(path);
        file.unwrap().set_len(length as u64).unwrap();
    };
    let remove = |path: PathBuf| fs::remove_file(path).unwrap();
    type Damage<'a> = (&'a str, Box<dyn Fn(&Path) + 'a>, &'a [u64], &'a [&'a str]);
    let all = &[0, 1, 2, 3, 4, 5, 6, 7];
    let damages: [Damage; 11] = [
        (
            "torn file",
            Box::new(|dir| shorten(chunk(dir, "reflectance", PACK), 5 * CHUNK + 20)),
            &[5, 6, 7],
            &[],
        ),
        (
            "empty file",
            Box::new(|dir| fs::write(chunk(dir, "transmittance", PACK), "").unwrap()),
            all,
            &[],
        ),
        (
            "missing file",
            Box::new(|dir| remove(chunk(dir, "transmittance_se", PACK))),
            all,
            &[],
        ),
        (
            "flipped bit",
            Box::new(|dir| flip(chunk(dir, "reflectance_se", PACK), 5 * CHUNK + 5)),
            &[5],
            &[],
        ),
        (
            "flipped mark",
            Box::new(|dir| flip(chunk(dir, "jobs/committed", "c.0"), 5 * 8 + 5)),
            &[5],
            &[],
        ),
        (
            "missing marks",
            Box::new(|dir| remove(chunk(dir, "jobs/committed", "c.0"))),
            all,
            &[],
        ),
        (
            "foreign chunk",
            Box::new(|dir| copy_from_other(dir, "transmittance_se", CHUNK, PACK)),
            &[5],
            &[],
        ),
        (
            "foreign job",
            Box::new(|dir| {
                per_job().for_each(|(array, length, name)| {
                    copy_from_other(dir, array, length, name);
                });
            }),
            &[5],
            &[],
        ),
        (
            "torn index",
            Box::new(|dir| shorten(chunk(dir, "reflectance", PACK), 8 * CHUNK + 20)),
            &[],
            &["reflectance/c.0.0.0.0.0.0"],
        ),
        (
            "flipped bit of an index",
            Box::new(|dir| flip(chunk(dir, "transmittance", PACK), 8 * CHUNK + 16)),
            &[],
            &["transmittance/c.0.0.0.0.0.0"],
        ),
        (
            "flipped checksum",
            Box::new(|dir| flip(chunk(dir, "jobs/lost_share", "c.0"), 8 * 8)),
            &[],
            &["jobs/lost_share/c.0"],
        ),
    ];
    for (name, damage, missing, damaged) in damages {
        let (dir, _) = finished(&grid);
        damage(dir.path());
        let store = Store::open(dir.path()).unwrap();
        let found = store.verify().unwrap();
        assert_eq!(found.missing, missing, "{name}");
        assert_eq!(found.damaged, damaged, "{name}");
        let unreadable = if missing.is_empty() { all } else { missing };
        assert_eq!(store.missing().unwrap(), unreadable, "{name}");
        let run = run(dir.path(), &grid, 1, None).unwrap().run;
        assert_eq!(run, missing.len() as u64, "{name}");
        assert_same(&expected, &dir_bytes(dir.path()));
    }
}

#[test]
fn jobs_in_the_wrong_place_are_detected() {
    let grid = grid(Engine::Spectral);
    let (dir, _) = finished(&grid);
    for (array, length, name) in per_job() {
        let path = chunk(dir.path(), array, name);
        let mut bytes = fs::read(&path).unwrap();
        bytes.copy_within(..length, 5 * length);
        fs::write(path, bytes).unwrap();
    }
    assert_eq!(Store::open(dir.path()).unwrap().missing().unwrap(), [5]);
}

/// Jobs are files until the last of their pack is done.
#[test]
fn jobs_that_are_not_packed_yet_are_kept() {
    let grid = grid(Engine::Spectral);
    let (done, expected) = finished(&grid);
    let dir = tempfile::tempdir().unwrap();
    for index in [0, 1] {
        run(dir.path(), &grid, 1, Some(Shard::new(index, 2).unwrap())).unwrap();
    }
    // each process has half of the pack
    let jobs = dir.path().join(".splitsnow-jobs");
    assert_eq!(fs::read_dir(&jobs).unwrap().count(), 8);
    let store = Store::open(dir.path()).unwrap();
    assert!(store.unmarked().unwrap().is_empty());
    assert_eq!(store.missing().unwrap().len(), 8);
    assert!(!store.verify().unwrap().is_whole());
    let whole = Store::open(done.path()).unwrap();
    for job in 0..8 {
        assert_eq!(store.spectra(job).unwrap(), whole.spectra(job).unwrap());
    }
    let shares = store.lost_shares(2..7).unwrap();
    assert_eq!(shares, whole.lost_shares(0..8).unwrap()[2..7]);
    assert!(shares.iter().all(|share| *share > 0.0));
    // a truncated file, as after a power failure, and one of another job
    let second = fs::read(jobs.join("2")).unwrap();
    fs::write(jobs.join("3"), &second[..200]).unwrap();
    fs::write(jobs.join("4"), &second).unwrap();
    assert_eq!(run(dir.path(), &grid, 2, None).unwrap().run, 2);
    assert_same(&expected, &dir_bytes(dir.path()));
    assert!(!jobs.exists());
}

/// Several packs, of which the last has fewer jobs.
#[test]
fn packs_are_read_in_order() {
    let mut grid = grid(Engine::Reference);
    let facetness = (0..100).map(|i| 0.005 + 0.0099 * f64::from(i)).collect();
    grid.axes.set(Parameter::Facetness, facetness);
    let dir = tempfile::tempdir().unwrap();
    // 85 of 100 blocks of 12 jobs fit into a pack
    assert_eq!(run(dir.path(), &grid, 2, None).unwrap().jobs, 1200);
    for (array, _, _) in per_job() {
        let files = fs::read_dir(dir.path().join("database.zarr").join(array)).unwrap();
        assert_eq!(files.count(), 3, "{array}: two packs and metadata");
    }
    let store = Store::open(dir.path()).unwrap();
    assert!(store.verify().unwrap().is_whole());
    let reflectance = store.read(Variable::REFLECTANCE).unwrap();
    assert_eq!(reflectance.dim(), (1200, 4));
    for job in [0, 1019, 1020, 1199] {
        let stored = store.spectra(job).unwrap().unwrap();
        let values = stored[0].reflectance.iter().map(|m| m.value as f32);
        assert!(
            values.eq(reflectance.row(job as usize).iter().copied()),
            "{job}"
        );
    }
    // and compressed
    let bounds = CompressionRequest::plain(grid.compression, Viewing::default());
    build::compress(dir.path(), &bounds).unwrap();
    let curves = reflectance.mapv(f64::from);
    let file = Database::open(dir.path().join("snow.safetensors")).unwrap();
    let errors = curve_errors(&file, Quantity::Reflectance, curves.view(), None).unwrap();
    let expected = Decomposition::new(curves.view()).unwrap().basis;
    let components = file.basis(Quantity::Reflectance).ncols();
    for (component, expected) in (0..components).zip(expected.columns()) {
        let found = file.basis(Quantity::Reflectance);
        let found = found.column(component);
        assert!(found.iter().zip(expected).all(|(a, b)| *a == *b as f32));
    }
    // the rows of the file are those of the database; the table has six digits
    let table: serde_json::Value = serde_json::from_str(&file.metadata()["error_table"]).unwrap();
    let table = &table["reflectance"];
    let chosen = table["chosen"].as_u64().unwrap() as usize;
    let stated = table["rows"][chosen - 1]["rmse"]["max"].as_f64().unwrap();
    let largest = errors.rmse.iter().copied().fold(0.0, f64::max);
    assert!((stated / largest - 1.0).abs() < 5e-6, "{stated} {largest}");
}

/// A process killed while it packs leaves jobs both in arrays and in files.
#[test]
fn packing_can_be_interrupted_anywhere() {
    let grid = grid(Engine::Spectral);
    let (_dir, expected) = finished(&grid);
    for writes in 0..=6 {
        let dir = tempfile::tempdir().unwrap();
        for index in [0, 1] {
            run(dir.path(), &grid, 1, Some(Shard::new(index, 2).unwrap())).unwrap();
        }
        let files: Vec<_> = (expected.iter())
            .filter(|(name, _)| name.contains("/c.") && !name.contains("_deg/"))
            .filter(|(name, _)| per_job().any(|(array, ..)| name.contains(&format!("{array}/"))))
            .collect();
        assert_eq!(files.len(), 6);
        for (name, bytes) in files.into_iter().take(writes) {
            fs::write(dir.path().join(name), bytes).unwrap();
        }
        assert_eq!(run(dir.path(), &grid, 1, None).unwrap().run, 0, "{writes}");
        assert_same(&expected, &dir_bytes(dir.path()));
    }
}

/// A database of version 1 of the format has a file of each array for each job. It is read, and
/// continued as it is.
#[test]
fn a_database_of_version_1_is_read_and_continued() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let original = data.join("database_1");
    let store = Store::open(&original).unwrap();
    assert!(store.verify().unwrap().is_whole());
    let reflectance = store.read(Variable::REFLECTANCE).unwrap();
    assert_eq!(reflectance.dim(), (8, 3));
    let second_job = store.spectra(1).unwrap().unwrap();
    for (row, spectrum) in (4..).zip(&second_job) {
        let row: Vec<f64> = reflectance.row(row).iter().map(|v| f64::from(*v)).collect();
        let values = spectrum.reflectance.iter().map(|measured| measured.value);
        assert_eq!(row, values.collect::<Vec<_>>());
        assert!(row.iter().all(|value| *value > 0.5));
    }
    let dir = tempfile::tempdir().unwrap();
    let before = dir_bytes(&original);
    for (name, bytes) in &before {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    fs::remove_file(chunk(dir.path(), "reflectance", "c.1.0.0.0.0.0")).unwrap();
    let copy = Store::open(dir.path()).unwrap();
    assert_eq!(copy.missing().unwrap(), [1]);
    let build = Command::new(cargo_bin!("splitsnow"))
        .arg("build")
        .arg(data.join("database_1.toml"))
        .arg("--out")
        .arg(dir.path())
        .output()
        .unwrap();
    assert!(build.status.success(), "{build:?}");
    assert!(String::from_utf8_lossy(&build.stdout).starts_with("2 jobs, 1 of them run now"));
    assert!(copy.verify().unwrap().is_whole());
    let after = dir_bytes(dir.path());
    assert!(before.keys().all(|name| after.contains_key(name)));
}

#[test]
fn coordinates_are_repaired_and_leftovers_removed() {
    let grid = grid(Engine::Spectral);
    let (dir, expected) = finished(&grid);
    let path = dir.path();
    fs::write(chunk(path, "angle_deg", "c.0"), "torn").unwrap();
    fs::remove_file(chunk(path, "jobs", "zarr.json")).unwrap();
    fs::create_dir(path.join(".splitsnow-partial")).unwrap();
    fs::write(path.join(".splitsnow-partial/alone-3"), "half a chu").unwrap();
    fs::write(path.join(".splitsnow-lock-shard-0-of-2"), "").unwrap();
    let found = Store::open(path).unwrap().verify().unwrap();
    assert_eq!(found.damaged, ["angle_deg/c.0", "jobs/zarr.json"]);
    assert_eq!(run(path, &grid, 1, None).unwrap().run, 0);
    assert_same(&expected, &dir_bytes(path));
}

#[test]
fn an_interrupted_run_can_be_continued() {
    let grid = grid(Engine::Reference);
    let (_dir, expected) = finished(&grid);
    let dir = tempfile::tempdir().unwrap();
    let cancel = AtomicBool::new(false);
    let jobs_started = AtomicU64::new(0);
    let store = open(dir.path(), &grid).unwrap();
    let error = batch::run(
        &grid,
        &store,
        |request, control| {
            if jobs_started.fetch_add(1, Ordering::Relaxed) == 5 {
                cancel.store(true, Ordering::Relaxed);
            }
            simulate(request, control)
        },
        &BatchOptions {
            threads: 1,
            ..BatchOptions::default()
        },
        &cancel,
    )
    .unwrap_err();
    drop(store);
    assert_eq!(
        error.to_string(),
        "interrupted: 5 of 24 jobs are done and safe; run the same command again to continue"
    );
    assert_eq!(run(dir.path(), &grid, 2, None).unwrap().run, 19);
    assert_same(&expected, &dir_bytes(dir.path()));
}

#[test]
fn a_failing_job_is_named_and_the_others_are_kept() {
    let grid = grid(Engine::Spectral);
    let dir = tempfile::tempdir().unwrap();
    let store = open(dir.path(), &grid).unwrap();
    let third = grid.job(&grid.jobs().unwrap(), 3).unwrap().cell;
    let error = batch::run(
        &grid,
        &store,
        |request, control| {
            if request.cell != third {
                return simulate(request, control);
            }
            Err(EngineError::SlabTooThin {
                thickness_m: 0.01,
                size_max_m: 0.009,
            })
        },
        &BatchOptions {
            threads: 1,
            ..BatchOptions::default()
        },
        &AtomicBool::new(false),
    )
    .unwrap_err();
    assert_eq!(
        error.to_string(),
        "job 3 (facetness 0.05, grain size 200 um, density 300 kg m-3, thickness 1, 2, 5 cm, angle 60 degrees): the slab of 1 cm is too thin for grains up to 9000 um long: 10000 grains in a row did not fit; use a thickness of at least 10 grain lengths"
    );
    assert_eq!(store.missing().unwrap(), [3, 4, 5, 6, 7]);
}

#[test]
fn nan_values_are_rejected() {
    let grid = grid(Engine::Spectral);
    let dir = tempfile::tempdir().unwrap();
    let store = open(dir.path(), &grid).unwrap();
    let error = batch::run(
        &grid,
        &store,
        |request, control| {
            let mut spectra = simulate(request, control)?;
            spectra[1].reflectance[2].value = f64::NAN;
            Ok(spectra)
        },
        &BatchOptions::default(),
        &AtomicBool::new(false),
    )
    .unwrap_err();
    let message = error.to_string();
    assert!(message.contains("reflectance is NaN"), "{message}");
}

/// The attributes of a database describe its substrate.
#[test]
fn a_database_describes_its_substrate() {
    let bottom = |grid: &Grid| {
        let (dir, _) = finished(grid);
        let text = fs::read_to_string(dir.path().join("database.zarr/zarr.json")).unwrap();
        let root: serde_json::Value = serde_json::from_str(&text).unwrap();
        let text = root["attributes"]["bottom_boundary"].as_str().unwrap();
        text.to_owned()
    };
    let mut grid = grid(Engine::Spectral);
    assert!(bottom(&grid).starts_with("black:"));
    grid.fixed.substrate = Substrate::Grey(0.25);
    assert_eq!(
        bottom(&grid),
        "Lambertian substrate { reflectance = 0.25 }; transmittance is the light that stays in it"
    );
    let snow = grid.job(&grid.jobs().unwrap(), 0).unwrap().snowpack.surface;
    grid.axes
        .values_mut(Parameter::Thickness)
        .iter_mut()
        .for_each(|h| *h += 1.0);
    grid.fixed.below.push(Layer {
        snow,
        thickness_m: 0.01,
    });
    assert!(bottom(&grid).starts_with("the layers of fixed.below, then Lambertian"));
}

#[test]
fn a_different_config_is_rejected_by_key() {
    let grid = grid(Engine::Spectral);
    let (dir, before) = finished(&grid);
    type Change = (fn(&mut Grid), &'static str);
    let changes: [Change; 11] = [
        (|g| g.run.seed = 8, "run.seed = 7, not 8;"),
        (|g| g.run.rays = 5, "run.rays = 100, not 5;"),
        (
            |g| g.run.engine = Engine::Reference,
            "run.engine = \"spectral\", not \"reference\";",
        ),
        (
            |g| g.axes.values_mut(Parameter::Thickness).push(7.0),
            "axes.thickness_cm = [1.0, 2.0, 5.0], not [1.0, 2.0, 5.0, 7.0];",
        ),
        (
            |g| g.spread.facetness_sd = 0.1,
            "spread.facetness_sd = 0.072, not 0.1;",
        ),
        (
            |g| g.wavelengths_nm[0] = 410.0,
            "wavelengths.values_nm = [400.0,",
        ),
        (
            |g| g.fixed.water_saturation = 0.1,
            "fixed.water_saturation = 0.0, not 0.1;",
        ),
        (
            |g| g.fixed.substrate = Substrate::Grey(0.2),
            "fixed.substrate = (none), not { reflectance = 0.2 };",
        ),
        (
            |g| g.fixed.brown_carbon = Some(Carbon::brown(5.0)),
            "fixed.brown_carbon = (none), not { concentration_ng_g = 5.0, sedimentation = 1.0,",
        ),
        (
            |g| {
                g.fixed.below.push(Layer {
                    snow: g.job(&g.jobs().unwrap(), 0).unwrap().snowpack.surface,
                    thickness_m: 0.005,
                });
            },
            "fixed.below = (none), not [{ thickness_cm = 0.5, density_kg_m3 = 300.0,",
        ),
        (
            |g| g.axes.values_mut(Parameter::Density)[0] = 310.0,
            "axes.density_kg_m3 = [300.0], not [310.0];",
        ),
    ];
    for (change, message) in changes {
        let mut other = grid.clone();
        change(&mut other);
        let error = open(dir.path(), &other).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let tables = BTreeMap::from([("data.ice".to_string(), "4567".to_string())]);
    let error = Store::build(dir.path(), &grid, &tables, Access::Exclusive).unwrap_err();
    assert!(
        error.to_string().contains("data.ice = 0123, not 4567"),
        "{error}"
    );
    let error = Store::build(dir.path(), &grid, &BTreeMap::new(), Access::Exclusive).unwrap_err();
    assert!(
        error.to_string().contains("data.ice = 0123, not (none)"),
        "{error}"
    );

    let mut recompressed = grid.clone();
    recompressed.compression.max_delta_e = 1.0;
    assert!(open(dir.path(), &recompressed).is_ok());
    assert_same(&before, &dir_bytes(dir.path()));
}

#[test]
fn a_different_format_is_rejected() {
    let grid = grid(Engine::Spectral);
    let (dir, _) = finished(&grid);
    let root = chunk(dir.path(), "", "zarr.json");
    let text = fs::read_to_string(&root).unwrap();
    fs::write(
        &root,
        text.replace("format_version = 2", "format_version = 99"),
    )
    .unwrap();
    for error in [open(dir.path(), &grid), Store::open(dir.path())] {
        let error = error.unwrap_err().to_string();
        assert!(error.contains("format_version = 99, not 2"), "{error}");
    }
}

#[test]
fn a_directory_is_locked_against_other_processes() {
    let grid = grid(Engine::Spectral);
    let dir = tempfile::tempdir().unwrap();
    let shard = |i, n| Access::Shard(Shard::new(i, n).unwrap());
    let build = |access| Store::build(dir.path(), &grid, &extra(), access);
    let assert_busy = |outcome: Result<Store, StoreError>| {
        let error = outcome.unwrap_err();
        assert!(matches!(error, StoreError::Busy { .. }), "{error}");
    };
    let first = build(Access::Exclusive).unwrap();
    assert_busy(build(Access::Exclusive));
    assert_busy(build(shard(0, 2)));
    assert_busy(Store::open_exclusive(dir.path()));
    assert!(store::remove(dir.path()).is_err());
    assert!(Store::open(dir.path()).is_ok(), "reading needs no lock");
    drop(first);
    let first = build(shard(0, 2)).unwrap();
    let second = build(shard(1, 2)).unwrap();
    assert_busy(build(shard(0, 2)));
    assert_busy(build(Access::Exclusive));
    drop((first, second));
    assert!(Store::open_exclusive(dir.path()).is_ok());
}

#[test]
fn removal_leaves_foreign_files() {
    let first = grid(Engine::Spectral);
    let (dir, _) = finished(&first);
    fs::write(dir.path().join(store::COMPACT), "old").unwrap();
    fs::write(dir.path().join("notes.txt"), "mine").unwrap();
    store::remove(dir.path()).unwrap();
    let left: Vec<_> = dir_bytes(dir.path()).into_keys().collect();
    assert_eq!(left, [".splitsnow-lock", "notes.txt"]);
    store::remove(dir.path()).unwrap();
    let mut other = first.clone();
    other.run.seed = 8;
    run(dir.path(), &other, 1, None).unwrap();

    let foreign = tempfile::tempdir().unwrap();
    let database = foreign.path().join("database.zarr");
    fs::create_dir(&database).unwrap();
    let contents = [
        None,
        Some("{}"),
        Some("not json"),
        Some(r#"{"attributes":{"program":"x"}}"#),
    ];
    for content in contents {
        if let Some(content) = content {
            fs::write(database.join("zarr.json"), content).unwrap();
        }
        for error in [
            store::remove(foreign.path()),
            open(foreign.path(), &first).map(drop),
        ] {
            let error = error.unwrap_err().to_string();
            assert!(error.contains("was not made by splitsnow"), "{error}");
        }
        assert!(database.exists());
    }
}

#[test]
fn impossible_output_directories_are_rejected() {
    let mut grid = grid(Engine::Spectral);
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "x").unwrap();
    let error = open(&file, &grid).unwrap_err().to_string();
    assert!(error.contains("is a file, not a directory"), "{error}");
    assert!(open(&file.join("below"), &grid).is_err());
    let error = Store::open(dir.path()).unwrap_err().to_string();
    assert!(error.starts_with("no database in"), "{error}");

    let many: Vec<f64> = (1..=4000).map(f64::from).collect();
    grid.axes.values_mut(Parameter::Thickness).clone_from(&many);
    let densities = many.iter().map(|v| v / 5.0).collect();
    grid.axes.set(Parameter::Density, densities);
    grid.axes.set(
        Parameter::GrainSize,
        many.iter().map(|v| v + 100.0).collect(),
    );
    let absurd = dir.path().join("absurd");
    let error = open(&absurd, &grid).unwrap_err().to_string();
    assert!(error.contains("but the disk has"), "{error}");
    assert!(!absurd.join("database.zarr").exists());
}
