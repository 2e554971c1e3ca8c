//! Particles in the pores that scatter light.
#![allow(clippy::unwrap_used)]
use splitsnow::config::sample::{self, SampleFile};
use splitsnow::engine::Engine;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::{Absorber, MassAbsorption, ParticleScattering};
use splitsnow::simulation::Simulation;
use splitsnow::slab::{Light, Medium, Streams};
use splitsnow::transport::Snowpack;

const NM: [f64; 3] = [450.0, 700.0, 1000.0];

/// A sample whose layers end with `dust`.
fn text(layers: &[(f64, f64)], dust: &str) -> String {
    let layers = layers.iter().map(|(thickness_cm, saturation)| {
        format!(
            "[[layer]]\nthickness_cm = {thickness_cm}\ndensity_kg_m3 = 300\nwater_saturation = {saturation}\n\
             grain = [{{ size_um = {{ min = 400, max = 600 }}, facetness = {{ min = 0.2, max = 0.4, mean = 0.3, sd = 0.07 }} }}]\n{dust}\n"
        )
    });
    let layers: String = layers.collect();
    format!(
        "version = 1\nillumination = {{ incidence_angle_deg = 50 }}\n\
         wavelengths = {{ values_nm = {NM:?} }}\n[model]\nimpurity_mass = \"conserved\"\n{layers}"
    )
}

const DUST: &str = "[[layer.absorber]]\nspecies = \"dust_libya\"\nconcentration_ug_g = 1000\n\
     phase = \"pores\"\nmass_scattering_efficiency_m2_g = 3\nasymmetry_parameter = 0.7";

fn parse(text: &str) -> SampleFile {
    sample::parse("s.toml", text).unwrap()
}

fn run(sample: &SampleFile, snowpack: &Snowpack, engine: Engine, rays: u64) -> Spectrum {
    let mut file = sample.clone();
    file.snowpack = snowpack.clone();
    let simulation = Simulation::of(&file).engine(engine).rays(rays).threads(2);
    simulation.run().unwrap()
}

fn pairs(spectrum: &Spectrum) -> impl Iterator<Item = &Measured> {
    spectrum.reflectance.iter().chain(&spectrum.transmittance)
}

/// Asserts that two spectra agree within 4.5 standard errors and `systematic`.
fn assert_agree(what: &str, a: &Spectrum, b: &Spectrum, systematic: f64) {
    for (a, b) in pairs(a).zip(pairs(b)) {
        let allowed = systematic + 4.5 * a.se.hypot(b.se);
        assert!((a.value - b.value).abs() < allowed, "{what}: {a:?} {b:?}");
    }
}

/// In hardly any snow, the particles are a slab of point scatterers, which the plane-parallel
/// solver knows.
#[test]
fn particles_alone_are_point_scatterers() {
    let sample = parse(&text(&[(5.0, 0.0)], ""));
    let (albedo, optical_thickness) = (50.0 / 51.0, 5.0 * 51.0 / 50.0);
    for asymmetry in [0.0, 0.7] {
        let mut snowpack = sample.snowpack.clone();
        // 10 g of snow and 100 g of particles in a cubic metre
        snowpack.surface.density_kg_m3 = 0.01;
        snowpack.surface.absorbers = vec![Absorber {
            name: "particles".into(),
            concentration_ng_g: 1e10,
            sedimentation: 0.0,
            mass_absorption: MassAbsorption::Power {
                m2_g: 0.02,
                reference_nm: 550.0,
                angstrom_exponent: 0.0,
            },
            per_wet_mass: false,
            scattering: Some(ParticleScattering {
                m2_g: 1.0,
                asymmetry,
            }),
        }];
        let streams = Streams::new(20).unwrap();
        let chi = (0..41).map(|l| albedo * asymmetry.powi(l));
        let medium = Medium::new(&streams, &chi.collect::<Vec<_>>()).unwrap();
        let cosine = 50_f64.to_radians().cos();
        let light = Light::Collimated { cosine };
        let expected = medium.fluxes(optical_thickness, light).unwrap();
        for engine in [Engine::Reference, Engine::Spectral, Engine::Tabulated] {
            let found = run(&sample, &snowpack, engine, 40_000);
            for (found, expected) in [
                (&found.reflectance, expected.reflectance),
                (&found.transmittance, expected.transmittance),
            ] {
                for found in found {
                    // a ray meets a grain with a probability of some .003
                    let allowed = 4.5 * found.se + 1e-3;
                    let error = (found.value - expected).abs();
                    assert!(
                        error < allowed,
                        "{engine:?} {asymmetry}: {found:?} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn engines_agree_in_dusty_snow() {
    for layers in [&[(3.0, 0.0)][..], &[(3.0, 0.3)], &[(1.0, 0.0), (1.0, 0.1)]] {
        let dusty = parse(&text(layers, DUST));
        let reference = run(&dusty, &dusty.snowpack, Engine::Spectral, 20_000);
        for (engine, rays, systematic) in [
            (Engine::Reference, 4000, 0.0),
            (Engine::Tabulated, 20_000, 0.0),
            (Engine::Hybrid, 65_536, 3e-3),
        ] {
            let found = run(&dusty, &dusty.snowpack, engine, rays);
            assert_agree(
                &format!("{engine:?} {layers:?}"),
                &found,
                &reference,
                systematic,
            );
        }
    }
}

/// Scattering makes dusty snow brighter, and without the keys nothing changes.
#[test]
fn scattering_brightens_dusty_snow() {
    let plain = DUST.split_once("mass_scattering").unwrap().0;
    let [clean, dark, dusty] = ["", plain, DUST].map(|dust| parse(&text(&[(40.0, 0.0)], dust)));
    let blue = |sample: &SampleFile| {
        run(sample, &sample.snowpack, Engine::Hybrid, 16_384).reflectance[0].value
    };
    let [clean, dark, dusty] = [&clean, &dark, &dusty].map(blue);
    assert!(dark < clean - 0.1, "{clean} {dark}");
    // three times the projected area of the grains in particles
    let ratio = (1.0 - dusty) / (1.0 - dark);
    assert!((0.5..0.9).contains(&ratio), "{dark} {dusty}");
}

#[test]
fn keys_are_checked_and_written_again() {
    let dusty = parse(&text(&[(3.0, 0.0)], DUST));
    let scattering = dusty.snowpack.surface.absorbers[0].scattering.unwrap();
    assert_eq!((scattering.m2_g, scattering.asymmetry), (3.0, 0.7));
    let again = sample::parse("again.toml", dusty.to_toml()).unwrap();
    assert_eq!(again.snowpack, dusty.snowpack);
    let message = |from: &str, to: &str| {
        let text = text(&[(3.0, 0.0)], &DUST.replace(from, to));
        sample::parse("s.toml", &text).unwrap_err().to_string()
    };
    for (from, to, expected) in [
        (
            "asymmetry_parameter = 0.7",
            "",
            "asymmetry_parameter` is missing",
        ),
        (
            "asymmetry_parameter = 0.7",
            "asymmetry_parameter = 1",
            "0.95",
        ),
        (
            "mass_scattering_efficiency_m2_g = 3",
            "",
            "mass_scattering_efficiency_m2_g` is missing",
        ),
        (
            "mass_scattering_efficiency_m2_g = 3",
            "mass_scattering_efficiency_m2_g = -1",
            "1000",
        ),
        (
            "phase = \"pores\"\n",
            "",
            "has no effect on particles inside the ice",
        ),
    ] {
        let message = message(from, to);
        assert!(message.contains(expected), "{message}");
    }
}
