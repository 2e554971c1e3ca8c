//! `splitsnow retrieve`: known snows are found again, with intervals that hold them.
#![allow(clippy::unwrap_used)]
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use assert_cmd::cargo::cargo_bin;
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde_json::Value;
use splitsnow::lookup::{Database, Lookup};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};
use splitsnow::retrieve::{
    Cube, CubeIntervals, CubeRequest, FileGrains, MeasuredInput, NoiseModel, Setup, SetupRequest,
};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

fn configs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(name)
}

/// A folder with the database of a grid file.
fn built(grid: PathBuf) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(cargo_bin!("splitsnow"))
        .arg("build")
        .arg(grid)
        .arg("--out")
        .arg(folder.path())
        .output()
        .unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{errors}");
    folder
}

/// The database of the natural snow.
fn natural() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| built(configs("vermont.toml"))).path()
}

fn retrieve(words: &[&str]) -> Output {
    let mut command = Command::new(cargo_bin!("splitsnow"));
    command.arg("retrieve").args(words).output().unwrap()
}

fn json(words: &[&str]) -> Value {
    let output = retrieve(&[words, &["--json"]].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// An entry of the list of estimates.
fn estimate<'a>(found: &'a Value, name: &str) -> &'a Value {
    let mut all = found["estimates"].as_array().unwrap().iter();
    all.find(|estimate| estimate["name"] == name).unwrap()
}

/// The ends of an interval.
fn ends(found: &Value, name: &str, interval: &str) -> [f64; 2] {
    [0, 1].map(|i| estimate(found, name)[interval][i].as_f64().unwrap())
}

const DEEP: &str = "@thickness_cm=34,density_kg_m3=200";
const THIN: &str = "@thickness_cm=2.5,density_kg_m3=155";

/// The words of the command for the natural snow.
fn words(deep: bool, thin: bool) -> Vec<String> {
    let file = |name: &str| configs("measured").join(name).display().to_string();
    let mut words = vec!["--within".to_owned(), natural().display().to_string()];
    if deep {
        words.push(file("vermont_deep.csv") + DEEP);
    }
    if thin {
        words.push(file("vermont_thin.csv") + THIN);
    }
    words
}

fn as_words(words: &[String]) -> Vec<&str> {
    words.iter().map(String::as_str).collect()
}

/// Letcher et al. 2022: micro-CT gave 26.1 m2/kg for the thin slab, and 18 to 27 for the deep snow.
#[test]
fn the_measured_surface_of_natural_snow_is_in_the_interval() {
    for (deep, thin) in [(true, false), (false, true), (true, true)] {
        let words = words(deep, thin);
        let found = json(&as_words(&words));
        let [low, high] = ends(&found, "ssa_m2_kg", "p68");
        eprintln!("{deep} {thin}: {low:.1} to {high:.1}");
        assert!(low < 26.1 && 26.1 < high, "{deep} {thin}: {low} {high}");
        // the interval says something: it is narrower than half of the value
        assert!(high - low < 13.0, "{low} {high}");
        // the facets are not determined, and the program says so
        let shape = estimate(&found, "facetness");
        assert_eq!(shape["determined"], "no", "{shape}");
        let remarks = found["remarks"].to_string();
        assert!(remarks.contains("grain_size_um and facetness"), "{remarks}");
        assert!(found["information"]["determined"].as_u64().unwrap() < 3);
    }
}

/// The two files are those of the table of both thicknesses.
#[test]
fn natural_snow_is_that_of_the_table() {
    let table = std::fs::read_to_string(data("crrel_uvd_2021.csv")).unwrap();
    for (thickness, name) in [("34", "vermont_deep.csv"), ("2.5", "vermont_thin.csv")] {
        let rows = table
            .lines()
            .filter(|line| line.split(',').next() == Some(thickness));
        let rows: Vec<String> = rows
            .map(|line| line.split(',').skip(3).collect::<Vec<_>>().join(","))
            .collect();
        let file = std::fs::read_to_string(configs("measured").join(name)).unwrap();
        let own = file.lines().filter(|line| !line.starts_with('#'));
        let own: Vec<&str> = own.skip(1).collect();
        assert_eq!(own, rows);
    }
}

#[test]
fn the_engine_confirms_the_optimum() {
    let words = words(true, false);
    let words = [as_words(&words), vec!["--exact", "--fix", "facetness=0.2"]].concat();
    let found = json(&words);
    let exact = &found["exact"];
    assert_eq!(exact["settled"], true, "{exact}");
    assert!(exact["largest_in_sigma"].as_f64().unwrap() < 1.0, "{exact}");
    assert!(exact["moved_sd"].as_f64().unwrap() < 1.0, "{exact}");
}

/// Smooth spheres of 82 um by other models: medium snow of the Johns Hopkins library, and TARTES.
/// Ours are darker, so that smaller ones are found (docs/retrieval.md).
#[test]
fn spheres_of_other_models_have_their_radius() {
    let folder = built(data("retrieval/spheres.toml"));
    let folder = folder.path().display().to_string();
    for (name, most) in [
        ("measured/ecostress_medium_converted.csv", 0.15),
        ("retrieval/tartes_spheres.csv", 0.17),
    ] {
        let spectrum = data(name).display().to_string();
        let found = json(&[&spectrum, "--within", &folder]);
        let radius = &estimate(&found, "optical_radius_um")["best"];
        let less = 1.0 - radius.as_f64().unwrap() / 82.0;
        assert!(0.1 < less && less < most, "{name}: {radius}");
    }
}

/// What docs/retrieval.md says about the usual grains and other models.
#[test]
#[ignore = "builds a database for half a minute"]
fn usual_grains_are_biased_as_stated() {
    let folder = built(data("retrieval/facets.toml"));
    let folder = folder.path().display().to_string();
    let spectrum = data("measured/ecostress_medium_converted.csv")
        .display()
        .to_string();
    let found = json(&[&spectrum, "--within", &folder]);
    let [low, high] = ends(&found, "optical_radius_um", "p95");
    assert!(82.0 < low && low < 100.0 && 150.0 < high, "{low} {high}");
    let tartes = data("../../docs/peers/tartes.csv").display().to_string();
    let words = [
        "--column",
        "2",
        "--quantity",
        "reflectance",
        "--within",
        &folder,
    ];
    let found = json(&[&[tartes.as_str()][..], &words].concat());
    let [low, high] = ends(&found, "ssa_m2_kg", "p95");
    assert!(low < 20.33 && 20.33 < high, "{low} {high}");
}

/// A uniform number in 0 to 1.
fn uniform(random: &mut Xoshiro256PlusPlus) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// 500 spectra of the natural snow's file with noise as stated: the intervals of surface and
/// carbon hold the truth in 68 % of them, by the grid and by Laplace.
#[test]
fn intervals_of_many_spectra_hold_the_truth() {
    let database = Database::open(natural()).unwrap();
    let grains = FileGrains::of(&database).unwrap();
    let noise = NoiseModel {
        level: 0.0,
        ..NoiseModel::default()
    };
    let fix: Vec<_> = ["facetness=0.2", "thickness_cm=34", "density_kg_m3=200"]
        .map(|text| text.parse().unwrap())
        .into();
    let nm = database.wavelengths_nm().to_vec();
    let request = CubeRequest {
        database: &database,
        quantity: Quantity::Reflectance,
        indices: (0..nm.len()).collect(),
        bands: None,
        free: &[],
        fix: &fix,
        varying: Vec::new(),
        noise,
    };
    let cube = Cube::new(request).unwrap();
    assert_eq!(
        cube.names(),
        [
            "ssa_m2_kg",
            "optical_radius_um",
            "grain_size_um",
            "black_carbon_ng_g"
        ]
    );
    let errors = splitsnow::retrieve::EmulatorError::of(&database, Quantity::Reflectance).sd;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
    let mut normal = {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(4);
        move || (0..12).map(|_| uniform(&mut random)).sum::<f64>() - 6.0
    };
    let sizes = database.axes().values(Parameter::GrainSize);
    let (first, last) = (sizes[0], sizes[sizes.len() - 1]);
    let (mut spectra, mut truths) = (Vec::new(), Vec::new());
    for _ in 0..500 {
        let carbon = 300.0 * uniform(&mut random);
        let size = first * (last / first).powf(uniform(&mut random));
        let at = database
            .at(Point::from([(Parameter::BlackCarbon, carbon)]))
            .unwrap();
        let lookup = Lookup::new(&at, Quantity::Reflectance).unwrap();
        let point = Point::from_core([0.2, size, 200.0, 34.0, 0.0]);
        let mut spectrum = vec![0.0; nm.len()];
        lookup.spectrum(point, &mut spectrum).unwrap();
        let mut shared = [normal(), normal()];
        for l in 0..nm.len() {
            if l > 0 {
                let near = f64::exp((nm[l - 1] - nm[l]) / noise.length_nm);
                let fresh = (1.0 - near * near).sqrt();
                shared = shared.map(|value| near * value + fresh * normal());
            }
            let error = noise.correlated * shared[0] + errors[l] * shared[1];
            spectra.push(f64::from(spectrum[l]) + error + noise.value * normal());
        }
        let measure = splitsnow::grain::SizeMeasure::SpecificSurface;
        truths.push([grains.measure(measure, &point), carbon]);
    }
    for (intervals, least) in [(CubeIntervals::Grid, 315), (CubeIntervals::Laplace, 300)] {
        let rows = cube.solve(&spectra, None, intervals, false).unwrap();
        for (name, k) in [(0, 0), (3, 1)] {
            let held = rows.iter().zip(&truths).filter(|(row, truth)| {
                let [low, high] = row.p68[name];
                (low..=high).contains(&truth[k])
            });
            let held = held.count();
            eprintln!("{intervals:?} {name}: {held} of 500");
            assert!(
                (least..=365).contains(&held),
                "{intervals:?} {name}: {held}"
            );
        }
    }
}

/// Reflectance and transmittance of one look-up give back its snow, also with more than four
/// unknowns.
#[test]
fn several_spectra_share_the_unknowns() {
    let database = Database::open(natural()).unwrap();
    let at = database
        .at(Point::from([(Parameter::BlackCarbon, 40.0)]))
        .unwrap();
    let point = Point::from_core([0.3, 300.0, 180.0, 6.0, 0.0]);
    let inputs = Quantity::ALL.map(|quantity| {
        let mut spectrum = vec![0.0; database.wavelengths_nm().len()];
        let lookup = Lookup::new(&at, quantity).unwrap();
        lookup.spectrum(point, &mut spectrum).unwrap();
        MeasuredInput {
            name: quantity.name().into(),
            quantity,
            indices: (0..spectrum.len()).collect(),
            uncertainties: vec![None; spectrum.len()],
            values: spectrum.into_iter().map(f64::from).collect(),
            fixed: Vec::new(),
        }
    });
    let request = SetupRequest {
        database: &database,
        inputs: &inputs,
        free: &[],
        fix: &[],
        noise: NoiseModel::default(),
        bands: None,
    };
    let setup = Setup::new(&request).unwrap();
    let found = setup.retrieve(&database, 1, None).unwrap();
    assert_eq!(found.unknowns().len(), 5);
    assert!(
        found.goodness.chi_square < 1.0,
        "{}",
        found.goodness.chi_square
    );
    for (name, truth) in [
        ("grain_size_um", 300.0),
        ("thickness_cm", 6.0),
        ("black_carbon_ng_g", 40.0),
    ] {
        let estimate = found.estimates.iter().find(|e| e.name == name).unwrap();
        let [low, high] = estimate.interval.p95;
        assert!(low < truth && truth < high, "{name}: {low} {high}");
    }
    let text = found.to_string();
    assert!(text.contains("affine-invariant sampler"), "{text}");
    // with what is known it is exact
    let fix: Vec<_> = ["facetness=0.3", "density_kg_m3=180", "thickness_cm=6"]
        .map(|text| text.parse().unwrap())
        .into();
    let known = SetupRequest {
        fix: &fix,
        ..request
    };
    let setup = Setup::new(&known).unwrap();
    let found = setup.retrieve(&database, 1, None).unwrap();
    let size = found.unknowns()[0].best;
    assert!((size / 300.0 - 1.0).abs() < 0.01, "{size}");
}

#[test]
fn contradictions_are_named() {
    let words = words(true, false);
    for (more, expected) in [
        (&["--fix", "temperature_c=-5"][..], "no axis temperature_c"),
        (
            &["--fix", "ssa_m2_kg=200"],
            "ssa_m2_kg = 200 is outside the compact file, which covers 8",
        ),
        (
            &["--fix", "facetness=0.2", "--free", "facetness"],
            "facetness is both known and unknown",
        ),
        (
            &["--free", "incidence_angle_deg"],
            "incidence_angle_deg cannot be unknown",
        ),
        (
            &["--free", "facetness", "--free", "facetness=0.1..0.3"],
            "facetness is stated as unknown twice",
        ),
        (
            &["--free", "ssa_m2_kg=200..300"],
            "ssa_m2_kg = 200..300 is outside",
        ),
        (&["--fix", "thickness_cm=10"], "thickness_cm has two values"),
        (
            &[
                "--fix",
                "facetness=0.2",
                "--fix",
                "ssa_m2_kg=26",
                "--fix",
                "black_carbon_ng_g=0",
            ],
            "nothing to retrieve",
        ),
    ] {
        let output = retrieve(&[&as_words(&words), more].concat());
        let errors = String::from_utf8(output.stderr).unwrap();
        let last = errors.lines().last().unwrap();
        assert!(
            !output.status.success() && last.contains(expected),
            "{more:?}: {errors}"
        );
    }
}

/// Without `--within` the command makes the grid, builds it once and keeps it.
#[test]
fn a_grid_is_made_from_what_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let thin = configs("measured/vermont_thin.csv");
    let run = |words: &[&str]| {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        let command = command
            .current_dir(folder.path())
            .arg("retrieve")
            .arg(&thin);
        let output = command.args(words).output().unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        (output.status.success(), output.stdout, errors)
    };
    let known = [
        "--fix=thickness_cm=2.5",
        "--fix=density_kg_m3=155",
        "--fix=facetness=0.2",
        "--fix=incidence_angle_deg=0",
        "--fix=black_carbon_ng_g=0",
        "--json",
    ];
    let (good, first, errors) = run(&known);
    assert!(good, "{errors}");
    assert!(
        errors.contains("made from what is known") && errors.contains("building out/retrieve_")
    );
    let found: Value = serde_json::from_slice(&first).unwrap();
    let [low, high] = ends(&found, "ssa_m2_kg", "p95");
    assert!(low < 26.1 && 26.1 < high, "{low} to {high}");
    let (good, second, errors) = run(&known);
    assert!(good && first == second, "{errors}");
    assert!(!errors.contains("building") && errors.contains("searching the snows of"));
    std::fs::write(
        folder.path().join("t.csv"),
        "wavelength_nm,transmittance\n500,0.2\n600,0.15\n800,0.05\n",
    )
    .unwrap();
    let (good, nothing, errors) = run(&["t.csv"]);
    assert!(!good && nothing.is_empty());
    assert!(errors.contains("--fix thickness_cm=VALUE"), "{errors}");
    let files = std::fs::read_dir(folder.path().join("out")).unwrap();
    assert_eq!(files.count(), 2, "the grid file and its directory");
    #[cfg(unix)]
    another_process_is_waited_for(folder.path(), &thin, &known, &first);
}

/// Little soot in deep snow, simulated, is found between the nodes of the grid that the command
/// makes, at a node and between two.
#[test]
fn little_soot_in_deep_snow_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        let output = command.current_dir(folder.path()).args(words).output();
        let output = output.unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
        String::from_utf8(output.stdout).unwrap()
    };
    for carbon in [10.0, 18.0] {
        let sample = format!(
            "version = 1\n[illumination]\nincidence_angle_deg = 50\n\
             [wavelengths]\nvalues_nm = [400, 450, 500, 550, 600, 650, 700]\n\
             [[layer]]\nthickness_cm = inf\ndensity_kg_m3 = 300\n\
             black_carbon = {{ concentration_ng_g = {carbon} }}\n\
             [[layer.grain]]\nssa_m2_kg = 13\n\
             facetness = {{ min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }}\n"
        );
        std::fs::write(folder.path().join("sample.toml"), sample).unwrap();
        let engine = ["--engine", "hybrid", "--rays", "20000"];
        let table = run(&[&["simulate", "sample.toml"], &engine[..]].concat());
        let rows: Vec<Vec<&str>> = table
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split(',').collect())
            .collect();
        let at = rows[0].iter().position(|name| *name == "reflectance");
        let column = |row: &Vec<&str>| format!("{},{}\n", row[0], row[at.unwrap()]);
        let spectrum: String = rows.iter().map(column).collect();
        std::fs::write(folder.path().join("deep.csv"), spectrum).unwrap();
        let known = [
            "--fix=ssa_m2_kg=13",
            "--fix=facetness=0.3",
            "--fix=incidence_angle_deg=50",
            "--json",
        ];
        let text = run(&[&["retrieve", "deep.csv"], &known[..]].concat());
        let found: Value = serde_json::from_str(&text).unwrap();
        let [low, high] = ends(&found, "black_carbon_ng_g", "p68");
        assert!(low < carbon && carbon < high, "{low} to {high}");
        let best = estimate(&found, "black_carbon_ng_g")["best"]
            .as_f64()
            .unwrap();
        assert!((best / carbon - 1.0).abs() < 0.35, "{best} for {carbon}");
    }
}

/// A second process that needs the same database waits for the first, says so once, and goes on
/// with the result; Ctrl-C ends it.
#[cfg(unix)]
fn another_process_is_waited_for(folder: &Path, file: &Path, known: &[&str], result: &[u8]) {
    use std::io::{BufRead, BufReader, Read};
    let made = std::fs::read_dir(folder.join("out")).unwrap();
    let mut made = made.map(|entry| entry.unwrap().path());
    let dir = made.find(|path| path.is_dir()).unwrap();
    for interrupted in [false, true] {
        let lock = std::fs::File::options();
        let lock = lock
            .clone()
            .write(true)
            .open(dir.join(".splitsnow-lock"))
            .unwrap();
        lock.try_lock().unwrap();
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command
            .current_dir(folder)
            .arg("retrieve")
            .arg(file)
            .args(known);
        let pipe = std::process::Stdio::piped;
        let mut child = command.stdout(pipe()).stderr(pipe()).spawn().unwrap();
        let mut errors = BufReader::new(child.stderr.take().unwrap());
        let (mut line, mut said) = (String::new(), String::new());
        while !line.starts_with("another process works in") {
            line.clear();
            assert_ne!(errors.read_line(&mut line).unwrap(), 0, "{said}");
            said += &line;
        }
        assert!(child.try_wait().unwrap().is_none());
        if interrupted {
            let pid = child.id().to_string();
            let killed = Command::new("kill").args(["-INT", &pid]).status();
            assert!(killed.unwrap().success());
        } else {
            drop(lock);
        }
        let mut rest = String::new();
        errors.read_to_string(&mut rest).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(!rest.contains("another process works in"), "{rest}");
        if interrupted {
            assert_eq!(output.status.code(), Some(130), "{rest}");
            assert!(output.stdout.is_empty() && rest.contains("the other process goes on"));
        } else {
            assert!(output.status.success(), "{rest}");
            assert_eq!(output.stdout, result);
        }
    }
}

/// What is kept can be kept elsewhere; what cannot be written is named before the work.
#[test]
fn outputs_are_checked_before_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let thin = configs("measured/vermont_thin.csv");
    let run = |words: &str| {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command
            .current_dir(folder.path())
            .arg("retrieve")
            .arg(&thin);
        let known = "--fix=thickness_cm=2.5 --fix=density_kg_m3=155 --fix=facetness=0.2";
        let words = known.split(' ').chain(words.split_whitespace());
        let output = command.args(words).output().unwrap();
        (
            output.status.success(),
            String::from_utf8(output.stderr).unwrap(),
        )
    };
    let fails = |words: &str, parts: &[&str]| {
        let (good, errors) = run(words);
        assert!(!good, "{words}");
        for part in parts {
            assert!(errors.contains(part), "{words}: {errors}");
        }
    };
    fails("--picture none/x.svg", &["cannot write none/x.svg"]);
    assert!(!folder.path().join("out").exists());
    // a file in the place of the directory stands for one that is read-only: root writes anywhere
    std::fs::write(folder.path().join("out"), "").unwrap();
    fails("", &["cannot write out", "--keep-in DIR"]);
    let found =
        "--fix=incidence_angle_deg=0 --fix=black_carbon_ng_g=0 --free=grain_size_um=30..300";
    let (good, errors) = run(&format!("{found} --keep-in kept"));
    assert!(
        good && errors.contains("building kept/retrieve_"),
        "{errors}"
    );
    // the settings of a grid that the user did not write are not advised
    assert!(!errors.contains("warning:"), "{errors}");
    assert!(
        errors.contains("warnings, which `splitsnow plan kept/retrieve_"),
        "{errors}"
    );
    let made = std::fs::read_dir(folder.path().join("kept")).unwrap();
    let mut made = made.map(|entry| entry.unwrap().path());
    let dir = made.find(|path| path.is_dir()).unwrap();
    let within = format!("--within {} --keep-in kept", dir.display());
    fails(&within, &["--keep-in is for a database that is built"]);
    fails("--bands sentinel2a --unit um", &["cannot be used with"]);
    fails(
        "--fix=incidence_angle_deg=89.99 --keep-in kept",
        &["light may come from up to 89.9", "degrees from the normal"],
    );
}

/// Rows beyond 2500 nm are used if they are asked for.
#[test]
fn a_grid_goes_beyond_2500_nm_if_it_is_asked_to() {
    let folder = tempfile::tempdir().unwrap();
    let rows = "700,0.85\n1030,0.6\n1300,0.4\n2700,0.02\n3500,0.02\n6000,0.02\n";
    let file = folder.path().join("far.csv");
    std::fs::write(&file, format!("wavelength_nm,reflectance\n{rows}")).unwrap();
    let run = |words: &str| {
        let known =
            "--fix=incidence_angle_deg=0 --fix=black_carbon_ng_g=0 --fix=facetness=0.2 --json";
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command
            .current_dir(folder.path())
            .arg("retrieve")
            .arg("far.csv");
        let words = known.split(' ').chain(words.split_whitespace());
        let output = command.args(words).output().unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        let found: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let nm = found["spectra"][0]["wavelength_nm"].clone();
        (serde_json::from_value::<Vec<f64>>(nm), errors)
    };
    let (nm, errors) = run("");
    assert_eq!(nm.unwrap(), [700.0, 1030.0, 1300.0], "{errors}");
    let hint = "used up to 2500 nm: give --longest-nm 5000 to use more";
    assert!(errors.contains(hint), "{errors}");
    let (nm, errors) = run("--longest-nm 5000");
    assert_eq!(nm.unwrap(), [700.0, 1030.0, 1300.0, 3500.0], "{errors}");
    // the grid decides within a box
    let made = std::fs::read_dir(folder.path().join("out")).unwrap();
    let grid = made
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .find(|path| std::fs::read_to_string(path).unwrap().contains("3500"))
        .unwrap();
    for within in [grid.clone(), grid.with_extension("")] {
        let (nm, errors) = run(&format!("--within {}", within.display()));
        assert_eq!(nm.unwrap(), [700.0, 1030.0, 1300.0, 3500.0], "{errors}");
        assert!(!errors.contains("to use more"), "{errors}");
    }
    let (_, errors) = run("--longest-nm 6000");
    assert!(errors.contains("350 to 5000 nm"), "{errors}");
}
