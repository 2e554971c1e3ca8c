//! The writer of the compact file.
//!
//! The header is written here, not by the `safetensors` crate: that one keeps
//! metadata in a hash map, so that no two files would have the same bytes.
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use ndarray::Array2;
use serde_json::{Value, json};
use thiserror::Error;

use super::format::{
    AXES, BASIS_LINEAR, BOUNDS, Coordinate, ERROR_TABLE, FORMAT, FORMAT_VERSION, MAX_HEADER,
    MAX_NUMBER, PROVENANCE, WAVELENGTHS, axis_order, basis_name, coefficients_name, components_key,
    number,
};
use super::{Bounds, Compressed, ErrorTable};
use crate::atomic;
use crate::grid::Axes;
use crate::measurement::Quantity;

/// Why a compact file could not be written.
#[derive(Debug, Error)]
pub enum CompactError {
    /// What is to be written does not fit together.
    #[error("the compact file cannot be written: {0}")]
    Content(String),
    /// The header could not be put into JSON.
    #[error("the header of the compact file cannot be written: {0}")]
    Header(#[from] serde_json::Error),
    /// The system refused.
    #[error("cannot write {}: {source}; the file that was there, if any, is untouched", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// What a compact file is made of. Its bytes are a function of these fields.
#[derive(Debug, Clone, Copy)]
pub struct CompactFile<'a> {
    /// The axes of the database; kept as f32.
    pub axes: &'a Axes,
    /// Wavelengths, nm; kept as f32.
    pub wavelengths_nm: &'a [f64],
    /// Compressed transmittance, one row per cell of the axes.
    pub transmittance: &'a Compressed,
    /// Compressed reflectance, likewise.
    pub reflectance: &'a Compressed,
    /// Where the numbers come from: the JSON of [`crate::store::Store::attributes`].
    pub provenance: &'a str,
    /// Further metadata (illumination, bottom boundary, ...); none of the
    /// format's own keys.
    pub extra: &'a BTreeMap<String, String>,
}

impl CompactFile<'_> {
    /// Writes the file, replacing `path` as a whole or not at all.
    ///
    /// # Errors
    /// See [`CompactError`].
    pub fn write(&self, path: &Path) -> Result<(), CompactError> {
        atomic::write(path, &self.to_bytes()?).map_err(|source| CompactError::Io {
            path: path.to_owned(),
            source,
        })
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// [`CompactError::Content`] and [`CompactError::Header`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, CompactError> {
        let wavelengths = rounded(&WAVELENGTHS, self.wavelengths_nm)?;
        let mut curves: usize = 1;
        // Sorted by name: the order of the header and of the data.
        let mut tensors = BTreeMap::new();
        for (coordinate, values) in AXES.iter().zip(self.axis_values()) {
            curves = curves.saturating_mul(values.len());
            let values = rounded(coordinate, values)?;
            tensors.insert(coordinate.name.to_owned(), (vec![values.len()], values));
        }
        for (quantity, compressed) in self.quantities() {
            let Compressed {
                coefficients,
                basis,
                ..
            } = compressed;
            let components = compressed.components();
            let shapes = [
                (
                    coefficients_name(quantity),
                    coefficients,
                    [curves, components],
                ),
                (basis_name(quantity), basis, [wavelengths.len(), components]),
            ];
            for (name, matrix, shape) in shapes {
                check_matrix(&name, matrix, shape)?;
                // Logical order is row-major, whatever the layout in memory.
                let values = matrix.iter().copied().collect();
                tensors.insert(name, (shape.to_vec(), values));
            }
        }
        tensors.insert(
            WAVELENGTHS.name.to_owned(),
            (vec![wavelengths.len()], wavelengths),
        );

        let mut header = BTreeMap::from([("__metadata__".to_owned(), self.metadata()?)]);
        let mut data = Vec::new();
        for (name, (shape, values)) in tensors {
            let begin = data.len();
            data.extend(values.iter().flat_map(|v| v.to_le_bytes()));
            let entry =
                json!({"dtype": "F32", "shape": shape, "data_offsets": [begin, data.len()]});
            header.insert(name, entry);
        }
        let mut header = serde_json::to_vec(&header)?;
        header.resize(header.len().next_multiple_of(8), b' ');
        if header.len() > MAX_HEADER {
            let problem = format!(
                "its metadata take {} bytes; at most {MAX_HEADER} are allowed",
                header.len()
            );
            return Err(CompactError::Content(problem));
        }
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.append(&mut header);
        bytes.append(&mut data);
        Ok(bytes)
    }

    fn quantities(&self) -> [(Quantity, &Compressed); 2] {
        Quantity::ALL.map(|quantity| match quantity {
            Quantity::Transmittance => (quantity, self.transmittance),
            Quantity::Reflectance => (quantity, self.reflectance),
        })
    }

    /// Values in the order of [`AXES`].
    fn axis_values(&self) -> [&[f64]; 5] {
        let axes = self.axes;
        [
            &axes.facetness,
            &axes.grain_size_um,
            &axes.density_kg_m3,
            &axes.thickness_cm,
            &axes.angle_deg,
        ]
    }

    /// `__metadata__`: strings by name.
    fn metadata(&self) -> Result<Value, CompactError> {
        let tables: BTreeMap<&str, &ErrorTable> =
            self.quantities().map(|(q, c)| (q.name(), &c.table)).into();
        let bounds: BTreeMap<&str, Bounds> =
            self.quantities().map(|(q, c)| (q.name(), c.bounds)).into();
        let mut units = BTreeMap::from(AXES.map(|axis| (axis.name, axis.unit)));
        units.insert(WAVELENGTHS.name, WAVELENGTHS.unit);
        units.extend(Quantity::ALL.map(|quantity| (quantity.name(), "1")));

        let mut entries = BTreeMap::from([
            ("format".to_owned(), FORMAT.to_owned()),
            ("format_version".to_owned(), FORMAT_VERSION.to_owned()),
            ("axis_order".to_owned(), axis_order()),
            ("units".to_owned(), serde_json::to_string(&units)?),
            ("basis".to_owned(), BASIS_LINEAR.to_owned()),
            (ERROR_TABLE.to_owned(), serde_json::to_string(&tables)?),
            (BOUNDS.to_owned(), serde_json::to_string(&bounds)?),
            (PROVENANCE.to_owned(), self.provenance.to_owned()),
        ]);
        for (quantity, compressed) in self.quantities() {
            entries.insert(
                components_key(quantity),
                compressed.components().to_string(),
            );
        }
        for (key, value) in self.extra {
            if entries.insert(key.clone(), value.clone()).is_some() {
                let problem = format!("`{key}` is a metadata key of the format itself");
                return Err(CompactError::Content(problem));
            }
        }
        Ok(serde_json::to_value(entries)?)
    }
}

/// `values` as f32, if a reader accepts them.
fn rounded(coordinate: &Coordinate, values: &[f64]) -> Result<Vec<f32>, CompactError> {
    let values: Vec<f32> = values.iter().map(|&v| v as f32).collect();
    coordinate.check(&values).map_err(CompactError::Content)?;
    Ok(values)
}

/// Whether a matrix has the shape and the kind of numbers a reader accepts.
fn check_matrix(name: &str, matrix: &Array2<f32>, shape: [usize; 2]) -> Result<(), CompactError> {
    if matrix.shape() != shape {
        let problem = format!("{name} has the shape {:?}, not {shape:?}", matrix.shape());
        return Err(CompactError::Content(problem));
    }
    if let Some(bad) = matrix.iter().find(|v| !number(**v)) {
        let problem =
            format!("{name} has the value {bad}, which is not finite or above {MAX_NUMBER:e}");
        return Err(CompactError::Content(problem));
    }
    Ok(())
}
