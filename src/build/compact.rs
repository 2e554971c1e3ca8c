//! Compression of a finished database: the last stage of a build, and a command of its own.
//! Writes the compact file, and reports on database and file.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use ndarray::{Array2, ArrayView2, Axis};
use serde_json::{Map, Value, json};

use super::BuildError;
use super::report::{CompactReport, LostShare, QuantityReport};
use crate::batch::BatchError;
use crate::colour::{Colorimeter, Viewing};
use crate::compress::{
    self, AnisotropyFactors, Bands, Choice, CompactFile, CompactVariant, CompressError, Compressed,
    CurveBlocks,
};
use crate::grid::{Compression, absent_curves, existing_rows, why_absent};
use crate::lookup::{Basis, Database, DirectionalQuantity};
use crate::measurement::Quantity;
use crate::parameter::{Axes, Parameter};
use crate::store::{COMPACT, DIFFUSE, Store, VIEWS, VIEWS_DIFFUSE, Variable};
use crate::threads::threads;
use crate::units::cm_text;

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

/// Compresses the finished database in `dir` and writes its compact file; also those of
/// diffuse light and of the anisotropy factors toward views, if the database has them. Existing files are replaced. The bytes depend on
/// the database and `request` alone.
///
/// # Errors
/// [`BuildError`] if jobs are missing, another process is working in `dir`, or the error
/// bounds cannot be met.
pub fn compress(
    dir: impl AsRef<Path>,
    request: &CompressionRequest,
) -> Result<CompactReport, BuildError> {
    let store = Store::open_exclusive(dir.as_ref())?;
    check_finished(&store)?;
    let report = write(&store, request, threads(None)?)?;
    store.delete_tables();
    Ok(report)
}

/// Refuses a database with jobs that are missing in its arrays. Reads all its files.
fn check_finished(store: &Store) -> Result<(), BuildError> {
    check_none_missing(store, store.missing()?.len())
}

/// Refuses a database with `missing` jobs if there are any.
pub(super) fn check_none_missing(store: &Store, missing: usize) -> Result<(), BuildError> {
    match missing {
        0 => Ok(()),
        missing => Err(BuildError::Unfinished {
            missing,
            jobs: store.jobs().count(),
            path: store.path().into(),
        }),
    }
}

/// Compresses the database in `store`, whose jobs must all be done, on `threads` threads, and
/// writes its compact files. No other process may be writing to the store.
pub(super) fn write(
    store: &Store,
    request: &CompressionRequest,
    threads: usize,
) -> Result<CompactReport, BuildError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| BatchError::Threads(error.to_string()))?;
    pool.install(|| write_parts(store, request))
}

fn write_parts(store: &Store, request: &CompressionRequest) -> Result<CompactReport, BuildError> {
    let part = |is_diffuse, is_view| {
        let part = Part {
            is_diffuse,
            is_view,
        };
        write_part(store, request, part)
    };
    let of_light = |is_diffuse| -> Result<_, BuildError> {
        let mut report = part(is_diffuse, false)?;
        if !store.views().is_empty() {
            report.views = Some(Box::new(part(is_diffuse, true)?));
        }
        Ok(report)
    };
    let mut report = of_light(false)?;
    if store.has_diffuse() {
        report.diffuse = Some(Box::new(of_light(true)?));
    }
    Ok(report)
}

/// The existing curves of a database, read from its packs.
struct StoredCurves<'a> {
    store: &'a Store,
    variable: Variable,
    /// Numbers of the curves, increasing.
    rows: &'a [usize],
}

impl CurveBlocks for StoredCurves<'_> {
    fn shape(&self) -> (usize, usize) {
        (self.rows.len(), self.store.wavelengths_nm().len())
    }

    fn visit(
        &self,
        visit: &mut dyn FnMut(ArrayView2<f64>) -> Result<(), CompressError>,
    ) -> Result<(), CompressError> {
        let (mut first, mut rows) = (0, self.rows);
        self.store.visit(self.variable, &mut |block: Array2<f32>| {
            let end = first + block.nrows();
            let (own, rest) = rows.split_at(rows.partition_point(|row| *row < end));
            let own: Vec<usize> = own.iter().map(|row| row - first).collect();
            (first, rows) = (end, rest);
            let curves = block.select(Axis(0), &own).mapv(f64::from);
            visit(curves.view())
        })
    }
}

/// The part of a database that one compact file holds.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// The curves under diffuse light instead of those at the incidence angles.
    is_diffuse: bool,
    /// The anisotropy factors toward views instead of reflectance and transmittance.
    is_view: bool,
}

impl Part {
    /// Name of its compact file.
    fn file(self) -> &'static str {
        match (self.is_view, self.is_diffuse) {
            (false, false) => COMPACT,
            (false, true) => DIFFUSE,
            (true, false) => VIEWS,
            (true, true) => VIEWS_DIFFUSE,
        }
    }

    /// The array of its values for `quantity`.
    fn variable(self, quantity: Quantity) -> Variable {
        Variable {
            is_diffuse: self.is_diffuse,
            is_view: self.is_view,
            ..Variable::of(quantity)
        }
    }

    /// The axes of its file. Look-ups of diffuse light use a single angle and azimuth.
    fn axes(self, store: &Store) -> Axes {
        let views = store.views().iter().filter(|_| self.is_view);
        let axes = store.axes().iter().chain(views);
        axes.map(|(parameter, values)| match parameter {
            Parameter::Incidence | Parameter::RelativeAzimuth if self.is_diffuse => {
                (parameter, vec![0.0])
            }
            _ => (parameter, values.to_vec()),
        })
        .collect()
    }
}

/// The bytes of the compact file of anisotropy factors, under diffuse or collimated light, that
/// [`compress`] writes for the finished database in `store`.
pub(crate) fn view_file(
    store: &Store,
    request: &CompressionRequest,
    is_diffuse: bool,
) -> Result<Vec<u8>, BuildError> {
    let part = Part {
        is_diffuse,
        is_view: true,
    };
    check_finished(store)?;
    Ok(CompressedPart::new(store, request, part)?
        .file(store)
        .to_bytes()?)
}

/// A compressed part of a database, with the metadata of its file.
struct CompressedPart {
    axes: Axes,
    variant: CompactVariant,
    transmittance: Option<Compressed>,
    reflectance: Option<Compressed>,
    max_standard_errors: [f32; 2],
    provenance: String,
    extra: BTreeMap<String, String>,
}

impl CompressedPart {
    /// Depends on the database and `request` alone. No other process may be writing to the store.
    fn new(store: &Store, request: &CompressionRequest, part: Part) -> Result<Self, BuildError> {
        let colour = Colorimeter::viewing(store.wavelengths_nm(), &request.viewing)?;
        let variant = CompactVariant {
            basis: match part.is_view {
                true => Basis::Linear,
                false => request.variant.basis,
            },
            ..request.variant
        };
        let axes = part.axes(store);
        let rows = existing_rows(&axes, store.absent());
        let mut max_standard_errors = [0.0; 2];
        let mut compressed = |quantity: Quantity| -> Result<_, BuildError> {
            if !request.quantities.contains(&quantity) {
                return Ok(None);
            }
            let variable = part.variable(quantity);
            let row_count = axes.count() as usize;
            let bands = Bands::new(store.wavelengths_nm());
            let (colour, choice) = (colour.as_ref(), request.choice);
            let max_standard_error = &mut max_standard_errors[quantity as usize];
            // standard errors of curves that do not exist are NaN, which `f32::max` ignores
            let largest = |errors: &Array2<f32>| errors.iter().copied().fold(0.0, f32::max);
            let compressed = if part.is_view {
                let (errors, values) = (store.read(variable.se())?, store.read(variable)?);
                let hemispherical = Variable {
                    is_view: false,
                    ..variable
                };
                let totals = store.read(hemispherical)?;
                let factors = AnisotropyFactors::new(values.view(), errors.view(), totals.view());
                *max_standard_error = largest(&factors.errors);
                factors.compress(&rows, quantity, colour, &bands, choice, variant)
            } else {
                let mut bands = bands;
                store.visit(variable.se(), &mut |errors| -> Result<(), BuildError> {
                    *max_standard_error = max_standard_error.max(largest(&errors));
                    bands = std::mem::take(&mut bands).with_noise(errors.view());
                    Ok(())
                })?;
                let bands = match choice {
                    Choice::Bounds(bounds) => bands.bounded(bounds.max_rmse),
                    Choice::Components(_) => bands,
                };
                let curves = StoredCurves {
                    store,
                    variable,
                    rows: &rows,
                };
                compress::compress(curves, quantity, colour, &bands, choice, variant)
            };
            compressed
                .map(|compressed| Some(compressed.spread_over(&rows, row_count)))
                .map_err(|source| BuildError::Compress { quantity, source })
        };
        let transmittance = compressed(Quantity::Transmittance)?;
        let reflectance = compressed(Quantity::Reflectance)?;
        let (provenance, mut extra) = metadata(store, request.choice, &request.viewing);
        if part.is_diffuse {
            let light =
                "diffuse: isotropic radiance; the one angle_deg, 0, stands for all directions";
            extra.insert("illumination".to_owned(), light.to_owned());
        }
        Ok(Self {
            axes,
            variant,
            transmittance,
            reflectance,
            max_standard_errors,
            provenance,
            extra,
        })
    }

    /// The compact file of this part of `store`.
    fn file<'a>(&'a self, store: &'a Store) -> CompactFile<'a> {
        CompactFile {
            axes: &self.axes,
            absent: store.absent(),
            wavelengths_nm: store.wavelengths_nm(),
            substrate: store.substrate(),
            transmittance: self.transmittance.as_ref(),
            reflectance: self.reflectance.as_ref(),
            provenance: &self.provenance,
            extra: &self.extra,
        }
    }
}

/// Compresses a part of `store` and writes its compact file. No other process may be writing to
/// the store.
fn write_part(
    store: &Store,
    request: &CompressionRequest,
    part: Part,
) -> Result<CompactReport, BuildError> {
    let compressed = CompressedPart::new(store, request, part)?;
    let compact = store.dir().join(part.file());
    compressed.file(store).write(&compact)?;
    let CompressedPart {
        axes,
        variant,
        transmittance,
        reflectance,
        max_standard_errors,
        ..
    } = compressed;
    let jobs = store.jobs();
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
        database_bytes: store.estimated_bytes(),
        curves: axes.count(),
        absent_curves: absent_curves(&axes, store.absent()),
        why_absent: why_absent(&axes, store.absent()),
        wavelengths: jobs.wavelengths(),
        compact_bytes,
        compact,
        basis: variant.basis,
        precision: variant.precision,
        transmittance: report(Quantity::Transmittance, transmittance),
        reflectance: report(Quantity::Reflectance, reflectance),
        lost_share: LostShare::of(store)?,
        next: query_command(store, request, part),
        diffuse: None,
        views: None,
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
fn query_command(store: &Store, request: &CompressionRequest, part: Part) -> String {
    let mut command = format!("splitsnow query {}", store.dir().display());
    if part.is_diffuse {
        command.push_str(" --diffuse");
    }
    // the axes that every database has come first
    let axes = part.axes(store);
    let (optional, core): (Vec<_>, Vec<_>) = axes.iter().partition(|(p, _)| p.is_optional());
    for (parameter, values) in core.into_iter().chain(optional) {
        let no_effect = [Parameter::Incidence, Parameter::RelativeAzimuth];
        if part.is_diffuse && no_effect.contains(&parameter) {
            continue;
        }
        let is_thickness = parameter == Parameter::Thickness;
        // of the first grain size, the thinnest slab that is thick enough for its grains
        let thin_count = store.absent().first().filter(|_| is_thickness);
        let first = values.get(thin_count.copied().unwrap_or_default());
        let first = first.copied().unwrap_or_default();
        let text = match is_thickness {
            true => cm_text(first),
            false => first.to_string(),
        };
        let _ = write!(command, " --{} {text}", parameter.record().option);
    }
    let has_both = request.quantities.contains(&Quantity::Transmittance);
    let quantity = match (part.is_view, has_both) {
        (false, true) => return command,
        (false, false) => Quantity::Reflectance.name(),
        (true, _) if request.quantities.contains(&Quantity::Reflectance) => {
            DirectionalQuantity::ReflectanceFactor.name(part.is_diffuse)
        }
        (true, _) => DirectionalQuantity::TransmittanceFactor.name(part.is_diffuse),
    };
    let _ = write!(command, " --quantity {quantity}");
    command
}
