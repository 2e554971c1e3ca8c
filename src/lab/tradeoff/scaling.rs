//! How the cost of a run scales with the size of the request.
use super::ladder::typical;
use super::measure::{Bench, Tables, failed, request};
use super::{NamedSample, Setting, TradeoffError};
use crate::accuracy::mean;
use crate::engine::Engine;
use crate::transport::Illumination;

/// Share of the budget that may be spent when the costs have been measured.
const SHARE: f64 = 1.0;
/// Number of runs that are averaged, with seeds 1, 2, ...
const RUNS: u64 = 3;
/// Thickness of the slab unless it is varied, and the largest of several thicknesses, m.
const THICKNESS_M: f64 = 0.12;

/// The part of a request that is increased.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScalingVariable {
    /// Thickness of one slab, cm.
    Thickness,
    /// Wavelengths, between 400 and 700 nm.
    Wavelengths,
    /// Number of thicknesses in one request, up to 12 cm.
    Thicknesses,
    /// Number of incidence angles, from 0 to 80 degrees, as separate illuminations.
    Angles,
}

impl ScalingVariable {
    /// All variants.
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

    /// The values at which the cost is measured, increasing.
    fn values(self) -> &'static [f64] {
        match self {
            Self::Thickness => &[1.0, 2.0, 5.0, 10.0, 20.0, 50.0],
            Self::Wavelengths => &[1.0, 3.0, 10.0, 31.0, 101.0, 301.0],
            Self::Thicknesses | Self::Angles => &[1.0, 2.0, 4.0, 8.0, 16.0],
        }
    }
}

/// The cost of one engine at one value.
#[derive(Debug, Clone, PartialEq)]
pub struct Cost {
    /// The part that is varied.
    pub variable: ScalingVariable,
    /// Its value.
    pub value: f64,
    /// The setting, the same for all costs of an engine.
    pub setting: Setting,
    /// CPU seconds, mean over a few runs.
    pub cpu_seconds: f64,
}

/// The costs of `engines` for the snow of `sample`. Each series ends where its share of the
/// budget ends. Parts that are not varied have 12 cm, 31 wavelengths in 400-700 nm and the
/// illumination of the sample. Settings that an engine refuses have no cost.
pub(super) fn costs(
    bench: &Bench,
    sample: &NamedSample,
    engines: &[Engine],
    say: &dyn Fn(&str),
) -> Result<Vec<Cost>, TradeoffError> {
    let mut costs = Vec::new();
    let mut series = engines.len() * ScalingVariable::ALL.len();
    for setting in engines.iter().filter_map(|engine| typical(*engine)) {
        for variable in ScalingVariable::ALL {
            say(&format!("cost of {setting} against {}", variable.name()));
            let mut allowance = bench.left_of(SHARE) / series as f64;
            series -= 1;
            let mut last: Option<(f64, f64)> = None;
            for &value in variable.values() {
                let expected = last.map_or(0.0, |(cost, previous)| cost * value / previous);
                if expected > allowance {
                    break;
                }
                let Some(cpu_seconds) = cost(bench, sample, &setting, variable, value)? else {
                    continue;
                };
                let spent = RUNS as f64 * cpu_seconds;
                allowance -= spent;
                last = Some((spent, value));
                costs.push(Cost {
                    variable,
                    value,
                    setting,
                    cpu_seconds,
                });
            }
        }
    }
    Ok(costs)
}

/// The cost at one value; `None` if the engine refuses the request.
fn cost(
    bench: &Bench,
    sample: &NamedSample,
    setting: &Setting,
    variable: ScalingVariable,
    value: f64,
) -> Result<Option<f64>, TradeoffError> {
    let count = |varied: ScalingVariable, default: u32| {
        if variable == varied {
            value as u32
        } else {
            default
        }
    };
    let thickness_m = if variable == ScalingVariable::Thickness {
        value / 100.0
    } else {
        THICKNESS_M
    };
    let n = count(ScalingVariable::Thicknesses, 1);
    let thicknesses_m: Vec<f64> = (1..=n)
        .map(|i| thickness_m * f64::from(i) / f64::from(n))
        .collect();
    // A single wavelength is in the middle of the band.
    let nm = match count(ScalingVariable::Wavelengths, 31) {
        1 => vec![550.0],
        n => (0..n)
            .map(|i| 400.0 + 300.0 * f64::from(i) / f64::from(n - 1))
            .collect(),
    };
    let angles = count(ScalingVariable::Angles, 1);
    let light = |i: u32| match variable {
        ScalingVariable::Angles => Illumination::Collimated {
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
