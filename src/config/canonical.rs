//! Writes a sample as canonical TOML in which every value is explicit. Equal samples
//! give equal bytes, whatever the comments, the order of keys, the way water is given
//! and the defaults used in the file.
use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use crate::grain::{SizeLaw, TruncatedNormal};
use crate::grid::{
    AbsorberSettings, CarbonSettings, LawSettings, Reflectance, SizeSettings, toml_entries,
    toml_text,
};
use crate::optics::WaterTable;
use crate::transport::{Layer, Model, Substrate};
use crate::units::HALF_SPACE_CM;

use super::keys::LayerKeys;
use super::layer::sizes_um;

/// Collects `key = value` lines under table headers.
pub(super) struct TomlWriter {
    text: String,
}

impl TomlWriter {
    pub(super) fn new() -> Self {
        Self {
            text: "version = 1\n".to_owned(),
        }
    }

    /// Writes a table header such as `[axes]`.
    pub(super) fn header(&mut self, header: &str) {
        let _ = writeln!(self.text, "\n{header}");
    }

    pub(super) fn raw(&mut self, key: &str, value: &str) {
        let _ = writeln!(self.text, "{key} = {value}");
    }

    fn value<T: Serialize + ?Sized>(&mut self, key: &str, value: &T) {
        self.raw(key, &toml_text(value));
    }

    pub(super) fn number(&mut self, key: &str, value: f64) {
        self.value(key, &value);
    }

    pub(super) fn numbers(&mut self, key: &str, values: &[f64]) {
        self.value(key, values);
    }

    pub(super) fn law(&mut self, key: &str, law: &TruncatedNormal) {
        self.value(key, &LawSettings::from(law));
    }

    /// Writes the table `[model]`; a CSV path is written relative to `directory`.
    pub(super) fn model(&mut self, model: &Model, size_law: SizeLaw, directory: &Path) {
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
        self.text("facets", model.facets.name());
        self.text("size_law", size_law.name());
        self.text("layers", model.joining.name());
        self.text("carbon_law", model.carbon_law.name());
        self.text("impurity_mass", model.impurity_mass.name());
        self.text("ice", model.ice.name());
        self.text("water", &water);
    }

    /// Writes a table `[[layer]]`; lengths are taken from `keys`, in the units of the file.
    pub(super) fn layer(&mut self, layer: &Layer, keys: &LayerKeys) {
        let snow = &layer.snow;
        self.header("[[layer]]");
        match keys.thickness_cm < HALF_SPACE_CM {
            true => self.number("thickness_cm", keys.thickness_cm),
            false => self.raw("thickness_cm", "inf"),
        }
        self.number("density_kg_m3", snow.density_kg_m3);
        self.number("temperature_c", snow.temperature_c);
        self.number("water_saturation", snow.water_saturation);
        for (component, keys) in snow.grains.iter().zip(&keys.grain) {
            let grain = &component.grain;
            self.header("[[layer.grain]]");
            self.number("fraction", component.fraction);
            let law = grain.size.law();
            let shape = (grain.shape, grain.proportion);
            let sizes = sizes_um(keys, law, shape, snow.temperature_c);
            let [min, max] = sizes;
            self.value("size_um", &SizeSettings { min, max });
            self.law("facetness", &grain.facetness);
            self.text("shape", grain.shape.name());
            let proportion = match grain.shape.has_aspect_ratio() {
                true => "aspect_ratio",
                false => "sphericity",
            };
            self.law(proportion, &grain.proportion);
        }
        for (name, carbon) in [
            ("black_carbon", &snow.black_carbon),
            ("brown_carbon", &snow.brown_carbon),
        ] {
            if let Some(carbon) = carbon {
                self.header(&format!("[layer.{name}]"));
                for (key, value) in toml_entries(&CarbonSettings::from(carbon)) {
                    self.raw(&key, &value);
                }
            }
        }
        for absorber in &snow.absorbers {
            self.header("[[layer.absorber]]");
            for (key, value) in toml_entries(&AbsorberSettings::from(absorber)) {
                self.raw(&key, &value);
            }
        }
    }

    /// Writes the table `[substrate]`; nothing for a black substrate.
    pub(super) fn substrate(&mut self, substrate: &Substrate) {
        let Some(reflectance) = Reflectance::of(substrate) else {
            return;
        };
        self.header("[substrate]");
        self.value("reflectance", &reflectance);
    }

    pub(super) fn text(&mut self, key: &str, value: &str) {
        self.value(key, value);
    }

    pub(super) fn finish(self) -> String {
        self.text
    }
}
