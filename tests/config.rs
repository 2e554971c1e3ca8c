//! Config files: reading, error messages and warnings.
//!
//! `UPDATE_GOLDEN=1` rewrites the schemas and the error messages. Review the diff before
//! you commit it.
#![allow(clippy::unwrap_used)]

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::config_errors::{
    BRDF_STUDY, BRDF_STUDY_ERRORS, GRID, GRID_ERRORS, SAMPLE, SAMPLE_ERRORS, SCENE, SCENE_ERRORS,
    SNOWPACK, SNOWPACK_ERRORS, STUDY, STUDY_ERRORS,
};
use proptest::prelude::*;
use splitsnow::colour::{ColourDifference, Illuminant, Viewing};
use splitsnow::config::{grid, sample, scene, schema, study};
use splitsnow::engine::Engine;
use splitsnow::grain::{Facets, Shape, SizeLaw, SizeMeasure, specific_surface_m2_kg};
use splitsnow::measurement::Quantity;
use splitsnow::optics::{AbsorptionLaw, Carbon, CarbonLaw, ImpurityMass, ice_density_kg_m3};
use splitsnow::parameter::{Parameter, Region};
use splitsnow::transport::{Entry, Illumination, Joining, Substrate, Tracers};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Compares `text` with a committed file, or rewrites the file.
fn golden(path: &str, text: &str) {
    let path = root().join(path);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let path = path.display();
    assert_eq!(
        committed, text,
        "{path} is out of date: see the top of this test file"
    );
}

/// Applies each edit of `cases`, an old and a new text, to the valid file `good`. Every
/// result must be refused. Returns the edits with the error messages.
fn error_messages<T>(
    good: &str,
    cases: &[(&str, &str)],
    parse: impl Fn(&str) -> Result<T, splitsnow::config::ConfigError>,
) -> String {
    assert!(parse(good).is_ok());
    let mut text = String::new();
    for (old, new) in cases {
        assert_eq!(
            good.matches(old).count(),
            1,
            "`{old}` must occur exactly once"
        );
        let Err(error) = parse(&good.replace(old, new)) else {
            panic!("accepted: {new}");
        };
        for (sign, edit) in [('-', old), ('+', new)] {
            for line in edit.lines() {
                writeln!(text, "{sign} {line}").unwrap();
            }
        }
        writeln!(text, "{error}\n").unwrap();
    }
    text
}

#[test]
fn error_messages_of_samples_are_current() {
    let text = error_messages(SAMPLE, SAMPLE_ERRORS, |text| sample::parse("s.toml", text));
    golden("tests/config_errors/sample.txt", &text);
}

#[test]
fn error_messages_of_snowpacks_are_current() {
    let text = error_messages(SNOWPACK, SNOWPACK_ERRORS, |text| {
        sample::parse("s.toml", text)
    });
    golden("tests/config_errors/snowpack.txt", &text);
}

#[test]
fn error_messages_of_grids_are_current() {
    let text = error_messages(GRID, GRID_ERRORS, |text| grid::parse("g.toml", text));
    golden("tests/config_errors/grid.txt", &text);
}

#[test]
fn error_messages_of_scenes_are_current() {
    let text = error_messages(SCENE, SCENE_ERRORS, |text| scene::parse("s.toml", text));
    golden("tests/config_errors/scene.txt", &text);
}

#[test]
fn scenes_are_read() {
    let file = scene::parse("scenes/mine.toml", SCENE).unwrap();
    assert_eq!((file.name.as_str(), file.text.as_str()), ("mine", SCENE));
    assert_eq!(file.warnings, Vec::<String>::new());
    let read = file.scene;
    let region = Region::from([
        (Parameter::Facetness, [0.1, 0.9]),
        (Parameter::GrainSize, [300.0, 300.0]),
        (Parameter::Density, [200.0, 400.0]),
        (Parameter::Thickness, [1.0, 50.0]),
        (Parameter::Incidence, [0.0, 89.0]),
    ]);
    assert_eq!(read.regions, [region]);
    assert_eq!(read.quantities, [Quantity::Transmittance]);
    assert_eq!((read.max_delta_e, read.seed), (0.5, 1));
    assert_eq!(
        (read.max_bytes, read.max_seconds),
        (Some(10_000), Some(20.0))
    );
    assert_eq!(
        (read.wavelengths_nm.len(), read.wavelengths_nm[30]),
        (31, 700.0)
    );
    // A grid file with the same keys has the same values.
    let grid = grid::parse("g.toml", GRID).unwrap().grid;
    assert_eq!((read.spread, read.fixed), (grid.spread, grid.fixed));

    let short = "\
version = 1
scene = { max_delta_e = 1, thickness_cm = 5, incidence_angle_deg = 0.5 }
wavelengths.values_nm = [450, 550, 650]
fixed.water_fraction = 0.05
snow = [
    { facetness = 0.3, grain_size_um = 300, density_kg_m3 = 300 },
    { facetness = 0, grain_size_um = 90, density_kg_m3 = 300 },
]
";
    let file = scene::parse("s.toml", short).unwrap();
    assert_eq!(
        file.warnings,
        [
            "s.toml:7: `snow[1].facetness` = 0 is where reflectance is discontinuous: facetness 0 and 0.01 give very different reflectances, and look-ups between the two are not reliable (docs/stability.md)",
            "s.toml:7: `snow[1].grain_size_um` = 90 makes grains down to 40 um; the ordinary range is 50 to 3000 um"
        ]
    );
    let read = file.scene;
    for region in &read.regions {
        assert_eq!(region.get(Parameter::Thickness), Some([5.0, 5.0]));
        assert_eq!(region.get(Parameter::Incidence), Some([0.5, 0.5]));
    }
    assert_eq!(read.quantities, Quantity::ALL);
    assert_eq!(read.viewing, Viewing::default());
    assert_eq!(
        (read.max_bytes, read.max_seconds, read.regions.len()),
        (None, None, 2)
    );
    assert!(read.fixed.water_saturation > 0.05);
    let viewing_keys = "illuminants = [\"LED-B5\", \"E\"], delta_e = \"cie2000\", max_delta_e";
    let read = scene::parse("s.toml", &short.replace("max_delta_e", viewing_keys));
    assert_eq!(
        read.unwrap().scene.viewing,
        Viewing {
            illuminants: vec![Illuminant::LedB5, Illuminant::E],
            difference: ColourDifference::Cie2000,
        }
    );
}

#[test]
fn oversized_databases_are_refused() {
    let list = |n: u32, last: f64| {
        let values: Vec<_> = (1..=n)
            .map(|i| format!("{}", last * f64::from(i) / f64::from(n)))
            .collect();
        format!("[{}]", values.join(", "))
    };
    let long = GRID
        .replace("[0.1, 0.5, 0.9]", &list(1000, 1.0))
        .replace("[0, 40, 80]", &list(1000, 80.0))
        .replace("[200, 400]", "[200, 250, 300, 350, 400]")
        .replace("step_nm = 10", "step_nm = 1");
    let error = grid::parse("g.toml", &long).unwrap_err().to_string();
    assert!(
        error.starts_with(
            "g.toml:2: `axes` describes 1000 x 3 x 5 x 3 x 1000 curves of 301 wavelengths"
        ),
        "{error}"
    );
    let error = grid::parse("g.toml", &GRID.replace("[0.1, 0.5, 0.9]", &list(1001, 1.0)));
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("`axes.facetness` is out of range: allowed 1 to 1000 entries"),
        "{error}"
    );
    let many_rays = long
        .replace("step_nm = 1", "step_nm = 300")
        .replace("rays = 1000", "rays = 1000000000000");
    let error = grid::parse("g.toml", &many_rays).unwrap_err();
    assert_eq!(error.key(), "run.rays");
}

#[test]
fn unreadable_files_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    for path in [
        directory.path().join("none.toml"),
        directory.path().to_owned(),
        write("binary.toml", &[0xff, 0xfe]),
        write("long.toml", &vec![b'\n'; (1 << 20) + 1]),
    ] {
        let error = grid::read(&path).unwrap_err().to_string();
        assert!(error.contains(": cannot be read: "), "{error}");
    }
}

#[test]
fn schemas_are_current() {
    golden("schema/sample.schema.json", &schema::sample());
    golden("schema/grid.schema.json", &schema::grid());
    golden("schema/scene.schema.json", &schema::scene());
    golden("schema/study.schema.json", &schema::study());
}

#[test]
fn committed_configs_are_accepted_and_name_their_schema() {
    let files = |folder: &str| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(root().join(folder)).unwrap();
        let paths = entries.map(|entry| entry.unwrap().path());
        paths
            .filter(|p| p.extension().is_some_and(|e| e == "toml"))
            .collect()
    };
    let names_schema = |path: &Path| {
        let text = std::fs::read_to_string(path).unwrap();
        let schema = text
            .lines()
            .next()
            .unwrap()
            .strip_prefix("#:schema ")
            .unwrap();
        assert!(
            path.parent().unwrap().join(schema).is_file(),
            "{}",
            path.display()
        );
    };
    let (grids, mut samples) = (files("configs"), files("configs/samples"));
    samples.extend(files("configs/tradeoff"));
    let scenes = files("configs/scenes");
    assert!(grids.len() >= 2 && samples.len() >= 17 && scenes.len() >= 4);
    let studies = files("configs/studies");
    assert!(studies.len() >= 28);
    for path in &studies {
        names_schema(path);
        let file = study::read(path).unwrap_or_else(|e| panic!("{e}"));
        // smooth grains cause a warning, which is allowed; only these files have others, due to
        // tiny grains or a wide range of sizes
        let with_other_warnings = [
            "brdf_grain_size.toml",
            "brdf_hemisphere_grain_size.toml",
            "sample_sispec_195.toml",
            "surface_layer.toml",
        ];
        assert_eq!(
            file.warnings
                .iter()
                .any(|w| !w.contains("reflectance is discontinuous")),
            with_other_warnings.iter().any(|name| path.ends_with(name)),
            "{}",
            path.display()
        );
    }
    for path in &scenes {
        names_schema(path);
        let file = scene::read(path).unwrap_or_else(|e| panic!("{e}"));
        let smooth = file
            .warnings
            .iter()
            .all(|w| w.contains("reflectance is discontinuous"));
        assert!(smooth, "{:?}", file.warnings);
    }
    for path in &grids {
        names_schema(path);
        let file = grid::read(path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(file.warnings, Vec::<String>::new());
        let again = grid::parse(&path.display().to_string(), &file.grid.to_config()).unwrap();
        assert_eq!(again.grid, file.grid);
    }
    for path in &samples {
        names_schema(path);
        let file = sample::read(path).unwrap_or_else(|e| panic!("{e}"));
        let has_fresh_surface =
            path.ends_with("surface.toml") || path.ends_with("surface_on_basal.toml");
        let is_wide = path.ends_with("sispec_195.toml");
        assert_eq!(
            file.warnings
                .iter()
                .any(|w| !w.contains("reflectance is discontinuous")),
            has_fresh_surface || is_wide
        );
    }
}

/// The error message for the study `good` with the change `edit`. The sample file `base.toml`
/// is in the same folder.
fn study_error(good: &str, edit: (&str, &str)) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("base.toml"), SAMPLE).unwrap();
    let name = folder.path().join("study.toml").display().to_string();
    assert!(study::parse(&name, good).is_ok());
    assert_eq!(good.matches(edit.0).count(), 1, "{}", edit.0);
    let error = study::parse(&name, &good.replace(edit.0, edit.1)).unwrap_err();
    let folder = format!("{}/", folder.path().display());
    error.to_string().replace(&folder, "")
}

#[test]
fn error_messages_of_studies_are_current() {
    let mut text = String::new();
    for (good, errors) in [(STUDY, STUDY_ERRORS), (BRDF_STUDY, BRDF_STUDY_ERRORS)] {
        for (old, new) in errors {
            let message = study_error(good, (old, new));
            writeln!(text, "- {old}\n+ {new}\n{message}\n").unwrap();
        }
    }
    golden("tests/config_errors/study.txt", &text);
}

#[test]
fn studies_vary_samples() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("base.toml"), SAMPLE).unwrap();
    let name = folder.path().join("study.toml").display().to_string();
    let file = study::parse(&name, STUDY).unwrap();
    assert_eq!((file.name.as_str(), file.variants.len()), ("study", 2));
    let spectra = study::DrawSpectra {
        quantity: Quantity::Reflectance,
        against: study::Against::Wavelength,
        from: 0.0,
    };
    assert_eq!(file.draw, study::Draw::Spectra(spectra));
    let base = sample::parse("s.toml", SAMPLE).unwrap();
    let [first, second] = &file.variants[..] else {
        panic!("{:?}", file.variants)
    };
    assert_eq!((first.label.as_str(), first.group.as_str()), ("thin", ""));
    assert_eq!(first.sample.wavelengths_nm, [500.0, 600.0]);
    assert_eq!(first.sample.snowpack, base.snowpack);
    assert_eq!(first.sample.thickness_m, 0.05);
    // one more layer, which is the new surface
    assert_eq!(
        second.sample.snowpack.below.len(),
        base.snowpack.below.len() + 1
    );
    assert_eq!(second.sample.snowpack.surface.density_kg_m3, 100.0);
    assert_eq!(file.published[0].range, Some([0.8, 0.95]));

    let brdf = |text: &str| study::parse(&name, text).unwrap().draw;
    let mut plane = study::DrawBrdf {
        hemisphere: false,
        logarithmic: true,
        sensors: 1000,
    };
    assert_eq!(brdf(BRDF_STUDY), study::Draw::Brdf(plane));
    (plane.hemisphere, plane.logarithmic, plane.sensors) = (true, false, 70);
    let keys = "directions = \"hemisphere\"\nsensors = 70";
    let discs = BRDF_STUDY.replace("scale = \"logarithmic\"", keys);
    assert_eq!(brdf(&discs), study::Draw::Brdf(plane));
}

#[test]
fn the_thesis_grid_has_the_size_of_the_published_database() {
    let file = grid::read(&root().join("configs/thesis.toml")).unwrap();
    let axes = &file.grid.axes;
    let curves = axes.values(Parameter::Facetness).len()
        * axes.values(Parameter::GrainSize).len()
        * axes.values(Parameter::Density).len()
        * axes.values(Parameter::Thickness).len()
        * axes.values(Parameter::Incidence).len();
    assert_eq!(curves, 24_750);
    assert_eq!(file.grid.wavelengths_nm.len(), 31);
    assert_eq!(file.name, "thesis");
}

#[test]
fn the_thesis_scene_covers_the_thesis_grid() {
    let axes = grid::read(&root().join("configs/thesis.toml"))
        .unwrap()
        .grid
        .axes;
    let scene = scene::read(&root().join("configs/scenes/thesis.toml"))
        .unwrap()
        .scene;
    assert_eq!(scene.regions, [axes.region()]);
}

#[test]
fn samples_have_the_documented_defaults() {
    let short = "\
version = 1
illumination.diffuse = true
wavelengths.values_nm = [842.25, 1037.76]
[[layer]]
thickness_cm = 25
density_kg_m3 = 275
[[layer.grain]]
size_um = { min = 300, max = 750 }
facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }
";
    let file = sample::parse("s.toml", short).unwrap();
    assert_eq!(file.illumination, Illumination::Diffuse);
    assert_eq!(file.snowpack.surface.temperature_c, -1.0);
    assert_eq!(file.snowpack.surface.water_saturation, 0.0);
    assert_eq!(
        file.snowpack.surface.grains[0].grain.proportion.mean(),
        0.798
    );
    assert_eq!(file.thickness_m, 0.25);
    assert_eq!(file.wavelengths_nm, [842.25, 1037.76]);
    assert_eq!(file.snowpack.surface.sizes_m()[1], 750.0 * 1e-6);
}

/// A `Snowpack` lists its layers from the surface down, a file from the base up.
#[test]
fn snowpacks_are_read() {
    let file = sample::parse("s.toml", SNOWPACK).unwrap();
    let snowpack = &file.snowpack;
    assert!((file.thickness_m - 0.17).abs() < 1e-15);
    assert_eq!(file.model.joining, Joining::Cascade);
    assert_eq!(file.model.impurity_mass, ImpurityMass::Conserved);
    assert_eq!(file.model.carbon_law, CarbonLaw::Power);
    assert_eq!(snowpack.substrate, Substrate::Grey(0.2));
    let [base] = &snowpack.below[..] else {
        panic!("{snowpack:?}")
    };
    assert_eq!(
        (base.thickness_m, base.snow.density_kg_m3),
        (15.0 * 1e-2, 375.0)
    );
    assert_eq!(base.snow.black_carbon, Some(Carbon::black(6.0)));
    assert_eq!(base.snow.brown_carbon, None);
    let surface = &snowpack.surface;
    // 300 kg/m3, including 50 kg/m3 of water
    assert_eq!(surface.density_kg_m3, 250.0);
    assert!(
        (surface.water_saturation * (1.0 - 250.0 / ice_density_kg_m3(-1.0)) - 0.05).abs() < 1e-15
    );
    let fractions: Vec<f64> = surface.grains.iter().map(|grain| grain.fraction).collect();
    assert_eq!(fractions, [0.25, 0.75]);
    assert_eq!(surface.sizes_m(), [100.0 * 1e-6, 1200.0 * 1e-6]);
    let brown = Carbon {
        per_wet_mass: true,
        ..Carbon::brown(500.0)
    };
    assert_eq!(surface.brown_carbon, Some(brown));
    let laws = [1.0, 2.0].map(AbsorptionLaw::Power).to_vec();
    let tracers = Tracers::of(snowpack, &file.model, &file.wavelengths_nm);
    assert_eq!(tracers, Tracers::Laws(laws));
}

#[test]
fn all_ways_to_give_water_are_equivalent() {
    let ice = ice_density_kg_m3(-1.0);
    let dry = sample::parse("s.toml", SAMPLE).unwrap().snowpack.surface;
    let fraction = 0.05 * (1.0 - 275.0 / ice);
    let wet = 275.0 + 1000.0 * fraction;
    for (density, water) in [
        (
            format!("wet_density_kg_m3 = {wet}"),
            "water_saturation = 0.05".to_owned(),
        ),
        (
            format!("wet_density_kg_m3 = {wet}"),
            format!("water_fraction = {fraction}"),
        ),
        (
            "density_kg_m3 = 275".to_owned(),
            format!("water_fraction = {fraction}"),
        ),
    ] {
        let text = SAMPLE
            .replace("density_kg_m3 = 275", &density)
            .replace("water_saturation = 0.05", &water);
        let snow = sample::parse("s.toml", &text).unwrap().snowpack.surface;
        assert!((snow.density_kg_m3 - dry.density_kg_m3).abs() < 1e-10);
        assert!((snow.water_saturation - dry.water_saturation).abs() < 1e-14);
    }
}

#[test]
fn values_outside_the_ordinary_range_cause_warnings() {
    for (old, new, warning) in [
        (
            "min = 300, max = 750",
            "min = 40, max = 75",
            "s.toml:15: `layer[0].grain[0].size_um.min` = 40 is outside the ordinary range 50 to 3000 um",
        ),
        (
            "density_kg_m3 = 275",
            "density_kg_m3 = 500",
            "s.toml:10: `layer[0].density_kg_m3` = 500 is outside the ordinary range 50 to 450 kg/m3 of dry snow",
        ),
        (
            "thickness_cm = 25",
            "thickness_cm = 0.9",
            "s.toml:9: `layer[0].thickness_cm` = 0.9 is outside the ordinary range 1 to 100 cm",
        ),
        (
            "stop_nm = 700",
            "stop_nm = 705",
            "s.toml:6: `wavelengths.stop_nm` = 705 is not a whole number of steps from start_nm; the last wavelength is 700 nm",
        ),
    ] {
        let file = sample::parse("s.toml", &SAMPLE.replace(old, new)).unwrap();
        assert_eq!(file.warnings, [warning]);
    }
}

#[test]
fn paths_are_relative_to_the_config() {
    let directory = tempfile::tempdir().unwrap();
    let table = "wavelength_nm,n,k\n300,1.34,1e-9\n2600,1.3,1e-3\n";
    std::fs::write(directory.path().join("mine.csv"), table).unwrap();
    let path = directory.path().join("s.toml");
    let soil = "wavelength_nm,reflectance\n300,0.25\n700,0.75\n";
    std::fs::write(directory.path().join("soil.csv"), soil).unwrap();
    let text = SAMPLE
        .replace("segelstein_1981", "mine.csv")
        .replace("reflectance = 0", "reflectance = \"soil.csv\"");
    std::fs::write(&path, text).unwrap();
    let mut file = sample::read(&path).unwrap();
    assert!(file.to_toml().contains("water = \"mine.csv\""));
    assert!(
        file.to_toml()
            .contains("reflectance = [0.375, 0.3875, 0.4, ")
    );
    assert_eq!(file.snowpack.substrate.reflectance(500.0), Some(0.5));
    let [note] = &file.notes[..] else { panic!() };
    assert!(
        note.contains("soil.csv: a table, 2 columns by commas"),
        "{note}"
    );
    file.notes.clear();
    let again = sample::parse(&path.display().to_string(), file.to_toml()).unwrap();
    assert_eq!(again, file);
}

/// An inline table of a truncated normal distribution with bounds in [low, 1].
fn distribution(low: f64) -> impl Strategy<Value = String> {
    (low..=1.0, low..=1.0, 0.0..=1.0, 0.0..=2.0).prop_map(
        |(a, b, position, sd): (f64, f64, f64, f64)| {
            let (min, max) = (a.min(b), a.max(b));
            let mean = (min + position * (max - min)).clamp(min, max);
            format!("{{ min = {min}, max = {max}, mean = {mean}, sd = {sd} }}")
        },
    )
}

fn light() -> impl Strategy<Value = String> {
    prop_oneof![
        Just("diffuse = true".to_owned()),
        (0.0..90.0).prop_map(|angle| format!("incidence_angle_deg = {angle}")),
    ]
}

fn wavelengths() -> impl Strategy<Value = String> {
    let list = prop::collection::btree_set(350_000_u32..=2_500_000, 1..20);
    prop_oneof![
        (350.0..1000.0, 1000.0..2500.0, 1.0..3000.0_f64).prop_map(|(start, stop, step)| {
            let step = step.min(2150.0);
            format!("start_nm = {start}\nstop_nm = {stop}\nstep_nm = {step}")
        }),
        list.prop_map(|pm| {
            let nm: Vec<_> = pm
                .iter()
                .map(|pm| (f64::from(*pm) / 1000.0).to_string())
                .collect();
            format!("values_nm = [{}]", nm.join(", "))
        }),
    ]
}

fn water() -> impl Strategy<Value = String> {
    prop_oneof![
        (0.0..=0.5).prop_map(|s| format!("water_saturation = {s}")),
        (0.0..=0.15).prop_map(|w| format!("water_fraction = {w}")),
    ]
}

fn carbon() -> impl Strategy<Value = String> {
    let exponent = prop::sample::select(vec![0.5, 1.0, 2.0, 3.25]);
    let per = prop_oneof![Just("dry_mass"), Just("wet_mass")];
    let numbers = (0.0..=1e9_f64, 0.0..=1.0, 0.0..=1000.0, 100.0..=10_000.0);
    (numbers, exponent, per).prop_map(|((c, x, m, nm), exponent, per)| {
        format!(
            "concentration_ng_g = {c}\nsedimentation = {x}\nmass_absorption_efficiency_m2_g = {m}\n\
             reference_wavelength_nm = {nm}\nangstrom_exponent = {exponent}\nconcentration_per = \"{per}\"\n"
        )
    })
}

/// A layer `[[name]]` of one or two types of grain. `cm` is the range of its thickness in
/// hundredths of a centimetre.
fn layer(name: &'static str, cm: std::ops::Range<u32>) -> impl Strategy<Value = String> {
    let grain = || {
        (
            (10_u32..3000, 10_u32..3000),
            distribution(0.0),
            distribution(0.01),
        )
    };
    let fraction = prop::option::of(0.0..=1.0_f64);
    let grains = (fraction, [grain(), grain()]);
    let soot = (prop::option::of(carbon()), prop::option::of(carbon()));
    (cm, 50.0..=550.0, -40.0..=0.0, water(), grains, soot).prop_map(
        move |(cm, density, temperature, water, (fraction, grains), (black, brown))| {
            let thickness = f64::from(cm) / 100.0;
            let mut text = format!(
                "[[{name}]]\nthickness_cm = {thickness}\ndensity_kg_m3 = {density}\n\
                 temperature_c = {temperature}\n{water}\n"
            );
            let fractions = fraction.map_or(vec![1.0], |fraction| vec![fraction, 1.0 - fraction]);
            for (fraction, ((a, b), facetness, sphericity)) in fractions.iter().zip(&grains) {
                let (min, max) = (a.min(b), a.max(b));
                write!(
                    text,
                    "[[{name}.grain]]\nfraction = {fraction}\nsize_um = {{ min = {min}, max = {max} }}\n\
                     facetness = {facetness}\nsphericity = {sphericity}\n"
                )
                .unwrap();
            }
            for (key, soot) in [("black_carbon", black), ("brown_carbon", brown)] {
                if let Some(soot) = soot {
                    write!(text, "[{name}.{key}]\n{soot}").unwrap();
                }
            }
            text
        },
    )
}

fn substrate(name: &'static str) -> impl Strategy<Value = String> {
    prop::option::of(0.0..=1.0_f64).prop_map(move |reflectance| {
        reflectance.map_or(String::new(), |r| format!("[{name}]\nreflectance = {r}\n"))
    })
}

fn model_choices() -> impl Strategy<Value = String> {
    let law = prop_oneof![Just("power"), Just("varsa2025")];
    let mass = prop_oneof![Just("varsa2025"), Just("conserved")];
    let size = prop_oneof![Just("varsa2025"), Just("consistent")];
    (law, mass, size).prop_map(|(law, mass, size)| {
        format!("carbon_law = \"{law}\"\nimpurity_mass = \"{mass}\"\nsize_law = \"{size}\"\n")
    })
}

/// A strictly increasing list of multiples of `unit` in [low, high].
fn axis(low: u32, high: u32, unit: f64) -> impl Strategy<Value = String> {
    prop::collection::btree_set(low..=high, 1..6).prop_map(move |set| {
        let values: Vec<_> = set
            .iter()
            .map(|&v| (f64::from(v) * unit).to_string())
            .collect();
        format!("[{}]", values.join(", "))
    })
}

/// A wide range of sizes causes a warning, which names the remedy. So does facetness 0.
/// Ordinary samples cause neither.
#[test]
fn wide_size_ranges_and_smooth_grains_cause_warnings() {
    let warnings = |text: &str, part: &str| -> Vec<String> {
        let file = sample::parse("s.toml", text).unwrap();
        let found = file.warnings.into_iter().filter(|w| w.contains(part));
        found.collect()
    };
    let (overpacked, discontinuous) = ("times the ice", "reflectance is discontinuous");
    assert!(warnings(SAMPLE, overpacked).is_empty() && warnings(SAMPLE, discontinuous).is_empty());
    let wide = SAMPLE.replace("min = 300, max = 750", "min = 50, max = 3000");
    let [warning] = &warnings(&wide, overpacked)[..] else {
        panic!("expected one warning");
    };
    assert!(
        warning.contains(
            "size_um` makes grains of 50 to 3000 um, for which rays cross 7.33 times the ice"
        ) && warning.contains("size_law = \"consistent\""),
        "{warning}"
    );
    let consistent = wide.replace("[model]\n", "[model]\nsize_law = \"consistent\"\n");
    assert!(warnings(&consistent, overpacked).is_empty());
    for (min, count) in [("0", 1), ("0.001", 0)] {
        let smooth = SAMPLE.replace(
            "facetness = { min = 0.2",
            &format!("facetness = {{ min = {min}"),
        );
        assert_eq!(warnings(&smooth, discontinuous).len(), count);
    }

    let warnings = |text: &str, part: &str| -> Vec<String> {
        let file = grid::parse("g.toml", text).unwrap();
        let found = file.warnings.into_iter().filter(|w| w.contains(part));
        found.collect()
    };
    assert!(warnings(GRID, overpacked).is_empty() && warnings(GRID, discontinuous).is_empty());
    let wide = GRID.replace(
        "grain_size_um = [100, 300, 500]",
        "grain_size_um = [65, 100, 300]",
    );
    let [warning] = &warnings(&wide, overpacked)[..] else {
        panic!("expected one warning");
    };
    assert!(
        warning.contains("`axes.grain_size_um[0]` = 65 makes grains of 15 to 115 um")
            && warning.contains("1.85 times"),
        "{warning}"
    );
    let consistent = format!("{wide}[model]\nsize_law = \"consistent\"\n");
    assert!(warnings(&consistent, overpacked).is_empty());
    let smooth = GRID.replace("facetness = [0.1,", "facetness = [0, 0.1,");
    assert!(warnings(&smooth, discontinuous)[0].contains("`axes.facetness[0]` = 0"));
}

/// The grain size may be given by the optical radius or the specific surface area. All
/// grains then have the size with this value. In a grid, the sizes keep their half width.
#[test]
fn grain_size_may_be_given_by_optical_radius_or_ssa() {
    let read = |size: &str| {
        let text = SAMPLE.replace("size_um = { min = 300, max = 750 }", size);
        let file = sample::parse("s.toml", &text).unwrap();
        let again = sample::parse("s.toml", file.to_toml()).unwrap();
        assert_eq!(again.snowpack, file.snowpack);
        let [min, max] = file.snowpack.surface.sizes_m();
        assert_eq!(min, max);
        let grain = file.snowpack.surface.grains[0].grain;
        (
            min * 1e6,
            specific_surface_m2_kg(&grain, -1.0),
            file.warnings,
        )
    };
    let (s, ssa, warnings) = read("optical_radius_um = 82");
    // the optical radius is 3 / (SSA D_ice); with the default sphericity, a grain is 1 / .351
    // optical radii long
    assert!((3e6 / (ssa * ice_density_kg_m3(-1.0)) - 82.0).abs() < 1e-9);
    assert!((82.0 / s - 0.351).abs() < 5e-4, "{s}");
    assert_eq!(warnings, Vec::<String>::new());
    let (_, ssa, _) = read("ssa_m2_kg = 20.5");
    assert!((ssa - 20.5).abs() < 1e-10);
    let (s, _, warnings) = read("optical_radius_um = 2000");
    assert!(
        s > 5500.0 && warnings[0].contains("makes grains up to 569"),
        "{s} {warnings:?}"
    );

    let axis = "grain_size_um = [100, 300, 500]";
    for (sizes, width) in [
        ("optical_radius_um = [30, 500, 1000]", ""),
        (
            "ssa_m2_kg = [5, 20, 30.5]",
            "grain_size_half_width_um = 10\n",
        ),
    ] {
        let text = GRID
            .replace(axis, sizes)
            .replace("thickness_cm = [1,", "thickness_cm = [4,")
            .replace("2, 5]", "5, inf]")
            .replace("grain_size_half_width_um = 50\n", width);
        let file = grid::parse("g.toml", &text).unwrap();
        let again = grid::parse("g.toml", &file.grid.to_config()).unwrap();
        assert_eq!(again.grid, file.grid);
        assert!(file.grid.to_config().contains(&sizes[..10]));
        let jobs = file.grid.jobs().unwrap();
        let given = file.grid.size_axis.as_ref().unwrap();
        let (measure, values) = (given.measure, given.by_size());
        for (i, value) in values.iter().enumerate() {
            let job = file.grid.job(&jobs, (i * 2 * 3) as u64).unwrap();
            let surface = &job.snowpack.surface;
            let [min, max] = surface.sizes_m();
            let half_width = if width.is_empty() { 0.0 } else { 10e-6 };
            assert!((max - min - 2.0 * half_width).abs() < 1e-12);
            let ssa = specific_surface_m2_kg(&surface.grains[0].grain, -1.0);
            let found = match measure {
                SizeMeasure::OpticalRadius => 3e6 / (ssa * ice_density_kg_m3(-1.0)),
                SizeMeasure::SpecificSurface => ssa,
            };
            assert!((found / value - 1.0).abs() < 1e-9, "{found} {value}");
            assert_eq!(job.thicknesses_m, [0.04, 0.05, 1e4]);
        }
    }
}

/// Infinite thicknesses, and 10000 cm, which is still a slab.
#[test]
fn thicknesses_may_be_infinite() {
    for (given, metres) in [
        ("inf", 1e4),
        ("+inf", 1e4),
        ("\"inf\"", 1e4),
        ("1e6", 1e4),
        ("10000", 100.0),
    ] {
        let text = SAMPLE.replace("thickness_cm = 25", &format!("thickness_cm = {given}"));
        let file = sample::parse("s.toml", &text).unwrap();
        assert_eq!(file.thickness_m, metres);
        let again = sample::parse("s.toml", file.to_toml()).unwrap();
        assert_eq!(again.thickness_m, metres);
        assert_eq!(file.warnings.is_empty(), metres > 100.0);
    }
    let text = GRID.replace("[1, 2, 5]", "[1, 10000, \"inf\"]");
    let file = grid::parse("g.toml", &text).unwrap();
    assert_eq!(file.grid.axes.values(Parameter::Thickness), [1.0, 1e4, 1e6]);
    let again = grid::parse("g.toml", &file.grid.to_config()).unwrap();
    assert_eq!(again.grid, file.grid);
}

/// The size law applies to all grains of samples, layers, grids and scenes. The canonical
/// config of a grid mentions it only if it is not the published law.
#[test]
fn the_size_law_applies_to_all_grains() {
    let grains = |text: &str| {
        let file = sample::parse("s.toml", text).unwrap();
        let components = file.snowpack.snows().flat_map(|snow| snow.grains.clone());
        components.map(|c| c.grain.size.law()).collect::<Vec<_>>()
    };
    assert_eq!(grains(SNOWPACK), [SizeLaw::Varsa2025; 3]);
    let consistent = SNOWPACK.replace("[model]\n", "[model]\nsize_law = \"consistent\"\n");
    assert_eq!(grains(&consistent), [SizeLaw::Consistent; 3]);

    let published = grid::parse("g.toml", GRID).unwrap().grid;
    let text = format!(
        "{GRID}[model]\nsize_law = \"consistent\"\n[[fixed.below]]\nthickness_cm = 0.7\n\
        density_kg_m3 = 300\ngrain = [{{ size_um = {{ min = 300, max = 600 }}, facetness = {{ min = 0.1, max = 1, mean = 0.5, sd = 1 }} }}]\n"
    );
    let consistent = grid::parse("g.toml", &text).unwrap().grid;
    let job = consistent.job(&consistent.jobs().unwrap(), 0).unwrap();
    for snow in job.snowpack.snows() {
        assert_eq!(snow.grains[0].grain.size.law(), SizeLaw::Consistent);
    }
    assert!(!published.to_config().contains("size_law"));
    let again = grid::parse("g.toml", &consistent.to_config()).unwrap().grid;
    assert_eq!(again.spread, consistent.spread);
    assert_eq!(again.fixed, consistent.fixed);

    let scene = format!("{SCENE}[model]\nsize_law = \"consistent\"\n");
    let scene = scene::parse("s.toml", &scene).unwrap().scene;
    assert_eq!(scene.spread.size_law, SizeLaw::Consistent);
}

/// A preset gives the model options that the file does not have.
#[test]
fn presets_choose_the_options_that_are_not_given() {
    let options = |model: &str| {
        let start = SAMPLE.find("[model]").unwrap();
        let text = format!("{}[model]\n{model}", &SAMPLE[..start]);
        let file = sample::parse("s.toml", &text).unwrap();
        let again = sample::parse("s.toml", file.to_toml()).unwrap();
        assert_eq!(
            (&again.model, &again.snowpack),
            (&file.model, &file.snowpack)
        );
        let law = file.snowpack.surface.grains[0].grain.size.law();
        (file.model.entry, file.model.facets, law)
    };
    let published = (Entry::Uniform, Facets::Varsa2025, SizeLaw::Varsa2025);
    let measured = (Entry::Projected, Facets::VGroove, SizeLaw::Consistent);
    assert_eq!(options(""), published);
    assert_eq!(options("preset = \"varsa2025\""), published);
    assert_eq!(options("preset = \"measured\""), measured);
    assert_eq!(
        options("preset = \"measured\"\nentry = \"uniform\"\nsize_law = \"varsa2025\""),
        (Entry::Uniform, Facets::VGroove, SizeLaw::Varsa2025)
    );
    assert_eq!(
        options("facets = \"visible\""),
        (Entry::Uniform, Facets::Visible, SizeLaw::Varsa2025)
    );
    let grid = format!("{GRID}[model]\npreset = \"measured\"\n");
    let grid = grid::parse("g.toml", &grid).unwrap().grid;
    assert_eq!(grid.fixed.model.facets, Facets::VGroove);
    assert_eq!(grid.spread.size_law, SizeLaw::Consistent);
    assert_eq!(grid::parse("g.toml", &grid.to_config()).unwrap().grid, grid);
}

/// Shapes are read, written and applied to all nodes of a grid, and convert optical radii.
#[test]
fn shapes_are_read_and_written() {
    let usual = "sphericity = { min = 0.6, max = 0.95, mean = 0.798, sd = 0.064 }";
    let plates = "aspect_ratio = { min = 0.1, max = 0.3, mean = 0.2, sd = 0.05 }";
    for (shape, keys) in [
        (Shape::Oblate, format!("shape = \"oblate\"\n{usual}")),
        (Shape::Hexagonal, format!("shape = \"hexagonal\"\n{plates}")),
    ] {
        let text = SAMPLE.replace(usual, &keys);
        let file = sample::parse("s.toml", &text).unwrap();
        let again = sample::parse("s.toml", file.to_toml()).unwrap();
        assert_eq!(again.snowpack, file.snowpack);
        let grain = file.snowpack.surface.grains[0].grain;
        let mean = if shape == Shape::Oblate { 0.798 } else { 0.2 };
        assert_eq!((grain.shape, grain.proportion.mean()), (shape, mean));

        let text = GRID
            .replace(usual, &keys)
            .replace(
                "grain_size_um = [100, 300, 500]",
                "optical_radius_um = [100, 300]",
            )
            .replace("thickness_cm = [1,", "thickness_cm = [4,")
            .replace("2, 5]", "5, 6]");
        let grid = grid::parse("g.toml", &text).unwrap().grid;
        assert_eq!(grid::parse("g.toml", &grid.to_config()).unwrap().grid, grid);
        let job = grid.job(&grid.jobs().unwrap(), 0).unwrap();
        let grain = job.snowpack.surface.grains[0].grain;
        assert_eq!(grain.shape, shape);
        let ssa = specific_surface_m2_kg(&grain, -1.0);
        assert!((3e6 / (ssa * ice_density_kg_m3(-1.0)) - 100.0).abs() < 1e-9);
    }
}

proptest! {
    #[test]
    fn samples_are_unchanged_by_writing_and_reading(
        (light, wavelengths) in (light(), wavelengths()),
        layers in prop::collection::vec(layer("layer", 300..100_000), 1..4),
        (substrate, choices) in (substrate("substrate"), model_choices()),
        joining in prop_oneof![Just("continuous"), Just("cascade")],
        entry in prop_oneof![Just("uniform"), Just("projected")],
        ice in prop_oneof![Just("warren_brandt_2008"), Just("picard_2016")],
    ) {
        let layers = layers.concat();
        let text = format!("version = 1\n[illumination]\n{light}\n[wavelengths]\n{wavelengths}\n\
            {layers}{substrate}[model]\nentry = \"{entry}\"\nice = \"{ice}\"\nlayers = \"{joining}\"\n{choices}");
        let first = sample::parse("s.toml", &text).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let again = sample::parse("s.toml", first.to_toml()).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(again.to_toml(), first.to_toml());
        let without_warnings = |mut file: sample::SampleFile| { file.warnings.clear(); file };
        prop_assert_eq!(without_warnings(again), without_warnings(first));
    }

    #[test]
    fn grids_are_unchanged_by_writing_and_reading(
        wavelengths in wavelengths(),
        (facetness, sizes, densities) in (axis(0, 100, 0.01), axis(60, 2900, 1.0), axis(500, 5500, 0.1)),
        (thicknesses, angles) in (axis(30, 1000, 0.1), axis(0, 8999, 0.01)),
        (half_width, sd, size_half_width) in (0.0..=1.0, 0.0..=10.0, 0.0..=50.0),
        (saturation, temperature, sphericity) in (0.0..=0.5, -40.0..=0.0, distribution(0.01)),
        (seed, rays) in (0..=9_007_199_254_740_991_u64, 1..=1_000_000_000_000_u64),
        engine in prop_oneof![Just("spectral"), Just("reference")],
        rmse in prop::option::of(1e-9..=1.0),
        below in prop::collection::vec(layer("fixed.below", 1..140), 0..3),
        (substrate, black, choices) in (substrate("fixed.substrate"), carbon(), model_choices()),
    ) {
        let below = below.concat();
        let rmse = rmse.map_or(String::new(), |rmse| format!("max_rmse = {rmse}\n"));
        let text = format!("version = 1\n[axes]\nfacetness = {facetness}\ngrain_size_um = {sizes}\n\
            density_kg_m3 = {densities}\nthickness_cm = {thicknesses}\nincidence_angle_deg = {angles}\n\
            [spread]\nfacetness_half_width = {half_width}\nfacetness_sd = {sd}\n\
            grain_size_half_width_um = {size_half_width}\n[wavelengths]\n{wavelengths}\n[fixed]\n\
            temperature_c = {temperature}\nwater_saturation = {saturation}\nsphericity = {sphericity}\n\
            {below}{substrate}[fixed.black_carbon]\n{black}[model]\n{choices}\
            [run]\nengine = \"{engine}\"\nseed = {seed}\nrays = {rays}\n[compression]\n{rmse}");
        let first = grid::parse("g.toml", &text).map_err(|e| TestCaseError::fail(e.to_string()))?;
        let written = first.grid.to_config();
        let mut again = grid::parse("g.toml", &written).map_err(|e| TestCaseError::fail(e.to_string()))?.grid;
        prop_assert_eq!(again.to_config(), written);
        // The compression bounds do not affect the spectra and are not written.
        again.compression = first.grid.compression;
        prop_assert_eq!(again, first.grid);
    }

    /// Valid files with text inserted at random places are read or refused, without a panic.
    #[test]
    fn corrupted_files_never_panic(
        insertions in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 1..12),
        good in prop::sample::select(vec![GRID, SAMPLE, SNOWPACK, SCENE]),
    ) {
        const PIECES: [&str; 16] = ["nan", "-inf", "1e999", "-0.0", "[", "]", "{", "}", "=", "\"", "\n",
            "[[layer]]\n", "[axes]\n", "0x7fffffffffffffffffff", "a.b.c = 1\n", "\u{feff}"];
        let mut text = good.to_owned();
        for (piece, position) in insertions {
            let position = position.index(text.len() + 1);
            if text.is_char_boundary(position) {
                text.insert_str(position, piece.get::<&str>(&PIECES));
            }
        }
        let _ = (sample::parse("s.toml", &text), grid::parse("g.toml", &text));
        let _ = scene::parse("s.toml", &text);
    }
}

#[test]
fn former_names_of_keys_and_engines_are_read() {
    let former = |text: &str| {
        let old = text.replace("incidence_angle_deg", "polar_angle_deg");
        assert_ne!(old, text);
        old
    };
    let [new, old] = [SAMPLE.to_owned(), former(SAMPLE)].map(|t| sample::parse("s.toml", &t));
    assert_eq!(new.unwrap(), old.unwrap());

    let hybrid = GRID.replace("\"spectral\"", "\"hybrid\"");
    let new = grid::parse("g.toml", &hybrid).unwrap().grid;
    assert_eq!(new.run.engine, Engine::Hybrid);
    let old = hybrid
        .replace("incidence_angle_deg", "angle_deg")
        .replace("\"hybrid\"", "\"doubling\"");
    assert_eq!(grid::parse("g.toml", &old).unwrap().grid, new);

    let scene = include_str!("../configs/scenes/igloo.toml");
    let old = scene.replace("incidence_angle_deg", "angle_deg");
    assert_ne!(old, scene);
    let [new, old] = [scene, &old].map(|text| scene::parse("x.toml", text).unwrap().scene);
    assert_eq!(new, old);

    // the present and a former name together
    let both = GRID.replace(
        "incidence_angle_deg =",
        "angle_deg = [0]\nincidence_angle_deg =",
    );
    let refused = grid::parse("g.toml", &both).unwrap_err().to_string();
    assert!(
        refused.contains("`axes.angle_deg` is not a known key"),
        "{refused}"
    );
}
