//! Compact files with optional axes.
use std::collections::BTreeMap;

use ndarray::Array2;
use splitsnow::compress::{self, Bands, Basis, Choice, CompactFile, CompactVariant, Precision};

use splitsnow::lookup::{Database, FormatError, Lookup, LookupError, SubstrateKind, Varsa2025};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};

use super::damage::with_header;
use super::{axes, curves, wavelengths};

const CARBON: Parameter = Parameter::BlackCarbon;
const TEMPERATURE: Parameter = Parameter::Temperature;

/// Two concentrations of carbon, which vary slowest, and three temperatures.
fn axes_with_optional() -> Axes {
    axes()
        .with(CARBON, vec![0.0, 100.0])
        .with(TEMPERATURE, vec![-20.0, -10.0, 0.0])
}

/// The curves of [`axes`] to the powers 1 to 6. Their logarithms are equidistant.
fn powers() -> Array2<f64> {
    let base = curves();
    let blocks: Vec<_> = (1..=6).map(|power| base.mapv(|v| v.powi(power))).collect();
    let blocks: Vec<_> = blocks.iter().map(|block| block.view()).collect();
    ndarray::concatenate(ndarray::Axis(0), &blocks).unwrap()
}

fn file(basis: Basis) -> Vec<u8> {
    let variant = CompactVariant {
        basis,
        precision: Precision::F32,
    };
    let quantity = Quantity::Transmittance;
    let compressed = compress::compress(
        powers().view(),
        quantity,
        None,
        &Bands::default(),
        Choice::Components(5),
        variant,
    );
    CompactFile {
        axes: &axes_with_optional(),
        absent: &[],
        wavelengths_nm: &wavelengths(),
        substrate: SubstrateKind::Black,
        transmittance: Some(&compressed.unwrap()),
        reflectance: None,
        provenance: "{}",
        extra: &BTreeMap::new(),
    }
    .to_bytes()
    .unwrap()
}

#[test]
fn rows_and_points_of_optional_axes_correspond() {
    let quantity = Quantity::Transmittance;
    let database = Database::from_bytes(&file(Basis::Log)).unwrap();
    assert_eq!(database.curves(), 6 * 108);
    let nodes: Vec<_> = database.axes().iter().collect();
    assert_eq!(nodes[0], (CARBON, &[0.0, 100.0][..]));
    assert_eq!(nodes[1], (TEMPERATURE, &[-20.0, -10.0, 0.0][..]));
    assert_eq!(
        database.metadata()["axis_order"],
        "black_carbon_ng_g,temperature_c,facetness,grain_size_um,density_kg_m3,thickness_cm,angle_deg"
    );
    assert!(database.metadata()["units"].contains(r#""black_carbon_ng_g":"ng g-1""#));
    for row in [0, 107, 108, 4 * 108 + 5, 6 * 108 - 1] {
        let point = database.point(row).unwrap();
        let combination = row / 108;
        assert_eq!(point[CARBON], [0.0, 100.0][combination / 3]);
        assert_eq!(point[TEMPERATURE], [-20.0, -10.0, 0.0][combination % 3]);
        assert_eq!(database.row(point).unwrap(), row);
        let at_optional = database.at(point.optional()).unwrap();
        assert!(at_optional.axes().optional().is_empty());
        let core = Point::from_core(point.core());
        assert_eq!(at_optional.row(core).unwrap(), row % 108);
        let curve = database.curve(row, quantity).unwrap();
        assert_eq!(curve, at_optional.spectrum(core, quantity).unwrap());
        assert_eq!(curve, database.spectrum(point, quantity).unwrap());
    }
    assert_eq!(database.point(6 * 108), None);
}

#[test]
fn interpolation_along_optional_axes_is_linear_in_their_coordinates() {
    let quantity = Quantity::Transmittance;
    for basis in Basis::ALL {
        let database = Database::from_bytes(&file(basis)).unwrap();
        // halfway in the coordinate sqrt(c + 20)
        let halfway = (0.5 * (20_f64.sqrt() + 120_f64.sqrt())).powi(2) - 20.0;
        let between = database.at([(CARBON, halfway), (TEMPERATURE, -8.0)].into());
        let between = between.unwrap();
        // at -8 degrees the power is 2.2 without carbon, and 5.2 at the highest concentration
        let power = 0.5 * (2.2 + 5.2);
        for row in [0, 3, 50, 100] {
            let found = between.curve(row, quantity).unwrap();
            for (found, base) in found.iter().zip(curves().row(row)) {
                let expected = base.powf(power);
                assert!(
                    (f64::from(*found) - expected).abs() < 2e-3,
                    "{basis:?} {row} {found} {expected}"
                );
            }
        }
        assert!(Lookup::new(&between, quantity).is_ok());
    }
}

#[test]
fn missing_unknown_and_outside_conditions_are_refused_by_name() {
    let quantity = Quantity::Transmittance;
    let database = Database::from_bytes(&file(Basis::Log)).unwrap();
    let error = |conditions: &[(Parameter, f64)]| {
        let result = database.at(conditions.iter().copied().collect());
        result.unwrap_err().to_string()
    };
    assert_eq!(
        error(&[(TEMPERATURE, -5.0)]),
        "the database has an axis black_carbon_ng_g: give a value of black_carbon_ng_g from 0 to 100"
    );
    assert!(error(&[(CARBON, 5.0)]).contains("give a value of temperature_c from -20 to 0"));
    assert_eq!(
        error(&[(CARBON, 100.1), (TEMPERATURE, 0.0)]),
        "black_carbon_ng_g = 100.1 is outside the database, which covers 0 to 100; give a value in this range, or build a database with a longer axis"
    );
    assert!(
        error(&[(CARBON, f64::NAN), (TEMPERATURE, 0.0)])
            .contains("give a value of black_carbon_ng_g")
    );
    assert!(error(&[(Parameter::Sphericity, 0.8)]).contains("no axis sphericity"));
    let point = Point::from_core(database.point(0).unwrap().core());
    let is_missing = |error: LookupError| matches!(error, LookupError::MissingCondition { .. });
    assert!(is_missing(database.spectrum(point, quantity).unwrap_err()));
    assert!(is_missing(Lookup::new(&database, quantity).unwrap_err()));
    assert!(is_missing(Varsa2025::new(&database, quantity).unwrap_err()));
}

#[test]
fn damaged_optional_axes_are_refused() {
    let refused = |from: &str, to: &str| {
        let bytes = with_header(&file(Basis::Log), |header| {
            assert!(header.contains(from), "{header}");
            header.replacen(from, to, 1)
        });
        Database::from_bytes(&bytes).unwrap_err()
    };
    let order = "\"axis_order\":\"black_carbon_ng_g,temperature_c,";
    let unknown = refused(order, "\"axis_order\":\"dust_ng_g,temperature_c,");
    assert_eq!(unknown, FormatError::UnknownAxis("dust_ng_g".into()));
    for other in [
        "\"axis_order\":\"temperature_c,black_carbon_ng_g,",
        "\"axis_order\":\"temperature_c,temperature_c,",
    ] {
        let error = refused(order, other).to_string();
        assert!(error.contains("`axis_order`"), "{error}");
    }
    // an axis without a tensor, and a tensor without an axis
    let longer = "\"axis_order\":\"black_carbon_ng_g,temperature_c,sphericity,";
    let missing = refused(order, longer);
    assert_eq!(missing, FormatError::Missing("sphericity".into()));
    let unlisted = refused(order, "\"axis_order\":\"temperature_c,");
    assert_eq!(unlisted, FormatError::Unknown("black_carbon_ng_g".into()));
    // other lengths in a well-formed header
    let shape = "\"shape\":[3]";
    let length = refused(shape, "\"shape\":[2]").to_string();
    assert!(length.contains("header is damaged"), "{length}");
    let rows = refused("\"shape\":[648,5]", "\"shape\":[540,6]").to_string();
    assert!(rows.contains("expected F32 [648, 5]"), "{rows}");
    // an impossible value
    let mut bytes = file(Basis::Log);
    let (length, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let (begin, _) = header.info("temperature_c").unwrap().data_offsets;
    bytes[8 + length + begin..][..8].copy_from_slice(&1_f64.to_le_bytes());
    let value = Database::from_bytes(&bytes).unwrap_err().to_string();
    assert!(value.contains("temperature_c has the value 1"), "{value}");
}
