//! Compression keeps the error bound of every wavelength band, in every variant.
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::quoted::assert_says;
use serde_json::Value;
use splitsnow::batch;
use splitsnow::colour::Colorimeter;
use splitsnow::compress::{
    BAND_ERRORS, BandError, Bands, Choice, CompactVariant, DEFAULT_MAX_RMSE, NOISE_FACTOR,
    compress, curve_errors,
};
use splitsnow::engine::{Control, Engine, EngineError, Request};
use splitsnow::lookup::Database;
use splitsnow::measurement::{Measured, Quantity, Spectrum};
use splitsnow::optics::IceTable;
use splitsnow::parameter::{Axes, Parameter};
use splitsnow::spectrum::Band;
use splitsnow::store::{Access, COMPACT, Store, Variable};
use splitsnow::transport::Illumination;

fn splitsnow(arguments: &[&str], dir: &Path) {
    let mut command = assert_cmd::Command::cargo_bin("splitsnow").unwrap();
    command.args(arguments).arg(dir).assert().success();
}

/// The largest rms over the wavelengths of `band`, among the rows of `values`.
fn largest_rms(values: &ndarray::Array2<f32>, nm: &[f64], band: Band) -> f64 {
    let rms = |row: ndarray::ArrayView1<f32>| {
        let in_band = row.iter().zip(nm).filter(|(_, nm)| band.holds(**nm));
        let squares: Vec<f64> = in_band.map(|(v, _)| f64::from(*v).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    values.rows().into_iter().map(rms).fold(0.0, f64::max)
}

/// Asserts that the compression errors of the compact file in `dir` are below the bound in
/// every band, and that the file states these errors. `bound` gives the bound from the
/// standard error of the curves.
fn assert_bounds_kept(dir: &Path, bound: impl Fn(f64) -> f64) {
    let store = Store::open(dir).unwrap();
    let database = Database::open(dir.join(COMPACT)).unwrap();
    let nm = store.wavelengths_nm();
    let stated = database.metadata().get(BAND_ERRORS);
    let stated: Value = stated.map_or(Value::Null, |text| serde_json::from_str(text).unwrap());
    for (quantity, [values, errors]) in Quantity::ALL.into_iter().zip([
        [Variable::TRANSMITTANCE, Variable::TRANSMITTANCE.se()],
        [Variable::REFLECTANCE, Variable::REFLECTANCE.se()],
    ]) {
        if !database.has(quantity) {
            assert!(stated[quantity.name()].is_null());
            continue;
        }
        let curves = store.read(values).unwrap();
        let noise = store.read(errors).unwrap();
        let rebuilt = (0..database.curves()).flat_map(|row| database.curve(row, quantity).unwrap());
        let residuals =
            ndarray::Array2::from_shape_vec(curves.dim(), rebuilt.collect()).unwrap() - &curves;
        let found = curve_errors(&database, quantity, curves.mapv(f64::from).view(), None).unwrap();
        let stated = &stated[quantity.name()];
        for (i, (band, found)) in Band::ALL.into_iter().zip(&found.bands).enumerate() {
            let rmse = largest_rms(&residuals, nm, band);
            let bound = bound(largest_rms(&noise, nm, band));
            assert!(rmse < bound, "{quantity:?} {band:?} {rmse} {bound}");
            let stated = &stated[i];
            assert_eq!(
                (stated["band"].as_str(), found.band),
                (Some(band.name()), band)
            );
            let assert_near = |key: &Value, value: f64, tolerance: f64| {
                let stated = key.as_f64().unwrap();
                assert!((stated / value - 1.0).abs() < tolerance, "{key} {value}");
            };
            // two digits are written
            assert_near(&stated["max_rmse"], bound, 0.05);
            // the curves are read as f32
            assert_near(&stated["rmse"]["max"], rmse, 1e-3);
            // six digits are written
            assert_near(&stated["largest"]["error"], found.largest.error, 1e-5);
            let curve = stated["largest"]["curve"].as_u64().unwrap() as usize;
            let worst_nm = stated["largest"]["wavelength_nm"].as_f64().unwrap();
            let column = nm.iter().position(|nm| *nm == worst_nm).unwrap();
            assert!(band.holds(worst_nm));
            assert_near(
                &stated["largest"]["error"],
                residuals[[curve, column]].abs().into(),
                1e-3,
            );
        }
    }
}

fn assert_bounds_kept_in_every_variant(dir: &Path) {
    let default = |noise: f64| (NOISE_FACTOR * noise).max(DEFAULT_MAX_RMSE);
    assert_bounds_kept(dir, default);
    for (basis, precision) in [("log", "f32"), ("linear", "f16"), ("log", "quantised")] {
        let variant = ["compress", "--basis", basis, "--precision", precision];
        splitsnow(&variant, dir);
        assert_bounds_kept(dir, default);
    }
    let reflectance_only = [
        "compress",
        "--quantity",
        "reflectance",
        "--max-rmse",
        "5e-4",
    ];
    splitsnow(&reflectance_only, dir);
    assert_bounds_kept(dir, |_| 5e-4);
}

/// A fake engine. Reflectance and transmittance follow diffusion theory with the absorption
/// of ice. Standard errors are larger from 1400 nm on.
fn simulate_by_diffusion(request: &Request, _: &Control) -> Result<Vec<Spectrum>, EngineError> {
    let size_m = request.snowpack.longest_grain_m();
    let curve_values = |nm: f64, thickness_m: f64, cosine: f64| {
        let ice = IceTable::WarrenBrandt2008.at(nm).unwrap();
        let path = (ice.absorption_per_m(nm) * size_m).sqrt();
        let [extinction, z] = [1.5 * path / size_m, 1.2 * size_m * (0.7 + cosine)];
        let transmittance = (extinction * z).sinh() / (extinction * (thickness_m + z)).sinh();
        [
            transmittance,
            0.98 * (-3.0 * path * (0.5 + cosine)).exp() * (1.0 - transmittance),
        ]
    };
    let mut spectra = Vec::new();
    for thickness_m in request.thicknesses_m {
        for light in request.illuminations {
            let Illumination::Collimated { polar_angle_rad } = light else {
                return Err(EngineError::Cancelled);
            };
            let both = request.wavelengths_nm.iter().map(|&nm| {
                let se = if nm < 1400.0 { 3e-4 } else { 0.002 };
                curve_values(nm, *thickness_m, polar_angle_rad.cos())
                    .map(|value| Measured { value, se })
            });
            let (transmittance, reflectance) = both.map(|[t, r]| (t, r)).unzip();
            spectra.push(Spectrum {
                transmittance,
                reflectance,
                lost: vec![0.0; request.wavelengths_nm.len()],
            });
        }
    }
    Ok(spectra)
}

/// Spectra of 350-2500 nm with the default bounds. With a bound on Delta-E alone, errors of
/// reflectance in the near infrared are several hundredths.
#[test]
fn wide_spectra_keep_their_bounds_in_every_band() {
    let mut grid = crate::common::grid(Engine::Spectral);
    grid.axes = Axes::from([
        (Parameter::Facetness, vec![0.1]),
        (Parameter::GrainSize, vec![100.0, 200.0, 400.0]),
        (Parameter::Density, vec![300.0]),
        (Parameter::Thickness, vec![1.0, 4.0, 50.0]),
        (Parameter::Incidence, vec![0.0, 80.0]),
    ]);
    grid.wavelengths_nm = (0..=215).map(|i| 350.0 + 10.0 * f64::from(i)).collect();
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("long");
    let store = Store::build(&dir, &grid, &BTreeMap::new(), Access::Exclusive).unwrap();
    let options = batch::BatchOptions::default();
    batch::run(
        &grid,
        &store,
        simulate_by_diffusion,
        &options,
        &AtomicBool::new(false),
    )
    .unwrap();

    let curves = store.read(Variable::REFLECTANCE).unwrap().mapv(f64::from);
    let colour = Colorimeter::new(&grid.wavelengths_nm).unwrap();
    let (quantity, bands) = (Quantity::Reflectance, Bands::new(&grid.wavelengths_nm));
    let (colour, variant) = (colour.as_ref(), CompactVariant::default());
    let delta_e_only = compress(
        curves.view(),
        quantity,
        colour,
        &bands,
        super::BOUNDS,
        variant,
    );
    let largest = |band: &BandError| band.largest.error;
    let error = delta_e_only
        .unwrap()
        .band_errors()
        .iter()
        .map(largest)
        .fold(0.0, f64::max);
    assert!(error > 0.03, "{error}");
    drop(store);

    splitsnow(&["compress"], &dir);
    assert_bounds_kept_in_every_variant(&dir);
}

/// The same bounds for simulated snow.
#[test]
#[ignore = "long: tables of four snows at 216 wavelengths, about 21 CPU-s"]
fn simulated_wide_spectra_keep_their_bounds_in_every_band() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("long");
    let grid = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/long_default.toml");
    splitsnow(&["build", grid.to_str().unwrap(), "--out"], &dir);
    assert_page_is_current(&dir);
    assert_bounds_kept_in_every_variant(&dir);
}

/// Asserts that the table and the text of docs/methods.md quote the results of this grid.
fn assert_page_is_current(dir: &Path) {
    let page = "docs/methods.md";
    let store = Store::open(dir).unwrap();
    let curves = store.read(Variable::REFLECTANCE).unwrap().mapv(f64::from);
    let noise = store.read(Variable::REFLECTANCE.se()).unwrap();
    let nm = store.wavelengths_nm();
    let noise = [0, 1, 2, 3].map(|i| largest_rms(&noise, nm, Band::ALL[i]));
    assert_says(page, "bands, standard errors", noise);
    let bounds = noise.map(|noise| (NOISE_FACTOR * noise).max(DEFAULT_MAX_RMSE));
    assert_says(page, "bands, bounds", bounds);
    let colour = Colorimeter::new(nm).unwrap();
    for components in [2, 4, 5] {
        let compressed = compress(
            curves.view(),
            Quantity::Reflectance,
            colour.as_ref(),
            &Bands::new(nm),
            Choice::Components(components),
            CompactVariant::default(),
        )
        .unwrap();
        let bands = compressed.band_errors();
        let [uv_a, visible, ir_a, ir_b] = [0, 1, 2, 3].map(|i| bands[i].rmse.max);
        let worst = bands.iter().map(|band| &band.largest);
        let worst = worst.max_by(|a, b| a.error.total_cmp(&b.error)).unwrap();
        let (error, error_nm) = (worst.error, worst.wavelength_nm);
        let name = format!("bands, {components}");
        assert_says(page, &name, [uv_a, visible, ir_a, ir_b, error, error_nm]);
        let mut pairs = bounds.iter().zip(&bands);
        let kept = pairs.all(|(bound, band)| band.rmse.max < *bound);
        assert_eq!(kept, components == 5, "{name}");
        if components == 2 {
            let e = compressed.errors().unwrap().delta_e.unwrap().max;
            assert_says(page, "bands, Delta-E and largest error of two", [e]);
            assert_says(page, "bands, largest error of two", [error, error_nm]);
        }
    }
}
