//! `splitsnow retrieve`: from measured spectra to the snow.
mod within;

use std::fs::File;
use std::io::Read;
use std::path::PathBuf;

use anyhow::{anyhow, ensure};

use super::against::{self, Exclude};
use super::bands;
use super::common::{self, Interrupted, Spinner, ThreadArgs};
use super::spectra::{self, SpectrumArg};
use crate::comparison::{Exclusion, Hints, MeasuredSpectrum};
use crate::engine::EngineError;
#[cfg(feature = "charts")]
use crate::lab::report;
use crate::measurement::Quantity;
use crate::optics::MODEL_RANGE_NM;
use crate::retrieve::{
    ExactOptions, FreeParameter, KnownValue, MeasuredBands, MeasuredInput, NoiseModel,
    RetrieveError, Setup, SetupRequest,
};
use crate::spectrum::measured::{Column, MAX_BYTES, Unit, ValueScale};

/// Find the snow that has a measured spectrum, with credible intervals
///
/// Prints specific surface area and optical radius first, then the unknowns: their most probable
/// values, medians, and the intervals that hold them with a probability of 68 and 95 %. Also which
/// combinations of the unknowns the spectrum determines, chi-square and what it says, and the
/// residuals by band.
///
/// All axes of the file with several values are unknown, unless --fix gives their value. Several
/// spectra of one snow share the unknowns: R and T, or several thicknesses or angles. What is
/// known of one spectrum alone follows its name: `thin.csv@thickness_cm=2.5`.
///
/// With --bands, the values are averages over the bands of a sensor: each row is the name of a band,
/// its value and, if known, its standard deviation.
///
/// The errors of the measurement have three parts: of each value (--noise, unless the file states
/// them), of the level of each spectrum (--level), and one that is correlated between wavelengths
/// (--correlated). The errors that the compact file states are added. The intervals follow from
/// these errors: state your own.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  splitsnow retrieve field.csv --picture fit.svg
  splitsnow retrieve field.csv --within out/alpine --fix thickness_cm=inf \\
      --fix density_kg_m3=250 --fix incidence_angle_deg=55
  splitsnow retrieve r.csv t.csv@quantity=transmittance --within out/alpine \\
      --fix thickness_cm=4 --free ssa_m2_kg=26+-3 --free facetness=0.1..0.6
  splitsnow retrieve --within alpine.toml --exact --picture fit.svg \\
      thin.csv@thickness_cm=2.5,density_kg_m3=155 deep.csv@thickness_cm=34,density_kg_m3=200
  splitsnow retrieve pixel.csv --bands sentinel2a --within out/alpine --fix thickness_cm=inf \\
      --fix density_kg_m3=250 --fix incidence_angle_deg=55
  splitsnow retrieve configs/measured/vermont_thin.csv --within configs/vermont.toml \\
      --fix thickness_cm=2.5 --fix density_kg_m3=155")]
pub(super) struct Args {
    /// Measured spectra of one snow: text tables (CSV, ECOSTRESS, .sed, .sig) in a format of
    /// docs/formats.md. `FILE@NAME=VALUE,...` adds what is known of this spectrum alone: a value on
    /// an axis, `quantity`, or `column`
    #[arg(value_name = "SPECTRUM", required = true)]
    spectra: Vec<String>,
    /// Compact file, or the output directory that holds it; or a grid file (.toml), whose database
    /// is then built, or continued, in out/NAME [default: a grid made from what was measured and
    /// what is known, in out/retrieve_ID.toml]
    #[arg(long, value_name = "BOX")]
    within: Option<PathBuf>,
    /// Directory for the grid that is made and for the database that is built [default: out]
    #[arg(long, value_name = "DIR")]
    keep_in: Option<PathBuf>,
    /// Unknown with its prior: NAME=MIN..MAX, NAME=MEAN+-SD (a Gaussian within the axis), or NAME
    /// (anything on the axis). ssa_m2_kg and optical_radius_um stand for the grain size. May be
    /// given several times
    #[arg(long, value_name = "NAME[=PRIOR]")]
    free: Vec<FreeParameter>,
    /// Value that is known for all spectra; thickness_cm=inf is a half space. May be given several
    /// times
    #[arg(long, value_name = "NAME=VALUE")]
    fix: Vec<KnownValue>,
    /// The light was diffuse: use the file for isotropic light in the directory
    #[arg(long)]
    diffuse: bool,
    /// Standard deviation of each measured value, for values whose file does not state it
    #[arg(long, value_name = "SD", default_value_t = NoiseModel::default().value, value_parser = not_negative)]
    noise: f64,
    /// Relative standard deviation of the level of each spectrum: the calibration
    #[arg(long, value_name = "SHARE", default_value_t = NoiseModel::default().level, value_parser = not_negative)]
    level: f64,
    /// Standard deviation of the error that is correlated between wavelengths
    #[arg(long, value_name = "SD", default_value_t = NoiseModel::default().correlated, value_parser = not_negative)]
    correlated: f64,
    /// Distance over which that correlation falls to 1/e, nm
    #[arg(long, value_name = "NM", default_value_t = NoiseModel::default().length_nm, value_parser = common::positive)]
    correlation_nm: f64,
    /// Check the optimum by simulation, and improve it until it stays
    #[arg(long)]
    exact: bool,
    /// Walks of each simulation of --exact [default: the grid's, at least
    /// those of `simulate`]
    #[arg(long, value_name = "N", requires = "exact", value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,
    /// Seed of the sampler, which is used for more than four unknowns, and of --exact
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Column of the files: its name, a part of its name, or its number from 1 [default: the first
    /// column whose name fits, else the first]
    #[arg(long, value_name = "NAME|N")]
    column: Option<Column>,
    /// Unit of the files' wavelengths [default: the unit that a file states, else guessed]
    #[arg(long, conflicts_with = "bands", value_parser = common::name_parser(Unit::ALL, Unit::name))]
    unit: Option<Unit>,
    /// Scale of the files' values [default: the scale that a file states, else guessed]
    #[arg(long, value_parser = common::name_parser(ValueScale::ALL, ValueScale::name))]
    scale: Option<ValueScale>,
    /// Quantity in the files [default: from the name of the column, else reflectance]
    #[arg(long, value_parser = common::name_parser(Quantity::ALL, Quantity::name))]
    quantity: Option<Quantity>,
    /// Band in nm, ends included, that is left out; may be given several times, or once as `none`
    /// [default: 1750-2000 and 2350-2500, where water vapour absorbs; if wavelengths beyond 2500 are
    /// used, 2350-3350 and 4150-4500]
    #[arg(long, value_name = "FROM-TO")]
    exclude: Vec<Exclude>,
    /// Longest wavelength of the files that is used without --within, nm, 350 to 5000; beyond 2500
    /// see docs/methods.md [default: 2500]
    #[arg(long, value_name = "NM", conflicts_with_all = ["within", "bands"], value_parser = longest_nm)]
    longest_nm: Option<f64>,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Print JSON: everything, with the fitted spectra and residuals
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print the table of the quantities as CSV
    #[arg(long)]
    csv: bool,
    /// Write a picture to FILE, which must end with .svg or .png: measured and fitted spectra,
    /// residuals, and the distributions of the unknowns
    #[cfg(feature = "charts")]
    #[arg(long, value_name = "FILE", value_parser = against::picture)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    bands: bands::Args,
}

/// Parses a finite number that is not negative.
fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("the value must be a finite number, 0 or above".into()),
    }
}

/// Parses a wavelength of the model.
fn longest_nm(text: &str) -> Result<f64, String> {
    let (first, last) = MODEL_RANGE_NM;
    let nm = text.parse().ok().filter(|nm| (first..=last).contains(nm));
    nm.ok_or_else(|| format!("the wavelength must be {first} to {last} nm"))
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let cancel = common::interrupt_flag();
    #[cfg(feature = "charts")]
    if let Some(path) = &args.picture {
        common::check_output(path)?;
    }
    let longest = args.longest_nm()?;
    let exclusions = against::exclusions(&args.exclude, longest)?;
    let bands = args.bands.open()?;
    let spectra: anyhow::Result<Vec<SpectrumArg>> = args
        .spectra
        .iter()
        .map(|word| SpectrumArg::parse(word))
        .collect();
    let spectra = spectra?;
    let read = |spectra: Vec<SpectrumArg>, bands: Option<&MeasuredBands>| {
        let read = |spectrum| args.read(spectrum, longest, &exclusions, bands);
        let measured: anyhow::Result<Vec<_>> = spectra.into_iter().map(read).collect();
        measured
    };
    // spectra are read before a database is built; bands need its wavelengths
    let (measured, database, bands) = match bands {
        None => {
            let measured = read(spectra, None)?;
            let (within, made) = match &args.within {
                Some(within) => (within.clone(), false),
                None => {
                    let nm = spectra::wavelengths_nm(measured.iter().map(|(_, m)| m));
                    ensure!(
                        nm.len() > 1,
                        "{}: fewer than 2 wavelengths are outside the excluded bands; --exclude none uses all",
                        args.spectra.join(", ")
                    );
                    let known = measured.iter().map(|(arg, m)| arg.known(m)).collect();
                    (args.default_box(known, &nm)?, true)
                }
            };
            (
                measured,
                args.database(&within, made, cancel.as_deref().ok())?,
                None,
            )
        }
        Some(bands) => {
            let within = args.within.as_deref().ok_or_else(|| {
                anyhow!("--bands needs a database whose wavelengths cover the bands: give it, or a grid file, with --within")
            })?;
            let database = args.database(within, false, cancel.as_deref().ok())?;
            let bands = bands.measured(&database)?;
            (read(spectra, Some(&bands))?, database, Some(bands))
        }
    };
    let inputs: anyhow::Result<Vec<MeasuredInput>> = measured
        .into_iter()
        .map(|(spectrum, measured)| match &bands {
            Some(bands) => spectra::band_input(spectrum, &measured, bands),
            None => spectra::input(spectrum, &measured, &database),
        })
        .collect();
    let inputs = inputs?;
    let request = SetupRequest {
        database: &database,
        inputs: &inputs,
        free: &args.free,
        fix: &args.fix,
        noise: NoiseModel {
            value: args.noise,
            level: args.level,
            correlated: args.correlated,
            length_nm: args.correlation_nm,
        },
        bands: bands.as_ref(),
    };
    let setup = Setup::new(&request)?;
    if !setup.assumed().is_empty() {
        let names: Vec<_> = setup.assumed().iter().map(|p| p.key()).collect();
        common::note(&format!(
            "unknown within their axes: {} (--fix NAME=VALUE makes one known)",
            names.join(", ")
        ));
    }
    let exact = ExactOptions {
        rays: args.rays,
        seed: args.seed,
        cancel: cancel.as_deref().ok(),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.count()?)
        .build()?;
    let spinner = Spinner::new("searching");
    let exact = args.exact.then_some(&exact);
    let found = pool.install(|| setup.retrieve(&database, args.seed, exact));
    drop(spinner);
    let found = match found {
        Err(RetrieveError::Engine(EngineError::Cancelled)) => {
            return Err(Interrupted("nothing was written".into()).into());
        }
        found => found?,
    };
    #[cfg(feature = "charts")]
    if let Some(path) = &args.picture {
        report::RetrievalPicture(&found).write(path)?;
    }
    if args.json {
        common::print_json(&found.to_json())
    } else if args.csv {
        common::print(&found.to_csv())
    } else {
        common::print(&found.to_string())
    }
}

impl Args {
    /// Reads one measured spectrum, or the values of `bands`, and notes how it was read.
    fn read(
        &self,
        spectrum: SpectrumArg,
        longest_nm: f64,
        exclusions: &[Exclusion],
        bands: Option<&MeasuredBands>,
    ) -> anyhow::Result<(SpectrumArg, MeasuredSpectrum)> {
        let hints = Hints {
            quantity: spectrum.quantity.or(self.quantity),
            column: spectrum.column.clone().or_else(|| self.column.clone()),
            unit: bands.map_or(self.unit, |_| Some(Unit::Nm)),
            scale: self.scale,
            longest_nm: Some(longest_nm),
        };
        let beyond = match &self.within {
            None => "give --longest-nm 5000",
            Some(_) => "give --within a grid with wavelengths beyond it",
        };
        let measured = match bands {
            None => MeasuredSpectrum::read(&spectrum.file, &hints, exclusions)
                .map_err(|error| against::reach(error, beyond))?,
            Some(bands) => {
                let file = spectrum.file.display().to_string();
                let mut bytes = Vec::new();
                File::open(&spectrum.file)
                    .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
                    .map_err(|error| anyhow!("{file}: cannot be read: {error}"))?;
                let text = bands.with_wavelengths(&String::from_utf8_lossy(&bytes));
                let text = text.ok_or_else(|| {
                    anyhow!("{file}: no row begins with the name of a band; with --bands each row is a band, its value and, if known, its standard deviation; the bands are {}", bands.names())
                })?;
                MeasuredSpectrum::parse(&file, text.as_bytes(), &hints, exclusions)?
            }
        };
        against::note_read(&spectrum.file, &measured, beyond);
        Ok((spectrum, measured))
    }
}
