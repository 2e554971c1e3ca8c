//! Writes a sample back as TOML with every value explicit: equal samples give
//! equal bytes, whatever their comments, order, units of water or defaults.
use std::fmt::Write;
use std::path::Path;

use crate::grain::TruncatedNormal;
use crate::grid::{list, normal, number};
use crate::optics::WaterTable;
use crate::transport::Model;

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
        self.raw(key, &number(value));
    }

    pub(super) fn numbers(&mut self, key: &str, values: &[f64]) {
        self.raw(key, &list(values));
    }

    pub(super) fn law(&mut self, key: &str, law: &TruncatedNormal) {
        self.raw(key, &normal(law));
    }

    /// The table `[model]`; a CSV path is written relative to `directory`.
    pub(super) fn model(&mut self, model: &Model, directory: &Path) {
        let water = match &model.water {
            WaterTable::Csv(path) => path
                .strip_prefix(directory)
                .unwrap_or(path)
                .display()
                .to_string(),
            table => table.name(),
        };
        self.header("[model]");
        self.text("entry", model.entry.name());
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
