//! The options that give a point in a compact file: one option for each parameter.
use anyhow::bail;
use clap::{Arg, ArgMatches, Command};

#[cfg(feature = "netcdf")]
use crate::export::{ExportError, ExportTable};
#[cfg(feature = "charts")]
use crate::lookup::Database;
use crate::parameter::{Parameter, Point};
use crate::units::HALF_SPACE_CM;

/// The coordinates given on the command line, at most one for each axis.
#[derive(Debug)]
pub(super) struct PointArgs(Point);

/// Parses a number, also `inf`; NaN is refused.
fn number(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| !number.is_nan());
    number.ok_or_else(|| "the value must be a number".to_owned())
}

/// The option of a parameter.
fn arg(parameter: Parameter) -> Arg {
    let record = parameter.record();
    let mut words = record.long_name.chars();
    let first = words.next().map(|c| c.to_uppercase().to_string());
    let mut help = first.unwrap_or_default() + words.as_str();
    match record.unit {
        "1" => {}
        "degree" => help += ", degrees",
        unit => help += &format!(", {unit}"),
    }
    if parameter == Parameter::Thickness {
        help += "; inf for a half space";
    }
    if parameter.is_optional() {
        help += "; only for a file with this axis";
    }
    let arg = Arg::new(record.key)
        .long(record.option)
        .value_name(record.symbol)
        .value_parser(number)
        .help(help);
    match parameter {
        // the name of this option in version 0.1
        Parameter::Incidence => arg.alias("angle-deg"),
        _ => arg,
    }
}

impl clap::Args for PointArgs {
    fn augment_args(command: Command) -> Command {
        let optional = Parameter::ALL.into_iter().filter(|p| p.is_optional());
        command.args(Parameter::CORE.into_iter().chain(optional).map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl clap::FromArgMatches for PointArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = Parameter::ALL.into_iter().filter_map(|parameter| {
            let value = *matches.get_one::<f64>(parameter.key())?;
            let value = match parameter {
                // files store a half space as the finite thickness HALF_SPACE_CM
                Parameter::Thickness => value.min(HALF_SPACE_CM),
                _ => value,
            };
            Some((parameter, value))
        });
        Ok(Self(given.collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Makes the options of the axes that every file has required.
pub(super) fn required(arg: Arg) -> Arg {
    match Parameter::named(arg.get_id().as_str()) {
        Some(Parameter::Incidence) => arg.required_unless_present("diffuse"),
        Some(parameter) if !parameter.is_optional() => arg.required(true),
        _ => arg,
    }
}

impl PointArgs {
    /// Whether no coordinate is given.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether no density, grain size, thickness or incidence angle is given.
    pub(super) fn leaves_tables(&self) -> bool {
        let core = Parameter::CORE.into_iter();
        let mut rest = core.filter(|p| *p != Parameter::Facetness);
        rest.all(|parameter| self.0.get(parameter).is_none())
    }

    /// The part of `table` at the given nodes.
    #[cfg(feature = "netcdf")]
    pub(super) fn cut(&self, mut table: ExportTable) -> Result<ExportTable, ExportError> {
        for (parameter, value) in self.0.iter() {
            table = table.select(parameter.name(), value)?;
        }
        Ok(table)
    }

    /// The point. Every axis that all files have must be given, except the incidence angle
    /// under `diffuse` light, which is set to 0.
    ///
    /// # Errors
    /// If a required option is missing.
    pub(super) fn point(&self, diffuse: bool) -> anyhow::Result<Point> {
        let mut point = self.0;
        if diffuse && point.get(Parameter::Incidence).is_none() {
            point.set(Parameter::Incidence, 0.0);
        }
        let mut core = Parameter::CORE.into_iter();
        match core.find(|parameter| point.get(*parameter).is_none()) {
            Some(parameter) => bail!(
                "a spectrum needs a value for every axis; give --{} too",
                parameter.record().option
            ),
            None => Ok(point),
        }
    }
}

/// Snow for look-up tables.
#[cfg(feature = "exr")]
impl PointArgs {
    /// The snow: every axis that all files have but the thickness and the incidence angle, which
    /// are those of the table.
    ///
    /// # Errors
    /// If a required option is missing, or one of the table is given.
    pub(super) fn snow(&self) -> anyhow::Result<Point> {
        for parameter in Parameter::CORE {
            let option = parameter.record().option;
            let is_of_table = matches!(parameter, Parameter::Thickness | Parameter::Incidence);
            match self.0.get(parameter) {
                Some(_) if is_of_table => {
                    bail!("lut holds all thicknesses and angles; remove --{option}")
                }
                None if !is_of_table => {
                    bail!("a look-up table is of one snow; give --{option} too")
                }
                _ => {}
            }
        }
        Ok(self.0)
    }
}

/// Points for exports as pictures.
#[cfg(feature = "charts")]
impl PointArgs {
    /// Whether the thickness is given.
    pub(super) fn has_thickness(&self) -> bool {
        self.0.get(Parameter::Thickness).is_some()
    }

    /// The point, with the middle node of each axis that is not given.
    pub(super) fn or_middle(&self, database: &Database) -> Point {
        let mut point = self.0;
        for (parameter, nodes) in database.axes().iter() {
            if point.get(parameter).is_none() {
                point.set(
                    parameter,
                    nodes.get(nodes.len() / 2).copied().unwrap_or(0.0),
                );
            }
        }
        point
    }

    /// The point as text, without the thickness unless it is given.
    pub(super) fn described(&self, point: Point) -> String {
        match self.has_thickness() {
            true => point.to_string(),
            false => point.with(Parameter::Thickness, f64::NAN).to_string(),
        }
    }
}
