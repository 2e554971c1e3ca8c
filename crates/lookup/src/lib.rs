//! Look-ups in compact snow databases: what a renderer needs.
//!
//! A compact file (`snow.safetensors`) holds spectra of transmittance and reflectance on a
//! grid of snow parameters. [`Database`] reads the file and returns spectra at its nodes.
//! [`Lookup`] interpolates anywhere within the axes (method `smooth`). [`Varsa2025`]
//! interpolates with the method published in Varsa 2025 (docs/methods.md).
//!
//! ```no_run
//! use splitsnow_lookup::{Database, Lookup, Parameter, Point, Quantity};
//!
//! # fn main() -> Result<(), splitsnow_lookup::LookupError> {
//! let database = Database::open("out/quick")?; // or the path of a file
//! let lookup = Lookup::new(&database, Quantity::Transmittance)?;
//! let mut spectrum = vec![0.0; lookup.wavelengths()];
//! let point = Point::from([
//!     (Parameter::Facetness, 0.3),
//!     (Parameter::GrainSize, 250.0),
//!     (Parameter::Density, 275.0),
//!     (Parameter::Thickness, 7.5),
//!     (Parameter::Incidence, 33.0),
//! ]);
//! lookup.spectrum(point, &mut spectrum)?;
//! # Ok(())
//! # }
//! ```
mod absent;
mod anisotropy;
mod basis;
mod conditions;
mod diffusion;
mod directions;
pub mod format;
mod header;
mod monotone;
mod nodes;
pub mod parameter;
mod precision;
mod read;
mod smooth;
mod varsa2025;

use absent::{MissingCurve, absent_error, missing_curve};
pub use anisotropy::Anisotropy;
pub use basis::Basis;
pub use directions::{DirectionalQuantity, Directions};
pub use format::SubstrateKind;
pub use parameter::{Axes, Interval, Parameter, Point, Region};
use precision::f16_to_f32;
pub use precision::{Precision, dequantised};
pub use read::FormatError;
pub use smooth::Lookup;
pub use splitsnow_spectra::Quantity;
pub use varsa2025::Varsa2025;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ndarray::{Array2, ArrayView1, ArrayView2};
use splitsnow_spectra::units::cm_text;
use thiserror::Error;

/// File name of the compact file in an output directory.
pub const COMPACT: &str = "snow.safetensors";
/// File name of the compact file of the curves under diffuse light.
pub const DIFFUSE: &str = "diffuse.safetensors";
/// File name of the compact file of anisotropy factors in an output directory.
pub const VIEWS: &str = "views.safetensors";
/// File name of the compact file of anisotropy factors under diffuse light.
pub const VIEWS_DIFFUSE: &str = "views_diffuse.safetensors";

/// What the nodes of an axis cover, as text.
fn covered(axis: &str, first: f64, last: f64) -> String {
    let text = |value: f64| match axis == Parameter::Thickness.name() {
        true => cm_text(value),
        false => value.to_string(),
    };
    match first == last {
        true => format!("has {} only", text(first)),
        false => format!("covers {} to {}", text(first), text(last)),
    }
}

/// An error of a look-up, or of reading the database.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LookupError {
    /// The file could not be read.
    #[error("cannot read {}: {source}; give a compact file, or the output directory of `splitsnow build` or `tailor`", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The directory has no compact file.
    #[error("no {COMPACT} in {}; run `splitsnow build`, which writes it once all jobs are done", path.display())]
    NoCompactFile {
        /// The directory.
        path: PathBuf,
    },
    /// The file is not a compact file that this version can read.
    #[error("{} cannot be used as a compact snow database: {source}; give a file that `splitsnow build` or `tailor` wrote, or write it again", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The defect of the file.
        source: FormatError,
    },
    /// A coordinate outside the range of its axis.
    #[error(
        "{axis} = {value} is outside the database, which {}; give a value in this range, or build a database with a longer axis",
        covered(axis, *first, *last)
    )]
    Outside {
        /// Name of the axis.
        axis: &'static str,
        /// The requested value.
        value: f64,
        /// First node.
        first: f64,
        /// Last node.
        last: f64,
    },
    /// A coordinate between two nodes.
    #[error(
        "{axis} = {value} lies between the nodes {below} and {above} of the database; this look-up answers at nodes only; use the method `smooth` to interpolate"
    )]
    BetweenNodes {
        /// Name of the axis.
        axis: &'static str,
        /// The requested value.
        value: f64,
        /// The node below.
        below: f64,
        /// The node above.
        above: f64,
    },
    /// No value is given for an optional axis with several nodes.
    #[error("the database has an axis {axis}: give a value of {axis} from {first} to {last}")]
    MissingCondition {
        /// Name of the axis.
        axis: &'static str,
        /// First node.
        first: f64,
        /// Last node.
        last: f64,
    },
    /// A value is given for an axis that is not in the database.
    #[error(
        "the database has no axis {axis}: its value was fixed when the database was built; leave {axis} out"
    )]
    NoAxis {
        /// Name of the axis.
        axis: &'static str,
    },
    /// The look-up table would exceed 1 GiB.
    #[error(
        "the look-up table of this file would take {bytes} bytes, more than 1 GB; use fewer wavelengths or nodes, or compress the database with --basis log"
    )]
    TooLarge {
        /// Size of the table, bytes.
        bytes: u128,
    },
    /// The look-up needs a curve that does not exist.
    #[error(
        "the file has no spectrum for grains of {grain_size_um} um in {thickness_cm} cm of snow: grains of the node {node_um} um do not fit into {}; use thicker snow or smaller grains",
        least_cm.map_or_else(|| "any slab of the file".to_owned(), |cm| format!("a slab thinner than {cm} cm"))
    )]
    Absent {
        /// The requested grain size, um.
        grain_size_um: f64,
        /// The requested thickness, cm.
        thickness_cm: f64,
        /// Grain-size node without the curve, um.
        node_um: f64,
        /// The thinnest thickness node with a curve at that grain size, cm; `None` if there is none.
        least_cm: Option<f64>,
    },
    /// The file holds anisotropy factors where reflectance and transmittance are needed, or the
    /// other way round.
    #[error("the compact file holds {found}, not {expected}; {}", if *has_views { format!("give {COMPACT} instead, or look up with Directions") } else { format!("give {VIEWS} or {VIEWS_DIFFUSE} instead, which `splitsnow build` writes for a grid with axes.view_deg") })]
    Content {
        /// What the file holds.
        found: &'static str,
        /// What the look-up needs.
        expected: &'static str,
        /// Whether the file has views.
        has_views: bool,
    },
    /// Two files do not belong together.
    #[error("the two compact files have different {difference}; give files of the same build")]
    Mismatch {
        /// Name of the axis that differs.
        difference: &'static str,
    },
    /// The file does not hold the requested quantity.
    #[error("the compact file has no {}, it has {} only; ask for that, or make a file with both", missing.name(), stored.name())]
    NoQuantity {
        /// The requested quantity.
        missing: Quantity,
        /// The quantity that the file holds.
        stored: Quantity,
    },
    /// A matrix or spectrum whose shape does not match the database.
    #[error("expected {expected} {dimension} as in the compact file, found {found}")]
    Shape {
        /// The dimension: curves or wavelengths.
        dimension: &'static str,
        /// Number of them in the file.
        expected: usize,
        /// Number of them given.
        found: usize,
    },
}

/// One quantity: a row of `coefficients` times `basis`^T gives a spectrum. Empty
/// if the file does not hold the quantity.
#[derive(Debug, Clone, PartialEq, Default)]
struct Factors {
    /// `[s, l']`.
    coefficients: Array2<f32>,
    /// `[l, l']`.
    basis: Array2<f32>,
}

impl Factors {
    /// Adds row `row` of the coefficients times the basis to `sum` (`[l]`).
    fn add_row(&self, row: usize, sum: &mut [f64]) {
        let coefficients = self.coefficients.row(row);
        for (&coefficient, vector) in coefficients.iter().zip(self.basis.columns()) {
            add_component(sum, coefficient, vector);
        }
    }
}

/// A compact file in memory, fully validated.
#[derive(Debug, Clone, PartialEq)]
pub struct Database {
    axes: Axes,
    /// For each grain size, the number of thinnest thicknesses without a curve; empty if
    /// every curve exists.
    absent: Vec<usize>,
    wavelengths_nm: Vec<f64>,
    curves: usize,
    kind: Basis,
    precision: Precision,
    transmittance: Arc<Factors>,
    reflectance: Arc<Factors>,
    has_black_substrate: bool,
    metadata: BTreeMap<String, String>,
}

impl Database {
    /// Reads the file at `path`, or [`COMPACT`] in the directory at `path`.
    ///
    /// # Errors
    /// [`LookupError::Io`] if the file cannot be read, [`LookupError::NoCompactFile`] if the
    /// directory has none, [`LookupError::Format`] if the file is not a valid compact file.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, LookupError> {
        let path = path.as_ref();
        if !path.is_dir() {
            return Self::open_file(path);
        }
        let file = path.join(COMPACT);
        if !file.exists() {
            return Err(LookupError::NoCompactFile { path: path.into() });
        }
        Self::open_file(&file)
    }

    fn open_file(path: &Path) -> Result<Self, LookupError> {
        let io = |source| LookupError::Io {
            path: path.to_owned(),
            source,
        };
        let format = |source| LookupError::Format {
            path: path.to_owned(),
            source,
        };
        // Check the type before opening: opening a pipe waits for its writer.
        let status = std::fs::metadata(path).map_err(io)?;
        if !status.is_file() {
            return Err(format(FormatError::NotAFile));
        }
        let mut file = File::open(path).map_err(io)?;
        // Reject a large file of another kind by its first bytes.
        let mut bytes = Vec::new();
        (&mut file).take(8).read_to_end(&mut bytes).map_err(io)?;
        read::header_length(&bytes, status.len()).map_err(format)?;
        file.read_to_end(&mut bytes).map_err(io)?;
        Self::from_bytes(&bytes).map_err(format)
    }

    /// Reads the content of a file. For any input it does not panic, and allocates at most
    /// a small multiple of the length of `bytes`.
    ///
    /// # Errors
    /// A [`FormatError`] if the bytes are not a valid compact file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        read::read(bytes)
    }

    /// A database of uncompressed curves (`[s, l]`, stored in single precision). A quantity
    /// given as `None` is not in the database; for `has_black_substrate` see
    /// [`Database::has_black_substrate`].
    #[must_use]
    pub fn from_curves(
        has_black_substrate: bool,
        axes: &Axes,
        wavelengths_nm: &[f64],
        transmittance: Option<&Array2<f64>>,
        reflectance: Option<&Array2<f64>>,
    ) -> Self {
        let factors = |curves: Option<&Array2<f64>>| {
            curves.map_or_else(Factors::default, |curves| Factors {
                coefficients: curves.mapv(|v| v as f32),
                basis: Array2::eye(wavelengths_nm.len()),
            })
        };
        Self {
            curves: axes.count() as usize,
            axes: axes.clone(),
            absent: Vec::new(),
            wavelengths_nm: wavelengths_nm.to_vec(),
            kind: Basis::Linear,
            precision: Precision::F32,
            transmittance: factors(transmittance).into(),
            reflectance: factors(reflectance).into(),
            has_black_substrate,
            metadata: BTreeMap::new(),
        }
    }

    /// This database with some curves marked as absent. `absent` holds, for each grain size,
    /// the number of thinnest thicknesses without a curve; the values of these are ignored.
    #[must_use]
    pub fn with_absent(self, absent: &[usize]) -> Self {
        Self {
            absent: absent.to_vec(),
            ..self
        }
    }

    /// For each grain size, the number of thinnest thicknesses without a curve because
    /// the grains do not fit into the slab; empty if every curve exists.
    #[must_use]
    pub fn absent(&self) -> &[usize] {
        &self.absent
    }

    /// Whether curve `row` exists.
    #[must_use]
    pub fn exists(&self, row: usize) -> bool {
        let [.., thicknesses, angles] = self.axes.core_shape();
        let absent = self.absent.get(self.size_of(row)).copied();
        row / angles % thicknesses >= absent.unwrap_or_default()
    }

    /// The index of the grain size of curve `row`.
    fn size_of(&self, row: usize) -> usize {
        let [_, sizes, densities, thicknesses, angles] = self.axes.core_shape();
        row / (angles * thicknesses * densities) % sizes
    }

    /// Whether all curves exist that the method `smooth` needs for this grain size and
    /// thickness.
    #[must_use]
    pub fn covers(&self, grain_size_um: f64, thickness_cm: f64) -> bool {
        missing_curve(&self.absent, &self.axes, grain_size_um, thickness_cm).is_none()
    }

    /// Checks that the file holds `quantity`.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`] if it does not.
    pub fn require(&self, quantity: Quantity) -> Result<(), LookupError> {
        if self.has(quantity) {
            return Ok(());
        }
        Err(LookupError::NoQuantity {
            missing: quantity,
            stored: match quantity {
                Quantity::Transmittance => Quantity::Reflectance,
                Quantity::Reflectance => Quantity::Transmittance,
            },
        })
    }

    /// Whether the spectra are anisotropy factors, for [`Anisotropy`].
    #[must_use]
    pub fn holds_anisotropy(&self) -> bool {
        self.axes.has(Parameter::View)
    }

    /// Checks that the file does not hold anisotropy factors.
    ///
    /// # Errors
    /// [`LookupError::Content`] if it does.
    pub fn require_hemispherical(&self) -> Result<(), LookupError> {
        self.require_content(false)
    }

    /// Checks that the file holds anisotropy factors, or reflectance and transmittance.
    fn require_content(&self, anisotropy: bool) -> Result<(), LookupError> {
        const KINDS: [&str; 2] = ["reflectance and transmittance", "anisotropy factors"];
        let has_views = self.holds_anisotropy();
        if has_views == anisotropy {
            return Ok(());
        }
        Err(LookupError::Content {
            found: KINDS[usize::from(has_views)],
            expected: KINDS[usize::from(anisotropy)],
            has_views,
        })
    }

    /// Wavelengths, nm, `[l]`, strictly increasing.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// The axes and their nodes.
    #[must_use]
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// Number of curves, s: the product of the lengths of all axes.
    #[must_use]
    pub fn curves(&self) -> usize {
        self.curves
    }

    /// Whether the slab lies on a black substrate, with no other layers. At thickness 0
    /// the transmittance is then 1 and the reflectance 0, so look-ups extend down to
    /// thickness 0; otherwise they start at the first node. Read from the metadata
    /// `substrate`.
    #[must_use]
    pub fn has_black_substrate(&self) -> bool {
        self.has_black_substrate
    }

    /// What a row of coefficients times basis^T represents.
    #[must_use]
    pub fn basis_kind(&self) -> Basis {
        self.kind
    }

    /// Number format of the coefficients in the file.
    #[must_use]
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Whether the file holds `quantity`. Every file holds at least one.
    #[must_use]
    pub fn has(&self, quantity: Quantity) -> bool {
        self.components(quantity) > 0
    }

    /// Number of components of `quantity`, l'; 0 if the file does not hold it.
    #[must_use]
    pub fn components(&self, quantity: Quantity) -> usize {
        self.basis(quantity).ncols()
    }

    /// Coefficients of `quantity`, `[s, l']`, converted to f32; `[0, 0]` if the file does
    /// not hold the quantity.
    #[must_use]
    pub fn coefficients(&self, quantity: Quantity) -> ArrayView2<'_, f32> {
        self.factors(quantity).coefficients.view()
    }

    /// Basis of `quantity`, `[l, l']`; `[0, 0]` if the file does not hold the quantity.
    #[must_use]
    pub fn basis(&self, quantity: Quantity) -> ArrayView2<'_, f32> {
        self.factors(quantity).basis.view()
    }

    /// The file's metadata, strings by name (`error_table`, `provenance`, ...).
    #[must_use]
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The spectrum of `quantity` at a node of the axes, `[l]`. Each coordinate must match
    /// a node to within 1e-6 of the node's value.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`] if the file does not hold `quantity`,
    /// [`LookupError::Absent`] if the curve does not exist, and the errors of
    /// [`Database::row`].
    pub fn spectrum(&self, point: Point, quantity: Quantity) -> Result<Vec<f32>, LookupError> {
        self.require(quantity)?;
        let row = self.row(point)?;
        if !self.exists(row) {
            let missing = MissingCurve::at_size(self.size_of(row), &self.absent, &self.axes);
            return Err(absent_error(missing, point));
        }
        Ok(self.curve(row, quantity).unwrap_or_default())
    }

    /// The row of the curve at a node: the inverse of [`Database::point`]. An optional axis
    /// with a single node needs no value.
    ///
    /// # Errors
    /// [`LookupError::Outside`] and [`LookupError::BetweenNodes`] for a coordinate that is
    /// not on a node; [`LookupError::MissingCondition`] and [`LookupError::NoAxis`] as in
    /// [`Database::at`].
    pub fn row(&self, point: Point) -> Result<usize, LookupError> {
        self.require_axes_of(&point)?;
        let mut row = 0;
        for (parameter, nodes) in self.axes.iter() {
            let node = match point.get(parameter) {
                None if parameter.is_optional() && nodes.len() == 1 => 0,
                None if parameter.is_optional() => return Err(missing_value(parameter, nodes)),
                _ => nodes::find(parameter.key(), nodes, point[parameter])?,
            };
            row = row * nodes.len() + node;
        }
        Ok(row)
    }

    /// The coordinates of curve `row`; `None` if there is no such row.
    #[must_use]
    pub fn point(&self, row: usize) -> Option<Point> {
        (row < self.curves).then(|| self.axes.point(row as u64))
    }

    /// The spectrum of curve `row`, `[l]`, computed with the same arithmetic as the error
    /// table. `None` if there is no such row or the file does not hold `quantity`; all NaN
    /// if the curve does not exist ([`Database::exists`]).
    #[must_use]
    pub fn curve(&self, row: usize, quantity: Quantity) -> Option<Vec<f32>> {
        let factors = self.factors(quantity);
        if row >= factors.coefficients.nrows() {
            return None;
        }
        let mut sum = vec![0.0; factors.basis.nrows()];
        if !self.exists(row) {
            return Some(vec![f32::NAN; sum.len()]);
        }
        factors.add_row(row, &mut sum);
        let value = |sum| self.kind.value(quantity, sum) as f32;
        Some(sum.into_iter().map(value).collect())
    }

    fn factors(&self, quantity: Quantity) -> &Arc<Factors> {
        match quantity {
            Quantity::Transmittance => &self.transmittance,
            Quantity::Reflectance => &self.reflectance,
        }
    }
}

/// Adds one component to the reconstruction of a spectrum. The product of two f32 is
/// exact in f64, and components are added in order, so the reconstruction is
/// bit-identical to the one behind the error table.
pub fn add_component(sum: &mut [f64], coefficient: f32, vector: ArrayView1<f32>) {
    for (sum, &v) in sum.iter_mut().zip(vector) {
        *sum += f64::from(coefficient) * f64::from(v);
    }
}

/// The error of a point without a value on an axis with several nodes.
fn missing_value(parameter: Parameter, nodes: &[f64]) -> LookupError {
    LookupError::MissingCondition {
        axis: parameter.key(),
        first: nodes.first().copied().unwrap_or(f64::NAN),
        last: nodes.last().copied().unwrap_or(f64::NAN),
    }
}
