//! Look-ups in compact snow databases: what a renderer needs.
//!
//! A compact file (`snow.safetensors`) holds spectra of transmittance and reflectance on a
//! lattice of snow parameters. [`Database`] reads it and answers on its nodes, [`Lookup`]
//! anywhere in its box by our method, [`Varsa2025`] by the published one (docs/methods.md).
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
mod basis;
mod conditions;
mod diffusion;
pub mod format;
mod header;
mod monotone;
mod nodes;
pub mod parameter;
mod precision;
mod read;
mod smooth;
mod varsa2025;

use absent::{Gap, absent, gap};
pub use basis::Basis;
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

use ndarray::{Array2, ArrayView1, ArrayView2};
use thiserror::Error;

/// The compact file in an output directory.
pub const COMPACT: &str = "snow.safetensors";

/// Why a look-up gave no spectrum.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LookupError {
    /// The system refused to read the file.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A directory without a compact file.
    #[error("no {COMPACT} in {}; `splitsnow build` makes it once all jobs are done", path.display())]
    NoCompactFile {
        /// The directory.
        path: PathBuf,
    },
    /// The file is not a compact file that this version reads.
    #[error("{} cannot be used as a compact snow database: {source}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: FormatError,
    },
    /// A coordinate outside the database.
    #[error("{axis} = {value} is outside the database, which covers {first} to {last}")]
    Outside {
        /// Name of the axis.
        axis: &'static str,
        /// What was asked for.
        value: f64,
        /// First node.
        first: f64,
        /// Last node.
        last: f64,
    },
    /// A coordinate between two nodes.
    #[error(
        "{axis} = {value} lies between the nodes {below} and {above} of the database, and this look-up knows nodes only; the method `smooth` interpolates"
    )]
    BetweenNodes {
        /// Name of the axis.
        axis: &'static str,
        /// What was asked for.
        value: f64,
        /// The node below.
        below: f64,
        /// The node above.
        above: f64,
    },
    /// A value that must be told, on an axis that a database may leave out.
    #[error("the database has an axis {axis}, from {first} to {last}: say where on it")]
    Condition {
        /// Name of the axis.
        axis: &'static str,
        /// First node.
        first: f64,
        /// Last node.
        last: f64,
    },
    /// A value on an axis that the file does not have.
    #[error("the database has no axis {axis}: its snow is as it was built; leave it out")]
    NoAxis {
        /// Name of the axis.
        axis: &'static str,
    },
    /// A table that does not fit into memory.
    #[error(
        "the look-up table of this file would take {bytes} bytes, more than 1 GB; give fewer wavelengths or nodes, or compress the database with --basis log"
    )]
    TooLarge {
        /// Its size.
        bytes: u128,
    },
    /// A curve that does not exist would be needed.
    #[error(
        "the file has no answer for grains of {grain_size_um} um in {thickness_cm} cm: grains of the node {node_um} um do not fit into a slab thinner than {}; ask for thicker snow or smaller grains",
        least_cm.map_or_else(|| "all of the file".to_owned(), |cm| format!("{cm} cm"))
    )]
    Absent {
        /// What was asked for.
        grain_size_um: f64,
        /// What was asked for.
        thickness_cm: f64,
        /// Node of the grain size that lacks it.
        node_um: f64,
        /// The thinnest node that it has.
        least_cm: Option<f64>,
    },
    /// A quantity that the file does not hold.
    #[error("the compact file has no {}, it has {} only", missing.name(), there.name())]
    NoQuantity {
        /// What was asked for.
        missing: Quantity,
        /// What there is.
        there: Quantity,
    },
    /// A matrix or spectrum of another shape than the database.
    #[error("expected {expected} {what} as in the compact file, found {found}")]
    Shape {
        /// Curves or wavelengths.
        what: &'static str,
        /// How many the file has.
        expected: usize,
        /// How many were given.
        found: usize,
    },
}

/// One quantity: a row of `coefficients` times `basis`^T gives a spectrum. Empty
/// if the file does not hold it.
#[derive(Debug, Clone, PartialEq, Default)]
struct Factors {
    /// `[s, l']`.
    coefficients: Array2<f32>,
    /// `[l, l']`.
    basis: Array2<f32>,
}

/// A compact file in memory, wholly checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Database {
    axes: Axes,
    /// For each grain size, how many of the thinnest thicknesses have no curve; empty if
    /// all have.
    absent: Vec<usize>,
    wavelengths_nm: Vec<f64>,
    curves: usize,
    kind: Basis,
    precision: Precision,
    transmittance: Factors,
    reflectance: Factors,
    has_black_substrate: bool,
    metadata: BTreeMap<String, String>,
}

impl Database {
    /// Reads the file at `path`, or [`COMPACT`] in the directory at `path`.
    ///
    /// # Errors
    /// [`LookupError::Io`], [`LookupError::NoCompactFile`] and [`LookupError::Format`].
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
        // Before opening: to open a pipe is to wait for its writer.
        let status = std::fs::metadata(path).map_err(io)?;
        if !status.is_file() {
            return Err(format(FormatError::NotAFile));
        }
        let mut file = File::open(path).map_err(io)?;
        // A large file of another kind is refused by its first bytes.
        let mut bytes = Vec::new();
        (&mut file).take(8).read_to_end(&mut bytes).map_err(io)?;
        read::header_length(&bytes, status.len()).map_err(format)?;
        file.read_to_end(&mut bytes).map_err(io)?;
        Self::from_bytes(&bytes).map_err(format)
    }

    /// Reads the content of a file. Never panics, and never allocates more than
    /// a small multiple of `bytes`, whatever they are.
    ///
    /// # Errors
    /// See [`FormatError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        read::read(bytes)
    }

    /// A database of these very curves (`[s, l]`, in single precision), for look-ups
    /// that no compression touches. What is `None` it does not hold; for `has_black_substrate`
    /// see [`Database::has_black_substrate`].
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
            transmittance: factors(transmittance),
            reflectance: factors(reflectance),
            has_black_substrate,
            metadata: BTreeMap::new(),
        }
    }

    /// The same of which the curves that `absent` counts do not exist, whatever they
    /// hold: for each grain size, how many of the thinnest thicknesses.
    #[must_use]
    pub fn without(self, absent: &[usize]) -> Self {
        Self {
            absent: absent.to_vec(),
            ..self
        }
    }

    /// For each grain size, how many of the thinnest thicknesses have no curve, since
    /// the grains do not fit into the slab; empty if all have.
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

    /// Whether all curves exist that the look-up `smooth` needs for these.
    #[must_use]
    pub fn covers(&self, grain_size_um: f64, thickness_cm: f64) -> bool {
        gap(&self.absent, &self.axes, grain_size_um, thickness_cm).is_none()
    }

    /// Refuses a quantity that the file does not hold.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`].
    pub fn require(&self, quantity: Quantity) -> Result<(), LookupError> {
        if self.has(quantity) {
            return Ok(());
        }
        Err(LookupError::NoQuantity {
            missing: quantity,
            there: match quantity {
                Quantity::Transmittance => Quantity::Reflectance,
                Quantity::Reflectance => Quantity::Transmittance,
            },
        })
    }

    /// Wavelengths, nm, `[l]`, strictly increasing.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// The axes with their nodes.
    #[must_use]
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// Number of curves, s: the product of the lengths of all axes.
    #[must_use]
    pub fn curves(&self) -> usize {
        self.curves
    }

    /// Whether there is nothing but the snow of the axes, over black substrate: without
    /// snow, transmittance is then 1 and reflectance 0, and look-ups reach down to a
    /// thickness of 0; otherwise they begin at the first node. The metadata
    /// `substrate` says so.
    #[must_use]
    pub fn has_black_substrate(&self) -> bool {
        self.has_black_substrate
    }

    /// What a row of coefficients times the basis^T is.
    #[must_use]
    pub fn basis_kind(&self) -> Basis {
        self.kind
    }

    /// Numbers in which the file holds its coefficients.
    #[must_use]
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Whether the file holds `quantity`; it holds at least one.
    #[must_use]
    pub fn has(&self, quantity: Quantity) -> bool {
        self.components(quantity) > 0
    }

    /// Number of components of `quantity`, l'; 0 if the file does not hold it.
    #[must_use]
    pub fn components(&self, quantity: Quantity) -> usize {
        self.basis(quantity).ncols()
    }

    /// Coefficients of `quantity`, `[s, l']`, whatever their precision in the
    /// file; `[0, 0]` if it does not hold it.
    #[must_use]
    pub fn coefficients(&self, quantity: Quantity) -> ArrayView2<'_, f32> {
        self.factors(quantity).coefficients.view()
    }

    /// Basis of `quantity`, `[l, l']`; `[0, 0]` if the file does not hold it.
    #[must_use]
    pub fn basis(&self, quantity: Quantity) -> ArrayView2<'_, f32> {
        self.factors(quantity).basis.view()
    }

    /// The file's metadata, strings by name (`error_table`, `provenance`, ...).
    #[must_use]
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.metadata
    }

    /// The spectrum of `quantity` at a node of the axes, `[l]`. A coordinate is
    /// on a node within 1e-6 of the node's value.
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`], [`LookupError::Absent`], and those of
    /// [`Database::row`].
    pub fn spectrum(&self, point: Point, quantity: Quantity) -> Result<Vec<f32>, LookupError> {
        self.require(quantity)?;
        let row = self.row(point)?;
        if !self.exists(row) {
            let gap = Gap::of(self.size_of(row), &self.absent, &self.axes);
            return Err(absent(gap, point));
        }
        Ok(self.curve(row, quantity).unwrap_or_default())
    }

    /// The row of the curve at a node: [`Database::point`] inverted. An axis of one node
    /// that a database may leave out need not be told.
    ///
    /// # Errors
    /// [`LookupError::Outside`] and [`LookupError::BetweenNodes`];
    /// [`LookupError::Condition`] and [`LookupError::NoAxis`] as in [`Database::at`].
    pub fn row(&self, point: Point) -> Result<usize, LookupError> {
        self.has_axes_of(&point)?;
        let mut row = 0;
        for (parameter, nodes) in self.axes.iter() {
            let node = match point.get(parameter) {
                None if parameter.is_optional() && nodes.len() == 1 => 0,
                None if parameter.is_optional() => return Err(untold(parameter, nodes)),
                _ => nodes::find(parameter.key(), nodes, point[parameter])?,
            };
            row = row * nodes.len() + node;
        }
        Ok(row)
    }

    /// The node of curve `row`; `None` beyond the last one.
    #[must_use]
    pub fn point(&self, row: usize) -> Option<Point> {
        (row < self.curves).then(|| self.axes.point(row as u64))
    }

    /// The spectrum of curve `row`, `[l]`, in the arithmetic in which the error table
    /// was made; `None` beyond the last one, and if the file does not hold `quantity`.
    /// NaN if the curve does not exist ([`Database::exists`]).
    #[must_use]
    pub fn curve(&self, row: usize, quantity: Quantity) -> Option<Vec<f32>> {
        let Factors {
            coefficients,
            basis,
        } = self.factors(quantity);
        let coefficients = (row < coefficients.nrows()).then(|| coefficients.row(row))?;
        if !self.exists(row) {
            return Some(vec![f32::NAN; basis.nrows()]);
        }
        let mut sum = vec![0.0; basis.nrows()];
        for (&coefficient, vector) in coefficients.iter().zip(basis.columns()) {
            add_component(&mut sum, coefficient, vector);
        }
        let value = |sum| self.kind.value(quantity, sum) as f32;
        Some(sum.into_iter().map(value).collect())
    }

    fn factors(&self, quantity: Quantity) -> &Factors {
        match quantity {
            Quantity::Transmittance => &self.transmittance,
            Quantity::Reflectance => &self.reflectance,
        }
    }
}

/// Adds one component to a spectrum being rebuilt. Products of two f32 are exact
/// in f64; components are added in order, so that the errors of a table and of a
/// reader agree to the last bit.
pub fn add_component(sum: &mut [f64], coefficient: f32, vector: ArrayView1<f32>) {
    for (sum, &v) in sum.iter_mut().zip(vector) {
        *sum += f64::from(coefficient) * f64::from(v);
    }
}

/// The error of a point that does not say where on an axis of several nodes.
fn untold(parameter: Parameter, nodes: &[f64]) -> LookupError {
    LookupError::Condition {
        axis: parameter.key(),
        first: nodes.first().copied().unwrap_or(f64::NAN),
        last: nodes.last().copied().unwrap_or(f64::NAN),
    }
}
