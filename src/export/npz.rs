//! NPZ: arrays for NumPy in a ZIP archive of `.npy` files (NEP 1, version 1.0).
use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::{ExportError, ExportTable};

/// `table` as the bytes of an uncompressed `.npz` file. It holds float64 axes and float32
/// quantities by name; the dimensions have the order of the axes, without those that a quantity does not have.
///
/// # Errors
/// [`ExportError::Encoding`] if the archive cannot be written.
pub fn npz(table: &ExportTable) -> Result<Vec<u8>, ExportError> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, values) in &table.axes {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        add(&mut archive, name, "<f8", &[values.len()], bytes.collect())?;
    }
    for (variable, array) in &table.quantities {
        let bytes = array.iter().flat_map(|value| value.to_le_bytes());
        let shape: Vec<usize> = table.dimensions(*variable).map(|(_, n)| n).collect();
        add(
            &mut archive,
            variable.name(),
            "<f4",
            &shape,
            bytes.collect(),
        )?;
    }
    let buffer = archive.finish().map_err(ExportError::encoding("npz"))?;
    Ok(buffer.into_inner())
}

/// Adds an array of the NumPy type `kind` to the archive.
fn add(
    archive: &mut ZipWriter<Cursor<Vec<u8>>>,
    name: &str,
    kind: &str,
    shape: &[usize],
    data: Vec<u8>,
) -> Result<(), ExportError> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default())
        .large_file(data.len() > 1 << 31);
    let started = archive.start_file(format!("{name}.npy"), options);
    started.map_err(ExportError::encoding("npz"))?;
    let written = archive.write_all(&header(kind, shape));
    let written = written.and_then(|()| archive.write_all(&data));
    written.map_err(ExportError::encoding("npz"))
}

/// The header of a `.npy` file: type and shape as a Python dictionary, padded so that the data
/// begins at a multiple of 64 bytes.
fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let shape: String = shape.iter().map(|n| format!("{n},")).collect();
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // Magic, version, length and the final newline take 11 bytes.
    let length = (text.len() + 11).next_multiple_of(64) - 10;
    text.extend(std::iter::repeat_n(' ', length - 1 - text.len()));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    // At most a dozen axes of 20 digits, so the length is far below 65536.
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_end_at_64_bytes() {
        for shape in [&[3][..], &[2; 7], &[1_000_000_000; 9]] {
            let bytes = header("<f4", shape);
            assert_eq!(bytes.len() % 64, 0);
            let length = u16::from_le_bytes([bytes[8], bytes[9]]);
            assert_eq!(usize::from(length) + 10, bytes.len());
            assert_eq!(bytes.last(), Some(&b'\n'));
        }
        let text = String::from_utf8_lossy(&header("<f8", &[3])).into_owned();
        assert!(text.contains("{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }"));
    }
}
