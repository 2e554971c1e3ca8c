//! The description of a database: its identity, which determines whether a build may
//! continue it, and the settings of its grid.
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::StoreError;
use super::layout::Contents;
use crate::grid::{Grid, GridSettings, Reflectance, config_text, toml_text};
use crate::lookup::SubstrateKind;
use crate::parameter::{Axes, Parameter};
use crate::transport::Entry;

/// Version of the layout described in [`crate::store`].
pub const FORMAT_VERSION: u32 = 2;
/// The version whose jobs have a file of each array. It is read and continued.
pub(super) const FILE_PER_JOB: u32 = 1;

/// Version of the assignment of random streams and tables to nodes. A database of another
/// version is not continued, because it would mix two sets of streams. Projected entry has
/// its own, since the attitudes of grains are weighted too.
const STREAMS: u32 = 2;
const PROJECTED_STREAMS: u32 = 3;

/// Key of the entry with the version of the layout.
const FORMAT: &str = "format_version";

/// Key of the entry with the number of too thin thicknesses per grain size.
const ABSENT: &str = "absent";

/// Value of the attribute `program`, which identifies databases of this program.
const PROGRAM: &str = "splitsnow";

/// Renamed keys and values: the spelling of version 0.1, which the identity keeps, and the
/// current one. Commit marks hash the identity, so that a new spelling there would
/// invalidate every finished job.
const KEYS: [[&str; 2]; 1] = [["axes.angle_deg", "axes.incidence_angle_deg"]];
const ENGINES: [[&str; 2]; 1] = [["\"doubling\"", "\"hybrid\""]];

/// How keys and values are spelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Spelling {
    /// As in version 0.1.
    Former,
    Present,
}

impl Spelling {
    /// An entry in this spelling.
    fn entry(self, key: &str, value: &str) -> (String, String) {
        let value = match key {
            "run.engine" => self.respell(ENGINES, value),
            _ => value,
        };
        (self.respell(KEYS, key).to_owned(), value.to_owned())
    }

    fn respell<'a>(self, pairs: [[&'static str; 2]; 1], text: &'a str) -> &'a str {
        let order = |[former, present]: [&'static str; 2]| match self {
            Self::Former => (present, former),
            Self::Present => (former, present),
        };
        let mut pairs = pairs.into_iter().map(order);
        let pair = pairs.find(|(from, _)| *from == text);
        pair.map_or(text, |(_, to)| to)
    }
}

/// The attributes of a database that state what it was made from, as stored.
///
/// Both are canonical: they depend neither on the formatting of the user's file nor on the
/// history of the directory.
#[derive(Debug, Clone)]
pub(super) struct Stored {
    pub(super) identity: Identity,
    /// The canonical grid file.
    config: String,
}

impl Stored {
    /// Reads the attributes of the database at `path` from its file `root`.
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
        Ok(Self {
            identity: Identity::read(attribute("identity").ok_or_else(|| damaged("identity"))?),
            config: attribute("config").ok_or_else(|| damaged("config"))?.into(),
        })
    }

    /// The description of the database at `path`.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if this version cannot read the canonical grid file.
    pub(super) fn describe(self, path: &Path) -> Result<Description, StoreError> {
        let settings = GridSettings::parse(&self.config).map_err(|reason| StoreError::Damaged {
            path: path.join("zarr.json"),
            reason: format!("attribute \"config\": {reason}"),
        })?;
        Ok(Description {
            identity: self.identity,
            settings,
            config: self.config,
        })
    }
}

/// Everything that the bytes of a database depend on: key and value of every input, in a
/// fixed order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Identity {
    entries: Vec<(String, String)>,
}

impl Identity {
    /// The identity of the database of `grid`, which has these `settings`, in the layout of
    /// version `format`. `extra` has further inputs, such as the hashes of the data tables in use.
    fn new(
        grid: &Grid,
        settings: &GridSettings,
        extra: &BTreeMap<String, String>,
        format: u32,
    ) -> Self {
        let streams = match grid.fixed.model.entry {
            Entry::Uniform => STREAMS,
            Entry::Projected => PROJECTED_STREAMS,
        };
        let versions = [
            (FORMAT.to_string(), format.to_string()),
            (
                "program_version".to_string(),
                env!("CARGO_PKG_VERSION").to_string(),
            ),
            ("streams".to_string(), streams.to_string()),
        ];
        let absent = grid.absent().unwrap_or_default();
        let absent = (!absent.is_empty()).then(|| (ABSENT.to_string(), counts(&absent)));
        // Each entry is one line of the attribute.
        let extra = extra
            .iter()
            .map(|(key, value)| (key.clone(), value.replace('\n', " ")));
        Self {
            entries: versions
                .into_iter()
                .chain(settings.entries())
                .chain(absent)
                .chain(extra)
                .collect(),
        }
    }

    /// Reads the text of an identity.
    fn read(text: &str) -> Self {
        let lines = text.lines().filter_map(|line| line.split_once(" = "));
        Self {
            entries: lines
                .map(|(key, value)| Spelling::Present.entry(key, value))
                .collect(),
        }
    }

    /// All entries as lines `key = value`, respelled as in version 0.1.
    fn text(&self) -> String {
        let lines = self.entries.iter().map(|(key, value)| {
            let (key, value) = Spelling::Former.entry(key, value);
            format!("{key} = {value}")
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// SHA-256 of the text, which enters every commit mark.
    pub(super) fn digest(&self) -> [u8; 32] {
        Sha256::digest(self.text()).into()
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
            // reflectance and transmittance do not depend on it
            "run.view_rays" => true,
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

    /// Version of the layout; 0 if it is unknown.
    pub(super) fn format(&self) -> u32 {
        let format = self.get(FORMAT).and_then(|text| text.parse().ok());
        format.unwrap_or_default()
    }

    /// Refuses a database whose format this version cannot read.
    pub(super) fn check_format(&self, path: &Path) -> Result<(), StoreError> {
        match self.format() {
            FILE_PER_JOB..=FORMAT_VERSION => Ok(()),
            _ => Err(StoreError::Differs {
                path: path.into(),
                key: FORMAT.into(),
                stored: self.get(FORMAT).unwrap_or("(none)").into(),
                requested: FORMAT_VERSION.to_string(),
            }),
        }
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

    fn has_axis(&self, axis: Parameter) -> bool {
        self.get(&format!("axes.{}", axis.key())).is_some()
    }
}

/// The identity of a database and the settings of its grid.
#[derive(Debug, Clone)]
pub(super) struct Description {
    pub(super) identity: Identity,
    settings: GridSettings,
    /// The canonical grid file.
    pub(super) config: String,
}

impl Description {
    /// The description of the database of `grid` in the layout of version `format`. `extra` has
    /// further inputs, such as the hashes of the data tables in use.
    pub(super) fn new(grid: &Grid, extra: &BTreeMap<String, String>, format: u32) -> Self {
        let settings = grid.describe();
        Self {
            identity: Identity::new(grid, &settings, extra, format),
            config: settings.to_config(),
            settings,
        }
    }

    /// The contents of the database at `path`.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if they contradict each other.
    pub(super) fn contents(&self, path: &Path) -> Result<Contents, StoreError> {
        let settings = &self.settings;
        let all_axes = settings.axes().ok_or_else(|| StoreError::Damaged {
            path: path.join("zarr.json"),
            reason: "attribute \"config\" does not describe the grains".into(),
        })?;
        let (views, axes) = settings.views(&all_axes);
        Ok(Contents {
            absent: self.identity.absent(&axes, path)?,
            views: views.map(|views| views.axes).unwrap_or_default(),
            axes,
            size_axis: settings.size_axis(),
            wavelengths_nm: settings.wavelengths.values_nm.clone(),
            engine: settings.run.engine,
            diffuse: settings.axes.diffuse,
            format: self.identity.format(),
        })
    }

    /// The kind of substrate under the surface layer, including the layers below.
    pub(super) fn substrate(&self) -> SubstrateKind {
        let fixed = self.settings.fixed.properties();
        if !fixed.below.is_empty() {
            SubstrateKind::Layers
        } else if self.is_axis(Parameter::SubstrateReflectance) || fixed.substrate.is_some() {
            SubstrateKind::Reflecting
        } else {
            SubstrateKind::Black
        }
    }

    fn is_axis(&self, axis: Parameter) -> bool {
        self.settings.axes.has(axis)
    }

    /// Whether the identity has all settings of the canonical grid file.
    pub(super) fn agrees(&self) -> bool {
        let entries = self.settings.entries();
        let mut entries = entries.iter();
        entries.all(|(key, value)| self.identity.get(key) == Some(value))
    }

    /// What lies under the surface layer, in words.
    fn bottom_boundary(&self, spelling: Spelling) -> String {
        let fixed = self.settings.fixed.properties();
        let noun = match spelling {
            Spelling::Former => "ground",
            Spelling::Present => "substrate",
        };
        let lambertian = |which: &str| {
            format!("Lambertian {noun} {which}; transmittance is the light that stays in it")
        };
        let substrate = match &fixed.substrate {
            _ if self.is_axis(Parameter::SubstrateReflectance) => {
                lambertian("of the axis substrate_reflectance")
            }
            None => "black: light that leaves through the bottom does not come back".to_owned(),
            Some(substrate) => match substrate.reflectance {
                Reflectance::Spectrum(_) => {
                    lambertian("with the spectrum fixed.substrate of config")
                }
                Reflectance::Grey(_) => lambertian(&toml_text(substrate)),
            },
        };
        match fixed.below.is_empty() {
            true => substrate,
            false => format!("the layers of fixed.below, then {substrate}"),
        }
    }

    /// Attributes of the Zarr group.
    pub(super) fn attributes(&self) -> Map<String, Value> {
        self.attributes_in(Spelling::Present, &self.config)
    }

    /// Attributes of the Zarr group as version 0.1 wrote them.
    pub(super) fn former_attributes(&self) -> Map<String, Value> {
        let entries = self.settings.entries().into_iter();
        let entries = entries.map(|(key, value)| Spelling::Former.entry(&key, &value));
        let config = config_text(&entries.collect::<Vec<_>>());
        self.attributes_in(Spelling::Former, &config)
    }

    fn attributes_in(&self, spelling: Spelling, config: &str) -> Map<String, Value> {
        let GridSettings { run, model, .. } = &self.settings;
        // a file name may need other quotes in TOML, which the attribute keeps
        let water = toml_text(&model.water);
        let (_, engine) = spelling.entry("run.engine", &toml_text(run.engine.name()));
        let identity = &self.identity;
        let version = identity.get("program_version").unwrap_or_default();
        let format = identity.format();
        let mut units = String::new();
        let is_axis = |axis: &Parameter| !axis.is_optional() || self.is_axis(*axis);
        for axis in Parameter::ALL.into_iter().filter(is_axis) {
            let _ = write!(units, "{}: {}; ", axis.name(), axis.unit());
        }
        let illumination = if self.settings.axes.diffuse {
            "collimated; angle_deg is the polar angle of incidence, measured from the surface normal; those named diffuse: isotropic"
        } else {
            "collimated; angle_deg is the polar angle of incidence, measured from the surface normal"
        };
        let entries: [(&str, Value); 17] = [
            ("title", "Spectral database of snow".into()),
            ("program", PROGRAM.into()),
            ("program_version", version.into()),
            ("format_version", format.into()),
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
            ("bottom_boundary", self.bottom_boundary(spelling).into()),
            ("substrate", self.substrate().name().into()),
            ("ice_table", model.ice.as_str().into()),
            ("water_table", water.trim_matches('"').into()),
            ("engine", engine.trim_matches('"').into()),
            ("seed", run.seed.into()),
            ("rays", run.rays.into()),
            ("config", config.into()),
            ("config_sha256", hex(&Sha256::digest(config)).into()),
            ("identity", self.identity.text().into()),
        ];
        let mut attributes: Map<String, Value> = entries
            .into_iter()
            .map(|(key, value)| (key.to_string(), value))
            .collect();
        if let Some(given) = self.settings.size_axis() {
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

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::engine::Engine;
    use crate::grain::{SizeLaw, SizeMeasure};
    use crate::grid::tests::{small, with_extra};
    use crate::grid::{Fixed, GridViews, SizeAxis};
    use crate::optics::Carbon;
    use crate::transport::{Layer, Substrate};

    /// Grids of every engine and axis, and of every setting that not all grids have.
    fn grids() -> Vec<Grid> {
        let grid = || small(Engine::Hybrid);
        let optional = || {
            let optional = Parameter::ALL.into_iter();
            optional.filter(|axis| axis.is_optional() && !axis.is_view())
        };
        let fixed = |change: fn(&mut Fixed)| {
            let mut grid = grid();
            change(&mut grid.fixed);
            grid
        };
        let mut grids: Vec<_> = Engine::ALL.into_iter().map(small).collect();
        for axis in optional() {
            let mut grid = grid();
            grid.axes.set(axis, vec![0.25, 0.5]);
            grids.push(grid);
        }
        let mut all_axes = grid();
        for axis in optional() {
            all_axes.axes.set(axis, vec![0.25, 0.5]);
        }
        grids.push(all_axes);
        let mut views = grid();
        views.views = Some(GridViews {
            axes: Parameter::VIEWS.map(|axis| (axis, vec![0.0, 60.0])).into(),
            rays: 5,
        });
        grids.push(views);
        for measure in SizeMeasure::ALL {
            let mut grid = grid();
            let values = vec![30.0, 40.0];
            grid.size_axis = Some(SizeAxis { measure, values });
            grids.push(grid);
        }
        grids.push(fixed(|fixed| fixed.diffuse = true));
        grids.push(fixed(|fixed| fixed.substrate = Substrate::Grey(0.3)));
        grids.push(fixed(|fixed| {
            fixed.black_carbon = Some(Carbon::black(20.0))
        }));
        grids.push(fixed(|fixed| {
            fixed.black_carbon = Some(Carbon::black(1e-7))
        }));
        grids.push(with_extra(fixed(|fixed| {
            fixed.brown_carbon = Some(Carbon::black(1e17));
            fixed.black_carbon = Some(Carbon::black(0.0));
        })));
        let mut layered = grid();
        let jobs = layered.jobs().unwrap();
        let snow = layered.job(&jobs, 0).unwrap().snowpack.surface;
        let thickness_m = 0.05;
        layered.fixed.below = vec![Layer { thickness_m, snow }; 2];
        layered.spread.size_law = SizeLaw::Consistent;
        grids.push(layered);
        grids
    }

    fn read(attributes: Map<String, Value>) -> Description {
        let path = Path::new("database.zarr");
        let root = json!({ "attributes": attributes }).to_string();
        let stored = Stored::read(root.as_bytes(), path).unwrap();
        stored.describe(path).unwrap()
    }

    #[test]
    fn a_description_reads_back() {
        for grid in grids() {
            let extra = [("data.ice.csv".to_owned(), "0a".to_owned())].into();
            let written = Description::new(&grid, &extra, FORMAT_VERSION);
            let again = read(written.attributes());
            assert_eq!(again.identity, written.identity);
            assert_eq!(again.settings, written.settings);
            assert_eq!(again.settings.to_config(), again.config);
            assert_eq!(again.attributes(), written.attributes());
            let contents = again.contents(Path::new("")).unwrap();
            assert_eq!(contents.engine, grid.run.engine);
            assert_eq!(contents.size_axis, grid.size_axis);
            if grid.size_axis.is_none() {
                assert_eq!(contents.axes, grid.axes);
            }
        }
    }

    #[test]
    fn the_spelling_of_version_0_1_is_the_same_description() {
        for grid in grids() {
            let written = Description::new(&grid, &BTreeMap::new(), FORMAT_VERSION);
            let identity = written.identity.text();
            assert!(identity.contains("axes.angle_deg = ") && !identity.contains("hybrid"));
            let former = |text: &str| {
                let text = text.replace("incidence_angle_deg", "angle_deg");
                text.replace("\"hybrid\"", "\"doubling\"")
            };
            let attributes = written.former_attributes();
            assert_eq!(attributes["config"], former(&written.config));
            assert_ne!(attributes["engine"], "hybrid");
            let again = read(attributes.clone());
            assert_eq!(again.identity, written.identity);
            assert_eq!(again.settings, written.settings);
            assert_eq!(again.former_attributes(), attributes);
            assert!(again.agrees());
        }
    }

    #[test]
    fn a_config_that_cannot_be_read_is_named() {
        let written = Description::new(&small(Engine::Hybrid), &BTreeMap::new(), FORMAT_VERSION);
        for (old, new, reason) in [
            ("\"hybrid\"", "\"other\"", "unknown engine \"other\""),
            ("values_nm", "values", "missing field `values_nm`"),
            ("density_kg_m3", "density", "missing field `density_kg_m3`"),
        ] {
            let mut attributes = written.attributes();
            attributes.insert("config".into(), written.config.replace(old, new).into());
            let root = json!({ "attributes": attributes }).to_string();
            let stored = Stored::read(root.as_bytes(), Path::new("d")).unwrap();
            let error = stored.describe(Path::new("d")).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
