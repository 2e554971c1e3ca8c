//! `include/splitsnow.h`, compiled with warnings as errors and sanitizers: it answers
//! as the Rust library does, and refuses the files that it refuses.
//!
//! With SPLITSNOW_FILE a compact file of one's own is compared, too.
#![allow(clippy::unwrap_used)]
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use ndarray::Array2;
use palette::convert::FromColorUnclamped;
use palette::white_point::{Any, D65, WhitePoint};
use palette::{LinSrgb, Xyz};
use splitsnow::colour::{Colorimeter, ColourDifference, Illuminant, UnitWhite, Viewing};
use splitsnow::compress::{Basis, Choice, CompactFile, Precision, Variant, compress};
use splitsnow::grid::{Axes, Compression, Conditions, ExtraAxis};
use splitsnow::lookup::{Database, Lookup, Point};
use splitsnow::measurement::Quantity;
use splitsnow::spectrum::Resampling;

const STRICT: [&str; 6] = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Werror",
];
const CHECKED: &str = "-fsanitize=address,undefined";
/// Wavelengths that tests/c/answers.c asks spectra at.
const AT: [f64; 6] = [100.0, 433.3, 433.4, 555.0, 700.0, 3000.0];

/// A folder of this test's own.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c").join(name);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn run(command: &mut Command) -> String {
    let output = command.output();
    let output =
        output.unwrap_or_else(|e| panic!("{command:?}: {e}; a C and C++ compiler is needed"));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{command:?}: {text}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A program from one source file, strictly.
fn compiled(source: &Path, sanitizer: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = folder("bin").join(source.file_stem().unwrap());
    let (compiler, standard) = match source.extension().unwrap().to_str() {
        Some("c") => ("cc", "-std=c99"),
        _ => ("c++", "-std=c++17"),
    };
    let mut command = Command::new(compiler);
    command
        .args(STRICT)
        .args([standard, "-O1", "-g", sanitizer]);
    command.arg("-fno-sanitize-recover=all");
    command.arg("-I").arg(root.join("include"));
    command.arg(root.join(source)).arg("-o").arg(&program);
    run(command.args(["-lm", "-pthread"]));
    program
}

static ANSWERS: LazyLock<PathBuf> =
    LazyLock::new(|| compiled(Path::new("tests/c/answers.c"), CHECKED));

/// Numbers without a pattern, in [0, 1).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

/// Something like snow, with all that decides it.
fn curve(row: &[f64], nm: &[f64], quantity: Quantity) -> Vec<f64> {
    let [beyond @ .., facetness, size, density, thickness, angle] = row else {
        panic!("five axes")
    };
    let dirt = 1.0 + beyond.iter().map(|v| v.abs().sqrt()).sum::<f64>() / 20.0;
    let scatter = 6.0 * density / size * (1.0 - 0.4 * (-facetness / 0.2).exp());
    let z = (0.7 + 0.5 * angle.to_radians().cos()) / scatter;
    let value = |nm: &f64| {
        let k = (scatter * density * 1e-6 * dirt * (nm / 700.0).powi(8)).sqrt();
        let t = (k * z).sinh() / (k * (thickness + z)).sinh();
        match quantity {
            Quantity::Transmittance => t,
            Quantity::Reflectance => 0.97 - (0.9 * t).max(z / (thickness + z)),
        }
    };
    nm.iter().map(value).collect()
}

/// A compact file: what is in it, and how.
struct Made {
    axes: Axes,
    nm: Vec<f64>,
    variant: Variant,
    choice: Choice,
    there: Vec<Quantity>,
    extra: BTreeMap<String, String>,
}

impl Default for Made {
    fn default() -> Self {
        Self {
            axes: Axes {
                facetness: vec![0.1, 0.4, 0.9],
                grain_size_um: vec![100.0, 180.0, 400.0],
                density_kg_m3: vec![200.0, 350.0],
                thickness_cm: vec![0.5, 1.0, 2.0, 5.0, 10.0, 30.0],
                angle_deg: vec![0.0, 30.0, 60.0, 80.0, 89.0],
                ..Axes::default()
            },
            nm: (40..=70).map(|i| f64::from(i) * 10.0).collect(),
            variant: Variant::default(),
            choice: Choice::Components(5),
            there: Quantity::ALL.into(),
            extra: BTreeMap::new(),
        }
    }
}

impl Made {
    fn bytes(&self) -> Vec<u8> {
        let beyond = self.axes.extra.values().map(Vec::as_slice);
        let five = self.axes.named().map(|(_, values)| values);
        let mut rows = vec![Vec::new()];
        for values in beyond.chain(five) {
            let longer = |head: Vec<f64>| {
                let with = move |value: &f64| [head.as_slice(), &[*value]].concat();
                values.iter().map(with).collect::<Vec<_>>()
            };
            rows = rows.into_iter().flat_map(longer).collect();
        }
        let [t, r] = Quantity::ALL.map(|quantity| {
            let over = self.extra.contains_key("bottom_boundary");
            let values = rows.iter().flat_map(|row| {
                let mut curve = curve(row, &self.nm, quantity);
                if over && quantity == Quantity::Reflectance {
                    let ground = 0.35 * (-row[row.len() - 2]).exp();
                    curve.iter_mut().for_each(|r| *r = 0.6 * *r + ground);
                }
                curve
            });
            let curves = Array2::from_shape_vec((rows.len(), self.nm.len()), values.collect());
            let curves = curves.unwrap();
            let made = compress(curves.view(), quantity, None, self.choice, self.variant);
            self.there.contains(&quantity).then(|| made.unwrap())
        });
        CompactFile {
            axes: &self.axes,
            wavelengths_nm: &self.nm,
            transmittance: t.as_ref(),
            reflectance: r.as_ref(),
            provenance: "{}",
            extra: &self.extra,
        }
        .to_bytes()
        .unwrap()
    }
}

/// Files of every variant, by name.
fn variants() -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for basis in Basis::ALL {
        for precision in Precision::ALL {
            let variant = Variant { basis, precision };
            let made = Made {
                variant,
                ..Made::default()
            };
            let name = format!("{}_{}", basis.name(), precision.name());
            all.push((name, made.bytes()));
        }
    }
    let log = |precision| Variant {
        basis: Basis::Log,
        precision,
    };
    let beyond = |n: usize| {
        let axes = [
            (ExtraAxis::BlackCarbon, vec![0.0, 50.0, 200.0]),
            (ExtraAxis::WaterSaturation, vec![0.0, 0.1]),
            (ExtraAxis::Temperature, vec![-20.0, -5.0]),
            (ExtraAxis::Sphericity, vec![0.6, 0.9]),
            (ExtraAxis::SubstrateReflectance, vec![0.25]),
        ];
        Axes {
            facetness: vec![0.3, 0.5],
            grain_size_um: vec![100.0, 300.0],
            density_kg_m3: vec![300.0],
            thickness_cm: vec![1.0, 3.0, 9.0, 20.0],
            angle_deg: vec![0.0, 70.0],
            extra: axes.into_iter().skip(5 - n).collect(),
        }
    };
    for (name, variant, n) in [
        ("beyond_log", log(Precision::F32), 5),
        ("beyond_quantised", log(Precision::Quantised), 3),
        ("beyond_linear", Variant::default(), 4),
    ] {
        let made = Made {
            axes: beyond(n),
            variant,
            ..Made::default()
        };
        all.push((name.to_owned(), made.bytes()));
    }
    // 8 bits; few wavelengths with straight lines between, as `fit` writes
    let loose = Choice::Bounds(Compression {
        max_delta_e: 2.3,
        max_rmse: Some(0.02),
    });
    let fitted = Made {
        nm: vec![400.0, 431.5, 480.0, 550.0, 611.0, 655.0, 690.0, 760.25],
        variant: log(Precision::Quantised),
        choice: loose,
        extra: [("between_wavelengths".into(), "linear".into())].into(),
        ..Made::default()
    };
    all.push(("fitted".into(), fitted.bytes()));
    // over a ground, where snow darkens what is under it
    for (name, basis) in [("ground_linear", Basis::Linear), ("ground_log", Basis::Log)] {
        let made = Made {
            variant: Variant {
                basis,
                ..Variant::default()
            },
            extra: [("bottom_boundary".into(), "Lambertian ground".into())].into(),
            ..Made::default()
        };
        all.push((name.to_owned(), made.bytes()));
    }
    // more components than are summed at once, and one quantity
    let many = Made {
        nm: (0..90).map(|i| 380.0 + 5.0 * f64::from(i)).collect(),
        variant: log(Precision::F32),
        choice: Choice::Components(90),
        there: vec![Quantity::Reflectance],
        ..Made::default()
    };
    all.push(("many".into(), many.bytes()));
    for (name, thickness_cm) in [("thick", vec![15.0]), ("two_thick", vec![5.0, 15.0])] {
        let axes = Axes {
            thickness_cm,
            angle_deg: vec![30.0],
            ..Made::default().axes
        };
        let made = Made {
            axes,
            nm: vec![900.0],
            choice: Choice::Components(1),
            there: vec![Quantity::Transmittance],
            ..Made::default()
        };
        all.push((name.to_owned(), made.bytes()));
    }
    if let Some(path) = std::env::var_os("SPLITSNOW_FILE") {
        all.push(("given".into(), fs::read(path).unwrap()));
    }
    all
}

/// A point of the box, on its edges more often than chance, and a little outside.
fn point(database: &Database, numbers: &mut Numbers) -> [f64; 5] {
    let mut point = [0.0; 5];
    for (axis, (to, nodes)) in point.iter_mut().zip(database.axes()).enumerate() {
        let [first, last] = [nodes[0], nodes[nodes.len() - 1]].map(f64::from);
        *to = match numbers.below(24) {
            0 => f64::from(nodes[numbers.below(nodes.len())]),
            1 => last * (1.0 + 5e-7),
            2 if axis == 3 => first * numbers.next(),
            3 if axis == 3 => last * (1.0 + 3.0 * numbers.next()),
            4 if axis == 3 => 0.0,
            _ => first + (last - first) * numbers.next(),
        };
    }
    match numbers.below(200) {
        0 => point[numbers.below(5)] = f64::NAN,
        1 => point[numbers.below(5)] = -1.0,
        2 => point[numbers.below(5)] = 1e300,
        3 => point[4] = 89.5,
        4 => point[3] = 1e30,
        _ => {}
    }
    point
}

/// How spectra of the file are seen: as docs/c.md says.
fn colorimeter(database: &Database, illuminant: Illuminant) -> Option<Colorimeter> {
    let nm = database.wavelengths_nm();
    let viewing = Viewing {
        illuminants: vec![illuminant],
        difference: ColourDifference::Cie1976,
    };
    if !database.metadata().contains_key("between_wavelengths") {
        let nm: Vec<f64> = nm.iter().map(|nm| f64::from(*nm)).collect();
        return Colorimeter::viewing(&nm, &viewing).unwrap();
    }
    let [first, last] = [nm[0], nm[nm.len() - 1]].map(f64::from);
    let steps = (72..=166).map(|i| 5.0 * f64::from(i));
    let steps: Vec<f64> = steps.filter(|nm| (first..=last).contains(nm)).collect();
    let colorimeter = Colorimeter::viewing(&steps, &viewing).unwrap();
    colorimeter.map(|seen| seen.resampled(&Resampling::new(nm, &steps)))
}

/// X, Y, Z as shares of white.
fn relative(colorimeter: &Colorimeter, spectrum: &[f64]) -> [f64; 3] {
    let xyz = Xyz::<UnitWhite, f64>::from_color_unclamped(colorimeter.lab(spectrum));
    [xyz.x, xyz.y, xyz.z]
}

/// What tests/c/answers.c writes of a point that Rust answers with `spectrum`.
fn expected(database: &Database, colours: &[Option<Colorimeter>], spectrum: &[f32]) -> Vec<f64> {
    let nm = database.wavelengths_nm();
    let spectrum: Vec<f64> = spectrum.iter().map(|v| f64::from(*v)).collect();
    let mut all = [spectrum.as_slice(), &spectrum].concat();
    all.extend(Resampling::new(nm, &AT).apply(&spectrum));
    // minus SPLITSNOW_ERROR_ARGUMENT where there is no colour
    for colour in colours {
        all.extend(colour.as_ref().map_or([-4.0; 3], |colour| {
            let (shares, white) = (relative(colour, &spectrum), colour.white());
            std::array::from_fn(|c| shares[c] * white[c])
        }));
    }
    all.extend(colours[0].as_ref().map_or([-4.0; 3], |colour| {
        let [x, y, z] = relative(colour, &spectrum);
        let white: Xyz<Any, f64> = D65::get_xyz();
        let xyz = Xyz::<D65, f64>::new(x * white.x, y * white.y, z * white.z);
        let rgb = LinSrgb::<f64>::from_color_unclamped(xyz);
        [rgb.red, rgb.green, rgb.blue]
    }));
    all
}

fn write_numbers(path: &Path, numbers: &[f64]) {
    let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_ne_bytes()).collect();
    fs::write(path, bytes).unwrap();
}

/// 10,000 points of all variants: answers differ by 1e-6 at most, and refusals agree.
#[test]
fn answers_are_those_of_rust() {
    let folder = folder("points");
    let [file, points, out] = ["snow.safetensors", "points", "out"].map(|n| folder.join(n));
    let mut numbers = Numbers(1);
    let (mut worst, mut asked, mut refused) = (0.0_f64, 0, 0);
    for (name, bytes) in variants() {
        fs::write(&file, &bytes).unwrap();
        let database = Database::from_bytes(&bytes).unwrap();
        let colours = Illuminant::ALL.map(|light| colorimeter(&database, light));
        for quantity in Quantity::ALL.into_iter().filter(|q| database.has(*q)) {
            // with axes beyond the five, at several places on them
            for _ in 0..if database.extra().is_empty() { 1 } else { 4 } {
                let beyond = database.extra().iter().map(|(axis, nodes)| {
                    let [first, last] = [nodes[0], nodes[nodes.len() - 1]].map(f64::from);
                    let u = [0.0, 1.0, numbers.next(), numbers.next()][numbers.below(4)];
                    (*axis, first + u * (last - first))
                });
                let conditions: Conditions = beyond.collect();
                let there = database.at(&conditions).unwrap();
                let lookup = Lookup::new(&there, quantity).unwrap();
                let of = |axis| 5 + ExtraAxis::ALL.iter().position(|a| *a == axis).unwrap();
                let mut given = vec![conditions.len() as f64];
                given.extend(conditions.iter().flat_map(|(a, v)| [of(*a) as f64, *v]));
                let count = if conditions.is_empty() { 500 } else { 125 };
                let mut all: Vec<_> = (0..count).map(|_| point(&there, &mut numbers)).collect();
                // several of each snow, which is prepared once
                for same in all.chunks_mut(5) {
                    let [facetness, size, density, ..] = same[0];
                    let snow = [facetness, size, density];
                    same[1..4]
                        .iter_mut()
                        .for_each(|p| p[..3].copy_from_slice(&snow));
                }
                given.extend(all.iter().flatten());
                write_numbers(&points, &given);
                let mut command = Command::new(&*ANSWERS);
                command.arg("points").arg(&file).arg(quantity.name());
                run(command.args([&points, &out]));

                let found = fs::read(&out).unwrap();
                let found: Vec<f64> = found
                    .as_chunks::<8>()
                    .0
                    .iter()
                    .map(|bytes| f64::from_ne_bytes(*bytes))
                    .collect();
                let each = 2 * lookup.wavelengths() + AT.len() + 18;
                assert_eq!(found.len(), each * all.len());
                for (point, found) in all.iter().zip(found.chunks(each)) {
                    let mut spectrum = vec![0.0; lookup.wavelengths()];
                    let at = Point::from_coordinates(*point);
                    if lookup.spectrum(at, &mut spectrum).is_err() {
                        // SPLITSNOW_ERROR_OUTSIDE, or as below
                        let (spectra, seen) = found.split_at(each - 18);
                        assert!(
                            spectra.iter().all(|v| *v == -8.0)
                                && seen.iter().all(|v| *v == -8.0 || *v == -4.0),
                            "{name} {point:?} {found:?}"
                        );
                        refused += 1;
                        continue;
                    }
                    let expected = expected(&database, &colours, &spectrum);
                    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                        let error = (found - expected).abs();
                        assert!(error <= 1e-6, "{name} {point:?} {i}: {found} {expected}");
                        worst = worst.max(error);
                    }
                    asked += 1;
                }
            }
        }
    }
    println!("{asked} points, {refused} refused, at most {worst:e} off");
    assert!(asked > 9_500 && refused > 100, "{asked} {refused}");
}

/// A file with its header text changed and its length kept true.
fn with_header(bytes: &[u8], change: impl FnOnce(Vec<u8>) -> Vec<u8>) -> Vec<u8> {
    let (length, rest) = bytes.split_first_chunk::<8>().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header = change(header.to_vec());
    [&(header.len() as u64).to_le_bytes(), &header[..], data].concat()
}

/// Headers that are odd, some of which mean what they meant before.
fn odd_headers(bytes: &[u8]) -> Vec<Vec<u8>> {
    let angle = r#""angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}"#;
    let nested = |n: usize| format!(r#""a":{}{}, "dtype":"F32""#, "[".repeat(n), "]".repeat(n));
    let mut swaps: Vec<(&str, String)> = Vec::new();
    for other in [
        r#""angle_deg":{"dtype":{"F32":null},"shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":{"F32":{}},"shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":{"F32":null,"F32":null},"shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":["F32",[2],[0,8]]"#,
        r#""angle_deg":["F32",[2],[0,8],1]"#,
        r#""angle_deg":["F32",[2]]"#,
        r#""angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0,8,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0]}"#,
        r#""angle_deg":{"dtype":"F32","dtype":"F32","shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[2]}"#,
        r#""angle_deg":{}"#,
        r#""angle_deg":null"#,
        r#""angle_deg":7,"angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"U8","shape":[9],"data_offsets":[3,2]},"angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0,8]},"angle_deg":{"dtype":"U8","shape":[9],"data_offsets":[3,2]}"#,
        r#""angle\u005fdeg":{"\u0064type":"F32","shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F3\u0032","shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg\u0000":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[2.0],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[-0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[02],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[2,],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[18446744073709551615,2],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[18446744073709551616],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[4611686018427387906],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F4","shape":[16],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F4","shape":[15],"data_offsets":[0,8]}"#,
        r#""angle_deg":{"dtype":"F32","shape":[],"data_offsets":[0,4]}"#,
        r#""nothing":{"dtype":"F32","shape":[0],"data_offsets":[0,0]},"angle_deg":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}"#,
        r#"  "angle_deg" : 	{"dtype":"F32" , "shape":[ 2 ],"data_offsets":[0 ,8] } "#,
    ] {
        swaps.push((angle, other.to_owned()));
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
        swaps.push((r#""dtype":"F32""#, format!(r#""a":{value},"dtype":"F32""#)));
    }
    swaps.extend([124, 125, 126, 127, 128, 5000].map(|n| (r#""dtype":"F32""#, nested(n))));
    for (from, to) in [
        (r#""format":"#, r#""format":"other","format":"#),
        (
            r#""format_version":"1""#,
            r#""format_version":"1","format_version":"2""#,
        ),
        (r#""format_version":"1""#, r#""format_version":1"#),
        (r#""format_version":"1""#, r#""format_version":"1\u0000""#),
        (r#""format_version":"1""#, r#""format_version":"\u0031""#),
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
        swaps.push((from, to.to_owned()));
    }
    let mut all = Vec::new();
    for (from, to) in &swaps {
        all.push(with_header(bytes, |header| {
            let header = String::from_utf8(header).unwrap();
            assert!(header.contains(from), "{from} {header}");
            header.replacen(from, to, 1).into_bytes()
        }));
    }
    // what is no text, behind and before the header
    for odd in [
        &b"\xff"[..],
        b"\xed\xa0\x80",
        b"\xc0\x80",
        b"\xf4\x90\x80\x80",
        b"\xe2\x82",
    ] {
        all.push(with_header(bytes, |header| {
            [b"{\"__metadata__\":{\"x\":\"", odd, b"\",", &header[17..]].concat()
        }));
    }
    for tail in [&b"\0"[..], b"  \n\t\r", b"x", b"{}", b"\x0b"] {
        all.push(with_header(bytes, |header| [&header, tail].concat()));
        all.push(with_header(bytes, |header| [tail, &header].concat()));
    }
    for header in ["{}", "[]", "{", "\"\"", "1 ", "{\"__metadata__\":null}"] {
        all.push(with_header(bytes, |_| header.into()));
        all.push([&(header.len() as u64).to_le_bytes(), header.as_bytes()].concat());
    }
    for length in [0, 1, 2, 16 << 20, (16 << 20) + 1, u64::MAX, u64::MAX - 7] {
        all.push([&u64::to_le_bytes(length), &bytes[8..]].concat());
    }
    all
}

/// The header refuses what the Rust reader refuses, and nothing else.
#[test]
fn hostile_files_are_refused_as_by_rust() {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/compact");
    let mut all = Vec::new();
    for entry in fs::read_dir(&seeds).unwrap() {
        all.push(fs::read(entry.unwrap().path()).unwrap());
    }
    let originals = all.clone();
    let valid = fs::read(seeds.join("valid.safetensors")).unwrap();
    all.extend((0..valid.len()).map(|end| valid[..end].to_vec()));
    all.push([valid.as_slice(), &[0]].concat());
    all.extend(odd_headers(&valid));
    let mut numbers = Numbers(2);
    for i in 0..8000 {
        let mut bytes = originals[i % originals.len()].clone();
        for _ in 0..1 + numbers.below(3) {
            // bytes of JSON as often as any
            let any = [
                numbers.below(256) as u8,
                b"0123456789{}[],:\"\\eE.-+ nF"[numbers.below(26)],
            ];
            let at = numbers.below(bytes.len());
            match numbers.below(4) {
                0 => bytes[at] ^= 1 << numbers.below(8),
                1 => bytes[at] = any[0],
                2 => bytes[at] = any[1],
                _ => {
                    let range = 8 + numbers.below(bytes.len() - 8);
                    bytes[range] = any[1];
                }
            }
        }
        all.push(bytes);
    }
    let folder = folder("files");
    let [pack, out] = ["pack", "out"].map(|name| folder.join(name));
    let packed = all.iter().flat_map(|bytes| {
        let length = (bytes.len() as u64).to_le_bytes();
        [&length, bytes.as_slice()].concat()
    });
    fs::write(&pack, packed.collect::<Vec<u8>>()).unwrap();
    run(Command::new(&*ANSWERS).arg("files").args([&pack, &out]));
    let found = fs::read_to_string(&out).unwrap();
    let found: Vec<&str> = found.lines().collect();
    assert_eq!(found.len(), all.len());
    let mut accepted = 0;
    for (i, (bytes, found)) in all.iter().zip(found).enumerate() {
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
    println!("{} files, {accepted} accepted", all.len());
    assert!(accepted > 800 && all.len() - accepted > 5000, "{accepted}");
}

/// What the functions refuse of their arguments, getters, and the table for textures.
#[test]
fn arguments_are_checked() {
    let program = compiled(Path::new("tests/c/arguments.c"), CHECKED);
    let folder = folder("arguments");
    let all: BTreeMap<_, _> = variants().into_iter().collect();
    let mut command = Command::new(program);
    for name in ["linear_f32", "beyond_log", "thick"] {
        let file = folder.join(name);
        fs::write(&file, &all[name]).unwrap();
        command.arg(file);
    }
    run(command.arg(&folder));
}

/// The compiler's checks of threads find no race, and all threads the same answers.
#[test]
fn threads_share_a_database() {
    let program = compiled(Path::new("tests/c/threads.cpp"), "-fsanitize=thread");
    let file = folder("threads").join("snow.safetensors");
    fs::write(&file, Made::default().bytes()).unwrap();
    run(Command::new(program).arg(&file));
}

/// The examples of docs/c.md are compiled as they stand, and answer.
#[test]
fn the_documented_examples_work() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/c.md"));
    let text = text.unwrap();
    let blocks = |language: &str| -> Vec<String> {
        let begin = format!("```{language}\n");
        let parts = text.split(&begin).skip(1);
        parts
            .map(|part| part.split("```").next().unwrap().to_owned())
            .collect()
    };
    let folder = folder("documented");
    let [program, table] = blocks("c").try_into().unwrap();
    let [renderer] = blocks("cpp").try_into().unwrap();
    let c = folder.join("example.c");
    // the second example goes on where the first asks
    let asks = "    /* per sample";
    assert!(program.contains(asks));
    let table: String = table.lines().map(|line| format!("    {line}\n")).collect();
    fs::write(
        &c,
        program.replace(asks, &format!("{table}    free(table);\n{asks}")),
    )
    .unwrap();
    let cpp = folder.join("renderer.cpp");
    fs::write(
        &cpp,
        format!("#define SPLITSNOW_IMPLEMENTATION\n{renderer}int main() {{}}\n"),
    )
    .unwrap();
    compiled(&cpp, CHECKED);

    let made = Made::default().bytes();
    let file = folder.join("snow.safetensors");
    fs::write(&file, &made).unwrap();
    let found = run(Command::new(compiled(&c, CHECKED)).arg(&file));
    let database = Database::from_bytes(&made).unwrap();
    let lookup = Lookup::new(&database, Quantity::Transmittance).unwrap();
    let mut spectrum = [0.0; 31];
    let point = Point::from_coordinates([0.4, 260.0, 270.0, 7.5, 33.0]);
    lookup.spectrum(point, &mut spectrum).unwrap();
    let values: Vec<f64> = found
        .lines()
        .take(4)
        .map(|line| line.split_once(',').unwrap().1.parse().unwrap())
        .collect();
    for (value, at) in values.iter().zip([5, 12, 20, 28]) {
        assert!((value - f64::from(spectrum[at])).abs() < 2e-6, "{found}");
    }
    assert_eq!(found.lines().count(), 5);
}
