//! `splitsnow query`: one spectrum from a compact file.
use std::fmt::Write;
use std::path::PathBuf;

use super::common;
use crate::certificate::{CERTIFICATE, Certificate};
use crate::fit::BETWEEN_WAVELENGTHS;
use crate::grid::ExtraAxis;
use crate::lookup::{Database, Lookup, Point, Varsa2025};
use crate::measurement::Quantity;

/// Print one spectrum of a compact file as CSV
///
/// The columns are `wavelength_nm,value`. Any point in the box of the five axes
/// is answered, and any thickness from 0 on. `--method varsa2025` interpolates in
/// thickness and angle only, as the thesis does, and refuses other snow than that
/// of the nodes.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_long_help = "\
Examples:
  splitsnow query out/quick --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --angle-deg 40
  splitsnow query out/quick/snow.safetensors --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --angle-deg 40 --quantity reflectance"
)]
pub(super) struct Args {
    /// A compact file, or the output directory that holds one
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Mean facetness of the grains
    #[arg(long, value_name = "F")]
    facetness: f64,
    /// Mean length of the grains' major axis, um
    #[arg(long, value_name = "G")]
    grain_size_um: f64,
    /// Density of the dry snow, kg/m3
    #[arg(long, value_name = "D")]
    density_kg_m3: f64,
    /// Thickness of the slab, cm
    #[arg(long, value_name = "H")]
    thickness_cm: f64,
    /// Polar angle of incidence from the surface normal, degrees
    #[arg(long, value_name = "A")]
    angle_deg: f64,
    /// Black carbon, ng per g of snow; this and the four below where the file has
    /// such an axis, and only there
    #[arg(long, value_name = "C")]
    black_carbon_ng_g: Option<f64>,
    /// Water saturation of the pore space
    #[arg(long, value_name = "S")]
    water_saturation: Option<f64>,
    /// Temperature, Celsius
    #[arg(long, value_name = "T")]
    temperature_c: Option<f64>,
    /// Mean sphericity of the grains
    #[arg(long, value_name = "S")]
    sphericity: Option<f64>,
    /// Lambertian reflectance of the substrate
    #[arg(long, value_name = "R")]
    substrate_reflectance: Option<f64>,
    /// Which spectrum
    #[arg(long, default_value = Quantity::Transmittance.name(),
          value_parser = common::named(Quantity::ALL, Quantity::name))]
    quantity: Quantity,
    /// How to interpolate
    #[arg(long, value_enum, default_value = "smooth")]
    method: Method,
    /// Say before the columns, in lines that begin with #, what the file is and how
    /// far its answers may be off
    #[arg(long)]
    explain: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Method {
    /// All five axes, in coordinates in which snow is smooth
    Smooth,
    /// Natural spline in thickness, straight line in the angle
    Varsa2025,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let database = Database::open(&common::compact_path(&args.file)?)?;
    let point = Point {
        facetness: args.facetness,
        grain_size_um: args.grain_size_um,
        density_kg_m3: args.density_kg_m3,
        thickness_cm: args.thickness_cm,
        angle_deg: args.angle_deg,
    };
    let conditions = [
        args.black_carbon_ng_g,
        args.water_saturation,
        args.temperature_c,
        args.sphericity,
        args.substrate_reflectance,
    ];
    let conditions = ExtraAxis::ALL.into_iter().zip(conditions);
    let conditions = conditions.filter_map(|(axis, value)| Some((axis, value?)));
    let there = database.at(&conditions.collect())?;
    let spectrum = match args.method {
        Method::Smooth => {
            let lookup = Lookup::new(&there, args.quantity)?;
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

/// What the file is, and its certificate.
fn explanation(database: &Database, quantity: Quantity) -> String {
    let mut text = format!(
        "{} nodes, components: {} of {} spectra, coefficients: {}",
        database.curves(),
        database.components(quantity),
        database.basis_kind().name(),
        database.precision().name()
    );
    if let Some(between) = database.metadata().get(BETWEEN_WAVELENGTHS) {
        let n = database.wavelengths_nm().len();
        let _ = write!(text, "\n{n} wavelengths, between them {between}");
    }
    let certificate = database.metadata().get(CERTIFICATE);
    let certificate = certificate.and_then(|text| serde_json::from_str::<Certificate>(text).ok());
    let _ = match certificate {
        Some(certificate) => write!(text, "\n{certificate}"),
        None => write!(
            text,
            "\nno certificate: `splitsnow verify` measures how far its answers are off"
        ),
    };
    text
}
