//! `splitsnow compress`: the compact file anew.
use std::path::{Path, PathBuf};

use super::common::{self, Spinner};
use super::compact::Words;
use crate::build;
use crate::colour::{ColourDifference, Illuminant, IlluminantError, Viewing};
use crate::compress::{Basis, Choice, DEFAULT_MAX_DELTA_E, Precision, Variant};
use crate::grid::Compression;
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::store::COMPACT;
use crate::verify;

/// Compress a finished database again, with other bounds or in another variant
///
/// Prints the errors for each number of components and rewrites the compact file
/// `snow.safetensors` with the smallest number that keeps the bounds on every
/// curve, or with the number given. Transmittance and reflectance are compressed
/// apart.
///
/// The RMSE is bounded in each band of wavelengths: uv_a (to 400 nm), visible (400-780),
/// ir_a (780-1400), ir_b (from 1400). Unless --max-rmse is given, its bound is twice the
/// largest standard error of a curve in the band, but at least 0.002.
///
/// With `--basis log` the components are of the logarithm of transmittance and
/// of 1 - reflectance; transmittance of thick snow then needs fewer. With
/// `--precision` each is smaller. Errors and bounds are of the file as it is written. Quantised
/// coefficients take 8 bits where the bounds allow it, else 16.
///
/// A later `splitsnow build` of the same directory writes the file with the
/// bounds of the grid file again, linear and f32.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_long_help = "\
Examples:
  splitsnow compress out/quick
  splitsnow compress out/quick --max-delta-e 0.5 --max-rmse 0.002
  splitsnow compress out/quick --components 4
  splitsnow compress out/quick --basis log --precision quantised --quantity transmittance
  splitsnow compress out/quick --illuminant D65 --illuminant LED-B5 --delta-e cie2000"
)]
pub(super) struct Args {
    /// Output directory of a build
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Largest Delta-E allowed on any curve [default: 2.3]
    #[arg(long, value_name = "X", value_parser = common::positive)]
    max_delta_e: Option<f64>,
    /// Largest RMSE allowed on any curve, over all its wavelengths and in each band
    /// [default: by the simulation's own error in each band, see above]
    #[arg(long, value_name = "Y", value_parser = common::positive)]
    max_rmse: Option<f64>,
    /// Keep this many components, whatever the errors
    #[arg(long, value_name = "K", conflicts_with_all = ["max_delta_e", "max_rmse"],
          value_parser = clap::value_parser!(u16).range(1..))]
    components: Option<u16>,
    /// Light the colours are compared under: D55, D65, E, FL3.15, LED-B5, A, D50, or a file
    /// with a table of its relative power; given several times, the worst case counts
    #[arg(long, value_name = "NAME|FILE", default_value = "D65")]
    illuminant: Vec<String>,
    /// Formula of the colour difference Delta-E
    #[arg(long, value_name = "FORMULA", default_value = "cie1976",
          value_parser = common::named(ColourDifference::ALL, ColourDifference::name))]
    delta_e: ColourDifference,
    /// What the components are of
    #[arg(long, default_value = Basis::Linear.name(),
          value_parser = common::named(Basis::ALL, Basis::name))]
    basis: Basis,
    /// Numbers of the coefficients
    #[arg(long, default_value = Precision::F32.name(),
          value_parser = common::named(Precision::ALL, Precision::name))]
    precision: Precision,
    /// What the file holds; may be given twice [default: both]
    #[arg(long, value_parser = common::named(Quantity::ALL, Quantity::name))]
    quantity: Vec<Quantity>,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let bounds = Choice::Bounds(Compression {
        max_delta_e: args.max_delta_e.unwrap_or(DEFAULT_MAX_DELTA_E),
        max_rmse: args.max_rmse,
    });
    let components = |k| Choice::Components(usize::from(k));
    let lights = illuminants(&args.illuminant, &args.dir.join(COMPACT))?;
    let asked = build::CompressionRequest {
        choice: args.components.map_or(bounds, components),
        variant: Variant {
            basis: args.basis,
            precision: args.precision,
        },
        quantities: match args.quantity.as_slice() {
            [] => Quantity::ALL.into(),
            some => some.into(),
        },
        viewing: Viewing {
            illuminants: lights,
            difference: args.delta_e,
        },
    };
    let spinner = Spinner::new("compressing");
    let report = build::compress(&args.dir, &asked)?;
    drop(spinner);
    if args.json {
        return common::print_json(&report);
    }
    common::print(&Words(&report).to_string())
}

/// The lights asked for. A table whose file is gone is taken from the compact file that
/// there is, if that has one of the name.
fn illuminants(asked: &[String], compact: &Path) -> anyhow::Result<Vec<Illuminant>> {
    let mut lights: Vec<Illuminant> = Vec::new();
    for asked in asked {
        let light = match Illuminant::find(asked, Path::new("")) {
            Ok((light, report)) => {
                if let Some(report) = report {
                    let file = common::one_line(Path::new(asked));
                    common::note(&format!("read {file}: {report}"));
                }
                light
            }
            Err(unknown @ IlluminantError::Unknown { .. }) => {
                let kept = kept(asked, compact).ok_or(unknown)?;
                common::note(&format!(
                    "no file {asked}: {kept} is taken from {}",
                    compact.display()
                ));
                kept
            }
            Err(error) => return Err(error.into()),
        };
        if !lights.contains(&light) {
            lights.push(light);
        }
    }
    Ok(lights)
}

/// The table that the compact file keeps of the file `asked`.
fn kept(asked: &str, compact: &Path) -> Option<Illuminant> {
    let name = Path::new(asked).file_name()?.to_str()?;
    let viewing = verify::viewing(&Database::open(compact).ok()?).ok()?;
    let mut tables = viewing.illuminants.into_iter();
    tables.find(|light| matches!(light, Illuminant::Table(table) if table.name() == name))
}
