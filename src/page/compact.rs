//! `open` and `lookup`: compact files.
use std::collections::BTreeMap;

use crate::config;
use crate::grain::TruncatedNormal;
use crate::grid::{AbsorberSettings, Fixed, Spread};
use crate::lookup::{Database, Lookup};
use crate::measurement::Quantity;
use crate::optics::Carbon;
use crate::parameter::{Parameter, Point};
use crate::retrieve::FileGrains;
use crate::transport::Substrate;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::refused::Refused;

/// Files kept open. The one opened first is closed for a new one.
const MOST_FILES: usize = 8;

#[derive(Debug, Deserialize)]
pub(super) struct OpenRequest {
    name: String,
}

#[derive(Debug, Serialize)]
pub(super) struct OpenedFile {
    id: u64,
    name: String,
    bytes: usize,
    axes: Vec<AxisAnswer>,
    wavelengths_nm: Vec<f64>,
    quantities: Vec<QuantityAnswer>,
    basis: &'static str,
    precision: &'static str,
    metadata: BTreeMap<String, String>,
}

#[derive(Debug, Serialize)]
struct AxisAnswer {
    name: &'static str,
    unit: &'static str,
    values: Vec<f64>,
}

#[derive(Debug, Serialize)]
struct QuantityAnswer {
    name: &'static str,
    components: usize,
}

#[derive(Debug, Deserialize)]
pub(super) struct LookupRequest {
    id: u64,
    point: BTreeMap<String, f64>,
}

#[derive(Debug, Serialize)]
pub(super) struct LookupAnswer {
    wavelengths_nm: Vec<f64>,
    reflectance: Option<Vec<f32>>,
    transmittance: Option<Vec<f32>>,
    sample: Option<Value>,
}

/// The compact files that are open.
#[derive(Debug, Default)]
pub(super) struct OpenFiles {
    /// Oldest first.
    files: Vec<OpenFile>,
    opened: u64,
}

#[derive(Debug)]
struct OpenFile {
    id: u64,
    database: Database,
    snow: Option<(Fixed, Spread)>,
    /// Look-ups at one point of the optional axes, per quantity.
    prepared: Option<(Point, [Option<Lookup>; 2])>,
}

impl OpenFiles {
    pub(super) fn open(
        &mut self,
        request: OpenRequest,
        bytes: &[u8],
    ) -> Result<OpenedFile, Refused> {
        let name = &request.name;
        let refuse = |error: &dyn std::fmt::Display| Refused::new(format!("{name}: {error}"));
        let database = Database::from_bytes(bytes).map_err(|error| refuse(&error))?;
        database
            .require_hemispherical()
            .map_err(|error| refuse(&error))?;
        self.opened += 1;
        if self.files.len() >= MOST_FILES {
            self.files.remove(0);
        }
        let stored = Quantity::ALL.into_iter().filter(|q| database.has(*q));
        let file = OpenedFile {
            id: self.opened,
            bytes: bytes.len(),
            axes: database.axes().iter().map(AxisAnswer::from).collect(),
            wavelengths_nm: database.wavelengths_nm().to_vec(),
            quantities: stored
                .map(|quantity| QuantityAnswer {
                    name: quantity.name(),
                    components: database.components(quantity),
                })
                .collect(),
            basis: database.basis_kind().name(),
            precision: database.precision().name(),
            metadata: database.metadata().clone(),
            name: request.name,
        };
        self.files.push(OpenFile {
            id: self.opened,
            snow: snow_of(&database),
            database,
            prepared: None,
        });
        Ok(file)
    }

    pub(super) fn lookup(&mut self, request: &LookupRequest) -> Result<LookupAnswer, Refused> {
        let file = self.files.iter_mut().find(|file| file.id == request.id);
        let file = file.ok_or_else(|| {
            Refused::new(format!(
                "the file number {} is not open; open it again",
                request.id
            ))
        })?;
        let mut point = Point::default();
        for (name, value) in &request.point {
            let parameter = Parameter::named(name)
                .ok_or_else(|| Refused::new(format!("no axis is named `{name}`")))?;
            point.set(parameter, *value);
        }
        file.lookup(point)
    }
}

impl From<(Parameter, &[f64])> for AxisAnswer {
    fn from((parameter, values): (Parameter, &[f64])) -> Self {
        Self {
            name: parameter.key(),
            unit: parameter.unit(),
            values: values.to_vec(),
        }
    }
}

impl OpenFile {
    fn lookup(&mut self, point: Point) -> Result<LookupAnswer, Refused> {
        let conditions = point.optional();
        if self
            .prepared
            .as_ref()
            .is_none_or(|(prepared, _)| *prepared != conditions)
        {
            let database = self.database.at(conditions).map_err(Refused::new)?;
            let prepare = |quantity| match database.has(quantity) {
                true => Lookup::new(&database, quantity).map(Some),
                false => Ok(None),
            };
            let prepared = [Quantity::Reflectance, Quantity::Transmittance].map(prepare);
            let [reflectance, transmittance] = prepared;
            let lookups = [
                reflectance.map_err(Refused::new)?,
                transmittance.map_err(Refused::new)?,
            ];
            self.prepared = Some((conditions, lookups));
        }
        let spectrum = |lookup: &Lookup| {
            let mut spectrum = vec![0.0; lookup.wavelengths()];
            lookup
                .spectrum(point, &mut spectrum)
                .map_err(Refused::new)?;
            Ok::<_, Refused>(spectrum)
        };
        let lookups = self.prepared.iter().flat_map(|(_, lookups)| lookups);
        let spectra: Result<Vec<_>, Refused> = lookups
            .map(|lookup| lookup.as_ref().map(spectrum).transpose())
            .collect();
        let mut spectra = spectra?.into_iter();
        let snow = self.snow.as_ref();
        Ok(LookupAnswer {
            wavelengths_nm: self.database.wavelengths_nm().to_vec(),
            reflectance: spectra.next().flatten(),
            transmittance: spectra.next().flatten(),
            sample: snow.and_then(|snow| sample(snow, &point, self.database.wavelengths_nm())),
        })
    }
}

/// The snow that the axes of a file do not give, and the widths of its distributions; `None` if
/// the file does not state them.
fn snow_of(database: &Database) -> Option<(Fixed, Spread)> {
    if let Some(grains) = FileGrains::of(database) {
        return Some((grains.grid().fixed.clone(), grains.grid().spread));
    }
    let text = database.metadata().get("scene")?;
    let scene = config::scene::parse("the compact file", text).ok()?.scene;
    Some((scene.fixed, scene.spread))
}

/// The snow at `point` as a sample under collimated light; `None` if it lies on other layers or
/// does not exist.
fn sample(
    (fixed, spread): &(Fixed, Spread),
    point: &Point,
    wavelengths_nm: &[f64],
) -> Option<Value> {
    let at = fixed.at(point, spread).ok()?;
    if !at.below.is_empty() {
        return None;
    }
    let facetness = spread
        .facetness_law(point.get(Parameter::Facetness)?)
        .ok()?;
    let size_um = point.get(Parameter::GrainSize)?;
    let half_um = spread.grain_size_half_width_um;
    let law = |law: &TruncatedNormal| json!({ "min": law.min(), "max": law.max(), "mean": law.mean(), "sd": law.sd() });
    let proportion = match at.shape.has_aspect_ratio() {
        true => "aspect_ratio",
        false => "sphericity",
    };
    let mut layer = json!({
        "thickness_cm": point.get(Parameter::Thickness)?,
        "density_kg_m3": point.get(Parameter::Density)?,
        "temperature_c": at.temperature_c,
        "water_saturation": at.water_saturation,
        "grain": [{
            "size_um": { "min": size_um - half_um, "max": size_um + half_um },
            "facetness": law(&facetness),
            "shape": at.shape.name(),
            proportion: law(&at.proportion),
        }],
    });
    let kinds = [
        ("black_carbon", at.black_carbon),
        ("brown_carbon", at.brown_carbon),
    ];
    for (name, carbon) in kinds {
        if let Some(carbon) = carbon {
            layer[name] = carbon_keys(&carbon);
        }
    }
    if !at.absorbers.is_empty() {
        let absorbers = at.absorbers.iter().map(AbsorberSettings::from);
        layer["absorber"] = json!(absorbers.collect::<Vec<_>>());
    }
    let mut sample = json!({
        "version": 1,
        "illumination": { "incidence_angle_deg": point.get(Parameter::Incidence)? },
        "wavelengths": { "values_nm": wavelengths_nm },
        "layer": [layer],
        "model": {
            "entry": at.model.entry.name(),
            "facets": at.model.facets.name(),
            "size_law": spread.size_law.name(),
            "layers": at.model.joining.name(),
            "carbon_law": at.model.carbon_law.name(),
            "impurity_mass": at.model.impurity_mass.name(),
            "ice": at.model.ice.name(),
            "water": at.model.water.name(),
        },
    });
    match at.substrate {
        Substrate::Black => {}
        Substrate::Grey(reflectance) => {
            sample["substrate"] = json!({ "reflectance": reflectance });
        }
        Substrate::Spectrum { table } => {
            let at = |nm: &f64| table.linear(0, *nm);
            let values: Option<Vec<f64>> = wavelengths_nm.iter().map(at).collect();
            sample["substrate"] = json!({ "reflectance": values? });
        }
    }
    Some(sample)
}

fn carbon_keys(carbon: &Carbon) -> Value {
    json!({
        "concentration_ng_g": carbon.concentration_ng_g,
        "sedimentation": carbon.sedimentation,
        "mass_absorption_efficiency_m2_g": carbon.mass_absorption_efficiency_m2_g,
        "reference_wavelength_nm": carbon.reference_wavelength_nm,
        "angstrom_exponent": carbon.angstrom_exponent,
        "concentration_per": if carbon.per_wet_mass { "wet_mass" } else { "dry_mass" },
    })
}
