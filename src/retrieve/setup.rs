//! Measured spectra, a compact file and what is known, joined to one problem.
use splitsnow_retrieval::{Emulator, Inverse, NoiseModel, Observation, Prior, Unknown, Whitening};

use super::knowledge::{Belief, FreeParameter, KnownValue, Named};
use super::{EmulatorError, FileGrains, MeasuredBands, RetrieveError};
use crate::grain::SizeMeasure;
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::{Parameter, Point};
use crate::units::{HALF_SPACE_CM, cm_text};

/// What the file covers of a parameter, as text.
fn covered(named: Named, first: f64, last: f64) -> String {
    let text = |value: f64| match named.parameter() {
        Parameter::Thickness => cm_text(value),
        _ => format!("{value:.6}"),
    };
    match first == last {
        true => format!("has {} only", text(first)),
        false => format!("covers {} to {}", text(first), text(last)),
    }
}

/// One measured spectrum at wavelengths of the compact file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredInput {
    /// Its name in messages and reports.
    pub name: String,
    /// What was measured.
    pub quantity: Quantity,
    /// Indices of the wavelengths of the file, or of the bands, increasing.
    pub indices: Vec<usize>,
    /// The values.
    pub values: Vec<f64>,
    /// Their standard uncertainties, where the measurement states them.
    pub uncertainties: Vec<Option<f64>>,
    /// What is known of this spectrum alone.
    pub fixed: Vec<KnownValue>,
}

/// What a [`Setup`] is made of.
#[derive(Debug, Clone, Copy)]
pub struct SetupRequest<'a> {
    /// The compact file.
    pub database: &'a Database,
    /// The measured spectra of one snow.
    pub inputs: &'a [MeasuredInput],
    /// Priors. Axes with several nodes that are in neither list are unknown in their whole range.
    pub free: &'a [FreeParameter],
    /// Values that are known for all spectra.
    pub fix: &'a [KnownValue],
    /// Errors of the measurements.
    pub noise: NoiseModel,
    /// The bands whose averages were measured; `None` for spectra.
    pub bands: Option<&'a MeasuredBands>,
}

/// A problem that is ready to be solved.
#[derive(Debug, Clone)]
pub struct Setup {
    pub(super) inputs: Vec<MeasuredInput>,
    pub(super) unknowns: Vec<Unknown>,
    /// Unknowns for which nothing was stated.
    pub(super) assumed: Vec<Parameter>,
    pub(super) grains: Option<FileGrains>,
    pub(super) noise: NoiseModel,
    pub(super) emulator_errors: Vec<(Quantity, EmulatorError)>,
    pub(super) bands: Option<MeasuredBands>,
    emulators: Vec<Emulator>,
    whitenings: Vec<Whitening>,
    points: Vec<Point>,
}

/// Known values by axis.
pub(super) struct Knowledge<'a> {
    database: &'a Database,
    grains: Option<&'a FileGrains>,
}

impl<'a> Knowledge<'a> {
    pub(super) fn new(database: &'a Database, grains: Option<&'a FileGrains>) -> Self {
        Self { database, grains }
    }

    /// Nodes of the axis of `named`.
    fn nodes(&self, named: Named) -> Result<&'a [f64], RetrieveError> {
        let parameter = named.parameter();
        match self.database.axes().values(parameter) {
            [] => {
                let (name, axes) = (named.name(), self.database.axes());
                let axes: Vec<_> = axes.iter().map(|(p, _)| p.key()).collect();
                Err(RetrieveError::Knowledge(format!(
                    "the compact file has no axis {name}: its value was fixed when the file was built; leave {name} out; the axes are {}",
                    axes.join(", ")
                )))
            }
            nodes => Ok(nodes),
        }
    }

    /// First and last value of an axis; of the thicknesses, without a half space.
    fn range(nodes: &[f64]) -> [f64; 2] {
        let mut finite = nodes.iter().copied().filter(|node| *node < HALF_SPACE_CM);
        let last = finite.next_back().unwrap_or(f64::NAN);
        [nodes.first().copied().unwrap_or(f64::NAN), last]
    }

    /// The value of the axis for a value of `named`. `snow` has the values that a measure depends
    /// on.
    fn axis_value(&self, named: Named, value: f64, snow: &Point) -> Result<f64, RetrieveError> {
        let nodes = self.nodes(named)?;
        let Named::Measure(measure) = named else {
            return Ok(value);
        };
        let grains = self.grains.ok_or(RetrieveError::NoGrains(measure.name()))?;
        let range = Self::range(nodes);
        Ok(grains.size_um(measure, value, range, snow))
    }

    /// Adds the known values `fix` to `point`.
    pub(super) fn fix(&self, point: &mut Point, fix: &[KnownValue]) -> Result<(), RetrieveError> {
        // measures depend on other values
        let (measures, axes): (Vec<&KnownValue>, Vec<&KnownValue>) = fix
            .iter()
            .partition(|fixed| matches!(fixed.named, Named::Measure(_)));
        for fixed in axes.into_iter().chain(measures) {
            let (named, parameter) = (fixed.named, fixed.named.parameter());
            let nodes = self.nodes(named)?;
            let value = self.axis_value(named, fixed.value, point)?;
            let value = match parameter {
                Parameter::Thickness => value.min(HALF_SPACE_CM),
                _ => value,
            };
            self.check(named, fixed.value, nodes, point)?;
            if point.get(parameter).is_some_and(|other| other != value) {
                let name = named.name();
                return Err(RetrieveError::Knowledge(format!(
                    "{name} has two values; remove one of them"
                )));
            }
            point.set(parameter, value);
        }
        Ok(())
    }

    /// Refuses a known value outside the axis.
    fn check(
        &self,
        named: Named,
        value: f64,
        nodes: &[f64],
        snow: &Point,
    ) -> Result<(), RetrieveError> {
        let [first, last] = self.measured_range(named, nodes, snow);
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs().max(1e-9);
        let inside = (first..=last).contains(&value) || close(value, first) || close(value, last);
        // look-ups reach beyond the thicknesses of the file
        let is_deep = named.parameter() == Parameter::Thickness && value > 0.0;
        let reaches = match nodes {
            [cm] => *cm < HALF_SPACE_CM && self.database.has_black_substrate(),
            _ => true,
        };
        if inside || (is_deep && reaches) {
            return Ok(());
        }
        let name = named.name();
        Err(RetrieveError::Knowledge(format!(
            "{name} = {value} is outside the compact file, which {}; give a value in this range, or build a file with a longer axis",
            covered(named, first, last)
        )))
    }

    /// The range of `named` in the file.
    fn measured_range(&self, named: Named, nodes: &[f64], snow: &Point) -> [f64; 2] {
        let ends = Self::range(nodes);
        let (Named::Measure(measure), Some(grains)) = (named, self.grains) else {
            return ends;
        };
        let value = |size| grains.measure(measure, &snow.with(Parameter::GrainSize, size));
        let [a, b] = ends.map(value);
        [a.min(b), a.max(b)]
    }

    /// The unknown of a belief, with its prior.
    pub(super) fn unknown(
        &self,
        free: &FreeParameter,
        snow: &Point,
    ) -> Result<Unknown, RetrieveError> {
        let FreeParameter { named, belief } = *free;
        let (nodes, name) = (self.nodes(named)?, named.name());
        let parameter = named.parameter();
        let wrong = |text: String| Err(RetrieveError::Knowledge(text));
        if nodes.len() < 2 {
            return wrong(format!(
                "{name} cannot be unknown: the compact file has only the value {}; build a file with a longer axis {}",
                nodes.first().copied().unwrap_or(f64::NAN),
                parameter.key()
            ));
        }
        if let (Named::Measure(_), None) = (named, self.grains) {
            return Err(RetrieveError::NoGrains(name));
        }
        let depends = |p: &Parameter| {
            let axis = self.database.axes().values(*p);
            axis.len() > 1 && snow.get(*p).is_none()
        };
        if let (Named::Measure(_), Some(other), false) = (
            named,
            [Parameter::Sphericity].iter().find(|p| depends(p)),
            belief == Belief::Axis,
        ) {
            return wrong(format!(
                "what is known of {name} cannot be used while {0} is unknown, on which it depends; fix {0}, or state what is known of {1}",
                other.key(),
                Parameter::GrainSize.key()
            ));
        }
        let whole = Self::range(nodes);
        let [first, last] = self.measured_range(named, nodes, snow);
        let size = |value: f64| self.axis_value(named, value, snow);
        let log = |value: f64| match parameter {
            Parameter::GrainSize => libm::log(value),
            _ => value,
        };
        Ok(match belief {
            Belief::Axis => Unknown::new(parameter, whole, Prior::Flat),
            Belief::Range([min, max]) => {
                let deep = parameter == Parameter::Thickness && max < HALF_SPACE_CM;
                if max <= first || min >= last && !deep {
                    return wrong(format!(
                        "{name} = {min}..{max} is outside the compact file, which {}",
                        covered(named, first, last)
                    ));
                }
                let inside = [min.max(first), if deep { max } else { max.min(last) }];
                let [a, b] = [size(inside[0])?, size(inside[1])?];
                Unknown::new(parameter, [a.min(b), a.max(b)], Prior::Flat)
            }
            Belief::Normal([mean, sd]) => {
                if !(first - 3.0 * sd..=last + 3.0 * sd).contains(&mean) {
                    return wrong(format!(
                        "{name} = {mean}+-{sd} is outside the compact file, which {}",
                        covered(named, first, last)
                    ));
                }
                let prior = match (parameter, named) {
                    // a Gaussian of the logarithm with the same relative width
                    (Parameter::GrainSize, _) if mean <= 0.0 => {
                        return wrong(format!("{name}: the mean must be above 0"));
                    }
                    (Parameter::GrainSize, Named::Measure(_)) => {
                        let centre = log(size(mean.clamp(first, last))?);
                        // radius and surface are nearly proportional to the size or its inverse
                        let beyond = libm::log(mean.clamp(first, last) / mean);
                        let sign = match named {
                            Named::Measure(SizeMeasure::SpecificSurface) => 1.0,
                            _ => -1.0,
                        };
                        Prior::Normal {
                            mean: centre + sign * beyond,
                            sd: sd / mean,
                        }
                    }
                    (Parameter::GrainSize, _) => Prior::Normal {
                        mean: log(mean),
                        sd: sd / mean,
                    },
                    _ => Prior::Normal { mean, sd },
                };
                Unknown::new(parameter, whole, prior)
            }
        })
    }
}

/// The unknowns of a file: those stated, and all axes with several nodes that are not `known`.
/// Also the latter.
pub(super) fn unknowns(
    knowledge: &Knowledge<'_>,
    free: &[FreeParameter],
    known: &Point,
) -> Result<(Vec<Unknown>, Vec<Parameter>), RetrieveError> {
    let (mut unknowns, mut assumed) = (Vec::new(), Vec::new());
    for stated in free {
        let name = stated.named.name();
        let nodes = knowledge.nodes(stated.named)?;
        if nodes.len() > 1 && known.get(stated.named.parameter()).is_some() {
            return Err(RetrieveError::Knowledge(format!(
                "{name} is both known and unknown; remove one of them"
            )));
        }
        if nodes.len() < 2 {
            knowledge.unknown(stated, known)?;
        }
    }
    for (parameter, nodes) in knowledge.database.axes().iter() {
        if known.get(parameter).is_some() {
            continue;
        }
        let mut stated = free
            .iter()
            .filter(|free| free.named.parameter() == parameter);
        let first = stated.next();
        if stated.next().is_some() {
            let name = parameter.key();
            return Err(RetrieveError::Knowledge(format!(
                "{name} is stated as unknown twice; remove one of them"
            )));
        }
        match first {
            Some(stated) => unknowns.push(knowledge.unknown(stated, known)?),
            None if nodes.len() > 1 => {
                assumed.push(parameter);
                let free = FreeParameter {
                    named: Named::Axis(parameter),
                    belief: Belief::Axis,
                };
                unknowns.push(knowledge.unknown(&free, known)?);
            }
            None => {}
        }
    }
    if unknowns.is_empty() {
        return Err(RetrieveError::Knowledge(
            "every value is known, so there is nothing to retrieve; remove a known value".into(),
        ));
    }
    // the grain size first, then the other parameters that every file has
    let last = |p: Parameter| (p != Parameter::GrainSize, p.is_optional());
    unknowns.sort_by_key(|unknown| last(unknown.parameter()));
    Ok((unknowns, assumed))
}

/// `point` with the values of the axes that have a single node.
pub(super) fn with_single_nodes(database: &Database, point: Point) -> Point {
    let mut point = point;
    for (parameter, nodes) in database.axes().iter() {
        if let ([only], None) = (nodes, point.get(parameter)) {
            point.set(parameter, *only);
        }
    }
    point
}

impl Setup {
    /// Joins the parts of `request`.
    ///
    /// # Errors
    /// [`RetrieveError`] if a value is outside the file, two statements contradict each other,
    /// or the file lacks a quantity.
    pub fn new(request: &SetupRequest<'_>) -> Result<Self, RetrieveError> {
        let SetupRequest {
            database,
            inputs,
            noise,
            ..
        } = *request;
        database.require_hemispherical()?;
        let grains = FileGrains::of(database);
        let knowledge = Knowledge::new(database, grains.as_ref());
        let mut common = Point::default();
        knowledge.fix(&mut common, request.fix)?;
        let mut points = Vec::new();
        for input in inputs {
            let mut point = common;
            knowledge.fix(&mut point, &input.fixed)?;
            points.push(point);
        }
        // known in every spectrum, or in none
        let mut known = common;
        for (parameter, _) in database.axes().iter() {
            let given = points.iter().filter_map(|point| point.get(parameter));
            let count = given.clone().count();
            if let Some(first) = given.clone().next() {
                if count < points.len() {
                    return Err(RetrieveError::Knowledge(format!(
                        "{} is known for {count} of {} spectra; give it for each of them",
                        parameter.key(),
                        points.len()
                    )));
                }
                known.set(parameter, first);
            }
        }
        let (unknowns, assumed) = unknowns(
            &knowledge,
            request.free,
            &with_single_nodes(database, known),
        )?;
        let (mut emulators, mut whitenings) = (Vec::new(), Vec::new());
        let mut emulator_errors: Vec<(Quantity, EmulatorError)> = Vec::new();
        for (input, point) in inputs.iter().zip(&mut points) {
            let emulator = Emulator::new(database, input.quantity, *point)?;
            *point = with_single_nodes(database, *point);
            let mut error = EmulatorError::of(database, input.quantity);
            let emulator = match request.bands {
                None => emulator,
                Some(bands) => bands.averaged(emulator, &mut error),
            };
            let nm = |i: &usize| emulator.wavelengths_nm()[*i];
            let nm: Vec<f64> = input.indices.iter().map(nm).collect();
            let extra: Vec<f64> = input.indices.iter().map(|i| error.sd[*i]).collect();
            let own = input.uncertainties.iter();
            let own: Vec<f64> = own.map(|sd| sd.unwrap_or(noise.value)).collect();
            let whitening = Whitening::new(&nm, &own, &extra, &noise);
            whitenings.push(whitening.ok_or(RetrieveError::Noise)?);
            emulators.push(emulator);
            if emulator_errors.iter().all(|(q, _)| *q != input.quantity) {
                emulator_errors.push((input.quantity, error));
            }
        }
        Ok(Self {
            inputs: inputs.to_vec(),
            unknowns,
            assumed,
            grains,
            noise,
            emulator_errors,
            bands: request.bands.cloned(),
            emulators,
            whitenings,
            points,
        })
    }

    /// The problem, with `offsets` (as many as values) subtracted from the measured values.
    pub(super) fn inverse(&self, offsets: &[f64]) -> Inverse<'_> {
        let (mut at, mut observations) = (0, Vec::with_capacity(self.inputs.len()));
        let parts = self.inputs.iter().zip(&self.emulators);
        let parts = parts.zip(self.whitenings.iter().zip(&self.points));
        for ((input, emulator), (whitening, point)) in parts {
            let offsets = &offsets[at..at + input.values.len()];
            at += input.values.len();
            let pairs = input.values.iter().zip(offsets);
            let shifted = pairs.map(|(measured, offset)| measured - offset).collect();
            let indices = &input.indices;
            observations.push(Observation::new(
                emulator, whitening, indices, *point, shifted,
            ));
        }
        Inverse::new(&self.unknowns, observations)
    }

    /// Number of measured values.
    #[must_use]
    pub fn values(&self) -> usize {
        self.inputs.iter().map(|input| input.values.len()).sum()
    }

    /// The measured spectra.
    #[must_use]
    pub fn inputs(&self) -> &[MeasuredInput] {
        &self.inputs
    }

    /// Wavelengths of the compact file or mean wavelengths of the bands, nm.
    pub(super) fn wavelengths_nm(&self) -> &[f64] {
        self.emulators.first().map_or(&[], Emulator::wavelengths_nm)
    }

    /// Parameters that are unknown because nothing was stated about them.
    #[must_use]
    pub fn assumed(&self) -> &[Parameter] {
        &self.assumed
    }
}

impl Setup {
    /// Standard deviation of each measured value from all stated errors.
    pub(super) fn sigmas(&self) -> Vec<f64> {
        let noise = self.noise;
        let of = |input: &MeasuredInput| -> Vec<f64> {
            let error = self
                .emulator_errors
                .iter()
                .find(|(q, _)| *q == input.quantity);
            let value = |(k, index): (usize, &usize)| {
                let own = input.uncertainties[k].unwrap_or(noise.value);
                let emulator = error.map_or(0.0, |(_, error)| error.sd[*index]);
                let parts = [
                    own,
                    noise.correlated,
                    noise.level * input.values[k],
                    emulator,
                ];
                parts.iter().map(|part| part * part).sum::<f64>().sqrt()
            };
            input.indices.iter().enumerate().map(value).collect()
        };
        self.inputs.iter().flat_map(of).collect()
    }
}
