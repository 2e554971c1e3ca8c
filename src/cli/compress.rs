//! `splitsnow compress`: compresses a finished database again.
use std::path::{Path, PathBuf};

use super::common::{self, Spinner};
use super::compact::CompactSummary;
use crate::build;
use crate::colour::{ColourDifference, Illuminant, IlluminantError, Viewing};
use crate::compress::{Basis, Choice, CompactVariant, DEFAULT_MAX_DELTA_E, Precision};
use crate::grid::Compression;
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::store::COMPACT;
use crate::verify;

/// Compress a finished database again, with other bounds or in another variant
///
/// Prints the errors for each number of components and rewrites the compact file
/// `snow.safetensors`. The file holds the smallest number of components that keeps the
/// bounds on every curve, or the number given by --components. Transmittance and
/// reflectance are compressed separately.
///
/// The RMSE is bounded in each band of wavelengths: uv_a (to 400 nm), visible (400-780 nm),
/// ir_a (780-1400 nm), ir_b (from 1400 nm). Without --max-rmse, the bound of a band is twice
/// the largest standard error of a curve in the band, but at least 0.002.
///
/// `--basis log` decomposes the logarithm of transmittance and of 1 - reflectance, which
/// needs fewer components for the transmittance of thick snow. `--precision` stores each
/// coefficient in fewer bits; quantised coefficients take 8 bits where the bounds allow it,
/// else 16. Errors and bounds apply to the file as it is written.
///
/// A later `splitsnow build` of the same directory writes the file again with the bounds of
/// the grid file, linear and in f32.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_long_help = "\
Examples:
  splitsnow compress out/quick --max-delta-e 0.5 --max-rmse 0.002
  splitsnow compress out/quick --components 4
  splitsnow compress out/quick --basis log --precision quantised --quantity transmittance
  splitsnow compress out/quick --illuminant D65 --illuminant LED-B5 --delta-e cie2000"
)]
pub(super) struct Args {
    /// Output directory of a build
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Largest Delta-E allowed on any curve, above 0 [default: 2.3]
    #[arg(long, value_name = "X", value_parser = common::positive)]
    max_delta_e: Option<f64>,
    /// Largest RMSE allowed on any curve, above 0, over all its wavelengths and in each band
    /// [default: from the standard error of the simulation in each band, see above]
    #[arg(long, value_name = "Y", value_parser = common::positive)]
    max_rmse: Option<f64>,
    /// Keep this many components, whatever the errors
    #[arg(long, value_name = "K", conflicts_with_all = ["max_delta_e", "max_rmse"],
          value_parser = clap::value_parser!(u16).range(1..))]
    components: Option<u16>,
    /// Illuminant under which colours are compared: D55, D65, E, FL3.15, LED-B5, A, D50, or a
    /// file with a table of relative power; may be given several times, and the largest
    /// Delta-E counts
    #[arg(long, value_name = "NAME|FILE", default_value = "D65")]
    illuminant: Vec<String>,
    /// Formula of the colour difference Delta-E
    #[arg(long, value_name = "FORMULA", default_value = "cie1976",
          value_parser = common::name_parser(ColourDifference::ALL, ColourDifference::name))]
    delta_e: ColourDifference,
    /// Quantity that the components decompose: the spectra or their logarithm
    #[arg(long, default_value = Basis::Linear.name(),
          value_parser = common::name_parser(Basis::ALL, Basis::name))]
    basis: Basis,
    /// Number format of the coefficients
    #[arg(long, default_value = Precision::F32.name(),
          value_parser = common::name_parser(Precision::ALL, Precision::name))]
    precision: Precision,
    /// Quantity to compress; may be given twice [default: both]
    #[arg(long, value_parser = common::name_parser(Quantity::ALL, Quantity::name))]
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
    let illuminants = illuminants(&args.illuminant, &args.dir.join(COMPACT))?;
    let request = build::CompressionRequest {
        choice: args.components.map_or(bounds, components),
        variant: CompactVariant {
            basis: args.basis,
            precision: args.precision,
        },
        quantities: match args.quantity.as_slice() {
            [] => Quantity::ALL.into(),
            given => given.into(),
        },
        viewing: Viewing {
            illuminants,
            difference: args.delta_e,
        },
    };
    let spinner = Spinner::new("compressing");
    let report = build::compress(&args.dir, &request)?;
    drop(spinner);
    if args.json {
        return common::print_json(&report);
    }
    common::print(&CompactSummary(&report).to_string())
}

/// The illuminants with these names or files. If a file no longer exists, its table is
/// taken from the compact file, if that holds a table of the same name.
fn illuminants(names: &[String], compact: &Path) -> anyhow::Result<Vec<Illuminant>> {
    let mut illuminants: Vec<Illuminant> = Vec::new();
    for name in names {
        let illuminant = match Illuminant::find(name, Path::new("")) {
            Ok((illuminant, report)) => {
                if let Some(report) = report {
                    let file = common::one_line(Path::new(name));
                    common::note(&format!("read {file}: {report}"));
                }
                illuminant
            }
            Err(unknown @ IlluminantError::Unknown { .. }) => {
                let stored = stored_table(name, compact).ok_or(unknown)?;
                common::note(&format!(
                    "no file {name}: the table {stored} is taken from {}",
                    compact.display()
                ));
                stored
            }
            Err(error) => return Err(error.into()),
        };
        if !illuminants.contains(&illuminant) {
            illuminants.push(illuminant);
        }
    }
    Ok(illuminants)
}

/// The illuminant table that the compact file holds of the file `path`, by file name.
fn stored_table(path: &str, compact: &Path) -> Option<Illuminant> {
    let name = Path::new(path).file_name()?.to_str()?;
    let viewing = verify::viewing(&Database::open(compact).ok()?).ok()?;
    let mut illuminants = viewing.illuminants.into_iter();
    illuminants.find(|light| matches!(light, Illuminant::Table(table) if table.name() == name))
}
