//! `splitsnow simulate`: a virtual spectrophotometer for one snow sample.
use std::fmt::Write;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::common::{self, Interrupted, ThreadArgs};
use super::{against, bands, goniometer, profile, walking};
use crate::config::sample;
use crate::engine::{Engine, EngineError};
use crate::measurement::{Measured, Spectrum};
use crate::simulation::Simulation;

/// Measure reflectance and transmittance of one snow sample, with standard errors
///
/// Prints CSV: wavelength_nm, reflectance, reflectance_se, transmittance, transmittance_se,
/// absorptance. Comment lines that start with # come first and describe the simulation. The
/// absorptance is 1 - reflectance - transmittance; it includes the rays stopped at the event
/// limit, whose share is printed if there are any. The result depends only on the sample,
/// engine, rays and seed.
///
/// With --against, prints instead how well the simulation agrees with a measured spectrum:
/// root mean square error and bias, overall and per band, in lines that start with #; then
/// CSV: wavelength_nm, simulated, simulated_se, measured, residual (simulated - measured),
/// excluded.
///
/// With --bands, simulates the wavelengths that the bands need, every 5 nm, instead of those of
/// the sample file. Prints CSV: band, centre_nm (the response-weighted mean wavelength), from_nm,
/// to_nm, and the same five columns, averaged over the band. The standard errors are upper bounds,
/// since walks share their errors between wavelengths.
#[derive(Debug, clap::Args)]
#[command(
    mut_args = alone,
    after_long_help = "\
Examples:
  splitsnow simulate configs/samples/representative.toml --engine spectral --rays 100000 --json
  splitsnow simulate configs/samples/representative.toml --goniometer --principal-plane
  splitsnow simulate mine.toml --max-rmse 0.005
  splitsnow simulate mine.toml --against measured.csv --plot residuals.svg
  splitsnow simulate mine.toml --bands sentinel2a:B3,B11
  splitsnow simulate mine.toml --bands broadband --sun subarctic_winter
  splitsnow simulate mine.toml --depths-cm 0:10:0.5 --bands par
  splitsnow simulate configs/samples/representative.toml"
)]
pub(super) struct Args {
    /// Sample file (TOML)
    #[arg(value_name = "SAMPLE.toml")]
    sample: PathBuf,
    /// Engine that simulates the sample
    #[arg(long, default_value = Engine::Auto.name(), value_parser = common::engine_parser())]
    engine: Engine,
    /// Rays: per wavelength in `reference`, per node of refractive index in `spectral` and
    /// `tabulated`, and per direction of incidence in `hybrid` (`auto`) [default: 32768 in `hybrid`
    /// and `auto`; 131072 in other engines, at depths and toward views]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// As many rays as it takes for this root mean square error of R and T over the wavelengths:
    /// the systematic error of the engine and the noise together. The output states the number
    #[arg(long, value_name = "ERROR", value_parser = common::positive)]
    max_rmse: Option<f64>,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Print JSON: one list per column, and the share of lost rays per wavelength
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    bands: bands::Args,
    #[command(flatten)]
    against: against::Args,
    #[command(flatten)]
    profile: profile::Args,
    #[command(flatten)]
    exits: goniometer::Args,
}

/// Makes the options of one measurement exclude the others, as the measurement does. `requires`
/// does not: clap waives a required option that conflicts with one that is given.
fn alone(arg: clap::Arg) -> clap::Arg {
    let others: &[&str] = match arg.get_id().as_str() {
        "max_rmse" => &[
            "rays",
            "goniometer",
            "radial_profile",
            "view_deg",
            "depths_cm",
        ],
        "bands" | "sun" => &["against", "goniometer", "radial_profile", "view_deg"],
        "column" | "unit" | "scale" | "quantity" | "exclude" | "plot" => &[
            "bands",
            "goniometer",
            "radial_profile",
            "view_deg",
            "depths_cm",
        ],
        "sensors" | "principal_plane" => &[
            "against",
            "bands",
            "radial_profile",
            "view_deg",
            "depths_cm",
        ],
        "relative_azimuth_deg" => &[
            "against",
            "bands",
            "goniometer",
            "radial_profile",
            "depths_cm",
        ],
        _ => &[],
    };
    arg.conflicts_with_all(others)
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag()?;
    #[cfg(feature = "charts")]
    args.against.check_plot()?;
    let (sample, bands) = match args.bands.open()? {
        Some(bands) => {
            let nm = bands.wavelengths_nm();
            let averages = bands.averages(&nm)?;
            (sample::read_at(&args.sample, nm)?, Some((averages, bands)))
        }
        None => (sample::read(&args.sample)?, None),
    };
    common::warn(&sample.warnings);
    common::notes(&sample.notes);
    let target = args.against.target(&sample.wavelengths_nm)?;
    let simulation = Simulation::of(&sample).engine(args.engine).seed(args.seed);
    let simulation = match args.rays {
        Some(rays) => simulation.rays(rays),
        None => simulation,
    };
    let job = goniometer::SharedOptions {
        sample: args.sample.display().to_string(),
        engine: args.engine,
        request: simulation.detailed_request(),
        threads: args.threads,
        json: args.json,
    };
    if args.profile.is_requested() {
        let text = profile::text(&args.profile, &job, bands.as_ref(), cancel)?;
        return common::print(&text);
    }
    if args.exits.is_requested() {
        return goniometer::run(&args.exits, &job, cancel);
    }
    let result = match args.max_rmse {
        None => walking::run(args.threads, Some(simulation.walks()?), cancel, |control| {
            let spectrum = simulation.run_with(control)?;
            Ok((simulation.clone(), spectrum))
        })?,
        Some(rmse) => {
            let simulation = simulation.max_rmse(rmse);
            walking::run(args.threads, None, cancel, |control| {
                simulation.run_to_error_with(control)
            })?
        }
    };
    let (simulation, spectrum) = match result {
        Err(EngineError::Cancelled) => return Err(Interrupted("nothing was written".into()).into()),
        result => result?,
    };
    let (engine, rays) = (simulation.resolved(), simulation.request().rays);
    let bands = bands.map(|(averages, bands)| bands.simulated(&averages, &spectrum, engine));
    let compared = target.map(|target| target.compare(&spectrum));
    common::print(&if args.json {
        let mut value = json_value(args, (engine, rays), &sample.wavelengths_nm, &spectrum);
        if let Some(compared) = &compared {
            value["against"] = compared.json();
        }
        if let Some(bands) = &bands {
            value["bands"] = bands.json();
        }
        format!("{value:#}\n")
    } else {
        let rows = match (&compared, &bands) {
            (Some(compared), _) => compared.csv(),
            (None, Some(bands)) => bands.csv(&sample.wavelengths_nm),
            (None, None) => csv_rows(&sample.wavelengths_nm, &spectrum),
        };
        comments(args, (engine, rays), &spectrum) + &rows
    })?;
    #[cfg(feature = "charts")]
    if let Some(compared) = &compared {
        args.against.plot(compared)?;
    }
    Ok(())
}

/// The share of light that is neither reflected nor transmitted.
fn absorptance(reflectance: &Measured, transmittance: &Measured) -> f64 {
    1.0 - reflectance.value - transmittance.value
}

/// The comment lines that describe the simulation: version, sample, engine, rays, seed.
fn comments(args: &Args, (engine, rays): (Engine, u64), spectrum: &Spectrum) -> String {
    let sample = common::one_line(&args.sample);
    let (version, engine) = (env!("CARGO_PKG_VERSION"), engine.name());
    let seed = args.seed;
    let mut out = format!(
        "# splitsnow {version} measure\n# sample: {sample}\n# engine: {engine}\n# rays: {rays}\n# seed: {seed}\n"
    );
    let lost = spectrum.lost.iter().copied().fold(0.0, f64::max);
    if lost > 0.0 {
        let _ = writeln!(
            out,
            "# lost_share: {lost:?} at most; rays stopped at the event limit, counted in absorptance"
        );
    }
    out
}

fn csv_rows(wavelengths_nm: &[f64], spectrum: &Spectrum) -> String {
    let mut out = String::from(
        "wavelength_nm,reflectance,reflectance_se,transmittance,transmittance_se,absorptance\n",
    );
    let measured = spectrum.reflectance.iter().zip(&spectrum.transmittance);
    for (nm, (r, t)) in wavelengths_nm.iter().zip(measured) {
        // `{:?}` prints the shortest decimals that read back as the same number.
        let absorptance = absorptance(r, t);
        let _ = writeln!(
            out,
            "{nm},{:?},{:?},{:?},{:?},{absorptance:?}",
            r.value, r.se, t.value, t.se
        );
    }
    out
}

fn json_value(
    args: &Args,
    (engine, rays): (Engine, u64),
    wavelengths_nm: &[f64],
    spectrum: &Spectrum,
) -> Value {
    let (r, t) = (&spectrum.reflectance, &spectrum.transmittance);
    let list = |column: &[Measured], part: fn(&Measured) -> f64| -> Vec<f64> {
        column.iter().map(part).collect()
    };
    let absorptance: Vec<f64> = r.iter().zip(t).map(|(r, t)| absorptance(r, t)).collect();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "sample": args.sample.display().to_string(),
        "engine": engine.name(),
        "rays": rays,
        "seed": args.seed,
        "wavelength_nm": wavelengths_nm,
        "reflectance": list(r, |m| m.value),
        "reflectance_se": list(r, |m| m.se),
        "transmittance": list(t, |m| m.value),
        "transmittance_se": list(t, |m| m.se),
        "absorptance": absorptance,
        "lost_share": spectrum.lost,
    })
}
