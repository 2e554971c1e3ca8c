//! `splitsnow query`: prints one spectrum of a compact file.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{bail, ensure};

use super::bands;
use super::common;
use super::point::{self, PointArgs};
use crate::compress::{BAND_ERRORS, BandError};
use crate::error_budget::ErrorBudget;
use crate::lookup::{Database, DirectionalQuantity, Directions, Lookup, Varsa2025};
use crate::measurement::Quantity;
use crate::parameter::Parameter;
use crate::store::{VIEWS, VIEWS_DIFFUSE};
use crate::tailor::BETWEEN_WAVELENGTHS;

/// Print one spectrum of a compact file as CSV
///
/// The columns are `wavelength_nm,value`. Any point inside the box of the axes is allowed, at
/// any thickness from 0 to inf (a half space). `--method varsa2025` interpolates in thickness
/// and incidence angle only, as Varsa's thesis does; it refuses snow that is not at a node.
///
/// If the grid has views, `--quantity` may be a factor toward a view: brf and btf, the
/// bidirectional reflectance and transmittance factors; with --diffuse hdrf and hdtf, the
/// hemispherical-directional ones; or anisotropy_factor, the reflectance factor over the
/// reflectance. They need --view-deg and --relative-azimuth-deg.
///
/// With --bands, prints averages over the bands of a sensor: `band,centre_nm,from_nm,to_nm,value`.
/// The file must have wavelengths at most 30 nm apart in each band.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    mut_args = point::required,
    after_long_help = "\
Examples:
  splitsnow query out/quick --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --incidence-angle-deg 40
  splitsnow query out/brdf --facetness 0 --grain-size-um 300 \\
      --density-kg-m3 300 --thickness-cm inf --incidence-angle-deg 60 \\
      --view-deg 45 --relative-azimuth-deg 0 --quantity brf
  splitsnow query out/quick --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --incidence-angle-deg 40 \\
      --quantity reflectance --bands sentinel2a:B2,B3,B4
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
          value_parser = common::name_parser(QueryQuantity::ALL, QueryQuantity::name))]
    quantity: QueryQuantity,
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
    #[command(flatten)]
    bands: bands::Args,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Method {
    /// All axes, in coordinates in which spectra vary smoothly
    Smooth,
    /// Natural cubic spline in thickness, linear in incidence angle
    Varsa2025,
}

/// A quantity that a query prints.
#[derive(Debug, Clone, Copy)]
enum QueryQuantity {
    Hemispherical(Quantity),
    /// Toward a view, under collimated or diffuse light.
    Directional(DirectionalQuantity, bool),
}

impl QueryQuantity {
    const ALL: [Self; 7] = [
        Self::Hemispherical(Quantity::Transmittance),
        Self::Hemispherical(Quantity::Reflectance),
        Self::Directional(DirectionalQuantity::ReflectanceFactor, false),
        Self::Directional(DirectionalQuantity::TransmittanceFactor, false),
        Self::Directional(DirectionalQuantity::ReflectanceFactor, true),
        Self::Directional(DirectionalQuantity::TransmittanceFactor, true),
        Self::Directional(DirectionalQuantity::AnisotropyFactor, false),
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Hemispherical(quantity) => quantity.name(),
            Self::Directional(quantity, diffuse) => quantity.name(diffuse),
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let bands = args.bands.open()?;
    ensure!(
        bands.is_none()
            || !matches!(
                args.quantity,
                QueryQuantity::Directional(DirectionalQuantity::AnisotropyFactor, _)
            ),
        "the anisotropy factor of a band is its reflectance factor over its reflectance; ask for both, and divide"
    );
    let database = if args.diffuse {
        Database::open(common::diffuse_path(&args.file)?)?
    } else {
        Database::open(&args.file)?
    };
    let mut csv = String::new();
    let spectrum = match args.quantity {
        QueryQuantity::Hemispherical(quantity) => {
            if args.explain {
                csv = comments(&database, quantity);
            }
            args.hemispherical(&database, quantity)?
        }
        QueryQuantity::Directional(quantity, _) => {
            let views = Database::open(args.views_path()?)?;
            if args.explain {
                csv = comments(&views, quantity.side());
            }
            args.directional(&database, &views, quantity)?
        }
    };
    if let Some(bands) = bands {
        let nm = database.wavelengths_nm();
        let spectrum: Vec<f64> = spectrum.into_iter().map(f64::from).collect();
        let values = bands.averages(nm)?.values(&spectrum);
        return common::print(&(csv + &bands.comments(nm) + &bands.csv(&values)));
    }
    csv.push_str("wavelength_nm,value\n");
    for (nm, value) in database.wavelengths_nm().iter().zip(&spectrum) {
        writeln!(csv, "{nm},{value}")?;
    }
    common::print(&csv)
}

impl Args {
    /// A spectrum of reflectance or transmittance.
    fn hemispherical(&self, database: &Database, quantity: Quantity) -> anyhow::Result<Vec<f32>> {
        let point = self.point.point(self.diffuse)?;
        let mut views = Parameter::VIEWS.into_iter();
        if let Some(axis) = views.find(|axis| point.get(*axis).is_some()) {
            let (name, option) = (quantity.name(), axis.record().option);
            let factor = DirectionalQuantity::ReflectanceFactor.name(self.diffuse);
            bail!("{name} does not depend on a view; remove --{option}, or ask for {factor}");
        }
        let database_at = database.at(point.optional())?;
        Ok(match self.method {
            Method::Smooth => {
                let lookup = Lookup::new(&database_at, quantity)?;
                let mut spectrum = vec![0.0; lookup.wavelengths()];
                lookup.spectrum(point, &mut spectrum)?;
                spectrum
            }
            Method::Varsa2025 => Varsa2025::new(database, quantity)?.spectrum(point)?,
        })
    }

    /// A spectrum of factors toward a view.
    fn directional(
        &self,
        database: &Database,
        views: &Database,
        quantity: DirectionalQuantity,
    ) -> anyhow::Result<Vec<f32>> {
        let point = self.point.point(self.diffuse)?;
        let needed = match self.diffuse {
            true => &Parameter::VIEWS[..1],
            false => &Parameter::VIEWS,
        };
        if let Some(axis) = needed.iter().find(|axis| point.get(**axis).is_none()) {
            let (name, option) = (self.quantity.name(), axis.record().option);
            bail!("{name} is the light toward a view; give --{option} too");
        }
        if self.diffuse && point.get(Parameter::VIEWS[1]).is_some() {
            let (name, option) = (self.quantity.name(), Parameter::VIEWS[1].record().option);
            bail!("{name} under diffuse light does not depend on the azimuth; remove --{option}");
        }
        let snow = point.optional();
        let directions = Directions::new(&database.at(snow)?, &views.at(snow)?)?;
        let mut spectrum = vec![0.0; directions.wavelengths()];
        directions.spectrum(quantity, point, &mut spectrum)?;
        Ok(spectrum)
    }

    /// The path of the anisotropy factors.
    ///
    /// # Errors
    /// If the options contradict each other, or the directory has no such file.
    fn views_path(&self) -> anyhow::Result<PathBuf> {
        let name = self.quantity.name();
        ensure!(
            matches!(self.method, Method::Smooth),
            "the method varsa2025 does not know views; remove --method, or ask for reflectance or transmittance"
        );
        if let QueryQuantity::Directional(quantity, diffuse) = self.quantity
            && diffuse != self.diffuse
            && quantity != DirectionalQuantity::AnisotropyFactor
        {
            let other = quantity.name(self.diffuse);
            bail!(
                "{name} belongs to {} light; ask for {other}, or {} --diffuse",
                if diffuse { "diffuse" } else { "collimated" },
                if diffuse { "add" } else { "remove" }
            );
        }
        ensure!(
            self.file.is_dir(),
            "{name} is looked up in two files; give their directory instead of {}",
            self.file.display()
        );
        let file = if self.diffuse { VIEWS_DIFFUSE } else { VIEWS };
        let path = self.file.join(file);
        ensure!(
            path.exists(),
            "no {file} in {}; run `splitsnow build` on a grid file with axes.view_deg and axes.relative_azimuth_deg{}",
            self.file.display(),
            if self.diffuse {
                ", and axes.diffuse = true"
            } else {
                ""
            }
        );
        Ok(path)
    }
}

/// The comment lines of `--explain`.
fn comments(database: &Database, quantity: Quantity) -> String {
    let explanation = explanation(database, quantity);
    let lines = explanation.lines().map(|line| format!("# {line}\n"));
    lines.collect()
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
