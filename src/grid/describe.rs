//! The settings of a grid, taken from the grid and written as the text of a grid file.
use super::Grid;
use super::settings::{
    AbsorberSettings, AxisSettings, BelowSettings, CarbonSettings, EfficiencySettings,
    ErrorSettings, FixedSettings, GrainSettings, GridSettings, LawSettings, ModelSettings,
    Properties, Reflectance, RunSettings, SizeSettings, SpreadSettings, SubstrateSettings,
    WavelengthSettings,
};
use crate::engine::Engine;
use crate::grain::{Facets, Shape, SizeLaw, TruncatedNormal};
use crate::optics::{Absorber, Carbon, MassAbsorption, WaterTable};
use crate::parameter::{Axes, Parameter};
use crate::transport::{Component, Layer, Substrate};
use crate::units::{m_to_cm, m_to_um};

impl Grid {
    /// The axes, with those of the views.
    fn all_axes(&self) -> Axes {
        let views = self.views.iter().flat_map(|views| views.axes.iter());
        let axes = self.axes.iter().chain(views);
        axes.map(|(parameter, values)| (parameter, values.to_vec()))
            .collect()
    }

    /// Every setting that affects the spectra.
    #[must_use]
    pub fn describe(&self) -> GridSettings {
        let axes = &self.all_axes();
        let spread = &self.spread;
        let sphericity_is_axis = axes.has(Parameter::Sphericity);
        GridSettings {
            axes: AxisSettings::new(axes, self.size_axis.as_ref(), self.fixed.diffuse),
            spread: SpreadSettings {
                facetness_half_width: spread.facetness_half_width,
                facetness_sd: spread.facetness_sd,
                grain_size_half_width_um: spread.grain_size_half_width_um,
                sphericity_half_width: sphericity_is_axis.then_some(spread.sphericity_half_width),
                sphericity_sd: sphericity_is_axis.then_some(spread.sphericity_sd),
            },
            wavelengths: WavelengthSettings {
                values_nm: self.wavelengths_nm.clone(),
            },
            fixed: FixedSettings::new(&self.properties(), axes),
            run: RunSettings {
                engine: self.run.engine,
                seed: self.run.seed,
                rays: self.run.rays,
                view_rays: self.views.as_ref().map(|views| views.rays),
                max_error: (self.run.engine == Engine::Auto).then_some(ErrorSettings {
                    delta_e: self.run.max_error.delta_e,
                    rmse: self.run.max_error.rmse,
                }),
            },
            model: self.model_settings(),
        }
    }

    /// The properties that all curves share.
    fn properties(&self) -> Properties {
        let fixed = &self.fixed;
        let (shape, proportion) = (fixed.shape, LawSettings::from(&fixed.proportion));
        Properties {
            shape: shape_name(shape),
            sphericity: (!shape.has_aspect_ratio()).then_some(proportion),
            aspect_ratio: shape.has_aspect_ratio().then_some(proportion),
            temperature_c: fixed.temperature_c,
            water_saturation: fixed.water_saturation,
            black_carbon: fixed.black_carbon.as_ref().map(CarbonSettings::from),
            brown_carbon: fixed.brown_carbon.as_ref().map(CarbonSettings::from),
            absorber: fixed.absorbers.iter().map(AbsorberSettings::from).collect(),
            // config files list layers from the base up
            below: fixed.below.iter().rev().map(BelowSettings::from).collect(),
            substrate: Reflectance::of(&fixed.substrate)
                .map(|reflectance| SubstrateSettings { reflectance }),
        }
    }

    /// The model options; those without effect in this grid are left out.
    fn model_settings(&self) -> ModelSettings {
        let (fixed, size_law) = (&self.fixed, self.spread.size_law);
        let model = &fixed.model;
        let carbon = fixed.carbon().next().is_some() || self.axes.has(Parameter::BlackCarbon);
        let is_layered = !fixed.below.is_empty();
        ModelSettings {
            entry: model.entry.name().into(),
            // defaults are left out, as in databases from before these keys existed
            facets: (model.facets != Facets::default()).then(|| model.facets.name().into()),
            size_law: (size_law != SizeLaw::default()).then(|| size_law.name().into()),
            layers: is_layered.then(|| model.joining.name().into()),
            carbon_law: carbon.then(|| model.carbon_law.name().into()),
            impurity_mass: (carbon || fixed.has_absorbers())
                .then(|| model.impurity_mass.name().into()),
            ice: model.ice.name().into(),
            water: water_name(&model.water),
        }
    }

    /// The text of a grid file that builds this database, with every value explicit.
    /// [`crate::config::grid::parse`] gives this grid again, except that the bounds of the
    /// compression, and settings without effect in this grid, have their defaults. A user's
    /// tables are named without their directory: they are searched for in the directory of
    /// the file.
    #[must_use]
    pub fn to_config(&self) -> String {
        self.describe().to_config()
    }
}

impl From<&TruncatedNormal> for LawSettings {
    fn from(law: &TruncatedNormal) -> Self {
        Self {
            min: law.min(),
            max: law.max(),
            mean: law.mean(),
            sd: law.sd(),
        }
    }
}

/// The mass that a concentration refers to.
fn concentration_per(wet: bool) -> String {
    if wet { "wet_mass" } else { "dry_mass" }.into()
}

impl From<&Absorber> for AbsorberSettings {
    fn from(absorber: &Absorber) -> Self {
        let (efficiency, reference, exponent) = match &absorber.mass_absorption {
            MassAbsorption::Power {
                m2_g,
                reference_nm,
                angstrom_exponent,
            } => (
                EfficiencySettings::Power(*m2_g),
                Some(*reference_nm),
                Some(*angstrom_exponent),
            ),
            MassAbsorption::Table(table) => {
                let values = table.column(0).to_vec();
                (EfficiencySettings::Spectrum(values), None, None)
            }
        };
        Self {
            name: absorber.name.clone(),
            concentration_ng_g: Some(absorber.concentration_ng_g),
            sedimentation: absorber.sedimentation,
            mass_absorption_efficiency_m2_g: efficiency,
            reference_wavelength_nm: reference,
            angstrom_exponent: exponent,
            concentration_per: concentration_per(absorber.per_wet_mass),
            mass_scattering_efficiency_m2_g: absorber.scattering.map(|s| s.m2_g),
            asymmetry_parameter: absorber.scattering.map(|s| s.asymmetry),
        }
    }
}

impl From<&Carbon> for CarbonSettings {
    fn from(carbon: &Carbon) -> Self {
        Self {
            concentration_ng_g: carbon.concentration_ng_g,
            sedimentation: carbon.sedimentation,
            mass_absorption_efficiency_m2_g: carbon.mass_absorption_efficiency_m2_g,
            reference_wavelength_nm: carbon.reference_wavelength_nm,
            angstrom_exponent: carbon.angstrom_exponent,
            concentration_per: concentration_per(carbon.per_wet_mass),
        }
    }
}

impl From<&Layer> for BelowSettings {
    fn from(layer: &Layer) -> Self {
        let snow = &layer.snow;
        Self {
            thickness_cm: m_to_cm(layer.thickness_m),
            density_kg_m3: snow.density_kg_m3,
            temperature_c: snow.temperature_c,
            water_saturation: snow.water_saturation,
            grain: snow.grains.iter().map(GrainSettings::from).collect(),
            black_carbon: snow.black_carbon.as_ref().map(CarbonSettings::from),
            brown_carbon: snow.brown_carbon.as_ref().map(CarbonSettings::from),
            absorber: snow.absorbers.iter().map(AbsorberSettings::from).collect(),
        }
    }
}

impl From<&Component> for GrainSettings {
    fn from(Component { fraction, grain }: &Component) -> Self {
        Self {
            fraction: *fraction,
            size_um: SizeSettings {
                min: m_to_um(grain.size.min_m()),
                max: m_to_um(grain.size.max_m()),
            },
            facetness: (&grain.facetness).into(),
            shape: shape_name(grain.shape),
            sphericity: (!grain.shape.has_aspect_ratio()).then(|| (&grain.proportion).into()),
            aspect_ratio: grain
                .shape
                .has_aspect_ratio()
                .then(|| (&grain.proportion).into()),
        }
    }
}

impl Reflectance {
    /// The value of the key `reflectance` of a substrate; a spectrum is a list with one value
    /// per wavelength. `None` for a black substrate.
    pub(crate) fn of(substrate: &Substrate) -> Option<Self> {
        match substrate {
            Substrate::Black => None,
            Substrate::Grey(reflectance) => Some(Self::Grey(*reflectance)),
            Substrate::Spectrum { table } => Some(Self::Spectrum(table.column(0).to_vec())),
        }
    }
}

/// The name of a shape other than the default.
fn shape_name(shape: Shape) -> Option<String> {
    (shape != Shape::default()).then(|| shape.name().into())
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
