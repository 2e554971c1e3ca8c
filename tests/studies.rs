//! Trends in the committed studies (configs/studies) other than those of homogeneous clean
//! snow in tests/published.rs: samples, layers, carbon, depth, and the BRDF.
//!
//! Each test runs its study file, with fewer wavelengths or sensors. A difference must be
//! significant over all comparisons here (see tests/published.rs).
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::snow::z_limit;
use splitsnow::config::sample;
use splitsnow::config::study::{Draw, StudyFile, StudyVariant, read};
use splitsnow::engine::exits::Exits;
use splitsnow::engine::{Cache, Control, Engine};
use splitsnow::lab::study::{Spectra, Studied, StudySettings, run};
use splitsnow::math::Vec3;
use splitsnow::measurement::{Measured, Sensors};

/// Probability that any comparison fails although the trend is real, and an upper bound of
/// the number of comparisons.
const ALPHA: f64 = 1e-6;
const COMPARISONS: usize = 200;

fn committed(name: &str) -> StudyFile {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/studies");
    read(&folder.join(format!("{name}.toml"))).unwrap()
}

fn study(name: &str, wavelengths_nm: &[f64]) -> StudyFile {
    let mut study = committed(name);
    for variant in &mut study.variants {
        variant.sample.wavelengths_nm = wavelengths_nm.to_vec();
    }
    study
}

/// The values of every variant, by group and label.
type Values = BTreeMap<(String, String), Vec<Measured>>;

fn studied(study: &StudyFile, rays: u64) -> Studied<'_> {
    let (cancel, rays_done, cache) = (AtomicBool::new(false), AtomicU64::new(0), Cache::default());
    let control = Control {
        parallel: true,
        cancel: &cancel,
        rays_done: &rays_done,
        cache: &cache,
    };
    let settings = StudySettings {
        engine: Engine::Auto,
        rays,
        seed: 2025,
    };
    run(study, settings, &control, |_| ()).unwrap()
}

fn spectra(study: &StudyFile, rays: u64) -> Spectra<'_> {
    match studied(study, rays) {
        Studied::Spectra(spectra) => spectra,
        Studied::Brdfs(_) => panic!("{} draws BRDFs", study.name),
    }
}

fn values(study: &StudyFile, rays: u64) -> Values {
    let studied = spectra(study, rays);
    let values_of = |(variant, _, values): (&StudyVariant, _, &[Measured])| {
        let key = (variant.group.clone(), variant.label.clone());
        (key, values.to_vec())
    };
    studied.curves().map(values_of).collect()
}

fn key(group: &str, label: &str) -> (String, String) {
    (group.to_owned(), label.to_owned())
}

/// The amount by which `more` exceeds `less`, and the limit of chance differences.
fn gap(more: Measured, less: Measured) -> (f64, f64) {
    let limit = z_limit(ALPHA, COMPARISONS) * more.se.hypot(less.se);
    (more.value - less.value, limit)
}

fn assert_more(label: &str, more: Measured, less: Measured, by: f64) {
    let (gap, limit) = gap(more, less);
    assert!(gap - limit > by, "{label}: {more:?} {less:?}");
}

/// 1 cm of fine faceted grains increases the reflectance of an old snowpack by more than 0.1
/// over 800-1300 nm, with either way of joining layers, and by less than 0.05 in the visible.
#[test]
fn a_surface_layer_brightens_the_near_infrared() {
    let wavelengths_nm = [500.0, 900.0, 1100.0, 1300.0];
    let found = values(&study("surface_layer", &wavelengths_nm), 2048);
    let old = &found[&key("", "basal layer, 15 cm")];
    for label in ["1 cm of fine grains on it", "cascaded as printed"] {
        let fresh = &found[&key("", label)];
        for l in 1..4 {
            assert_more(label, fresh[l], old[l], 0.1);
        }
        let (gap, limit) = gap(fresh[0], old[0]);
        assert!(gap.abs() < 0.05 + limit, "{label}: {gap}");
    }
}

/// Every step of black carbon lowers the reflectance at 450 and 550 nm. There, 1000 ng/g
/// lower it three times as much as at 1030 nm; at 1300 nm by less than 0.02.
#[test]
fn black_carbon_darkens_mostly_the_visible() {
    let wavelengths_nm = [450.0, 550.0, 1030.0, 1300.0];
    let found = values(&study("black_carbon", &wavelengths_nm), 8192);
    let values_of = |ng_g: u32| &found[&key("", &format!("{ng_g} ng/g"))];
    for (less, more) in [(0, 20), (20, 100), (100, 500), (500, 1000)] {
        for (less, more) in values_of(less).iter().zip(values_of(more)).take(2) {
            assert_more("clean above sooty", *less, *more, 0.0);
        }
    }
    let lost: Vec<_> = values_of(0)
        .iter()
        .zip(values_of(1000))
        .map(|(a, b)| gap(*a, *b))
        .collect();
    for visible in &lost[..2] {
        assert!(
            visible.0 - visible.1 > 3.0 * (lost[2].0 + lost[2].1),
            "{lost:?}"
        );
    }
    assert!(lost[3].0 < 0.02 + lost[3].1, "{lost:?}");
}

/// Below its reference wavelength of 880 nm, brown carbon absorbs more with a larger exponent
/// in the corrected law. In the law as printed, with nm, the trend is inverted, and at
/// exponent 2 nothing remains of the absorption.
#[test]
fn the_exponent_of_brown_carbon_acts_according_to_its_law() {
    let wavelengths_nm = [400.0, 500.0, 600.0];
    let found = values(&study("brown_carbon", &wavelengths_nm), 16_384);
    let values_of = |law: &str, label: &str| &found[&key(&format!("carbon_law = {law}"), label)];
    let exponents = ["exponent 1", "exponent 1.5", "exponent 2"];
    for pair in exponents.windows(2) {
        let [power, printed] =
            ["power", "varsa2025"].map(|law| (values_of(law, pair[0]), values_of(law, pair[1])));
        for l in 0..wavelengths_nm.len() {
            assert_more(pair[1], power.0[l], power.1[l], 0.0);
            let (gap, limit) = gap(printed.1[l], printed.0[l]);
            assert!(gap > -limit, "{}: {gap}", pair[1]);
        }
    }
    for l in 0..wavelengths_nm.len() {
        let printed = values_of("varsa2025", "exponent 2")[l];
        assert_more(
            "printed",
            printed,
            values_of("varsa2025", "exponent 1")[l],
            0.0,
        );
        let (gap, limit) = gap(values_of("varsa2025", "clean")[l], printed);
        assert!(gap.abs() < 0.005 + limit, "{gap}");
        // with exponent 1 the two laws are identical
        let (gap, limit) = self::gap(
            values_of("power", "exponent 1")[l],
            values_of("varsa2025", "exponent 1")[l],
        );
        assert!(gap.abs() <= limit, "{gap}");
    }
}

/// In every snow of the depth study, blue light (400-500 nm) penetrates deepest. At 10 cm it
/// clearly exceeds 700 nm, which exceeds 800 nm. At smaller depths of coarse snow, where ice
/// absorbs little, the visible is flat: blue is at most 0.001 below 600 nm. Beyond 600 nm,
/// transmittance decreases towards the infrared.
#[test]
fn blue_light_penetrates_deepest_in_all_snows() {
    let wavelengths_nm = [400.0, 450.0, 500.0, 600.0, 700.0, 800.0, 1000.0];
    let found = values(&study("depth", &wavelengths_nm), 4096);
    assert_eq!(found.len(), 16);
    for ((group, label), t) in found {
        let label = format!("{group}, {label}");
        let larger = |a: Measured, b: &Measured| if b.value > a.value { *b } else { a };
        let blue = t[..3].iter().fold(Measured::default(), larger);
        let (above, limit) = gap(blue, t[3]);
        assert!(above > -0.001 - limit, "{label}: {blue:?} {:?}", t[3]);
        for pair in t[3..].windows(2) {
            let (gap, limit) = gap(pair[0], pair[1]);
            assert!(gap > -limit, "{label}: {pair:?}");
        }
        if label == "10 cm" {
            assert!(above > -limit, "{label}: {blue:?} {:?}", t[3]);
            assert_more(&label, blue, t[4], 0.0);
            assert_more(&label, t[4], t[5], 0.0);
        }
    }
}

/// From 1.25 to 10 cm, total visible transmittance is nearly a straight line on logarithmic
/// axes: less than 2 % of the variance of the logarithms is unexplained. Standard errors (at
/// most 2 % of a value) do not contribute noticeably. The slope is that of a power of -1 or
/// steeper, and steeper in fine snow, where light takes longer paths.
#[test]
fn visible_transmittance_is_nearly_a_power_of_thickness() {
    let file = study("visible_thickness", &[450.0, 550.0, 650.0]);
    let studied = spectra(&file, 8192);
    let mut lines: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
    for (variant, thickness_m, mean) in studied.against_thickness() {
        assert!(mean.se < 0.02 * mean.value, "{mean:?}");
        if thickness_m < 0.1001 {
            let line = lines.entry(&variant.group).or_default();
            line.push([thickness_m.ln(), mean.value.ln()]);
        }
    }
    assert_eq!(lines.len(), 3);
    for (group, line) in lines {
        let n = line.len() as f64;
        let mean = |value: &dyn Fn(&[f64; 2]) -> f64| line.iter().map(value).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p[0]), mean(&|p| p[1]));
        let product = |i: usize, j: usize| mean(&|p| (p[i] - [x, y][i]) * (p[j] - [x, y][j]));
        let slope = product(0, 1) / product(0, 0);
        let unexplained = 1.0 - slope * product(0, 1) / product(1, 1);
        println!("{group}: slope {slope:.3}, variance left {unexplained:.4}");
        assert!((-1.6..-0.8).contains(&slope), "{group}: {slope}");
        assert!(unexplained < 0.02, "{group}: {unexplained}");
    }
}

/// The representative sample is bright in the visible. In the infrared it is dark in the
/// absorption bands of ice and brighter on either side of each band.
#[test]
fn the_representative_sample_shows_the_bands_of_ice() {
    let wavelengths_nm = [500.0, 1030.0, 1100.0, 1500.0, 1830.0, 2000.0, 2250.0];
    let found = values(&study("sample_representative", &wavelengths_nm), 4096);
    let r = &found[&key("", "representative sample")];
    assert_more("visible", r[0], Measured::default(), 0.95);
    for (bright, dark) in [(0, 1), (2, 1), (2, 3), (4, 3), (4, 5), (6, 5)] {
        let label = format!("{} nm", wavelengths_nm[bright]);
        assert_more(&label, r[bright], r[dark], 0.0);
    }
}

/// SISpec-195, for which the published size law meets 1.5 times the ice. The consistent law
/// reflects less blue light; elsewhere the reflectance changes by less than 0.02.
#[test]
fn the_size_law_matters_little_for_a_wide_size_range() {
    let wavelengths_nm = [400.0, 500.0, 700.0, 1030.0, 1250.0, 1830.0];
    let found = values(&study("sample_sispec_195", &wavelengths_nm), 16_384);
    let values_of = |law: &str| &found[&key("", &format!("size_law = {law}"))];
    let (published, consistent) = (values_of("varsa2025"), values_of("consistent"));
    assert_more("400 nm", published[0], consistent[0], 0.0);
    for (a, b) in published.iter().zip(consistent) {
        let (gap, limit) = gap(*a, *b);
        assert!(gap.abs() < 0.02 + limit, "{a:?} {b:?}");
    }
}

/// The 6 ng/g in SISpec-197 lower the reflectance at 400 and 500 nm, by less than 0.02. At 1030
/// and 1300 nm the change is below 0.001, with the same walks.
#[test]
fn a_little_black_carbon_darkens_only_the_visible() {
    let wavelengths_nm = [400.0, 500.0, 1030.0, 1300.0];
    let found = values(&study("sample_sispec_197", &wavelengths_nm), 16_384);
    let (sooty, clean) = (
        &found[&key("", "6 ng/g of black carbon")],
        &found[&key("", "clean")],
    );
    for l in 0..2 {
        assert_more("clean above sooty", clean[l], sooty[l], 0.0);
        assert!(clean[l].value - sooty[l].value < 0.02, "{sooty:?}");
    }
    for l in 2..4 {
        assert!((clean[l].value - sooty[l].value).abs() < 0.001, "{sooty:?}");
    }
}

/// Water in P18 increases visible transmittance, but decreases it at 740 nm, in one of its
/// absorption bands. Carbon absorbs blue light.
#[test]
fn water_and_carbon_change_p18_in_their_own_bands() {
    let wavelengths_nm = [450.0, 600.0, 740.0, 800.0];
    let found = values(&study("sample_p18", &wavelengths_nm), 32_768);
    let values_of = |label: &str| &found[&key("", label)];
    let (wet, dry) = (
        values_of("saturation 0.18, 5 ng/g"),
        values_of("dry, 5 ng/g"),
    );
    for l in [0, 1, 3] {
        assert_more("wet above dry", wet[l], dry[l], 0.0);
    }
    assert_more("in the band", dry[2], wet[2], 0.0);
    assert_more("clean", values_of("saturation 0.18, clean")[0], wet[0], 0.0);
}

/// A half-and-half mixture lies between its components, and above their mean. The variants
/// are the same as in the sample files.
#[test]
fn a_mixture_is_closer_to_its_small_grains() {
    let wavelengths_nm = [900.0, 1030.0];
    let file = study("mixture", &wavelengths_nm);
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/samples");
    let [small, half, large] = ["small", "mixture", "large"].map(|name| {
        let sample = sample::read(&samples.join(format!("{name}.toml"))).unwrap();
        let is_sample = |variant: &&StudyVariant| variant.sample.snowpack == sample.snowpack;
        file.variants.iter().find(is_sample).unwrap().label.clone()
    });
    let found = values(&file, 4096);
    let values_of = |label: &str| &found[&key("", label)];
    for l in 0..wavelengths_nm.len() {
        let (small, half, large) = (
            values_of(&small)[l],
            values_of(&half)[l],
            values_of(&large)[l],
        );
        let mean = Measured {
            value: (small.value + large.value) / 2.0,
            se: small.se.hypot(large.se) / 2.0,
        };
        assert_more("small above half", small, half, 0.0);
        assert_more("half above the mean", half, mean, 0.0);
    }
}

/// At every depth of the depth study, coarse light snow transmits most and fine dense snow
/// least. Of the other two, the coarse snow transmits more although it is denser.
#[test]
fn grain_size_matters_more_than_density_at_every_depth() {
    let found = values(&study("depth_snows", &[450.0, 600.0]), 8192);
    let snows = [
        "500 ± 50 µm, 100",
        "500 ± 50 µm, 400",
        "100 ± 50 µm, 100",
        "100 ± 50 µm, 400",
    ];
    for depth in ["2.5 cm", "5 cm", "7.5 cm", "10 cm"] {
        let values_of = |snow: &str| &found[&key(depth, &format!("{snow} kg/m3"))];
        for pair in snows.windows(2) {
            for (more, less) in values_of(pair[0]).iter().zip(values_of(pair[1])) {
                assert_more(depth, *more, *less, 0.0);
            }
        }
    }
}

/// Visible light decreases with depth in each of these snows: faster than 1 / depth in fine
/// dense snow, more slowly in coarse light snow.
#[test]
fn visible_light_decreases_faster_in_fine_dense_snow() {
    let file = study("depth_visible", &[450.0, 550.0, 650.0]);
    let studied = spectra(&file, 8192);
    let mut found: BTreeMap<&str, Vec<Measured>> = BTreeMap::new();
    for (variant, _, mean) in studied.against_thickness() {
        found.entry(&variant.group).or_default().push(mean);
    }
    assert_eq!(found.len(), 4);
    for (group, means) in &found {
        for pair in means.windows(2) {
            assert_more(group, pair[0], pair[1], 0.0);
        }
    }
    // the last depth is four times the first
    let quarter = |group: &str| (scaled(found[group][0], 0.25), found[group][3]);
    let (least, last) = quarter("500 ± 50 µm, 100 kg/m3");
    assert_more("coarse and light", last, least, 0.0);
    let (least, last) = quarter("100 ± 50 µm, 400 kg/m3");
    assert_more("fine and dense", least, last, 0.0);
}

/// BRDFs by group and label, on few sensors about 20 degrees wide.
struct Brdfs {
    sensors: Sensors,
    exits: BTreeMap<(String, String), Exits>,
}

fn brdfs(name: &str, rays: u64) -> Brdfs {
    let mut study = committed(name);
    let Draw::Brdf(draw) = &mut study.draw else {
        panic!("{name} draws spectra")
    };
    draw.sensors = 60;
    let Studied::Brdfs(brdfs) = studied(&study, rays) else {
        panic!("{name} gives spectra")
    };
    let named = brdfs.variants().map(|(variant, exits)| {
        let key = (variant.group.clone(), variant.label.clone());
        (key, exits.clone())
    });
    Brdfs {
        exits: named.collect(),
        sensors: brdfs.sensors.clone(),
    }
}

impl Brdfs {
    /// The BRDF relative to that of a Lambertian reflector with the same reflectance.
    fn relative(&self, group: &str, label: &str, degrees: f64, azimuth: f64) -> Measured {
        let exits = &self.exits[&key(group, label)];
        let (sin, cos) = degrees.to_radians().sin_cos();
        let direction = Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), -cos);
        let brdf = exits.reflected[self.sensors.index(direction)];
        scaled(brdf, PI / exits.reflectance.value)
    }

    fn nadir(&self, group: &str, label: &str) -> Measured {
        self.relative(group, label, 0.0, 0.0)
    }

    fn forward(&self, group: &str, label: &str) -> Measured {
        self.relative(group, label, 80.0, 0.0)
    }

    /// The ratio of the forward peak to the nadir.
    fn contrast(&self, group: &str, label: &str) -> Measured {
        let (peak, nadir) = (self.forward(group, label), self.nadir(group, label));
        let value = peak.value / nadir.value;
        let se = value * (peak.se / peak.value).hypot(nadir.se / nadir.value);
        Measured { value, se }
    }
}

fn scaled(m: Measured, by: f64) -> Measured {
    Measured {
        value: by * m.value,
        se: by * m.se,
    }
}

/// At normal incidence and 600 nm the BRDF is within a fifth of that of a Lambertian
/// reflector, up to 60 degrees. At 60 degrees incidence there is more light forward and less
/// at nadir, and both effects are stronger at 1800 nm.
#[test]
#[ignore = "long: tables of grain events for every part, some 15 CPU-s"]
fn oblique_light_is_scattered_forward() {
    let found = brdfs("brdf_incidence", 16_384);
    let [normal, slight, oblique] = ["0", "30", "60"].map(|angle| format!("light at {angle}°"));
    for degrees in [0.0, 20.0, 40.0, 60.0] {
        let f = found.relative("600 nm", &normal, degrees, 0.0);
        let limit = z_limit(ALPHA, COMPARISONS) * f.se;
        assert!((f.value - 1.0).abs() < 0.2 + limit, "{degrees}: {f:?}");
    }
    for nm in ["600 nm", "1800 nm"] {
        let peak = found.forward(nm, &oblique);
        for less in [&normal, &slight] {
            assert_more("forward at 60 degrees", peak, found.forward(nm, less), 0.0);
        }
        let nadirs = [&normal, &slight, &oblique].map(|label| found.nadir(nm, label));
        assert_more("nadir at 0 degrees", nadirs[0], nadirs[2], 0.0);
        for pair in nadirs.windows(2) {
            let (gap, limit) = gap(pair[0], pair[1]);
            assert!(gap > -limit, "{nm}: {pair:?}");
        }
    }
    let [near, far] = ["600 nm", "1800 nm"];
    let peaks = [near, far].map(|nm| found.forward(nm, &oblique));
    assert_more("forward at 1800 nm", peaks[1], peaks[0], 0.0);
    let nadirs = [near, far].map(|nm| found.nadir(nm, &oblique));
    assert_more("nadir at 600 nm", nadirs[0], nadirs[1], 0.0);
}

/// From 52.8 to 84.8 degrees incidence the forward peak increases and the nadir darkens. From
/// 69.3 degrees the peak is above everything else; at 84.8 degrees it is five times the
/// Lambertian value. At 1800 nm both effects are stronger than at 600 nm.
#[test]
fn more_grazing_light_is_scattered_more_forward() {
    let found = brdfs("brdf_incidence_published", 8_192);
    let labels = ["52.8", "69.3", "84.8"].map(|angle| format!("light at {angle}°"));
    let peaks = labels
        .each_ref()
        .map(|label| found.forward("600 nm", label));
    let nadirs = labels.each_ref().map(|label| found.nadir("600 nm", label));
    for i in 0..2 {
        assert_more("forward", peaks[i + 1], peaks[i], 0.0);
        let (gap, limit) = gap(nadirs[i], nadirs[i + 1]);
        assert!(gap > -limit, "{nadirs:?}");
        assert_more("nadir", nadirs[i], nadirs[2], 0.0);
    }
    assert_more(
        "the peak at 84.8 degrees",
        peaks[2],
        Measured::default(),
        5.0,
    );
    let backward = found.relative("600 nm", &labels[1], 60.0, PI);
    assert_more("forward above backward", peaks[1], backward, 0.0);
    let at_1800_nm =
        |value: fn(&Brdfs, &str, &str) -> Measured| value(&found, "1800 nm", &labels[1]);
    assert_more(
        "forward at 1800 nm",
        at_1800_nm(Brdfs::forward),
        peaks[1],
        0.0,
    );
    assert_more("nadir at 600 nm", nadirs[1], at_1800_nm(Brdfs::nadir), 0.0);
}

/// At 600 nm fine grains have the lower ratio of forward peak to nadir.
#[test]
#[ignore = "long: the difference is small, some 45 CPU-s"]
fn the_forward_peak_of_fine_grains_is_low_in_the_visible() {
    let found = brdfs("brdf_grain_size", 65_536);
    let [coarse, fine] = ["grains of 1.5-3 mm", "grains of 0.03-0.3 mm"];
    assert_more(
        "600 nm",
        found.contrast("600 nm", coarse),
        found.contrast("600 nm", fine),
        0.0,
    );
}

/// At 1450 nm fine grains have the higher forward peak in 1/sr. Their nadir is brighter by an
/// even larger factor.
#[test]
#[ignore = "long: tables of grain events for every part, some 10 CPU-s"]
fn the_forward_peak_of_fine_grains_is_high_in_the_infrared() {
    let found = brdfs("brdf_grain_size", 8_192);
    let [coarse, fine] = ["grains of 1.5-3 mm", "grains of 0.03-0.3 mm"];
    let contrast = |nm: &str, label: &str| found.contrast(nm, label);
    assert_more(
        "1450 nm",
        contrast("1450 nm", coarse),
        contrast("1450 nm", fine),
        10.0,
    );
    let per_sr = |label: &str| {
        let exits = &found.exits[&key("1450 nm", label)];
        scaled(
            found.forward("1450 nm", label),
            exits.reflectance.value / PI,
        )
    };
    assert_more("1450 nm, 1/sr", per_sr(fine), per_sr(coarse), 0.0);
}

/// Grains of both sizes scatter most light forward, more than to the sides and back at the
/// same angle. At 1450 nm fine grains are brighter in all these directions.
#[test]
fn the_peak_of_all_grain_sizes_is_forward() {
    let found = brdfs("brdf_hemisphere_grain_size", 4096);
    let grains = ["grains of 0.03-0.3 mm", "grains of 1.5-3 mm"];
    let azimuths = [0.0, FRAC_PI_2, PI];
    for nm in ["600 nm", "1450 nm"] {
        for label in grains {
            let [forward, side, back] = azimuths.map(|a| found.relative(nm, label, 80.0, a));
            assert_more(label, forward, side, 0.0);
            assert_more(label, forward, back, 0.0);
        }
    }
    for azimuth in azimuths {
        let [fine, coarse] = grains.map(|label| {
            let r = found.exits[&key("1450 nm", label)].reflectance.value;
            scaled(found.relative("1450 nm", label, 80.0, azimuth), r / PI)
        });
        assert_more("fine above coarse", fine, coarse, 0.0);
    }
}

/// The forward peak decreases with facetness. From 0.3 to 0.9 the decrease is small, so the
/// test only requires that it does not increase.
#[test]
#[ignore = "long: tables of grain events for every part, some 10 CPU-s"]
fn facets_lower_the_forward_peak() {
    let found = brdfs("brdf_facetness", 65_536);
    let [smooth, middle, faceted] =
        ["0-0.2", "0.2-0.4", "0.8-1"].map(|f| found.forward("", &format!("facetness {f}")));
    assert_more("0.1 above 0.3", smooth, middle, 0.0);
    assert_more("0.1 above 0.9", smooth, faceted, 0.0);
    let (gap, limit) = gap(middle, faceted);
    assert!(gap > -limit, "{middle:?} {faceted:?}");
}

/// At 1800 nm faceted snow has forward and backward peaks above the nadir and above the sides
/// at the same angle; smooth snow has the higher forward peak. At 600 nm faceted snow has no
/// forward peak.
#[test]
#[ignore = "long: tables of grain events for every part, some 10 CPU-s"]
fn faceted_snow_has_two_peaks_in_the_infrared() {
    let found = brdfs("brdf_hemisphere", 16_384);
    let [smooth, faceted] = ["facetness 0.1", "facetness 0.9"];
    let nm = "1800 nm";
    let forward = found.forward(nm, faceted);
    let backward = found.relative(nm, faceted, 60.0, PI);
    for (peak, degrees) in [(forward, 80.0), (backward, 60.0)] {
        assert_more("above nadir", peak, found.nadir(nm, faceted), 0.0);
        let side = found.relative(nm, faceted, degrees, FRAC_PI_2);
        assert_more("above the sides", peak, side, 0.0);
    }
    assert_more("smooth forward", found.forward(nm, smooth), forward, 0.0);
    let (gap, limit) = gap(
        found.nadir("600 nm", faceted),
        found.forward("600 nm", faceted),
    );
    assert!(gap > -limit, "{gap}");
}

/// The command writes a figure and a table for each study.
#[test]
fn the_command_draws_the_requested_studies() {
    let folder = tempfile::tempdir().unwrap();
    let sample = "\
version = 1
illumination.incidence_angle_deg = 0
wavelengths.values_nm = [500, 600, 900]
layer = [{ thickness_cm = 1, density_kg_m3 = 300, grain = [{ size_um = { min = 900, max = 1000 }, facetness = { min = 0, max = 1, mean = 0.3, sd = 0.1 } }] }]
";
    let study_text = |draw: &str| {
        format!(
            "version = 1\ntitle = \"Slabs\"\nexpected = \"more is darker\"\nsample = \"../s.toml\"\n\
             draw = {{ {draw} }}\n\
             [[variant]]\nlabel = \"1 cm\"\n[[variant]]\nlabel = \"2 cm\"\n\
             set.\"layer[0].thickness_cm\" = 2\n"
        )
    };
    let single_light =
        "[set]\nwavelengths = { values_nm = [600] }\nillumination = { incidence_angle_deg = 40 }\n";
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("s.toml"), sample).unwrap();
    std::fs::create_dir(path("studies")).unwrap();
    for against in ["wavelength", "thickness"] {
        let draw = format!("quantity = \"transmittance\", against = \"{against}\"");
        std::fs::write(path(&format!("studies/{against}.toml")), study_text(&draw)).unwrap();
    }
    for (directions, scale) in [("principal_plane", "logarithmic"), ("hemisphere", "linear")] {
        let draw = format!(
            "quantity = \"brdf\", sensors = 70, directions = \"{directions}\", scale = \"{scale}\""
        );
        let text = format!("{}{single_light}", study_text(&draw));
        std::fs::write(path(&format!("studies/{directions}.toml")), text).unwrap();
    }
    let output = Command::new(env!("CARGO_BIN_EXE_splitsnow"))
        .args(["study", "studies", "--rays", "1024", "--out", "out"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let rows = |name: &str| {
        let mut reader = csv::Reader::from_path(path(name)).unwrap();
        let header: Vec<_> = reader
            .headers()
            .unwrap()
            .iter()
            .map(str::to_owned)
            .collect();
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        (header, rows)
    };
    let (header, spectra) = rows("out/wavelength.csv");
    let columns = [
        "group",
        "variant",
        "wavelength_nm",
        "transmittance",
        "transmittance_se",
    ];
    assert_eq!(
        (header, spectra.len()),
        (columns.map(str::to_owned).into(), 6)
    );
    let number = |row: &csv::StringRecord, column: usize| row[column].parse::<f64>().unwrap();
    assert!(number(&spectra[0], 3) > number(&spectra[3], 3));
    let (header, means) = rows("out/thickness.csv");
    assert_eq!((header[2].as_str(), &means[1][2]), ("thickness_cm", "2"));
    // 900 nm is not visible
    let mean = (number(&spectra[0], 3) + number(&spectra[1], 3)) / 2.0;
    assert!((number(&means[0], 3) - mean).abs() < 2e-6);
    // a BRDF equals that of `simulate` with twice the number of walks
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_eq!(stdout.matches("forward/nadir").count(), 4, "{stdout}");
    let alone = sample
        .replace("incidence_angle_deg = 0", "incidence_angle_deg = 40")
        .replace("500, 600, 900", "600");
    std::fs::write(path("alone.toml"), alone).unwrap();
    let measured = Command::new(env!("CARGO_BIN_EXE_splitsnow"))
        .args(["measure", "alone.toml", "--rays", "2048", "--goniometer"])
        .args(["--sensors", "70"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let measured = String::from_utf8(measured.stdout).unwrap();
    let measured: Vec<f64> = measured
        .lines()
        .filter(|line| line.contains(",reflected,"))
        .map(|line| line.split(',').nth(4).unwrap().parse().unwrap())
        .collect();
    let (header, brdf) = rows("out/hemisphere.csv");
    assert_eq!(header[2..], ["polar_deg", "azimuth_deg", "brdf", "brdf_se"]);
    assert_eq!((brdf.len(), measured.len()), (140, 70));
    for (row, value) in brdf.iter().zip(measured) {
        assert!((number(row, 4) - value).abs() < 1e-6, "{row:?} {value}");
    }
    // the plane of incidence contains those at azimuths 0 and 180
    let (_, plane) = rows("out/principal_plane.csv");
    let cut: Vec<_> = brdf
        .iter()
        .filter(|row| ["0.00", "180.00"].contains(&&row[3]))
        .collect();
    assert!(plane.iter().all(|row| cut.contains(&row) || &row[2] > "80"));
    for name in ["wavelength", "thickness", "principal_plane", "hemisphere"] {
        let svg = std::fs::read_to_string(path(&format!("out/{name}.svg"))).unwrap();
        assert!(svg.contains("Slabs") && svg.contains("more is darker"));
        let png = std::fs::read(path(&format!("out/{name}.png"))).unwrap();
        assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    }
}
