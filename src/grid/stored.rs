//! The settings of a grid read back from a database.
use serde_json::Value;

use super::settings::{AxisSettings, FixedSettings, Properties};
use super::{GridSettings, GridViews, SizeAxis};
use crate::grain::{Shape, SizeConversion, SizeLaw, SizeMeasure, TruncatedNormal};
use crate::parameter::{Axes, Parameter};

impl GridSettings {
    /// Reads the canonical text of a grid, also one of version 0.1, which named the axis of
    /// incidence angles and the engine `hybrid` differently.
    ///
    /// # Errors
    /// What is missing or unreadable.
    pub(crate) fn parse(config: &str) -> Result<Self, String> {
        toml::from_str(config).map_err(|error| error.message().to_owned())
    }

    /// The axes, also those of a view, with grain sizes in um; `None` if these do not follow from
    /// the settings.
    pub(crate) fn axes(&self) -> Option<Axes> {
        let mut axes = Axes::default();
        for (name, values) in &self.axes.lists {
            if let Some(parameter) = Parameter::named(name) {
                axes.set(parameter, values.clone());
            }
        }
        if let Some(given) = self.size_axis() {
            let sizes = given
                .measure
                .sizes_um(&given.values, &self.size_conversion()?);
            axes.set(Parameter::GrainSize, sizes);
        }
        Some(axes)
    }

    /// The views, if any, and the axes `all` without theirs.
    pub(crate) fn views(&self, all: &Axes) -> (Option<GridViews>, Axes) {
        let axes = all.views();
        let views = (!axes.is_empty()).then_some(GridViews {
            axes,
            rays: self.run.view_rays.unwrap_or(GridViews::RAYS),
        });
        (views, all.without_views())
    }

    /// Values of the grain size axis if it is given by another measure than the size.
    pub(crate) fn size_axis(&self) -> Option<SizeAxis> {
        let mut lists = self.axes.lists.iter();
        lists.find_map(|(name, values)| {
            let mut measures = SizeMeasure::ALL.into_iter();
            Some(SizeAxis {
                measure: measures.find(|measure| measure.name() == *name)?,
                values: values.clone(),
            })
        })
    }

    /// How often a ray meets grains of each size in the size range.
    pub(crate) fn size_law(&self) -> SizeLaw {
        match self.model.size_law.as_deref() {
            Some(name) if name == SizeLaw::Consistent.name() => SizeLaw::Consistent,
            _ => SizeLaw::Varsa2025,
        }
    }

    /// The shape of the grains.
    pub(crate) fn shape(&self) -> Shape {
        let name = self.fixed.properties().shape;
        let mut shapes = Shape::ALL.into_iter();
        let found = shapes.find(|shape| Some(shape.name()) == name.as_deref());
        found.unwrap_or_default()
    }

    /// The distribution of the proportion that all curves share; `None` if it is an axis.
    pub(crate) fn proportion(&self) -> Option<TruncatedNormal> {
        let fixed = self.fixed.properties();
        let law = fixed.aspect_ratio.or(fixed.sphericity)?;
        TruncatedNormal::new(law.min, law.max, law.mean, law.sd).ok()
    }

    /// The properties of the grains that convert other measures to grain sizes.
    fn size_conversion(&self) -> Option<SizeConversion> {
        Some(SizeConversion {
            half_width_um: self.spread.grain_size_half_width_um,
            size_law: self.size_law(),
            shape: self.shape(),
            proportion: self.proportion()?,
            // only specific surface areas depend on it, and these exclude an axis of temperature
            temperature_c: self.fixed.properties().temperature_c,
        })
    }
}

impl FixedSettings {
    /// The properties; those that an axis replaces have their defaults.
    pub(crate) fn properties(&self) -> Properties {
        serde_json::from_value(Value::Object(self.0.clone())).unwrap_or_default()
    }
}

impl AxisSettings {
    /// Whether the parameter is an axis; that of the grain size may be given by another measure.
    pub(crate) fn has(&self, parameter: Parameter) -> bool {
        self.lists.iter().any(|(key, _)| *key == parameter.key())
    }
}
