//! The settings an engine is tried at, cheapest first.
use std::fmt;
use std::ops::RangeInclusive;

use crate::engine::{Engine, Resolution};

/// An engine with all that trades its speed against its accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// The engine.
    pub engine: Engine,
    /// Its walks, as [`crate::engine::Request::rays`] counts them.
    pub rays: u64,
    /// Its tables and directions; nothing to engines without.
    pub resolution: Resolution,
}

impl Setting {
    /// Its rays, and what differs from the default resolution.
    #[must_use]
    pub fn accuracy(&self) -> String {
        let mut text = self.rays.to_string();
        let (here, default) = (self.resolution, Resolution::default());
        if here.table != default.table {
            text += &format!(", table {}", here.table);
        }
        if here.streams != default.streams {
            text += &format!(", {} streams", here.streams);
        }
        text
    }
}

impl fmt::Display for Setting {
    /// The engine and its [`accuracy`](Setting::accuracy).
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {}", self.engine.name(), self.accuracy())
    }
}

/// The settings of `engine` on the chart, cheapest first.
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

/// Small tables.
fn coarse(streams: usize) -> Resolution {
    Resolution {
        table: 1 << 13,
        grains: 1 << 16,
        streams,
    }
}

/// One setting of `engine` for what is not about accuracy: a third up its ladder.
#[must_use]
pub(super) fn typical(engine: Engine) -> Option<Setting> {
    let ladder = ladder(engine);
    ladder.get(ladder.len().saturating_sub(1) / 3).copied()
}

/// Every resolution with 4^exponent rays for each exponent.
fn over(
    engine: Engine,
    exponents: RangeInclusive<u32>,
    resolutions: &[Resolution],
) -> Vec<Setting> {
    let at = |exponent: u32, &resolution: &Resolution| Setting {
        engine,
        rays: 4_u64.pow(exponent),
        resolution,
    };
    exponents
        .flat_map(|exponent| resolutions.iter().map(move |of| at(exponent, of)))
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
    fn names_tell_what_is_not_the_default() {
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
