//! The light toward views: its compact files against the database, and fresh simulations of
//! curves of different jobs against the stored factors.
//!
//! The errors of both results of a factor come from the scatter of n = [`PARTS`] parts. So the
//! difference d in combined standard errors has the tails of Student's t. The differences of the
//! parts, divided by their root sum of squares, have Gaussian or lighter tails (Efron 1969; see
//! [`super::nodes`]): that number is sqrt(n d^2 / (n - 1 + d^2)), the z of this check.
use ndarray::Array2;

use super::fresh::PreparedPoint;
use super::nodes::{Node, ZScores, chosen};
use super::{Check, CheckContext, VerifyError, compact};
use crate::build::view_file;
use crate::engine::exits::{self, PARTS};
use crate::engine::{Control, EngineError, Request};
use crate::grid::{GridError, GridViews};
use crate::lookup::Database;
use crate::measurement::{Measured, Quantity, Spectrum, ViewFactors};
use crate::parameter::Point;
use crate::store::{VIEWS, VIEWS_DIFFUSE, Variable};

/// Name of the check of the compact files.
const FILES: &str = "compact files of anisotropy factors against the database";
/// Name of the check by fresh simulations.
const FRESH: &str = "fresh simulations toward views";
/// Most curves that are simulated: each takes as long as the walks of a job toward its views.
const MOST_CURVES: usize = 3;
/// Largest difference between two anisotropy factors that count as the same.
const ROUNDING: f32 = 1e-5;

/// Checks that the compact files are those that `splitsnow compress` makes from the database.
pub(super) fn files(context: &CheckContext<'_>) -> Result<Check, VerifyError> {
    let mut check = Check::new(FILES);
    let lights: &[bool] = match context.store.has_diffuse() {
        true => &[false, true],
        false => &[false],
    };
    for &is_diffuse in lights {
        let name = if is_diffuse { VIEWS_DIFFUSE } else { VIEWS };
        let path = context.store.dir().join(name);
        let opened = Database::open(&path).map_err(|error| error.to_string());
        let opened = opened.and_then(|file| Ok((compact::request(&file)?, file)));
        let problem = match opened {
            Err(problem) => Some(problem),
            Ok((request, file)) => {
                let bytes = view_file(context.store, &request, is_diffuse)?;
                match Database::from_bytes(&bytes) {
                    Err(error) => Some(error.to_string()),
                    Ok(expected) => difference(&file, &expected),
                }
            }
        };
        match problem {
            Some(problem) => check.problems.push(format!(
                "{name}: {problem}; make the file again with `splitsnow compress`"
            )),
            None => check.notes.push(format!(
                "{name} holds the factors that follow from the database"
            )),
        }
    }
    Ok(check)
}

/// The first difference between a file and the one expected, in words.
fn difference(file: &Database, expected: &Database) -> Option<String> {
    if file.axes() != expected.axes() || file.wavelengths_nm() != expected.wavelengths_nm() {
        return Some("its axes differ from those of the database".to_owned());
    }
    if file.absent() != expected.absent() {
        return Some("its absent curves differ from those of the database".to_owned());
    }
    for quantity in Quantity::ALL.into_iter().filter(|q| expected.has(*q)) {
        for row in (0..expected.curves()).filter(|row| expected.exists(*row)) {
            let curves = [file, expected].map(|file| file.curve(row, quantity));
            let [Some(found), Some(curve)] = curves else {
                return Some(format!("it lacks the factors of {}", quantity.name()));
            };
            let pairs = found.iter().zip(&curve);
            let mut differs = pairs.map(|(a, b)| (a - b).abs() > ROUNDING * b.abs().max(1.0));
            if let Some(l) = differs.position(|differs| differs) {
                let point = expected.point(row).unwrap_or_default();
                return Some(format!(
                    "the factor of {} at {} nm, {point}, is {} instead of {}",
                    quantity.name(),
                    expected.wavelengths_nm()[l],
                    found[l],
                    curve[l]
                ));
            }
        }
    }
    None
}

/// Simulates some curves of different jobs again. Returns the check with the number of curves
/// skipped for lack of time and the number of all.
pub(super) fn fresh(
    context: &CheckContext<'_>,
    views: &GridViews,
    control: &Control<'_>,
) -> Result<(Check, [usize; 2]), VerifyError> {
    let (nodes, seed) = chosen(context, "views", MOST_CURVES.min(context.options.samples));
    let mut check = Check::new(FRESH);
    let stored = Stored::read(context)?;
    let mut scores = [ZScores::default(), ZScores::default()];
    let mut ended = 0;
    for node in &nodes {
        let spectrum = stored.spectrum(node);
        let fresh = match simulate(context, views, node.point, spectrum, seed, control) {
            Err(VerifyError::Cancelled) => break,
            fresh => fresh?,
        };
        ended += 1;
        for (scores, quantity) in scores.iter_mut().zip(Quantity::ALL) {
            let pairs = fresh
                .of(quantity)
                .iter()
                .zip(stored.factors(node, quantity));
            let z: Vec<f64> = pairs.map(|(a, b)| z(*a, b)).collect();
            let wavelengths_nm = &context.grid.wavelengths_nm;
            for z in z.chunks(wavelengths_nm.len()) {
                scores.add(node, z, wavelengths_nm);
            }
        }
    }
    check.notes.push(format!(
        "{ended} curves of different jobs toward {} views, {} rays; false alarms: {:e}",
        views.count(),
        views.rays,
        super::FALSE_ALARM,
    ));
    for (scores, quantity) in scores.into_iter().zip(Quantity::ALL) {
        check.figures.extend(scores.largest(quantity, context.grid));
    }
    Ok((check, [nodes.len() - ended, nodes.len()]))
}

/// The factors of the curve at `point`, which add up to `spectrum`.
fn simulate(
    context: &CheckContext<'_>,
    views: &GridViews,
    point: Point,
    spectrum: Spectrum,
    seed: u64,
    control: &Control<'_>,
) -> Result<ViewFactors, VerifyError> {
    let grid = context.grid;
    let prepared = PreparedPoint::new(grid, point)?;
    let request = Request {
        seed,
        ..prepared.request(grid, 0)
    };
    let directions = views.views().map_err(GridError::Views)?;
    let how = (&directions, views.rays);
    let factors = exits::view_factors(grid.run.engine, &request, how, &[spectrum], control);
    let factors = factors.map_err(|source| match source {
        EngineError::Cancelled => VerifyError::Cancelled,
        source => prepared.error(source),
    })?;
    Ok(factors.into_iter().next().unwrap_or_default())
}

/// The stored arrays of collimated light: values and errors of each quantity, and the factors
/// likewise, in the order of [`Quantity::ALL`].
struct Stored {
    totals: [[Array2<f32>; 2]; 2],
    factors: [[Array2<f32>; 2]; 2],
}

impl Stored {
    fn read(context: &CheckContext<'_>) -> Result<Self, VerifyError> {
        let both = |variable: Variable| -> Result<_, VerifyError> {
            let store = context.store;
            Ok([store.read(variable)?, store.read(variable.se())?])
        };
        let [first, second] = Quantity::ALL.map(Variable::of);
        Ok(Self {
            totals: [both(first)?, both(second)?],
            factors: [both(first.toward_views())?, both(second.toward_views())?],
        })
    }

    /// Values and errors of one row.
    fn row([values, errors]: &[Array2<f32>; 2], row: usize) -> Vec<Measured> {
        let pairs = values.row(row).into_iter().zip(errors.row(row));
        let measured = pairs.map(|(value, se)| Measured {
            value: f64::from(*value),
            se: f64::from(*se),
        });
        measured.collect()
    }

    /// Reflectance and transmittance at a node.
    fn spectrum(&self, node: &Node) -> Spectrum {
        let mut spectrum = Spectrum::default();
        for (quantity, totals) in Quantity::ALL.into_iter().zip(&self.totals) {
            let row = Self::row(totals, node.row);
            match quantity {
                Quantity::Transmittance => spectrum.transmittance = row,
                Quantity::Reflectance => spectrum.reflectance = row,
            }
        }
        spectrum
    }

    /// The factors of one quantity at a node, `[view][wavelength]`.
    fn factors(&self, node: &Node, quantity: Quantity) -> impl Iterator<Item = Measured> {
        let position = Quantity::ALL.iter().position(|other| *other == quantity);
        let position = position.unwrap_or_default();
        let factors = &self.factors[position];
        let curves = self.totals[position][0].nrows();
        let rows = (node.row..factors[0].nrows()).step_by(curves);
        rows.flat_map(move |row| Self::row(factors, row))
    }
}

/// The difference in combined standard errors, as a number with Gaussian or lighter tails.
fn z(fresh: Measured, stored: Measured) -> f64 {
    let d = super::nodes::z(fresh, stored);
    let n = PARTS as f64;
    d.signum() * (n * d * d / (n - 1.0 + d * d)).sqrt()
}
