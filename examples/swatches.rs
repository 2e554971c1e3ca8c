//! Draws the swatches of Varsa 2025, section 8.6, from a database of configs/thesis.toml.
//!
//! `cargo run --release --example swatches -- out/thesis docs` writes swatches.svg,
//! swatches.png and swatches.md to the directory `docs`, in seconds.
use std::error::Error;
use std::fmt::Write;
use std::path::PathBuf;

use ndarray::Array2;
use splitsnow::colour::Colorimeter;
use splitsnow::compress::{Bands, Choice, CompactVariant, compress};
use splitsnow::export::{LIGHTS, LUMINANCE, Observers, Sampling};
use splitsnow::lab::report::{Swatch, SwatchRows, Swatches};
use splitsnow::lookup::Database;
use splitsnow::measurement::Quantity;
use splitsnow::parameter::{Parameter, Point};
use splitsnow::store::{Store, Variable};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn base() -> Point {
    Point::from_core([0.3, 400.0, 300.0, 15.0, 0.0])
}
const NOTE: &str = "ΔE*ab (CIE 1976) of the two as they are; in brackets, exposed";

/// Two spectra that are compared.
struct Comparison {
    /// Name of the parameter that differs, and its two values.
    name: [&'static str; 2],
    spectra: [Vec<f64>; 2],
    /// Factor by which both are brightened for display.
    exposure: f64,
}

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1).map(PathBuf::from);
    let (Some(out), Some(docs)) = (args.next(), args.next()) else {
        return Err(
            "give two directories: a database of configs/thesis.toml, and the output directory"
                .into(),
        );
    };
    let store = Store::open(&out)?;
    if !store.missing()?.is_empty() {
        return Err(format!("the database in {} is not finished", out.display()).into());
    }
    let curves = store.read(Variable::TRANSMITTANCE)?.mapv(f64::from);
    let nm = store.wavelengths_nm();
    let database = Database::from_curves(true, store.axes(), nm, Some(&curves), None);
    let observers = Observers::new(database.wavelengths_nm())?;
    let comparisons = comparisons(&curves, &database, nm, &observers)?;
    let swatches = swatches(&observers, &comparisons);
    std::fs::write(docs.join("swatches.svg"), swatches.svg()?)?;
    std::fs::write(docs.join("swatches.png"), swatches.png()?)?;
    std::fs::write(docs.join("swatches.md"), page(&observers, &comparisons)?)?;
    Ok(())
}

fn comparisons(
    curves: &Array2<f64>,
    database: &Database,
    nm: &[f64],
    observers: &Observers,
) -> Result<Vec<Comparison>> {
    let spectrum = |point| -> Result<Vec<f64>> {
        let spectrum = database.spectrum(point, Quantity::Transmittance)?;
        Ok(spectrum.into_iter().map(f64::from).collect())
    };
    let rebuilt = |components| -> Result<Vec<f64>> {
        let colour = Colorimeter::new(nm)?;
        let compressed = compress(
            curves.view(),
            Quantity::Transmittance,
            colour.as_ref(),
            &Bands::default(),
            Choice::Components(components),
            CompactVariant::default(),
        )?;
        let coefficients = compressed.coefficients.decoded();
        let row = coefficients.row(database.row(base())?).mapv(f64::from);
        Ok(compressed.basis.mapv(f64::from).dot(&row).to_vec())
    };
    let size = |grain_size_um| spectrum(base().with(Parameter::GrainSize, grain_size_um));
    let facetness = |facetness| spectrum(base().with(Parameter::Facetness, facetness));
    let density = |density_kg_m3| spectrum(base().with(Parameter::Density, density_kg_m3));
    let pairs = [
        (
            ["grain size, µm", "100 | 500"],
            [size(100.0)?, size(500.0)?],
        ),
        (
            ["facetness", "0.1 | 0.9"],
            [facetness(0.1)?, facetness(0.9)?],
        ),
        (
            ["density, kg/m³", "200 | 400"],
            [density(200.0)?, density(400.0)?],
        ),
        (["components", "31 | 1"], [spectrum(base())?, rebuilt(1)?]),
        (["components", "31 | 2"], [spectrum(base())?, rebuilt(2)?]),
    ];
    let comparison = |(name, spectra): ([&'static str; 2], [Vec<f64>; 2])| Comparison {
        exposure: observers.exposure(&[&spectra[0], &spectra[1]]),
        name,
        spectra,
    };
    Ok(pairs.into_iter().map(comparison).collect())
}

impl Comparison {
    /// Delta-E of the two spectra under a light and, in brackets, after exposure.
    fn difference(&self, observers: &Observers, light: usize, sampling: Sampling) -> String {
        let [first, second] = &self.spectra;
        let delta_e = |exposure| {
            observers.difference(light, [(sampling, first), (sampling, second)], exposure)
        };
        format!("{:.2} ({:.2})", delta_e(1.0), delta_e(self.exposure))
    }
}

fn swatches(observers: &Observers, comparisons: &[Comparison]) -> Swatches {
    let row = |light: usize, sampling| {
        let swatch = |comparison: &Comparison| Swatch {
            colours: comparison
                .spectra
                .iter()
                .map(|spectrum| observers.srgb(sampling, light, spectrum, comparison.exposure))
                .collect(),
            words: comparison.difference(observers, light, sampling),
        };
        let swatches = comparisons.iter().map(swatch).collect();
        (LIGHTS[light].name().to_owned(), swatches)
    };
    let head = |comparison: &Comparison| {
        let [name, values] = comparison.name;
        [
            name.to_owned(),
            format!("{values}, × {}", comparison.exposure),
        ]
    };
    Swatches {
        title: "Light through snow, in pairs".into(),
        remarks: vec![
            "400 ± 50 µm, facetness 0.3 ± 0.1, 300 kg/m³, 15 cm, 0°, dry, but for what a column says".into(),
            format!("×: exposure of both, to a luminance of {LUMINANCE} (white 1)"),
            NOTE.into(),
        ],
        columns: comparisons.iter().map(head).collect(),
        groups: Sampling::ALL
            .map(|sampling| SwatchRows {
                heading: sampling.name().into(),
                rows: (0..LIGHTS.len()).map(|light| row(light, sampling)).collect(),
            })
            .into(),
    }
}

fn page(observers: &Observers, comparisons: &[Comparison]) -> Result<String> {
    let mut page = format!(
        "# Swatches

`just swatches` makes this page and its picture anew, from a database of
`configs/thesis.toml`, after Varsa 2025, section 8.6: transmittance of snow with
grains of 400 +- 50 um, facetness 0.3 +- 0.1, 300 kg/m3, 15 cm thick, dry, at normal
incidence, 400-700 nm by 10, unless a column changes it; and the same spectrum rebuilt
from one and two of its 31 components, those of all 24,750 curves.

![Pairs of colour patches: five comparisons under five lights, by 31 and by 3 wavelengths](swatches.svg)

Colours are those of the CIE 1931 2-degree observer in sRGB. A spectrum of 1
everywhere, lit by the light of the row, is the white of the screen. Light through
snow is dark beside it: each column is shown brighter by the factor × above it,
which lifts the brighter spectrum to a luminance of {LUMINANCE} of white under light E;
both patches of a pair by the same. With 3 wavelengths, white and patches are sums
over 455, 551 and 608 nm alone. FL3.15 is our reading of the light that the thesis
calls FL-15.

Delta-E*ab, CIE 1976, of the two colours of a pair as they are (in brackets: as
exposed). 2.3 is a just noticeable difference. One standard error of the simulation is
at most 0.3, as they are.
"
    );
    for sampling in Sampling::ALL {
        write!(page, "\n| {} |", sampling.name())?;
        for light in LIGHTS {
            write!(page, " {} |", light.name())?;
        }
        writeln!(page, "\n|---|{}", "---|".repeat(LIGHTS.len()))?;
        for comparison in comparisons {
            let [name, values] = comparison.name;
            write!(page, "| {name}: {} |", values.replace('|', "and"))?;
            for light in 0..LIGHTS.len() {
                write!(
                    page,
                    " {} |",
                    comparison.difference(observers, light, sampling)
                )?;
            }
            page.push('\n');
        }
    }
    Ok(page)
}
