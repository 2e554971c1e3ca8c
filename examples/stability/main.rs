//! Maps where methods fail: tests every engine, the plane-parallel solver, the
//! decomposition and the colour difference at the limits of the parameter space and
//! beyond.
//!
//! `cargo run --release --example stability -- docs` writes `stability.csv`, the measured
//! parts of `stability.md` and three pictures to `docs`, in about five minutes on one
//! core. A second argument scales the numbers of rays.
#![allow(clippy::unwrap_used, clippy::print_stdout)]
mod cases;
mod judge;
mod numerics;
mod pictures;
mod report;

use std::error::Error;
use std::fmt::Write;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use cases::{Case, absorbing, all, ordinary};
use judge::{Answer, impossible, judge};
use pictures::Curve;
use splitsnow::engine::{Cache, Engine, Resolution};
use splitsnow::grain::Surface;
use splitsnow::math::Vec3;
use splitsnow::measurement::{Measured, Spectrum};
use splitsnow::optics::Index;
use splitsnow::rng::{Key, Stream};
use splitsnow::table::{PackedTable, TableSnowpack, TableWalker, draw};
use splitsnow::transport::{Absorption, Coefficients, End, Sink, Walk};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Number of rays of `spectral`, with which the other engines are compared; they walk a
/// fraction of this number.
const RAYS: f64 = 100_000.0;

fn main() -> Result<()> {
    let font = dejavu::sans::regular();
    plotters::style::register_font("sans-serif", plotters::style::FontStyle::Normal, font)
        .map_err(|_| "unreadable font")?;
    let arguments: Vec<String> = std::env::args().collect();
    let docs = Path::new(arguments.get(1).map_or("docs", String::as_str));
    let scale: f64 = arguments.get(2).map_or(Ok(1.0), |text| text.parse())?;
    let rays = (RAYS * scale) as u64;
    let start = Instant::now();
    let (mut cases, mut rows) = (all(), vec![]);
    for case in &cases {
        rows.push((case.name.clone(), engines(case, rays)));
        println!("{:6.1} s  {}", start.elapsed().as_secs_f64(), case.name);
    }
    for saturation in [0.0, 0.5] {
        let (ladder, answers) = absorption(saturation, 2 * rays);
        cases.extend(ladder);
        rows.extend(answers);
    }
    println!("{:6.1} s  absorption", start.elapsed().as_secs_f64());
    report::csv(&docs.join("stability.csv"), &cases, &rows)?;
    let mapped = all().len();
    pictures::map(&docs.join("stability_map.svg"), &rows[..mapped])?;
    pictures::curves(
        &docs.join("stability_absorption.svg"),
        [
            "`hybrid` minus `spectral`, T, against absorption",
            "ice absorption per mean free distance",
            "|difference|",
        ],
        &against_absorption(&cases[mapped..], &rows[mapped..]),
        judge::stated(Engine::Hybrid),
    )?;
    pictures::curves(
        &docs.join("stability_thickness.svg"),
        [
            "`hybrid` minus `spectral` against thickness",
            "thickness, mean free distances",
            "|difference|",
        ],
        &against_thickness(4 * rays),
        judge::stated(Engine::Hybrid),
    )?;
    println!("{:6.1} s  thickness", start.elapsed().as_secs_f64());
    let page = std::fs::read_to_string(docs.join("stability.md"))?;
    let page = report::replace(&page, "map", &report::map(&rows))?;
    let page = report::replace(
        &page,
        "solver",
        &report::checks("slab", &numerics::solver()),
    )?;
    let page = report::replace(
        &page,
        "decomposition",
        &report::checks("matrix", &numerics::decomposition()),
    )?;
    let page = report::replace(
        &page,
        "colours",
        &report::checks("spectra", &numerics::colours()),
    )?;
    let page = report::replace(&page, "resolution", &resolution(rays)?)?;
    std::fs::write(docs.join("stability.md"), page)?;
    println!("{:6.1} s  done", start.elapsed().as_secs_f64());
    Ok(())
}

/// Runs all engines on one case and compares them with `spectral`.
fn engines(case: &Case, rays: u64) -> Vec<Answer> {
    let run =
        |engine, rays, seed| case.run(engine, rays, Resolution::default(), &Cache::default(), seed);
    // walks get longer with thickness: fewer rays in very thick slabs
    let deepest = (case.thicknesses_m.last().unwrap() - case.snowpack.below_m())
        / case.snowpack.surface.mean_free_distance_m();
    let rays = (rays as f64 * (30.0 / deepest).min(1.0)) as u64;
    let spectral = run(Engine::Spectral, rays, 1);
    let expected = spectral.clone().unwrap_or_default();
    let rays_of = |engine| match engine {
        Engine::Reference => rays / 10,
        Engine::Spectral => rays,
        _ => rays / 2,
    };
    Engine::ALL
        .into_iter()
        .map(|engine| {
            let result = if engine == Engine::Spectral {
                spectral.clone()
            } else {
                run(engine, rays_of(engine).max(4096), 2)
            };
            let refusal = case.refusal(engine, Resolution::default());
            judge(case, engine, refusal.map_or(result, Err), &expected)
        })
        .collect()
}

/// A series of cases with increasing absorption, along which R and T must decrease.
fn absorption(saturation: f64, rays: u64) -> (Vec<Case>, Vec<(String, Vec<Answer>)>) {
    let ladder = [
        0.0, 1e-12, 1e-9, 1e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 1e-2, 0.1,
    ];
    // 1e-25 instead of 0: its absorption is below rounding
    let cases = ladder.map(|k| absorbing(f64::max(k, 1e-25), saturation));
    let mut rows: Vec<(String, Vec<Answer>)> = vec![];
    for case in &cases {
        let mut answers = engines(case, rays);
        for (i, answer) in answers.iter_mut().enumerate() {
            let Some((_, previous)) = rows.last() else {
                break;
            };
            let rises = |a: &Spectrum, b: &Spectrum, value: fn(&Spectrum) -> Measured| {
                cases::z(value(b), value(a)) > judge::Z
            };
            let mut pairs = previous[i].spectra.iter().zip(&answer.spectra);
            let is_brighter = pairs.any(|(a, b)| {
                rises(a, b, |s| s.reflectance[0]) || rises(a, b, |s| s.transmittance[0])
            });
            if is_brighter {
                answer.verdict = judge::Verdict::Impossible;
                answer.why = "R or T rises with absorption".into();
            }
        }
        rows.push((case.name.clone(), answers));
    }
    (cases.into(), rows)
}

/// `x`, the difference of two values, and the standard error of the difference.
fn point(x: f64, a: Measured, b: Measured) -> [f64; 3] {
    [x, a.value - b.value, a.se.hypot(b.se)]
}

fn against_absorption(cases: &[Case], rows: &[(String, Vec<Answer>)]) -> Vec<Curve> {
    let half = cases.len() / 2;
    let mut curves = vec![];
    for (first, wetness) in [(0, "dry"), (half, "half full of water")] {
        for (h, depth) in [(1, "4.2"), (2, "6"), (3, "12")] {
            let points = (first + 2..first + half).filter_map(|i| {
                let k: f64 = cases[i].snowpack.surface.sizes_m()[1] / 750e-6 * 1.32e-5;
                let per_distance = 4.0 * std::f64::consts::PI * 1.32e-5 / 1300e-9
                    * cases[i].snowpack.surface.mean_free_distance_m();
                let spectrum = |engine| {
                    rows[i]
                        .1
                        .iter()
                        .find(|a| a.engine == engine)?
                        .spectra
                        .get(h)
                };
                let (a, b): (&Spectrum, &Spectrum) =
                    (spectrum(Engine::Hybrid)?, spectrum(Engine::Spectral)?);
                (k > 1e-8).then(|| point(per_distance, a.transmittance[0], b.transmittance[0]))
            });
            curves.push(Curve {
                name: format!("{wetness}, {depth} mean free distances"),
                points: points.collect(),
            });
        }
    }
    curves
}

fn against_thickness(rays: u64) -> Vec<Curve> {
    let depths = [
        1.0, 2.0, 3.0, 3.9, 4.1, 4.5, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 30.0, 50.0,
    ];
    let case = Case::new("thickness", ordinary(), 0.0, &depths, &[550.0, 1300.0]);
    let run = |engine| {
        case.run(engine, rays, Resolution::default(), &Cache::default(), 3)
            .unwrap()
    };
    let (spectral, hybrid) = (run(Engine::Spectral), run(Engine::Hybrid));
    let mut curves = vec![];
    for (l, nm) in case.wavelengths_nm.iter().enumerate() {
        for (letter, value) in [
            (
                "R",
                (|s: &Spectrum, l| s.reflectance[l]) as fn(&Spectrum, usize) -> Measured,
            ),
            ("T", |s, l| s.transmittance[l]),
        ] {
            let points = depths.iter().zip(hybrid.iter().zip(&spectral));
            curves.push(Curve {
                name: format!("{letter} at {nm} nm"),
                points: points
                    .map(|(x, (a, b))| point(*x, value(a, l), value(b, l)))
                    .collect(),
            });
        }
    }
    curves
}

/// Errors against the size of tables, the number of rays and the number of streams: the
/// root mean square and the mean difference of R from `spectral`, over eight seeds, at
/// 550 and 1030 nm and a thickness of ten mean free distances.
fn resolution(rays: u64) -> Result<String> {
    const SEEDS: u64 = 8;
    let case = Case::new("resolution", ordinary(), 0.0, &[10.0], &[550.0, 1030.0]);
    let best = case.run(
        Engine::Spectral,
        20 * rays,
        Resolution::default(),
        &Cache::default(),
        1,
    )?;
    let usual = Resolution {
        grains: 1 << 18,
        ..Resolution::default()
    };
    let mut trials = vec![];
    for table in [1, 10, 30, 100, 300, 1000, 4096, 1 << 14, 1 << 16] {
        for engine in [Engine::Tabulated, Engine::Hybrid] {
            trials.push((engine, rays, Resolution { table, ..usual }));
        }
    }
    for rays in [1, 8, 64, 256, 1024, 4096] {
        trials.push((Engine::Hybrid, rays, usual));
    }
    for streams in [1, 2, 3, 4, 6, 8, 16, 31, 32, 64] {
        trials.push((Engine::Hybrid, rays, Resolution { streams, ..usual }));
    }
    let mut out = String::from(
        "| engine | rays | table | streams | R off, rms | mean | stated se | |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (engine, rays, resolution) in trials {
        let (mut squares, mut sum, mut se, mut problem) = (0.0, 0.0, 0.0, None);
        for seed in 10..10 + SEEDS {
            match case.run(engine, rays, resolution, &Cache::default(), seed) {
                Err(error) => problem = Some(error.to_string()),
                Ok(spectra) => {
                    problem = problem.or(impossible(&spectra, true));
                    for l in 0..2 {
                        let d = spectra[0].reflectance[l].value - best[0].reflectance[l].value;
                        squares += d * d / (2 * SEEDS) as f64;
                        sum += d / (2 * SEEDS) as f64;
                        se += spectra[0].reflectance[l].se / (2 * SEEDS) as f64;
                    }
                }
            }
        }
        let Resolution { table, streams, .. } = resolution;
        let problem = problem.unwrap_or_default();
        writeln!(
            out,
            "| {} | {rays} | {table} | {streams} | {:.4} | {sum:+.4} | {se:.4} | {problem} |",
            engine.name(),
            f64::sqrt(squares)
        )?;
    }
    let rays = 10 * rays;
    let large = large_table(&case, rays);
    let difference = large - best[0].reflectance[0].value;
    let se = (large * (1.0 - large) / rays as f64).sqrt();
    writeln!(
        out,
        "| walks from one table | {rays} | 10000000 | | {:.4} | {difference:+.4} | {se:.4} | |",
        difference.abs()
    )?;
    writeln!(
        out,
        "\nStandard error of `spectral` here: {:.5}.",
        best[0].reflectance[0].se
    )?;
    Ok(out)
}

/// R of the case at its first wavelength, from a table of ten million grain events. The
/// table contains all events drawn; an engine would choose them from eight times as many,
/// which takes 4 GB.
fn large_table(case: &Case, rays: u64) -> f64 {
    struct Reflected(u64);
    impl Sink for Reflected {
        fn end(&mut self, _: Range<usize>, end: End, _: &splitsnow::transport::Path, _: Vec3) {
            self.0 += u64::from(end == End::Reflected);
        }
    }
    let stream = |batch| {
        Stream::new(Key {
            seed: 5,
            cell: 0,
            purpose: [0; 3],
            batch,
        })
    };
    const ENTRIES: usize = 10_000_000;
    let nm = case.wavelengths_nm[0];
    let (ice, air) = (case.model.ice.at(nm).unwrap(), Index { n: 1.0, k: 0.0 });
    let [surface, _] = Surface::in_air_and_water(ice, air, false);
    let outcomes = draw(
        &case.snowpack.surface.grains[0].grain,
        (case.model.entry, case.model.facets),
        surface,
        ENTRIES,
        stream(0),
    );
    let table = PackedTable::new(&outcomes, ENTRIES, &mut stream(1));
    let walker = TableWalker {
        snowpack: TableSnowpack::plain(&case.snowpack.surface, [&table; 2]),
        absorption: Absorption {
            coefficients: Coefficients {
                ice_per_m: ice.absorption_per_m(nm),
                water_per_m: 0.0,
                ..Coefficients::default()
            },
            deferred: 0.0,
        },
    };
    let mut reflected = Reflected(0);
    let slabs = &case.thicknesses_m;
    walker
        .walk(slabs, case.light, rays, stream(2), &mut reflected)
        .unwrap();
    reflected.0 as f64 / rays as f64
}
