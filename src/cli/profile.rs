//! `simulate --depths-cm`: light inside the snow against depth, in cm, per incident flux.
use std::fmt::Write;
use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::bands::SensorBands;
use super::common::{Interrupted, one_line};
use super::goniometer::SharedOptions;
use super::walking;
use crate::engine::profile::{self, LightAtDepth, Profile};
use crate::engine::{Engine, EngineError};
use crate::measurement::Measured;
use crate::sensor::BandAverages;

/// Most depths of a profile.
const MOST_DEPTHS: usize = 1000;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Print the light inside the snow at these depths below the surface instead
    ///
    /// Give a list, 0,1,2,5, or ranges, START:END:STEP, or both. END is included if it is a whole
    /// number of steps from START. The surface and the base are always added. Prints CSV: wavelength_nm, depth_cm; downwelling and upwelling, the fluxes that
    /// cross the depth downward and upward; actinic, the radiance integrated over all directions
    /// (spherical irradiance); and absorbed_per_m, the power absorbed per volume between this depth
    /// and the next (W/m3 per W/m2), empty at the base. All are per incident flux and have standard
    /// errors. With --bands, averages over the bands; --bands par gives photosynthetically active
    /// radiation. Engines: hybrid (auto), spectral and reference.
    #[arg(long, value_name = "CM,...", value_delimiter = ',', value_parser = depths_cm,
        conflicts_with_all = ["goniometer", "radial_profile", "view_deg", "against"])]
    depths_cm: Vec<DepthsCm>,
}

/// One depth or a range of depths, cm.
#[derive(Debug, Clone)]
struct DepthsCm {
    values: Vec<f64>,
    /// What is said of a range that ends before its END.
    short: Option<String>,
}

/// Reads `DEPTH` or `START:END:STEP`.
fn depths_cm(text: &str) -> Result<DepthsCm, String> {
    let number = |text: &str| {
        let value = text.trim().parse::<f64>();
        let depth = value.ok().filter(|cm| cm.is_finite() && *cm >= 0.0);
        depth.ok_or_else(|| format!("`{text}` is not a depth; give 0 or more, in cm"))
    };
    let parts: Vec<f64> = text.split(':').map(number).collect::<Result<_, _>>()?;
    match parts[..] {
        [depth] => Ok(DepthsCm {
            values: vec![depth],
            short: None,
        }),
        [start, end, step] if step > 0.0 && end >= start => {
            // rounding must not drop the end
            let steps = ((end - start) / step + 1e-9).floor();
            if steps >= MOST_DEPTHS as f64 {
                return Err(format!(
                    "a range of {} depths; at most {MOST_DEPTHS} are possible",
                    steps + 1.0
                ));
            }
            let depth = |i: usize| (start + i as f64 * step).min(end);
            let last = depth(steps as usize);
            let is_short = end - last > 1e-9 * step;
            Ok(DepthsCm {
                values: (0..=steps as usize).map(depth).collect(),
                short: is_short.then(|| {
                    format!("{text}: {end} is not a whole number of steps from {start}; the last depth is {} cm", centimetres(last / 100.0))
                }),
            })
        }
        _ => Err(
            "give a depth, or START:END:STEP with END not less than START and STEP above 0".into(),
        ),
    }
}

impl Args {
    /// Whether a profile is requested.
    pub(super) fn is_requested(&self) -> bool {
        !self.depths_cm.is_empty()
    }
}

/// Simulates the profile, and averages it over `bands` if there are any.
///
/// # Errors
/// If the engine cannot run the request, or the user interrupts it.
pub(super) fn text(
    args: &Args,
    job: &SharedOptions,
    bands: Option<&(BandAverages, SensorBands)>,
    cancel: &AtomicBool,
) -> anyhow::Result<String> {
    for depths in &args.depths_cm {
        let short: Vec<String> = depths
            .short
            .iter()
            .map(|s| format!("--depths-cm {s}"))
            .collect();
        super::common::warn(&short);
    }
    let depths = args.depths_cm.iter().flat_map(|depths| &depths.values);
    let depths_m: Vec<f64> = depths.map(|cm| cm / 100.0).collect();
    if depths_m.len() > MOST_DEPTHS {
        anyhow::bail!(
            "--depths-cm gives {} depths; at most {MOST_DEPTHS} are possible",
            depths_m.len()
        );
    }
    let engine = profile::engine(job.engine, &job.request);
    let walks = profile::walks(engine, &job.request, &depths_m)?;
    let result = walking::run(job.threads, Some(walks), cancel, |control| {
        profile::run(engine, &job.request, &depths_m, control)
    })?;
    let profile = match result {
        Err(EngineError::Cancelled) => return Err(Interrupted("nothing was written".into()).into()),
        result => result?,
    };
    let averaged = bands.map(|(averages, bands)| (profile.averaged(averages.weights()), bands));
    Ok(match (&averaged, job.json) {
        (None, false) => {
            let cells = job.request.wavelengths_nm.iter().map(f64::to_string);
            heading(job, engine, &profile) + &rows("wavelength_nm", cells, &profile)
        }
        (None, true) => {
            let mut value = summary(job, engine, &profile);
            value["wavelength_nm"] = json!(job.request.wavelengths_nm);
            format!("{value:#}\n")
        }
        (Some((profile, bands)), false) => {
            let comments = bands.comments(job.request.wavelengths_nm);
            let (columns, cells) = bands.cells();
            heading(job, engine, profile) + &comments + &rows(columns, cells, profile)
        }
        (Some((profile, bands)), true) => {
            let mut value = summary(job, engine, profile);
            value["bands"] = bands.json();
            format!("{value:#}\n")
        }
    })
}

/// The comment lines that describe the profile: option, sample, engine, rays, seed.
fn heading(job: &SharedOptions, engine: Engine, profile: &Profile) -> String {
    let sample = one_line(job.sample.as_ref());
    let (version, engine) = (env!("CARGO_PKG_VERSION"), engine.name());
    let (rays, seed) = (job.request.rays, job.request.seed);
    let mut out = format!(
        "# splitsnow {version} measure --depths-cm\n# sample: {sample}\n# engine: {engine}\n# rays: {rays}\n# seed: {seed}\n"
    );
    if profile.lost > 0.0 {
        let _ = writeln!(
            out,
            "# lost_share: {:?} at most; rays stopped at an event limit",
            profile.lost
        );
    }
    out
}

/// A row per wavelength or band, described by `cells` under `columns`, and depth.
fn rows(columns: &str, cells: impl Iterator<Item = String>, profile: &Profile) -> String {
    let mut out = format!(
        "{columns},depth_cm,downwelling,downwelling_se,upwelling,upwelling_se,actinic,actinic_se,absorbed_per_m,absorbed_per_m_se\n"
    );
    for (wavelength, cells) in cells.enumerate() {
        for (depth, depth_m) in profile.depths_m().iter().enumerate() {
            let LightAtDepth {
                downwelling,
                upwelling,
                actinic,
                absorbed_per_m,
            } = profile.at(wavelength, depth);
            let _ = write!(out, "{cells},{}", centimetres(*depth_m));
            for Measured { value, se } in [downwelling, upwelling, actinic] {
                let _ = write!(out, ",{value:?},{se:?}");
            }
            let _ = match absorbed_per_m {
                Some(Measured { value, se }) => writeln!(out, ",{value:?},{se:?}"),
                None => writeln!(out, ",,"),
            };
        }
    }
    out
}

/// A depth in cm without the rounding of its value in m.
fn centimetres(depth_m: f64) -> f64 {
    (depth_m * 1e11).round() / 1e9
}

/// The JSON of a profile: per wavelength or band, a list over depths.
fn summary(job: &SharedOptions, engine: Engine, profile: &Profile) -> Value {
    let depths_m = profile.depths_m();
    let lists = |depths: usize, part: &dyn Fn(&LightAtDepth) -> f64| -> Vec<Vec<f64>> {
        let row = |wavelength| {
            let depths = 0..depths;
            depths
                .map(|depth| part(&profile.at(wavelength, depth)))
                .collect()
        };
        (0..profile.wavelengths()).map(row).collect()
    };
    let mut value = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "sample": job.sample,
        "engine": engine.name(),
        "rays": job.request.rays,
        "seed": job.request.seed,
        "lost_share": profile.lost,
        "depth_cm": depths_m.iter().copied().map(centimetres).collect::<Vec<f64>>(),
    });
    let mut add = |name: &str, depths: usize, column: &dyn Fn(&LightAtDepth) -> Measured| {
        value[name] = json!(lists(depths, &|light| column(light).value));
        value[format!("{name}_se")] = json!(lists(depths, &|light| column(light).se));
    };
    add("downwelling", depths_m.len(), &|light| light.downwelling);
    add("upwelling", depths_m.len(), &|light| light.upwelling);
    add("actinic", depths_m.len(), &|light| light.actinic);
    // between the depths
    add("absorbed_per_m", depths_m.len() - 1, &|light| {
        light.absorbed_per_m.unwrap_or_default()
    });
    value
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_numbers_or_ranges() {
        let read = |text| depths_cm(text).map(|depths| depths.values);
        assert_eq!(read("2.5").unwrap(), [2.5]);
        assert_eq!(read("0:1:0.25").unwrap(), [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(read("0:0.3:0.1").unwrap().len(), 4);
        assert_eq!(read("1:2:3").unwrap(), [1.0]);
        assert_eq!(read("0:10:3").unwrap(), [0.0, 3.0, 6.0, 9.0]);
        let short = |text| depths_cm(text).unwrap().short;
        assert_eq!(
            short("0:10:3").as_deref(),
            Some("0:10:3: 10 is not a whole number of steps from 0; the last depth is 9 cm")
        );
        for whole in ["0:9:3", "0:0.3:0.1", "2.5", "0:30:0.7"] {
            let found = short(whole);
            assert_eq!(found.is_some(), whole == "0:30:0.7", "{whole}: {found:?}");
        }
        for bad in [
            "", "x", "-1", "nan", "1:2", "2:1:1", "0:1:0", "0:1:1e-9", "1:2:3:4",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
