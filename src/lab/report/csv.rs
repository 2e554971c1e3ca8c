//! Results of `tradeoff` as CSV (docs/formats.md).
use csv::Writer;

use super::ReportError;
use crate::engine::Resolution;
use crate::lab::tradeoff::{Metrics, Results, Setting};

/// All CSV files of `results`: names and contents.
pub(super) fn files(results: &Results) -> Result<Vec<(String, Vec<u8>)>, ReportError> {
    Ok(vec![
        ("tradeoff.csv".into(), errors(results)?),
        ("scaling.csv".into(), costs(results)?),
        ("components.csv".into(), components(results)?),
    ])
}

/// `value` with six digits, which exceeds the precision of all results.
fn digits(value: f64) -> String {
    format!("{value:.5e}")
}

/// The columns of a setting: engine, rays, table, streams.
fn setting(setting: &Setting) -> [String; 4] {
    let Resolution { table, streams, .. } = setting.resolution;
    [
        setting.engine.name().into(),
        setting.rays.to_string(),
        table.to_string(),
        streams.to_string(),
    ]
}

/// The columns of the errors: RMSE, largest absolute error, Delta-E.
fn metrics(metrics: &Metrics) -> [String; 3] {
    [
        digits(metrics.rmse),
        digits(metrics.max_abs),
        metrics.delta_e.map(digits).unwrap_or_default(),
    ]
}

/// The bytes of a finished table.
fn finish(writer: Writer<Vec<u8>>) -> Result<Vec<u8>, ReportError> {
    let bytes = writer.into_inner().map_err(|error| error.into_error());
    Ok(bytes.map_err(csv::Error::from)?)
}

/// The file `tradeoff.csv`.
fn errors(results: &Results) -> Result<Vec<u8>, ReportError> {
    let mut out = Writer::from_writer(Vec::new());
    out.write_record([
        "sample",
        "engine",
        "rays",
        "table",
        "streams",
        "kind",
        "band",
        "quantity",
        "wavelengths",
        "seeds",
        "cpu_seconds",
        "cpu_seconds_min",
        "cpu_seconds_max",
        "table_seconds",
        "rmse",
        "max_abs_error",
        "delta_e",
        "truth_rmse_se",
        "truth_max_abs_se",
        "truth_delta_e_se",
        "truth_rays",
        "reason",
    ])?;
    for row in &results.rows {
        let mut record = vec![row.sample.clone()];
        record.extend(setting(&row.setting));
        record.extend([row.kind.name(), row.band.name(), row.quantity.name()].map(String::from));
        record.push(row.band.wavelengths_nm().len().to_string());
        record.push(row.seeds.to_string());
        record.extend(row.cpu_seconds.map(digits));
        record.push(digits(row.table_seconds));
        record.extend(metrics(&row.error));
        record.extend(metrics(&row.floor));
        record.extend([row.truth_rays.to_string(), String::new()]);
        out.write_record(record)?;
    }
    for refusal in &results.refusals {
        let mut record = vec![refusal.sample.clone()];
        record.extend(setting(&refusal.setting));
        record.extend(["refused", refusal.band.name(), ""].map(String::from));
        record.push(refusal.band.wavelengths_nm().len().to_string());
        record.extend(std::iter::repeat_n(String::new(), 12));
        record.push(refusal.reason.clone());
        out.write_record(record)?;
    }
    finish(out)
}

/// The file `scaling.csv`.
fn costs(results: &Results) -> Result<Vec<u8>, ReportError> {
    let mut out = Writer::from_writer(Vec::new());
    out.write_record([
        "varied",
        "value",
        "engine",
        "rays",
        "table",
        "streams",
        "cpu_seconds",
    ])?;
    for cost in &results.costs {
        let mut record = vec![cost.variable.name().to_owned(), cost.value.to_string()];
        record.extend(setting(&cost.setting));
        record.push(digits(cost.cpu_seconds));
        out.write_record(record)?;
    }
    finish(out)
}

/// The file `components.csv`.
fn components(results: &Results) -> Result<Vec<u8>, ReportError> {
    let mut out = Writer::from_writer(Vec::new());
    out.write_record([
        "quantity",
        "basis",
        "precision",
        "components",
        "bytes",
        "cpu_seconds",
        "rmse_mean",
        "rmse_max",
        "delta_e_mean",
        "delta_e_max",
    ])?;
    for row in &results.components {
        let mut record = vec![
            row.quantity.name().to_owned(),
            row.coding.basis().name().to_owned(),
            row.coding.precision().to_owned(),
            row.components.to_string(),
            row.bytes.to_string(),
            digits(row.cpu_seconds),
        ];
        record.extend(row.rmse.map(digits));
        let colours = row.delta_e.map(|e| e.map(digits));
        record.extend(colours.unwrap_or_default());
        out.write_record(record)?;
    }
    finish(out)
}
