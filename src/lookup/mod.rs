//! Reading a compact file and looking spectra up in it (docs/methods.md): at its
//! nodes as it stands ([`Database`]), anywhere in its box by our method
//! ([`Lookup`]) or by the published one ([`Varsa2025`]).
mod absent;
mod conditions;
mod coordinates;
mod diffusion;
mod fidelity;
mod format;
mod monotone;
mod nodes;
mod smooth;
mod varsa2025;

use absent::{Gap, absent, gap};
pub(crate) use conditions::{exact, spread_beyond};
pub use coordinates::spread;
pub use fidelity::{BandErrors, CurveErrors, errors_of};
pub use format::FormatError;
pub use nodes::Point;
pub use smooth::Lookup;
pub use varsa2025::Varsa2025;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use ndarray::{Array2, ArrayView2};
use thiserror::Error;

use crate::compress::{AXES, Basis, Precision, add_component};
use crate::grid::{Axes, ExtraAxis};
use crate::measurement::Quantity;

/// Why a look-up gave no spectrum.
#[derive(Debug, Error)]
pub enum LookupError {
    /// The system refused to read the file.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
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
        first: f32,
        /// Last node.
        last: f32,
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
        below: f32,
        /// The node above.
        above: f32,
    },
    /// A value that must be told, on an axis beyond the five.
    #[error("the database has an axis {axis}, from {first} to {last}: say where on it")]
    Condition {
        /// Name of the axis.
        axis: &'static str,
        /// First node.
        first: f32,
        /// Last node.
        last: f32,
    },
    /// A value of an axis beyond the five that the file has not.
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
        node_um: f32,
        /// The thinnest node that it has.
        least_cm: Option<f32>,
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
    axes: [Vec<f32>; 5],
    /// For each grain size, how many of the thinnest thicknesses have no curve; empty if
    /// all have.
    absent: Vec<usize>,
    /// Slower than the five.
    extra: BTreeMap<ExtraAxis, Vec<f32>>,
    wavelengths_nm: Vec<f32>,
    curves: usize,
    kind: Basis,
    precision: Precision,
    transmittance: Factors,
    reflectance: Factors,
    stands_free: bool,
    metadata: BTreeMap<String, String>,
}

impl Database {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`LookupError::Io`] and [`LookupError::Format`].
    pub fn open(path: &Path) -> Result<Self, LookupError> {
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
        format::header_length(&bytes, status.len()).map_err(format)?;
        file.read_to_end(&mut bytes).map_err(io)?;
        Self::from_bytes(&bytes).map_err(format)
    }

    /// Reads the content of a file. Never panics, and never allocates more than
    /// a small multiple of `bytes`, whatever they are.
    ///
    /// # Errors
    /// See [`FormatError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FormatError> {
        format::read(bytes)
    }

    /// A database of these very curves (`[s, l]`, in single precision), for look-ups
    /// that no compression touches. What is `None` it does not hold; for `stands_free`
    /// see [`Database::stands_free`].
    #[must_use]
    pub fn from_curves(
        stands_free: bool,
        axes: &Axes,
        wavelengths_nm: &[f64],
        transmittance: Option<&Array2<f64>>,
        reflectance: Option<&Array2<f64>>,
    ) -> Self {
        let single = |values: &[f64]| values.iter().map(|v| *v as f32).collect();
        let factors = |curves: Option<&Array2<f64>>| {
            curves.map_or_else(Factors::default, |curves| Factors {
                coefficients: curves.mapv(|v| v as f32),
                basis: Array2::eye(wavelengths_nm.len()),
            })
        };
        Self {
            curves: (axes.combinations() * axes.shape().iter().product::<u64>()) as usize,
            extra: axes
                .extra
                .iter()
                .map(|(axis, values)| (*axis, single(values)))
                .collect(),
            axes: axes.named().map(|(_, values)| single(values)),
            absent: Vec::new(),
            wavelengths_nm: single(wavelengths_nm),
            kind: Basis::Linear,
            precision: Precision::F32,
            transmittance: factors(transmittance),
            reflectance: factors(reflectance),
            stands_free,
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
        let [.., thicknesses, angles] = self.axes.each_ref().map(Vec::len);
        let absent = self.absent.get(self.size_of(row)).copied();
        row / angles % thicknesses >= absent.unwrap_or_default()
    }

    /// The index of the grain size of curve `row`.
    fn size_of(&self, row: usize) -> usize {
        let [_, sizes, densities, thicknesses, angles] = self.axes.each_ref().map(Vec::len);
        row / (angles * thicknesses * densities) % sizes
    }

    /// Whether all curves exist that the look-up `smooth` needs for these.
    #[must_use]
    pub fn covers(&self, grain_size_um: f64, thickness_cm: f64) -> bool {
        let [size, thickness] = [grain_size_um, thickness_cm].map(|v| v as f32);
        gap(&self.absent, &self.axes, size, thickness).is_none()
    }

    /// [`LookupError::NoQuantity`] unless the file holds `quantity`.
    fn require(&self, quantity: Quantity) -> Result<(), LookupError> {
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
    pub fn wavelengths_nm(&self) -> &[f32] {
        &self.wavelengths_nm
    }

    /// Nodes of the five axes, in the order of [`AXES`], slowest first.
    #[must_use]
    pub fn axes(&self) -> &[Vec<f32>; 5] {
        &self.axes
    }

    /// Number of curves, s: the product of the lengths of all axes.
    #[must_use]
    pub fn curves(&self) -> usize {
        self.curves
    }

    /// Whether there is nothing but the snow of the axes, over black ground: without
    /// snow, transmittance is then 1 and reflectance 0, and look-ups reach down to a
    /// thickness of 0; otherwise they begin at the first node. The metadata
    /// `bottom_boundary` says so, by beginning with `black` or by its absence.
    #[must_use]
    pub fn stands_free(&self) -> bool {
        self.stands_free
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
    /// on a node within 1e-6 of the node's value (the axes are f32).
    ///
    /// # Errors
    /// [`LookupError::NoQuantity`], [`LookupError::Absent`], and those of
    /// [`Database::row`].
    pub fn spectrum(&self, point: Point, quantity: Quantity) -> Result<Vec<f32>, LookupError> {
        self.expect(quantity)?;
        let row = self.row(point)?;
        if !self.exists(row) {
            return Err(absent(
                Gap::of(self.size_of(row), &self.absent, &self.axes),
                point,
            ));
        }
        Ok(self.curve(row, quantity).unwrap_or_default())
    }

    /// The row of the curve at a node: [`Database::point`] inverted.
    ///
    /// # Errors
    /// [`LookupError::Outside`] and [`LookupError::BetweenNodes`];
    /// [`LookupError::Condition`] if the five axes do not tell the row
    /// ([`Database::at`]).
    pub fn row(&self, point: Point) -> Result<usize, LookupError> {
        self.single()?;
        let mut row = 0;
        for ((axis, nodes), value) in AXES.iter().zip(&self.axes).zip(point.coordinates()) {
            row = row * nodes.len() + nodes::find(axis.name, nodes, value)?;
        }
        Ok(row)
    }

    /// The node of curve `row` on the five axes; `None` beyond the last one.
    #[must_use]
    pub fn point(&self, row: usize) -> Option<Point> {
        let mut rest = row;
        let mut coordinates = [0.0; 5];
        for (coordinate, nodes) in coordinates.iter_mut().zip(&self.axes).rev() {
            *coordinate = f64::from(*nodes.get(rest % nodes.len())?);
            rest /= nodes.len();
        }
        (row < self.curves).then(|| Point::from_coordinates(coordinates))
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

    /// Refuses a quantity that is not there.
    fn expect(&self, quantity: Quantity) -> Result<(), LookupError> {
        let mut all = Quantity::ALL.into_iter();
        match all.find(|&other| self.has(other)) {
            Some(there) if !self.has(quantity) => Err(LookupError::NoQuantity {
                missing: quantity,
                there,
            }),
            _ => Ok(()),
        }
    }

    fn factors(&self, quantity: Quantity) -> &Factors {
        match quantity {
            Quantity::Transmittance => &self.transmittance,
            Quantity::Reflectance => &self.reflectance,
        }
    }
}
