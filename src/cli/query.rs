//! `splitsnow query`: one spectrum from a compact file.
use std::fmt::Write;
use std::path::PathBuf;

use super::common;
use crate::lookup::{Database, Point};
use crate::measurement::Quantity;

/// Print one spectrum of a compact file as CSV
///
/// The columns are `wavelength_nm,value`. This version answers on the nodes of
/// the five axes only; a point between them is refused with its neighbours.
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
    /// Which spectrum
    #[arg(long, default_value = Quantity::Transmittance.name(),
          value_parser = common::named(Quantity::ALL, Quantity::name))]
    quantity: Quantity,
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
    let spectrum = database.spectrum(point, args.quantity)?;
    let mut csv = String::from("wavelength_nm,value\n");
    for (nm, value) in database.wavelengths_nm().iter().zip(&spectrum) {
        writeln!(csv, "{nm},{value}")?;
    }
    common::print(&csv)
}
