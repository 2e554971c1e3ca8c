//! Rows of a table as a spectrum.
use super::columns::{Columns, columns};
use super::error::{Problem, quoted};
use super::layout::{Cell, Layout, skipped};
use super::report::{By, Encoding, Format, MaskReason, Masked, Order, Report};
use super::{Content, Curve, Request, Sample, Scale, Unit};

/// A refusal and its line, from 1.
type Refusal = (Option<usize>, Problem);

/// Wavelengths whose median is below are in um: no snow is seen beyond.
const UM_BELOW: f64 = 100.0;
/// Values of which one in ten is above are percent: noise is rarer, and dark snow, for
/// which they may be mistaken, is then refused for what else it has.
const PERCENT_ABOVE: f64 = 3.0;
/// Three detectors meet two by two; one wavelength more often is another table.
const MOST_TIMES: usize = 4;

/// A row in the units of the file.
struct Row {
    line: usize,
    x: Option<f64>,
    y: Option<f64>,
    u: Option<f64>,
}

/// The rows of a table.
struct Rows {
    rows: Vec<Row>,
    /// Whether values have percent signs.
    percent_signs: bool,
    footer_lines: usize,
}

/// The spectrum in a table of `lines`.
pub(super) fn curve(
    lines: &[&str],
    layout: &Layout,
    encoding: Encoding,
    request: &Request,
) -> Result<Curve, Refusal> {
    let (preamble, body) = lines.split_at(layout.first);
    let format = format(preamble);
    let names = names(layout, format);
    let header_line = layout.header.as_ref().map(|(line, _)| *line);
    let columns = columns(&names, layout, format, preamble, request)
        .map_err(|problem| (header_line, problem))?;
    let found = rows(body, layout, names.len(), &columns)?;
    let rows = &found.rows;

    let (unit, unit_by) = columns
        .unit
        .unwrap_or_else(|| (guessed_unit(rows), By::Values));
    let nm = |x: f64| match unit {
        Unit::Nm => x,
        // 0.351 um is 351 nm, not 350.99999999999994; a tiny wavelength must not become 0
        Unit::Um => Some((x * 1e9).round() / 1e6)
            .filter(|nm| *nm > 0.0)
            .unwrap_or(x * 1e3),
    };
    let (low, high) = request.range_nm;
    let inside = |row: &&Row| row.x.is_some_and(|x| (low..=high).contains(&nm(x)));
    let judged = |row: &&Row| row.x.is_some_and(|x| !request.excluded(nm(x)));
    let power = columns.content.0 == Content::Power;
    let (scale, scale_by) = match (columns.scale, found.percent_signs) {
        _ if power => (None, By::Default),
        (Some((scale, by)), _) => (Some(scale), by),
        (None, true) => (Some(Scale::Percent), By::Name),
        (None, false) => {
            let judged: Vec<f64> = rows
                .iter()
                .filter(inside)
                .filter(judged)
                .filter_map(|row| row.y)
                .collect();
            (Some(guessed_scale(judged)), By::Values)
        }
    };
    let share = |y: f64| match scale {
        Some(Scale::Percent) => y / 100.0,
        _ => y,
    };

    let (mut samples, mut masked, mut bad_uncertainties) = (Vec::new(), Vec::new(), 0);
    let mut seen = 0;
    for row in rows.iter().filter(|row| row.x.is_none() || inside(row)) {
        let at = row.x.map(nm);
        let free = at.is_some_and(|nm| request.excluded(nm));
        let (nm, value) = match (at, row.y.map(share)) {
            (Some(nm), Some(value)) => (nm, value),
            (_, value) => {
                if !free {
                    masked.push(Masked {
                        line: row.line,
                        wavelength_nm: at,
                        value,
                        why: MaskReason::Missing,
                    });
                }
                continue;
            }
        };
        seen += usize::from(!free);
        let (least, most) = request.possible;
        if !free && !(least..=most).contains(&value) {
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
            usize::from(columns.uncertainty.is_some() && !free && uncertainty.is_none());
        samples.push(Sample {
            nm,
            value,
            uncertainty,
        });
    }
    plausible(&masked, seen, scale, columns.content.0, request)?;
    let order = order(&samples);
    let before = samples.len();
    let samples = merged(samples).map_err(|problem| (None, problem))?;
    if samples.is_empty() {
        let unit = unit.name();
        let rows = rows.len();
        return Err((
            None,
            Problem::Empty {
                rows,
                low,
                high,
                unit,
            },
        ));
    }
    let outside = rows.iter().filter(|row| row.x.is_some() && !inside(row));
    let report = Report {
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
        outside: outside.count(),
        merged: before - samples.len(),
        masked,
        bad_uncertainties,
        footer_lines: found.footer_lines,
    };
    Ok(Curve { samples, report })
}

/// The kind of a file that begins with these lines.
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

/// Names of the columns: those of the header, or those that the format has.
fn names(layout: &Layout, format: Format) -> Vec<String> {
    let width = layout.numeric.len();
    let fixed: &[&str] = match (&layout.header, format) {
        (Some((_, names)), _) => {
            let kept = names.iter().rposition(|name| !name.is_empty());
            return names[..kept.map_or(0, |last| last + 1)].to_vec();
        }
        // Reference and target are radiances or counts; the fourth is their ratio.
        (None, Format::Svc) if width >= 4 => {
            &["wavelength nm", "reference", "target", "reflectance %"]
        }
        _ => &[],
    };
    fixed.iter().map(|name| (*name).to_owned()).collect()
}

/// The rows of `body`, the lines of a text from the first row on.
fn rows(body: &[&str], layout: &Layout, named: usize, columns: &Columns) -> Result<Rows, Refusal> {
    let mut found = Rows {
        rows: Vec::new(),
        percent_signs: false,
        footer_lines: 0,
    };
    let (mut decimal, mut expected) = (None, named);
    let is_row = |line: &&str| {
        let cells = layout.separator.cells(line);
        cells.len() >= 2 && Cell::of(cells[columns.wavelength.min(cells.len() - 1)]) != Cell::Text
    };
    let last = body.iter().rposition(|line| !skipped(line) && is_row(line));
    let end = last.map_or(0, |last| last + 1);
    found.footer_lines = body[end..].iter().filter(|line| !skipped(line)).count();
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
            return Err(refuse(Problem::Cells {
                found: cells.len(),
                expected,
                row: quoted(line),
            }));
        }
        let mut take = |column: usize, what: &'static str| -> Result<_, Refusal> {
            // A row that ends early has no measurement there.
            let text = cells.get(column).copied().unwrap_or_default();
            match Cell::of(text) {
                Cell::Missing => Ok((None, false)),
                Cell::Text => {
                    let text = quoted(text);
                    Err(refuse(Problem::Number { text, what }))
                }
                Cell::Number {
                    value,
                    decimal: sign,
                    percent,
                } => {
                    if let Some(sign) = sign
                        && sign != *decimal.get_or_insert(sign)
                    {
                        return Err(refuse(Problem::Decimal(quoted(text))));
                    }
                    Ok((Some(value), percent))
                }
            }
        };
        let (x, _) = take(columns.wavelength, "the wavelength")?;
        if let Some(x) = x.filter(|x| *x <= 0.0) {
            return Err(refuse(Problem::Wavelength(x)));
        }
        let (y, percent) = take(columns.value, "the value")?;
        let u = match columns.uncertainty {
            Some(column) => take(column, "the uncertainty")?.0,
            None => None,
        };
        found.percent_signs |= percent;
        found.rows.push(Row {
            line: number,
            x,
            y,
            u,
        });
    }
    Ok(found)
}

/// The unit in which most wavelengths are those of light.
fn guessed_unit(rows: &[Row]) -> Unit {
    let mut x: Vec<f64> = rows.iter().filter_map(|row| row.x).collect();
    x.sort_by(f64::total_cmp);
    match x.get(x.len() / 2) {
        Some(median) if *median < UM_BELOW => Unit::Um,
        _ => Unit::Nm,
    }
}

fn guessed_scale(mut values: Vec<f64>) -> Scale {
    values.sort_by(f64::total_cmp);
    // Of few values the largest may be noise.
    let place = 9 * values.len().saturating_sub(1) / 10;
    match values.get(place) {
        Some(high) if *high > PERCENT_ABOVE => Scale::Percent,
        _ => Scale::Fraction,
    }
}

/// Refuses a spectrum of which the greater part cannot be: it is another quantity, or
/// in another scale.
fn plausible(
    masked: &[Masked],
    seen: usize,
    scale: Option<Scale>,
    content: Content,
    request: &Request,
) -> Result<(), Refusal> {
    let mut wrong = masked
        .iter()
        .filter(|row| row.why == MaskReason::Impossible);
    let impossible = wrong.clone().count();
    let percent = scale == Some(Scale::Percent);
    let in_file = |share: f64| if percent { 100.0 * share } else { share };
    let (low, high) = request.possible;
    match wrong.next() {
        Some(first) if 2 * impossible >= seen => Err((
            Some(first.line),
            Problem::Impossible {
                value: first.value.map_or(f64::NAN, in_file),
                nm: first.wavelength_nm.unwrap_or(f64::NAN),
                what: content.name(),
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

fn order(samples: &[Sample]) -> Order {
    let all = |holds: fn(f64, f64) -> bool| {
        samples.windows(2).all(|pair| match pair {
            [a, b] => holds(a.nm, b.nm),
            _ => true,
        })
    };
    match () {
        () if all(|a, b| a <= b) => Order::Ascending,
        () if all(|a, b| a >= b) => Order::Descending,
        () => Order::Mixed,
    }
}

/// By wavelength, each once: the mean where there are several.
fn merged(mut samples: Vec<Sample>) -> Result<Vec<Sample>, Problem> {
    samples.sort_by(|a, b| a.nm.total_cmp(&b.nm));
    let same = samples.chunk_by(|a, b| a.nm == b.nm);
    let one = |group: &[Sample]| {
        let (nm, times) = (group[0].nm, group.len());
        if times > MOST_TIMES {
            return Err(Problem::Stacked { nm, times });
        }
        let count = times as f64;
        let uncertain: Option<f64> = group.iter().map(|sample| sample.uncertainty).sum();
        Ok(Sample {
            nm,
            value: group.iter().map(|sample| sample.value).sum::<f64>() / count,
            // Not less than of one: neighbours mostly err alike.
            uncertainty: uncertain.map(|sum| sum / count),
        })
    };
    same.map(one).collect()
}
