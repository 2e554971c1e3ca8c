//! The description of a database: the identity that determines whether a build may
//! continue it, and the text of a grid file that makes the same database.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::StoreError;
use super::layout::Contents;
use crate::engine::Engine;
use crate::grain::{Shape, SizeConversion, SizeLaw, SizeMeasure, TruncatedNormal};
use crate::grid::{GivenSizes, Grid};
use crate::lookup::SubstrateKind;
use crate::parameter::{Axes, Parameter};

/// Version of the layout described in [`crate::store`].
pub const FORMAT_VERSION: u32 = 1;

/// Version of the assignment of random streams and tables to nodes. A database of another
/// version is not continued, because it would mix two sets of streams.
const STREAMS: u32 = 2;

/// Key of the entry with the number of too thin thicknesses per grain size.
const ABSENT: &str = "absent";

/// Value of the attribute `program`, which identifies databases of this program.
const PROGRAM: &str = "splitsnow";

/// Renamed keys and values: the spelling of version 0.1, which the identity keeps, and the
/// current one. Commit marks hash the identity, so that a new spelling there would
/// invalidate every finished job.
const KEYS: [[&str; 2]; 1] = [["axes.angle_deg", "axes.incidence_angle_deg"]];
const ENGINES: [[&str; 2]; 1] = [["\"doubling\"", "\"hybrid\""]];

/// An entry with its key and value respelled; `order` returns the spelling to replace and
/// its replacement.
fn respelled(
    key: &str,
    value: &str,
    order: impl Fn([&'static str; 2]) -> (&'static str, &'static str),
) -> (String, String) {
    let replaced = |pairs: [[&'static str; 2]; 1], text: &str| {
        let mut pairs = pairs.into_iter().map(&order);
        let pair = pairs.find(|(from, _)| *from == text);
        pair.map_or_else(|| text.to_owned(), |(_, to)| to.to_owned())
    };
    let new_value = match key {
        "run.engine" => replaced(ENGINES, value),
        _ => value.to_owned(),
    };
    (replaced(KEYS, key), new_value)
}

/// Everything that the bytes of a database depend on.
///
/// Both parts are canonical: they depend neither on the formatting of the user's file nor
/// on the history of the directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Description {
    /// Key and value of every input, in a fixed order.
    entries: Vec<(String, String)>,
    /// The canonical grid file.
    pub(super) config: String,
}

impl Description {
    /// The description of the database of `grid`. `extra` has further inputs, such as the
    /// hashes of the data tables in use.
    pub(super) fn new(grid: &Grid, extra: &BTreeMap<String, String>) -> Self {
        let versions = [
            ("format_version".to_string(), FORMAT_VERSION.to_string()),
            (
                "program_version".to_string(),
                env!("CARGO_PKG_VERSION").to_string(),
            ),
            ("streams".to_string(), STREAMS.to_string()),
        ];
        let inputs = grid
            .describe()
            .into_iter()
            .map(|(section, key, value)| (format!("{section}.{key}"), value));
        let absent = grid.absent().unwrap_or_default();
        let absent = (!absent.is_empty()).then(|| (ABSENT.to_string(), counts(&absent)));
        // Each entry is one line of the attribute.
        let extra = extra
            .iter()
            .map(|(key, value)| (key.clone(), value.replace('\n', " ")));
        Self {
            entries: versions
                .into_iter()
                .chain(inputs)
                .chain(absent)
                .chain(extra)
                .collect(),
            config: grid.to_config(),
        }
    }

    /// Reads the description of the database at `path` from its attributes `root`.
    ///
    /// # Errors
    /// [`StoreError::Foreign`] if the database was not made by this program;
    /// [`StoreError::Damaged`] if an attribute is missing.
    pub(super) fn read(root: &[u8], path: &Path) -> Result<Self, StoreError> {
        let foreign = |reason: &str| StoreError::Foreign {
            path: path.into(),
            reason: reason.into(),
        };
        let root: Value =
            serde_json::from_slice(root).map_err(|_| foreign("zarr.json is not JSON"))?;
        let attribute = |key: &str| root.get("attributes")?.get(key)?.as_str();
        if attribute("program") != Some(PROGRAM) {
            return Err(foreign(
                "its zarr.json does not name splitsnow as the program",
            ));
        }
        let damaged = |key: &str| StoreError::Damaged {
            path: path.join("zarr.json"),
            reason: format!("attribute {key:?} is missing or unreadable"),
        };
        let entries = attribute("identity")
            .ok_or_else(|| damaged("identity"))?
            .lines()
            .filter_map(|line| line.split_once(" = "))
            .map(|(key, value)| respelled(key, value, |[former, present]| (former, present)))
            .collect();
        let config = attribute("config").ok_or_else(|| damaged("config"))?.into();
        Ok(Self { entries, config })
    }

    /// The value of an entry; `None` if it does not exist.
    pub(super) fn get(&self, key: &str) -> Option<&str> {
        let mut entries = self.entries.iter();
        entries
            .find(|(k, _)| k == key)
            .map(|(_, value)| value.as_str())
    }

    /// Refuses the database at `path`, which `self` describes, if it differs from
    /// `requested`.
    ///
    /// # Errors
    /// [`StoreError::Differs`] with the first entry that differs.
    pub(super) fn check_same(&self, requested: &Self, path: &Path) -> Result<(), StoreError> {
        const NONE: &str = "(none)";
        let entries = requested.entries.iter().chain(&self.entries);
        for (key, _) in entries {
            let (stored, wanted) = (self.get(key), requested.get(key));
            if stored != wanted {
                return Err(StoreError::Differs {
                    path: path.into(),
                    key: key.clone(),
                    stored: short(stored.unwrap_or(NONE)),
                    requested: short(wanted.unwrap_or(NONE)),
                });
            }
        }
        Ok(())
    }

    /// Refuses the database at `path`, which `self` describes, if it differs from
    /// `requested` in more than the values of the axes, so that no node can be the same.
    ///
    /// # Errors
    /// [`StoreError::OtherNodes`] with the first entry that differs.
    pub(super) fn check_nodes(&self, requested: &Self, path: &Path) -> Result<(), StoreError> {
        const NONE: &str = "(none)";
        let entries = requested.entries.iter().chain(&self.entries);
        for (key, _) in entries {
            let (stored, wanted) = (self.get(key), requested.get(key));
            if stored != wanted && !self.may_come_from_axes(requested, key) {
                return Err(StoreError::OtherNodes {
                    path: path.into(),
                    key: key.clone(),
                    stored: short(stored.unwrap_or(NONE)),
                    requested: short(wanted.unwrap_or(NONE)),
                });
            }
        }
        Ok(())
    }

    /// Whether a difference in `key` may come from the axes alone. An optional parameter may
    /// be an axis in one description and fixed in the other. A substance that is absent has
    /// neither laws nor tables in the description. In these cases the parameters of each
    /// node determine whether it is the same.
    fn may_come_from_axes(&self, requested: &Self, key: &str) -> bool {
        let moved = |axis| self.has_axis(axis) != requested.has_axis(axis);
        let in_one = self.get(key).is_some() != requested.get(key).is_some();
        match key {
            "fixed.sphericity" | "spread.sphericity_half_width" | "spread.sphericity_sd" => {
                in_one && moved(Parameter::Sphericity)
            }
            "model.carbon_law" | "model.impurity_mass" => in_one,
            // the absent curves follow from the grain sizes and thicknesses
            ABSENT => true,
            _ if key.starts_with("axes.") => true,
            _ if key.starts_with("data.") => in_one,
            _ => Parameter::ALL.into_iter().any(|axis| {
                let fixed = axis.record().fixed.iter();
                moved(axis) && fixed.into_iter().any(|fixed| fixed.starts_with(key))
            }),
        }
    }

    /// Refuses a database whose format this version cannot read.
    pub(super) fn check_format(&self, path: &Path) -> Result<(), StoreError> {
        let supported = FORMAT_VERSION.to_string();
        match self.get("format_version") {
            Some(version) if version == supported => Ok(()),
            other => Err(StoreError::Differs {
                path: path.into(),
                key: "format_version".into(),
                stored: other.unwrap_or("(none)").into(),
                requested: supported,
            }),
        }
    }

    /// All entries as lines `key = value`, respelled as in version 0.1.
    fn identity(&self) -> String {
        let lines = self.entries.iter().map(|(key, value)| {
            let (key, value) = respelled(key, value, |[former, present]| (present, former));
            format!("{key} = {value}")
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// SHA-256 of the identity, which enters every commit mark.
    pub(super) fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.identity()).into()
    }

    /// The contents of the database, from the canonical grid file.
    pub(super) fn contents(&self, path: &Path) -> Result<Contents, StoreError> {
        let damaged = |reason: String| StoreError::Damaged {
            path: path.join("zarr.json"),
            reason,
        };
        let config: toml::Table = self.config.parse().map_err(|error: toml::de::Error| {
            damaged(format!("attribute \"config\": {}", error.message()))
        })?;
        let get = |section: &str, key: &str| config.get(section)?.get(key);
        let list = |section: &str, key: &str| -> Result<Vec<f64>, StoreError> {
            get(section, key)
                .and_then(|values| values.as_array())
                .and_then(|values| values.iter().map(toml::Value::as_float).collect())
                .ok_or_else(|| damaged(format!("attribute \"config\" has no {section}.{key}")))
        };
        let measure = SizeMeasure::ALL
            .into_iter()
            .find(|measure| get("axes", measure.name()).is_some());
        let given_sizes = match measure {
            None => None,
            Some(measure) => Some(GivenSizes {
                measure,
                values: list("axes", measure.name())?,
            }),
        };
        let mut axes = Axes::default();
        for parameter in Parameter::ALL {
            let values = match &given_sizes {
                Some(given) if parameter == Parameter::GrainSize => {
                    let shape = size_conversion(&config).ok_or_else(|| {
                        damaged("attribute \"config\" does not describe the grains".into())
                    })?;
                    given.measure.sizes_um(&given.values, &shape)
                }
                _ if parameter.is_optional() && get("axes", parameter.key()).is_none() => continue,
                // in version 0.1, the key of an axis was its name in files
                _ if get("axes", parameter.key()).is_none() => list("axes", parameter.name())?,
                _ => list("axes", parameter.key())?,
            };
            axes.set(parameter, values);
        }
        let name = get("run", "engine").and_then(|name| name.as_str());
        let engine = name
            .and_then(Engine::named)
            .ok_or_else(|| damaged(format!("unknown engine {name:?}")))?;
        Ok(Contents {
            absent: self.absent(&axes, path)?,
            axes,
            given_sizes,
            wavelengths_nm: list("wavelengths", "values_nm")?,
            engine,
            diffuse: self.has_diffuse(),
        })
    }

    /// For each grain size, the number of the thinnest thicknesses without a curve; empty if
    /// all curves exist.
    fn absent(&self, axes: &Axes, path: &Path) -> Result<Vec<usize>, StoreError> {
        let Some(text) = self.get(ABSENT) else {
            return Ok(Vec::new());
        };
        let counts: Result<Vec<usize>, _> = text.split(", ").map(str::parse).collect();
        let [_, sizes, _, thicknesses, _] = axes.core_shape();
        counts
            .ok()
            .filter(|counts| counts.len() == sizes && counts.iter().all(|n| *n <= thicknesses))
            .ok_or_else(|| StoreError::Damaged {
                path: path.join("zarr.json"),
                reason: format!("its identity has {ABSENT} = {text}, which does not fit the axes"),
            })
    }

    /// Whether there are curves under diffuse light.
    fn has_diffuse(&self) -> bool {
        self.get("axes.diffuse") == Some("true")
    }

    /// Values of the grain size axis if it is given by another measure than the size.
    fn given_sizes(&self) -> Option<GivenSizes> {
        SizeMeasure::ALL.into_iter().find_map(|measure| {
            let list = self.get(&format!("axes.{}", measure.name()))?;
            let values = serde_json::from_str(list).ok()?;
            Some(GivenSizes { measure, values })
        })
    }

    /// The kind of substrate under the surface layer, including the layers below.
    pub(super) fn substrate(&self) -> SubstrateKind {
        let axis = self.has_axis(Parameter::SubstrateReflectance);
        if self.get("fixed.below").is_some() {
            SubstrateKind::Layers
        } else if axis || self.get("fixed.substrate").is_some() {
            SubstrateKind::Reflecting
        } else {
            SubstrateKind::Black
        }
    }

    fn has_axis(&self, axis: Parameter) -> bool {
        self.get(&format!("axes.{}", axis.key())).is_some()
    }

    /// Attributes of the Zarr group.
    pub(super) fn attributes(&self) -> Map<String, Value> {
        let text = |key: &str| self.get(key).unwrap_or_default().trim_matches('"').into();
        let number = |key: &str| {
            let value = self.get(key).and_then(|value| value.parse::<u64>().ok());
            Value::from(value.unwrap_or_default())
        };
        let mut units = String::new();
        let is_axis = |axis: &Parameter| !axis.is_optional() || self.has_axis(*axis);
        for axis in Parameter::ALL.into_iter().filter(is_axis) {
            let _ = write!(units, "{}: {}; ", axis.name(), axis.unit());
        }
        let substrate = if self.has_axis(Parameter::SubstrateReflectance) {
            Some("of the axis substrate_reflectance")
        } else {
            self.get("fixed.substrate")
        };
        let substrate = match substrate {
            None => "black: light that leaves through the bottom does not come back".to_owned(),
            Some(substrate) if substrate.contains('[') => {
                "Lambertian substrate with the spectrum fixed.substrate of config; transmittance is the light that stays in it".to_owned()
            }
            Some(substrate) => {
                format!("Lambertian substrate {substrate}; transmittance is the light that stays in it")
            }
        };
        let bottom = match self.get("fixed.below") {
            None => substrate,
            Some(_) => format!("the layers of fixed.below, then {substrate}"),
        };
        let illumination = if self.has_diffuse() {
            "collimated; angle_deg is the polar angle of incidence, measured from the surface normal; those named diffuse: isotropic"
        } else {
            "collimated; angle_deg is the polar angle of incidence, measured from the surface normal"
        };
        let entries: [(&str, Value); 17] = [
            ("title", "Spectral database of snow".into()),
            ("program", PROGRAM.into()),
            ("program_version", text("program_version")),
            ("format_version", number("format_version")),
            (
                "source",
                "P. M. Varsa, A First-Principles Framework for Simulating Light and Snow Interactions, PhD thesis, University of Waterloo, 2025".into(),
            ),
            (
                "units",
                format!("{units}wavelength_nm: nm; transmittance, reflectance and their standard errors: 1").into(),
            ),
            (
                "illumination",
                illumination.into(),
            ),
            ("bottom_boundary", bottom.into()),
            ("substrate", self.substrate().name().into()),
            ("ice_table", text("model.ice")),
            ("water_table", text("model.water")),
            ("engine", text("run.engine")),
            ("seed", number("run.seed")),
            ("rays", number("run.rays")),
            ("config", self.config.as_str().into()),
            ("config_sha256", hex(&Sha256::digest(&self.config)).into()),
            ("identity", self.identity().into()),
        ];
        let mut attributes: Map<String, Value> = entries
            .into_iter()
            .map(|(key, value)| (key.to_string(), value))
            .collect();
        if let Some(given) = self.given_sizes() {
            let measure = given.measure;
            let relation = format!(
                "{}: {}. The values here are those of the grain sizes in their order; spread.grain_size_half_width_um is that of the sizes.",
                measure.name(),
                measure.about().0
            );
            attributes.insert("grain_size_relation".into(), relation.into());
            attributes.insert(measure.name().into(), given.by_size().into());
            // tells xarray that the array of this name is a coordinate
            attributes.insert("coordinates".into(), measure.name().into());
        }
        attributes
    }
}

fn counts(values: &[usize]) -> String {
    values
        .iter()
        .map(usize::to_string)
        .collect::<Vec<_>>()
        .join(", ")
}

/// A value shortened for messages: lists of spectra and axes may be long.
fn short(value: &str) -> String {
    const MAX_CHARACTERS: usize = 200;
    match value.char_indices().nth(MAX_CHARACTERS) {
        None => value.to_owned(),
        Some((end, _)) => format!("{}...", &value[..end]),
    }
}

/// The properties of the grains, from a canonical grid file, that convert other measures to
/// grain sizes; `None` if a key is missing.
fn size_conversion(config: &toml::Table) -> Option<SizeConversion> {
    let number = |section: &str, key: &str| config.get(section)?.get(key)?.as_float();
    let law = config.get("fixed")?.get("sphericity")?;
    let law = |key: &str| law.get(key)?.as_float();
    let model = config.get("model");
    let size_law = model.and_then(|model| model.get("size_law")?.as_str());
    let size_law = match size_law {
        Some(name) if name == SizeLaw::Consistent.name() => SizeLaw::Consistent,
        _ => SizeLaw::Varsa2025,
    };
    Some(SizeConversion {
        half_width_um: number("spread", "grain_size_half_width_um")?,
        size_law,
        shape: Shape::default(),
        sphericity: TruncatedNormal::new(law("min")?, law("max")?, law("mean")?, law("sd")?)
            .ok()?,
        // only specific surface areas depend on it, and these exclude an axis of temperature
        temperature_c: number("fixed", "temperature_c").unwrap_or_default(),
    })
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
