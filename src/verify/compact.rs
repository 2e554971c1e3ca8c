//! The compact file against the database it must have been made from.
use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::{Check, Figure, Subject, VerifyError};
use crate::colour::{Colorimeter, Viewing};
use crate::compress::{
    BAND_ERRORS, BOUNDS, BandError, BandErrors, Bounds, ERROR_TABLE, PROVENANCE, errors_of, rmse_in,
};
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::{Axes, Parameter};

pub(super) const NAME: &str = "compact file against the database";
pub(super) const DIFFUSE_NAME: &str = "compact file of isotropic light against the database";
/// Attributes without which a provenance says nothing.
const IDENTITY: [&str; 3] = ["config_sha256", "engine", "seed"];
/// The error table has six digits: the most that one of its numbers may differ
/// from the errors found anew, relative to itself.
const ROUNDING: f64 = 1e-5;

pub(super) fn check(
    subject: &Subject<'_>,
    database: &Database,
    colour: Option<&Colorimeter>,
    diffuse: bool,
) -> Result<Check, VerifyError> {
    let mut check = Check::new(match diffuse {
        false => NAME,
        true => DIFFUSE_NAME,
    });
    check.problems.extend(origin(subject, database, diffuse));
    if !check.problems.is_empty() {
        return Ok(check);
    }
    let metadata = |key: &str| {
        let text = database.metadata().get(key).map(String::as_str);
        text.unwrap_or_default()
    };
    let table: Value = serde_json::from_str(metadata(ERROR_TABLE)).unwrap_or_default();
    for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
        let [curves, _] = subject.curves(quantity, diffuse)?;
        let errors = errors_of(database, quantity, curves.view(), colour)?;
        let row = &table[quantity.name()]["rows"][database.components(quantity) - 1];
        let Some(bounds) = stated(database, quantity) else {
            let problem = format!("its metadata `{BOUNDS}` state none for {}", quantity.name());
            check.problems.push(problem);
            continue;
        };
        let measures = [
            (
                ["RMSE mean", "RMSE max"],
                "rmse",
                Some(errors.rmse),
                bounds.max_rmse,
            ),
            (
                ["Delta-E mean", "Delta-E max"],
                "delta_e",
                errors.delta_e,
                bounds.max_delta_e,
            ),
        ];
        for ([mean_name, max_name], key, errors, bound) in measures {
            let Some((mean, max, worst)) = errors.as_deref().and_then(summary) else {
                continue;
            };
            let figure = |measure, value, bound, at| Figure {
                quantity,
                measure,
                value,
                bound,
                at,
            };
            check
                .figures
                .push(figure(mean_name, mean, None, String::new()));
            let worst = at(database, worst);
            check.figures.push(figure(max_name, max, bound, worst));
            for (name, found, stated) in [
                (mean_name, mean, &row[key]["mean"]),
                (max_name, max, &row[key]["max"]),
            ] {
                let same = stated
                    .as_f64()
                    .is_some_and(|s| (s - found).abs() <= ROUNDING * found);
                if !same {
                    check.problems.push(format!(
                        "its error table states {stated} as the {name} of {}, its coefficients give {found:.5e}: one of them was changed",
                        quantity.name()
                    ));
                }
            }
        }
        match band_errors(database, quantity) {
            // Files from before bands were told.
            Ok(None) => {}
            Ok(Some(stated)) => {
                for found in &errors.bands {
                    in_band(&mut check, database, quantity, found, &stated);
                }
            }
            Err(problem) => check.problems.push(problem),
        }
    }
    Ok(check)
}

/// The RMSE of one band against its bound, and what the file says of it against what
/// was `found`.
fn in_band(
    check: &mut Check,
    database: &Database,
    quantity: Quantity,
    found: &BandErrors,
    stated: &[BandError],
) {
    let name = found.band.name();
    let Some((_, max, worst)) = summary(&found.rmse) else {
        return;
    };
    let stated = stated.iter().find(|stated| stated.band == found.band);
    check.figures.push(Figure {
        quantity,
        measure: rmse_in(found.band),
        value: max,
        bound: stated.and_then(|stated| stated.max_rmse),
        at: at(database, worst),
    });
    let Some(stated) = stated else {
        let problem = format!(
            "its metadata `{BAND_ERRORS}` say nothing of {name} of {}",
            quantity.name()
        );
        check.problems.push(problem);
        return;
    };
    let largest = found.largest.error;
    for (what, found, stated) in [
        ("largest RMSE", max, stated.rmse.max),
        ("largest error", largest, stated.largest.error),
    ] {
        if (stated - found).abs() > ROUNDING * found || stated.is_nan() {
            check.problems.push(format!(
                "its metadata `{BAND_ERRORS}` state {stated} as the {what} of {} in {name}, its coefficients give {found:.5e}: one of them was changed",
                quantity.name()
            ));
        }
    }
}

/// The node of a curve.
fn at(database: &Database, row: usize) -> String {
    let point = database.point(row);
    point.map_or(String::new(), |point| point.to_string())
}

/// What the file states of each band of `quantity`; `None` if it states no bands at all.
/// An error says that it cannot be read.
fn band_errors(database: &Database, quantity: Quantity) -> Result<Option<Vec<BandError>>, String> {
    let Some(text) = database.metadata().get(BAND_ERRORS) else {
        return Ok(None);
    };
    let all: BTreeMap<String, Vec<BandError>> = serde_json::from_str(text)
        .map_err(|e| format!("its metadata `{BAND_ERRORS}` cannot be read: {e}"))?;
    Ok(Some(all.get(quantity.name()).cloned().unwrap_or_default()))
}

/// What tells that the file was made from another database.
fn origin(subject: &Subject<'_>, database: &Database, diffuse: bool) -> Vec<String> {
    let provenance = provenance(database);
    let mut problems = Vec::new();
    let mut compare = |key: &str, stored: &Value| match provenance.get(key) {
        Some(value) if value == stored => {}
        // What differs in it is told line by line.
        Some(_) if key == "config" => {}
        Some(value) if key == "identity" => problems.extend(differing_lines(value, stored)),
        Some(value) => problems.push(format!(
            "it was made from another database: its {key} is {value}, that of the database {stored}"
        )),
        None if IDENTITY.contains(&key) => {
            problems.push(format!("its metadata `{PROVENANCE}` do not tell its {key}"));
        }
        None => {}
    };
    let attributes = subject.store.attributes();
    for (key, stored) in &attributes {
        compare(key, stored);
    }
    if database.absent() != subject.store.absent() {
        problems.push("the curves that it lacks are not those of the database".to_owned());
    }
    let names = |axes: &Axes| {
        let names: Vec<_> = axes.iter().map(|(parameter, _)| parameter.name()).collect();
        names.join(", ")
    };
    let [stored, found] = [subject.store.axes(), database.axes()];
    if names(stored) != names(found) {
        problems.push(format!(
            "its axes are {}, those of the database {}",
            names(found),
            names(stored)
        ));
        return problems;
    }
    // files of version 1 hold single precision
    let same = |a: &[f64], b: &[f64]| a.iter().map(|v| *v as f32).eq(b.iter().map(|v| *v as f32));
    for (parameter, values) in stored.iter() {
        // isotropic light has one angle, which stands for all
        let all = diffuse && parameter == Parameter::Incidence;
        if !all && !same(values, found.values(parameter)) {
            let name = parameter.name();
            problems.push(format!("its {name} are not those of the database"));
        }
    }
    if !same(subject.store.wavelengths_nm(), database.wavelengths_nm()) {
        problems.push("its wavelength_nm are not those of the database".to_owned());
    }
    problems
}

fn provenance(database: &Database) -> Value {
    let text = database.metadata().get(PROVENANCE);
    text.and_then(|text| serde_json::from_str(text).ok())
        .unwrap_or_default()
}

/// How the file says its colours were compared; the default where it says
/// nothing. An error says what is unknown.
pub(crate) fn viewing(database: &Database) -> Result<Viewing, String> {
    match provenance(database).get("compression") {
        Some(stated) => Viewing::deserialize(stated).map_err(|e| e.to_string()),
        None => Ok(Viewing::default()),
    }
}

/// Lines of the identity in which file and database differ.
fn differing_lines(file: &Value, stored: &Value) -> Vec<String> {
    let lines = |value: &Value| -> Vec<String> {
        let text = value.as_str().unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    };
    let (file, stored) = (lines(file), lines(stored));
    let only = |a: &[String], b: &[String], whose| -> Vec<String> {
        let lines = a.iter().filter(|line| !b.contains(line));
        lines
            .map(|line| format!("{line}: only in the {whose}"))
            .collect()
    };
    let mut differing = only(&file, &stored, "compact file");
    differing.extend(only(&stored, &file, "database"));
    differing
}

/// The bounds that the file states for `quantity`.
pub(super) fn stated(database: &Database, quantity: Quantity) -> Option<Bounds> {
    let text = database.metadata().get(BOUNDS)?;
    let bounds: BTreeMap<String, Bounds> = serde_json::from_str(text).ok()?;
    bounds.get(quantity.name()).copied()
}

/// Mean, largest and position of the (first) largest, of curves that exist; `None` of
/// nothing.
pub(super) fn summary(errors: &[f64]) -> Option<(f64, f64, usize)> {
    let there = errors.iter().enumerate().filter(|(_, e)| !e.is_nan());
    let mean = there.clone().map(|(_, e)| e).sum::<f64>() / there.clone().count() as f64;
    let (worst, max) = there.reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    Some((mean, *max, worst))
}
