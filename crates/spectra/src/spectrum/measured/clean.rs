//! Conversion of the rows of a table to a spectrum.
use super::columns::{Columns, columns};
use super::error::{ReadProblem, quoted};
use super::layout::{CellValue, TextLayout, skipped};
use super::report::{Encoding, Format, KnownFrom, MaskReason, Masked, Order, ReadReport};
use super::{Content, Curve, MeasuredValue, ReadOptions, Unit, ValueScale};

/// A problem and its line, from 1; no line if the problem is the whole file.
pub(super) type RowRefusal = (Option<usize>, ReadProblem);

/// Median wavelength below which wavelengths are taken as um: no spectrum of snow extends to
/// 100 um.
const UM_BELOW: f64 = 100.0;
/// Values are taken as percent if one in ten is above this. Noise exceeds it more rarely, and
/// dark snow mistaken for percent is refused because of its other values.
const PERCENT_ABOVE: f64 = 3.0;
/// Most rows of one wavelength. The overlaps of three detectors give fewer; more rows mean
/// that several tables follow one another.
const MOST_TIMES: usize = 4;

/// A row in the units of the file.
struct Row {
    /// Line in the file, from 1.
    line: usize,
    /// Wavelength.
    x: Option<f64>,
    /// Value.
    y: Option<f64>,
    /// Standard uncertainty of the value.
    u: Option<f64>,
}

/// The rows of a table.
struct Rows {
    rows: Vec<Row>,
    /// Whether values have percent signs.
    percent_signs: bool,
    footer_lines: usize,
}

/// Reads the spectrum from the table in `lines`.
pub(super) fn curve(
    lines: &[&str],
    layout: &TextLayout,
    encoding: Encoding,
    request: &ReadOptions,
) -> Result<Curve, RowRefusal> {
    let (preamble, body) = lines.split_at(layout.first);
    let format = format(preamble);
    let names = names(layout, format);
    let header_line = layout.header.as_ref().map(|(line, _)| *line);
    let columns = columns(&names, layout, format, preamble, request)
        .map_err(|problem| (header_line, problem))?;
    let table = rows(body, layout, names.len(), &columns)?;
    let rows = &table.rows;

    let (unit, unit_by) = columns
        .unit
        .unwrap_or_else(|| (guessed_unit(rows), KnownFrom::Values));
    let nm = |x: f64| match unit {
        Unit::Nm => x,
        // rounded: 0.351 um is 351 nm, not 350.99999999999994; but not to 0
        Unit::Um => Some((x * 1e9).round() / 1e6)
            .filter(|nm| *nm > 0.0)
            .unwrap_or(x * 1e3),
    };
    let (low, high) = request.range_nm;
    let inside = |row: &&Row| row.x.is_some_and(|x| (low..=high).contains(&nm(x)));
    let judged = |row: &&Row| row.x.is_some_and(|x| !request.excluded(nm(x)));
    let power = columns.content.0 == Content::Power;
    let (scale, scale_by) = match (columns.scale, table.percent_signs) {
        _ if power => (None, KnownFrom::Default),
        (Some((scale, by)), _) => (Some(scale), by),
        (None, true) => (Some(ValueScale::Percent), KnownFrom::Name),
        (None, false) => {
            let judged: Vec<f64> = rows
                .iter()
                .filter(inside)
                .filter(judged)
                .filter_map(|row| row.y)
                .collect();
            (Some(guessed_scale(judged)), KnownFrom::Values)
        }
    };
    let share = |y: f64| match scale {
        Some(ValueScale::Percent) => y / 100.0,
        _ => y,
    };

    let (mut samples, mut masked, mut bad_uncertainties) = (Vec::new(), Vec::new(), 0);
    let mut seen = 0;
    for row in rows.iter().filter(|row| row.x.is_none() || inside(row)) {
        let wavelength_nm = row.x.map(nm);
        let excluded = wavelength_nm.is_some_and(|nm| request.excluded(nm));
        let (nm, value) = match (wavelength_nm, row.y.map(share)) {
            (Some(nm), Some(value)) => (nm, value),
            (_, value) => {
                if !excluded {
                    masked.push(Masked {
                        line: row.line,
                        wavelength_nm,
                        value,
                        why: MaskReason::Missing,
                    });
                }
                continue;
            }
        };
        seen += usize::from(!excluded);
        let (least, most) = request.possible;
        if !excluded && !(least..=most).contains(&value) {
            masked.push(Masked {
                line: row.line,
                wavelength_nm: Some(nm),
                value: Some(value),
                why: MaskReason::Impossible,
            });
            continue;
        }
        let uncertainty = row.u.map(share).filter(|u| *u >= 0.0);
        bad_uncertainties +=
            usize::from(columns.uncertainty.is_some() && !excluded && uncertainty.is_none());
        samples.push(MeasuredValue {
            nm,
            value,
            uncertainty,
        });
    }
    check_plausible(&masked, seen, scale, columns.content.0, request)?;
    let order = order(&samples);
    let before = samples.len();
    let samples = merged(samples).map_err(|problem| (None, problem))?;
    let ends = |nm: &mut dyn Iterator<Item = f64>| {
        nm.fold(None, |ends: Option<(f64, f64)>, nm| {
            let (low, high) = ends.unwrap_or((nm, nm));
            Some((low.min(nm), high.max(nm)))
        })
    };
    let outside = || rows.iter().filter(|row| row.x.is_some() && !inside(row));
    let outside_nm = ends(&mut outside().filter_map(|row| row.x).map(nm));
    if samples.is_empty() {
        let unit = unit.name();
        let rows = rows.len();
        return Err((
            None,
            ReadProblem::Empty {
                rows,
                low,
                high,
                unit,
                outside_nm,
            },
        ));
    }
    let report = ReadReport {
        encoding,
        format,
        separated_by: layout.separator.name(),
        columns: layout.numeric.len().max(names.len()),
        wavelength_column: columns.wavelength + 1,
        column: columns.value + 1,
        name: names
            .get(columns.value)
            .map(|name| quoted(name))
            .unwrap_or_default(),
        column_by: columns.value_by,
        other_columns: columns.others,
        uncertainty_column: columns.uncertainty.map(|column| column + 1),
        content: columns.content.0,
        content_by: columns.content.1,
        unit,
        unit_by,
        scale,
        scale_by,
        order,
        rows: rows.len(),
        used: samples.len(),
        outside: outside().count(),
        outside_nm,
        merged: before - samples.len(),
        masked,
        bad_uncertainties,
        footer_lines: table.footer_lines,
    };
    Ok(Curve { samples, report })
}

/// The format of a file, from the lines before the table.
fn format(preamble: &[&str]) -> Format {
    let begins = |line: &str, with: &str| {
        let start = line.trim_start().get(..with.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(with))
    };
    let any = |with: &str| preamble.iter().any(|line| begins(line, with));
    match () {
        () if any("/*** Spectra Vista") => Format::Svc,
        () if any("Columns [") && any("Data:") => Format::SpectralEvolution,
        () if any("X Units:") && any("Y Units:") => Format::Ecostress,
        () => Format::Table,
    }
}

/// Names of the columns, from the header or from the format.
fn names(layout: &TextLayout, format: Format) -> Vec<String> {
    let width = layout.numeric.len();
    let fixed: &[&str] = match (&layout.header, format) {
        (Some((_, names)), _) => {
            let last = names.iter().rposition(|name| !name.is_empty());
            return names[..last.map_or(0, |last| last + 1)].to_vec();
        }
        // Reference and target are radiances or counts; the fourth column is their ratio.
        (None, Format::Svc) if width >= 4 => {
            &["wavelength nm", "reference", "target", "reflectance %"]
        }
        _ => &[],
    };
    fixed.iter().map(|name| (*name).to_owned()).collect()
}

/// Reads the rows from `body`, the lines of the file from the first row on. `named` is the
/// number of named columns.
fn rows(
    body: &[&str],
    layout: &TextLayout,
    named: usize,
    columns: &Columns,
) -> Result<Rows, RowRefusal> {
    let mut table = Rows {
        rows: Vec::new(),
        percent_signs: false,
        footer_lines: 0,
    };
    let (mut decimal, mut expected) = (None, named);
    let is_row = |line: &&str| {
        let cells = layout.separator.cells(line);
        cells.len() >= 2
            && CellValue::parse(cells[columns.wavelength.min(cells.len() - 1)]) != CellValue::Text
    };
    let last = body.iter().rposition(|line| !skipped(line) && is_row(line));
    let end = last.map_or(0, |last| last + 1);
    table.footer_lines = body[end..].iter().filter(|line| !skipped(line)).count();
    for (i, line) in body[..end].iter().enumerate() {
        if skipped(line) {
            continue;
        }
        let number = layout.first + i + 1;
        let refuse = |problem| (Some(number), problem);
        let mut cells = layout.separator.cells(line);
        while cells.len() > expected.max(1) && cells.last().is_some_and(|cell| cell.is_empty()) {
            cells.pop();
        }
        if expected == 0 {
            expected = cells.len();
        }
        if cells.len() > expected {
            return Err(refuse(ReadProblem::Cells {
                found: cells.len(),
                expected,
                row: quoted(line),
            }));
        }
        let mut take = |column: usize, quantity: &'static str| -> Result<_, RowRefusal> {
            // A short row has no measurement in the missing columns.
            let text = cells.get(column).copied().unwrap_or_default();
            match CellValue::parse(text) {
                CellValue::Missing => Ok((None, false)),
                CellValue::Text => {
                    let text = quoted(text);
                    Err(refuse(ReadProblem::Number { text, quantity }))
                }
                CellValue::Number {
                    value,
                    decimal: sign,
                    percent,
                } => {
                    if let Some(sign) = sign
                        && sign != *decimal.get_or_insert(sign)
                    {
                        return Err(refuse(ReadProblem::Decimal(quoted(text))));
                    }
                    Ok((Some(value), percent))
                }
            }
        };
        let (x, _) = take(columns.wavelength, "the wavelength")?;
        if let Some(x) = x.filter(|x| *x <= 0.0) {
            return Err(refuse(ReadProblem::Wavelength(x)));
        }
        let (y, percent) = take(columns.value, "the value")?;
        let u = match columns.uncertainty {
            Some(column) => take(column, "the uncertainty")?.0,
            None => None,
        };
        table.percent_signs |= percent;
        table.rows.push(Row {
            line: number,
            x,
            y,
            u,
        });
    }
    Ok(table)
}

/// The unit of the wavelengths, guessed from their median.
fn guessed_unit(rows: &[Row]) -> Unit {
    let mut x: Vec<f64> = rows.iter().filter_map(|row| row.x).collect();
    x.sort_by(f64::total_cmp);
    match x.get(x.len() / 2) {
        Some(median) if *median < UM_BELOW => Unit::Um,
        _ => Unit::Nm,
    }
}

/// The scale of the values, guessed from their 90th percentile: the largest may be noise.
fn guessed_scale(mut values: Vec<f64>) -> ValueScale {
    values.sort_by(f64::total_cmp);
    let place = 9 * values.len().saturating_sub(1) / 10;
    match values.get(place) {
        Some(high) if *high > PERCENT_ABOVE => ValueScale::Percent,
        _ => ValueScale::Fraction,
    }
}

/// Refuses a spectrum if at least half of its values are impossible: it is another quantity,
/// or on another scale.
fn check_plausible(
    masked: &[Masked],
    seen: usize,
    scale: Option<ValueScale>,
    content: Content,
    request: &ReadOptions,
) -> Result<(), RowRefusal> {
    let mut wrong = masked
        .iter()
        .filter(|row| row.why == MaskReason::Impossible);
    let impossible = wrong.clone().count();
    let percent = scale == Some(ValueScale::Percent);
    let in_file = |share: f64| if percent { 100.0 * share } else { share };
    let (low, high) = request.possible;
    match wrong.next() {
        Some(first) if 2 * impossible >= seen => Err((
            Some(first.line),
            ReadProblem::Impossible {
                value: first.value.map_or(f64::NAN, in_file),
                nm: first.wavelength_nm.unwrap_or(f64::NAN),
                quantity: content.name(),
                low: in_file(low),
                high: in_file(high),
                percent,
                impossible,
                rows: seen,
                excludable: if request.excluded_nm.is_empty() {
                    ""
                } else {
                    "yes"
                },
            },
        )),
        _ => Ok(()),
    }
}

fn order(samples: &[MeasuredValue]) -> Order {
    let all_pairs = |holds: fn(f64, f64) -> bool| {
        samples.windows(2).all(|pair| match pair {
            [a, b] => holds(a.nm, b.nm),
            _ => true,
        })
    };
    match () {
        () if all_pairs(|a, b| a <= b) => Order::Ascending,
        () if all_pairs(|a, b| a >= b) => Order::Descending,
        () => Order::Mixed,
    }
}

/// Sorts samples by wavelength and replaces those of equal wavelength by their mean.
fn merged(mut samples: Vec<MeasuredValue>) -> Result<Vec<MeasuredValue>, ReadProblem> {
    samples.sort_by(|a, b| a.nm.total_cmp(&b.nm));
    let same = samples.chunk_by(|a, b| a.nm == b.nm);
    let mean = |group: &[MeasuredValue]| {
        let (nm, times) = (group[0].nm, group.len());
        if times > MOST_TIMES {
            return Err(ReadProblem::Stacked { nm, times });
        }
        let count = times as f64;
        let uncertain: Option<f64> = group.iter().map(|sample| sample.uncertainty).sum();
        Ok(MeasuredValue {
            nm,
            value: group.iter().map(|sample| sample.value).sum::<f64>() / count,
            // The mean, not reduced by averaging: errors of such rows are mostly correlated.
            uncertainty: uncertain.map(|sum| sum / count),
        })
    };
    same.map(mean).collect()
}
