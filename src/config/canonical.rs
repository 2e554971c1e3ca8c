//! Writes a config back as TOML with every value explicit: equal configs give
//! equal bytes, whatever their comments, order, units of water or defaults.
use std::fmt::Write;
use std::path::Path;

use crate::grain::TruncatedNormal;
use crate::optics::WaterTable;
use crate::transport::Model;

use super::keys::ENTRIES;

/// Collects `key = value` lines under table headers.
pub(super) struct Writer {
    text: String,
}

impl Writer {
    pub(super) fn new() -> Self {
        Self {
            text: "version = 1\n".to_owned(),
        }
    }

    /// A header such as `[axes]`.
    pub(super) fn header(&mut self, header: &str) {
        let _ = writeln!(self.text, "\n{header}");
    }

    pub(super) fn raw(&mut self, key: &str, value: &str) {
        let _ = writeln!(self.text, "{key} = {value}");
    }

    pub(super) fn number(&mut self, key: &str, value: f64) {
        self.raw(key, &float(value));
    }

    pub(super) fn numbers(&mut self, key: &str, values: &[f64]) {
        let values: Vec<_> = values.iter().map(|&v| float(v)).collect();
        self.raw(key, &format!("[{}]", values.join(", ")));
    }

    pub(super) fn law(&mut self, key: &str, law: &TruncatedNormal) {
        let [min, max, mean, sd] = [law.min(), law.max(), law.mean(), law.sd()].map(float);
        let value = format!("{{ min = {min}, max = {max}, mean = {mean}, sd = {sd} }}");
        self.raw(key, &value);
    }

    /// The table `[model]`; a CSV path is written relative to `directory`.
    pub(super) fn model(&mut self, model: &Model, directory: &Path) {
        let entry = ENTRIES.iter().find(|(_, entry)| *entry == model.entry);
        let water = match &model.water {
            WaterTable::Csv(path) => path
                .strip_prefix(directory)
                .unwrap_or(path)
                .display()
                .to_string(),
            table => table.name(),
        };
        self.header("[model]");
        self.text("entry", entry.map_or("", |(name, _)| name));
        self.text("layers", "continuous");
        self.text("carbon_law", "power");
        self.text("impurity_mass", "varsa2025");
        self.text("ice", model.ice.name());
        self.text("water", &water);
    }

    pub(super) fn text(&mut self, key: &str, value: &str) {
        self.raw(key, &toml::Value::from(value).to_string());
    }

    pub(super) fn finish(self) -> String {
        self.text
    }
}

/// The shortest decimal that reads back as the same double; -0 is written 0.
pub(super) fn float(value: f64) -> String {
    format!("{:?}", value + 0.0)
}
