//! The grid of snows that is searched if none is given: from what was measured and what is known.
//!
//! Units are those of grid files (docs/formats.md). The default nodes span natural snow (5 to 120
//! m2/kg, 0 to 2500 ng/g of black carbon); snow beyond them is not found, and a value at an end
//! says so. The snow has one layer, is dry and lies on black ground, unless axes say otherwise.
use super::knowledge::{Belief, FreeParameter, KnownValue, Named};
use super::{MeasuredInput, RetrieveError};
use crate::config::grid;
use crate::grain::SizeMeasure;
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Scale};
use crate::units::HALF_SPACE_CM;

/// Nodes of an axis for which a range is stated.
const NODES: usize = 6;
/// Wavelengths up to which black carbon changes the colour of snow, nm.
const CARBON_NM: f64 = 900.0;
/// Nodes of black carbon, ng/g. Deep snow darkens like the square root of the mass of soot, from far
/// below 1 ng/g on, and look-ups between few nodes make it too bright (docs/retrieval.md).
const CARBON: [f64; 11] = [
    0.0, 1.0, 3.0, 10.0, 30.0, 70.0, 150.0, 300.0, 600.0, 1200.0, 2500.0,
];

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
    /// [`RetrieveError::Knowledge`] if statements contradict each other or the ranges of their
    /// parameters, or if the thickness of snow that transmits light or the range of an optional
    /// axis is not stated.
    pub fn new(request: &BoxRequest<'_>) -> Result<Self, RetrieveError> {
        request.check()?;
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
        // the coarsest grains may not fit into thin slabs
        let mut first = None;
        for left_out in 0..NODES {
            let text = request.text(is_deep, left_out)?;
            match grid::parse("what is known", &text) {
                Ok(_) if left_out == 0 => return Ok(Self { text, assumed }),
                Ok(_) => {
                    assumed.push("grains of less than a tenth of the thickness".into());
                    return Ok(Self { text, assumed });
                }
                Err(error) => first = first.or(Some(error)),
            }
        }
        let problem = first.map_or_else(String::new, |error| error.to_string());
        Err(RetrieveError::Knowledge(format!(
            "what is known gives no grid: {problem}"
        )))
    }
}

impl BoxRequest<'_> {
    /// The text of the grid file, without so many of the coarsest grains.
    fn text(&self, is_deep: bool, left_out: usize) -> Result<String, RetrieveError> {
        let request = self;
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
                Parameter::BlackCarbon if first_nm.is_some_and(|nm| nm < CARBON_NM) => &CARBON,
                _ => &[],
            };
            let (named, mut nodes) = request.axis(parameter, defaults)?;
            if parameter == Parameter::GrainSize && nodes.len() > left_out + 1 {
                match named {
                    Named::Measure(SizeMeasure::SpecificSurface) => nodes.drain(..left_out),
                    _ => nodes.drain(nodes.len() - left_out..),
                };
            }
            if !nodes.is_empty() {
                let values = list(&nodes, parameter == Parameter::Thickness);
                text += &format!("{} = {values}\n", named.name());
            }
        }
        if request.diffuse {
            text += "diffuse = true\n";
        }
        let nm = list(request.wavelengths_nm, false);
        text += &format!("\n[wavelengths]\nvalues_nm = {nm}\n");
        text += "\n[run]\nengine = \"hybrid\"\nrays = 8000\n";
        Ok(text)
    }

    /// Refuses statements that contradict each other or the ranges of the parameters.
    fn check(&self) -> Result<(), RetrieveError> {
        let wrong = |text: String| Err(RetrieveError::Knowledge(text));
        let stated = |a: &[Named]| -> Vec<Parameter> { a.iter().map(|n| n.parameter()).collect() };
        let free: Vec<Named> = self.free.iter().map(|free| free.named).collect();
        let known: Vec<Named> = self.fix.iter().map(|known| known.named).collect();
        let all = stated(&[free, known].concat());
        if let Some(twice) = (1..all.len()).find(|i| all[..*i].contains(&all[*i])) {
            let name = all[twice].key();
            return wrong(format!("{name} is stated twice; remove one statement"));
        }
        for input in self.inputs {
            for own in &input.fixed {
                let parameter = own.named.parameter();
                let name = parameter.key();
                if all.contains(&parameter) {
                    return wrong(format!(
                        "{name} is stated for {} and for all spectra; remove one statement",
                        input.name
                    ));
                }
                let has = |input: &&MeasuredInput| {
                    let mut names = input.fixed.iter().map(|known| known.named.parameter());
                    names.any(|other| other == parameter)
                };
                let count = self.inputs.iter().filter(has).count();
                if count < self.inputs.len() {
                    let of = self.inputs.len();
                    return wrong(format!(
                        "{name} is known for {count} of {of} spectra; give it for each of them"
                    ));
                }
            }
        }
        if self.diffuse && !self.says_nothing(Parameter::Incidence) {
            return wrong(
                "--diffuse and an incidence angle contradict each other; remove one".into(),
            );
        }
        let own = self.inputs.iter().flat_map(|input| &input.fixed);
        for known in self.fix.iter().chain(own) {
            let (name, value) = (known.named.name(), known.value);
            let allowed = known.named.parameter().record().allowed;
            let half_space = value == f64::INFINITY && name == Parameter::Thickness.key();
            match known.named {
                Named::Axis(_) if half_space || allowed.contains(value) => {}
                Named::Axis(_) => {
                    return wrong(format!("{name} = {value} is out of range: {allowed}"));
                }
                Named::Measure(_) if value > 0.0 && value.is_finite() => {}
                Named::Measure(_) => return wrong(format!("{name} = {value} must be above 0")),
            }
        }
        for free in self.free {
            let (name, allowed) = (free.named.name(), free.named.parameter().record().allowed);
            let is_axis = matches!(free.named, Named::Axis(_));
            let outside = |value: f64| !value.is_finite() || is_axis && !allowed.contains(value);
            match free.belief {
                Belief::Range([min, max]) if outside(min) || outside(max) => {
                    return wrong(format!("{name} = {min}..{max} is out of range: {allowed}"));
                }
                Belief::Normal([mean, sd]) if outside(mean) => {
                    return wrong(format!("{name} = {mean}+-{sd} is out of range: {allowed}"));
                }
                Belief::Axis if name == Parameter::Thickness.key() => {
                    return wrong(format!(
                        "the range of {name} is not stated; write --free {name}=MIN..MAX"
                    ));
                }
                _ => {}
            }
        }
        Ok(())
    }

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

    /// What an axis holds and its nodes, increasing; none if the grid does not need the axis.
    fn axis(
        &self,
        parameter: Parameter,
        defaults: &[f64],
    ) -> Result<(Named, Vec<f64>), RetrieveError> {
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
        let spread = |ends: [f64; 2]| match parameter {
            Parameter::BlackCarbon => carbon(ends),
            _ => scale.spread(ends, NODES),
        };
        let mut nodes = match free.map(|free| free.belief) {
            _ if self.is_known(parameter) => Vec::new(),
            Some(Belief::Range(ends)) => spread(ends),
            Some(Belief::Normal([mean, sd])) => {
                let is_size = parameter == Parameter::GrainSize;
                // sizes in proportion, because they are above 0
                let ratio = libm::exp(3.0 * sd / mean);
                let [low, high] = match is_size {
                    true => [mean / ratio, mean * ratio],
                    false => [mean - 3.0 * sd, mean + 3.0 * sd],
                };
                let ends = match named {
                    Named::Measure(_) => [low, high],
                    // not quite to an end that is excluded
                    Named::Axis(_) => [
                        low.max(
                            allowed.min
                                + if allowed.open[0] {
                                    0.01 * (mean - allowed.min)
                                } else {
                                    0.0
                                },
                        ),
                        high.min(
                            allowed.max
                                - if allowed.open[1] {
                                    0.01 * (allowed.max - mean)
                                } else {
                                    0.0
                                },
                        ),
                    ],
                };
                spread(ends)
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
        Ok((named, nodes))
    }
}

/// Both ends, and the nodes of black carbon between them, ng/g; beyond the last each is double.
fn carbon([first, last]: [f64; 2]) -> Vec<f64> {
    let beyond = std::iter::successors(Some(2.0 * CARBON[10]), |node| Some(2.0 * node));
    let all = CARBON.into_iter().chain(beyond);
    let below = all.take_while(|node| *node < last);
    let between = below.filter(|node| *node > first);
    [first].into_iter().chain(between).chain([last]).collect()
}

/// The list as TOML; of thicknesses, a half space is `inf`.
fn list(values: &[f64], thicknesses: bool) -> String {
    let value = |x: &f64| match thicknesses && *x >= HALF_SPACE_CM {
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
        assert_eq!(nodes(&found.text, Parameter::BlackCarbon), CARBON);
        assert!(nodes(&found.text, Parameter::Temperature).is_empty());
        let diffuse = of(&[(R, &[])], &[], &[], true).unwrap().text;
        assert_eq!(nodes(&diffuse, Parameter::Incidence), [0.0]);
        assert!(grid::parse("x.toml", &diffuse).unwrap().grid.fixed.diffuse);
    }

    #[test]
    fn known_values_are_nodes() {
        let inputs: [(_, &[&str]); 2] = [(R, &["thickness_cm=34"]), (T, &["thickness_cm=2.5"])];
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
        let carbon = |free: &str| {
            let found = of(&[(R, &[])], &[free], &[], false).unwrap();
            nodes(&found.text, Parameter::BlackCarbon)
        };
        let clean = carbon("black_carbon_ng_g=0..20");
        assert_eq!(clean, [0.0, 1.0, 3.0, 10.0, 20.0]);
        assert_eq!(
            carbon("black_carbon_ng_g=12+-4"),
            [0.0, 1.0, 3.0, 10.0, 24.0]
        );
        assert_eq!(carbon("black_carbon_ng_g=40..50"), [40.0, 50.0]);
        let dark = carbon("black_carbon_ng_g=1200..12000");
        assert_eq!(dark, [1200.0, 2500.0, 5000.0, 10000.0, 12000.0]);
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
            "grain_size_um is stated twice",
        );
        wrong(&["absorber_ug_g=0..10"], &[], R, "substance");
        wrong(&["thickness_cm"], &[], R, "--free thickness_cm=MIN..MAX");
        wrong(&["thickness_cm=1..inf"], &[], R, "out of range");
        wrong(
            &["facetness=5+-0.1"],
            &[],
            R,
            "facetness = 5+-0.1 is out of range: 0 to 1",
        );
        wrong(
            &[],
            &["facetness=3"],
            R,
            "facetness = 3 is out of range: 0 to 1",
        );
        wrong(&[], &["ssa_m2_kg=-3"], R, "above 0");
        wrong(
            &["facetness"],
            &["facetness=0.3"],
            R,
            "facetness is stated twice",
        );
        wrong(
            &[],
            &["thickness_cm=2", "thickness_cm=inf"],
            R,
            "stated twice",
        );
        wrong(
            &[],
            &["temperature_c=-7", "ssa_m2_kg=20"],
            R,
            "gives no grid",
        );
        let both: [(_, &[&str]); 2] = [(R, &["thickness_cm=3"]), (R, &[])];
        let error = of(&both, &[], &[], false).unwrap_err();
        assert!(error.contains("known for 1 of 2 spectra"), "{error}");
        let mixed: [(_, &[&str]); 2] = [(R, &["ssa_m2_kg=20"]), (R, &["grain_size_um=300"])];
        let error = of(&mixed, &[], &[], false).unwrap_err();
        assert!(error.contains("several ways"), "{error}");
        let error = of(&both[..1], &[], &["thickness_cm=2"], false).unwrap_err();
        assert!(error.contains("for x and for all spectra"), "{error}");
        let error = of(&[(R, &["incidence_angle_deg=3"])], &[], &[], true).unwrap_err();
        assert!(error.contains("contradict"), "{error}");
    }

    /// Grains must fit into the slab, and priors end where parameters do.
    #[test]
    fn nodes_are_cut_to_what_is_possible() {
        let sizes = |free: &[&str], cm: &str| {
            let found = of(&[(R, &[])], free, &[cm], false).unwrap();
            nodes(&found.text, Parameter::GrainSize)
        };
        for cm in [0.3, 0.8, 1.0, 2.5] {
            let sizes = sizes(&[], &format!("thickness_cm={cm}"));
            assert!(
                sizes.len() > 2 && sizes.iter().all(|um| *um <= 1000.0 * cm),
                "{sizes:?}"
            );
        }
        assert!(sizes(&["grain_size_um=100..4000"], "thickness_cm=3").len() > 2);
        assert!(sizes(&["ssa_m2_kg=10+-5"], "thickness_cm=3").len() > 2);
        for free in [
            "incidence_angle_deg=85+-3",
            "grain_size_um=2000+-1000",
            "thickness_cm=10+-4",
        ] {
            assert!(of(&[(R, &[])], &[free], &[], false).is_ok(), "{free}");
        }
        let most = of(&[(R, &[])], &[], &["black_carbon_ng_g=1e9"], false).unwrap();
        assert_eq!(nodes(&most.text, Parameter::BlackCarbon), [1e9]);
    }
}
