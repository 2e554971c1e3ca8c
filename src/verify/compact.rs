//! The check of a compact file against the database from which it must have been made.
use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;

use super::{Check, CheckContext, CheckedValue, VerifyError};
use crate::accuracy::RunningSummary;
use crate::build::CompressionRequest;
use crate::colour::{Colorimeter, Viewing};
use crate::compress::{
    BAND_ERRORS, BOUNDS, BandError, BandErrors, Bounds, Choice, CompactVariant, ERROR_TABLE,
    PROVENANCE, curve_errors, rmse_in,
};
use crate::grid::Compression;
use crate::lookup::Database;
use crate::measurement::Quantity;
use crate::parameter::{Axes, Parameter};

/// Name of the check of the compact file.
pub(super) const NAME: &str = "compact file against the database";
/// Name of the check of the compact file for isotropic light.
pub(super) const DIFFUSE_NAME: &str = "compact file of isotropic light against the database";
/// Attributes that every provenance must have.
const IDENTITY: [&str; 3] = ["config_sha256", "engine", "seed"];
/// Largest relative difference allowed between a number of the error table, which has six
/// digits, and the error computed again.
const ROUNDING: f64 = 1e-5;

/// Checks the origin of the compact file, its bounds, and the errors that it states.
pub(super) fn check(
    context: &CheckContext<'_>,
    database: &Database,
    colour: Option<&Colorimeter>,
    diffuse: bool,
) -> Result<Check, VerifyError> {
    let mut check = Check::new(match diffuse {
        false => NAME,
        true => DIFFUSE_NAME,
    });
    check.problems.extend(origin(context, database, diffuse));
    if !check.problems.is_empty() {
        return Ok(check);
    }
    let metadata = |key: &str| {
        let text = database.metadata().get(key).map(String::as_str);
        text.unwrap_or_default()
    };
    let table: Value = serde_json::from_str(metadata(ERROR_TABLE)).unwrap_or_default();
    for quantity in Quantity::ALL.into_iter().filter(|&q| database.has(q)) {
        let [curves, _] = context.curves(quantity, diffuse)?;
        let errors = curve_errors(database, quantity, curves.view(), colour)?;
        let row = &table[quantity.name()]["rows"][database.components(quantity) - 1];
        let Some(bounds) = stated(database, quantity) else {
            let problem = format!(
                "its metadata `{BOUNDS}` state no bounds for {}",
                quantity.name()
            );
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
            let Some(summary) = errors.as_deref().and_then(summary) else {
                continue;
            };
            let (mean, max) = (summary.mean(), summary.max);
            let figure = |measure, value, bound, at| CheckedValue {
                quantity,
                measure,
                value,
                bound,
                at,
            };
            check
                .figures
                .push(figure(mean_name, mean, None, String::new()));
            let worst = point_text(database, summary.worst);
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
                        "its error table states {stated} as the {name} of {}, but its coefficients give {found:.5e}: the table or the coefficients were changed",
                        quantity.name()
                    ));
                }
            }
        }
        match band_errors(database, quantity) {
            // Files of older versions state no band errors.
            Ok(None) => {}
            Ok(Some(stated)) => {
                for band in &errors.bands {
                    check_band(&mut check, database, quantity, band, &stated);
                }
            }
            Err(problem) => check.problems.push(problem),
        }
    }
    Ok(check)
}

/// Checks the RMSE of one band against its bound, and the errors that the file states for the
/// band against the `computed` errors.
fn check_band(
    check: &mut Check,
    database: &Database,
    quantity: Quantity,
    computed: &BandErrors,
    stated: &[BandError],
) {
    let name = computed.band.name();
    let Some(RunningSummary { max, worst, .. }) = summary(&computed.rmse) else {
        return;
    };
    let stated = stated.iter().find(|stated| stated.band == computed.band);
    check.figures.push(CheckedValue {
        quantity,
        measure: rmse_in(computed.band),
        value: max,
        bound: stated.and_then(|stated| stated.max_rmse),
        at: point_text(database, worst),
    });
    let Some(stated) = stated else {
        let problem = format!(
            "its metadata `{BAND_ERRORS}` have no entry for {name} of {}",
            quantity.name()
        );
        check.problems.push(problem);
        return;
    };
    let largest = computed.largest.error;
    for (measure, computed, stated) in [
        ("largest RMSE", max, stated.rmse.max),
        ("largest error", largest, stated.largest.error),
    ] {
        if (stated - computed).abs() > ROUNDING * computed || stated.is_nan() {
            check.problems.push(format!(
                "its metadata `{BAND_ERRORS}` state {stated} as the {measure} of {} in {name}, but its coefficients give {computed:.5e}: the metadata or the coefficients were changed",
                quantity.name()
            ));
        }
    }
}

/// The node of a curve, as text.
fn point_text(database: &Database, row: usize) -> String {
    let point = database.point(row);
    point.map_or(String::new(), |point| point.to_string())
}

/// The band errors that the file states for `quantity`; `None` if it states none at all.
///
/// # Errors
/// A message if the metadata cannot be read.
fn band_errors(database: &Database, quantity: Quantity) -> Result<Option<Vec<BandError>>, String> {
    let Some(text) = database.metadata().get(BAND_ERRORS) else {
        return Ok(None);
    };
    let by_quantity: BTreeMap<String, Vec<BandError>> = serde_json::from_str(text)
        .map_err(|e| format!("its metadata `{BAND_ERRORS}` cannot be read: {e}"))?;
    Ok(Some(
        by_quantity
            .get(quantity.name())
            .cloned()
            .unwrap_or_default(),
    ))
}

/// The differences that show that the file was made from another database.
pub(super) fn origin(
    context: &CheckContext<'_>,
    database: &Database,
    diffuse: bool,
) -> Vec<String> {
    let provenance = provenance(database);
    // Files of version 0.1 have the attributes in its spelling.
    let former = context.store.former_attributes();
    let mut problems = Vec::new();
    let mut compare = |key: &str, stored: &Value| {
        match provenance.get(key) {
        Some(value) if value == stored || former.get(key) == Some(value) => {}
        // The identity shows the differences of the config line by line.
        Some(_) if key == "config" => {}
        Some(value) if key == "identity" => problems.extend(differing_lines(value, stored)),
        Some(value) => problems.push(format!(
            "it was made from another database: its {key} is {value}, but that of the database is {stored}"
        )),
        None if IDENTITY.contains(&key) => {
            problems.push(format!("its metadata `{PROVENANCE}` lack {key}"));
        }
        None => {}
    }
    };
    let attributes = context.store.attributes();
    for (key, stored) in &attributes {
        compare(key, stored);
    }
    if database.absent() != context.store.absent() {
        problems
            .push("the curves absent from it are not those absent from the database".to_owned());
    }
    let names = |axes: &Axes| {
        let names: Vec<_> = axes.iter().map(|(parameter, _)| parameter.name()).collect();
        names.join(", ")
    };
    let [stored, found] = [context.store.axes(), database.axes()];
    if names(stored) != names(found) {
        problems.push(format!(
            "its axes are {}, but those of the database are {}",
            names(found),
            names(stored)
        ));
        return problems;
    }
    // Files of version 1 hold single precision.
    let same = |a: &[f64], b: &[f64]| a.iter().map(|v| *v as f32).eq(b.iter().map(|v| *v as f32));
    for (parameter, values) in stored.iter() {
        // A file for isotropic light has one angle, which stands for all.
        let is_averaged = diffuse && parameter == Parameter::Incidence;
        if !is_averaged && !same(values, found.values(parameter)) {
            let name = parameter.name();
            problems.push(format!("its {name} differs from that of the database"));
        }
    }
    if !same(context.store.wavelengths_nm(), database.wavelengths_nm()) {
        problems.push("its wavelength_nm differs from that of the database".to_owned());
    }
    problems
}

/// The provenance in the file; null if there is none.
fn provenance(database: &Database) -> Value {
    let text = database.metadata().get(PROVENANCE);
    text.and_then(|text| serde_json::from_str(text).ok())
        .unwrap_or_default()
}

/// The illuminants and formula with which the colours of the file were compared; the default if
/// the file does not state them.
///
/// # Errors
/// A message if an illuminant or formula is unknown.
pub(crate) fn viewing(database: &Database) -> Result<Viewing, String> {
    match provenance(database).get("compression") {
        Some(stated) => Viewing::deserialize(stated).map_err(|e| e.to_string()),
        None => Ok(Viewing::default()),
    }
}

/// The request of the compression that made the file.
///
/// # Errors
/// A message if its metadata do not state it.
pub(super) fn request(database: &Database) -> Result<CompressionRequest, String> {
    #[derive(Deserialize)]
    struct Stated {
        components: Option<usize>,
        max_delta_e: Option<f64>,
        max_rmse: Option<f64>,
    }
    let missing = || "its metadata do not state how it was compressed".to_owned();
    let provenance = provenance(database);
    let stated = provenance.get("compression").ok_or_else(missing)?;
    let stated = Stated::deserialize(stated).map_err(|e| e.to_string())?;
    let choice = match (stated.components, stated.max_delta_e) {
        (Some(components), _) => Choice::Components(components),
        (None, Some(max_delta_e)) => Choice::Bounds(Compression {
            max_delta_e,
            max_rmse: stated.max_rmse,
        }),
        (None, None) => return Err(missing()),
    };
    let quantities = Quantity::ALL.into_iter();
    Ok(CompressionRequest {
        choice,
        variant: CompactVariant {
            basis: database.basis_kind(),
            precision: database.precision(),
        },
        quantities: quantities.filter(|q| database.has(*q)).collect(),
        viewing: viewing(database)?,
    })
}

/// Lines of the identity that are in the file or the database only.
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

/// Summary of the errors of existing curves, by row; `None` if there are none.
fn summary(errors: &[f64]) -> Option<RunningSummary> {
    let mut summary = RunningSummary::default();
    let existing = errors.iter().enumerate().filter(|(_, e)| !e.is_nan());
    existing.for_each(|(row, error)| summary.add(row, *error));
    Some(summary).filter(|summary| !summary.is_empty())
}
