//! Compact files of every variant.
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use ndarray::Array2;
use splitsnow::compress::{Bands, Basis, Choice, CompactFile, CompactVariant, Precision, compress};
use splitsnow::grid::Compression;
use splitsnow::lookup::SubstrateKind;
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Axes, Parameter};

/// A curve similar to that of snow. It depends on all axes.
fn curve(row: &[f64], nm: &[f64], quantity: Quantity) -> Vec<f64> {
    let [optional @ .., facetness, size, density, thickness, angle] = row else {
        panic!("a row must have at least five values")
    };
    let dirt = 1.0 + optional.iter().map(|v| v.abs().sqrt()).sum::<f64>() / 20.0;
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

/// A lobe of scattered light, as in anisotropy factors of snow. It depends on all axes.
fn factors(row: &[f64], nm: &[f64], quantity: Quantity) -> Vec<f64> {
    let [
        view,
        azimuth,
        optional @ ..,
        facetness,
        size,
        _,
        thickness,
        light,
    ] = row
    else {
        panic!("a row must have at least seven values")
    };
    let unit = |polar: f64, azimuth: f64| {
        let (sin, cos) = polar.to_radians().sin_cos();
        let (y, x) = azimuth.to_radians().sin_cos();
        [sin * x, sin * y, cos]
    };
    let pairs = unit(*light, 0.0).into_iter().zip(unit(*view, *azimuth));
    let cosine: f64 = pairs.map(|(a, b)| a * b).sum();
    let dirt = optional.iter().map(|v| v.abs().sqrt()).sum::<f64>() / 50.0;
    let height = 0.3 + 0.5 / (1.0 + thickness) + dirt + 0.2 * facetness;
    let value = |nm: &f64| {
        let sharpness = 1.0 + nm / 400.0 + size / 300.0;
        let lobe = height * (sharpness * (cosine - 1.0)).exp();
        match quantity {
            Quantity::Transmittance => 1.3 - lobe,
            Quantity::Reflectance => 0.8 + lobe,
        }
    };
    nm.iter().map(value).collect()
}

/// Contents and variant of a compact file.
pub(crate) struct Contents {
    pub(crate) axes: Axes,
    pub(crate) nm: Vec<f64>,
    pub(crate) variant: CompactVariant,
    pub(crate) choice: Choice,
    pub(crate) quantities: Vec<Quantity>,
    pub(crate) absent: Vec<usize>,
    pub(crate) substrate: SubstrateKind,
    pub(crate) extra: BTreeMap<String, String>,
}

impl Default for Contents {
    fn default() -> Self {
        Self {
            axes: Axes::from([
                (Parameter::Facetness, vec![0.1, 0.4, 0.9]),
                (Parameter::GrainSize, vec![100.0, 180.0, 400.0]),
                (Parameter::Density, vec![200.0, 350.0]),
                (Parameter::Thickness, vec![0.5, 1.0, 2.0, 5.0, 10.0, 30.0]),
                (Parameter::Incidence, vec![0.0, 30.0, 60.0, 80.0, 89.0]),
            ]),
            nm: (40..=70).map(|i| f64::from(i) * 10.0).collect(),
            variant: CompactVariant::default(),
            choice: Choice::Components(5),
            quantities: Quantity::ALL.into(),
            absent: Vec::new(),
            substrate: SubstrateKind::Black,
            extra: BTreeMap::new(),
        }
    }
}

impl Contents {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut rows = vec![Vec::new()];
        for (_, values) in self.axes.iter() {
            let extend = |row: Vec<f64>| {
                let append = move |value: &f64| [row.as_slice(), &[*value]].concat();
                values.iter().map(append).collect::<Vec<_>>()
            };
            rows = rows.into_iter().flat_map(extend).collect();
        }
        let [t, r] = Quantity::ALL.map(|quantity| {
            let has_substrate = self.substrate != SubstrateKind::Black;
            let values = rows.iter().flat_map(|row| {
                if self.axes.has(Parameter::View) {
                    return factors(row, &self.nm, quantity);
                }
                let mut curve = curve(row, &self.nm, quantity);
                if has_substrate && quantity == Quantity::Reflectance {
                    let from_substrate = 0.35 * (-row[row.len() - 2]).exp();
                    curve
                        .iter_mut()
                        .for_each(|r| *r = 0.6 * *r + from_substrate);
                }
                curve
            });
            let curves = Array2::from_shape_vec((rows.len(), self.nm.len()), values.collect());
            let curves = curves.unwrap();
            let compressed = compress(
                curves.view(),
                quantity,
                None,
                &Bands::new(&self.nm),
                self.choice,
                self.variant,
            );
            self.quantities
                .contains(&quantity)
                .then(|| compressed.unwrap())
        });
        CompactFile {
            axes: &self.axes,
            absent: &self.absent,
            wavelengths_nm: &self.nm,
            substrate: self.substrate,
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
pub(crate) fn variants() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for basis in Basis::ALL {
        for precision in Precision::ALL {
            let variant = CompactVariant { basis, precision };
            let contents = Contents {
                variant,
                ..Contents::default()
            };
            let name = format!("{}_{}", basis.name(), precision.name());
            files.push((name, contents.bytes()));
        }
    }
    let log = |precision| CompactVariant {
        basis: Basis::Log,
        precision,
    };
    let axes_with_optional = |n: usize| {
        let axes = [
            (Parameter::BlackCarbon, vec![0.0, 50.0, 200.0]),
            (Parameter::WaterSaturation, vec![0.0, 0.1]),
            (Parameter::Temperature, vec![-20.0, -5.0]),
            (Parameter::Sphericity, vec![0.6, 0.9]),
            (Parameter::SubstrateReflectance, vec![0.25]),
        ];
        let core = Axes::from([
            (Parameter::Facetness, vec![0.3, 0.5]),
            (Parameter::GrainSize, vec![100.0, 300.0]),
            (Parameter::Density, vec![300.0]),
            (Parameter::Thickness, vec![1.0, 3.0, 9.0, 20.0]),
            (Parameter::Incidence, vec![0.0, 70.0]),
        ]);
        let optional = axes.into_iter().skip(5 - n);
        optional.fold(core, |axes, (parameter, values)| {
            axes.with(parameter, values)
        })
    };
    for (name, variant, n) in [
        ("optional_axes_log", log(Precision::F32), 5),
        ("optional_axes_quantised", log(Precision::Quantised), 3),
        ("optional_axes_linear", CompactVariant::default(), 4),
    ] {
        let contents = Contents {
            axes: axes_with_optional(n),
            variant,
            ..Contents::default()
        };
        files.push((name.to_owned(), contents.bytes()));
    }
    // the mass of a listed absorber, beside black carbon and the sphericity
    for (name, variant) in [
        ("absorber_log", log(Precision::Quantised)),
        ("absorber_linear", CompactVariant::default()),
    ] {
        let masses = vec![0.0, 1.0, 20.0, 500.0];
        let contents = Contents {
            axes: axes_with_optional(2)
                .with(Parameter::BlackCarbon, vec![0.0, 100.0])
                .with(Parameter::Absorber, masses),
            variant,
            ..Contents::default()
        };
        files.push((name.to_owned(), contents.bytes()));
    }
    // 8 bits, and a few wavelengths with linear interpolation, as written by `tailor`
    let loose = Choice::Bounds(Compression {
        max_delta_e: 2.3,
        max_rmse: Some(0.02),
    });
    let tailored = Contents {
        nm: vec![400.0, 431.5, 480.0, 550.0, 611.0, 655.0, 690.0, 760.25],
        variant: log(Precision::Quantised),
        choice: loose,
        extra: [("between_wavelengths".into(), "linear".into())].into(),
        ..Contents::default()
    };
    files.push(("tailored".into(), tailored.bytes()));
    // a reflecting substrate, for which reflectance may decrease with thickness
    for (name, basis) in [
        ("substrate_linear", Basis::Linear),
        ("substrate_log", Basis::Log),
    ] {
        let contents = Contents {
            variant: CompactVariant {
                basis,
                ..CompactVariant::default()
            },
            substrate: SubstrateKind::Reflecting,
            ..Contents::default()
        };
        files.push((name.to_owned(), contents.bytes()));
    }
    // wavelengths at which the thinnest slab is as dark as the thickest, and few components
    let saturated = Contents {
        nm: (8..40).map(|i| 50.0 * f64::from(i)).collect(),
        variant: log(Precision::F32),
        choice: Choice::Components(5),
        ..Contents::default()
    };
    files.push(("saturated".into(), saturated.bytes()));
    // absent curves; the last size has curves for few thicknesses only
    for (name, variant, absent) in [
        ("absent_linear", CompactVariant::default(), [0, 2, 5]),
        ("absent_quantised", log(Precision::Quantised), [0, 0, 3]),
    ] {
        let contents = Contents {
            variant,
            absent: absent.into(),
            ..Contents::default()
        };
        files.push((name.to_owned(), contents.bytes()));
    }
    // more components than are summed in one block, and a single quantity
    let many = Contents {
        nm: (0..90).map(|i| 380.0 + 5.0 * f64::from(i)).collect(),
        variant: log(Precision::F32),
        choice: Choice::Components(90),
        quantities: vec![Quantity::Reflectance],
        ..Contents::default()
    };
    files.push(("many".into(), many.bytes()));
    for (name, thickness_cm) in [("thick", vec![15.0]), ("two_thick", vec![5.0, 15.0])] {
        let axes = Contents::default()
            .axes
            .with(Parameter::Thickness, thickness_cm)
            .with(Parameter::Incidence, vec![30.0]);
        let contents = Contents {
            axes,
            nm: vec![900.0],
            choice: Choice::Components(1),
            quantities: vec![Quantity::Transmittance],
            ..Contents::default()
        };
        files.push((name.to_owned(), contents.bytes()));
    }
    // a file written before tensors were aligned
    let older = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/compact_tensors_by_name.safetensors");
    files.push(("by_name".to_owned(), fs::read(older).unwrap()));
    if let Some(path) = std::env::var_os("SPLITSNOW_FILE") {
        files.push(("given".into(), fs::read(path).unwrap()));
    }
    files
}
