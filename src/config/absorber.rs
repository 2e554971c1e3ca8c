//! Light-absorbing substances in snow: the tables `[[layer.absorber]]`.
use std::path::Path;
use std::sync::Arc;

use crate::optics::{
    Absorber, Carbon, ImpurityMass, MassAbsorption, ParticleScattering, SPECIES, Species,
};
use crate::spectrum::{Table, TableError};
use crate::transport::Model;

use super::check;
use super::document::Document;
use super::error::{ConfigError, Problem};
use super::keys::{AbsorberKeys, CONCENTRATIONS, CarbonKeys, EfficiencyKeys, LayerKeys};
use super::shared::exclusive;

/// Header of a file of mass absorption efficiencies.
const HEADER: [&str; 2] = ["wavelength_nm", "mac_m2_g"];
/// Largest mass absorption efficiency, m2/g.
pub(super) const MAX_EFFICIENCY: f64 = 1000.0;
/// Species that are the same as the tables of these names.
const CARBON: [&str; 2] = ["black_carbon", "brown_carbon"];

/// The keys of all absorbers of a snow.
pub(super) struct Keys<'a> {
    pub(super) carbon: [Option<&'a CarbonKeys>; 2],
    pub(super) others: &'a [AbsorberKeys],
    /// Whether an axis may give the mass of the first of the others.
    pub(super) may_be_axis: bool,
}

impl<'a> From<&'a LayerKeys> for Keys<'a> {
    fn from(keys: &'a LayerKeys) -> Self {
        Self {
            carbon: [keys.black_carbon.as_ref(), keys.brown_carbon.as_ref()],
            others: &keys.absorber,
            may_be_axis: false,
        }
    }
}

/// Black carbon, brown carbon and other absorbers of the snow in the table `table`. Paths are
/// relative to `directory`; a note on each file that is read is added to `notes`.
pub(super) fn absorbers(
    document: &Document,
    table: &str,
    keys: &Keys,
    at: (&Path, &[f64]),
    notes: &mut Vec<String>,
) -> Result<([Option<Carbon>; 2], Vec<Absorber>), ConfigError> {
    let mut carbons = [None; 2];
    let usual = [Carbon::black(0.0), Carbon::brown(0.0)];
    for (i, keys) in keys.carbon.iter().enumerate() {
        if let Some(keys) = keys {
            let key = format!("{table}.{}", CARBON[i]);
            carbons[i] = Some(carbon(document, &key, keys, usual[i])?);
        }
    }
    let mut others = Vec::new();
    for (i, other) in keys.others.iter().enumerate() {
        let key = format!("{table}.absorber[{i}]");
        let has_mass = other.concentration_ng_g.or(other.concentration_ug_g);
        let by_axis = keys.may_be_axis && i == 0 && has_mass.is_none();
        let mut found = absorber(document, &key, other, at, notes)?;
        found.concentration_ng_g = concentration(document, &key, other, by_axis)?;
        let species = other.species.as_deref();
        match CARBON.iter().position(|name| species == Some(*name)) {
            Some(kind) if !by_axis && found.scattering.is_none() => {
                if carbons[kind].is_some() {
                    let problem = format!("is in the snow twice: {} is given too", CARBON[kind]);
                    let help = "add the two masses, and remove one of the tables";
                    let key = format!("{key}.species");
                    return Err(document.error(&key, Problem::Contradiction(problem), help));
                }
                carbons[kind] = Some(Carbon {
                    concentration_ng_g: found.concentration_ng_g,
                    sedimentation: found.sedimentation,
                    per_wet_mass: found.per_wet_mass,
                    ..usual[kind]
                });
            }
            _ => others.push(found),
        }
    }
    Ok((carbons, others))
}

/// Warns of the default `impurity_mass`, with which an absorber absorbs less than its mass.
pub(super) fn remark_mass(document: &Document, model: &Model, warnings: &mut Vec<String>) {
    const KEY: &str = "model.impurity_mass";
    if model.impurity_mass == ImpurityMass::Varsa2025 && !document.has(KEY) {
        let remark = "is varsa2025 by default: an absorber absorbs as if its phase filled the snow, less than its mass does; set it to conserved, or to varsa2025 to keep that (docs/absorbers.md)";
        warnings.push(document.warning(KEY, remark.to_owned()));
    }
}

/// The carbon described by the table `table`; `usual` has the default values.
fn carbon(
    document: &Document,
    table: &str,
    keys: &CarbonKeys,
    usual: Carbon,
) -> Result<Carbon, ConfigError> {
    let efficiency = keys.mass_absorption_efficiency_m2_g;
    let reference = keys.reference_wavelength_nm;
    Ok(Carbon {
        concentration_ng_g: keys.concentration_ng_g,
        sedimentation: keys.sedimentation.unwrap_or(usual.sedimentation),
        mass_absorption_efficiency_m2_g: efficiency
            .unwrap_or(usual.mass_absorption_efficiency_m2_g),
        reference_wavelength_nm: reference.unwrap_or(usual.reference_wavelength_nm),
        angstrom_exponent: keys.angstrom_exponent.unwrap_or(usual.angstrom_exponent),
        per_wet_mass: per_wet_mass(document, table, &keys.concentration_per)?,
    })
}

fn per_wet_mass(document: &Document, table: &str, given: &str) -> Result<bool, ConfigError> {
    let key = format!("{table}.concentration_per");
    check::choice(document, &key, given, &CONCENTRATIONS, "")?;
    Ok(given == CONCENTRATIONS[1])
}

/// The mass of the absorber in `table` per mass of snow, ng/g; 0 if an axis gives it.
pub(super) fn concentration(
    document: &Document,
    table: &str,
    keys: &AbsorberKeys,
    by_axis: bool,
) -> Result<f64, ConfigError> {
    let [ng, ug] = ["concentration_ng_g", "concentration_ug_g"].map(|k| format!("{table}.{k}"));
    exclusive(document, &ng, &ug)?;
    match (keys.concentration_ng_g, keys.concentration_ug_g) {
        (None, None) if by_axis => Ok(0.0),
        (None, None) => {
            let help = "give the mass of the absorber per mass of snow as concentration_ng_g (ng/g) or concentration_ug_g (ug/g)";
            Err(document.error(&ng, Problem::Missing, help))
        }
        (ng, ug) => Ok(ng.or(ug.map(|ug| ug * 1e3)).unwrap_or_default()),
    }
}

/// The absorber described by `table`, without its mass.
fn absorber(
    document: &Document,
    table: &str,
    keys: &AbsorberKeys,
    at: (&Path, &[f64]),
    notes: &mut Vec<String>,
) -> Result<Absorber, ConfigError> {
    let key = |name: &str| format!("{table}.{name}");
    exclusive(document, &key("phase"), &key("sedimentation"))?;
    let (name, mass_absorption) = efficiency(document, table, keys, at, notes)?;
    let sedimentation = match (keys.phase.as_deref(), keys.sedimentation) {
        (Some("pores"), _) => 0.0,
        (_, share) => share.unwrap_or(1.0),
    };
    Ok(Absorber {
        name: keys.name.clone().unwrap_or(name),
        concentration_ng_g: 0.0,
        sedimentation,
        mass_absorption,
        per_wet_mass: per_wet_mass(document, table, &keys.concentration_per)?,
        scattering: scattering(document, table, keys, sedimentation)?,
    })
}

/// Scattering by the particles of an absorber, of which the share `sedimentation` is in the ice.
fn scattering(
    document: &Document,
    table: &str,
    keys: &AbsorberKeys,
    sedimentation: f64,
) -> Result<Option<ParticleScattering>, ConfigError> {
    const EFFICIENCY: &str = "mass_scattering_efficiency_m2_g";
    let key = |name: &str| format!("{table}.{name}");
    match (
        keys.mass_scattering_efficiency_m2_g,
        keys.asymmetry_parameter,
    ) {
        (None, None) => Ok(None),
        (None, Some(_)) => {
            let help = "give how much the particles scatter, or remove asymmetry_parameter";
            Err(document.error(&key(EFFICIENCY), Problem::Missing, help))
        }
        (Some(_), None) => {
            let help = "add it: from -0.95 (back) to 0.95 (forward); dust has about 0.7";
            Err(document.error(&key("asymmetry_parameter"), Problem::Missing, help))
        }
        (Some(_), Some(_)) if sedimentation == 1.0 => {
            let problem = "has no effect on particles inside the ice".to_owned();
            let help = "set phase = \"pores\", or sedimentation below 1; or remove it";
            Err(document.error(&key(EFFICIENCY), Problem::Contradiction(problem), help))
        }
        (Some(m2_g), Some(asymmetry)) => Ok(Some(ParticleScattering { m2_g, asymmetry })),
    }
}

/// The mass absorption efficiency and a name for it.
fn efficiency(
    document: &Document,
    table: &str,
    keys: &AbsorberKeys,
    (directory, wavelengths_nm): (&Path, &[f64]),
    notes: &mut Vec<String>,
) -> Result<(String, MassAbsorption), ConfigError> {
    const EFFICIENCY: &str = "mass_absorption_efficiency_m2_g";
    let key = |name: &str| format!("{table}.{name}");
    let refuse = |name: &str, problem: String, help: &str| {
        document.error(&key(name), Problem::Contradiction(problem), help)
    };
    for [a, b] in [
        ["species", "file"],
        ["species", EFFICIENCY],
        ["file", EFFICIENCY],
    ] {
        exclusive(document, &key(a), &key(b))?;
    }
    let is_power = matches!(
        keys.mass_absorption_efficiency_m2_g,
        Some(EfficiencyKeys::Number(_))
    );
    for (name, given) in [
        ("reference_wavelength_nm", keys.reference_wavelength_nm),
        ("angstrom_exponent", keys.angstrom_exponent),
    ] {
        if is_power && given.is_none() {
            let help = "add it: M (reference_wavelength_nm / wavelength)^angstrom_exponent is the law; for other spectra give a file";
            return Err(document.error(&key(name), Problem::Missing, help));
        }
        if !is_power && given.is_some() {
            let problem = format!("needs {EFFICIENCY} as one number");
            return Err(refuse(name, problem, "remove it, or give the number"));
        }
    }
    let named = |species: Option<&str>| species.map(|name| (name.to_owned(), Species::find(name)));
    match (
        named(keys.species.as_deref()),
        &keys.file,
        &keys.mass_absorption_efficiency_m2_g,
    ) {
        (Some((name, None)), ..) => {
            let names: Vec<_> = SPECIES.iter().map(|species| species.name).collect();
            check::choice(document, &key("species"), &name, &names, "")?;
            Err(document.error(&key("species"), Problem::Missing, ""))
        }
        (Some((name, Some(species))), ..) => {
            let absorption = species.mass_absorption();
            let MassAbsorption::Table(spectrum) = &absorption else {
                return Ok((name, absorption));
            };
            let found = at_wavelengths(spectrum, wavelengths_nm)
                .map_err(|problem| refuse("species", problem, "choose other wavelengths"))?;
            Ok((name, found))
        }
        (None, Some(path), _) => {
            let path = directory.join(path);
            let found = read(&path).and_then(|spectrum| {
                notes.push(format!("read {}: {}", path.display(), about(&spectrum)));
                at_wavelengths(&spectrum, wavelengths_nm)
            });
            let help = "extend or correct the table, or choose other wavelengths";
            let found = found.map_err(|problem| refuse("file", problem, help))?;
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            Ok((stem.into_owned(), found))
        }
        (None, None, Some(EfficiencyKeys::Number(m2_g))) => {
            let law = MassAbsorption::Power {
                m2_g: *m2_g,
                reference_nm: keys.reference_wavelength_nm.unwrap_or_default(),
                angstrom_exponent: keys.angstrom_exponent.unwrap_or_default(),
            };
            Ok(("absorber".to_owned(), law))
        }
        (None, None, Some(EfficiencyKeys::List(values))) => {
            let (given, needed) = (values.len(), wavelengths_nm.len());
            if given != needed {
                let problem = format!("has {given} values for {needed} wavelengths");
                let help = "give one value for each wavelength, in the same order";
                return Err(refuse(EFFICIENCY, problem, help));
            }
            Ok(("absorber".to_owned(), spectrum(wavelengths_nm, values)))
        }
        (None, None, None) => {
            let help =
                format!("give species, file, or {EFFICIENCY}: how much the absorber absorbs");
            Err(document.error(&key("species"), Problem::Missing, help))
        }
    }
}

/// A spectrum with one value per wavelength; a power law that is constant for a single one.
fn spectrum(wavelengths_nm: &[f64], values: &[f64]) -> MassAbsorption {
    match (
        Table::from_column(wavelengths_nm, values),
        wavelengths_nm,
        values,
    ) {
        (Some(table), ..) => MassAbsorption::Table(Arc::new(table)),
        (None, nm, m2_g) => MassAbsorption::Power {
            m2_g: m2_g.first().copied().unwrap_or_default(),
            reference_nm: nm.first().copied().unwrap_or_default(),
            angstrom_exponent: 0.0,
        },
    }
}

fn about(spectrum: &Table) -> String {
    let (first, last) = spectrum.range();
    let rows = spectrum.abscissae().len();
    format!("mass absorption efficiency in m2/g, {rows} rows, {first} to {last} nm")
}

/// Reads a file of mass absorption efficiencies.
fn read(path: &Path) -> Result<Table, String> {
    checked(Table::read(path, &HEADER))
}

fn checked(table: Result<Table, TableError>) -> Result<Table, String> {
    let table = table.map_err(|error| format!("cannot be used: {error}"))?;
    let mut rows = table.abscissae().iter().zip(table.column(0));
    match rows.find(|(_, value)| !(0.0..=MAX_EFFICIENCY).contains(*value)) {
        None => Ok(table),
        Some((nm, value)) => Err(format!(
            "cannot be used: {value} m2/g at {nm} nm; allowed 0 to {MAX_EFFICIENCY} m2/g"
        )),
    }
}

/// The mass absorption efficiency, m2/g, at `wavelengths_nm` in the `text` of a file called `name`,
/// and what the file holds in words.
///
/// # Errors
/// What is wrong with the file, to follow its name.
pub(crate) fn of_text(
    name: &str,
    text: &str,
    wavelengths_nm: &[f64],
) -> Result<(Vec<f64>, String), String> {
    let table = checked(Table::parse(name, text, &HEADER))?;
    Ok((values(&table, wavelengths_nm)?, about(&table)))
}

/// A spectrum at the wavelengths of the file, log-log between its rows.
fn at_wavelengths(table: &Table, wavelengths_nm: &[f64]) -> Result<MassAbsorption, String> {
    let values = values(table, wavelengths_nm)?;
    Ok(spectrum(wavelengths_nm, &values))
}

fn values(table: &Table, wavelengths_nm: &[f64]) -> Result<Vec<f64>, String> {
    let values = wavelengths_nm.iter().map(|nm| table.log_log(0, *nm));
    values.collect::<Option<Vec<f64>>>().ok_or_else(|| {
        let (min, max) = table.range();
        let ends = [wavelengths_nm.first(), wavelengths_nm.last()];
        let [first, last] = ends.map(|nm| nm.copied().unwrap_or_default());
        format!("covers {min} to {max} nm, but the wavelengths run from {first} to {last} nm")
    })
}
