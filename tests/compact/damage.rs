//! Damaged, foreign and malicious files.
use std::collections::BTreeMap;
use std::sync::LazyLock;

use ndarray::Array2;
use proptest::prelude::*;
use safetensors::{Dtype, SafeTensors};
use splitsnow::compress::{Bands, Basis, Choice, CompactFile, CompactVariant, Precision, compress};
use splitsnow::grid::Compression;
use splitsnow::lookup::{Database, FormatError, Lookup, SubstrateKind};
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter};

use super::valid;
use super::variants::{file, variants};

/// A file with its header modified by `change`. The stated header length stays correct.
pub(crate) fn with_header(bytes: &[u8], change: impl FnOnce(String) -> String) -> Vec<u8> {
    let (length, rest) = bytes.split_first_chunk::<8>().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header = change(String::from_utf8(header.to_vec()).unwrap());
    let mut changed = (header.len() as u64).to_le_bytes().to_vec();
    changed.extend(header.as_bytes());
    changed.extend(data);
    changed
}

/// The error of the valid file with `from` replaced by `to` in its header.
fn replacement_error(from: &str, to: &str) -> String {
    replacement_error_in(&valid(), from, to)
}

/// The error of a file with `from` replaced by `to` in its header.
fn replacement_error_in(bytes: &[u8], from: &str, to: &str) -> String {
    let bytes = with_header(bytes, |header| {
        assert!(header.contains(from), "{header}");
        header.replacen(from, to, 1)
    });
    Database::from_bytes(&bytes).unwrap_err().to_string()
}

#[test]
fn damaged_and_foreign_files_are_refused_with_a_reason() {
    let refused = |bytes: &[u8]| Database::from_bytes(bytes).unwrap_err();
    let bytes = valid();
    assert!(matches!(refused(b""), FormatError::NotSafetensors { .. }));
    assert!(matches!(
        refused(b"version = 1\n"),
        FormatError::NotSafetensors { .. }
    ));
    assert!(matches!(
        refused(&[0xff; 64]),
        FormatError::NotSafetensors { .. }
    ));
    assert!(matches!(
        refused(&bytes[..100]),
        FormatError::Truncated { .. }
    ));
    assert!(matches!(
        refused(&bytes[..bytes.len() - 1]),
        FormatError::Truncated { .. }
    ));
    let longer = [bytes.as_slice(), &[0]].concat();
    assert!(matches!(refused(&longer), FormatError::Trailing { .. }));
    assert!(matches!(
        refused(b"\x08\0\0\0\0\0\0\0{\"a\":1,}"),
        FormatError::Header(_)
    ));

    let version = replacement_error(r#""format_version":"2""#, r#""format_version":"3""#);
    assert!(
        version.contains("`format_version` is \"3\", expected `2` or `1`"),
        "{version}"
    );
    let substrate = replacement_error(r#""substrate":"black""#, r#""substrate":"blue""#);
    let message = "`substrate` is \"blue\", expected `black` or `reflecting` or `layers`";
    assert!(substrate.contains(message), "{substrate}");
    let basis = replacement_error(r#""basis":"linear""#, r#""basis":"cubic""#);
    assert!(
        basis.contains("`basis` is \"cubic\", expected `linear` or `log`"),
        "{basis}"
    );
    let none = replacement_error(r#""basis":"linear","#, "");
    assert!(none.contains("`basis` is missing"), "{none}");
    let precision = replacement_error(r#""precision":"f32""#, r#""precision":"f64""#);
    assert!(precision.contains("`precision` is \"f64\""), "{precision}");
    let precision = replacement_error(r#""precision":"f32""#, r#""precision":"f16""#);
    let other = "is F32 [108, 2], expected F16 [108, 2]";
    assert!(precision.contains(other), "{precision}");
    let both = r#""quantities":"transmittance,reflectance""#;
    let quantities = replacement_error(both, r#""quantities":"absorptance""#);
    assert!(quantities.contains("`quantities` is"), "{quantities}");
    let quantities = replacement_error(both, r#""quantities":"reflectance""#);
    assert!(
        quantities.contains("tensor `transmittance."),
        "{quantities}"
    );
    let other = replacement_error(r#""format":"splitsnow-compact","#, "");
    assert!(other.contains("`format` is missing"), "{other}");
    let order = replacement_error("facetness,grain_size_um,", "grain_size_um,facetness,");
    assert!(order.contains("axis_order"), "{order}");
    let components = replacement_error(
        r#"reflectance.components":"5""#,
        r#"reflectance.components":"32""#,
    );
    assert!(components.contains("expected `1 to 31`"), "{components}");
    let components = replacement_error(
        r#"reflectance.components":"5""#,
        r#"reflectance.components":"4""#,
    );
    assert!(
        components.contains("F32 [108, 5], expected F32 [108, 4]"),
        "{components}"
    );

    assert_eq!(
        replacement_error(r#""angle_deg":{"#, r#""angle":{"#),
        "it has a tensor `angle`, which this version does not know"
    );
    let dtype = replacement_error(
        r#""dtype":"F64","shape":[31]"#,
        r#""dtype":"I64","shape":[31]"#,
    );
    assert!(
        dtype.contains("`wavelength_nm` is I64 [31], expected F64 or F32 [n]"),
        "{dtype}"
    );
    let shape = replacement_error(r#""shape":[31]"#, r#""shape":[1,31]"#);
    assert!(shape.contains("expected F64 or F32 [n]"), "{shape}");
    let shape = replacement_error(r#""shape":[108,5]"#, r#""shape":[54,10]"#);
    assert!(shape.contains("expected F32 [108, 5]"), "{shape}");
    for shape in [
        "[107,5]",
        "[4611686018427387904,5]",
        "[18446744073709551615,5]",
        "[-1,5]",
        "[1e3,5]",
    ] {
        let shape = replacement_error(r#""shape":[108,5]"#, &format!(r#""shape":{shape}"#));
        assert!(shape.contains("header is damaged"), "{shape}");
    }
    for offsets in ["[0,16]", "[8,24]", "[24,0]", "[0,18446744073709551615]"] {
        let offsets = replacement_error(
            r#""data_offsets":[0,24]"#,
            &format!(r#""data_offsets":{offsets}"#),
        );
        assert!(offsets.contains("header is damaged"), "{offsets}");
    }
}

#[test]
fn damaged_quantised_files_are_refused_with_a_reason() {
    let variant = CompactVariant {
        basis: Basis::Log,
        precision: Precision::Quantised,
    };
    let bytes = file(Choice::Components(3), variant);
    let replacement_error = |from: &str, to: &str| replacement_error_in(&bytes, from, to);
    let unknown = replacement_error("reflectance.coefficients.2", "reflectance.coefficients.3");
    assert!(
        unknown.contains("`reflectance.coefficients.3`, which"),
        "{unknown}"
    );
    let unknown = replacement_error("reflectance.coefficients.2", "reflectance.coefficients.02");
    assert!(
        unknown.contains("which this version does not know"),
        "{unknown}"
    );
    let dtype = replacement_error(r#""U16","shape":[108]"#, r#""I16","shape":[108]"#);
    assert!(
        dtype.contains("I16 [108], expected U8 or U16 [108]"),
        "{dtype}"
    );
    let shape = replacement_error(r#""U16","shape":[108]"#, r#""U16","shape":[2,54]"#);
    assert!(shape.contains("expected U8 or U16 [108]"), "{shape}");
    let shape = replacement_error(r#""shape":[3,2]"#, r#""shape":[2,3]"#);
    assert!(shape.contains("expected F32 [3, 2]"), "{shape}");
    let components = r#"reflectance.components":"3""#;
    let fewer = replacement_error(components, &components.replace('3', "2"));
    assert!(
        fewer.contains("which this version does not know"),
        "{fewer}"
    );
    let more = replacement_error(components, &components.replace('3', "4"));
    assert!(more.contains("expected F32 [4, 2]"), "{more}");

    let (length, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let begin = header.info("transmittance.quantisation").unwrap();
    let begin = 8 + length + begin.data_offsets.0;
    let mut bytes = bytes;
    bytes[begin + 4..begin + 8].copy_from_slice(&9e8_f32.to_le_bytes());
    let error = Database::from_bytes(&bytes).unwrap_err().to_string();
    assert!(
        error.contains("tensor transmittance.coefficients.0 has the value"),
        "{error}"
    );
}

/// The sum of the declared tensor sizes must not wrap around, even if it exceeds 64 bits.
#[test]
fn the_sum_of_huge_sizes_does_not_wrap() {
    let size = 1_u64 << 60;
    let tensors: Vec<String> = (0..16)
        .map(|i: u64| {
            let [begin, end] = [i * size, (i + 1).saturating_mul(size)];
            let shape = (end - begin) as usize;
            format!(
                r#""t{i:02}":{{"dtype":"U8","shape":[{shape}],"data_offsets":[{begin},{end}]}}"#
            )
        })
        .collect();
    let header = format!("{{{}}}", tensors.join(","));
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.as_bytes());
    let error = Database::from_bytes(&bytes).unwrap_err();
    assert!(matches!(error, FormatError::Truncated { .. }), "{error}");
}

#[test]
fn impossible_values_are_refused_by_name() {
    let bytes = valid();
    let (header_length, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let refused = |tensor: &str, index: usize, value: f32| {
        let mut bytes = bytes.clone();
        let info = header.info(tensor).unwrap();
        let begin = 8 + header_length + info.data_offsets.0;
        match info.dtype {
            Dtype::F64 => {
                bytes[begin + 8 * index..][..8].copy_from_slice(&f64::from(value).to_le_bytes())
            }
            _ => bytes[begin + 4 * index..][..4].copy_from_slice(&value.to_le_bytes()),
        }
        Database::from_bytes(&bytes).unwrap_err().to_string()
    };
    assert_eq!(
        refused("angle_deg", 2, 90.0),
        "its tensor angle_deg has the value 90; expected at least 0 and below 90"
    );
    assert!(refused("facetness", 0, f32::NAN).contains("facetness has the value NaN"));
    assert!(refused("thickness_cm", 1, 1.0).contains("thickness_cm has 1 after 1"));
    assert!(refused("grain_size_um", 0, -100.0).contains("expected above 0"));
    assert!(refused("wavelength_nm", 0, 450.0).contains("increase strictly"));
    assert!(refused("transmittance.coefficients", 3, f32::INFINITY).contains("value inf"));
    assert!(refused("reflectance.basis", 0, 1e30).contains("reflectance.basis"));
}

/// A small file of anisotropy factors, whose views go around the normal.
fn seed_of_views() -> Vec<u8> {
    let axes = Axes::from([
        (Parameter::View, vec![0.0, 30.0, 70.0]),
        (Parameter::RelativeAzimuth, vec![0.0, 180.0]),
        (Parameter::Facetness, vec![0.1]),
        (Parameter::GrainSize, vec![100.0, 200.0]),
        (Parameter::Density, vec![300.0]),
        (Parameter::Thickness, vec![5.0, 10.0]),
        (Parameter::Incidence, vec![0.0, 60.0]),
    ]);
    let factor = |(row, l)| {
        let [view, azimuth] = Parameter::VIEWS.map(|p| axes.point(row as u64)[p]);
        1.0 + (view * azimuth.to_radians().cos() + row as f64) / (200.0 + 50.0 * l as f64)
    };
    let curves = Array2::from_shape_fn((axes.count() as usize, 3), factor);
    let compressed = compress(
        curves.view(),
        Quantity::Reflectance,
        None,
        &Bands::default(),
        Choice::Components(2),
        CompactVariant::default(),
    );
    let file = CompactFile {
        axes: &axes,
        absent: &[],
        wavelengths_nm: &[500.0, 550.0, 600.0],
        substrate: SubstrateKind::Black,
        transmittance: None,
        reflectance: Some(&compressed.unwrap()),
        provenance: "{}",
        extra: &BTreeMap::new(),
    };
    file.to_bytes().unwrap()
}

/// Seeds of the fuzz target `compact`. Files named `valid*` can be opened, the others are
/// refused. `UPDATE_GOLDEN=1 cargo test --release --test pipeline compact::` rewrites them.
#[test]
fn fuzz_seeds_are_valid_or_refused_as_named() {
    let directory = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/compact");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        let curves = Array2::from_shape_fn((4, 3), |(i, j)| (1 + i * j) as f64 / 8.0);
        let small = Axes::from([
            (Parameter::Facetness, vec![0.1]),
            (Parameter::GrainSize, vec![100.0, 200.0]),
            (Parameter::Density, vec![300.0]),
            (Parameter::Thickness, vec![5.0]),
            (Parameter::Incidence, vec![0.0, 60.0]),
        ]);
        let bytes = |variant, choice, quantities: &[Quantity]| {
            let [t, r] = Quantity::ALL.map(|quantity| {
                let compressed = compress(
                    curves.view(),
                    quantity,
                    None,
                    &Bands::default(),
                    choice,
                    variant,
                )
                .unwrap();
                quantities.contains(&quantity).then_some(compressed)
            });
            CompactFile {
                axes: &small,
                absent: &[],
                wavelengths_nm: &[500.0, 550.0, 600.0],
                substrate: SubstrateKind::Black,
                transmittance: t.as_ref(),
                reflectance: r.as_ref(),
                provenance: "{}",
                extra: &BTreeMap::new(),
            }
            .to_bytes()
            .unwrap()
        };
        let two = Choice::Components(2);
        let valid = bytes(CompactVariant::default(), two, &Quantity::ALL);
        let log = |precision| CompactVariant {
            basis: Basis::Log,
            precision,
        };
        // Integers have 8 bits if the components are chosen by loose bounds, otherwise 16.
        let loose = Choice::Bounds(Compression {
            max_delta_e: 2.3,
            max_rmse: Some(0.01),
        });
        for (name, precision, choice, quantities) in [
            ("valid_log", Precision::F32, two, &Quantity::ALL[..]),
            ("valid_f16", Precision::F16, two, &Quantity::ALL),
            ("valid_u8", Precision::Quantised, loose, &Quantity::ALL),
            ("valid_u16", Precision::Quantised, two, &Quantity::ALL[1..]),
        ] {
            let path = directory.join(format!("{name}.safetensors"));
            std::fs::write(path, bytes(log(precision), choice, quantities)).unwrap();
        }
        let with_carbon = small
            .clone()
            .with(Parameter::Incidence, vec![0.0])
            .with(Parameter::BlackCarbon, vec![0.0, 100.0]);
        let compressed = compress(
            curves.view(),
            Quantity::ALL[0],
            None,
            &Bands::default(),
            two,
            CompactVariant::default(),
        );
        let file = CompactFile {
            axes: &with_carbon,
            absent: &[],
            wavelengths_nm: &[500.0, 550.0, 600.0],
            substrate: SubstrateKind::Black,
            transmittance: Some(&compressed.unwrap()),
            reflectance: None,
            provenance: "{}",
            extra: &BTreeMap::new(),
        };
        let path = directory.join("valid_axes.safetensors");
        std::fs::write(path, file.to_bytes().unwrap()).unwrap();
        std::fs::write(directory.join("valid_views.safetensors"), seed_of_views()).unwrap();
        let offset = String::from_utf8_lossy(&valid[8..]).find("F32").unwrap() + 8;
        let mut other_type = valid.clone();
        other_type[offset..offset + 3].copy_from_slice(b"I32");
        std::fs::write(directory.join("valid.safetensors"), &valid).unwrap();
        std::fs::write(
            directory.join("truncated.safetensors"),
            &valid[..valid.len() - 7],
        )
        .unwrap();
        std::fs::write(directory.join("other_type.safetensors"), other_type).unwrap();
    }
    let mut count = 0;
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let valid = path
            .file_name()
            .unwrap()
            .to_string_lossy()
            .starts_with("valid");
        let opened = Database::open(&path);
        assert_eq!(opened.is_ok(), valid, "{}", path.display());
        count += 1;
        // values stay in [0, 1], even in the file whose numbers overflow
        let Ok(database) = opened else { continue };
        if database.holds_anisotropy() {
            continue;
        }
        for quantity in Quantity::ALL.into_iter().filter(|q| database.has(*q)) {
            let mut spectrum = vec![0.0; database.wavelengths_nm().len()];
            for row in 0..database.curves() {
                let at_optional = database
                    .at(database.point(row).unwrap().optional())
                    .unwrap();
                let lookup = Lookup::new(&at_optional, quantity).unwrap();
                let point = database.point(row).unwrap();
                lookup.spectrum(point, &mut spectrum).unwrap();
                let bounded = spectrum.iter().all(|v| (0.0..=1.0).contains(v));
                assert!(bounded, "{}: {point}", path.display());
            }
        }
    }
    assert_eq!(count, 12);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// A file with changed bytes or a missing end is refused, or gives finite answers.
    #[test]
    fn damage_never_panics(
        flips in proptest::collection::vec((any::<prop::sample::Index>(), 1_u8..), 0..4),
        header_only in any::<bool>(),
        cut in proptest::option::weighted(0.2, any::<prop::sample::Index>()),
        variant in any::<prop::sample::Index>(),
    ) {
        static VALID: LazyLock<Vec<Vec<u8>>> =
            LazyLock::new(|| variants().map(|v| file(Choice::Components(3), v)).collect());
        let mut bytes = variant.get(&VALID).clone();
        let range = if header_only { 4000 } else { bytes.len() };
        for (index, mask) in flips {
            bytes[index.index(range)] ^= mask;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(database) = Database::from_bytes(&bytes) {
            for row in [0, database.curves() - 1] {
                let point = database.point(row).unwrap();
                for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
                    let spectrum = database.spectrum(point, quantity).unwrap();
                    prop_assert_eq!(spectrum.len(), database.wavelengths_nm().len());
                    prop_assert!(spectrum.iter().all(|v| v.is_finite()));
                }
            }
        }
    }
}
