//! The settings at which an engine runs, cheapest first.
use std::fmt;
use std::ops::RangeInclusive;

use crate::engine::{Engine, Resolution};

/// An engine with the settings that trade speed against accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// The engine.
    pub engine: Engine,
    /// Number of rays, as defined by [`crate::engine::Request::rays`].
    pub rays: u64,
    /// Table sizes and number of streams; ignored by engines that have none.
    pub resolution: Resolution,
}

impl Setting {
    /// The number of rays, and the resolution where it differs from the default.
    #[must_use]
    pub fn accuracy(&self) -> String {
        let mut text = self.rays.to_string();
        let (resolution, default) = (self.resolution, Resolution::default());
        if resolution.table != default.table {
            text += &format!(", table {}", resolution.table);
        }
        if resolution.streams != default.streams {
            text += &format!(", {} streams", resolution.streams);
        }
        text
    }
}

impl fmt::Display for Setting {
    /// Writes the engine and its [`accuracy`](Setting::accuracy).
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {}", self.engine.name(), self.accuracy())
    }
}

/// The settings of `engine` on the chart, cheapest first; empty for `auto`.
#[must_use]
pub fn ladder(engine: Engine) -> Vec<Setting> {
    let default = [Resolution::default()];
    match engine {
        Engine::Reference => over(engine, 2..=6, &default),
        Engine::Spectral => over(engine, 3..=10, &default),
        Engine::Tabulated => over(engine, 3..=10, &[coarse(8), default[0]]),
        Engine::Hybrid => over(engine, 4..=9, &[coarse(4), coarse(8), default[0]]),
        Engine::Auto => Vec::new(),
    }
}

/// A resolution with small tables.
fn coarse(streams: usize) -> Resolution {
    Resolution {
        table: 1 << 13,
        grains: 1 << 16,
        streams,
    }
}

/// A setting of `engine` a third up its ladder, for measurements that do not depend on accuracy.
#[must_use]
pub(super) fn typical(engine: Engine) -> Option<Setting> {
    let ladder = ladder(engine);
    ladder.get(ladder.len().saturating_sub(1) / 3).copied()
}

/// The settings with 4^exponent rays for every exponent and resolution.
fn over(
    engine: Engine,
    exponents: RangeInclusive<u32>,
    resolutions: &[Resolution],
) -> Vec<Setting> {
    let setting = |exponent: u32, &resolution: &Resolution| Setting {
        engine,
        rays: 4_u64.pow(exponent),
        resolution,
    };
    exponents
        .flat_map(|exponent| {
            resolutions
                .iter()
                .map(move |resolution| setting(exponent, resolution))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_engine_has_a_ladder_without_repetitions() {
        for engine in Engine::ALL.into_iter().filter(|e| *e != Engine::Auto) {
            let ladder = ladder(engine);
            assert!(ladder.len() >= 3, "{}", engine.name());
            for (i, setting) in ladder.iter().enumerate() {
                assert_eq!(setting.engine, engine);
                assert!(!ladder[..i].contains(setting), "{setting}");
            }
            assert!(ladder.is_sorted_by_key(|setting| setting.rays));
            assert!(typical(engine).is_some_and(|typical| ladder.contains(&typical)));
        }
    }

    #[test]
    fn names_state_what_differs_from_the_default() {
        let mut setting = Setting {
            engine: Engine::Spectral,
            rays: 64,
            resolution: Resolution::default(),
        };
        assert_eq!(setting.to_string(), "spectral 64");
        setting.resolution.streams += 1;
        setting.resolution.table += 1;
        let Resolution { table, streams, .. } = setting.resolution;
        assert_eq!(
            setting.to_string(),
            format!("spectral 64, table {table}, {streams} streams")
        );
    }
}
