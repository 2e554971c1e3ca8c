//! The last stage of `build` and all of `compress`: from a finished database to
//! its compact file, and a report of both.
use std::collections::BTreeMap;
use std::fmt::{self, Write};
use std::path::PathBuf;

use anyhow::{Context, bail};
use ndarray::Axis;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::common::{self, Spinner};
use crate::colour::{Colorimeter, Viewing};
use crate::compress::{
    BandError, Bands, Choice, CompactFile, Compressed, ErrorTable, Largest, Statistics, Variant,
    compress,
};
use crate::grid::{Compression, absent_curves, existing, why_absent};
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::Parameter;
use crate::store::{COMPACT, DIFFUSE, Store, Variable, estimated_bytes};

/// What the compact file is to be.
pub(super) struct Asked {
    pub(super) choice: Choice,
    pub(super) variant: Variant,
    /// At least one.
    pub(super) quantities: Vec<Quantity>,
    /// How colours are compared.
    pub(super) viewing: Viewing,
}

impl Asked {
    /// What `build` writes.
    pub(super) fn plain(bounds: Compression, viewing: Viewing) -> Self {
        Self {
            choice: Choice::Bounds(bounds),
            variant: Variant::default(),
            quantities: Quantity::ALL.into(),
            viewing,
        }
    }
}

/// What a database and its compact file hold, and how good they are.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    database: PathBuf,
    database_bytes: u64,
    curves: u64,
    /// Those of them that do not exist.
    absent_curves: u64,
    wavelengths: u64,
    compact: PathBuf,
    compact_bytes: u64,
    basis: &'static str,
    precision: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    transmittance: Option<QuantityReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reflectance: Option<QuantityReport>,
    lost_share: Lost,
    next: String,
    /// The same of the curves under isotropic light.
    #[serde(skip_serializing_if = "Option::is_none")]
    diffuse: Option<Box<Report>>,
    #[serde(skip)]
    why_absent: String,
}

/// One quantity; errors are the largest over all curves.
#[derive(Debug, Serialize)]
struct QuantityReport {
    components: usize,
    bits: Vec<u32>,
    rmse: Option<Statistics>,
    delta_e: Option<Statistics>,
    max_standard_error: f32,
    bands: Vec<BandError>,
    largest: Option<LargestError>,
    error_table: ErrorTable,
}

/// The largest error of any curve at any wavelength, and the node of the curve.
#[derive(Debug, Serialize)]
struct LargestError {
    #[serde(flatten)]
    largest: Largest,
    at: String,
}

/// Share of the rays that hit an event limit and count in no quantity.
#[derive(Debug, Serialize)]
struct Lost {
    mean: f64,
    max: f64,
}

/// Compresses the finished database in `store`, which nobody else may be writing, and
/// writes its compact file; that of isotropic light, too, if it has such.
pub(super) fn write(store: &Store, asked: &Asked) -> anyhow::Result<Report> {
    let mut report = write_one(store, asked, false)?;
    if store.has_diffuse() {
        report.diffuse = Some(Box::new(write_one(store, asked, true)?));
    }
    Ok(report)
}

/// Compresses the finished database in `store`, which nobody else may be
/// writing, and writes its compact file.
///
/// The file is a function of the database and `asked` alone.
fn write_one(store: &Store, asked: &Asked, diffuse: bool) -> anyhow::Result<Report> {
    let missing = store.missing(None)?.len();
    let jobs = store.jobs();
    if missing > 0 {
        bail!(
            "{missing} of {} jobs of {} are not done; finish it with `splitsnow build`",
            jobs.count(),
            store.path().display()
        );
    }
    let spinner = Spinner::new("compressing");
    let colour = Colorimeter::viewing(store.wavelengths_nm(), &asked.viewing)?;
    let Variant { basis, precision } = asked.variant;
    let mut axes = store.axes().clone();
    if diffuse {
        // look-ups ask for the one angle there is
        axes.set(Parameter::Incidence, vec![0.0]);
    }
    let variable = |of: Variable| if diffuse { of.diffuse() } else { of };
    let rows = existing(&axes, store.absent());
    let mut max_standard_errors = [0.0; 2];
    let mut compressed = |quantity, [values, errors]: [_; 2]| -> anyhow::Result<_> {
        if !asked.quantities.contains(&quantity) {
            return Ok(None);
        }
        let errors = store.read(variable(errors))?;
        max_standard_errors[quantity as usize] = errors.iter().copied().fold(0.0, f32::max);
        // standard errors of curves that do not exist are NaN, which no maximum is
        let bands = Bands::new(store.wavelengths_nm()).with_noise(errors.view());
        let bands = match asked.choice {
            Choice::Bounds(bounds) => bands.bounded(bounds.max_rmse),
            Choice::Components(_) => bands,
        };
        drop(errors);
        let curves = store.read(variable(values))?.mapv(f64::from);
        let all = curves.nrows();
        let curves = if rows.len() < all {
            curves.select(Axis(0), &rows)
        } else {
            curves
        };
        let colour = colour.as_ref();
        let (choice, variant) = (asked.choice, asked.variant);
        let compressed = compress(curves.view(), quantity, colour, &bands, choice, variant);
        let compressed = compressed.with_context(|| quantity.name())?;
        Ok(Some(compressed.spread_over(&rows, all)))
    };
    let transmittance = compressed(
        Quantity::Transmittance,
        [Variable::Transmittance, Variable::TransmittanceSe],
    )?;
    let reflectance = compressed(
        Quantity::Reflectance,
        [Variable::Reflectance, Variable::ReflectanceSe],
    )?;
    let (provenance, mut extra) = metadata(store, asked.choice, &asked.viewing)?;
    if diffuse {
        let light = "diffuse: isotropic radiance; the one angle_deg, 0, stands for all directions";
        extra.insert("illumination".to_owned(), light.to_owned());
    }
    let file = CompactFile {
        axes: &axes,
        absent: store.absent(),
        wavelengths_nm: store.wavelengths_nm(),
        substrate: store.substrate(),
        transmittance: transmittance.as_ref(),
        reflectance: reflectance.as_ref(),
        provenance: &provenance,
        extra: &extra,
    };
    let compact = store.dir().join(if diffuse { DIFFUSE } else { COMPACT });
    file.write(&compact)?;
    drop(spinner);
    let written = Database::open(&compact)?;
    let report = |quantity, compressed: Option<Compressed>| {
        let max_standard_error = max_standard_errors[quantity as usize];
        compressed.map(|one| QuantityReport::new(&written, max_standard_error, one))
    };
    Ok(Report {
        database: store.path().into(),
        database_bytes: estimated_bytes(jobs, jobs.count()),
        curves: axes.count(),
        absent_curves: absent_curves(&axes, store.absent()),
        why_absent: why_absent(&axes, store.absent()),
        wavelengths: jobs.wavelengths(),
        compact_bytes: std::fs::metadata(&compact)?.len(),
        compact,
        basis: basis.name(),
        precision: precision.name(),
        transmittance: report(Quantity::Transmittance, transmittance),
        reflectance: report(Quantity::Reflectance, reflectance),
        lost_share: Lost::of(store)?,
        next: next(store, asked, diffuse),
        diffuse: None,
    })
}

/// Where the numbers come from, as JSON; and what the spectra are of.
fn metadata(
    store: &Store,
    choice: Choice,
    viewing: &Viewing,
) -> anyhow::Result<(String, BTreeMap<String, String>)> {
    let mut provenance = Map::new();
    let mut extra = BTreeMap::new();
    for (key, value) in store.attributes() {
        match (key.as_str(), value) {
            ("title" | "source" | "illumination" | "bottom_boundary", Value::String(text)) => {
                extra.insert(key, text);
            }
            ("grain_size_relation", Value::String(text)) => {
                extra.insert(key, text);
            }
            ("optical_radius_um" | "ssa_m2_kg", values) => {
                extra.insert(key, values.to_string());
            }
            // what readers of Zarr need
            ("coordinates", _) => {}
            // Those of the database, which the file has its own of.
            ("units" | "format_version" | "substrate", _) => {}
            (_, value) => {
                provenance.insert(key, value);
            }
        }
    }
    let mut compression = match choice {
        Choice::Components(components) => json!({ "components": components }),
        Choice::Bounds(bounds) => {
            json!({ "max_delta_e": bounds.max_delta_e, "max_rmse": bounds.max_rmse })
        }
    };
    compression["illuminants"] = json!(viewing.illuminants);
    compression["delta_e"] = json!(viewing.difference);
    provenance.insert("compression".into(), compression);
    Ok((serde_json::to_string(&provenance)?, extra))
}

/// A command that uses the compact file: its first curve.
fn next(store: &Store, asked: &Asked, diffuse: bool) -> String {
    let mut command = format!("splitsnow query {}", store.dir().display());
    if diffuse {
        command.push_str(" --diffuse");
    }
    // those that every database has first
    let (optional, core): (Vec<_>, Vec<_>) =
        store.axes().iter().partition(|(p, _)| p.is_optional());
    for (parameter, values) in core.into_iter().chain(optional) {
        if diffuse && parameter == Parameter::Incidence {
            continue;
        }
        let is_thickness = parameter == Parameter::Thickness;
        // of the first grain size, the thinnest slab into which its grains fit
        let thinnest = store.absent().first().filter(|_| is_thickness);
        let first = values.get(thinnest.copied().unwrap_or_default());
        let first = first.copied().unwrap_or_default();
        let _ = write!(command, " --{} {first}", parameter.record().option);
    }
    if !asked.quantities.contains(&Quantity::Transmittance) {
        let _ = write!(command, " --quantity {}", Quantity::Reflectance.name());
    }
    command
}

impl QuantityReport {
    /// `database` is the file that it was written to.
    fn new(database: &Database, max_standard_error: f32, compressed: Compressed) -> Self {
        let row = compressed.errors().copied();
        let bands = compressed.band_errors();
        let larger = |a: Largest, b: Largest| if b.error > a.error { b } else { a };
        let largest = bands.iter().map(|band| band.largest).reduce(larger);
        let at = |row| {
            let point = database.point(row);
            point.map_or(String::new(), |point| point.to_string())
        };
        Self {
            components: compressed.components(),
            bits: compressed.coefficients.bits(),
            rmse: row.map(|row| row.rmse),
            delta_e: row.and_then(|row| row.delta_e),
            max_standard_error,
            bands,
            largest: largest.map(|largest| LargestError {
                at: at(largest.curve),
                largest,
            }),
            error_table: compressed.table,
        }
    }

    /// Largest errors with the components chosen.
    fn errors(&self) -> String {
        let plural = if self.components == 1 { "" } else { "s" };
        let mut text = format!("{} component{plural}", self.components);
        if self.bits.iter().any(|bits| *bits != 32) {
            let bits: Vec<_> = self.bits.iter().map(u32::to_string).collect();
            let _ = write!(text, " of {} bits", bits.join(", "));
        }
        if let Some(delta_e) = self.delta_e {
            let _ = write!(text, ", Delta-E at most {:.3}", delta_e.max);
        }
        if let Some(rmse) = self.rmse {
            let _ = write!(text, ", RMSE at most {:.5}", rmse.max);
        }
        text
    }
}

/// Lines of the bands and the largest error, each after 16 columns.
impl fmt::Display for QuantityReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let bands = self.bands.iter().map(|band| {
            let bound = band.max_rmse.map(|bound| format!(" < {bound}"));
            let (name, rmse) = (band.band.name(), band.rmse.max);
            format!("{name} {rmse:.5}{}", bound.unwrap_or_default())
        });
        let bands: Vec<_> = bands.collect();
        writeln!(f, "  RMSE in       {}", bands.join(", "))?;
        if let Some(LargestError { largest, at }) = &self.largest {
            writeln!(
                f,
                "  largest error {:.5} at {} nm: {at}",
                largest.error, largest.wavelength_nm
            )?;
        }
        Ok(())
    }
}

impl Lost {
    fn of(store: &Store) -> anyhow::Result<Self> {
        let count = store.jobs().count();
        let (mut sum, mut max) = (0.0, 0.0_f64);
        for job in 0..count {
            let share = store.lost_share(job)?;
            sum += share;
            max = max.max(share);
        }
        Ok(Self {
            mean: sum / count as f64,
            max,
        })
    }
}

/// The tables and a closing summary.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let both = [
            (Quantity::Transmittance, &self.transmittance),
            (Quantity::Reflectance, &self.reflectance),
        ];
        let there = both
            .into_iter()
            .filter_map(|(quantity, report)| Some((quantity, report.as_ref()?)));
        for (quantity, report) in there.clone() {
            writeln!(f, "{}\n{}\n", quantity.name(), report.error_table)?;
        }
        writeln!(
            f,
            "database        {}: {} curves of {} wavelengths, {} on disk",
            self.database.display(),
            self.curves,
            self.wavelengths,
            common::bytes(self.database_bytes),
        )?;
        if self.absent_curves > 0 {
            writeln!(f, "absent          {}", self.why_absent)?;
        }
        writeln!(
            f,
            "compact file    {}: {}, {} basis, {}",
            self.compact.display(),
            common::bytes(self.compact_bytes),
            self.basis,
            self.precision
        )?;
        for (quantity, report) in there {
            writeln!(
                f,
                "{:<14}  {}, standard errors at most {:.5}",
                quantity.name(),
                report.errors(),
                report.max_standard_error
            )?;
            write!(f, "{report}")?;
        }
        if self.lost_share.max > 0.0 {
            writeln!(
                f,
                "lost rays       {:.4} % hit the event limit and count in no quantity (worst curve {:.4} %)",
                100.0 * self.lost_share.mean,
                100.0 * self.lost_share.max
            )?;
        }
        writeln!(f, "next            {}", self.next)?;
        match &self.diffuse {
            Some(diffuse) => write!(f, "\nunder isotropic light: {diffuse}"),
            None => Ok(()),
        }
    }
}
