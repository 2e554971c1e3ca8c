//! `simulate --view-deg`: reflectance factors and anisotropy factors toward given views.
use std::fmt::Write;

use serde_json::json;

use super::goniometer::{self, SharedOptions};
use crate::engine::Engine;
use crate::engine::exits::Exits;
use crate::measurement::{Measured, Views};
use crate::transport::Illumination;

#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Measure reflectance factors toward views at these angles from the normal, degrees
    ///
    /// Prints CSV: wavelength_nm, view_deg, relative_azimuth_deg; brf, the bidirectional
    /// reflectance factor (hdrf, the hemispherical-directional one, under diffuse light);
    /// anisotropy_factor, which is brf over reflectance; and btf (hdtf), the same as brf for
    /// transmitted light, with the view angle from the normal below the snow. Each has its
    /// standard error. Every view angle is combined with every relative azimuth. Each value is
    /// that of a quadratic fit to the light within 13 degrees of the view. Comment lines and
    /// engines are those of --goniometer.
    #[arg(long, value_name = "DEG,...", value_delimiter = ',', allow_negative_numbers = true,
        conflicts_with_all = ["goniometer", "radial_profile", "against"])]
    view_deg: Vec<f64>,
    /// Azimuths of the views, degrees: 0 is forward, 180 back toward the light [default: 0]
    #[arg(
        long,
        value_name = "DEG,...",
        value_delimiter = ',',
        allow_negative_numbers = true,
        requires = "view_deg"
    )]
    relative_azimuth_deg: Vec<f64>,
}

impl Args {
    pub(super) fn is_requested(&self) -> bool {
        !self.view_deg.is_empty()
    }

    /// The views that are requested, if any.
    ///
    /// # Errors
    /// If an angle is out of range.
    pub(super) fn views(&self) -> anyhow::Result<Option<Views>> {
        if !self.is_requested() {
            return Ok(None);
        }
        let azimuths: &[f64] = match self.relative_azimuth_deg.as_slice() {
            [] => &[0.0],
            azimuths => azimuths,
        };
        let at = |polar: &f64| azimuths.iter().map(|azimuth| [*polar, *azimuth]).collect();
        let angles: Vec<Vec<[f64; 2]>> = self.view_deg.iter().map(at).collect();
        Ok(Some(Views::new(&angles.concat())?))
    }
}

/// Factors toward all views.
type Factors = fn(&Exits) -> Vec<Measured>;

/// Names of the factors of reflected and transmitted light.
fn names(job: &SharedOptions) -> [&'static str; 2] {
    match job.request.illuminations[0] {
        Illumination::Collimated { .. } => ["brf", "btf"],
        Illumination::Diffuse => ["hdrf", "hdtf"],
    }
}

/// The printed result, CSV or JSON.
pub(super) fn text(
    job: &SharedOptions,
    engine: Engine,
    views: &Views,
    spectrum: &[Exits],
) -> String {
    let [reflected, transmitted] = names(job);
    let columns = [
        (reflected, Exits::reflectance_factors as Factors),
        ("anisotropy_factor", Exits::anisotropy_factors),
        (transmitted, Exits::transmittance_factors),
    ];
    if job.json {
        let mut value = goniometer::summary(job, engine, spectrum);
        let angles = |i: usize| -> Vec<f64> { views.angles_deg().iter().map(|a| a[i]).collect() };
        value["view_deg"] = json!(angles(0));
        value["relative_azimuth_deg"] = json!(angles(1));
        for (name, factors) in columns {
            let lists = |part: fn(&Measured) -> f64| -> Vec<Vec<f64>> {
                let factors = spectrum.iter().map(factors);
                factors.map(|row| row.iter().map(part).collect()).collect()
            };
            value[name] = json!(lists(|measured| measured.value));
            value[format!("{name}_se")] = json!(lists(|measured| measured.se));
        }
        return format!("{value:#}\n");
    }
    let mut out = goniometer::heading(job, "--view-deg", engine, spectrum);
    let names = columns
        .map(|(name, _)| format!("{name},{name}_se"))
        .join(",");
    let _ = writeln!(out, "wavelength_nm,view_deg,relative_azimuth_deg,{names}");
    for (nm, exits) in job.request.wavelengths_nm.iter().zip(spectrum) {
        let factors = columns.map(|(_, factors)| factors(exits));
        for (view, [polar, azimuth]) in views.angles_deg().iter().enumerate() {
            let _ = write!(out, "{nm},{polar},{azimuth}");
            for column in &factors {
                let Measured { value, se } = column[view];
                let _ = write!(out, ",{value:?},{se:?}");
            }
            out.push('\n');
        }
    }
    out
}
