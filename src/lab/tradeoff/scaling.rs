//! What the cost of a run grows with.
use super::ladder::typical;
use super::measure::{Bench, Tables, failed, mean, request};
use super::{Sample, Setting, TradeoffError};
use crate::engine::Engine;
use crate::transport::Illumination;

/// Share of the budget until which costs are measured.
const SHARE: f64 = 1.0;
/// Runs whose mean is taken, with seeds 1, 2, ...
const RUNS: u64 = 3;
/// Thickness where it is not the question, and the largest of several, m.
const THICKNESS_M: f64 = 0.12;

/// What is made more of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Growth {
    /// Thickness of one slab, cm.
    Thickness,
    /// Wavelengths, between 400 and 700 nm.
    Wavelengths,
    /// Thicknesses asked for at once, up to 12 cm.
    Thicknesses,
    /// Polar angles, 0 to 80 degrees: as many requests.
    Angles,
}

impl Growth {
    /// All.
    pub const ALL: [Self; 4] = [
        Self::Thickness,
        Self::Wavelengths,
        Self::Thicknesses,
        Self::Angles,
    ];

    /// The name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Thickness => "thickness_cm",
            Self::Wavelengths => "wavelengths",
            Self::Thicknesses => "thicknesses",
            Self::Angles => "angles",
        }
    }

    /// Where it is measured, increasing.
    fn values(self) -> &'static [f64] {
        match self {
            Self::Thickness => &[1.0, 2.0, 5.0, 10.0, 20.0, 50.0],
            Self::Wavelengths => &[1.0, 3.0, 10.0, 31.0, 101.0, 301.0],
            Self::Thicknesses | Self::Angles => &[1.0, 2.0, 4.0, 8.0, 16.0],
        }
    }
}

/// The cost of one engine at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// What is varied.
    pub growth: Growth,
    /// Its value.
    pub value: f64,
    /// The setting, the same for all costs of an engine.
    pub setting: Setting,
    /// CPU seconds, the mean of a few runs.
    pub cpu_seconds: f64,
}

/// Costs of `engines` with the grains of `sample`, each up to where its part of
/// the budget ends. Where not varied: 12 cm, 31 wavelengths of 400-700 nm, the
/// light of the sample. Settings that an engine refuses have no cost.
pub(super) fn costs(
    bench: &Bench,
    sample: &Sample,
    engines: &[Engine],
    say: &dyn Fn(&str),
) -> Result<Vec<Cost>, TradeoffError> {
    let mut costs = Vec::new();
    let mut series = engines.len() * Growth::ALL.len();
    for setting in engines.iter().filter_map(|engine| typical(*engine)) {
        for growth in Growth::ALL {
            say(&format!("cost of {setting} against {}", growth.name()));
            let mut allowance = bench.left_of(SHARE) / series as f64;
            series -= 1;
            let mut last: Option<(f64, f64)> = None;
            for &value in growth.values() {
                let expected = last.map_or(0.0, |(cost, at)| cost * value / at);
                if expected > allowance {
                    break;
                }
                let Some(cpu_seconds) = cost(bench, sample, &setting, growth, value)? else {
                    continue;
                };
                let spent = RUNS as f64 * cpu_seconds;
                allowance -= spent;
                last = Some((spent, value));
                costs.push(Cost {
                    growth,
                    value,
                    setting,
                    cpu_seconds,
                });
            }
        }
    }
    Ok(costs)
}

/// The cost at one point; `None` if the engine refuses.
fn cost(
    bench: &Bench,
    sample: &Sample,
    setting: &Setting,
    growth: Growth,
    value: f64,
) -> Result<Option<f64>, TradeoffError> {
    let count = |of: Growth, otherwise: u32| {
        if growth == of {
            value as u32
        } else {
            otherwise
        }
    };
    let thickness_m = if growth == Growth::Thickness {
        value / 100.0
    } else {
        THICKNESS_M
    };
    let n = count(Growth::Thicknesses, 1);
    let thicknesses_m: Vec<f64> = (1..=n)
        .map(|i| thickness_m * f64::from(i) / f64::from(n))
        .collect();
    // A single one is in the middle.
    let nm = match count(Growth::Wavelengths, 31) {
        1 => vec![550.0],
        n => (0..n)
            .map(|i| 400.0 + 300.0 * f64::from(i) / f64::from(n - 1))
            .collect(),
    };
    let angles = count(Growth::Angles, 1);
    let light = |i: u32| match growth {
        Growth::Angles => Illumination::Collimated {
            polar_angle_rad: (80.0 * f64::from(i) / f64::from(angles)).to_radians(),
        },
        _ => sample.file.illumination,
    };
    let lights: Vec<Illumination> = (0..angles).map(light).collect();
    let seeds: Vec<u64> = (1..=RUNS).collect();
    let runs = bench.map(&seeds, |&seed| {
        let mut request = request(setting, sample, &thicknesses_m, &nm, seed);
        request.illuminations = &lights;
        match bench.run(setting, &request, &Tables::default()) {
            Ok(run) => Ok(Some(run.cpu_seconds)),
            Err(error) => match failed(sample, setting, error) {
                TradeoffError::Engine { .. } => Ok(None),
                other => Err(other),
            },
        }
    })?;
    let seconds: Option<Vec<f64>> = runs.into_iter().collect();
    Ok(seconds.map(|seconds| mean(&seconds)))
}
