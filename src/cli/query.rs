//! `splitsnow query`: prints one spectrum of a compact file.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use super::common;
use super::point::{self, PointArgs};
use crate::compress::{BAND_ERRORS, BandError};
use crate::error_budget::ErrorBudget;
use crate::lookup::{Database, Lookup, Varsa2025};
use crate::measurement::Quantity;
use crate::tailor::BETWEEN_WAVELENGTHS;

/// Print one spectrum of a compact file as CSV
///
/// The columns are `wavelength_nm,value`. Any point inside the box of the axes is allowed, at
/// any thickness from 0 to inf (a half space). `--method varsa2025` interpolates in thickness
/// and incidence angle only, as Varsa's thesis does; it refuses snow that is not at a node.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    mut_args = point::required,
    after_long_help = "\
Examples:
  splitsnow query out/quick --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --incidence-angle-deg 40
  splitsnow query out/quick/snow.safetensors --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --incidence-angle-deg 40 \\
      --quantity reflectance --explain"
)]
pub(super) struct Args {
    /// Compact file, or the output directory that holds it
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    point: PointArgs,
    /// Quantity to print
    #[arg(long, default_value = Quantity::Transmittance.name(),
          value_parser = common::name_parser(Quantity::ALL, Quantity::name))]
    quantity: Quantity,
    /// Print the spectrum under isotropic light; FILE must be an output directory whose grid
    /// has axes.diffuse = true
    #[arg(long, conflicts_with = "incidence_angle_deg")]
    diffuse: bool,
    /// Interpolation method
    #[arg(long, value_enum, default_value = "smooth")]
    method: Method,
    /// Print comment lines (starting with #) before the columns: the contents of the file and
    /// how large the errors of its values may be
    #[arg(long)]
    explain: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Method {
    /// All axes, in coordinates in which spectra vary smoothly
    Smooth,
    /// Natural cubic spline in thickness, linear in incidence angle
    Varsa2025,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let database = if args.diffuse {
        Database::open(common::diffuse_path(&args.file)?)?
    } else {
        Database::open(&args.file)?
    };
    let point = args.point.point(args.diffuse)?;
    let database_at = database.at(point.optional())?;
    let spectrum = match args.method {
        Method::Smooth => {
            let lookup = Lookup::new(&database_at, args.quantity)?;
            let mut spectrum = vec![0.0; lookup.wavelengths()];
            lookup.spectrum(point, &mut spectrum)?;
            spectrum
        }
        Method::Varsa2025 => Varsa2025::new(&database, args.quantity)?.spectrum(point)?,
    };
    let mut csv = String::new();
    if args.explain {
        for line in explanation(&database, args.quantity).lines() {
            writeln!(csv, "# {line}")?;
        }
    }
    csv.push_str("wavelength_nm,value\n");
    for (nm, value) in database.wavelengths_nm().iter().zip(&spectrum) {
        writeln!(csv, "{nm},{value}")?;
    }
    common::print(&csv)
}

/// The contents of the file and its error budget.
fn explanation(database: &Database, quantity: Quantity) -> String {
    let mut text = format!(
        "{} nodes, components: {} of {} spectra, coefficients: {}",
        database.curves(),
        database.components(quantity),
        database.basis_kind().name(),
        database.precision().name()
    );
    if let Some(between) = database.metadata().get(BETWEEN_WAVELENGTHS) {
        let count = database.wavelengths_nm().len();
        let _ = write!(text, "\n{count} wavelengths, between them {between}");
    }
    let bands = database.metadata().get(BAND_ERRORS);
    let bands = bands.and_then(|text| serde_json::from_str(text).ok());
    let bands: BTreeMap<String, Vec<BandError>> = bands.unwrap_or_default();
    for band in bands.get(quantity.name()).into_iter().flatten() {
        let _ = write!(text, "\n{}", compression(band));
    }
    let _ = match ErrorBudget::of(database.metadata()) {
        Some(error_budget) => write!(text, "\n{error_budget}"),
        None => write!(
            text,
            "\nno error budget: run `splitsnow verify` to measure the errors of look-ups"
        ),
    };
    text
}

/// The compression errors in a band.
fn compression(band: &BandError) -> String {
    let BandError { rmse, largest, .. } = band;
    let mut text = format!(
        "compression in {} ({}-{} nm): RMSE at most {:.5}",
        band.band.name(),
        band.from_nm,
        band.to_nm,
        rmse.max
    );
    if let Some(bound) = band.max_rmse {
        let _ = write!(text, " (below {bound})");
    }
    if let Some(noise) = band.standard_error {
        let _ = write!(text, ", standard error at most {noise:.5}");
    }
    let _ = write!(
        text,
        ", largest error {:.5} at {} nm",
        largest.error, largest.wavelength_nm
    );
    text
}
