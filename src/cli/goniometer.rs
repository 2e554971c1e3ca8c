//! `simulate --goniometer` and `--radial-profile`: the directions or the distances at which
//! light leaves a sample.
use std::fmt::Write;
use std::sync::atomic::AtomicBool;

use serde_json::json;

use super::common::{self, Interrupted, ThreadArgs};
use super::{views, walking};
use crate::engine::exits::{self, Exits};
use crate::engine::{Control, Engine, EngineError, Request};
use crate::measurement::{MOST_SENSORS, Measured, Radii, Sensors};

/// Radii of the profile: the innermost in mean free distances, the outermost in sample
/// thicknesses.
const RADII: [f64; 2] = [0.1, 10.0];

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Measure BRDF and BTDF instead, on sensors of equal solid angle
    ///
    /// Prints CSV: wavelength_nm, side (reflected or transmitted), polar_deg and azimuth_deg
    /// of the sensor's centre, value_per_sr, se_per_sr. Polar angles are measured from the
    /// normal on that side. Azimuth 0 is forward, the direction in which the light travels;
    /// azimuth 180 is back toward the source. Values times projected solid angles sum to
    /// reflectance and transmittance, which comment lines (starting with #) give with their
    /// standard errors for all sensors together. Engines: reference, spectral and tabulated
    /// (auto; the fastest). Values of tabulated are scaled to the reflectance and
    /// transmittance of hybrid where hybrid applies.
    #[arg(long)]
    pub(super) goniometer: bool,
    /// Number of sensors on each hemisphere
    #[arg(long, value_name = "N", default_value_t = 1000, requires = "goniometer",
        value_parser = clap::value_parser!(u32).range(1..=MOST_SENSORS as i64))]
    sensors: u32,
    /// Print only the sensors that the plane of incidence cuts, at azimuths 0 and 180
    #[arg(long, requires = "goniometer")]
    principal_plane: bool,
    /// Measure in N rings how far from its point of entry light leaves
    ///
    /// Prints CSV: wavelength_nm, side, radius_min_m, radius_max_m, exitance_per_m2 (power
    /// leaving per area and unit incident power), its standard error se_per_m2, share (of the
    /// incident power, within the ring) and share_se. The last row holds all light that
    /// leaves farther out. Engines: reference and spectral (auto).
    #[arg(long, value_name = "N", conflicts_with = "goniometer",
        value_parser = clap::value_parser!(u32).range(1..=10_000))]
    radial_profile: Option<u32>,
    #[command(flatten)]
    views: views::Args,
}

/// The options shared with all measurements of `simulate`.
pub(super) struct SharedOptions<'a> {
    pub(super) sample: String,
    pub(super) engine: Engine,
    pub(super) request: Request<'a>,
    pub(super) threads: ThreadArgs,
    pub(super) json: bool,
}

impl Args {
    /// Whether exits are to be resolved by direction or by distance.
    pub(super) fn is_requested(&self) -> bool {
        self.goniometer || self.radial_profile.is_some() || self.views.is_requested()
    }
}

/// Measures and prints the exits.
///
/// # Errors
/// If the engine cannot run the request, or the user interrupts it.
pub(super) fn run(args: &Args, job: &SharedOptions, cancel: &AtomicBool) -> anyhow::Result<()> {
    let request = &job.request;
    let walk = |engine, work: &(dyn Fn(&Control) -> Result<Vec<Exits>, EngineError> + Sync)| {
        let walks = exits::walks(engine, request)?;
        match walking::run(job.threads, walks, cancel, work)? {
            Err(EngineError::Cancelled) => Err(Interrupted("nothing was written".into()).into()),
            result => anyhow::Ok(result?),
        }
    };
    let text = if let Some(count) = args.radial_profile {
        let radii = Radii::new(
            count as usize,
            RADII[0] * request.snowpack.surface.mean_free_distance_m(),
            RADII[1] * request.thicknesses_m[0],
        );
        let engine = exits::radial_engine(job.engine);
        let exits = walk(engine, &|control| {
            exits::radial_profile(engine, request, &radii, control)
        })?;
        profile_text(job, engine, &radii, &exits)
    } else if let Some(views) = args.views.views()? {
        let engine = exits::goniometer_engine(job.engine, request);
        let exits = walk(engine, &|control| {
            exits::views(engine, request, &views, control)
        })?;
        views::text(job, engine, &views, &exits)
    } else {
        let sensors = Sensors::new(args.sensors as usize);
        let engine = exits::goniometer_engine(job.engine, request);
        let exits = walk(engine, &|control| {
            exits::goniometer(engine, request, &sensors, control)
        })?;
        sensors_text(args, job, engine, &sensors, &exits)
    };
    common::print(&text)
}

/// The sensors to print, with their polar and azimuth angles in degrees.
fn chosen(args: &Args, sensors: &Sensors) -> Vec<(usize, [f64; 2])> {
    let angles_rad = if args.principal_plane {
        sensors.principal_plane()
    } else {
        let centre = |sensor| (sensor, sensors.centre_rad(sensor));
        (0..sensors.len()).map(centre).collect()
    };
    let degrees = |(sensor, angles): (usize, [f64; 2])| (sensor, angles.map(f64::to_degrees));
    angles_rad.into_iter().map(degrees).collect()
}

/// The comment lines that describe the measurement: option, sample, engine, rays, seed, sums.
pub(super) fn heading(
    job: &SharedOptions,
    option: &str,
    engine: Engine,
    spectrum: &[Exits],
) -> String {
    // A comment must stay on one line, even if the file name contains a line break.
    let sample = job.sample.replace(['\n', '\r'], " ");
    let (version, engine) = (env!("CARGO_PKG_VERSION"), engine.name());
    let Request { rays, seed, .. } = job.request;
    let mut out = format!(
        "# splitsnow {version} measure {option}\n# sample: {sample}\n# engine: {engine}\n# rays: {rays}\n# seed: {seed}\n"
    );
    if spectrum.iter().any(|exits| exits.normalised) {
        out.push_str("# sums: those of hybrid, to which values are scaled\n");
    }
    out.push_str(
        "# sum: wavelength_nm,reflectance,reflectance_se,transmittance,transmittance_se\n",
    );
    for (nm, exits) in job.request.wavelengths_nm.iter().zip(spectrum) {
        let (r, t) = (exits.reflectance, exits.transmittance);
        let _ = writeln!(
            out,
            "# sum: {nm},{:?},{:?},{:?},{:?}",
            r.value, r.se, t.value, t.se
        );
    }
    let lost = spectrum.iter().map(|exits| exits.lost).fold(0.0, f64::max);
    if lost > 0.0 {
        let _ = writeln!(
            out,
            "# lost_share: {lost:?} at most; rays stopped at an event limit"
        );
    }
    out
}

/// The JSON members that both measurements share. `spectrum` holds the exits at each wavelength.
pub(super) fn summary(
    job: &SharedOptions,
    engine: Engine,
    spectrum: &[Exits],
) -> serde_json::Value {
    let list = |part: &dyn Fn(&Exits) -> f64| -> Vec<f64> { spectrum.iter().map(part).collect() };
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "sample": job.sample,
        "engine": engine.name(),
        "rays": job.request.rays,
        "seed": job.request.seed,
        "wavelength_nm": job.request.wavelengths_nm,
        "reflectance": list(&|exits| exits.reflectance.value),
        "reflectance_se": list(&|exits| exits.reflectance.se),
        "transmittance": list(&|exits| exits.transmittance.value),
        "transmittance_se": list(&|exits| exits.transmittance.se),
        "sums_of": spectrum.iter().any(|exits| exits.normalised).then(|| Engine::Hybrid.name()),
        "lost_share": list(&|exits| exits.lost),
    })
}

/// The two sides of `exits` with their names.
fn sides(exits: &Exits) -> [(&'static str, &[Measured]); 2] {
    [
        ("reflected", &exits.reflected),
        ("transmitted", &exits.transmitted),
    ]
}

/// Adds to `value`, for each side, one list per wavelength of the values and standard errors
/// that `convert` computes from the bins.
fn add_columns(
    value: &mut serde_json::Value,
    spectrum: &[Exits],
    suffixes: [&str; 2],
    convert: impl Fn(&[Measured]) -> Vec<Measured>,
) {
    for side in 0..2 {
        let name = sides(&Exits::default())[side].0;
        let part = |part: fn(&Measured) -> f64| -> Vec<Vec<f64>> {
            let rows = spectrum.iter().map(|exits| convert(sides(exits)[side].1));
            rows.map(|row| row.iter().map(part).collect()).collect()
        };
        value[format!("{name}{}", suffixes[0])] = json!(part(|m| m.value));
        value[format!("{name}{}", suffixes[1])] = json!(part(|m| m.se));
    }
}

fn sensors_text(
    args: &Args,
    job: &SharedOptions,
    engine: Engine,
    sensors: &Sensors,
    spectrum: &[Exits],
) -> String {
    let chosen = chosen(args, sensors);
    if job.json {
        let mut value = summary(job, engine, spectrum);
        value["sensors"] = json!(sensors.len());
        let angles =
            |i: usize| -> Vec<f64> { chosen.iter().map(|(_, angles)| angles[i]).collect() };
        value["polar_deg"] = json!(angles(0));
        value["azimuth_deg"] = json!(angles(1));
        let projected = chosen.iter().map(|(s, _)| sensors.projected_sr(*s));
        value["projected_sr"] = json!(projected.collect::<Vec<_>>());
        add_columns(&mut value, spectrum, ["_per_sr", "_se_per_sr"], |bins| {
            chosen.iter().map(|(sensor, _)| bins[*sensor]).collect()
        });
        return format!("{value:#}\n");
    }
    let mut out = heading(job, "--goniometer", engine, spectrum);
    let _ = writeln!(out, "# sensors: {}", sensors.len());
    out.push_str("wavelength_nm,side,polar_deg,azimuth_deg,value_per_sr,se_per_sr\n");
    for (nm, exits) in job.request.wavelengths_nm.iter().zip(spectrum) {
        for (side, bins) in sides(exits) {
            for (sensor, [polar, azimuth]) in &chosen {
                let Measured { value, se } = bins[*sensor];
                let _ = writeln!(out, "{nm},{side},{polar:.4},{azimuth:.4},{value:?},{se:?}");
            }
        }
    }
    out
}

fn profile_text(job: &SharedOptions, engine: Engine, radii: &Radii, spectrum: &[Exits]) -> String {
    let exitance = |bins: &[Measured]| -> Vec<Measured> {
        let per_area = |(bin, share): (usize, &Measured)| {
            let area_m2 = radii.area_m2(bin);
            Measured {
                value: share.value / area_m2,
                se: share.se / area_m2,
            }
        };
        bins.iter().enumerate().map(per_area).collect()
    };
    if job.json {
        let mut value = summary(job, engine, spectrum);
        // the last ring has no outer radius
        let outer: Vec<f64> = (0..radii.len() - 1)
            .map(|bin| radii.bounds_m(bin)[1])
            .collect();
        value["radius_max_m"] = json!(outer);
        add_columns(&mut value, spectrum, ["_per_m2", "_se_per_m2"], exitance);
        add_columns(&mut value, spectrum, ["_share", "_share_se"], <[_]>::to_vec);
        return format!("{value:#}\n");
    }
    let mut out = heading(job, "--radial-profile", engine, spectrum);
    out.push_str(
        "wavelength_nm,side,radius_min_m,radius_max_m,exitance_per_m2,se_per_m2,share,share_se\n",
    );
    for (nm, exits) in job.request.wavelengths_nm.iter().zip(spectrum) {
        for (side, bins) in sides(exits) {
            for (bin, (share, exitance)) in bins.iter().zip(exitance(bins)).enumerate() {
                let [inner, outer] = radii.bounds_m(bin);
                let _ = writeln!(
                    out,
                    "{nm},{side},{inner:?},{outer:?},{:?},{:?},{:?},{:?}",
                    exitance.value, exitance.se, share.value, share.se
                );
            }
        }
    }
    out
}
