//! Variants of the compact file: basis, precision, and quantities.
use std::collections::BTreeMap;

use ndarray::Array2;
use safetensors::{Dtype, SafeTensors};
use splitsnow::compress::{
    Bands, Basis, Bounds, Choice, CompactFile, CompactVariant, CompressError, Compressed,
    Precision, StoredCoefficients, compress, curve_errors,
};
use splitsnow::grid::Compression;
use splitsnow::lookup::{Database, LookupError, SubstrateKind};
use splitsnow::measurement::Quantity;

use super::{BOUNDS, axes, colour, curves, valid, wavelengths};

pub(crate) fn variants() -> impl Iterator<Item = CompactVariant> {
    Basis::ALL
        .into_iter()
        .flat_map(|basis| Precision::ALL.map(|precision| CompactVariant { basis, precision }))
}

/// Curves of a quantity. Reflectance is slightly less than 1 minus transmittance.
fn curves_of(quantity: Quantity) -> Array2<f64> {
    match quantity {
        Quantity::Transmittance => curves(),
        Quantity::Reflectance => curves().mapv(|t| 0.98 - 0.9 * t),
    }
}

fn compressed(quantity: Quantity, choice: Choice, variant: CompactVariant) -> Compressed {
    let curves = curves_of(quantity);
    compress(
        curves.view(),
        quantity,
        Some(&colour()),
        &Bands::default(),
        choice,
        variant,
    )
    .unwrap()
}

fn try_bytes(
    transmittance: Option<&Compressed>,
    reflectance: Option<&Compressed>,
) -> Result<Vec<u8>, String> {
    CompactFile {
        axes: &axes(),
        absent: &[],
        wavelengths_nm: &wavelengths(),
        substrate: SubstrateKind::Black,
        transmittance,
        reflectance,
        provenance: "{}",
        extra: &BTreeMap::new(),
    }
    .to_bytes()
    .map_err(|error| error.to_string())
}

/// The bytes of a file with both quantities.
pub(crate) fn file(choice: Choice, variant: CompactVariant) -> Vec<u8> {
    let [t, r] = Quantity::ALL.map(|quantity| compressed(quantity, choice, variant));
    try_bytes(Some(&t), Some(&r)).unwrap()
}

fn largest(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

/// Every variant is read as it was written. The errors of the table equal those of the
/// reader, to the last bit, and the bounds hold.
#[test]
fn every_variant_has_the_errors_of_its_table() {
    for variant in variants() {
        for choice in [BOUNDS, Choice::Components(5)] {
            let [t, r] = Quantity::ALL.map(|quantity| compressed(quantity, choice, variant));
            let database = Database::from_bytes(&try_bytes(Some(&t), Some(&r)).unwrap()).unwrap();
            assert_eq!(database.basis_kind(), variant.basis);
            assert_eq!(database.precision(), variant.precision);
            for (quantity, compressed) in Quantity::ALL.into_iter().zip([&t, &r]) {
                assert!(database.has(quantity));
                let coefficients = compressed.coefficients.decoded();
                assert_eq!(database.coefficients(quantity), coefficients);
                assert_eq!(database.basis(quantity), compressed.basis);
                let curves = curves_of(quantity);
                let errors = curve_errors(&database, quantity, curves.view(), Some(&colour()));
                let errors = errors.unwrap();
                let row = compressed.table.rows[compressed.components() - 1];
                assert_eq!(row.components, compressed.components());
                assert_eq!(largest(&errors.rmse), row.rmse.max);
                let delta_e = errors.delta_e.unwrap();
                assert_eq!(largest(&delta_e), row.delta_e.unwrap().max);
                if compressed.bounds != Bounds::default() {
                    assert!(largest(&delta_e) < 2.3, "{variant:?} {quantity:?}");
                }
            }
        }
    }
}

#[test]
fn the_reader_inverts_the_logarithm() {
    let variant = CompactVariant {
        basis: Basis::Log,
        ..CompactVariant::default()
    };
    let database = Database::from_bytes(&file(Choice::Components(31), variant)).unwrap();
    for quantity in Quantity::ALL {
        let y = database.coefficients(quantity).mapv(f64::from);
        let y = y.dot(&database.basis(quantity).t().mapv(f64::from));
        for (row, curve) in curves_of(quantity).rows().into_iter().enumerate() {
            let found = database.curve(row, quantity).unwrap();
            for ((found, original), y) in found.iter().zip(curve).zip(y.row(row)) {
                let expected = match quantity {
                    Quantity::Transmittance => (-y).exp(),
                    Quantity::Reflectance => 1.0 - (-y).exp(),
                };
                assert!((f64::from(*found) - expected).abs() < 1e-6);
                assert!((f64::from(*found) - original).abs() < 1e-5);
            }
        }
    }
}

/// Curves that follow Beer's law with a single absorption spectrum need one component in the
/// log basis.
#[test]
fn exponentials_need_one_component() {
    let curves = Array2::from_shape_fn((200, 31), |(i, j)| {
        (-0.02 * i as f64 * (0.1 + (j as f64 / 31.0).powi(3))).exp()
    });
    let components = |quantity, curves: &Array2<f64>, basis| {
        let variant = CompactVariant {
            basis,
            ..CompactVariant::default()
        };
        let bounds = Choice::Bounds(Compression {
            max_delta_e: 0.1,
            max_rmse: Some(1e-4),
        });
        let found = compress(
            curves.view(),
            quantity,
            Some(&colour()),
            &Bands::default(),
            bounds,
            variant,
        );
        found.unwrap().components()
    };
    assert_eq!(components(Quantity::Transmittance, &curves, Basis::Log), 1);
    assert!(components(Quantity::Transmittance, &curves, Basis::Linear) > 2);
    let complement = curves.mapv(|t| 1.0 - t);
    assert_eq!(
        components(Quantity::Reflectance, &complement, Basis::Log),
        1
    );
}

#[test]
fn values_with_undefined_logarithm_are_compressed() {
    let mut curves = curves();
    curves.row_mut(3).fill(0.0);
    curves.row_mut(4).fill(1.0);
    curves.row_mut(5).fill(1.0 + 1e-9);
    let variant = CompactVariant {
        basis: Basis::Log,
        ..CompactVariant::default()
    };
    for quantity in Quantity::ALL {
        let choice = Choice::Components(31);
        let found = compress(
            curves.view(),
            quantity,
            None,
            &Bands::default(),
            choice,
            variant,
        )
        .unwrap();
        assert!(found.table.rows[30].rmse.max < 1e-5);
    }
    curves[[7, 2]] = f64::NAN;
    let error = compress(
        curves.view(),
        Quantity::Transmittance,
        None,
        &Bands::default(),
        BOUNDS,
        variant,
    );
    assert!(
        matches!(
            error,
            Err(CompressError::Value {
                row: 7,
                column: 2,
                ..
            })
        ),
        "{error:?}"
    );
}

/// docs/formats.md documents one tensor of integers per component.
#[test]
fn integers_have_the_documented_layout() {
    let variant = CompactVariant {
        basis: Basis::Log,
        precision: Precision::Quantised,
    };
    let bytes = file(BOUNDS, variant);
    let database = Database::from_bytes(&bytes).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let scales = tensors.tensor("transmittance.quantisation").unwrap();
    let components = database.components(Quantity::Transmittance);
    assert_eq!(
        (scales.dtype(), scales.shape()),
        (Dtype::F32, &[components, 2][..])
    );
    let scale = |i: usize| {
        let bytes = scales.data()[4 * i..4 * i + 4].try_into().unwrap();
        f64::from(f32::from_le_bytes(bytes))
    };
    for k in 0..components {
        let name = format!("transmittance.coefficients.{k}");
        let tensor = tensors.tensor(&name).unwrap();
        assert_eq!(tensor.shape(), [108]);
        let integer = |row: usize| match tensor.dtype() {
            Dtype::U8 => f64::from(tensor.data()[row]),
            Dtype::U16 => {
                let bytes = tensor.data()[2 * row..2 * row + 2].try_into().unwrap();
                f64::from(u16::from_le_bytes(bytes))
            }
            other => panic!("{other:?}"),
        };
        for row in 0..108 {
            let value = (scale(2 * k) + scale(2 * k + 1) * integer(row)) as f32;
            assert_eq!(
                value,
                database.coefficients(Quantity::Transmittance)[[row, k]]
            );
        }
    }
    assert!(tensors.tensor("transmittance.coefficients").is_err());
}

/// Integers have 16 bits without bounds or with tight bounds, and 8 bits with loose bounds.
#[test]
fn integers_are_as_narrow_as_the_bounds_allow() {
    let bits = |choice| {
        let variant = CompactVariant {
            basis: Basis::Log,
            precision: Precision::Quantised,
        };
        let found = compressed(Quantity::Transmittance, choice, variant);
        (found.coefficients.bits(), found.coefficients.bytes())
    };
    let bounds = |max_rmse| {
        Choice::Bounds(Compression {
            max_delta_e: 2.3,
            max_rmse: Some(max_rmse),
        })
    };
    assert_eq!(bits(Choice::Components(3)).0, [16; 3]);
    let (loose, bytes) = bits(bounds(0.1));
    assert!(loose.iter().all(|bits| *bits == 8), "{loose:?}");
    assert_eq!(bytes, loose.len() as u64 * (108 + 8));
    let (tight, _) = bits(bounds(5e-4));
    assert!(tight.contains(&16), "{tight:?}");
}

#[test]
fn a_bound_below_the_precision_is_refused() {
    for (precision, rmse) in [(Precision::F16, 1e-6), (Precision::Quantised, 1e-7)] {
        let bounds = Choice::Bounds(Compression {
            max_delta_e: 2.3,
            max_rmse: Some(rmse),
        });
        let variant = CompactVariant {
            precision,
            ..CompactVariant::default()
        };
        let curves = curves();
        let quantity = Quantity::Transmittance;
        let error = compress(
            curves.view(),
            quantity,
            Some(&colour()),
            &Bands::default(),
            bounds,
            variant,
        );
        let error = error.unwrap_err().to_string();
        let message = format!(
            "`{}` coefficients cannot be more accurate; raise the bound, or use f32",
            precision.name()
        );
        assert!(error.contains(&message), "{error}");
    }
}

#[test]
fn files_may_have_a_single_quantity() {
    for (present, missing) in [
        (Quantity::Transmittance, Quantity::Reflectance),
        (Quantity::Reflectance, Quantity::Transmittance),
    ] {
        let only = compressed(present, BOUNDS, CompactVariant::default());
        let bytes = match present {
            Quantity::Transmittance => try_bytes(Some(&only), None),
            Quantity::Reflectance => try_bytes(None, Some(&only)),
        };
        let bytes = bytes.unwrap();
        assert_eq!(SafeTensors::deserialize(&bytes).unwrap().len(), 8);
        let database = Database::from_bytes(&bytes).unwrap();
        assert_eq!(database.metadata()["quantities"], present.name());
        assert!(database.has(present) && !database.has(missing));
        assert_eq!(database.curves(), 108);
        assert_eq!(database.coefficients(missing).dim(), (0, 0));
        assert_eq!(database.basis(missing).dim(), (0, 0));
        assert_eq!(database.components(missing), 0);
        assert_eq!(database.curve(0, missing), None);
        assert!(database.curve(0, present).is_some());
        let point = database.point(0).unwrap();
        assert!(database.spectrum(point, present).is_ok());
        let error = database.spectrum(point, missing).unwrap_err();
        assert!(matches!(error, LookupError::NoQuantity { .. }));
        let message = format!("has no {}, it has {} only", missing.name(), present.name());
        assert!(error.to_string().contains(&message), "{error}");
        assert!(curve_errors(&database, missing, curves().view(), None).is_err());
    }
}

/// Old files lack the keys `precision` and `quantities`. They are f32 and have both
/// quantities.
#[test]
fn old_files_without_variant_keys_are_read() {
    let bytes = super::damage::with_header(&valid(), |header| {
        let header = header.replacen(r#""precision":"f32","#, "", 1);
        let older = header.replacen(r#""quantities":"transmittance,reflectance","#, "", 1);
        assert!(older.len() < header.len());
        older
    });
    let [old, new] = [&bytes, &valid()].map(|bytes| Database::from_bytes(bytes).unwrap());
    assert_eq!(old.precision(), Precision::F32);
    assert!(Quantity::ALL.iter().all(|&quantity| old.has(quantity)));
    let quantity = Quantity::Reflectance;
    assert_eq!(old.curve(5, quantity), new.curve(5, quantity));
}

#[test]
fn the_writer_refuses_inconsistent_contents() {
    let plain = compressed(Quantity::Transmittance, BOUNDS, CompactVariant::default());
    let error = try_bytes(None, None).unwrap_err();
    assert!(error.contains("neither"), "{error}");
    let variant = CompactVariant {
        basis: Basis::Log,
        ..CompactVariant::default()
    };
    let other = compressed(Quantity::Reflectance, BOUNDS, variant);
    let error = try_bytes(Some(&plain), Some(&other)).unwrap_err();
    assert!(error.contains("different variants"), "{error}");
    let mut short = plain.clone();
    short.coefficients = StoredCoefficients::Quantised(Vec::new());
    assert!(try_bytes(Some(&short), None).is_err());
}
