//! The last stage of `build` and all of `compress`: from a finished database to
//! its compact file, and a report of both.
use std::collections::BTreeMap;
use std::fmt::{self, Write};
use std::path::PathBuf;

use anyhow::bail;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::common::{self, Spinner};
use crate::colour::{Colorimeter, Viewing};
use crate::compress::{Choice, CompactFile, Compressed, ErrorTable, Statistics, compress};
use crate::measurement::Quantity;
use crate::store::{COMPACT, Store, Variable, estimated_bytes};

/// What a database and its compact file hold, and how good they are.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    database: PathBuf,
    database_bytes: u64,
    curves: u64,
    wavelengths: u64,
    compact: PathBuf,
    compact_bytes: u64,
    transmittance: QuantityReport,
    reflectance: QuantityReport,
    lost_share: Lost,
    next: String,
}

/// One quantity; errors are the largest over all curves.
#[derive(Debug, Serialize)]
struct QuantityReport {
    components: usize,
    rmse: Option<Statistics>,
    delta_e: Option<Statistics>,
    max_standard_error: f32,
    error_table: ErrorTable,
}

/// Share of the rays that hit an event limit and count in no quantity.
#[derive(Debug, Serialize)]
struct Lost {
    mean: f64,
    max: f64,
}

/// Compresses the finished database in `store`, which nobody else may be
/// writing, and writes its compact file.
///
/// The file is a function of the database, `choice` and `viewing` alone.
pub(super) fn write(store: &Store, choice: Choice, viewing: &Viewing) -> anyhow::Result<Report> {
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
    let colour = Colorimeter::viewing(store.wavelengths_nm(), viewing)?;
    let compressed = |variable| -> anyhow::Result<Compressed> {
        let curves = store.read(variable)?.mapv(f64::from);
        Ok(compress(curves.view(), colour.as_ref(), choice)?)
    };
    let transmittance = compressed(Variable::Transmittance)?;
    let reflectance = compressed(Variable::Reflectance)?;
    let (provenance, extra) = metadata(store, choice, viewing)?;
    let file = CompactFile {
        axes: store.axes(),
        wavelengths_nm: store.wavelengths_nm(),
        transmittance: &transmittance,
        reflectance: &reflectance,
        provenance: &provenance,
        extra: &extra,
    };
    let compact = store.dir().join(COMPACT);
    file.write(&compact)?;
    drop(spinner);
    Ok(Report {
        database: store.path().into(),
        database_bytes: estimated_bytes(&jobs, jobs.count()),
        curves: jobs.curves(),
        wavelengths: jobs.wavelengths(),
        compact_bytes: std::fs::metadata(&compact)?.len(),
        compact,
        transmittance: QuantityReport::new(store, Variable::TransmittanceSe, transmittance)?,
        reflectance: QuantityReport::new(store, Variable::ReflectanceSe, reflectance)?,
        lost_share: Lost::of(store)?,
        next: next(store),
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
            // Those of the database, which the file has its own of.
            ("units" | "format_version", _) => {}
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
fn next(store: &Store) -> String {
    let mut command = format!("splitsnow query {}", store.dir().display());
    for (name, values) in store.axes().named() {
        let first = values.first().copied().unwrap_or_default();
        let _ = write!(command, " --{} {first}", name.replace('_', "-"));
    }
    command
}

impl QuantityReport {
    fn new(store: &Store, errors: Variable, compressed: Compressed) -> anyhow::Result<Self> {
        let components = compressed.components();
        let table = compressed.table;
        let row = table.rows.iter().find(|row| row.components == components);
        let max_standard_error = store.read(errors)?.iter().copied().fold(0.0, f32::max);
        Ok(Self {
            components,
            rmse: row.map(|row| row.rmse),
            delta_e: row.and_then(|row| row.delta_e),
            max_standard_error,
            error_table: table,
        })
    }

    /// Largest errors with the components chosen.
    fn errors(&self) -> String {
        let plural = if self.components == 1 { "" } else { "s" };
        let mut text = format!("{} component{plural}", self.components);
        if let Some(delta_e) = self.delta_e {
            let _ = write!(text, ", Delta-E at most {:.3}", delta_e.max);
        }
        if let Some(rmse) = self.rmse {
            let _ = write!(text, ", RMSE at most {:.5}", rmse.max);
        }
        text
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
        for (quantity, report) in both {
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
        writeln!(
            f,
            "compact file    {}: {}",
            self.compact.display(),
            common::bytes(self.compact_bytes)
        )?;
        for (quantity, report) in both {
            writeln!(
                f,
                "{:<14}  {}, standard errors at most {:.5}",
                quantity.name(),
                report.errors(),
                report.max_standard_error
            )?;
        }
        if self.lost_share.max > 0.0 {
            writeln!(
                f,
                "lost rays       {:.4} % hit the event limit and count in no quantity (worst curve {:.4} %)",
                100.0 * self.lost_share.mean,
                100.0 * self.lost_share.max
            )?;
        }
        writeln!(f, "next            {}", self.next)
    }
}
