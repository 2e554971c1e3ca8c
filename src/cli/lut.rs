//! The options of `splitsnow export --format lut`.
use std::path::Path;

use anyhow::ensure;

use super::common::{self, positive};
use super::export::Exported;
use crate::colour::Illuminant;
use crate::export::{Lut, LutError, LutOptions, Primaries};
use crate::lookup::Database;
use crate::parameter::Point;

/// Largest number of texels along an axis.
const MOST_TEXELS: i64 = 4096;

/// The size and the colours of a look-up table.
#[derive(Debug, clap::Args)]
pub(super) struct LutArgs {
    /// Light, which is white: D55, D65, E, FL3.15, LED-B5, A, D50, or the path of a table of
    /// relative power [default: D65]
    #[arg(long, value_name = "NAME|PATH")]
    light: Option<String>,
    /// Primaries of the linear colours [default: acescg]
    #[arg(long, value_parser = common::name_parser(Primaries::ALL, Primaries::name))]
    primaries: Option<Primaries>,
    /// Width of the image, texels along the thickness [default: 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=MOST_TEXELS))]
    thicknesses: Option<u16>,
    /// Height of the image, texels along the cosine [default: 32]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=MOST_TEXELS))]
    cosines: Option<u16>,
    /// Largest thickness, cm [default: where a millionth of the light is left, 500 at most]
    #[arg(long, value_name = "H", value_parser = positive)]
    last_cm: Option<f64>,
    /// Largest error allowed up to 80 degrees, Delta-E*ab [default: 0.05; with xyz 0.1,
    /// half floats of which are not closer]
    #[arg(long, value_name = "E", value_parser = positive)]
    max_delta_e: Option<f64>,
}

impl LutArgs {
    /// Whether no option is given.
    pub(super) fn is_empty(&self) -> bool {
        self.light.is_none()
            && self.primaries.is_none()
            && self.thicknesses.is_none()
            && self.cosines.is_none()
            && self.last_cm.is_none()
            && self.max_delta_e.is_none()
    }

    /// The files of the table of `snow`, and its errors as remarks. `out` is the path
    /// without the endings.
    pub(super) fn files(
        &self,
        database: &Database,
        snow: Point,
        out: &Path,
    ) -> anyhow::Result<Exported> {
        let mut options = LutOptions::default();
        if let Some(light) = &self.light {
            let (light, report) = Illuminant::find(light, Path::new(""))?;
            if let Some(report) = report {
                common::note(&report.to_string());
            }
            options.light = light;
        }
        options.primaries = self.primaries.unwrap_or(options.primaries);
        options.thicknesses = self.thicknesses.map_or(options.thicknesses, usize::from);
        options.cosines = self.cosines.map_or(options.cosines, usize::from);
        options.last_cm = self.last_cm;
        let lut = Lut::new(database, snow, options)?;
        let largest = lut.certificate().largest;
        let allowed = self.max_delta_e.unwrap_or(match lut.primaries() {
            // half floats of X, Y and Z are not closer
            Primaries::Xyz => 0.1,
            _ => 0.05,
        });
        ensure!(
            largest.delta_e <= allowed,
            "the table would miss the file by a Delta-E of {}, and {allowed} is allowed; give more --thicknesses or --cosines, a smaller --last-cm, or a larger --max-delta-e",
            at(&largest)
        );
        let name = out.file_name().unwrap_or_default().to_string_lossy();
        let files = lut.files(&name)?.into_iter();
        Ok(Exported {
            files: files
                .map(|(name, bytes)| (out.with_file_name(name), bytes))
                .collect(),
            remarks: described(&lut),
        })
    }
}

/// An error and its place.
fn at(error: &LutError) -> String {
    let LutError {
        delta_e,
        thickness_cm,
        angle_deg,
    } = error;
    format!("{delta_e:.3} at {thickness_cm:.3} cm and {angle_deg:.1} degrees")
}

/// The errors of a table, and what its primaries cannot show.
fn described(lut: &Lut) -> String {
    let certificate = lut.certificate();
    let mut text = format!(
        "Delta-E against the file, up to 80 degrees: at most {}, mean {:.4}; exposed to half of white, by a factor of 1000 at most: {}\n",
        at(&certificate.largest),
        certificate.mean_delta_e,
        at(&certificate.exposed)
    );
    let clipping = lut.clipping();
    let name = lut.primaries().name();
    match clipping.from_cm {
        None => text += &format!("no texel is negative in {name}\n"),
        Some(cm) => {
            text += &format!(
                "{} of {} texels, from {cm:.3} cm on, are negative in {name} and were set to 0: Delta-E at most {}",
                clipping.texels,
                certificate.texels,
                at(&clipping.largest),
            );
            if let Some(exposed) = &clipping.exposed {
                text += &format!("; exposed: {}", at(exposed));
            }
            text += "\n";
        }
    }
    text
}
