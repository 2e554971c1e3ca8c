//! A database of many small jobs, whose spectra come from a formula in place of an engine: what
//! the program itself costs (docs/scale.md).
//!
//! `cargo run --release --example scale -- DIR JOBS I/N` runs the jobs of a shard;
//! `... -- DIR JOBS finish` runs what is left and compresses. JOBS is a power of ten up to
//! 1,000,000. Prints the jobs run, the CPU time and the largest memory.
#![allow(clippy::print_stdout)]
use std::path::Path;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use splitsnow::batch::{self, BatchOptions};
use splitsnow::build::{self, CompressionRequest};
use splitsnow::config;
use splitsnow::engine::{Control, EngineError, Request};
use splitsnow::grid::Shard;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::store::{Access, Store};

/// A grid of `jobs` jobs with one curve each.
fn text(jobs: u64) -> String {
    let mut left = jobs;
    // number of values of each axis
    let mut values = |first: f64, step: f64| {
        let count = if left >= 10 { 10 } else { 1 };
        left /= count;
        let values: Vec<String> = (0..count)
            .map(|i| format!("{:.3}", first + step * i as f64))
            .collect();
        values.join(", ")
    };
    let (facetness, size, density) = (values(0.05, 0.1), values(100.0, 20.0), values(100.0, 40.0));
    let (thickness, angle, carbon) = (values(2.0, 1.0), values(0.0, 8.0), values(0.0, 50.0));
    format!(
        "version = 1
[axes]
facetness = [{facetness}]
grain_size_um = [{size}]
density_kg_m3 = [{density}]
thickness_cm = [{thickness}]
incidence_angle_deg = [{angle}]
black_carbon_ng_g = [{carbon}]
[wavelengths]
start_nm = 400
stop_nm = 700
step_nm = 10
[run]
engine = \"reference\"
rays = 100
"
    )
}

/// Beer's law with a number in the snow's place.
fn spectra(request: &Request<'_>, _: &Control<'_>) -> Result<Vec<Spectrum>, EngineError> {
    let snow = (request.cell % 997) as f64 / 997.0;
    let measured = |value: f64| Measured { value, se: 1e-4 };
    let curve = |thickness_m: &f64| {
        let transmitted = |nm: &f64| {
            let absorbed = (1.0 + snow) * (nm / 400.0).powi(2) * thickness_m;
            0.3 * (-absorbed).exp()
        };
        let nm = request.wavelengths_nm.iter();
        Spectrum {
            transmittance: nm.clone().map(|nm| measured(transmitted(nm))).collect(),
            reflectance: nm
                .map(|nm| measured(0.95 - 2.0 * transmitted(nm)))
                .collect(),
            lost: vec![0.0; request.wavelengths_nm.len()],
        }
    };
    Ok(request.thicknesses_m.iter().map(curve).collect())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dir, jobs, part] = &arguments[..] else {
        anyhow::bail!("usage: scale DIR JOBS I/N|finish");
    };
    let file = config::grid::parse("scale.toml", &text(jobs.parse()?))?;
    let shard = match part.as_str() {
        "finish" => None,
        part => {
            let (index, count) = part.split_once('/').context("a shard is I/N")?;
            Some(Shard::new(index.parse()?, count.parse()?)?)
        }
    };
    let begin = cpu_seconds();
    let dir = Path::new(dir);
    let access = shard.map_or(Access::Exclusive, Access::Shard);
    let store = Store::build(dir, &file.grid, &Default::default(), access)?;
    let options = BatchOptions {
        threads: 1,
        shard,
        progress: None,
    };
    let summary = batch::run(
        &file.grid,
        &store,
        spectra,
        &options,
        &AtomicBool::new(false),
    )?;
    drop(store);
    let ran = cpu_seconds();
    println!(
        "jobs {} run {} cpu_s {:.2}",
        summary.jobs,
        summary.run,
        ran - begin
    );
    if shard.is_none() {
        let request = CompressionRequest::plain(file.grid.compression, file.viewing);
        let report = build::compress(dir, &request)?;
        println!(
            "curves {} compress_cpu_s {:.2}",
            report.curves,
            cpu_seconds() - ran
        );
    }
    println!("peak_mb {}", peak_mb().unwrap_or_default());
    Ok(())
}

fn cpu_seconds() -> f64 {
    cpu_time::ProcessTime::now().as_duration().as_secs_f64()
}

/// Largest memory so far, MB, on Linux.
fn peak_mb() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes / 1000)
}
