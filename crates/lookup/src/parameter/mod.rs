//! The parameters that can be axes of a database, with one record for each.
//!
//! The records are the single source for config keys and their limits, attributes of Zarr
//! and NetCDF files, tensors of the compact file, command-line options and coordinates of
//! look-ups. ARCHITECTURE.md ("How to extend") says what else a new axis needs.
mod axes;
mod point;
mod scale;

pub use axes::{Axes, Region};
pub use point::Point;
pub use scale::Scale;
pub(crate) use scale::{core_places, slab_places, thickness_slope};

/// A parameter that can be an axis. Variants are in storage order, slowest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Parameter {
    /// Angle of the view from the surface normal.
    View,
    /// Azimuth of the view relative to the light.
    RelativeAzimuth,
    /// Mass of black carbon per mass of snow.
    BlackCarbon,
    /// Mass of the first listed absorber per mass of snow.
    Absorber,
    /// Fraction of the pore space that is water.
    WaterSaturation,
    /// Temperature of the snow.
    Temperature,
    /// Mean sphericity of the grains.
    Sphericity,
    /// Lambertian reflectance of the substrate, the same at all wavelengths.
    SubstrateReflectance,
    /// Mean facetness of the grains.
    Facetness,
    /// Mean length of the grains' major axis.
    GrainSize,
    /// Density of the dry snow.
    Density,
    /// Thickness of the slab.
    Thickness,
    /// Polar angle of incidence.
    Incidence,
}

/// The role of a parameter in a simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// It describes the snow or the substrate.
    Snow,
    /// The thickness of the slab: most engines compute all thicknesses at once.
    Thickness,
    /// The incidence angle: some engines compute all angles at once.
    Incidence,
    /// The direction of the view: all views are computed at once, and only files of anisotropy
    /// factors have these axes.
    View,
}

/// The values from `min` to `max`, without the ends that are `open`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Whether `min` and `max` themselves are excluded.
    pub open: [bool; 2],
}

/// The properties of a parameter as an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// Key in config files and argument in Python, with the unit as suffix.
    pub key: &'static str,
    /// Option on the command line: the key with hyphens.
    pub option: &'static str,
    /// Name in databases, compact files and exports.
    pub name: &'static str,
    /// Name in text for people.
    pub label: &'static str,
    /// Symbol in formulas.
    pub symbol: &'static str,
    /// Unit as UDUNITS spells it; "1" for a pure number.
    pub unit: &'static str,
    /// Short description.
    pub long_name: &'static str,
    /// Range that a database may have.
    pub physical: Interval,
    /// Range that a config may have.
    pub allowed: Interval,
    /// Range that a config may have without a warning.
    pub ordinary: Interval,
    /// Coordinate in which -ln T is nearly linear.
    pub scale: Scale,
    /// Largest number of nodes tried by `tailor`.
    pub candidates: usize,
    /// Role in a simulation.
    pub role: Role,
    /// Whether a database may lack this axis.
    pub optional: bool,
    /// Config keys that set the value if the parameter is not an axis.
    pub fixed: &'static [&'static str],
}

const fn closed(min: f64, max: f64) -> Interval {
    Interval {
        min,
        max,
        open: [false, false],
    }
}

const fn above(min: f64, max: f64) -> Interval {
    Interval {
        min,
        max,
        open: [true, false],
    }
}

impl Parameter {
    /// Number of parameters.
    pub const COUNT: usize = 13;

    /// All parameters, in storage order.
    pub const ALL: [Self; Self::COUNT] = [
        Self::View,
        Self::RelativeAzimuth,
        Self::BlackCarbon,
        Self::Absorber,
        Self::WaterSaturation,
        Self::Temperature,
        Self::Sphericity,
        Self::SubstrateReflectance,
        Self::Facetness,
        Self::GrainSize,
        Self::Density,
        Self::Thickness,
        Self::Incidence,
    ];

    /// The parameters that are axes of every database, in storage order.
    pub const CORE: [Self; 5] = [
        Self::Facetness,
        Self::GrainSize,
        Self::Density,
        Self::Thickness,
        Self::Incidence,
    ];

    /// The axes of a direction of view, in storage order: only files of anisotropy factors have
    /// them.
    pub const VIEWS: [Self; 2] = [Self::View, Self::RelativeAzimuth];

    /// The record of this parameter. Ordinary and allowed ranges are those of
    /// docs/methods.md.
    #[must_use]
    pub const fn record(self) -> Record {
        match self {
            Self::View => Record {
                key: "view_deg",
                option: "view-deg",
                name: "view_deg",
                label: "view angle",
                symbol: "theta_v",
                unit: "degree",
                long_name: "angle of the view from the surface normal",
                physical: closed(0.0, 88.0),
                allowed: closed(0.0, 88.0),
                ordinary: closed(0.0, 88.0),
                scale: Scale::Linear,
                candidates: 9,
                role: Role::View,
                optional: true,
                fixed: &[],
            },
            Self::RelativeAzimuth => Record {
                key: "relative_azimuth_deg",
                option: "relative-azimuth-deg",
                name: "relative_azimuth_deg",
                label: "relative azimuth",
                symbol: "phi",
                unit: "degree",
                long_name: "azimuth of the view relative to the direction in which the light travels; 0 is forward, 180 back toward the light",
                physical: closed(0.0, 180.0),
                allowed: closed(0.0, 180.0),
                ordinary: closed(0.0, 180.0),
                scale: Scale::Linear,
                candidates: 9,
                role: Role::View,
                optional: true,
                fixed: &[],
            },
            Self::BlackCarbon => Record {
                key: "black_carbon_ng_g",
                option: "black-carbon-ng-g",
                name: "black_carbon_ng_g",
                label: "black carbon",
                symbol: "C",
                unit: "ng g-1",
                long_name: "mass of black carbon per mass of snow",
                physical: closed(0.0, 1e9),
                allowed: closed(0.0, 1e9),
                ordinary: closed(0.0, 1e9),
                // 20 ng/g absorb about as much visible light as clean ice
                scale: Scale::Root(20.0),
                candidates: 6,
                role: Role::Snow,
                optional: true,
                fixed: &["fixed.black_carbon.concentration_ng_g"],
            },
            Self::Absorber => Record {
                key: "absorber_ug_g",
                option: "absorber-ug-g",
                name: "absorber_ug_g",
                label: "absorber",
                symbol: "C_a",
                unit: "ug g-1",
                long_name: "mass of the listed absorber per mass of snow",
                physical: closed(0.0, 1e6),
                allowed: closed(0.0, 1e6),
                ordinary: closed(0.0, 1e6),
                // 10 ug/g of mineral dust absorb about as much as 20 ng/g of black carbon
                scale: Scale::Root(10.0),
                candidates: 6,
                role: Role::Snow,
                optional: true,
                fixed: &[
                    "fixed.absorber[0].concentration_ng_g",
                    "fixed.absorber[0].concentration_ug_g",
                ],
            },
            Self::WaterSaturation => Record {
                key: "water_saturation",
                option: "water-saturation",
                name: "water_saturation",
                label: "water saturation",
                symbol: "S",
                unit: "1",
                long_name: "share of the pore space that is water",
                physical: closed(0.0, 0.5),
                allowed: closed(0.0, 0.5),
                ordinary: closed(0.0, 0.5),
                scale: Scale::Complement(1.0),
                candidates: 6,
                role: Role::Snow,
                optional: true,
                fixed: &["fixed.water_saturation", "fixed.water_fraction"],
            },
            Self::Temperature => Record {
                key: "temperature_c",
                option: "temperature-c",
                name: "temperature_c",
                label: "temperature",
                symbol: "T",
                unit: "degC",
                long_name: "temperature of the snow",
                physical: closed(-40.0, 0.0),
                allowed: closed(-40.0, 0.0),
                ordinary: closed(-40.0, 0.0),
                scale: Scale::Linear,
                candidates: 6,
                role: Role::Snow,
                optional: true,
                fixed: &["fixed.temperature_c"],
            },
            Self::Sphericity => Record {
                key: "sphericity",
                option: "sphericity",
                name: "sphericity",
                label: "sphericity",
                symbol: "Psi",
                unit: "1",
                long_name: "mean sphericity of the grains",
                physical: above(0.0, 1.0),
                allowed: above(0.0, 1.0),
                ordinary: above(0.0, 1.0),
                scale: Scale::Log,
                candidates: 6,
                role: Role::Snow,
                optional: true,
                fixed: &["fixed.sphericity", "fixed.aspect_ratio"],
            },
            Self::SubstrateReflectance => Record {
                key: "substrate_reflectance",
                option: "substrate-reflectance",
                name: "substrate_reflectance",
                label: "substrate reflectance",
                symbol: "rho",
                unit: "1",
                long_name: "Lambertian reflectance of the substrate",
                physical: closed(0.0, 1.0),
                allowed: closed(0.0, 1.0),
                ordinary: closed(0.0, 1.0),
                // 0.95: reflectance of the snow above, for multiple reflections
                scale: Scale::Complement(0.95),
                candidates: 6,
                role: Role::Snow,
                optional: true,
                fixed: &["fixed.substrate"],
            },
            Self::Facetness => Record {
                key: "facetness",
                option: "facetness",
                name: "facetness",
                label: "facetness",
                symbol: "F",
                unit: "1",
                long_name: "mean facetness of the grains",
                physical: closed(0.0, 1.0),
                allowed: closed(0.0, 1.0),
                ordinary: closed(0.0, 1.0),
                scale: Scale::Saturating(0.18),
                candidates: 7,
                role: Role::Snow,
                optional: false,
                fixed: &[],
            },
            Self::GrainSize => Record {
                key: "grain_size_um",
                option: "grain-size-um",
                name: "grain_size_um",
                label: "grain size",
                symbol: "s",
                unit: "um",
                long_name: "mean length of the grains' major axis",
                physical: above(0.0, 1e6),
                allowed: closed(10.0, 6000.0),
                ordinary: closed(50.0, 3000.0),
                scale: Scale::Log,
                candidates: 9,
                role: Role::Snow,
                optional: false,
                fixed: &[],
            },
            Self::Density => Record {
                key: "density_kg_m3",
                option: "density-kg-m3",
                name: "density_kg_m3",
                label: "density",
                symbol: "D",
                unit: "kg m-3",
                long_name: "density of the dry snow",
                physical: Interval {
                    min: 0.0,
                    max: 1000.0,
                    open: [true, true],
                },
                allowed: closed(50.0, 550.0),
                ordinary: closed(50.0, 450.0),
                scale: Scale::Log,
                candidates: 4,
                role: Role::Snow,
                optional: false,
                fixed: &[],
            },
            Self::Thickness => Record {
                key: "thickness_cm",
                option: "thickness-cm",
                name: "thickness_cm",
                label: "thickness",
                symbol: "h",
                unit: "cm",
                long_name: "thickness of the slab",
                physical: above(0.0, 1e6),
                allowed: above(0.0, 10_000.0),
                ordinary: closed(1.0, 100.0),
                scale: Scale::Shifted(0.5),
                candidates: 17,
                role: Role::Thickness,
                optional: false,
                fixed: &[],
            },
            Self::Incidence => Record {
                key: "incidence_angle_deg",
                option: "incidence-angle-deg",
                name: "angle_deg",
                label: "incidence angle",
                symbol: "theta",
                unit: "degree",
                long_name: "polar angle of incidence from the surface normal",
                physical: Interval {
                    min: 0.0,
                    max: 90.0,
                    open: [false, true],
                },
                allowed: Interval {
                    min: 0.0,
                    max: 90.0,
                    open: [false, true],
                },
                ordinary: Interval {
                    min: 0.0,
                    max: 90.0,
                    open: [false, true],
                },
                scale: Scale::Grazing([0.4, 0.02]),
                candidates: 13,
                role: Role::Incidence,
                optional: false,
                fixed: &[],
            },
        }
    }

    /// Key in config files and argument in Python, with the unit as suffix.
    #[must_use]
    pub const fn key(self) -> &'static str {
        self.record().key
    }

    /// Name in databases, compact files and exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.record().name
    }

    /// The parameter with this key, or with this name in files.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let mut parameters = Self::ALL.into_iter();
        parameters.find(|parameter| parameter.key() == name || parameter.name() == name)
    }

    /// Unit as UDUNITS spells it; "1" for a pure number.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        self.record().unit
    }

    /// Whether a database may lack this axis.
    #[must_use]
    pub const fn is_optional(self) -> bool {
        self.record().optional
    }

    /// Whether this is an axis of a direction of view ([`Parameter::VIEWS`]).
    #[must_use]
    pub const fn is_view(self) -> bool {
        matches!(self.record().role, Role::View)
    }

    /// Position in [`Parameter::ALL`].
    const fn index(self) -> usize {
        self as usize
    }
}

impl Interval {
    /// Whether `value` is in the interval.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        let [open_min, open_max] = self.open;
        (self.min..=self.max).contains(&value)
            && !(open_min && value == self.min)
            && !(open_max && value == self.max)
    }
}

/// The range in words, for messages.
impl std::fmt::Display for Interval {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { min, max, open } = self;
        match open {
            [false, false] => write!(f, "{min} to {max}"),
            [true, false] => write!(f, "above {min} and at most {max}"),
            [false, true] => write!(f, "at least {min} and below {max}"),
            [true, true] => write!(f, "above {min} and below {max}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_consistent() {
        for (i, parameter) in Parameter::ALL.into_iter().enumerate() {
            let record = parameter.record();
            assert_eq!(parameter.index(), i);
            assert_eq!(Parameter::named(record.name), Some(parameter));
            assert_eq!(Parameter::named(record.key), Some(parameter));
            assert_eq!(record.option, record.key.replace('_', "-"));
            assert_eq!(record.optional, !Parameter::CORE.contains(&parameter));
            let is_property = record.optional && record.role == Role::Snow;
            assert_eq!(is_property, !record.fixed.is_empty());
            for (inner, outer) in [
                (record.ordinary, record.allowed),
                (record.allowed, record.physical),
            ] {
                assert!(
                    outer.min <= inner.min && inner.max <= outer.max,
                    "{record:?}"
                );
            }
        }
        assert!(Parameter::ALL.is_sorted());
        let views = Parameter::ALL.into_iter().filter(|p| p.is_view());
        assert_eq!(views.collect::<Vec<_>>(), Parameter::VIEWS);
        for role in [Role::Thickness, Role::Incidence] {
            let has = |parameter: &Parameter| parameter.record().role == role;
            assert_eq!(Parameter::ALL.into_iter().filter(has).count(), 1);
        }
    }

    #[test]
    fn open_ends_are_outside() {
        let angles = Parameter::Incidence.record().physical;
        assert!(angles.contains(0.0) && angles.contains(89.9) && !angles.contains(90.0));
        let sizes = Parameter::GrainSize.record().physical;
        assert!(!sizes.contains(0.0) && sizes.contains(1e6) && !sizes.contains(f64::NAN));
        assert_eq!(angles.to_string(), "at least 0 and below 90");
        assert_eq!(sizes.to_string(), "above 0 and at most 1000000");
    }
}
