//! NetCDF with the conventions CF-1.11.
use std::cell::RefCell;
use std::io::{Cursor, Seek, SeekFrom, Write};
use std::rc::Rc;

use netcdf3::error::WriteError;
use netcdf3::{DataSet, FileWriter, Version};

use super::{ExportError, ExportTable};
use crate::parameter::Parameter;
use crate::store::{WAVELENGTH, coordinate_about};

/// Largest array, bytes: even with 64-bit offsets, sizes are signed 32-bit numbers.
const LARGEST: u64 = i32::MAX as u64;
/// Largest total size for 32-bit offsets, which every reader supports, bytes. The remainder
/// to 2 GiB is left for attributes.
const CLASSIC: u64 = 2_000_000_000;
/// Attributes of a database or compact file that do not apply to the export.
const OMITTED: [&str; 6] = [
    "axis_order",
    "format",
    "format_version",
    "quantities",
    "source",
    "units",
];
/// Definition of reflectance and transmittance, as a global attribute.
const NORMALISATION: &str = "directional-hemispherical: the power that leaves a side of the slab in all directions, as a share of the power that falls onto it";

/// `table` as the bytes of a NetCDF file in the classic format, with 64-bit offsets if it
/// needs them.
///
/// # Errors
/// [`ExportError::TooLarge`] for an array above 2 GiB; [`ExportError::Encoding`] if the library
/// fails.
pub fn netcdf(table: &ExportTable) -> Result<Vec<u8>, ExportError> {
    let version = version(table.sizes())?;
    let set = table.definition().map_err(failed)?;
    written(&set, version, |writer| {
        for (name, values) in &table.axes {
            writer.write_var_f64(name, values)?;
        }
        for (variable, array) in &table.quantities {
            let values: Vec<f32> = array.iter().copied().collect();
            writer.write_var_f32(variable.name(), &values)?;
        }
        Ok(())
    })
}

/// The bytes of a file with this definition, whose variables `fill` writes.
pub(super) fn written(
    set: &DataSet,
    version: Version,
    fill: impl FnOnce(&mut FileWriter) -> Result<(), WriteError>,
) -> Result<Vec<u8>, ExportError> {
    let buffer = Buffer::default();
    let writer = FileWriter::open_seek_write("memory", Box::new(buffer.clone()));
    let mut writer = writer.map_err(failed)?;
    writer.set_def(set, version, 0).map_err(failed)?;
    fill(&mut writer).map_err(failed)?;
    writer.close().map_err(failed)?;
    let mut bytes = buffer.0.take().into_inner();
    fill_with_nan(&mut bytes);
    Ok(bytes)
}

/// Placeholder for NaN in the attribute [`FILL`]. The library compares variables by their
/// attributes, so a NaN would make a variable differ from itself.
pub(super) const STAND_IN: f32 = -1.267_650_6e30;
/// Name of the attribute with the value that marks missing data.
pub(super) const FILL: &str = "_FillValue";

/// Replaces [`STAND_IN`] by NaN in every attribute [`FILL`]. The value follows the padded name,
/// the type, and the number of values, 1.
fn fill_with_nan(bytes: &mut [u8]) {
    const NAME: &[u8] = b"\0\0\0\x0a_FillValue\0\0";
    let (single, double) = (STAND_IN.to_be_bytes(), f64::from(STAND_IN).to_be_bytes());
    let matches = bytes.windows(NAME.len()).enumerate();
    let matches = matches.filter(|(_, window)| *window == NAME);
    let offsets: Vec<usize> = matches.map(|(start, _)| start + NAME.len() + 8).collect();
    for offset in offsets {
        let Some((_, value)) = bytes.split_at_mut_checked(offset) else {
            continue;
        };
        if value.starts_with(&single) {
            value[..4].copy_from_slice(&f32::NAN.to_be_bytes());
        } else if value.starts_with(&double) {
            value[..8].copy_from_slice(&f64::NAN.to_be_bytes());
        }
    }
}

/// Converts an error of the library.
pub(super) fn failed<E: std::fmt::Debug>(error: E) -> ExportError {
    ExportError::encoding("NetCDF")(error)
}

/// The version of the format that holds arrays with these names and sizes (bytes).
pub(super) fn version<'a>(
    arrays: impl Iterator<Item = (&'a str, u64)>,
) -> Result<Version, ExportError> {
    let mut total = 0_u64;
    for (name, bytes) in arrays {
        if bytes > LARGEST {
            return Err(ExportError::TooLarge {
                name: name.into(),
                bytes,
                limit: LARGEST,
            });
        }
        total += bytes;
    }
    Ok(if total > CLASSIC {
        Version::Offset64Bit
    } else {
        Version::Classic
    })
}

impl ExportTable {
    /// Names and sizes (bytes) of all arrays.
    fn sizes(&self) -> impl Iterator<Item = (&str, u64)> {
        let axes = self.axes.iter();
        let axes = axes.map(|(name, values)| (*name, 8 * values.len() as u64));
        let quantities = self.quantities.iter();
        axes.chain(quantities.map(|(variable, array)| (variable.name(), 4 * array.len() as u64)))
    }

    /// Dimensions, variables and attributes.
    fn definition(&self) -> Result<DataSet, netcdf3::error::InvalidDataSet> {
        let mut set = DataSet::new();
        for (name, text) in self.global() {
            set.add_global_attr_string(&name, text)?;
        }
        for (name, values) in &self.axes {
            let (long_name, units) = coordinate_about(name);
            set.add_fixed_dim(*name, values.len())?;
            set.add_var_f64(name, &[*name])?;
            set.add_var_attr_string(name, "long_name", long_name)?;
            set.add_var_attr_string(name, "units", units)?;
            if *name == WAVELENGTH {
                set.add_var_attr_string(name, "standard_name", "radiation_wavelength")?;
            }
            if *name == Parameter::View.name() {
                set.add_var_attr_string(name, "standard_name", "sensor_zenith_angle")?;
            }
        }
        for (variable, array) in &self.quantities {
            let name = variable.name();
            let dimensions: Vec<_> = self.dimensions(*variable).map(|(axis, _)| axis).collect();
            set.add_var_f32(name, &dimensions)?;
            set.add_var_attr_string(name, "long_name", variable.long_name())?;
            set.add_var_attr_string(name, "units", "1")?;
            if array.iter().any(|value| value.is_nan()) {
                set.add_var_attr_f32(name, FILL, vec![STAND_IN])?;
            }
            let mut others = self.quantities.iter();
            let error = variable.se();
            if let Some((error, _)) = others.find(|(other, _)| Some(*other) == error) {
                set.add_var_attr_string(name, "ancillary_variables", error.name())?;
            }
        }
        Ok(set)
    }

    /// Global attributes: those of CF, the definitions of the numbers, and the other
    /// attributes of the exported file.
    pub(super) fn global(&self) -> Vec<(String, String)> {
        let version = env!("CARGO_PKG_VERSION");
        let attribute = |key: &str, default: &str| {
            let text = self.attributes.get(key);
            text.map_or(default, String::as_str).to_owned()
        };
        let own = [
            ("Conventions", "CF-1.11".to_owned()),
            ("title", attribute("title", "Spectral database of snow")),
            (
                "source",
                "first-principles Monte Carlo model of light in snow, splitsnow".to_owned(),
            ),
            (
                "history",
                format!(
                    "written by splitsnow export {version}, without a time so that equal inputs give equal bytes"
                ),
            ),
            (
                "references",
                attribute(
                    "source",
                    "P. M. Varsa, PhD thesis, University of Waterloo, 2025",
                ),
            ),
            (
                "illumination",
                attribute(
                    "illumination",
                    "collimated; angle_deg is the polar angle of incidence, measured from the surface normal",
                ),
            ),
            ("bottom_boundary", attribute("bottom_boundary", "black")),
            ("normalisation", NORMALISATION.to_owned()),
            ("wavelengths", "in vacuum".to_owned()),
        ];
        let is_omitted = |key: &String| {
            own.iter().any(|(name, _)| name == key) || OMITTED.contains(&key.as_str())
        };
        let others = self.attributes.iter().filter(|(key, _)| !is_omitted(key));
        let others: Vec<_> = others
            .map(|(key, text)| (key.replace('.', "_"), text.clone()))
            .collect();
        let own = own.into_iter().map(|(key, text)| (key.to_owned(), text));
        own.chain(others).collect()
    }
}

/// A shared buffer: the writer of the library owns one handle, and the caller reads the other.
#[derive(Debug, Clone, Default)]
struct Buffer(Rc<RefCell<Cursor<Vec<u8>>>>);

impl Write for Buffer {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for Buffer {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.0.borrow_mut().seek(to)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::export::ExportLayout;
    use crate::export::table::tests::database;

    #[test]
    fn read_back_by_the_library() {
        let table = ExportTable::of_compact(&database())
            .unwrap()
            .with_layout(ExportLayout::Crtm);
        let bytes = netcdf(&table).unwrap();
        let file = Box::new(Cursor::new(bytes));
        let mut reader = netcdf3::FileReader::open_seek_read("memory", file).unwrap();
        let set = reader.data_set();
        assert_eq!(
            set.get_global_attr_as_string("Conventions").unwrap(),
            "CF-1.11"
        );
        let names = set.get_var("reflectance").unwrap().dim_names();
        assert_eq!(names[2..], ExportLayout::CRTM);
        let values = reader.read_var_f32("reflectance").unwrap();
        let expected: Vec<f32> = table.quantities[1].1.iter().copied().collect();
        assert_eq!(values, expected);
        assert_eq!(reader.read_var_f64("facetness").unwrap(), [0.1, 0.9]);
    }

    #[test]
    fn missing_curves_are_nan_and_so_is_the_fill_value() {
        let mut table = ExportTable::of_compact(&database()).unwrap();
        table.quantities[1].1.fill(f32::NAN);
        let bytes = netcdf(&table).unwrap();
        let mut reader =
            netcdf3::FileReader::open_seek_read("memory", Box::new(Cursor::new(bytes))).unwrap();
        let fill = |name| {
            reader
                .data_set()
                .get_var_attr_f32(name, FILL)
                .map(<[f32]>::to_vec)
        };
        assert_eq!(fill("transmittance"), None);
        assert!(fill("reflectance").unwrap()[0].is_nan());
        let values = reader.read_var_f32("reflectance").unwrap();
        assert!(values.iter().all(|value| value.is_nan()));
    }

    #[test]
    fn arrays_larger_than_the_format_are_refused() {
        let version_for =
            |sizes: &[u64]| version(sizes.iter().map(|bytes| ("transmittance", *bytes)));
        assert_eq!(version_for(&[1_000_000_000; 2]).unwrap(), Version::Classic);
        assert_eq!(
            version_for(&[1_000_000_001; 2]).unwrap(),
            Version::Offset64Bit
        );
        assert_eq!(version_for(&[LARGEST; 4]).unwrap(), Version::Offset64Bit);
        let refused = version_for(&[8, LARGEST + 1]).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "the array transmittance takes 2147483648 bytes, and NetCDF in its classic format holds at most 2147483647 in one; read the database itself (Zarr), or export to npz"
        );
    }
}
