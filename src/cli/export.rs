//! `splitsnow export`: converts a database or compact file to other formats.
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};

use super::bands;
use super::common::{self, Spinner};
use super::point::PointArgs;
use crate::atomic;
use crate::export::{self, ExportLayout, ExportTable};
#[cfg(feature = "charts")]
use crate::lab::report::Swatches;
use crate::lookup::{Database, Lookup};
use crate::measurement::Quantity;
use crate::store::{COMPACT, DIFFUSE, Store, VIEWS};

/// Export to NetCDF, CSV or NPZ; a spectrum or a table for renderers; colour patches
///
/// `netcdf` (conventions CF-1.11), `csv` (one row for each node and wavelength) and `npz`
/// hold all nodes of the database, with standard errors, or all nodes of the compact file.
/// `spd` holds one spectrum of the compact file in the format of pbrt-v4 and Mitsuba 3.
/// `lut` is a table of transmitted colours over thickness and cosine, as an image of half floats,
/// with its look-up in OSL, GLSL, HLSL, WGSL and MaterialX and a sidecar in JSON, which states the
/// measured errors. `--out` is the first part of the names of these files.
/// `png` and `svg` are patches of colour from the compact file: all its thicknesses under
/// five illuminants, at the middle node of each other axis that no option sets.
/// `--bands` averages the spectra of netcdf, csv and npz over the bands of a sensor.
/// docs/formats.md describes all formats.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_long_help = "\
Examples:
  splitsnow export out/quick --format netcdf
  splitsnow export out/quick --from database --format csv --out quick.csv
  splitsnow export out/brdf --format netcdf --views
  splitsnow export out/alpine --format netcdf --bands sentinel2a --out bands.nc
  splitsnow export out/quick --format spd --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --incidence-angle-deg 40 --out snow.spd
  splitsnow export out/quick --format lut --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --primaries rec2020 --out snow
  splitsnow export out/quick --format png --grain-size-um 300 --incidence-angle-deg 0"
)]
pub(super) struct Args {
    /// Compact file, or an output directory
    #[arg(value_name = "FILE|DIR")]
    file: PathBuf,
    /// Format to write
    #[arg(long, value_enum)]
    format: ExportFormat,
    /// File to write; an existing file is replaced [default: snow.nc, snow.csv and so on in the
    /// directory, or the name of the compact file with the format's extension]
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// Source in an output directory [default: the compact file, or the database if there is
    /// no compact file]
    #[arg(long, value_enum)]
    from: Option<From>,
    /// Export the curves under isotropic light, as netcdf, csv or npz; FILE must be an output
    /// directory whose grid has axes.diffuse = true
    #[arg(long)]
    diffuse: bool,
    /// Export the factors toward views (BRF, BTF and anisotropy factor; HDRF and HDTF too if the
    /// grid has axes.diffuse = true), with reflectance and transmittance, from the database as
    /// netcdf, csv or npz; FILE must be an output directory whose grid has axes.view_deg
    #[arg(long, conflicts_with = "diffuse")]
    views: bool,
    /// Order of the axes in netcdf and npz: that of the database, or crtm (density, thickness,
    /// grain size, wavelength, angle, after all others), in netcdf with the names and units that
    /// the CRTM loader reads [default: database]
    #[arg(long, value_parser = common::name_parser(ExportLayout::ALL, ExportLayout::name))]
    layout: Option<ExportLayout>,
    /// Quantity in spd, png and svg [default: transmittance]
    #[arg(long, value_parser = common::name_parser(Quantity::ALL, Quantity::name))]
    quantity: Option<Quantity>,
    #[command(flatten)]
    bands: bands::Args,
    #[cfg(feature = "exr")]
    #[command(flatten, next_help_heading = "Look-up table (lut)")]
    lut: super::lut::LutArgs,
    #[command(
        flatten,
        next_help_heading = "Point for spd, png and svg; snow for lut; node for --layout crtm"
    )]
    point: PointArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ExportFormat {
    /// NetCDF, classic format, CF-1.11
    #[cfg(feature = "netcdf")]
    Netcdf,
    /// One row for each node and wavelength
    Csv,
    /// Arrays for NumPy
    #[cfg(feature = "npz")]
    Npz,
    /// One spectrum for pbrt-v4 and Mitsuba 3
    Spd,
    /// Look-up table for renderers: image, shaders, sidecar
    #[cfg(feature = "exr")]
    Lut,
    /// Patches of colour, as pixels
    #[cfg(feature = "charts")]
    Png,
    /// Patches of colour, as vector graphics
    #[cfg(feature = "charts")]
    Svg,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum From {
    /// The compact file, evaluated at its nodes
    Compact,
    /// The database, with standard errors
    Database,
}

impl ExportFormat {
    fn extension(self) -> &'static str {
        match self {
            #[cfg(feature = "netcdf")]
            Self::Netcdf => "nc",
            Self::Csv => "csv",
            #[cfg(feature = "npz")]
            Self::Npz => "npz",
            Self::Spd => "spd",
            #[cfg(feature = "exr")]
            Self::Lut => "exr",
            #[cfg(feature = "charts")]
            Self::Png => "png",
            #[cfg(feature = "charts")]
            Self::Svg => "svg",
        }
    }

    /// Whether the format holds all nodes.
    fn is_table(self) -> bool {
        match self {
            #[cfg(feature = "netcdf")]
            Self::Netcdf => true,
            Self::Csv => true,
            #[cfg(feature = "npz")]
            Self::Npz => true,
            Self::Spd => false,
            #[cfg(feature = "exr")]
            Self::Lut => false,
            #[cfg(feature = "charts")]
            Self::Png | Self::Svg => false,
        }
    }
}

/// What an export writes and prints.
pub(super) struct Exported {
    /// The files in the order in which they are written.
    pub(super) files: Vec<(PathBuf, Vec<u8>)>,
    /// Lines to print after their names.
    pub(super) remarks: String,
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    args.check()?;
    if args.out.is_some() {
        let out = args.out()?;
        // the path of a lut may lack its ending
        common::check_output(&match args.format.extension() {
            "exr" => out.with_extension("exr"),
            _ => out,
        })?;
    }
    let spinner = Spinner::new("exporting");
    let Exported { files, remarks } = args.files()?;
    for (path, bytes) in &files {
        atomic::write(path, bytes).map_err(|error| common::cannot_write(path, error))?;
    }
    drop(spinner);
    let mut text = String::new();
    for (path, bytes) in &files {
        let size = common::bytes(bytes.len() as u64);
        text += &format!("{}: {size}\n", common::one_line(path));
    }
    common::print(&(text + &remarks))
}

impl Args {
    /// Whether the output is NetCDF for the CRTM loader.
    fn is_crtm(&self) -> bool {
        self.format.extension() == "nc" && self.layout == Some(ExportLayout::Crtm)
    }

    /// The files to write.
    fn files(&self) -> anyhow::Result<Exported> {
        let layout = self.layout.unwrap_or(ExportLayout::Database);
        let quantity = self.quantity.unwrap_or(Quantity::Transmittance);
        let bands = self.bands.open()?;
        let mut remarks = String::new();
        let mut table = || -> anyhow::Result<ExportTable> {
            let Some(bands) = &bands else {
                return self.table();
            };
            let table = bands.table(self.table()?)?;
            for (name, nm) in table.bands() {
                let _ = writeln!(remarks, "{name}: {nm:.2} nm");
            }
            Ok(table)
        };
        let bytes = match self.format {
            #[cfg(feature = "netcdf")]
            ExportFormat::Netcdf if self.is_crtm() => export::crtm(self.point.cut(table()?)?)?,
            #[cfg(feature = "netcdf")]
            ExportFormat::Netcdf => export::netcdf(&table()?.with_layout(layout))?,
            ExportFormat::Csv => export::csv(&table()?.with_layout(layout)).into_bytes(),
            #[cfg(feature = "npz")]
            ExportFormat::Npz => export::npz(&table()?.with_layout(layout))?,
            ExportFormat::Spd => self.spectrum(quantity)?,
            #[cfg(feature = "exr")]
            ExportFormat::Lut => {
                let snow = self.point.snow()?;
                let database = self.compact()?.at(snow.optional())?;
                let out = self.out()?;
                let is_image = out.extension().is_some_and(|end| end == "exr");
                let out = if is_image {
                    out.with_extension("")
                } else {
                    out
                };
                return self.lut.files(&database, snow, &out);
            }
            #[cfg(feature = "charts")]
            ExportFormat::Png => self.patches(quantity)?.png()?,
            #[cfg(feature = "charts")]
            ExportFormat::Svg => self.patches(quantity)?.svg()?.into_bytes(),
        };
        Ok(Exported {
            files: vec![(self.out()?, bytes)],
            remarks,
        })
    }

    /// Refuses options that do not apply to the format.
    fn check(&self) -> anyhow::Result<()> {
        if self.is_crtm() {
            ensure!(
                self.point.leaves_tables() && self.quantity.is_none(),
                "--layout crtm exports the reflectance at all densities, thicknesses, grain sizes and incidence angles; remove their options and --quantity, and choose nodes of the other axes only"
            );
        } else if self.format.is_table() {
            ensure!(
                self.point.is_empty() && self.quantity.is_none(),
                "netcdf, csv and npz hold all points and quantities; remove the options of the point and --quantity, which apply to spd, lut, png and svg only"
            );
        } else {
            ensure!(
                self.from != Some(From::Database),
                "spd, lut, png and svg are looked up in the compact file; remove --from database"
            );
        }
        ensure!(
            self.format.is_table() || !self.bands.is_given(),
            "--bands applies only to netcdf, csv and npz; remove it, or choose one of these formats"
        );
        #[cfg(feature = "exr")]
        if self.format == ExportFormat::Lut {
            ensure!(
                self.quantity.is_none(),
                "lut holds transmittance and reflectance; remove --quantity"
            );
        } else {
            ensure!(
                self.lut.is_empty(),
                "--light, --primaries, --thicknesses, --cosines, --last-cm and --max-delta-e apply only to lut; remove them, or choose --format lut"
            );
        }
        ensure!(
            !self.diffuse || (self.format.is_table() && self.layout.is_none()),
            "--diffuse applies only to netcdf, csv and npz, without --layout; remove it, or choose one of these formats"
        );
        ensure!(
            !self.views || (self.format.is_table() && self.layout.is_none()),
            "--views applies only to netcdf, csv and npz, without --layout; remove it, or choose one of these formats"
        );
        ensure!(
            !self.views || self.from != Some(From::Compact),
            "--views exports the database; remove --from compact"
        );
        ensure!(
            self.layout.is_none() || matches!(self.format.extension(), "nc" | "npz"),
            "--layout applies only to netcdf and npz; remove it, or choose one of these formats"
        );
        Ok(())
    }

    /// The nodes of the database or of the compact file.
    fn table(&self) -> anyhow::Result<ExportTable> {
        if self.views {
            return Ok(ExportTable::of_views(&Store::open(&self.file)?)?);
        }
        let dir = self.file.is_dir();
        let lacks_compact = dir && !self.file.join(COMPACT).exists() && Store::is_at(&self.file);
        let database = match self.from {
            Some(from) => from == From::Database,
            None => lacks_compact,
        };
        Ok(match (database, self.diffuse) {
            (true, diffuse) => ExportTable::of_store(&Store::open(&self.file)?, diffuse)?,
            (false, false) => ExportTable::of_compact(&self.compact()?)?,
            (false, true) => {
                let file = Database::open(&common::diffuse_path(&self.file)?)?;
                ExportTable::of_compact(&file)?.diffuse()?
            }
        })
    }

    fn compact(&self) -> anyhow::Result<Database> {
        Ok(Database::open(&self.file)?)
    }

    /// The colours of the compact file at the given point, for all thicknesses or the given one.
    #[cfg(feature = "charts")]
    fn patches(&self, quantity: Quantity) -> anyhow::Result<Swatches> {
        let file = self.compact()?;
        let point = self.point.or_middle(&file);
        let file_at = file.at(point.optional())?;
        let snow = self.point.described(point);
        let one_thickness = self.point.has_thickness();
        let swatches = export::thicknesses(&file_at, quantity, point, one_thickness, snow)?;
        Ok(swatches)
    }

    /// The spectrum at the given point, in the spd format.
    fn spectrum(&self, quantity: Quantity) -> anyhow::Result<Vec<u8>> {
        let point = self.point.point(false)?;
        let file_at = self.compact()?.at(point.optional())?;
        let lookup = Lookup::new(&file_at, quantity)?;
        let mut values = vec![0.0; lookup.wavelengths()];
        lookup.spectrum(point, &mut values)?;
        let comments = [
            format!("{} of snow: {point}", quantity.name()),
            format!(
                "wavelength in vacuum, nm, and value; splitsnow {}",
                env!("CARGO_PKG_VERSION")
            ),
            format!(
                "where the file it is from ends within {} to {} nm, the last values are held",
                export::RANGE_NM[0],
                export::RANGE_NM[1]
            ),
        ];
        Ok(export::spd(&comments, file_at.wavelengths_nm(), &values).into_bytes())
    }

    /// The path of the file to write (in the format lut, of the image), which must not be the file exported.
    fn out(&self) -> anyhow::Result<PathBuf> {
        let extension = self.format.extension();
        let out = match &self.out {
            Some(out) => out.clone(),
            None if self.file.is_dir() => {
                let name = match (self.views, self.diffuse) {
                    (true, _) => VIEWS,
                    (false, true) => DIFFUSE,
                    (false, false) => COMPACT,
                };
                self.file.join(name).with_extension(extension)
            }
            None => self.file.with_extension(extension),
        };
        let real = |path: &Path| path.canonicalize().ok();
        let source = if self.file.is_dir() {
            self.file.join(COMPACT)
        } else {
            self.file.clone()
        };
        if real(&out).is_some_and(|out| real(&source) == Some(out)) {
            bail!(
                "{} is the file being exported; give another --out",
                out.display()
            );
        }
        Ok(out)
    }
}
