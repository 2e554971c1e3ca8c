//! Truncated, modified and malformed files.
use std::fs;
use std::path::Path;
use std::process::Command;

use splitsnow::compress::Choice;
use splitsnow::lookup::Database;
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter};

use super::files::Contents;
use super::{ANSWERS, Random, folder, run};

/// A file with its header modified by `change`. The stated header length stays correct.
fn with_header(bytes: &[u8], change: impl FnOnce(Vec<u8>) -> Vec<u8>) -> Vec<u8> {
    let (length, rest) = bytes.split_first_chunk::<8>().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header = change(header.to_vec());
    [&(header.len() as u64).to_le_bytes(), &header[..], data].concat()
}

/// Files with unusual headers. Most are invalid; some are valid and equivalent to `bytes`.
fn unusual_headers(bytes: &[u8]) -> Vec<Vec<u8>> {
    let angle = r#""angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0,16]}"#;
    let nested = |n: usize| format!(r#""a":{}{}, "dtype":"F32""#, "[".repeat(n), "]".repeat(n));
    let mut replacements: Vec<(&str, String)> = Vec::new();
    for other in [
        r#""angle_deg":{"dtype":{"F64":null},"shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":{"F64":{}},"shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":{"F64":null,"F64":null},"shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":["F64",[2],[0,16]]"#,
        r#""angle_deg":["F64",[2],[0,16],1]"#,
        r#""angle_deg":["F64",[2]]"#,
        r#""angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0,16,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0]}"#,
        r#""angle_deg":{"dtype":"F64","dtype":"F64","shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2]}"#,
        r#""angle_deg":{}"#,
        r#""angle_deg":null"#,
        r#""angle_deg":7,"angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"U8","shape":[9],"data_offsets":[3,2]},"angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0,16]},"angle_deg":{"dtype":"U8","shape":[9],"data_offsets":[3,2]}"#,
        r#""angle\u005fdeg":{"\u0064type":"F64","shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F6\u0034","shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg\u0000":{"dtype":"F64","shape":[2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2.0],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[-0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[02],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[1,2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2,],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[18446744073709551615,2],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[18446744073709551616],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[2305843009213693954],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F4","shape":[32],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F4","shape":[31],"data_offsets":[0,16]}"#,
        r#""angle_deg":{"dtype":"F64","shape":[],"data_offsets":[0,8]}"#,
        r#""nothing":{"dtype":"F32","shape":[0],"data_offsets":[0,0]},"angle_deg":{"dtype":"F64","shape":[2],"data_offsets":[0,16]}"#,
        r#"  "angle_deg" : 	{"dtype":"F64" , "shape":[ 2 ],"data_offsets":[0 ,16] } "#,
    ] {
        replacements.push((angle, other.to_owned()));
    }
    for value in [
        "1e308",
        "1e309",
        "-1e309",
        "1.7976931348623157e308",
        "1.7976931348623159e308",
        "17976931348623157e292",
        "17976931348623159e292",
        "0.00017976931348623159e312",
        "1e-99999999999",
        "1e99999999999",
        "0e99999999999",
        "0.0e99999999999",
        "01",
        "-",
        "-0",
        "1.",
        "1.e3",
        "1e",
        "1e+",
        ".5",
        "+1",
        "99999999999999999999999999",
        "true",
        "nul",
        "nan",
        r#""\ud83d\ude00""#,
        r#""\ud83d""#,
        r#""\ude00""#,
        r#""\ud83dx""#,
        r#""\ud83d\u0041""#,
        r#""\ud83d\ue000""#,
        r#""\x""#,
        r#""\u12g4""#,
        "\"\u{1}\"",
        "\"\u{7f}\"",
        "\"é\"",
        r#"{"a":[1,{"b":null}]}"#,
        r#"{"a" 1}"#,
        "[1 2]",
        "[,]",
        "{,}",
        "[1,]",
        "\"",
        "",
    ] {
        replacements.push((r#""dtype":"F32""#, format!(r#""a":{value},"dtype":"F32""#)));
    }
    replacements.extend([124, 125, 126, 127, 128, 5000].map(|n| (r#""dtype":"F32""#, nested(n))));
    for (from, to) in [
        (r#""format":"#, r#""format":"other","format":"#),
        (
            r#""format_version":"2""#,
            r#""format_version":"2","format_version":"3""#,
        ),
        (r#""format_version":"2""#, r#""format_version":2"#),
        (r#""format_version":"2""#, r#""format_version":"2\u0000""#),
        (r#""format_version":"2""#, r#""format_version":"\u0032""#),
        (r#"components":"2""#, r#"components":"+2""#),
        (r#"components":"2""#, r#"components":"+""#),
        (r#"components":"2""#, r#"components":"02""#),
        (r#"components":"2""#, r#"components":" 2""#),
        (r#"components":"2""#, r#"components":"-2""#),
        (r#"components":"2""#, r#"components":"""#),
        (
            r#"components":"2""#,
            r#"components":"18446744073709551618""#,
        ),
        (r#"components":"2""#, r#"components":"0""#),
        (r#""facetness,grain"#, r#"",facetness,grain"#),
        (r#""facetness,grain"#, r#""sphericity,facetness,grain"#),
        (r#""facetness,grain"#, r#""sphericityfacetness,grain"#),
        (r#""facetness,grain"#, r#""dust,facetness,grain"#),
        (r#""format_version":"2""#, r#""format_version":"1""#),
        (r#""substrate":"black""#, r#""substrate":"Black""#),
        (r#""substrate":"black","#, ""),
        (r#""substrate":"black""#, r#""substrate":"layers""#),
        (r#""precision":"f32""#, r#""precision":"f64""#),
        (r#""precision":"f32""#, r#""precision":"quantised""#),
        (r#""precision":"f32","#, ""),
        (r#""basis":"linear""#, r#""basis":"log""#),
        (r#""basis":"linear""#, r#""basis":"cubic""#),
        (r#""quantities":"transmittance,reflectance","#, ""),
        (
            r#""quantities":"transmittance,reflectance""#,
            r#""quantities":"reflectance""#,
        ),
        (r#""__metadata__":{"#, r#""__metadata__":null,"other":{"#),
        (
            r#""__metadata__":{"#,
            r#""__metadata__":null,"__metadata__":{"#,
        ),
        (r#""__metadata__":{"#, r#""__metadata__":{"x":null,"#),
        (
            r#""__metadata__":{"#,
            r#""__metadata__":{"x":"","x":"\u0000","#,
        ),
        (
            r#""__metadata__":{"#,
            "\"__metadata__\":{\"\u{e9}\u{10ffff}\":\"\",\"",
        ),
    ] {
        replacements.push((from, to.to_owned()));
    }
    let mut files = Vec::new();
    for (from, to) in &replacements {
        files.push(with_header(bytes, |header| {
            let header = String::from_utf8(header).unwrap();
            assert!(header.contains(from), "{from} {header}");
            header.replacen(from, to, 1).into_bytes()
        }));
    }
    // invalid UTF-8 within the header
    for invalid in [
        &b"\xff"[..],
        b"\xed\xa0\x80",
        b"\xc0\x80",
        b"\xf4\x90\x80\x80",
        b"\xe2\x82",
    ] {
        files.push(with_header(bytes, |header| {
            [
                b"{\"__metadata__\":{\"x\":\"",
                invalid,
                b"\",",
                &header[17..],
            ]
            .concat()
        }));
    }
    // additional bytes after and before the header
    for addition in [&b"\0"[..], b"  \n\t\r", b"x", b"{}", b"\x0b"] {
        files.push(with_header(bytes, |header| [&header, addition].concat()));
        files.push(with_header(bytes, |header| [addition, &header].concat()));
    }
    for header in ["{}", "[]", "{", "\"\"", "1 ", "{\"__metadata__\":null}"] {
        files.push(with_header(bytes, |_| header.into()));
        files.push([&(header.len() as u64).to_le_bytes(), header.as_bytes()].concat());
    }
    for length in [0, 1, 2, 16 << 20, (16 << 20) + 1, u64::MAX, u64::MAX - 7] {
        files.push([&u64::to_le_bytes(length), &bytes[8..]].concat());
    }
    files
}

/// Files with views, and with their axes or their content changed. `plain` has no views.
fn changed_content(plain: &[u8]) -> Vec<Vec<u8>> {
    let nodes = |values: &[f64]| values.to_vec();
    let small = Contents {
        axes: Axes::from([
            (Parameter::View, nodes(&[0.0, 30.0])),
            (Parameter::RelativeAzimuth, nodes(&[0.0, 90.0, 180.0])),
            (Parameter::Facetness, nodes(&[0.3])),
            (Parameter::GrainSize, nodes(&[100.0, 200.0])),
            (Parameter::Density, nodes(&[300.0])),
            (Parameter::Thickness, nodes(&[5.0])),
            (Parameter::Incidence, nodes(&[0.0, 60.0])),
        ]),
        nm: nodes(&[500.0, 600.0]),
        choice: Choice::Components(2),
        quantities: vec![Quantity::Reflectance],
        ..Contents::default()
    };
    let views = small.bytes();
    let order = "view_deg,relative_azimuth_deg,facetness";
    let [view, azimuth] = [r#""view_deg":{"#, r#""relative_azimuth_deg":{"#];
    let content = r#""content":"anisotropy_factor","#;
    // an axis that may have the same values
    let [carbon, carbon_tensor] = ["black_carbon_ng_g", r#""black_carbon_ng_g":{"#];
    let one = |name: &str| format!("{name},{carbon},facetness");
    let changes: Vec<Vec<(&str, String)>> = vec![
        vec![(content, String::new())],
        vec![(content, r#""content":"anisotropy_factors","#.into())],
        vec![(content, r#""content":"","#.into())],
        vec![(content, r#""content":"anisotropy\u005ffactor","#.into())],
        vec![(r#""basis":"linear""#, r#""basis":"log""#.into())],
        vec![(order, "relative_azimuth_deg,view_deg,facetness".into())],
        vec![(order, "view_deg,facetness".into())],
        vec![(
            order,
            "view_deg,view_deg,relative_azimuth_deg,facetness".into(),
        )],
        vec![(order, one("view_deg")), (azimuth, carbon_tensor.into())],
        vec![
            (order, one("relative_azimuth_deg")),
            (view, carbon_tensor.into()),
        ],
        vec![
            (order, one("view_deg")),
            (azimuth, carbon_tensor.into()),
            (content, String::new()),
        ],
        vec![
            (order, format!("{carbon},view_deg,facetness")),
            (azimuth, carbon_tensor.into()),
        ],
    ];
    let changed = changes.into_iter().map(|pairs| {
        with_header(&views, |header| {
            let mut header = String::from_utf8(header).unwrap();
            for (from, to) in pairs {
                assert!(header.contains(from), "{from} {header}");
                header = header.replacen(from, &to, 1);
            }
            header.into_bytes()
        })
    });
    let changed = changed.collect::<Vec<_>>();
    let metadata = r#""__metadata__":{"#;
    let stated = ["anisotropy_factor", "reflectance", ""].map(|value| {
        with_header(plain, |header| {
            let header = String::from_utf8(header).unwrap();
            let to = format!(r#"{metadata}"content":"{value}","#);
            header.replacen(metadata, &to, 1).into_bytes()
        })
    });
    [vec![views], changed, stated.into()].concat()
}

/// The C header refuses exactly the files that the Rust reader refuses.
#[test]
fn the_same_files_are_refused_as_by_rust() {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/compact");
    let mut files = Vec::new();
    for entry in fs::read_dir(&seeds).unwrap() {
        files.push(fs::read(entry.unwrap().path()).unwrap());
    }
    let valid = fs::read(seeds.join("valid.safetensors")).unwrap();
    let views = changed_content(&valid);
    files.push(views[0].clone());
    let originals = files.clone();
    files.extend(views);
    files.extend((0..valid.len()).map(|end| valid[..end].to_vec()));
    files.push([valid.as_slice(), &[0]].concat());
    files.extend(unusual_headers(&valid));
    let mut random = Random(2);
    for i in 0..8000 {
        let mut bytes = originals[i % originals.len()].clone();
        for _ in 0..1 + random.below(3) {
            // half of the new bytes are characters of JSON
            let new_bytes = [
                random.below(256) as u8,
                b"0123456789{}[],:\"\\eE.-+ nF"[random.below(26)],
            ];
            let offset = random.below(bytes.len());
            match random.below(4) {
                0 => bytes[offset] ^= 1 << random.below(8),
                1 => bytes[offset] = new_bytes[0],
                2 => bytes[offset] = new_bytes[1],
                _ => {
                    let position = 8 + random.below(bytes.len() - 8);
                    bytes[position] = new_bytes[1];
                }
            }
        }
        files.push(bytes);
    }
    let folder = folder("files");
    let [pack, out] = ["pack", "out"].map(|name| folder.join(name));
    let packed = files.iter().flat_map(|bytes| {
        let length = (bytes.len() as u64).to_le_bytes();
        [&length, bytes.as_slice()].concat()
    });
    fs::write(&pack, packed.collect::<Vec<u8>>()).unwrap();
    run(Command::new(&*ANSWERS).arg("files").args([&pack, &out]));
    let found = fs::read_to_string(&out).unwrap();
    let found: Vec<&str> = found.lines().collect();
    assert_eq!(found.len(), files.len());
    let mut accepted = 0;
    for (i, (bytes, found)) in files.iter().zip(found).enumerate() {
        let rust = Database::from_bytes(bytes);
        let header = String::from_utf8_lossy(bytes.get(8..).unwrap_or_default());
        assert_eq!(
            rust.is_ok(),
            found == "ok",
            "{i}: {:?} {found} {header}",
            rust.err()
        );
        accepted += usize::from(rust.is_ok());
    }
    let views = changed_content(&valid);
    let accepted_views = views.iter().filter(|f| Database::from_bytes(f).is_ok());
    assert_eq!(accepted_views.count(), 2, "the file itself, and an escape");
    eprintln!("{} files, {accepted} accepted", files.len());
    assert!(
        accepted > 800 && files.len() - accepted > 5000,
        "{accepted}"
    );
}
