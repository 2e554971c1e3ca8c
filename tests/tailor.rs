//! `tailor`: the files it writes meet the bound of the scene, which `verify` confirms. If it
//! fails, it says why and writes nothing.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::thread::sleep;
use std::time::Duration;

use assert_cmd::cargo::cargo_bin;
use ndarray::Array2;
use splitsnow::colour::Colorimeter;
use splitsnow::compress::with_metadata;
use splitsnow::config::scene;
use splitsnow::engine::{Cache, Control};
use splitsnow::error_budget::{
    Certification, ERROR_BUDGET, ErrorBudget, Measures, Patch, PatchSimulation,
};
use splitsnow::tailor::{self, BETWEEN_WAVELENGTHS, SCENE};

use splitsnow::lookup::Database;
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};
use splitsnow::store::COMPACT;

const TEXT: &str = "version = 1
[scene]
max_delta_e = 1
quantities = [\"transmittance\"]
thickness_cm = { min = 5, max = 10 }
incidence_angle_deg = { min = 0, max = 60 }
[[snow]]
facetness = 0.3
grain_size_um = 300
density_kg_m3 = 300
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 20
";

struct Folder(tempfile::TempDir);

impl Folder {
    /// A folder with the scene file `s.toml`.
    fn new(text: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("s.toml"), text).unwrap();
        Self(dir)
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn command(&self, args: &str) -> Command {
        let mut command = Command::new(cargo_bin!("splitsnow"));
        command.current_dir(self.path());
        command.args(args.split_whitespace());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn run(&self, args: &str) -> Output {
        self.command(args).output().unwrap()
    }

    fn fit(&self, more: &str) -> String {
        let output = self.run(&format!("fit s.toml --points 64 {more}"));
        assert!(output.status.success(), "{}", errors(&output));
        assert_eq!(errors(&output), "");
        String::from_utf8(output.stdout).unwrap()
    }

    fn file(&self) -> PathBuf {
        self.path().join("out/s").join(COMPACT)
    }

    /// Runs a `tailor` that must fail and write nothing; returns the error.
    fn error_of_failed_fit(&self) -> String {
        let output = self.run("fit s.toml --points 16");
        assert_eq!(output.status.code(), Some(1), "{}", errors(&output));
        assert!(!self.path().join("out").exists());
        errors(&output)
    }
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A tailored file and its text report, made once for all tests.
static TAILORED: LazyLock<(Vec<u8>, String)> = LazyLock::new(|| {
    let folder = Folder::new(TEXT);
    let text = folder.fit("--threads 1");
    (fs::read(folder.file()).unwrap(), text)
});

/// A folder that contains `bytes` as its tailored file.
fn with_file(bytes: &[u8]) -> Folder {
    let folder = Folder::new(TEXT);
    fs::create_dir_all(folder.file().parent().unwrap()).unwrap();
    fs::write(folder.file(), bytes).unwrap();
    folder
}

#[test]
fn a_tailored_file_meets_its_bound_and_passes_verification() {
    let (bytes, text) = &*TAILORED;
    let file = Database::from_bytes(bytes).unwrap();
    let error_budget: ErrorBudget = serde_json::from_str(&file.metadata()[ERROR_BUDGET]).unwrap();
    assert!(tailor::max_delta_e(&error_budget) < 1.0, "{error_budget}");
    assert!(error_budget.points >= 64 && error_budget.quantities.len() == 1);
    // fewer than the 16 wavelengths requested, and the cost of that
    let kept = file.wavelengths_nm();
    assert!((3..14).contains(&kept.len()), "{kept:?}");
    assert_eq!((kept[0], kept[kept.len() - 1]), (400.0, 700.0));
    assert_eq!(file.metadata()[BETWEEN_WAVELENGTHS], "linear");
    let chain = &error_budget.quantities["transmittance"];
    let between = chain.wavelengths.unwrap().delta_e.unwrap();
    assert!(between.max > 0.0 && between.max < 0.2, "{between:?}");
    assert!(text.contains("out/s/snow.safetensors: "), "{text}");
    assert!(text.contains("next: splitsnow verify out/s"), "{text}");
    assert_eq!(file.axes().core_shape()[..3], [1, 1, 1]);
    let region = file.axes().region();
    assert_eq!(region.get(Parameter::Thickness), Some([5.0, 10.0]));

    let folder = with_file(bytes);
    let output = folder.run("verify out/s --points 64 --point-rays 131072");
    let report = String::from_utf8(output.stdout.clone()).unwrap();
    assert!(output.status.success(), "{report}{}", errors(&output));
    assert!(report.ends_with("PASS\n"), "{report}");
    // the new error budget, from other points and walks, replaces the old one
    let verified = Database::open(folder.file()).unwrap();
    let other: ErrorBudget = serde_json::from_str(&verified.metadata()[ERROR_BUDGET]).unwrap();
    assert_ne!(other.seed, error_budget.seed);
    assert_ne!(other.quantities, error_budget.quantities);
    assert_eq!(verified.metadata()[SCENE], file.metadata()[SCENE]);
}

/// Uses databases of the same simulations, at some of the wavelengths of the scene.
#[test]
fn the_error_budget_includes_omitted_wavelengths() {
    let scene = scene::parse("s.toml", TEXT).unwrap().scene;
    let (grid, regions) = (tailor::grid(&scene), &scene.regions);
    let patch = Patch {
        snow: Point::from([
            (Parameter::Facetness, 0.3),
            (Parameter::GrainSize, 300.0),
            (Parameter::Density, 300.0),
        ]),
        thickness_cm: vec![5.0, 7.0, 10.0],
        angle_deg: vec![0.0, 30.0, 60.0],
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &Cache::default(),
    };
    let simulation = PatchSimulation {
        grid: &grid,
        rays: 16_384,
        seed: 1,
    };
    let spectra = simulation
        .run(std::slice::from_ref(&patch), &control)
        .unwrap();
    let axes = Axes::from([
        (Parameter::Facetness, vec![0.3]),
        (Parameter::GrainSize, vec![300.0]),
        (Parameter::Density, vec![300.0]),
        (Parameter::Thickness, patch.thickness_cm),
        (Parameter::Incidence, patch.angle_deg),
    ]);
    let colour = Colorimeter::viewing(&scene.wavelengths_nm, &scene.viewing).unwrap();
    let chain = |kept: &[usize]| {
        let nm: Vec<f64> = kept.iter().map(|i| scene.wavelengths_nm[*i]).collect();
        let value = |(row, w): (usize, usize)| spectra[0][row].transmittance[kept[w]].value;
        let curves = Array2::from_shape_fn((9, kept.len()), value);
        let file = Database::from_curves(true, &axes, &nm, Some(&curves), None);
        let subject = Certification {
            grid: &grid,
            regions,
            file: &file,
            exact: &file,
            colour: colour.as_ref(),
            points: 32,
            rays: 16_384,
            seed: 1,
        };
        let error_budget = subject.certify(&control).unwrap();
        error_budget.quantities["transmittance"].clone()
    };
    let max = |measures: Measures| measures.delta_e.unwrap().max;
    let every_wavelength = chain(&(0..16).collect::<Vec<_>>());
    let ends_only = chain(&[0, 15]);
    assert_eq!(every_wavelength.wavelengths, None);
    assert_eq!(every_wavelength.total, every_wavelength.interpolation);
    assert!(max(every_wavelength.total) < 0.3, "{every_wavelength:?}");
    assert!(max(ends_only.wavelengths.unwrap()) > 2.5, "{ends_only:?}");
    assert!(max(ends_only.total) > 2.5, "{ends_only:?}");
    assert!(
        ends_only.total.rmse.max > 3.0 * every_wavelength.total.rmse.max,
        "{ends_only:?}"
    );
    // the other terms of the budget do not change
    assert!(max(ends_only.interpolation) < 0.3, "{ends_only:?}");
    assert!(max(ends_only.simulation.unwrap()) < 0.3, "{ends_only:?}");
}

#[test]
fn few_wavelengths_are_not_thinned_out() {
    let text = TEXT.replace("step_nm = 20", "step_nm = 100");
    let folder = Folder::new(&text);
    let text = folder.fit("");
    let file = Database::open(folder.file()).unwrap();
    assert_eq!(file.wavelengths_nm(), [400.0, 500.0, 600.0, 700.0]);
    let error_budget: ErrorBudget = serde_json::from_str(&file.metadata()[ERROR_BUDGET]).unwrap();
    assert_eq!(error_budget.quantities["transmittance"].wavelengths, None);
    assert!(text.contains("(4 of 4)"), "{text}");
    assert!(!text.contains("wavelengths;"), "{text}");
}

#[test]
fn the_number_of_threads_does_not_change_the_file() {
    let folder = Folder::new(TEXT);
    let text = folder.fit("--threads 2");
    assert_eq!((fs::read(folder.file()).unwrap(), text), *TAILORED);
}

#[test]
fn quantities_not_requested_are_omitted() {
    let (bytes, text) = &*TAILORED;
    let file = Database::from_bytes(bytes).unwrap();
    assert!(file.has(Quantity::Transmittance) && !file.has(Quantity::Reflectance));
    assert!(text.contains(" of 16, linear between)"), "{text}");
    assert!(text.contains(" of 16 wavelengths; reflectance;"), "{text}");
    let left_out = "reflectance; the axes facetness, grain_size_um, density_kg_m3";
    assert!(text.contains(left_out), "{text}");
    let folder = with_file(bytes);
    let point = "--facetness 0.3 --grain-size-um 300 --density-kg-m3 300 --thickness-cm 7.3 --incidence-angle-deg 33";
    let query = folder.run(&format!("query out/s {point} --explain"));
    assert!(query.status.success(), "{}", errors(&query));
    let csv = String::from_utf8(query.stdout).unwrap();
    let n = file.wavelengths_nm().len();
    let comment = format!("# {n} wavelengths, between them linear\n");
    assert!(csv.contains(&comment), "{csv}");
    assert_eq!(
        csv.lines().filter(|line| !line.starts_with('#')).count(),
        1 + n
    );
    let other = folder.run(&format!("query out/s {point} --quantity reflectance"));
    assert_eq!(other.status.code(), Some(1));
    assert_eq!(
        errors(&other),
        "error: the compact file has no reflectance, it has transmittance only; ask for that, or make a file with both\n"
    );
}

/// The file with `change` applied to the numbers of the float32 tensor `name`.
fn with_changed_tensor(bytes: &[u8], name: &str, change: impl Fn(f32) -> f32) -> Vec<u8> {
    let header = 8 + u64::from_le_bytes(*bytes.first_chunk().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[8..header]).unwrap();
    let ends: [usize; 2] = serde_json::from_value(json[name]["data_offsets"].clone()).unwrap();
    let mut bytes = bytes.to_vec();
    for number in bytes[header + ends[0]..header + ends[1]].chunks_exact_mut(4) {
        let value = f32::from_le_bytes(*number.first_chunk().unwrap());
        number.copy_from_slice(&change(value).to_le_bytes());
    }
    bytes
}

#[test]
fn altered_coefficients_fail_verification() {
    let altered = with_changed_tensor(&TAILORED.0, "transmittance.quantisation", |v| 1.1 * v);
    let folder = with_file(&altered);
    let output = folder.run("verify out/s --points 16 --point-rays 65536");
    assert_eq!(output.status.code(), Some(1));
    let report = String::from_utf8(output.stdout).unwrap();
    assert!(report.contains("is not below 1.0000"), "{report}");
    assert!(report.ends_with("FAIL\n"), "{report}");
}

#[test]
fn a_lowered_bound_fails_verification() {
    let file = Database::from_bytes(&TAILORED.0).unwrap();
    let (text, error_budget) = (&file.metadata()[SCENE], &file.metadata()[ERROR_BUDGET]);
    let reached = tailor::max_delta_e(&serde_json::from_str(error_budget).unwrap());
    let bound = format!("{:.2}", 0.8 * reached);
    let lowered = text.replace("max_delta_e = 1\n", &format!("max_delta_e = {bound}\n"));
    assert_ne!(&lowered, text);
    let folder = with_file(&with_metadata(&TAILORED.0, &[(SCENE, Some(&lowered))]).unwrap());
    let output = folder.run("verify out/s --points 16 --point-rays 65536");
    assert_eq!(output.status.code(), Some(1));
    let report = String::from_utf8(output.stdout).unwrap();
    assert!(
        report.contains(&format!("is not below {bound}")),
        "{report}"
    );
}

#[test]
fn a_file_above_the_size_limit_is_rejected() {
    let text = TEXT.replace("max_delta_e = 1", "max_delta_e = 1\nmax_bytes = 100");
    let error = Folder::new(&text).error_of_failed_fit();
    let bytes = TAILORED.0.len();
    let (start, end) = ("takes ", " bytes, more than max_bytes = 100;");
    let needed = error.split_once(start).unwrap().1.split_once(end);
    let needed: usize = needed.unwrap().0.parse().unwrap();
    // up to the size of the key itself and the number of points of the error budget
    assert!(needed.abs_diff(bytes) < bytes / 5, "{error} {bytes}");
}

#[test]
fn an_unreachable_bound_is_rejected() {
    // no time to choose nodes, so only the end nodes are used
    let text = TEXT
        .replace("max_delta_e = 1", "max_delta_e = 1\nmax_seconds = 0.001")
        .replace("min = 5, max = 10", "min = 2, max = 40");
    let error = Folder::new(&text).error_of_failed_fit();
    let (_, best) = error.split_once("the best reaches ").unwrap();
    let reached: f64 = best.split_whitespace().next().unwrap().parse().unwrap();
    assert!(reached > 1.0, "{error}");
    assert!(
        error.contains("keeps Delta-E 1 ") && best.contains("thickness"),
        "{error}"
    );
}

#[test]
fn ctrl_c_leaves_no_files() {
    // a bound that needs many walks
    let folder = Folder::new(&TEXT.replace("max_delta_e = 1", "max_delta_e = 0.05"));
    let child = folder.command("fit s.toml").spawn().unwrap();
    sleep(Duration::from_millis(500));
    let id = child.id().to_string();
    let kill = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(kill.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", errors(&output));
    let message = errors(&output);
    assert!(
        message.ends_with("interrupted: nothing was written\n"),
        "{message}"
    );
    assert_eq!(crate::common::dir_bytes(folder.path()).len(), 1);
}
