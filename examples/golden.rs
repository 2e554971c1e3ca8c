//! Computes `tests/data/golden.csv`: converged reflectance and transmittance for the runs
//! of `tests/common/golden/plan.rs`, on one thread (about 50 minutes).
//!
//! `cargo run --release --example golden -- DATE`
//!
//! The file is rewritten after every run. Runs that are already in the file are not
//! repeated: an interrupted command resumes where it stopped, and if the number of rays of
//! one run changes, only that run is repeated.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
#[path = "../tests/common/golden/mod.rs"]
#[allow(dead_code)]
mod golden;

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Instant;

use golden::plan::{Run, illumination, runs};
use golden::{COLUMNS, FILE, key};
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::transport::Model;
use splitsnow::units::cm_to_m;

const SEED: u64 = 8128;

fn main() {
    let Some(date) = std::env::args().nth(1) else {
        println!("usage: cargo run --release --example golden -- DATE");
        return;
    };
    let runs = runs();
    let file = fs::read_to_string(FILE).unwrap_or_default();
    let old_rows = by_key(&file);
    let mut rows: Vec<Option<String>> = runs
        .iter()
        .map(|run| finished_rows(&old_rows, run))
        .collect();
    write(&date, &rows);
    let start = Instant::now();
    for (number, run) in runs.iter().enumerate() {
        if rows[number].is_some() {
            continue;
        }
        let spectra = compute(run, number as u64);
        rows[number] = Some(to_rows(run, &spectra));
        write(&date, &rows);
        println!(
            "{}/{}: {:.0} s in all, {}",
            number + 1,
            runs.len(),
            start.elapsed().as_secs_f64(),
            worst_errors(&spectra),
        );
    }
}

/// Writes the finished runs. The file is replaced atomically, so that an interruption does
/// not leave it incomplete.
fn write(date: &str, rows: &[Option<String>]) {
    let rows: String = rows.iter().flatten().map(String::as_str).collect();
    let temporary = format!("{FILE}.new");
    fs::write(&temporary, format!("{}{COLUMNS}\n{rows}", header(date))).unwrap();
    fs::rename(&temporary, FILE).unwrap();
}

fn header(date: &str) -> String {
    format!(
        "\
# Directional-hemispherical reflectance and transmittance of snow slabs, converged.
# command: cargo run --release --example golden -- {date}
# engine: {}, seed {SEED}, cell: number of the run in the plan; splitsnow {}, {date}
# The plan and the laws of the grains: tests/common/golden/plan.rs.
# size_min_um, size_max_um: grain length, uniform in between
# facetness, facetness_half_width: normal law with sd 0.072, cut to mean -+ half width and to [0, 1]
# (sphericity: normal, mean 0.798, sd 0.064, cut to [0.6, 0.95]; temperature -1 C)
# density_kg_m3: of the dry snow; saturation: share of the pore space that is water
# angle_deg: of incidence, from the normal, or diffuse: isotropic radiance
# rays: per index node; each wavelength mixes two
# *_se: standard errors; those of one snow and light are correlated over wavelengths, and over
# thicknesses that shared their walks. Where no ray scored, the value is 0 and the error 1/rays;
# where an error exceeds a quarter of its value, few rays scored and it may be far too small.
# lost: share of the rays given up, in neither of the two: those trapped in a smooth grain
# (about 2e-8 per grain event), and those that met 10^7 grains
",
        Engine::Spectral.name(),
        env!("CARGO_PKG_VERSION"),
    )
}

/// The rows of `file` by their [`key`].
fn by_key(file: &str) -> HashMap<&str, &str> {
    let keys = file.lines().filter_map(|line| {
        let (end, _) = line.match_indices(',').nth(9)?;
        Some((&line[..=end], line))
    });
    keys.collect()
}

/// The rows of `run` from the old file, if all of them are in it.
fn finished_rows(old_rows: &HashMap<&str, &str>, run: &Run) -> Option<String> {
    let keys = keys(run).into_iter();
    keys.map(|key| old_rows.get(key.as_str()).map(|row| format!("{row}\n")))
        .collect()
}

/// The keys of the rows of `run`: the columns with which a row begins.
fn keys(run: &Run) -> Vec<String> {
    let key = |cm| run.wavelengths_nm.iter().map(move |&nm| key(run, cm, nm));
    run.thicknesses_cm.iter().flat_map(|&cm| key(cm)).collect()
}

fn compute(run: &Run, cell: u64) -> Vec<Spectrum> {
    let snow = run.snow.snow();
    let thicknesses_m: Vec<f64> = run.thicknesses_cm.iter().map(|cm| cm_to_m(*cm)).collect();
    let model = Model::default();
    let request = Request {
        snowpack: &snow.clone().into(),
        thicknesses_m: &thicknesses_m,
        illuminations: &[illumination(run.angle_deg)],
        resolution: Resolution::default(),
        max_error: MaxError::default(),
        wavelengths_nm: run.wavelengths_nm,
        model: &model,
        rays: run.rays,
        seed: SEED,
        cell,
    };
    let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
    let control = Control {
        parallel: false,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &Cache::default(),
    };
    Engine::Spectral.run(&request, &control).unwrap()
}

fn to_rows(run: &Run, spectra: &[Spectrum]) -> String {
    let mut keys = keys(run).into_iter();
    let mut rows = String::new();
    for spectrum in spectra {
        let values = spectrum.reflectance.iter().zip(&spectrum.transmittance);
        for (((r, t), lost), key) in values.zip(&spectrum.lost).zip(&mut keys) {
            let [r_se, t_se, lost] = [r.se, t.se, *lost].map(|value| digits(value, 3));
            let [r, t] = [r.value, t.value].map(|value| digits(value, 6));
            writeln!(rows, "{key}{r},{r_se},{t},{t_se},{lost}").unwrap();
        }
    }
    rows
}

/// Formats `value` with `digits` significant digits; small values have an exponent.
fn digits(value: f64, digits: usize) -> String {
    let scientific = format!("{value:.*e}", digits - 1);
    let rounded: f64 = scientific.parse().unwrap();
    if value == 0.0 || value >= 1e-3 {
        rounded.to_string()
    } else {
        scientific
    }
}

fn worst_errors(spectra: &[Spectrum]) -> String {
    let worst = |values: fn(&Spectrum) -> &[Measured]| {
        let largest = spectra
            .iter()
            .map(|s| values(s).iter().map(|m| m.se).fold(0.0, f64::max));
        let text: Vec<String> = largest.map(|se| format!("{se:.1e}")).collect();
        text.join(" ")
    };
    let (r, t) = (worst(|s| &s.reflectance), worst(|s| &s.transmittance));
    format!("largest standard errors per thickness: R {r}, T {t}")
}
