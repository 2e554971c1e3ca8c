//! `splitsnow export`: a database or compact file in the formats of others.
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use super::common::{self, Spinner};
use super::point::PointArgs;
use crate::atomic;
use crate::export::{self, Layout, Table};
#[cfg(feature = "charts")]
use crate::lab::report::Swatches;
use crate::lookup::{Database, Lookup};
use crate::measurement::Quantity;
use crate::store::{COMPACT, DIFFUSE, Store};

/// Export to NetCDF, CSV or NPZ; one spectrum for renderers; patches of colour
///
/// `netcdf` (conventions CF-1.11), `csv` (one row for each node and wavelength) and
/// `npz` hold all nodes: those of the database, with standard errors, or those of the
/// compact file. `spd` is one spectrum of the compact file, as pbrt-v4 and Mitsuba 3
/// read it. `png` and `svg` are patches of the colours of the compact file, all its
/// thicknesses under five lights, at the middle of the other axes where no option says
/// otherwise. docs/formats.md describes them all.
#[derive(Debug, clap::Args)]
#[command(
    allow_negative_numbers = true,
    after_long_help = "\
Examples:
  splitsnow export out/quick --format netcdf
  splitsnow export out/quick --from database --format csv --out quick.csv
  splitsnow export out/quick --format spd --facetness 0.1 --grain-size-um 300 \\
      --density-kg-m3 200 --thickness-cm 5 --incidence-angle-deg 40 --out snow.spd
  splitsnow export out/quick --format png --grain-size-um 300 --incidence-angle-deg 0"
)]
pub(super) struct Args {
    /// A compact file, or an output directory
    #[arg(value_name = "FILE|DIR")]
    file: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    format: Format,
    /// File to write; one that is there is replaced [default: snow.nc, snow.csv and so
    /// on in the directory, or beside the file and named like it]
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// What of a directory [default: the compact file, or the database if there is none]
    #[arg(long, value_enum)]
    from: Option<From>,
    /// Curves under isotropic light, in netcdf, csv and npz: of an output directory whose
    /// grid has axes.diffuse
    #[arg(long)]
    diffuse: bool,
    /// Axes in netcdf and npz: as in the database, or crtm: density, thickness, grain
    /// size, wavelength, angle after all others, in netcdf under the names and units that
    /// the loader of CRTM reads [default: database]
    #[arg(long, value_parser = common::named(Layout::ALL, Layout::name))]
    layout: Option<Layout>,
    /// Which spectrum in spd, png and svg [default: transmittance]
    #[arg(long, value_parser = common::named(Quantity::ALL, Quantity::name))]
    quantity: Option<Quantity>,
    #[command(
        flatten,
        next_help_heading = "Where, in spd, png and svg; nodes for --layout crtm"
    )]
    point: PointArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// NetCDF, classic format, CF-1.11
    #[cfg(feature = "netcdf")]
    Netcdf,
    /// A long table
    Csv,
    /// Arrays for NumPy
    #[cfg(feature = "npz")]
    Npz,
    /// One spectrum for pbrt-v4 and Mitsuba 3
    Spd,
    /// Colours, as pixels
    #[cfg(feature = "charts")]
    Png,
    /// Colours, as vector graphics
    #[cfg(feature = "charts")]
    Svg,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum From {
    /// The compact file, rebuilt on its nodes
    Compact,
    /// The database, with standard errors
    Database,
}

impl Format {
    fn extension(self) -> &'static str {
        match self {
            #[cfg(feature = "netcdf")]
            Self::Netcdf => "nc",
            Self::Csv => "csv",
            #[cfg(feature = "npz")]
            Self::Npz => "npz",
            Self::Spd => "spd",
            #[cfg(feature = "charts")]
            Self::Png => "png",
            #[cfg(feature = "charts")]
            Self::Svg => "svg",
        }
    }

    /// Whether all nodes are exported.
    fn is_table(self) -> bool {
        matches!(self.extension(), "nc" | "csv" | "npz")
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    args.check()?;
    let spinner = Spinner::new("exporting");
    let bytes = if args.format.is_table() {
        args.written(args.table()?)?
    } else {
        args.seen()?
    };
    let out = args.out()?;
    atomic::write(&out, &bytes).with_context(|| format!("cannot write {}", out.display()))?;
    drop(spinner);
    let size = common::bytes(bytes.len() as u64);
    common::print(&format!("{}: {size}\n", common::one_line(&out)))
}

impl Args {
    /// Whether the loader of CRTM is to read it.
    fn is_crtm(&self) -> bool {
        self.format.extension() == "nc" && self.layout == Some(Layout::Crtm)
    }

    /// All nodes.
    fn written(&self, table: Table) -> anyhow::Result<Vec<u8>> {
        #[cfg(feature = "netcdf")]
        if self.is_crtm() {
            return Ok(export::crtm(self.point.cut(table)?)?);
        }
        let table = &table.laid_out(self.layout.unwrap_or(Layout::Database));
        Ok(match self.format {
            #[cfg(feature = "netcdf")]
            Format::Netcdf => export::netcdf(table)?,
            #[cfg(feature = "npz")]
            Format::Npz => export::npz(table)?,
            _ => export::csv(table).into_bytes(),
        })
    }

    /// Refuses options that the format has no use for.
    fn check(&self) -> anyhow::Result<()> {
        if self.is_crtm() {
            ensure!(
                self.point.leaves_tables() && self.quantity.is_none(),
                "the layout crtm holds the reflectance at all densities, thicknesses, grain sizes and angles; only options of the other axes choose a node of them"
            );
        } else if self.format.is_table() {
            ensure!(
                self.point.is_empty() && self.quantity.is_none(),
                "netcdf, csv and npz hold all points and quantities; only spd, png and svg take options that choose among them"
            );
        } else {
            ensure!(
                self.from != Some(From::Database),
                "spd, png and svg are looked up in the compact file; leave out --from database"
            );
        }
        ensure!(
            !self.diffuse || (self.format.is_table() && self.layout.is_none()),
            "--diffuse is for netcdf, csv and npz in the layout of the database"
        );
        ensure!(
            self.layout.is_none() || matches!(self.format.extension(), "nc" | "npz"),
            "--layout is for netcdf and npz"
        );
        Ok(())
    }

    fn table(&self) -> anyhow::Result<Table> {
        let dir = self.file.is_dir();
        let absent = dir && !self.file.join(COMPACT).exists() && Store::is_at(&self.file);
        let database = match self.from {
            Some(from) => from == From::Database,
            None => absent,
        };
        Ok(match (database, self.diffuse) {
            (true, diffuse) => Table::of_store(&Store::open(&self.file)?, diffuse)?,
            (false, false) => Table::of_compact(&self.compact()?)?,
            (false, true) => {
                let file = Database::open(&common::diffuse_path(&self.file)?)?;
                Table::of_compact(&file)?.diffuse()?
            }
        })
    }

    fn compact(&self) -> anyhow::Result<Database> {
        Ok(Database::open(&self.file)?)
    }

    /// A spectrum or colours.
    fn seen(&self) -> anyhow::Result<Vec<u8>> {
        let quantity = self.quantity.unwrap_or(Quantity::Transmittance);
        match self.format {
            #[cfg(feature = "charts")]
            Format::Png => Ok(self.patches(quantity)?.png()?),
            #[cfg(feature = "charts")]
            Format::Svg => Ok(self.patches(quantity)?.svg()?.into_bytes()),
            _ => self.spectrum(quantity),
        }
    }

    #[cfg(feature = "charts")]
    fn patches(&self, quantity: Quantity) -> anyhow::Result<Swatches> {
        let file = self.compact()?;
        let point = self.point.or_middle(&file);
        let there = file.at(point.optional())?;
        let snow = self.point.described(point);
        let one = self.point.has_thickness();
        let swatches = export::thicknesses(&there, quantity, point, one, snow)?;
        Ok(swatches)
    }

    fn spectrum(&self, quantity: Quantity) -> anyhow::Result<Vec<u8>> {
        let point = self.point.point(false)?;
        let there = self.compact()?.at(point.optional())?;
        let lookup = Lookup::new(&there, quantity)?;
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
        Ok(export::spd(&comments, there.wavelengths_nm(), &values).into_bytes())
    }

    fn out(&self) -> anyhow::Result<PathBuf> {
        let extension = self.format.extension();
        let out = match &self.out {
            Some(out) => out.clone(),
            None if self.file.is_dir() => {
                let name = if self.diffuse { DIFFUSE } else { COMPACT };
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
                "{} is the file to export; choose another --out",
                out.display()
            );
        }
        Ok(out)
    }
}
