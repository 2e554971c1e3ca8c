//! The compact file: compression, writing and reading.
#![allow(clippy::unwrap_used)]
mod bands;
mod beyond;
mod compression;
mod damage;
mod layout;
mod variants;

use std::collections::BTreeMap;

use ndarray::{Array2, ArrayView2};
use proptest::prelude::*;
use safetensors::SafeTensors;
use splitsnow::colour::Colorimeter;
use splitsnow::compress::{
    self, Bands, Choice, CompactFile, CompactVariant, CompressError, Compressed,
    StoredCoefficients, curve_errors,
};
use splitsnow::grid::Compression;
use splitsnow::lookup::{Database, LookupError, SubstrateKind};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};

const BOUNDS: Choice = Choice::Bounds(Compression {
    max_delta_e: 2.3,
    max_rmse: None,
});

fn axes() -> Axes {
    Axes::from([
        (Parameter::Facetness, vec![0.1, 0.3]),
        (Parameter::GrainSize, vec![100.0, 250.0, 500.0]),
        (Parameter::Density, vec![200.0, 400.0]),
        (Parameter::Thickness, vec![1.0, 1.5, 50.0]),
        (Parameter::Incidence, vec![0.0, 40.0, 89.0]),
    ])
}

fn wavelengths() -> Vec<f64> {
    (40..=70).map(|i| f64::from(i) * 10.0).collect()
}

fn colour() -> Colorimeter {
    Colorimeter::new(&wavelengths()).unwrap().unwrap()
}

/// Curves similar to transmittances: exponentials of a smooth absorption.
fn curves() -> Array2<f64> {
    let axes = axes();
    let mut rows = Vec::new();
    for &facetness in axes.values(Parameter::Facetness) {
        for &size in axes.values(Parameter::GrainSize) {
            for &density in axes.values(Parameter::Density) {
                for &thickness in axes.values(Parameter::Thickness) {
                    for &angle in axes.values(Parameter::Incidence) {
                        let cosine = angle.to_radians().cos();
                        let level = 1.0 / (1.0 + density * thickness / size / cosine.max(0.2));
                        let path = thickness.sqrt() * (1.0 - facetness / 2.0) * 0.3;
                        rows.extend(wavelengths().iter().map(|w| {
                            level
                                * (-path * (w / 700.0).powi(6)).exp()
                                * (1.0 + 1e-4 * (w * size).sin())
                        }));
                    }
                }
            }
        }
    }
    Array2::from_shape_vec((rows.len() / 31, 31), rows).unwrap()
}

/// Compresses transmittances in the default variant.
fn compress(
    curves: ArrayView2<f64>,
    colour: Option<&Colorimeter>,
    choice: Choice,
) -> Result<Compressed, CompressError> {
    let variant = CompactVariant::default();
    let bands = Bands::default();
    compress::compress(
        curves,
        Quantity::Transmittance,
        colour,
        &bands,
        choice,
        variant,
    )
}

fn compressed(choice: Choice) -> Compressed {
    compress(curves().view(), Some(&colour()), choice).unwrap()
}

fn bytes_of(transmittance: &Compressed, reflectance: &Compressed) -> Vec<u8> {
    CompactFile {
        axes: &axes(),
        absent: &[],
        wavelengths_nm: &wavelengths(),
        substrate: SubstrateKind::Black,
        transmittance: Some(transmittance),
        reflectance: Some(reflectance),
        provenance: r#"{"engine":"spectral","seed":1}"#,
        extra: &BTreeMap::from([("illumination".to_owned(), "collimated".to_owned())]),
    }
    .to_bytes()
    .unwrap()
}

/// A valid compact file.
fn valid() -> Vec<u8> {
    bytes_of(&compressed(BOUNDS), &compressed(Choice::Components(5)))
}

#[test]
fn files_are_valid_safetensors_and_reproducible() {
    let bytes = valid();
    assert_eq!(bytes, valid());
    assert_eq!(
        usize::from(bytes[0]) % 8,
        0,
        "the header is padded to 8 bytes"
    );
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let metadata = header.metadata().as_ref().unwrap();
    assert_eq!(metadata["format"], "splitsnow-compact");
    assert_eq!(metadata["format_version"], "2");
    assert_eq!(metadata["substrate"], "black");
    assert_eq!(metadata["basis"], "linear");
    assert_eq!(metadata["precision"], "f32");
    assert_eq!(metadata["quantities"], "transmittance,reflectance");
    assert_eq!(metadata["reflectance.components"], "5");
    assert_eq!(metadata["illumination"], "collimated");
    assert_eq!(
        metadata["axis_order"],
        "facetness,grain_size_um,density_kg_m3,thickness_cm,angle_deg"
    );
    let table: serde_json::Value = serde_json::from_str(&metadata["error_table"]).unwrap();
    assert_eq!(table["reflectance"]["chosen"], 5);
    assert_eq!(
        metadata["bounds"],
        r#"{"reflectance":{"max_delta_e":null,"max_rmse":null},"transmittance":{"max_delta_e":2.3,"max_rmse":null}}"#
    );
    assert_eq!(table["transmittance"]["rows"][0]["components"], 1);
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    assert_eq!(
        tensors.tensor("reflectance.coefficients").unwrap().shape(),
        [108, 5]
    );
    assert_eq!(
        tensors.tensor("reflectance.basis").unwrap().shape(),
        [31, 5]
    );
    let angle = tensors.tensor("angle_deg").unwrap();
    assert_eq!(angle.data()[8..16], 40.0_f64.to_le_bytes());
    assert_eq!(tensors.len(), 10);
}

#[test]
fn written_spectra_have_the_errors_of_the_table() {
    let transmittance = compressed(BOUNDS);
    let reflectance = compressed(Choice::Components(5));
    let database = Database::from_bytes(&bytes_of(&transmittance, &reflectance)).unwrap();
    assert_eq!(database.curves(), 108);
    for (quantity, compressed) in [
        (Quantity::Transmittance, &transmittance),
        (Quantity::Reflectance, &reflectance),
    ] {
        assert_eq!(database.components(quantity), compressed.components());
        let errors = curve_errors(&database, quantity, curves().view(), Some(&colour())).unwrap();
        let row = compressed.table.rows[compressed.components() - 1];
        let largest = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        // The errors of the table equal those of the reader, to the last bit.
        let colours = errors.delta_e.unwrap();
        let delta_e = row.delta_e.unwrap();
        assert_eq!(largest(&errors.rmse), row.rmse.max);
        assert_eq!(mean(&errors.rmse), row.rmse.mean);
        assert_eq!(errors.rmse[row.rmse.worst_curve], row.rmse.max);
        assert_eq!(largest(&colours), delta_e.max);
        assert_eq!(colours[delta_e.worst_curve], delta_e.max);
        assert!(delta_e.max < 2.3);
    }
}

#[test]
fn all_components_reproduce_the_curves() {
    let complete = compressed(Choice::Components(31));
    let database = Database::from_bytes(&bytes_of(&complete, &complete)).unwrap();
    for (row, curve) in curves().rows().into_iter().enumerate() {
        let rebuilt = database.curve(row, Quantity::Transmittance).unwrap();
        for (rebuilt, original) in rebuilt.iter().zip(curve) {
            // Coefficients and basis are f32: rounding errors are a few times 6e-8.
            assert!((f64::from(*rebuilt) - original).abs() < 1e-6);
        }
    }
    assert_eq!(database.curve(108, Quantity::Transmittance), None);
}

#[test]
fn nodes_are_found_and_other_points_are_refused() {
    let database = Database::from_bytes(&valid()).unwrap();
    let point = Point::from_core([0.3, 250.0, 200.0, 1.5, 89.0]);
    let row = ((((3 + 1) * 2) * 3) + 1) * 3 + 2;
    assert_eq!(database.row(point).unwrap(), row);
    let spectrum = database.spectrum(point, Quantity::Reflectance).unwrap();
    assert_eq!(
        database.curve(row, Quantity::Reflectance).unwrap(),
        spectrum
    );
    for row in 0..database.curves() {
        assert_eq!(database.row(database.point(row).unwrap()).unwrap(), row);
    }
    assert_eq!(database.point(database.curves()), None);
    let between = point.with(Parameter::Thickness, 10.0);
    assert_eq!(
        database
            .spectrum(between, Quantity::Reflectance)
            .unwrap_err()
            .to_string(),
        "thickness_cm = 10 lies between the nodes 1.5 and 50 of the database; this look-up answers at nodes only; use the method `smooth` to interpolate"
    );
    let outside = point.with(Parameter::Incidence, 89.5);
    assert_eq!(
        database
            .spectrum(outside, Quantity::Reflectance)
            .unwrap_err()
            .to_string(),
        "incidence_angle_deg = 89.5 is outside the database, which covers 0 to 89; give a value in this range, or build a database with a longer axis"
    );
}

#[test]
fn the_writer_refuses_files_that_the_reader_would_refuse() {
    let good = compressed(Choice::Components(2));
    let extra = BTreeMap::new();
    let error = |axes: &Axes, wavelengths_nm: &[f64], transmittance: &Compressed| {
        let file = CompactFile {
            axes,
            absent: &[],
            wavelengths_nm,
            substrate: SubstrateKind::Black,
            transmittance: Some(transmittance),
            reflectance: Some(&good),
            provenance: "{}",
            extra: &extra,
        };
        file.to_bytes().unwrap_err().to_string()
    };
    let mut bad_axes = axes();
    bad_axes.set(Parameter::Facetness, vec![0.3, 0.3 + 1e-9]);
    assert!(
        error(&bad_axes, &wavelengths(), &good).contains("facetness has 0.300000001 after 0.3")
    );
    bad_axes.set(Parameter::Facetness, vec![0.3]);
    assert!(error(&bad_axes, &wavelengths(), &good).contains("not [54, 2]"));
    bad_axes.set(Parameter::Incidence, vec![90.0]);
    assert!(error(&bad_axes, &wavelengths(), &good).contains("angle_deg has the value 90"));
    assert!(error(&axes(), &wavelengths()[1..], &good).contains("transmittance.basis"));
    let mut bad = good.clone();
    let mut coefficients = bad.coefficients.decoded();
    coefficients[[7, 1]] = f32::NAN;
    bad.coefficients = StoredCoefficients::F32(coefficients);
    assert!(error(&axes(), &wavelengths(), &bad).contains("NaN"));
    let reserved_key = BTreeMap::from([("basis".to_owned(), "log".to_owned())]);
    let (axes, wavelengths) = (axes(), wavelengths());
    let file = CompactFile {
        axes: &axes,
        absent: &[],
        wavelengths_nm: &wavelengths,
        substrate: SubstrateKind::Black,
        transmittance: Some(&good),
        reflectance: Some(&good),
        provenance: "{}",
        extra: &reserved_key,
    };
    assert!(file.to_bytes().unwrap_err().to_string().contains("`basis`"));
}

#[test]
fn files_are_replaced_atomically_and_errors_name_them() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("snow.safetensors");
    let error = Database::open(&path).unwrap_err();
    assert!(
        matches!(error, LookupError::Io { .. }) && error.to_string().contains("snow.safetensors")
    );
    let compressed = compressed(Choice::Components(2));
    let (axes, wavelengths, extra) = (axes(), wavelengths(), BTreeMap::new());
    let file = CompactFile {
        axes: &axes,
        absent: &[],
        wavelengths_nm: &wavelengths,
        substrate: SubstrateKind::Black,
        transmittance: Some(&compressed),
        reflectance: Some(&compressed),
        provenance: "{}",
        extra: &extra,
    };
    std::fs::write(&path, "older").unwrap();
    let error = Database::open(&path).unwrap_err().to_string();
    assert!(
        error.contains("snow.safetensors cannot be used") && error.contains("only 5 bytes"),
        "{error}"
    );
    file.write(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), file.to_bytes().unwrap());
    assert_eq!(
        Database::open(&path).unwrap().metadata()["provenance"],
        "{}"
    );
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 1);
    // a directory stands for its compact file, and must have one
    assert_eq!(
        Database::open(directory.path()).unwrap(),
        Database::open(&path).unwrap()
    );
    std::fs::remove_file(&path).unwrap();
    let error = Database::open(directory.path()).unwrap_err().to_string();
    assert!(error.contains("no snow.safetensors in"), "{error}");
    std::fs::create_dir(&path).unwrap();
    let error = Database::open(directory.path()).unwrap_err().to_string();
    assert!(error.contains("not a regular file"), "{error}");
    assert!(
        file.write(&directory.path().join("missing/snow.safetensors"))
            .is_err()
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A file of any values and axis lengths is read as it was written.
    #[test]
    fn files_are_read_as_written(
        lengths in proptest::array::uniform5(1_usize..4),
        bands in 1_usize..8,
        numbers in proptest::collection::vec(-1.0_f64..1.0, 64),
        components in 1_usize..4,
    ) {
        let axis = |index: usize, step: f64| -> Vec<f64> {
            (0..lengths[index]).map(|i| step * (i + 1) as f64).collect()
        };
        let axes = Axes::from([(Parameter::Facetness, axis(0, 0.25)), (Parameter::GrainSize, axis(1, 110.0)), (Parameter::Density, axis(2, 99.0)), (Parameter::Thickness, axis(3, 1.3)), (Parameter::Incidence, axis(4, 20.0))]);
        let rows: usize = lengths.iter().product();
        let curves = Array2::from_shape_fn((rows, bands), |(i, j)| numbers[(i * bands + j) % 64]);
        let components = components.min(rows).min(bands);
        let compressed = compress(curves.view(), None, Choice::Components(components)).unwrap();
        let wavelengths_nm: Vec<f64> = (0..bands).map(|i| 900.0 + 10.0 * i as f64).collect();
        let extra = BTreeMap::from([("note".to_owned(), "\"\\\u{1f}\u{e9}".to_owned())]);
        let file = CompactFile {
            axes: &axes,
            absent: &[],
            wavelengths_nm: &wavelengths_nm,
            substrate: SubstrateKind::Black,
            transmittance: Some(&compressed),
            reflectance: Some(&compressed),
            provenance: "{}",
            extra: &extra,
        };
        let database = Database::from_bytes(&file.to_bytes().unwrap()).unwrap();
        prop_assert_eq!(database.coefficients(Quantity::Transmittance), &compressed.coefficients.decoded());
        prop_assert_eq!(database.basis(Quantity::Reflectance), &compressed.basis);
        prop_assert_eq!(&database.metadata()["note"], &extra["note"]);
        prop_assert_eq!(database.axes(), &axes);
        prop_assert_eq!(database.wavelengths_nm(), &wavelengths_nm[..]);
        let errors = curve_errors(&database, Quantity::Transmittance, curves.view(), None).unwrap();
        let largest = errors.rmse.iter().copied().fold(0.0, f64::max);
        prop_assert_eq!(largest, compressed.table.rows[components - 1].rmse.max);
    }
}
