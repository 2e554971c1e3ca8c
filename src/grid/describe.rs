//! The canonical description of a grid: key by key, and as the text of a grid file. It
//! does not depend on the comments, order and formatting of the user's file, nor on the
//! bounds of the compression, which do not affect the spectra.
use std::fmt::Write;

use super::Grid;
use crate::engine::{Engine, MaxError};
use crate::grain::{SizeLaw, TruncatedNormal};
use crate::optics::{Carbon, WaterTable};
use crate::parameter::Parameter;
use crate::transport::{Component, Layer, Substrate};
use crate::units::{m_to_cm, m_to_um};

impl Grid {
    /// Section, key and TOML value of every setting that affects the spectra.
    #[must_use]
    pub fn describe(&self) -> Vec<(&'static str, &'static str, String)> {
        let axes = &self.axes;
        // the measure by which sizes are given determines the sizes
        let as_given = |parameter: Parameter| match &self.given_sizes {
            Some(given) if parameter == Parameter::GrainSize => {
                (given.measure.name(), given.values.as_slice())
            }
            _ => (parameter.key(), axes.values(parameter)),
        };
        // the axes that every database has come first
        let parameters = axes.iter().map(|(parameter, _)| parameter);
        let (optional, core): (Vec<_>, Vec<_>) = parameters.partition(|p| p.is_optional());
        let mut entries: Vec<_> = core
            .into_iter()
            .chain(optional)
            .map(as_given)
            .map(|(name, values)| ("axes", name, list(values)))
            .collect();
        let spread = &self.spread;
        let fixed = &self.fixed;
        let model = &fixed.model;
        let mut add = |section, key, value| entries.push((section, key, value));
        if fixed.diffuse {
            add("axes", "diffuse", "true".to_owned());
        }
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
        if axes.has(Parameter::Sphericity) {
            let half_width = number(spread.sphericity_half_width);
            add("spread", "sphericity_half_width", half_width);
            add("spread", "sphericity_sd", number(spread.sphericity_sd));
        }
        add("wavelengths", "values_nm", list(&self.wavelengths_nm));
        // a parameter that is an axis is not fixed
        for (parameter, value) in [
            (Parameter::Sphericity, normal(&fixed.sphericity)),
            (Parameter::Temperature, number(fixed.temperature_c)),
            (Parameter::WaterSaturation, number(fixed.water_saturation)),
        ] {
            if !axes.has(parameter) {
                add("fixed", parameter.key(), value);
            }
        }
        for (key, carbon) in [
            ("black_carbon", &fixed.black_carbon),
            ("brown_carbon", &fixed.brown_carbon),
        ] {
            if let Some(carbon) = carbon {
                let axis = key == "black_carbon" && axes.has(Parameter::BlackCarbon);
                // the concentration is the first line; an axis replaces it
                let lines = &carbon_lines(carbon)[usize::from(axis)..];
                add("fixed", key, inline(lines));
            }
        }
        if !fixed.below.is_empty() {
            // config files list layers from the base up
            let layers: Vec<_> = fixed.below.iter().rev().map(layer).collect();
            add("fixed", "below", format!("[{}]", layers.join(", ")));
        }
        let substrate = reflectance(&fixed.substrate);
        let is_fixed = !axes.has(Parameter::SubstrateReflectance);
        if let Some(reflectance) = substrate.filter(|_| is_fixed) {
            add(
                "fixed",
                "substrate",
                inline(&[format!("reflectance = {reflectance}")]),
            );
        }
        add("run", "engine", quoted(self.run.engine.name()));
        add("run", "seed", self.run.seed.to_string());
        add("run", "rays", self.run.rays.to_string());
        if self.run.engine == Engine::Auto {
            let MaxError { delta_e, rmse } = self.run.max_error;
            let error = format!("{{ delta_e = {delta_e:?}, rmse = {rmse:?} }}");
            add("run", "max_error", error);
        }
        add("model", "entry", quoted(model.entry.name()));
        // the default is left out, as in databases from before this key existed
        if spread.size_law != SizeLaw::default() {
            add("model", "size_law", quoted(spread.size_law.name()));
        }
        if !fixed.below.is_empty() {
            add("model", "layers", quoted(model.joining.name()));
        }
        if fixed.carbon().next().is_some() || axes.has(Parameter::BlackCarbon) {
            add("model", "carbon_law", quoted(model.carbon_law.name()));
            add("model", "impurity_mass", quoted(model.impurity_mass.name()));
        }
        add("model", "ice", quoted(model.ice.name()));
        add("model", "water", quoted(&water_name(&model.water)));
        entries
    }

    /// The text of a grid file that builds this database, with every value explicit.
    /// [`crate::config::grid::parse`] gives this grid again, except that the bounds of the
    /// compression, and settings without effect in this grid, have their defaults. A user's
    /// tables are named without their directory: they are searched for in the directory of
    /// the file.
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

/// The shortest decimal that reads back as the same number; -0 becomes 0.
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

fn inline(lines: &[String]) -> String {
    format!("{{ {} }}", lines.join(", "))
}

/// A layer as an inline table.
fn layer(layer: &Layer) -> String {
    let snow = &layer.snow;
    let grain = |Component { fraction, grain }: &Component| {
        let size = [grain.size.min_m(), grain.size.max_m()].map(|m| number(m_to_um(m)));
        inline(&[
            format!("fraction = {}", number(*fraction)),
            format!("size_um = {{ min = {}, max = {} }}", size[0], size[1]),
            format!("facetness = {}", normal(&grain.facetness)),
            format!("sphericity = {}", normal(&grain.sphericity)),
        ])
    };
    let grains: Vec<_> = snow.grains.iter().map(grain).collect();
    let mut lines = vec![
        format!("thickness_cm = {}", number(m_to_cm(layer.thickness_m))),
        format!("density_kg_m3 = {}", number(snow.density_kg_m3)),
        format!("temperature_c = {}", number(snow.temperature_c)),
        format!("water_saturation = {}", number(snow.water_saturation)),
        format!("grain = [{}]", grains.join(", ")),
    ];
    for (name, carbon) in [
        ("black_carbon", &snow.black_carbon),
        ("brown_carbon", &snow.brown_carbon),
    ] {
        lines.extend(carbon.map(|carbon| format!("{name} = {}", inline(&carbon_lines(&carbon)))));
    }
    inline(&lines)
}

/// The lines `key = value` of a table of carbon.
pub(crate) fn carbon_lines(carbon: &Carbon) -> Vec<String> {
    let per = if carbon.per_wet_mass {
        "wet_mass"
    } else {
        "dry_mass"
    };
    vec![
        format!("concentration_ng_g = {}", number(carbon.concentration_ng_g)),
        format!("sedimentation = {}", number(carbon.sedimentation)),
        format!(
            "mass_absorption_efficiency_m2_g = {}",
            number(carbon.mass_absorption_efficiency_m2_g)
        ),
        format!(
            "reference_wavelength_nm = {}",
            number(carbon.reference_wavelength_nm)
        ),
        format!("angstrom_exponent = {}", number(carbon.angstrom_exponent)),
        format!("concentration_per = {}", quoted(per)),
    ]
}

/// The value of the key `reflectance` of a substrate; a spectrum is a list with one value
/// per wavelength. `None` for a black substrate.
pub(crate) fn reflectance(substrate: &Substrate) -> Option<String> {
    match substrate {
        Substrate::Black => None,
        Substrate::Grey(reflectance) => Some(number(*reflectance)),
        Substrate::Spectrum { table } => Some(list(table.column(0))),
    }
}

/// A TOML basic string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

/// The name of a table of water. Of a user's table it is the file name alone, so that the
/// same table gives the same database from any directory; its contents are compared by
/// hash.
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
