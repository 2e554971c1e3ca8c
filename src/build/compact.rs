//! Compression of a finished database: the last stage of a build, and a command of its own.
//! Writes the compact file, and reports on database and file.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use ndarray::Axis;
use serde_json::{Map, Value, json};

use super::BuildError;
use super::report::{CompactReport, LostShare, QuantityReport};
use crate::colour::{Colorimeter, Viewing};
use crate::compress::{self, Bands, Choice, CompactFile, CompactVariant, Compressed};
use crate::grid::{Compression, absent_curves, existing_rows, why_absent};
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::Parameter;
use crate::store::{COMPACT, DIFFUSE, Store, Variable, estimated_bytes};

/// The requested properties of a compact file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CompressionRequest {
    /// How the number of components is chosen.
    pub choice: Choice,
    /// Basis and precision of the components.
    pub variant: CompactVariant,
    /// Quantities that the file holds; at least one.
    pub quantities: Vec<Quantity>,
    /// How colours are compared.
    pub viewing: Viewing,
}

impl CompressionRequest {
    /// The file that [`build`](super::build()) writes: both quantities, a linear basis,
    /// single precision.
    #[must_use]
    pub fn plain(bounds: Compression, viewing: Viewing) -> Self {
        Self {
            choice: Choice::Bounds(bounds),
            variant: CompactVariant::default(),
            quantities: Quantity::ALL.into(),
            viewing,
        }
    }
}

/// Compresses the finished database in `dir` and writes its compact file; also that of
/// diffuse light, if the database has it. Existing files are replaced. The bytes depend on
/// the database and `request` alone.
///
/// # Errors
/// [`BuildError`] if jobs are missing, another process is working in `dir`, or the error
/// bounds cannot be met.
pub fn compress(
    dir: impl AsRef<Path>,
    request: &CompressionRequest,
) -> Result<CompactReport, BuildError> {
    write(&Store::open_exclusive(dir.as_ref())?, request)
}

/// Compresses the finished database in `store` and writes its compact file; also that of
/// diffuse light, if the database has it. No other process may be writing to the store.
pub(super) fn write(
    store: &Store,
    request: &CompressionRequest,
) -> Result<CompactReport, BuildError> {
    let mut report = write_one(store, request, false)?;
    if store.has_diffuse() {
        report.diffuse = Some(Box::new(write_one(store, request, true)?));
    }
    Ok(report)
}

/// Compresses the curves of `store` under diffuse light or at the incidence angles, and
/// writes their compact file. No other process may be writing to the store.
///
/// The file depends on the database and `request` alone.
fn write_one(
    store: &Store,
    request: &CompressionRequest,
    diffuse: bool,
) -> Result<CompactReport, BuildError> {
    let missing = store.missing(None)?.len();
    let jobs = store.jobs();
    if missing > 0 {
        return Err(BuildError::Unfinished {
            missing,
            jobs: jobs.count(),
            path: store.path().into(),
        });
    }
    let colour = Colorimeter::viewing(store.wavelengths_nm(), &request.viewing)?;
    let CompactVariant { basis, precision } = request.variant;
    let mut axes = store.axes().clone();
    if diffuse {
        // a single angle, which look-ups of diffuse light use
        axes.set(Parameter::Incidence, vec![0.0]);
    }
    let variable = |collimated: Variable| {
        if diffuse {
            collimated.diffuse()
        } else {
            collimated
        }
    };
    let rows = existing_rows(&axes, store.absent());
    let mut max_standard_errors = [0.0; 2];
    let mut compressed = |quantity, [values, errors]: [_; 2]| -> Result<_, BuildError> {
        if !request.quantities.contains(&quantity) {
            return Ok(None);
        }
        let errors = store.read(variable(errors))?;
        max_standard_errors[quantity as usize] = errors.iter().copied().fold(0.0, f32::max);
        // standard errors of curves that do not exist are NaN, which `f32::max` ignores
        let bands = Bands::new(store.wavelengths_nm()).with_noise(errors.view());
        let bands = match request.choice {
            Choice::Bounds(bounds) => bands.bounded(bounds.max_rmse),
            Choice::Components(_) => bands,
        };
        drop(errors);
        let curves = store.read(variable(values))?.mapv(f64::from);
        let row_count = curves.nrows();
        let curves = if rows.len() < row_count {
            curves.select(Axis(0), &rows)
        } else {
            curves
        };
        let colour = colour.as_ref();
        let (choice, variant) = (request.choice, request.variant);
        compress::compress(curves.view(), quantity, colour, &bands, choice, variant)
            .map(|compressed| Some(compressed.spread_over(&rows, row_count)))
            .map_err(|source| BuildError::Compress { quantity, source })
    };
    let transmittance = compressed(
        Quantity::Transmittance,
        [Variable::Transmittance, Variable::TransmittanceSe],
    )?;
    let reflectance = compressed(
        Quantity::Reflectance,
        [Variable::Reflectance, Variable::ReflectanceSe],
    )?;
    let (provenance, mut extra) = metadata(store, request.choice, &request.viewing);
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
    let written = Database::open(&compact)?;
    let report = |quantity, compressed: Option<Compressed>| {
        let max_standard_error = max_standard_errors[quantity as usize];
        compressed.map(|compressed| QuantityReport::new(&written, max_standard_error, compressed))
    };
    let compact_bytes = std::fs::metadata(&compact)
        .map_err(|source| BuildError::Io {
            path: compact.clone(),
            source,
        })?
        .len();
    Ok(CompactReport {
        database: store.path().into(),
        database_bytes: estimated_bytes(jobs, jobs.count()),
        curves: axes.count(),
        absent_curves: absent_curves(&axes, store.absent()),
        why_absent: why_absent(&axes, store.absent()),
        wavelengths: jobs.wavelengths(),
        compact_bytes,
        compact,
        basis,
        precision,
        transmittance: report(Quantity::Transmittance, transmittance),
        reflectance: report(Quantity::Reflectance, reflectance),
        lost_share: LostShare::of(store)?,
        next: query_command(store, request, diffuse),
        diffuse: None,
    })
}

/// The provenance of the spectra, as JSON, and further metadata of the compact file.
fn metadata(
    store: &Store,
    choice: Choice,
    viewing: &Viewing,
) -> (String, BTreeMap<String, String>) {
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
            // only readers of Zarr need it
            ("coordinates", _) => {}
            // the compact file has its own values
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
    (Value::Object(provenance).to_string(), extra)
}

/// A command that looks up the first curve of the compact file.
fn query_command(store: &Store, request: &CompressionRequest, diffuse: bool) -> String {
    let mut command = format!("splitsnow query {}", store.dir().display());
    if diffuse {
        command.push_str(" --diffuse");
    }
    // the axes that every database has come first
    let (optional, core): (Vec<_>, Vec<_>) =
        store.axes().iter().partition(|(p, _)| p.is_optional());
    for (parameter, values) in core.into_iter().chain(optional) {
        if diffuse && parameter == Parameter::Incidence {
            continue;
        }
        let is_thickness = parameter == Parameter::Thickness;
        // of the first grain size, the thinnest slab that is thick enough for its grains
        let thin_count = store.absent().first().filter(|_| is_thickness);
        let first = values.get(thin_count.copied().unwrap_or_default());
        let first = first.copied().unwrap_or_default();
        let _ = write!(command, " --{} {first}", parameter.record().option);
    }
    if !request.quantities.contains(&Quantity::Transmittance) {
        let _ = write!(command, " --quantity {}", Quantity::Reflectance.name());
    }
    command
}
