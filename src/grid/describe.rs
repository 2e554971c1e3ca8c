//! A grid in its one canonical spelling: what a database is made of, key by
//! key, and as the text of a grid file. Comments, order and formatting of the
//! user's own file leave no trace here, nor do the bounds of the compression,
//! which change no spectrum.
use std::fmt::Write;

use super::Grid;
use crate::engine::{Engine, MaxError};
use crate::grain::TruncatedNormal;
use crate::optics::WaterTable;

impl Grid {
    /// Section, key and TOML value of everything that decides the spectra.
    #[must_use]
    pub fn describe(&self) -> Vec<(&'static str, &'static str, String)> {
        let mut entries: Vec<_> = self
            .axes
            .named()
            .into_iter()
            .map(|(name, values)| ("axes", name, list(values)))
            .collect();
        let spread = &self.spread;
        let fixed = &self.fixed;
        let model = &fixed.model;
        let mut add = |section, key, value| entries.push((section, key, value));
        add(
            "spread",
            "facetness_half_width",
            number(spread.facetness_half_width),
        );
        add("spread", "facetness_sd", number(spread.facetness_sd));
        add(
            "spread",
            "grain_size_half_width_um",
            number(spread.grain_size_half_width_um),
        );
        add("wavelengths", "values_nm", list(&self.wavelengths_nm));
        add("fixed", "sphericity", normal(&fixed.sphericity));
        add("fixed", "temperature_c", number(fixed.temperature_c));
        add("fixed", "water_saturation", number(fixed.water_saturation));
        add("run", "engine", quoted(self.run.engine.name()));
        add("run", "seed", self.run.seed.to_string());
        add("run", "rays", self.run.rays.to_string());
        if self.run.engine == Engine::Auto {
            let MaxError { delta_e, rmse } = self.run.max_error;
            let error = format!("{{ delta_e = {delta_e:?}, rmse = {rmse:?} }}");
            add("run", "max_error", error);
        }
        add("model", "entry", quoted(model.entry.name()));
        add("model", "ice", quoted(model.ice.name()));
        add("model", "water", quoted(&water_name(&model.water)));
        entries
    }

    /// The text of a grid file that builds this database, every value explicit:
    /// [`crate::config::grid::parse`] gives this grid again, with the default
    /// bounds of the compression. A user's water table is named without its
    /// folder: it is looked for beside the text.
    #[must_use]
    pub fn to_config(&self) -> String {
        let mut text = String::from("version = 1\n");
        let mut current = "";
        for (section, key, value) in self.describe() {
            if section != current {
                let _ = writeln!(text, "\n[{section}]");
                current = section;
            }
            let _ = writeln!(text, "{key} = {value}");
        }
        text
    }
}

/// The shortest decimal that reads back as the same number; -0 is 0.
pub(crate) fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

pub(crate) fn list(values: &[f64]) -> String {
    let values: Vec<_> = values.iter().copied().map(number).collect();
    format!("[{}]", values.join(", "))
}

pub(crate) fn normal(law: &TruncatedNormal) -> String {
    let [min, max, mean, sd] = [law.min(), law.max(), law.mean(), law.sd()].map(number);
    format!("{{ min = {min}, max = {max}, mean = {mean}, sd = {sd} }}")
}

/// A TOML basic string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

/// A user's table by its file name alone: the same table gives the same
/// database from any folder. Its contents are compared by hash.
fn water_name(table: &WaterTable) -> String {
    match table {
        WaterTable::Csv(path) => path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        table => table.name(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use crate::engine::Engine;
    use crate::grid::tests::small;

    #[test]
    fn the_canonical_text_is_a_grid_file() {
        let text = small(Engine::Spectral).to_config();
        let parsed: toml::Table = text.parse().unwrap();
        assert_eq!(parsed["version"].as_integer(), Some(1));
        assert_eq!(parsed["run"]["engine"].as_str(), Some("spectral"));
        assert_eq!(parsed["axes"]["facetness"][1].as_float(), Some(0.5));
        assert_eq!(parsed["fixed"]["sphericity"]["sd"].as_float(), Some(0.064));
        assert!(!parsed.contains_key("compression"));
    }

    #[test]
    fn compression_leaves_no_trace() {
        let mut grid = small(Engine::Spectral);
        let before = grid.describe();
        grid.compression.max_delta_e = 1.0;
        assert_eq!(grid.describe(), before);
    }
}
