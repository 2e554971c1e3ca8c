//! The grid of snows that is searched if none is given: from what was measured and what is known.
use super::knowledge::{Belief, FreeParameter, KnownValue, Named};
use super::{MeasuredInput, RetrieveError};
use crate::grain::SizeMeasure;
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Scale};
use crate::units::HALF_SPACE_CM;

/// Nodes of an axis for which a range is stated.
const NODES: usize = 6;
/// Wavelengths up to which black carbon changes the colour of snow, nm.
const CARBON_NM: f64 = 900.0;

/// What was measured, as far as the grid depends on it.
#[derive(Debug, Clone, Copy)]
pub struct BoxRequest<'a> {
    /// The quantity and the known values of each spectrum; their values do not matter.
    pub inputs: &'a [MeasuredInput],
    /// Wavelengths of the database, nm, strictly increasing.
    pub wavelengths_nm: &'a [f64],
    /// Priors.
    pub free: &'a [FreeParameter],
    /// Values that are known for all spectra.
    pub fix: &'a [KnownValue],
    /// Whether the light was diffuse.
    pub diffuse: bool,
}

/// A grid file, and what it assumes.
#[derive(Debug, Clone, PartialEq)]
pub struct DefaultBox {
    /// The text of the grid file.
    pub text: String,
    /// What the measurement does not say and the grid takes as known, one phrase each.
    pub assumed: Vec<String>,
}

impl DefaultBox {
    /// The grid of the snows that may have these spectra.
    ///
    /// # Errors
    /// [`RetrieveError::Knowledge`] if the thickness of snow that transmits light is not stated,
    /// or the range of an optional axis.
    pub fn new(request: &BoxRequest<'_>) -> Result<Self, RetrieveError> {
        let mut assumed = Vec::new();
        let transmits = |input: &MeasuredInput| input.quantity == Quantity::Transmittance;
        let mut thicknesses = request.known(Parameter::Thickness);
        if thicknesses.is_empty() && request.free(Parameter::Thickness).is_none() {
            if request.inputs.iter().any(transmits) {
                return Err(RetrieveError::Knowledge(
                    "the snow transmits light, but its thickness is not stated; add --fix thickness_cm=VALUE or --free thickness_cm=MIN..MAX".into(),
                ));
            }
            assumed.push("snow so deep that the ground does not matter".into());
            thicknesses.push((Named::Axis(Parameter::Thickness), HALF_SPACE_CM));
        }
        let is_deep = request.free(Parameter::Thickness).is_none()
            && thicknesses.iter().all(|(_, cm)| *cm >= HALF_SPACE_CM);
        if is_deep && request.says_nothing(Parameter::Density) {
            assumed.push("300 kg/m3, which hardly matters in deep snow".into());
        }
        if request.says_nothing(Parameter::Incidence) {
            assumed.push(match request.diffuse {
                true => "diffuse light".into(),
                false => "sun at an unknown angle, 0 to 80 degrees from the normal".into(),
            });
        }
        let first_nm = request.wavelengths_nm.first().copied();
        let optional = Parameter::ALL
            .into_iter()
            .filter(|p| p.is_optional() && !p.is_view());
        let axes: Vec<Parameter> = Parameter::CORE.into_iter().chain(optional).collect();
        let mut text =
            "# Snows that `splitsnow retrieve` searches\nversion = 1\n\n[axes]\n".to_owned();
        for parameter in axes {
            let defaults: &[f64] = match parameter {
                Parameter::Facetness => &[0.05, 0.2, 0.5, 0.95],
                // larger grains do not fit into thin slabs
                Parameter::GrainSize => match (request.size(), is_deep) {
                    (Named::Axis(_), true) => &[60.0, 100.0, 180.0, 320.0, 560.0, 1000.0, 1800.0],
                    (Named::Axis(_), false) => &[60.0, 100.0, 180.0, 320.0, 560.0, 1000.0],
                    (_, true) => &[5.0, 8.0, 13.0, 20.0, 32.0, 50.0, 80.0, 120.0],
                    (_, false) => &[8.0, 13.0, 20.0, 32.0, 50.0, 80.0, 120.0],
                },
                Parameter::Density if is_deep => &[300.0],
                Parameter::Density => &[100.0, 180.0, 300.0, 450.0],
                Parameter::Thickness => &[HALF_SPACE_CM],
                Parameter::Incidence if request.diffuse => &[0.0],
                Parameter::Incidence => &[0.0, 30.0, 50.0, 65.0, 80.0],
                Parameter::BlackCarbon if first_nm.is_some_and(|nm| nm < CARBON_NM) => {
                    &[0.0, 30.0, 150.0, 600.0, 2500.0]
                }
                _ => &[],
            };
            let (key, nodes) = request.axis(parameter, defaults)?;
            if !nodes.is_empty() {
                text += &format!("{key} = {}\n", list(&nodes));
            }
        }
        if request.diffuse {
            text += "diffuse = true\n";
        }
        text += &format!(
            "\n[wavelengths]\nvalues_nm = {}\n",
            list(request.wavelengths_nm)
        );
        text += "\n[run]\nengine = \"hybrid\"\nrays = 8000\n";
        Ok(Self { text, assumed })
    }
}

impl BoxRequest<'_> {
    /// The known values of a parameter, for all spectra and for single ones.
    fn known(&self, parameter: Parameter) -> Vec<(Named, f64)> {
        let own = self.inputs.iter().flat_map(|input| &input.fixed);
        let all = self.fix.iter().chain(own);
        let of = all.filter(|known| known.named.parameter() == parameter);
        of.map(|known| (known.named, known.value)).collect()
    }

    /// Whether each spectrum has a known value of the parameter.
    fn is_known(&self, parameter: Parameter) -> bool {
        let names = |known: &KnownValue| known.named.parameter() == parameter;
        self.fix.iter().any(names)
            || self
                .inputs
                .iter()
                .all(|input| input.fixed.iter().any(names))
    }

    fn free(&self, parameter: Parameter) -> Option<&FreeParameter> {
        let mut free = self.free.iter();
        free.find(|free| free.named.parameter() == parameter)
    }

    fn says_nothing(&self, parameter: Parameter) -> bool {
        self.known(parameter).is_empty() && self.free(parameter).is_none()
    }

    /// The measure of the grains, unless it is stated: their specific surface area, or their length
    /// where the same area would mean other lengths along another axis.
    fn size(&self) -> Named {
        let others = [Parameter::Sphericity, Parameter::Temperature];
        match others.into_iter().all(|other| self.says_nothing(other)) {
            true => Named::Measure(SizeMeasure::SpecificSurface),
            false => Named::Axis(Parameter::GrainSize),
        }
    }

    /// The key of an axis and its nodes, increasing; none if the grid does not need the axis.
    fn axis(
        &self,
        parameter: Parameter,
        defaults: &[f64],
    ) -> Result<(&'static str, Vec<f64>), RetrieveError> {
        let known = self.known(parameter);
        let free = self.free(parameter);
        let mut names = known.iter().map(|(named, _)| *named);
        let stated = names.next().or(free.map(|free| free.named));
        let standard = match parameter {
            Parameter::GrainSize => self.size(),
            other => Named::Axis(other),
        };
        let named = stated.unwrap_or(standard);
        if parameter == Parameter::Absorber && stated.is_some() {
            return Err(RetrieveError::Knowledge(format!(
                "{} needs its substance; give a grid with --within",
                named.name()
            )));
        }
        if names
            .chain(free.map(|free| free.named))
            .any(|other| other != named)
        {
            return Err(RetrieveError::Knowledge(format!(
                "the size of the grains is stated in several ways; state it as {} only, or give a grid with --within",
                named.name()
            )));
        }
        let scale = match parameter {
            Parameter::GrainSize => Scale::Log,
            other => other.record().scale,
        };
        let allowed = parameter.record().allowed;
        let mut nodes = match free.map(|free| free.belief) {
            _ if self.is_known(parameter) => Vec::new(),
            Some(Belief::Range(ends)) => scale.spread(ends, NODES),
            Some(Belief::Normal([mean, sd])) => {
                let ends = [mean - 3.0 * sd, mean + 3.0 * sd];
                let ends = match named {
                    // in proportion, because these are above 0
                    Named::Measure(_) | Named::Axis(Parameter::GrainSize) => {
                        let ratio = libm::exp(3.0 * sd / mean);
                        [mean / ratio, mean * ratio]
                    }
                    Named::Axis(_) => ends.map(|end| end.clamp(allowed.min, allowed.max)),
                };
                scale.spread(ends, NODES)
            }
            Some(Belief::Axis) if defaults.is_empty() => {
                let name = named.name();
                return Err(RetrieveError::Knowledge(format!(
                    "{name} is unknown, but its range is not stated; write --free {name}=MIN..MAX"
                )));
            }
            Some(Belief::Axis) | None if named == standard => defaults.to_vec(),
            Some(Belief::Axis) | None => {
                let name = named.name();
                return Err(RetrieveError::Knowledge(format!(
                    "the range of {name} is not stated; write --free {name}=MIN..MAX, or use {}",
                    standard.name()
                )));
            }
        };
        nodes.extend(known.iter().map(|(_, value)| *value));
        if parameter == Parameter::Thickness && !known.is_empty() && free.is_none() {
            // nothing but the known thicknesses
            nodes = known.iter().map(|(_, value)| *value).collect();
        }
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        Ok((named.name(), nodes))
    }
}

/// The list as TOML; a half space is `inf`.
fn list(values: &[f64]) -> String {
    let value = |x: &f64| match *x >= HALF_SPACE_CM {
        true => "inf".to_owned(),
        false => format!("{x}"),
    };
    let values: Vec<String> = values.iter().map(value).collect();
    format!("[{}]", values.join(", "))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::config::grid;

    /// The box for spectra with these quantities and known values, `free` and `fix`; the lists
    /// are words of the command line.
    fn of(
        inputs: &[(Quantity, &[&str])],
        free: &[&str],
        fix: &[&str],
        diffuse: bool,
    ) -> Result<DefaultBox, String> {
        let known = |words: &[&str]| words.iter().map(|word| word.parse().unwrap()).collect();
        let inputs: Vec<MeasuredInput> = inputs
            .iter()
            .map(|(quantity, fixed)| MeasuredInput {
                name: "x".into(),
                quantity: *quantity,
                indices: Vec::new(),
                values: Vec::new(),
                uncertainties: Vec::new(),
                fixed: known(fixed),
            })
            .collect();
        let free: Vec<FreeParameter> = free.iter().map(|word| word.parse().unwrap()).collect();
        let fix: Vec<KnownValue> = known(fix);
        let request = BoxRequest {
            inputs: &inputs,
            wavelengths_nm: &[500.0, 862.5, 1030.0],
            free: &free,
            fix: &fix,
            diffuse,
        };
        DefaultBox::new(&request).map_err(|error| error.to_string())
    }

    /// The nodes of an axis in the grid file, which must be one.
    fn nodes(text: &str, parameter: Parameter) -> Vec<f64> {
        let file = grid::parse("box.toml", text).unwrap();
        assert_eq!(file.grid.wavelengths_nm, [500.0, 862.5, 1030.0]);
        file.grid.axes.values(parameter).to_vec()
    }

    const R: Quantity = Quantity::Reflectance;
    const T: Quantity = Quantity::Transmittance;

    #[test]
    fn without_any_knowledge_the_snow_is_deep() {
        let found = of(&[(R, &[])], &[], &[], false).unwrap();
        assert_eq!(found.assumed.len(), 3);
        assert_eq!(nodes(&found.text, Parameter::Thickness), [HALF_SPACE_CM]);
        assert_eq!(nodes(&found.text, Parameter::Density), [300.0]);
        assert_eq!(nodes(&found.text, Parameter::Incidence).len(), 5);
        assert_eq!(nodes(&found.text, Parameter::BlackCarbon).len(), 5);
        assert!(nodes(&found.text, Parameter::Temperature).is_empty());
        let diffuse = of(&[(R, &[])], &[], &[], true).unwrap().text;
        assert_eq!(nodes(&diffuse, Parameter::Incidence), [0.0]);
        assert!(grid::parse("x.toml", &diffuse).unwrap().grid.fixed.diffuse);
    }

    #[test]
    fn known_values_are_nodes() {
        let inputs: [(_, &[&str]); 2] = [
            (R, &["thickness_cm=34", "density_kg_m3=200"]),
            (T, &["thickness_cm=2.5"]),
        ];
        let fix = [
            "grain_size_um=250",
            "temperature_c=-7",
            "black_carbon_ng_g=0",
        ];
        let found = of(&inputs, &[], &fix, false).unwrap();
        assert_eq!(nodes(&found.text, Parameter::Thickness), [2.5, 34.0]);
        assert_eq!(nodes(&found.text, Parameter::GrainSize), [250.0]);
        assert_eq!(nodes(&found.text, Parameter::Temperature), [-7.0]);
        assert_eq!(nodes(&found.text, Parameter::BlackCarbon), [0.0]);
        // known of one spectrum only
        let densities = [100.0, 180.0, 200.0, 300.0, 450.0];
        assert_eq!(nodes(&found.text, Parameter::Density), densities);
        assert_eq!(found.assumed.len(), 1, "{:?}", found.assumed);
    }

    #[test]
    fn ranges_and_gaussians_are_covered() {
        let free = [
            "ssa_m2_kg=26+-4",
            "facetness=0.9+-0.1",
            "thickness_cm=2..20",
        ];
        let found = of(&[(T, &[])], &free, &[], false).unwrap();
        let ends = |parameter| {
            let nodes = nodes(&found.text, parameter);
            assert_eq!(nodes.len(), NODES);
            [nodes[0], nodes[NODES - 1]]
        };
        assert_eq!(ends(Parameter::Facetness), [0.9 - 3.0 * 0.1, 1.0]);
        assert_eq!(ends(Parameter::Thickness), [2.0, 20.0]);
        let [small, large] = ends(Parameter::GrainSize);
        assert!((large / small - libm::exp(24.0 / 26.0)).abs() < 0.02);
        let round = of(&[(R, &[])], &["sphericity=0.5..0.9"], &[], false)
            .unwrap()
            .text;
        assert_eq!(nodes(&round, Parameter::Sphericity).len(), NODES);
        assert_eq!(nodes(&round, Parameter::GrainSize)[0], 60.0);
    }

    #[test]
    fn what_is_missing_is_said() {
        let wrong = |free: &[&str], fix: &[&str], quantity, part: &str| {
            let error = of(&[(quantity, &[])], free, fix, false).unwrap_err();
            assert!(error.contains(part), "{error}");
        };
        wrong(&[], &[], T, "--fix thickness_cm=VALUE");
        wrong(
            &["water_saturation"],
            &[],
            R,
            "--free water_saturation=MIN..MAX",
        );
        wrong(&["grain_size_um"], &[], R, "--free grain_size_um=MIN..MAX");
        wrong(
            &["grain_size_um=100..400"],
            &["ssa_m2_kg=20"],
            R,
            "several ways",
        );
        wrong(&["absorber_ug_g=0..10"], &[], R, "substance");
    }
}
