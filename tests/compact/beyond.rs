//! Files with optional axes.
use std::collections::BTreeMap;

use ndarray::Array2;
use splitsnow::compress::{self, Bands, Basis, Choice, CompactFile, Precision, Variant};

use splitsnow::lookup::{Database, FormatError, Lookup, LookupError, SubstrateKind, Varsa2025};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter, Point};

use super::damage::with_header;
use super::{axes, curves, wavelengths};

const CARBON: Parameter = Parameter::BlackCarbon;
const COLD: Parameter = Parameter::Temperature;

/// Two concentrations, slower, and three temperatures.
fn beyond() -> Axes {
    axes()
        .with(CARBON, vec![0.0, 100.0])
        .with(COLD, vec![-20.0, -10.0, 0.0])
}

/// The curves of [`axes`] to the power of 1 to 6: y grows in even steps.
fn powers() -> Array2<f64> {
    let one = curves();
    let blocks: Vec<_> = (1..=6).map(|power| one.mapv(|v| v.powi(power))).collect();
    let blocks: Vec<_> = blocks.iter().map(|block| block.view()).collect();
    ndarray::concatenate(ndarray::Axis(0), &blocks).unwrap()
}

fn file(basis: Basis) -> Vec<u8> {
    let variant = Variant {
        basis,
        precision: Precision::F32,
    };
    let quantity = Quantity::Transmittance;
    let made = compress::compress(
        powers().view(),
        quantity,
        None,
        &Bands::default(),
        Choice::Components(5),
        variant,
    );
    CompactFile {
        axes: &beyond(),
        absent: &[],
        wavelengths_nm: &wavelengths(),
        substrate: SubstrateKind::Black,
        transmittance: Some(&made.unwrap()),
        reflectance: None,
        provenance: "{}",
        extra: &BTreeMap::new(),
    }
    .to_bytes()
    .unwrap()
}

#[test]
fn rows_run_slower_along_them_and_come_back() {
    let quantity = Quantity::Transmittance;
    let database = Database::from_bytes(&file(Basis::Log)).unwrap();
    assert_eq!(database.curves(), 6 * 108);
    let nodes: Vec<_> = database.axes().iter().collect();
    assert_eq!(nodes[0], (CARBON, &[0.0, 100.0][..]));
    assert_eq!(nodes[1], (COLD, &[-20.0, -10.0, 0.0][..]));
    assert_eq!(
        database.metadata()["axis_order"],
        "black_carbon_ng_g,temperature_c,facetness,grain_size_um,density_kg_m3,thickness_cm,angle_deg"
    );
    assert!(database.metadata()["units"].contains(r#""black_carbon_ng_g":"ng g-1""#));
    for row in [0, 107, 108, 4 * 108 + 5, 6 * 108 - 1] {
        let point = database.point(row).unwrap();
        let number = row / 108;
        assert_eq!(point[CARBON], [0.0, 100.0][number / 3]);
        assert_eq!(point[COLD], [-20.0, -10.0, 0.0][number % 3]);
        assert_eq!(database.row(point).unwrap(), row);
        let there = database.at(point.optional()).unwrap();
        assert!(there.axes().optional().is_empty());
        let core = Point::from_core(point.core());
        assert_eq!(there.row(core).unwrap(), row % 108);
        let all = database.curve(row, quantity).unwrap();
        assert_eq!(all, there.spectrum(core, quantity).unwrap());
        assert_eq!(all, database.spectrum(point, quantity).unwrap());
    }
    assert_eq!(database.point(6 * 108), None);
}

#[test]
fn between_their_nodes_y_is_linear() {
    let quantity = Quantity::Transmittance;
    for basis in Basis::ALL {
        let database = Database::from_bytes(&file(basis)).unwrap();
        // halfway in the coordinate sqrt(c + 20)
        let halfway = (0.5 * (20_f64.sqrt() + 120_f64.sqrt())).powi(2) - 20.0;
        let there = database.at([(CARBON, halfway), (COLD, -8.0)].into());
        let there = there.unwrap();
        // temperature -8 is power 2.2 without carbon, and 5.2 with all
        let power = 0.5 * (2.2 + 5.2);
        for row in [0, 3, 50, 100] {
            let found = there.curve(row, quantity).unwrap();
            for (found, one) in found.iter().zip(curves().row(row)) {
                let expected = one.powf(power);
                assert!(
                    (f64::from(*found) - expected).abs() < 2e-3,
                    "{basis:?} {row} {found} {expected}"
                );
            }
        }
        assert!(Lookup::new(&there, quantity).is_ok());
    }
}

#[test]
fn what_is_not_told_or_not_there_is_refused_by_name() {
    let quantity = Quantity::Transmittance;
    let database = Database::from_bytes(&file(Basis::Log)).unwrap();
    let at = |conditions: &[(Parameter, f64)]| {
        let error = database.at(conditions.iter().copied().collect());
        error.unwrap_err().to_string()
    };
    assert_eq!(
        at(&[(COLD, -5.0)]),
        "the database has an axis black_carbon_ng_g: give a value of black_carbon_ng_g from 0 to 100"
    );
    assert!(at(&[(CARBON, 5.0)]).contains("give a value of temperature_c from -20 to 0"));
    assert_eq!(
        at(&[(CARBON, 100.1), (COLD, 0.0)]),
        "black_carbon_ng_g = 100.1 is outside the database, which covers 0 to 100"
    );
    assert!(at(&[(CARBON, f64::NAN), (COLD, 0.0)]).contains("give a value of black_carbon_ng_g"));
    assert!(at(&[(Parameter::Sphericity, 0.8)]).contains("no axis sphericity"));
    let point = Point::from_core(database.point(0).unwrap().core());
    let untold = |error: LookupError| matches!(error, LookupError::MissingCondition { .. });
    assert!(untold(database.spectrum(point, quantity).unwrap_err()));
    assert!(untold(Lookup::new(&database, quantity).unwrap_err()));
    assert!(untold(Varsa2025::new(&database, quantity).unwrap_err()));
}

#[test]
fn damage_to_them_is_found() {
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
    // an axis in the order without its tensor, and a tensor without its axis
    let longer = "\"axis_order\":\"black_carbon_ng_g,temperature_c,sphericity,";
    let missing = refused(order, longer);
    assert_eq!(missing, FormatError::Missing("sphericity".into()));
    let more = refused(order, "\"axis_order\":\"temperature_c,");
    assert_eq!(more, FormatError::Unknown("black_carbon_ng_g".into()));
    // another length, the header still whole
    let shape = "\"shape\":[3]";
    let length = refused(shape, "\"shape\":[2]").to_string();
    assert!(length.contains("header is damaged"), "{length}");
    let rows = refused("\"shape\":[648,5]", "\"shape\":[540,6]").to_string();
    assert!(rows.contains("expected F32 [648, 5]"), "{rows}");
    // a value that cannot be
    let mut bytes = file(Basis::Log);
    let (length, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let (begin, _) = header.info("temperature_c").unwrap().data_offsets;
    bytes[8 + length + begin..][..8].copy_from_slice(&1_f64.to_le_bytes());
    let value = Database::from_bytes(&bytes).unwrap_err().to_string();
    assert!(value.contains("temperature_c has the value 1"), "{value}");
}
