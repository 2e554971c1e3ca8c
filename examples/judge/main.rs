//! Judges variants of the model by measurements, and writes docs/judge (tables and a picture;
//! docs/measurements.md shows them).
//!
//! `cargo run --release --example judge -- docs/judge` takes some twenty minutes of CPU time. A
//! second argument scales the numbers of walks; `draw` draws the picture again.
//!
//! - `directions.csv`: anisotropy factors pi f / R of two snows in the laboratory (Dumont et al.
//!   2010). What the paper says of the grains is not at hand. So the optical radius is fitted,
//!   once for each variant and sample, to the factors at normal incidence and 1030, 1240 and
//!   1500 nm. Those at 30 and 60 degrees are predictions, and so is 600 nm, where the radius
//!   hardly matters. The snow is dry, 30 cm thick, 275 kg/m3, -10 C.
//! - `plane.csv`: the same factors in the principal plane, forward views positive.
//! - `reflectance.csv`: natural snow of two thicknesses (Letcher et al. 2022), spheres, statements
//!   of Varsa 2025. Nothing is fitted, except one specific surface area of the natural snow in the
//!   rows that say so.
//!
//! Shapes and facets are never fitted: each is a variant.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
mod directions;
mod picture;
mod reflectance;
mod variants;

use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64};

use directions::Directions;
use splitsnow::engine::{Cache, Control, EngineError, MaxError, Request, Resolution};
use splitsnow::transport::{Illumination, Snowpack};
use variants::Variant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Walks per index node for directions; those of reflectances are ten times as many.
const WALKS: f64 = 6000.0;

/// How engines run.
#[derive(Clone, Copy)]
struct Runner {
    rays: u64,
    seed: u64,
}

impl Runner {
    fn request<'a>(
        &self,
        snowpack: &'a Snowpack,
        thicknesses_m: &'a [f64],
        illuminations: &'a [Illumination],
        wavelengths_nm: &'a [f64],
        variant: &'a Variant,
    ) -> Request<'a> {
        Request {
            snowpack,
            thicknesses_m,
            illuminations,
            wavelengths_nm,
            model: &variant.model,
            rays: self.rays,
            max_error: MaxError::default(),
            resolution: Resolution::default(),
            seed: self.seed,
            cell: 0,
        }
    }

    fn with<T>(
        &self,
        cache: &Cache,
        work: impl FnOnce(&Control) -> std::result::Result<T, EngineError>,
    ) -> Result<T> {
        let (cancel, rays_done) = (AtomicBool::new(false), AtomicU64::new(0));
        Ok(work(&Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache,
        })?)
    }
}

/// The rows of a CSV file of numbers, without comments and header.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    lines
        .map(|line| line.split(',').map(|v| v.parse().unwrap()).collect())
        .collect()
}

/// Root mean square of differences, and of standard errors.
fn rms(scores: impl Iterator<Item = directions::Score>) -> [f64; 2] {
    let [squares, noise, count] = scores.fold([0.0; 3], |sum, score| {
        std::array::from_fn(|i| sum[i] + score[i])
    });
    [(squares / count).sqrt(), (noise / count).sqrt()]
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().unwrap_or_else(|| "docs/judge".to_owned());
    let out = Path::new(&out);
    let second = arguments.next();
    if second.as_deref() == Some("draw") {
        return picture::plane(&out.join("plane.csv"), &out.join("plane.svg"));
    }
    let scale: f64 = second.map_or(Ok(1.0), |text| text.parse())?;
    let walks = |count: f64| Runner {
        rays: (count * scale) as u64,
        seed: 1,
    };
    std::fs::create_dir_all(out)?;
    reflectances(&walks(10.0 * WALKS), out)?;
    directions(&walks(WALKS), out)
}

fn reflectances(runner: &Runner, out: &Path) -> Result<()> {
    let mut csv = String::from("variant,data,condition,given,computed,standard_error\n");
    let mut add = |name: &str, pairs: Vec<reflectance::Pair>| {
        for pair in &pairs {
            let (data, condition) = (pair.data, &pair.condition);
            let [value, se] = pair.computed;
            writeln!(
                csv,
                "\"{name}\",\"{data}\",\"{condition}\",{},{value:.5},{se:.5}",
                pair.given
            )
            .unwrap();
        }
        // statements are single numbers, of different units
        let is_spectrum = |pairs: &&[reflectance::Pair]| pairs[0].data != reflectance::STATEMENTS;
        let data = pairs.chunk_by(|a, b| a.data == b.data);
        for pairs in data.filter(is_spectrum) {
            let score = pairs.iter().map(|pair| {
                let [value, se] = pair.computed;
                [(value - pair.given).powi(2), se * se, 1.0]
            });
            let [rmse, noise] = rms(score);
            println!(
                "{name}: {}: RMSE {rmse:.3}, noise {noise:.4}",
                pairs[0].data
            );
        }
    };
    for variant in variants::options() {
        add(&variant.name, reflectance::statements(runner, &variant)?);
    }
    for variant in variants::spheres() {
        add(&variant.name, reflectance::spheres(runner, &variant)?);
    }
    for variant in variants::options().into_iter().chain(variants::grains()) {
        add(&variant.name, reflectance::natural(runner, &variant)?);
    }
    std::fs::write(out.join("reflectance.csv"), csv)?;
    Ok(())
}

fn directions(runner: &Runner, out: &Path) -> Result<()> {
    let measured = Directions::new();
    let mut scores = String::from(
        "variant,sample,optical_radius_um,wavelength_nm,incidence_deg,views,rmse,noise\n",
    );
    let mut plane = String::from(
        "variant,sample,wavelength_nm,incidence_deg,view_deg,measured,computed,standard_error\n",
    );
    for variant in variants::options().into_iter().chain(variants::grains()) {
        let name = &variant.name;
        let (misfits, values) = measured.judge(runner, &variant)?;
        for misfit in &misfits {
            let [rmse, noise] = rms([misfit.score].into_iter());
            writeln!(
                scores,
                "\"{name}\",{},{},{},{},{},{rmse:.4},{noise:.4}",
                misfit.sample, misfit.radius_um, misfit.nm, misfit.incidence_deg, misfit.score[2]
            )?;
        }
        for value in &values {
            let [computed, se] = value.computed;
            writeln!(
                plane,
                "\"{name}\",{},{},{},{},{},{computed:.4},{se:.4}",
                value.sample, value.nm, value.incidence_deg, value.view_deg, value.measured
            )?;
        }
        let over = |nm: f64| {
            let chosen = misfits.iter().filter(|misfit| misfit.nm == nm);
            rms(chosen.map(|misfit| misfit.score))
        };
        let [[visible, noise], [infrared, _]] = [600.0, 1030.0].map(over);
        println!(
            "{name}: directions: RMSE {visible:.3} at 600 nm (noise {noise:.3}), {infrared:.3} at 1030 nm"
        );
        // kept at each variant: an interrupted run leaves what it has
        std::fs::write(out.join("directions.csv"), &scores)?;
        std::fs::write(out.join("plane.csv"), &plane)?;
    }
    picture::plane(&out.join("plane.csv"), &out.join("plane.svg"))
}
