//! Look-up tables for renderers (`export --format lut`): the images hold the colours of the
//! compact file, the sidecar describes them, and its certificate is what others measure too.
#![allow(clippy::unwrap_used)]
use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde_json::Value;
use splitsnow::colour::{Colorimeter, Viewing, delta_e, relative_lab};
use splitsnow::export::{Lut, LutOptions, Primaries};
use splitsnow::parameter::Axes;
use splitsnow::{Database, Lookup, Parameter, Point, Quantity};

const SNOW: [f64; 5] = [0.3, 300.0, 275.0, 1.0, 0.0];
/// X, Y and Z of D65.
const WHITE: [f64; 3] = [0.3127 / 0.329, 1.0, 0.3583 / 0.329];

fn file(name: &str) -> Database {
    Database::open(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

fn snow() -> Database {
    file("examples/mitsuba/snow.safetensors")
}

/// A table as its files describe it.
struct Table {
    about: Value,
    texts: BTreeMap<String, String>,
    width: usize,
    /// Columns of each row, not scaled.
    texels: Vec<[f64; 3]>,
    reflected: Vec<[f64; 3]>,
}

/// The pixels of an image, row by row.
fn pixels(path: &Path) -> (usize, Vec<[f64; 3]>) {
    let image = read_first_flat_layer_from_file(path).unwrap();
    let channels = &image.layer_data.channel_data.list;
    let names: Vec<_> = channels.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R"]);
    let values = |channel: usize| match &channels[channel].sample_data {
        FlatSamples::F16(values) => values.clone(),
        other => panic!("{other:?}"),
    };
    let [blue, green, red] = [0, 1, 2].map(values);
    let pixel = |i: usize| [red[i], green[i], blue[i]].map(f64::from);
    let all = (0..red.len()).map(pixel).collect();
    (image.layer_data.size.width(), all)
}

impl Table {
    fn new(database: &Database, options: LutOptions) -> Self {
        let lut = Lut::new(database, Point::from_core(SNOW), options).unwrap();
        Self::of(&lut)
    }

    fn of(lut: &Lut) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let files = lut.files("snow").unwrap();
        for (name, bytes) in &files {
            std::fs::write(dir.path().join(name), bytes).unwrap();
        }
        let texts = files.into_iter().filter_map(|(name, bytes)| {
            let text = String::from_utf8(bytes).ok()?;
            Some((name, text))
        });
        let texts: BTreeMap<_, _> = texts.collect();
        let about: Value = serde_json::from_str(&texts["snow.json"]).unwrap();
        let (width, texels) = pixels(&dir.path().join("snow.exr"));
        let strip = dir.path().join("snow_reflectance.exr");
        let reflected = if strip.exists() {
            pixels(&strip).1
        } else {
            Vec::new()
        };
        Self {
            about,
            texts,
            width,
            texels,
            reflected,
        }
    }

    fn number(&self, path: &str) -> f64 {
        self.about.pointer(path).unwrap().as_f64().unwrap()
    }

    fn matrix(&self, name: &str) -> [[f64; 3]; 3] {
        serde_json::from_value(self.about["primaries"][name].clone()).unwrap()
    }

    /// Interpolates as a sampler does, at a coordinate of 0 to 1.
    fn sample(&self, u: f64, v: f64) -> [f64; 3] {
        let height = self.texels.len() / self.width;
        let place = |c: f64, n: usize| (c * n as f64 - 0.5).clamp(0.0, (n - 1) as f64);
        let (x, y) = (place(u, self.width), place(v, height));
        let (i, j) = (
            (x as usize).min(self.width - 2),
            (y as usize).min(height - 2),
        );
        let (a, b) = (x - i as f64, y - j as f64);
        [0, 1, 2].map(|c| {
            let texel = |i: usize, j: usize| self.texels[j * self.width + i][c];
            let low = texel(i, j) * (1.0 - a) + texel(i + 1, j) * a;
            let high = texel(i, j + 1) * (1.0 - a) + texel(i + 1, j + 1) * a;
            low * (1.0 - b) + high * b
        })
    }

    /// The linear colour, by the mapping of the sidecar.
    fn colour(&self, cm: f64, cosine: f64) -> [f64; 3] {
        let axis = |axis: &str, key: &str| self.number(&format!("/transmittance/{axis}/{key}"));
        let h = cm.clamp(axis("u", "first"), axis("u", "last"));
        let c = cosine.clamp(axis("v", "first"), axis("v", "last"));
        let u = axis("u", "scale") * h.powf(0.25) + axis("u", "offset");
        let v = axis("v", "scale") * c + axis("v", "offset");
        let scale = self.number("/transmittance/scale");
        self.sample(u, v).map(|value| value / scale)
    }
}

fn times(matrix: [[f64; 3]; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * x + row[1] * y + row[2] * z)
}

/// Solves `matrix` x = `right` by Cramer's rule.
fn solved(matrix: [[f64; 3]; 3], right: [f64; 3]) -> [f64; 3] {
    let det = |m: [[f64; 3]; 3]| {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    };
    [0, 1, 2].map(|column: usize| {
        let mut replaced = matrix;
        for (row, value) in replaced.iter_mut().zip(right) {
            row[column] = value;
        }
        det(replaced) / det(matrix)
    })
}

/// What the compact file says.
struct Truth {
    lookup: Lookup,
    eye: Colorimeter,
}

impl Truth {
    fn new(database: &Database, viewing: &Viewing, quantity: Quantity) -> Self {
        let eye = Colorimeter::piecewise_linear(database.wavelengths_nm(), viewing);
        let (lookup, eye) = (
            Lookup::new(database, quantity).unwrap(),
            eye.unwrap().unwrap(),
        );
        Self { lookup, eye }
    }

    fn spectrum(&self, cm: f64, deg: f64) -> Vec<f64> {
        let point = Point::from_core(SNOW).with(Parameter::Thickness, cm);
        let mut spectrum = vec![0.0; self.lookup.wavelengths()];
        let point = point.with(Parameter::Incidence, deg);
        self.lookup.spectrum(point, &mut spectrum).unwrap();
        spectrum.into_iter().map(f64::from).collect()
    }
}

#[test]
fn the_certificate_holds_between_texels() {
    let database = snow();
    let truth = Truth::new(&database, &Viewing::default(), Quantity::Transmittance);
    let table = Table::new(&database, LutOptions::default());
    assert_eq!((table.width, table.texels.len()), (256, 256 * 32));
    let certified = table.number("/certificate/largest/delta_e");
    assert!(certified > 0.0 && certified < 0.05, "{certified}");
    let matrix = table.matrix("from_xyz_d65");
    let last = table.number("/transmittance/u/last");
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let (mut largest, mut exposed) = (0.0_f64, 0.0_f64);
    for _ in 0..20_000 {
        // as many thin as thick ones
        let cm = (last + 1.0).powf(random.random::<f64>()) - 1.0;
        let deg = 80.0 * random.random::<f64>();
        let spectrum = truth.spectrum(cm, deg);
        let xyz = solved(matrix, table.colour(cm, deg.to_radians().cos()));
        let found = [0, 1, 2].map(|c: usize| xyz[c] / WHITE[c]);
        let exact = truth.eye.relative_xyz(&spectrum);
        let white = [0, 1, 2].map(|c: usize| exact[c] * WHITE[c]);
        let shown = times(matrix, white).map(|value| value.max(0.0));
        let shown = solved(matrix, shown);
        let exact = [0, 1, 2].map(|c: usize| shown[c] / WHITE[c]);
        largest = largest.max(delta_e(relative_lab(found), relative_lab(exact)));
        let bright = (0.5 / exact[1]).max(1.0);
        if bright <= 1000.0 {
            let [found, exact] = [found, exact].map(|xyz| relative_lab(xyz.map(|v| v * bright)));
            exposed = exposed.max(delta_e(found, exact));
        }
    }
    assert!(largest < 1.1 * certified, "{largest} {certified}");
    assert!(largest > 0.5 * certified, "{largest} {certified}");
    let certified = table.number("/certificate/exposed/delta_e");
    assert!(exposed < 1.1 * certified, "{exposed} {certified}");
    assert!(exposed > 0.5 * certified, "{exposed} {certified}");
}

/// The texels are look-ups rounded to half floats, in rows of equal cosines.
#[test]
fn texels_are_look_ups() {
    let database = snow();
    let transmittance = Truth::new(&database, &Viewing::default(), Quantity::Transmittance);
    let reflectance = Truth::new(&database, &Viewing::default(), Quantity::Reflectance);
    let options = LutOptions {
        primaries: Primaries::Xyz,
        last_cm: Some(40.0),
        thicknesses: 33,
        cosines: 5,
        ..LutOptions::default()
    };
    let table = Table::new(&database, options);
    assert_eq!(table.number("/transmittance/u/last"), 40.0);
    let near = |found: [f64; 3], scale: f64, xyz: [f64; 3]| {
        for c in 0..3 {
            let expected = scale * xyz[c] * WHITE[c];
            // one and a half units of the last of eleven bits
            let allowed = 1.5 * expected.abs() / 1024.0 + 1e-6;
            assert!(
                (found[c] - expected).abs() < allowed,
                "{} {expected}",
                found[c]
            );
        }
    };
    let angles = database.axes().values(Parameter::Incidence);
    let lowest = angles[angles.len() - 1].to_radians().cos();
    for row in 0..5 {
        let cosine = lowest + (1.0 - lowest) * row as f64 / 4.0;
        let deg = cosine
            .min(1.0)
            .acos()
            .to_degrees()
            .min(angles[angles.len() - 1]);
        for (column, cm) in [(0, 0.0), (32, 40.0)] {
            let xyz = transmittance
                .eye
                .relative_xyz(&transmittance.spectrum(cm, deg));
            near(table.texels[row * 33 + column], 32768.0, xyz);
        }
        let thickest = table.number("/reflectance/thickness_cm");
        let xyz = reflectance
            .eye
            .relative_xyz(&reflectance.spectrum(thickest, deg));
        near(table.reflected[row], 1.0, xyz);
    }
}

/// White is white under every light; colours agree with the library's, and between primaries.
#[test]
fn primaries_and_lights_are_consistent() {
    let database = snow();
    for light in ["D65", "A"] {
        let viewing = Viewing {
            illuminants: vec![light.parse().unwrap()],
            ..Viewing::default()
        };
        let truth = Truth::new(&database, &viewing, Quantity::Transmittance);
        // where Rec.709 holds all colours
        let expected = truth.eye.linear_srgb(&truth.spectrum(3.0, 20.0));
        for primaries in Primaries::ALL {
            let options = LutOptions {
                light: light.parse().unwrap(),
                primaries,
                ..LutOptions::default()
            };
            let table = Table::new(&database, options);
            assert_eq!(table.about["light"], light);
            assert_eq!(table.about["primaries"]["name"], primaries.name());
            let white = table.colour(0.0, 1.0);
            let one = if primaries == Primaries::Xyz {
                WHITE
            } else {
                [1.0; 3]
            };
            for c in 0..3 {
                assert!((white[c] - one[c]).abs() < 1e-3, "{primaries:?} {white:?}");
            }
            let colour = table.colour(3.0, 20_f64.to_radians().cos());
            let found = times(table.matrix("to_linear_rec709"), colour);
            for c in 0..3 {
                let error = (found[c] / expected[c] - 1.0).abs();
                assert!(
                    error < 3e-3,
                    "{primaries:?} {light}: {found:?} {expected:?}"
                );
            }
        }
    }
}

#[test]
fn what_primaries_cannot_show_is_stated() {
    let database = snow();
    let clipped = |primaries| {
        let table = Table::new(
            &database,
            LutOptions {
                primaries,
                ..LutOptions::default()
            },
        );
        let zeros = table
            .texels
            .iter()
            .filter(|texel| texel.contains(&0.0))
            .count();
        (table.about["clipping"].clone(), zeros)
    };
    let (rec709, zeros) = clipped(Primaries::Rec709);
    assert_eq!(rec709["texels"], zeros);
    assert!(zeros > 100);
    let from = rec709["from_cm"].as_f64().unwrap();
    assert!((15.0..30.0).contains(&from), "{from}");
    let costs = rec709["exposed"]["delta_e"].as_f64().unwrap();
    assert!(costs > 5.0, "{costs}");
    let (xyz, zeros) = clipped(Primaries::Xyz);
    assert_eq!((xyz["texels"].as_u64(), zeros), (Some(0), 0));
    assert_eq!(xyz["from_cm"], Value::Null);
    assert_eq!(xyz["exposed"], Value::Null);
}

#[test]
fn shaders_have_the_numbers_of_the_sidecar() {
    let table = Table::new(&snow(), LutOptions::default());
    for end in ["osl", "glsl", "hlsl", "wgsl", "mtlx"] {
        let text = &table.texts[&format!("snow.{end}")];
        assert!(!text.contains('@'), "{text}");
        assert!(
            text.contains("snow.exr") && text.contains("snow_reflectance.exr"),
            "{end}"
        );
        for key in [
            "u/scale", "u/offset", "u/first", "u/last", "v/first", "v/last",
        ] {
            let number = format!("{:?}", table.number(&format!("/transmittance/{key}")));
            assert!(text.contains(&number), "{end}: {key} {number}");
        }
        let scale = table.number("/transmittance/scale");
        let scale = if end == "mtlx" { scale } else { 1.0 / scale };
        assert!(text.contains(&format!("{scale:?}")), "{end}: {scale}");
    }
}

/// A file of transmittance alone has no table of reflectance, and none of its names in shaders.
#[test]
fn what_a_file_lacks_is_left_out() {
    let axis = |values: &[f64]| values.to_vec();
    let axes = Axes::default()
        .with(Parameter::Facetness, axis(&[0.3]))
        .with(Parameter::GrainSize, axis(&[300.0]))
        .with(Parameter::Density, axis(&[275.0]))
        .with(Parameter::Thickness, axis(&[1.0, 5.0]))
        .with(Parameter::Incidence, axis(&[0.0]));
    let nm: Vec<f64> = (0..=16).map(|i| 380.0 + 25.0 * f64::from(i)).collect();
    let share = |(row, _): (usize, usize)| [0.5, 0.1][row];
    let curves = Array2::from_shape_fn((2, nm.len()), share);
    let database = |substrate| Database::from_curves(substrate, &axes, &nm, Some(&curves), None);
    let table = Table::new(&database(true), LutOptions::default());
    assert_eq!(table.about["reflectance"], Value::Null);
    assert_eq!(table.about["certificate"]["reflectance"], Value::Null);
    assert!(table.reflected.is_empty());
    for (name, text) in table.texts {
        assert!(
            name == "snow.json" || !text.contains("reflectance"),
            "{name}"
        );
    }
    // a single angle holds for all; grey snow is grey
    let options = LutOptions {
        primaries: Primaries::Rec709,
        ..LutOptions::default()
    };
    let table = Table::new(&database(false), options);
    assert_eq!(table.number("/transmittance/u/first"), 1.0);
    for cosine in [0.0, 0.5, 1.0] {
        for value in table.colour(1.0, cosine) {
            assert!((value - 0.5).abs() < 1e-3, "{value}");
        }
    }
}

#[test]
fn tables_that_cannot_be_made_are_refused() {
    let database = snow();
    let message = |options| {
        let lut = Lut::new(&database, Point::from_core(SNOW), options);
        lut.unwrap_err().to_string()
    };
    let options = LutOptions {
        last_cm: Some(0.0),
        ..LutOptions::default()
    };
    assert_eq!(
        message(options),
        "cannot make a look-up table: the snow is thinnest at 0 cm, and the table ends at 0 cm; give a larger --last-cm"
    );
    let outside = Point::from_core(SNOW).with(Parameter::Density, 900.0);
    let error = Lut::new(&database, outside, LutOptions::default()).unwrap_err();
    assert!(error.to_string().contains("density_kg_m3 = 900"), "{error}");
    let lut = Lut::new(&database, Point::from_core(SNOW), LutOptions::default()).unwrap();
    for name in ["", "a b", "a\"b", "schnee\u{fc}"] {
        let error = lut.files(name).unwrap_err().to_string();
        assert!(error.contains(&format!("`{name}`")), "{error}");
    }
}
