//! Light-absorbing substances other than carbon, from the config file to the database, and
//! wavelengths beyond 2500 nm.
#![allow(clippy::unwrap_used)]
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::common::Folder;
use splitsnow::config::sample::{self, SampleFile};
use splitsnow::engine::{Cache, Control, Engine, UnitStore, Units};
use splitsnow::measurement::Spectrum;
use splitsnow::optics::{Absorber, Carbon, IceTable, MassAbsorption, SPECIES};
use splitsnow::simulation::Simulation;
use splitsnow::spectrum::Table;
use splitsnow::transport::{Layer, Snow, Snowpack, Substrate, TRACERS, Tracers};

/// A sample of coarse snow; `absorbers` is appended to its layer.
fn text(absorbers: &str) -> String {
    format!(
        "version = 1\nillumination = {{ incidence_angle_deg = 50 }}\n\
         wavelengths = {{ values_nm = [400, 470, 550, 640, 750, 900] }}\n\
         [model]\nimpurity_mass = \"conserved\"\n[[layer]]\nthickness_cm = 20\ndensity_kg_m3 = 300\n\
         grain = [{{ size_um = {{ min = 400, max = 600 }}, facetness = {{ min = 0.2, max = 0.4, mean = 0.3, sd = 0.07 }} }}]\n{absorbers}"
    )
}

fn parse(absorbers: &str) -> SampleFile {
    sample::parse("s.toml", &text(absorbers)).unwrap()
}

/// The message about a sample in `folder`.
fn message(folder: &Path, absorbers: &str) -> String {
    let name = folder.join("s.toml").display().to_string();
    let error = sample::parse(&name, &text(absorbers))
        .unwrap_err()
        .to_string();
    error.strip_prefix(&name).unwrap().to_owned()
}

fn run(sample: &SampleFile, snowpack: &Snowpack, engine: Engine) -> Spectrum {
    let mut file = sample.clone();
    file.snowpack = snowpack.clone();
    Simulation::of(&file)
        .engine(engine)
        .rays(2000)
        .threads(1)
        .run()
        .unwrap()
}

fn dust(name: &str, ug_g: f64, m2_g: f64, angstrom_exponent: f64) -> Absorber {
    Absorber {
        name: name.into(),
        concentration_ng_g: 1e3 * ug_g,
        sedimentation: 0.3,
        mass_absorption: MassAbsorption::Power {
            m2_g,
            reference_nm: 550.0,
            angstrom_exponent,
        },
        per_wet_mass: false,
        scattering: None,
    }
}

/// Asserts that two spectra of the same walks differ by rounding alone. `hybrid` sorts walks
/// into bins by the sums over absorbers, which differ, so that it differs by its own error.
fn assert_same_walks(engine: Engine, a: &Spectrum, b: &Spectrum) {
    let bound = if engine == Engine::Hybrid { 5e-4 } else { 1e-9 };
    for (a, b) in [
        (&a.reflectance, &b.reflectance),
        (&a.transmittance, &b.transmittance),
    ] {
        for (a, b) in a.iter().zip(b) {
            assert!((a.value - b.value).abs() < bound, "{engine:?} {a:?} {b:?}");
        }
    }
}

const ENGINES: [Engine; 3] = [Engine::Reference, Engine::Spectral, Engine::Hybrid];

#[test]
fn a_file_gives_what_the_same_power_law_gives() {
    let folder = tempfile::tempdir().unwrap();
    let rows = [350.0, 500.0, 800.0, 1000.0].map(|nm: f64| {
        let mac = 0.05 * (550.0 / nm).powf(3.0);
        format!("{nm},{mac}\n")
    });
    let csv = format!("# made up\nwavelength_nm,mac_m2_g\n{}", rows.concat());
    fs::write(folder.path().join("dust.csv"), csv).unwrap();
    let law = "mass_absorption_efficiency_m2_g = 0.05\nreference_wavelength_nm = 550\nangstrom_exponent = 3";
    let amount = "concentration_ug_g = 60\nphase = \"pores\"\n";
    let given = parse(&format!("[[layer.absorber]]\n{amount}{law}"));
    let name = folder.path().join("s.toml").display().to_string();
    let read = text(&format!("[[layer.absorber]]\n{amount}file = \"dust.csv\""));
    let read = sample::parse(&name, &read).unwrap();
    assert!(
        read.notes[0]
            .ends_with("dust.csv: mass absorption efficiency in m2/g, 4 rows, 350 to 1000 nm"),
        "{:?}",
        read.notes
    );
    let [absorber] = &read.snowpack.surface.absorbers[..] else {
        panic!("one absorber");
    };
    assert_eq!(
        (absorber.name.as_str(), absorber.concentration_ng_g),
        ("dust", 6e4)
    );
    assert_eq!(absorber.sedimentation, 0.0);
    let clean = parse("");
    for engine in ENGINES {
        let [given, read, clean] = [&given, &read, &clean].map(|s| run(s, &s.snowpack, engine));
        assert_same_walks(engine, &given, &read);
        assert!(given.reflectance[0].value < clean.reflectance[0].value - 0.05);
    }
    // the canonical text holds the values, not the path
    assert!(!read.to_toml().contains("csv"));
    let again = sample::parse("elsewhere.toml", read.to_toml()).unwrap();
    assert_eq!(again.snowpack, read.snowpack);
    assert_eq!(again.to_toml(), read.to_toml());
}

#[test]
fn carbon_is_an_absorber_like_others() {
    let own = parse("[layer.black_carbon]\nconcentration_ng_g = 200\nsedimentation = 0.3");
    let listed = parse(
        "[[layer.absorber]]\nspecies = \"black_carbon\"\nconcentration_ng_g = 200\nsedimentation = 0.3",
    );
    assert_eq!(own.to_toml(), listed.to_toml());
    assert_eq!(own.snowpack, listed.snowpack);
    // nor does it matter to a bit if it stays in the list
    let usual = Carbon::black(200.0);
    let mut snowpack = own.snowpack.clone();
    snowpack.surface.black_carbon = None;
    snowpack.surface.absorbers = vec![Absorber {
        concentration_ng_g: usual.concentration_ng_g,
        mass_absorption: MassAbsorption::Power {
            m2_g: usual.mass_absorption_efficiency_m2_g,
            reference_nm: usual.reference_wavelength_nm,
            angstrom_exponent: usual.angstrom_exponent,
        },
        ..dust("soot", 0.0, 0.0, 0.0)
    }];
    for engine in ENGINES {
        assert_eq!(
            run(&own, &own.snowpack, engine),
            run(&own, &snowpack, engine)
        );
    }
}

/// Substances with different exponents, as many as `exponents`.
fn many(exponents: &[f64]) -> Vec<Absorber> {
    let substance = |a: &f64| dust("many", 4.0 + a, 0.05, *a);
    exponents.iter().map(substance).collect()
}

#[test]
fn a_layer_may_have_any_number_of_absorbers() {
    let sample = parse("");
    let mixed = many(&[0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0]);
    let nm = &sample.wavelengths_nm;
    let total = |nm: &f64| {
        let parts = mixed
            .iter()
            .map(|absorber| match &absorber.mass_absorption {
                MassAbsorption::Power {
                    m2_g,
                    angstrom_exponent,
                    ..
                } => absorber.concentration_ng_g * m2_g * (550.0 / nm).powf(*angstrom_exponent),
                MassAbsorption::Table(_) => unreachable!(),
            });
        parts.sum::<f64>() / 1e4
    };
    let values: Vec<f64> = nm.iter().map(total).collect();
    let table = Table::from_column(nm, &values).unwrap();
    let one = Absorber {
        mass_absorption: MassAbsorption::Table(Arc::new(table)),
        ..dust("one", 10.0, 0.0, 0.0)
    };
    let snowpack = |absorbers: Vec<Absorber>| {
        let mut snowpack = sample.snowpack.clone();
        snowpack.surface.absorbers = absorbers;
        snowpack
    };
    let (mixed, one) = (snowpack(mixed), snowpack(vec![one]));
    let kind = |snowpack: &Snowpack| Tracers::of(snowpack, &sample.model, nm);
    assert!(matches!(kind(&mixed), Tracers::Places(places) if places.len() == 2));
    assert!(matches!(kind(&one), Tracers::Laws(laws) if laws.len() == 1));
    for engine in ENGINES {
        assert_same_walks(
            engine,
            &run(&sample, &mixed, engine),
            &run(&sample, &one, engine),
        );
    }
}

/// Keeps the units of a checkpoint.
#[derive(Debug, Clone, Default)]
struct Kept(Arc<Mutex<Vec<Vec<u8>>>>);

impl UnitStore for Kept {
    fn append(&self, units: &[u8]) -> bool {
        self.0.lock().unwrap().push(units.to_vec());
        true
    }
}

/// The spectrum of [`run`] with a checkpoint that has the units `earlier`, the rays that were
/// walked and all units.
fn resumed(
    sample: &SampleFile,
    snowpack: &Snowpack,
    engine: Engine,
    earlier: &[Vec<u8>],
) -> (Spectrum, u64, Vec<Vec<u8>>) {
    let mut file = sample.clone();
    file.snowpack = snowpack.clone();
    let simulation = Simulation::of(&file).rays(2000);
    let kept = Kept::default();
    let units = Units::new(Box::new(kept.clone()), earlier).with_save_interval(Duration::ZERO);
    let rays_done = AtomicU64::new(0);
    let control = Control {
        parallel: false,
        cancel: &AtomicBool::new(false),
        rays_done: &rays_done,
        cache: &Cache::default().with(units),
    };
    let spectra = engine.run(&simulation.request(), &control).unwrap();
    let kept = kept.0.lock().unwrap().clone();
    (spectra[0].clone(), rays_done.into_inner(), kept)
}

/// Five layers, each with its own mixture of five substances: the list of wavelengths is divided.
#[test]
fn so_may_any_number_of_layers() {
    let sample = parse("");
    let layer = |absorbers: Vec<Absorber>| Layer {
        snow: Snow {
            absorbers,
            ..sample.snowpack.surface.clone()
        },
        thickness_m: 0.04,
    };
    let mixtures: Vec<Vec<Absorber>> = (0..5)
        .map(|i| {
            let mut absorbers = many(&[0.0, 1.0, 2.0, 3.0, 4.0]);
            absorbers[i].concentration_ng_g *= 5.0;
            absorbers
        })
        .collect();
    let pack = |mixtures: &[Vec<Absorber>]| {
        let layers: Vec<_> = mixtures.iter().cloned().map(layer).collect();
        Snowpack::of(&layers, Substrate::Black).unwrap().0
    };
    let snowpack = pack(&mixtures);
    assert!(Tracers::of(&snowpack, &sample.model, &sample.wavelengths_nm).len() > TRACERS);
    let at = |nm: &[f64]| {
        let mut sample = sample.clone();
        sample.wavelengths_nm = nm.to_vec();
        sample
    };
    for engine in ENGINES {
        let whole = run(&sample, &snowpack, engine);
        let mut parts = Spectrum::default();
        for nm in sample.wavelengths_nm.chunks(TRACERS) {
            let part = run(&at(nm), &snowpack, engine);
            parts.reflectance.extend(part.reflectance);
            parts.transmittance.extend(part.transmittance);
            parts.lost.extend(part.lost);
        }
        assert_eq!(whole, parts);
        // two parts: what is finished is not walked again
        let (spectrum, walked, units) = resumed(&sample, &snowpack, engine, &[]);
        assert_eq!((&spectrum, units.len()), (&whole, 2));
        let (spectrum, walked_again, rest) = resumed(&sample, &snowpack, engine, &units[..1]);
        assert_eq!((&spectrum, rest.len()), (&whole, 1));
        assert!(0 < walked_again && walked_again < walked);
        let (spectrum, walked_again, _) = resumed(&sample, &snowpack, engine, &units);
        assert_eq!((&spectrum, walked_again), (&whole, 0));
        // at one wavelength, each layer might as well have one grey substance
        let nm = 470.0;
        let grey = |absorbers: &Vec<Absorber>| {
            let strength = absorbers
                .iter()
                .map(|absorber| match absorber.mass_absorption {
                    MassAbsorption::Power {
                        angstrom_exponent, ..
                    } => {
                        absorber.concentration_ng_g
                            * 0.05
                            * (550.0_f64 / nm).powf(angstrom_exponent)
                    }
                    MassAbsorption::Table(_) => unreachable!(),
                });
            vec![dust("grey", 1.0, strength.sum::<f64>() / 1e3, 0.0)]
        };
        let grey: Vec<_> = mixtures.iter().map(grey).collect();
        let [a, b] = [&snowpack, &pack(&grey)].map(|snowpack| run(&at(&[nm]), snowpack, engine));
        assert_same_walks(engine, &a, &b);
    }
}

#[test]
fn wrong_absorbers_give_one_message() {
    let folder = tempfile::tempdir().unwrap();
    let file = |text: &str| {
        fs::write(folder.path().join("x.csv"), text).unwrap();
        message(
            folder.path(),
            "[[layer.absorber]]\nconcentration_ug_g = 5\nfile = \"x.csv\"",
        )
    };
    let header = "wavelength_nm,mac_m2_g\n";
    for (csv, part) in [
        (
            "",
            "the header is ``; expected CSV with the header `wavelength_nm,mac_m2_g`",
        ),
        (
            "nm,mac\n1,2\n3,4\n",
            "expected CSV with the header `wavelength_nm,mac_m2_g`",
        ),
        (
            &format!("{header}400,1\n300,1\n"),
            "row 2 is not above the row before it",
        ),
        (&format!("{header}350,1\n1000,x\n"), "row 2"),
        (
            &format!("{header}350,1\n1000,-2\n"),
            "-2 m2/g at 1000 nm; allowed 0 to 1000 m2/g",
        ),
        (
            &format!("{header}350,1\n850,2\n"),
            "covers 350 to 850 nm, but the wavelengths run from 400 to 900 nm",
        ),
    ] {
        let message = file(csv);
        assert!(
            message.starts_with(":12: `layer[0].absorber[0].file` = \"x.csv\""),
            "{message}"
        );
        assert!(message.contains(part), "{message}");
        assert_eq!(message.lines().count(), 2, "{message}");
    }
    let law = "mass_absorption_efficiency_m2_g = 0.05";
    for (keys, part) in [
        (
            "concentration_ng_g = 5",
            "`layer[0].absorber[0].species` is missing",
        ),
        (
            "species = \"volcanic_ash\"",
            "`layer[0].absorber[0].concentration_ng_g` is missing",
        ),
        (
            "species = \"volcanic_ahs\"\nconcentration_ng_g = 5",
            "did you mean `volcanic_ash`",
        ),
        (
            "species = \"volcanic_ash\"\nfile = \"x.csv\"\nconcentration_ng_g = 5",
            "cannot be combined with `layer[0].absorber[0].species`",
        ),
        (
            "concentration_ng_g = 5\nconcentration_ug_g = 5\nspecies = \"volcanic_ash\"",
            "cannot be combined",
        ),
        (
            "concentration_ng_g = 5\nphase = \"ice\"\nsedimentation = 1\nspecies = \"volcanic_ash\"",
            "cannot be combined",
        ),
        (
            "concentration_ng_g = 5\nphase = \"air\"\nspecies = \"volcanic_ash\"",
            "is not one of the choices",
        ),
        (
            "concentration_ug_g = 2e6\nspecies = \"volcanic_ash\"",
            "is out of range: allowed 0 to 1000000",
        ),
        (
            &format!("concentration_ng_g = 5\n{law}"),
            "reference_wavelength_nm` is missing",
        ),
        (
            "concentration_ng_g = 5\nmass_absorption_efficiency_m2_g = [1, 2]",
            "has 2 values for 6 wavelengths",
        ),
        (
            "concentration_ng_g = 5\nspecies = \"volcanic_ash\"\nangstrom_exponent = 2",
            "needs mass_absorption_efficiency_m2_g as one number",
        ),
        (
            "concentration_ng_g = 5\nfile = \"none.csv\"",
            "cannot read table",
        ),
    ] {
        let message = message(folder.path(), &format!("[[layer.absorber]]\n{keys}"));
        assert!(message.contains(part), "{keys}: {message}");
        assert!(message.lines().count() <= 2, "{message}");
    }
    let twice = "[[layer.absorber]]\nspecies = \"black_carbon\"\nconcentration_ng_g = 5\n[layer.black_carbon]\nconcentration_ng_g = 1";
    let message = message(folder.path(), twice);
    assert!(message.contains("black_carbon is given too"), "{message}");
}

#[test]
fn every_species_darkens_blue_light() {
    let clean = parse("");
    let clean = run(&clean, &clean.snowpack, Engine::Spectral);
    for species in &SPECIES {
        let name = species.name;
        let sample = parse(&format!(
            "[[layer.absorber]]\nspecies = \"{name}\"\nconcentration_ug_g = 30"
        ));
        let snow = &sample.snowpack.surface;
        let carbon = snow.carbon().count();
        assert_eq!(carbon + snow.absorbers().count(), 1, "{name}");
        let dirty = run(&sample, &sample.snowpack, Engine::Spectral);
        let [dirty, clean] = [&dirty, &clean].map(|spectrum| spectrum.reflectance[0].value);
        assert!(dirty < clean - 0.01, "{name}: {dirty} {clean}");
    }
}

const GRID: &str = "version = 1
[axes]
facetness = [0.3]
grain_size_um = [300]
density_kg_m3 = [250]
thickness_cm = [5, 10]
incidence_angle_deg = [0, 60]
absorber_ug_g = [0, 50, 200]
[wavelengths]
values_nm = [450, 550, 650]
[fixed]
absorber = [{ name = \"dust\", file = \"dust.csv\", phase = \"pores\" }]
[run]
engine = \"hybrid\"
rays = 2000
";

#[test]
fn the_mass_of_an_absorber_is_an_axis() {
    let folder = Folder::new(GRID);
    let csv = "wavelength_nm,mac_m2_g\n400,0.08\n700,0.01\n";
    folder.write("dust.csv", csv);
    let plan = folder.succeeds("plan g.toml");
    assert!(
        plan.contains("absorber_ug_g        3 values, 0 to 200"),
        "{plan}"
    );
    folder.succeeds("build g.toml");
    let query = |ug_g: f64| {
        let snow = "--facetness 0.3 --grain-size-um 300 --density-kg-m3 250 --thickness-cm 10 --incidence-angle-deg 0 --quantity reflectance";
        let text = folder.succeeds(&format!("query out/g {snow} --absorber-ug-g {ug_g}"));
        let line = text.lines().nth(1).unwrap().to_owned();
        line.split(',').nth(1).unwrap().parse::<f64>().unwrap()
    };
    let [clean, some, more] = [0.0, 50.0, 120.0].map(query);
    assert!(
        clean > some + 0.02 && some > more + 0.02,
        "{clean} {some} {more}"
    );
    // the same snow as a sample
    let name = folder.0.path().join("s.toml").display().to_string();
    let grain = "size_um = { min = 250, max = 350 }, facetness = { min = 0.2, max = 0.4, mean = 0.3, sd = 0.072 }";
    let sample = format!(
        "version = 1\nillumination = {{ incidence_angle_deg = 0 }}\nwavelengths = {{ values_nm = [450, 550, 650] }}\n\
         [[layer]]\nthickness_cm = 10\ndensity_kg_m3 = 250\ngrain = [{{ {grain} }}]\n\
         absorber = [{{ concentration_ug_g = 50, file = \"dust.csv\", phase = \"pores\" }}]\n"
    );
    let sample = sample::parse(&name, &sample).unwrap();
    let simulated = Simulation::of(&sample)
        .engine(Engine::Hybrid)
        .rays(20_000)
        .threads(1)
        .run();
    let simulated = simulated.unwrap().reflectance[0];
    assert!(
        (simulated.value - some).abs() < 0.01,
        "{simulated:?} {some}"
    );
    // another file is another database, and nothing is half-written
    folder.write("dust.csv", &csv.replace("0.08", "0.09"));
    let refused = folder.run("build g.toml");
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && errors.contains("fixed.absorber"),
        "{errors}"
    );
    folder.write("dust.csv", csv);
    folder.succeeds("build g.toml");
    // an axis needs an absorber, and an absorber needs a mass
    for (edit, part) in [
        (
            "absorber = [{ name = \"dust\", file = \"dust.csv\", phase = \"pores\" }]\n",
            "`fixed.absorber` is missing",
        ),
        (
            "absorber_ug_g = [0, 50, 200]\n",
            "`fixed.absorber[0].concentration_ng_g` is missing",
        ),
    ] {
        folder.write("wrong.toml", &GRID.replace(edit, ""));
        let output = folder.run("plan wrong.toml");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            !output.status.success() && errors.contains(part),
            "{errors}"
        );
    }
}

/// Reflectance at normal incidence of a half space of spheres of index n + i k, so opaque that
/// light leaves it only after a single reflection on the outside of one of them. Light turned
/// by the angle pi - 2 theta was reflected at theta, by the Fresnel reflectance; turned angles
/// are isotropic.
fn single_reflection(n: f64, k: f64) -> f64 {
    let fresnel = |cos: f64| {
        let sin2 = 1.0 - cos * cos;
        let (re, im) = (n * n - k * k - sin2, 2.0 * n * k);
        let modulus = re.hypot(im);
        let a = ((modulus + re) / 2.0).sqrt();
        let b = ((modulus - re) / 2.0).max(0.0).sqrt();
        let s = ((a - cos).powi(2) + b * b) / ((a + cos).powi(2) + b * b);
        let t = sin2 / cos;
        let p = s * ((a - t).powi(2) + b * b) / ((a + t).powi(2) + b * b);
        0.5 * (s + p)
    };
    let points = (0..2000).map(|i| {
        let mu = (f64::from(i) + 0.5) / 2000.0;
        let theta = 0.5 * mu.acos();
        0.5 * fresnel(theta.cos()) * mu / (1.0 + mu)
    });
    points.sum::<f64>() / 2000.0
}

/// Where ice absorbs light within a few micrometres, snow reflects what the outsides of its
/// grains reflect. Further reflections and the grooves of facets add a nearly constant factor
/// (1.4 to 1.7), while the reflectance varies by a factor of 60. Engines agree.
#[test]
fn beyond_2500_nm_snow_reflects_like_the_outsides_of_its_grains() {
    let nm = [
        2850.0, 2950.0, 3050.0, 3150.0, 3300.0, 3600.0, 4500.0, 5000.0,
    ];
    let mut text = text("").replace("incidence_angle_deg = 50", "incidence_angle_deg = 0");
    text = text.replace("[400, 470, 550, 640, 750, 900]", &format!("{nm:?}"));
    text = text.replace("[model]", "[model]\npreset = \"measured\"");
    let sample = sample::parse("s.toml", &text).unwrap();
    let run = |engine| {
        let simulation = Simulation::of(&sample).engine(engine).rays(40_000);
        simulation.threads(1).run().unwrap()
    };
    let reference = run(Engine::Reference);
    for engine in [Engine::Spectral, Engine::Hybrid] {
        for (a, b) in run(engine).reflectance.iter().zip(&reference.reflectance) {
            let difference = (a.value - b.value).abs();
            assert!(
                difference < 4.0 * a.se.hypot(b.se),
                "{engine:?} {a:?} {b:?}"
            );
        }
    }
    for (nm, found) in nm.iter().zip(&reference.reflectance) {
        let index = IceTable::WarrenBrandt2008.at(*nm).unwrap();
        let single = single_reflection(index.n, index.k);
        let (low, high) = (1.25 * single, 1.85 * single);
        let noise = 4.0 * found.se;
        assert!(
            low - noise < found.value && found.value < high + noise,
            "{nm} {found:?} {single}"
        );
        assert!(found.value < 0.025);
    }
}
