//! Scores variants of the model on measured directions: the anisotropy factors, pi f / R, of two
//! snows in the laboratory (Dumont et al. 2010, tests/data/dumont_2010_anisotropy.csv).
//!
//! cargo run --release --example judge > judge.csv (two numbers may follow `--`: of walks,
//! default 6000, and of variants, the first ones)
//!
//! What the paper says of the grains is not at hand. So the optical radius is fitted, once for
//! each variant and sample, to the factors at normal incidence and 1030, 1240 and 1500 nm. Those
//! at 30 and 60 degrees are predictions, and so is 600 nm, where the radius hardly matters. Shapes
//! and facets are not fitted: each is a variant. The snow is dry, 30 cm thick, 275 kg/m3, -10 C.
//!
//! Columns: variant; sample; fitted optical radius; wavelength and incidence angle; number of
//! views; root mean square of the differences of the factors, and the part of it that is due to
//! the noise of the simulation. A summary goes to the standard error.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr)]
use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, AtomicU64};

use splitsnow::engine::exits::{Exits, goniometer};
use splitsnow::engine::{Cache, Control, Engine, MaxError, Request, Resolution};
use splitsnow::grain::{
    Facets, GrainType, Shape, SizeConversion, SizeLaw, SizeMeasure, SizeRange, TruncatedNormal,
};
use splitsnow::math::Vec3;
use splitsnow::measurement::Sensors;
use splitsnow::transport::{Entry, Illumination, Model, Snow};

const INCIDENCES_DEG: [f64; 3] = [0.0, 30.0, 60.0];
/// Candidates of the optical radius, um.
const RADII_UM: [f64; 6] = [45.0, 70.0, 110.0, 170.0, 260.0, 400.0];
/// Wavelengths of the fit, nm.
const FITTED_NM: [f64; 3] = [1030.0, 1240.0, 1500.0];

/// A measured factor.
struct Row {
    sample: u32,
    incidence_deg: f64,
    view_deg: f64,
    /// From the forward direction.
    azimuth_deg: f64,
    nm: f64,
    factor: f64,
}

fn measured() -> Vec<Row> {
    let text = include_str!("../tests/data/dumont_2010_anisotropy.csv");
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &str| {
        let numbers: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let [sample, incidence_deg, view_deg, azimuth_deg, nm, factor] = numbers[..] else {
            panic!("{line}")
        };
        Row {
            sample: sample as u32,
            incidence_deg,
            view_deg,
            azimuth_deg: 180.0 - azimuth_deg,
            nm,
            factor,
        }
    };
    lines.map(row).collect()
}

/// A truncated normal about `mean`, with half of the half width as standard deviation.
fn law(mean: f64, half_width: f64, [least, most]: [f64; 2]) -> TruncatedNormal {
    let (min, max) = (
        (mean - half_width).max(least),
        (mean + half_width).min(most),
    );
    TruncatedNormal::new(min, max, mean, 0.5 * half_width).unwrap()
}

struct Variant {
    name: String,
    model: Model,
    size_law: SizeLaw,
    shape: Shape,
    proportion: TruncatedNormal,
    facetness: TruncatedNormal,
}

fn variants() -> Vec<Variant> {
    let representative = |facets, entry| Variant {
        name: String::new(),
        model: Model {
            facets,
            entry,
            ..Model::default()
        },
        size_law: SizeLaw::Consistent,
        shape: Shape::Spheroid,
        proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
    };
    let published = || Variant {
        name: "varsa2025".into(),
        size_law: SizeLaw::Varsa2025,
        ..representative(Facets::Varsa2025, Entry::Uniform)
    };
    let named = |name: &str, facets, entry| Variant {
        name: name.into(),
        ..representative(facets, entry)
    };
    let grooved = |name: &str, shape: Shape, proportion: [f64; 2], facetness: f64| Variant {
        name: format!("measured: {name}, F {facetness}"),
        shape,
        proportion: law(
            proportion[0],
            proportion[1],
            match shape.has_aspect_ratio() {
                true => [0.02, 50.0],
                false => [0.05, 1.0],
            },
        ),
        facetness: law(facetness, facetness.min(0.1), [0.0, 1.0]),
        ..representative(Facets::VGroove, Entry::Projected)
    };
    let (spheroid, oblate, hexagonal) = (Shape::Spheroid, Shape::Oblate, Shape::Hexagonal);
    vec![
        published(),
        named("varsa2025, projected", Facets::Varsa2025, Entry::Projected),
        named("visible, projected", Facets::Visible, Entry::Projected),
        named("measured", Facets::VGroove, Entry::Projected),
        grooved("prolate .65", spheroid, [0.65, 0.15], 0.0),
        grooved("prolate .65", spheroid, [0.65, 0.15], 0.3),
        grooved("prolate .5", spheroid, [0.5, 0.1], 0.0),
        grooved("oblate .5", oblate, [0.5, 0.1], 0.0),
        grooved("plates .3", hexagonal, [0.3, 0.1], 0.1),
        grooved("columns 1", hexagonal, [1.0, 0.3], 0.3),
        grooved("columns 4", hexagonal, [4.0, 1.0], 0.1),
    ]
}

/// The anisotropy factor toward a view, and its standard error: linear in the polar angle between
/// the nearest two sensors.
fn factor(exits: &Exits, sensors: &Sensors, row: &Row) -> [f64; 2] {
    let at = |view_deg: f64| {
        let (sin, cos) = view_deg.to_radians().sin_cos();
        let (y, x) = row.azimuth_deg.to_radians().sin_cos();
        let sensor = sensors.index(Vec3::new(sin * x, sin * y, cos));
        let centre_deg = sensors.centre_rad(sensor)[0].to_degrees();
        (centre_deg, exits.reflected[sensor])
    };
    let (near_deg, near) = at(row.view_deg);
    let ring_deg = (2.0 * PI / sensors.len() as f64).sqrt().to_degrees();
    let beyond = row.view_deg
        + if row.view_deg > near_deg {
            ring_deg
        } else {
            -ring_deg
        };
    let (far_deg, far) = at(beyond.max(0.0));
    let t = match far_deg == near_deg {
        true => 0.0,
        false => (row.view_deg - near_deg) / (far_deg - near_deg),
    };
    let scale = PI / exits.reflectance.value;
    let mixed = near.mix(far, t);
    [scale * mixed.value, scale * mixed.se]
}

struct Judge {
    sensors: Sensors,
    rows: Vec<Row>,
    rays: u64,
}

/// Sum of squared differences, of squared standard errors, and the number of views.
type Score = [f64; 3];

impl Judge {
    /// Scores of a sample per wavelength at this incidence angle.
    fn scores(
        &self,
        variant: &Variant,
        radius_um: f64,
        (sample, incidence_deg): (u32, f64),
        wavelengths_nm: &[f64],
    ) -> Vec<Score> {
        let conversion = SizeConversion {
            half_width_um: 0.0,
            size_law: variant.size_law,
            shape: variant.shape,
            proportion: variant.proportion,
            temperature_c: -10.0,
        };
        let size_m = SizeMeasure::OpticalRadius.size_um(radius_um, &conversion) * 1e-6;
        let grain = GrainType {
            size: SizeRange::new(size_m, size_m)
                .unwrap()
                .with_law(variant.size_law),
            facetness: variant.facetness,
            shape: variant.shape,
            proportion: variant.proportion,
        };
        let request = Request {
            snowpack: &Snow::dry(grain, 275.0, -10.0).into(),
            thicknesses_m: &[0.3],
            illuminations: &[Illumination::Collimated {
                polar_angle_rad: incidence_deg.to_radians(),
            }],
            wavelengths_nm,
            model: &variant.model,
            rays: self.rays,
            max_error: MaxError::default(),
            resolution: Resolution::default(),
            seed: 1,
            cell: 0,
        };
        let (cancel, rays_done, cache) =
            (AtomicBool::new(false), AtomicU64::new(0), Cache::default());
        let control = Control {
            parallel: true,
            cancel: &cancel,
            rays_done: &rays_done,
            cache: &cache,
        };
        let exits = goniometer(Engine::Tabulated, &request, &self.sensors, &control).unwrap();
        let pairs = wavelengths_nm.iter().zip(&exits);
        let score = |(nm, exits): (&f64, &Exits)| {
            let rows = self.rows.iter().filter(|row| {
                row.sample == sample && row.incidence_deg == incidence_deg && row.nm == *nm
            });
            rows.fold([0.0; 3], |[squares, noise, count], row| {
                let [value, se] = factor(exits, &self.sensors, row);
                let off = value - row.factor;
                [squares + off * off, noise + se * se, count + 1.0]
            })
        };
        pairs.map(score).collect()
    }
}

fn rms(scores: impl Iterator<Item = Score>) -> [f64; 2] {
    let [squares, noise, count] = scores.fold([0.0; 3], |sum, score| {
        std::array::from_fn(|i| sum[i] + score[i])
    });
    [(squares / count).sqrt(), (noise / count).sqrt()]
}

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse().unwrap());
    let judge = Judge {
        rays: numbers.next().unwrap_or(6000),
        sensors: Sensors::new(2000),
        rows: measured(),
    };
    let most = numbers.next().unwrap_or(u64::MAX) as usize;
    let mut wavelengths_nm: Vec<f64> = judge.rows.iter().map(|row| row.nm).collect();
    wavelengths_nm.sort_by(f64::total_cmp);
    wavelengths_nm.dedup();
    println!("variant,sample,optical_radius_um,wavelength_nm,incidence_deg,views,rmse,noise");
    eprintln!("| variant | radius, um | 600 nm | 1030 nm | 600 nm, 60 degrees | all |");
    eprintln!("|---|---|---|---|---|---|");
    for variant in variants().iter().take(most) {
        let mut all: Vec<(f64, f64, Score)> = Vec::new();
        let mut radii = Vec::new();
        for sample in [1, 3] {
            let misfit = |radius_um: &f64| {
                let scores = judge.scores(variant, *radius_um, (sample, 0.0), &FITTED_NM);
                rms(scores.into_iter())[0]
            };
            let misfits: Vec<f64> = RADII_UM.iter().map(misfit).collect();
            let best = (0..RADII_UM.len()).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b]));
            let radius_um = RADII_UM[best.unwrap()];
            radii.push(radius_um.to_string());
            for incidence_deg in INCIDENCES_DEG {
                let key = (sample, incidence_deg);
                let scores = judge.scores(variant, radius_um, key, &wavelengths_nm);
                for (nm, score) in wavelengths_nm.iter().zip(scores) {
                    let [rmse, noise] = rms([score].into_iter());
                    println!(
                        "\"{}\",{sample},{radius_um},{nm},{incidence_deg},{},{rmse:.4},{noise:.4}",
                        variant.name, score[2]
                    );
                    all.push((*nm, incidence_deg, score));
                }
            }
        }
        let over = |chosen: &dyn Fn(f64, f64) -> bool| {
            let scores = all.iter().filter(|(nm, deg, _)| chosen(*nm, *deg));
            format!("{:.3}", rms(scores.map(|(.., score)| *score))[0])
        };
        eprintln!(
            "| {} | {} | {} | {} | {} | {} |",
            variant.name,
            radii.join(", "),
            over(&|nm, _| nm == 600.0),
            over(&|nm, _| nm == 1030.0),
            over(&|nm, deg| nm == 600.0 && deg == 60.0),
            over(&|_, _| true)
        );
    }
}
