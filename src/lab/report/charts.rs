//! The figures of `tradeoff` and their contents.
use super::figure::{Figure, Symbol};
use super::panel::{Panel, Series};
use super::style::Style;
use crate::engine::Engine;
use crate::lab::tradeoff::{
    ChartPoint, Coding, Components, Measure, Results, ScalingVariable, SpectralDomain, front,
    points,
};
use crate::measurement::Quantity;

/// A figure with the name of its files.
pub(super) struct Chart {
    pub(super) name: &'static str,
    pub(super) figure: Figure,
}

/// All charts of `results`.
pub(super) fn all(results: &Results) -> Vec<Chart> {
    let chart = |(name, figure)| Chart { name, figure };
    [
        ("tradeoff", tradeoff(results)),
        ("scaling", scaling(results)),
        ("components", components(&results.components)),
    ]
    .map(chart)
    .into()
}

/// Error against CPU time, over all samples.
fn tradeoff(results: &Results) -> Figure {
    let points = points(&results.rows, results.samples.len());
    let errors_of = |quantity, band, measure| {
        points
            .iter()
            .filter(|p: &&ChartPoint| (p.quantity, p.band) == (quantity, band))
            .filter_map(|p| Some((p, measure_of(measure, p)?)))
            .collect()
    };
    let visible = errors_of(
        Quantity::Transmittance,
        SpectralDomain::Visible,
        Measure::Rmse,
    );
    let infrared = errors_of(
        Quantity::Reflectance,
        SpectralDomain::NearInfrared,
        Measure::Rmse,
    );
    let colour = larger(
        errors_of(
            Quantity::Transmittance,
            SpectralDomain::Visible,
            Measure::DeltaE,
        ),
        &errors_of(
            Quantity::Reflectance,
            SpectralDomain::Visible,
            Measure::DeltaE,
        ),
    );
    let seeds = results.rows.iter().map(|row| row.seeds).max().unwrap_or(0);
    let mut legend = engines(points.iter().map(|p| p.setting.engine));
    if points.iter().any(|p| !p.measured) {
        let text =
            "baseline of Varsa 2025: reference, 1e5 rays (binomial error, extrapolated cost)";
        legend.push((Symbol::Series(Style::BASELINE), text.into()));
    }
    let remarks = [
        (
            Symbol::Front,
            "Pareto front of what was measured; numbers are rays".into(),
        ),
        (
            Symbol::Floor,
            format!(
                "below the standard error of the truth ({} rays), where nothing is resolved",
                results.truth_rays
            ),
        ),
        (
            Symbol::None,
            format!("errors: root mean square over {seeds} seeds, worst of the samples"),
        ),
        (
            Symbol::None,
            "time: one run of one sample on one thread, mean over the samples, tables there before"
                .into(),
        ),
        (
            Symbol::None,
            format!("samples: {}", results.samples.join(", ")),
        ),
    ];
    legend.extend(remarks);
    Figure {
        panels: vec![
            errors("Transmittance, 400-700 nm", "RMSE", visible),
            errors("Reflectance, 700-1400 nm", "RMSE", infrared),
            errors("Colour, the larger of both quantities", "ΔE*ab", colour),
        ],
        legend,
    }
}

/// A point with its error and the standard error of its truth.
type PointError<'a> = (&'a ChartPoint, (f64, f64));

/// The error of a point and the standard error of its truth in one measure.
fn measure_of(measure: Measure, point: &ChartPoint) -> Option<(f64, f64)> {
    Some((measure.of(&point.error)?, measure.of(&point.floor)?))
}

/// The points in both lists, each with the larger of its two errors.
fn larger<'a>(first: Vec<PointError<'a>>, second: &[PointError]) -> Vec<PointError<'a>> {
    first
        .into_iter()
        .filter_map(|(point, (error, floor))| {
            let same = |(other, _): &&PointError| {
                (other.setting, other.measured) == (point.setting, point.measured)
            };
            let (_, other) = second.iter().find(same)?;
            Some((point, (error.max(other.0), floor.max(other.1))))
        })
        .collect()
}

/// The panel of errors against CPU time.
fn errors(title: &str, y: &str, points: Vec<PointError>) -> Panel {
    let coordinate = |(point, (error, _)): &PointError| (point.cpu_seconds, *error);
    let measured: Vec<&PointError> = points.iter().filter(|(point, _)| point.measured).collect();
    let coordinates: Vec<_> = measured.iter().map(|point| coordinate(point)).collect();
    let front: Vec<usize> = front(&coordinates);
    let rays = |i: &usize| (coordinates[*i], measured[*i].0.setting.accuracy());
    let series = |style: fn(&ChartPoint) -> Style, is_measured: bool| {
        let selected = points
            .iter()
            .filter(move |(point, _)| point.measured == is_measured);
        selected.map(move |point| Series {
            style: style(point.0),
            points: vec![coordinate(point)],
            joined: false,
        })
    };
    Panel {
        title: title.into(),
        x: "CPU seconds per spectrum".into(),
        y: y.into(),
        series: series(|point| Style::of(point.setting.engine), true)
            .chain(series(|_| Style::BASELINE, false))
            .collect(),
        labels: front.iter().map(rays).collect(),
        front: front.iter().map(|&i| coordinates[i]).collect(),
        floor: points.iter().map(|(_, (_, floor))| *floor).reduce(f64::max),
    }
}

/// A line of the legend for each of the `engines`.
fn engines(engines: impl Iterator<Item = Engine> + Clone) -> Vec<(Symbol, String)> {
    Engine::ALL
        .into_iter()
        .filter(|engine| engines.clone().any(|other| other == *engine))
        .map(|engine| (Symbol::Series(Style::of(engine)), engine.name().into()))
        .collect()
}

/// Cost against the size of the request.
fn scaling(results: &Results) -> Figure {
    let panel = |variable: ScalingVariable| {
        let (title, x) = match variable {
            ScalingVariable::Thickness => ("One slab, ever thicker", "thickness, cm"),
            ScalingVariable::Wavelengths => ("More wavelengths in 400-700 nm", "wavelengths"),
            ScalingVariable::Thicknesses => {
                ("More slabs at once, the thickest 12 cm", "thicknesses")
            }
            ScalingVariable::Angles => ("More angles of incidence", "angles"),
        };
        let series_of = |engine: &Engine| {
            let costs = results.costs.iter();
            let selected = costs.filter(|c| c.variable == variable && c.setting.engine == *engine);
            Series {
                style: Style::of(*engine),
                points: selected.map(|c| (c.value, c.cpu_seconds)).collect(),
                joined: true,
            }
        };
        let series = Engine::ALL.iter().map(series_of);
        Panel {
            title: title.into(),
            x: x.into(),
            y: "CPU seconds".into(),
            series: series.filter(|series| !series.points.is_empty()).collect(),
            ..Panel::default()
        }
    };
    let mut legend: Vec<(Symbol, String)> = Vec::new();
    for cost in &results.costs {
        let text = format!("{} (rays)", cost.setting);
        if legend.iter().all(|(_, other)| *other != text) {
            legend.push((Symbol::Series(Style::of(cost.setting.engine)), text));
        }
    }
    let sample = results.samples.first().map_or("", String::as_str);
    legend.push((
        Symbol::None,
        format!("grains of {sample}; otherwise one slab of 12 cm, 31 wavelengths, one angle"),
    ));
    Figure {
        panels: ScalingVariable::ALL.map(panel).into(),
        legend,
    }
}

/// Errors of compression against its costs, for each variant of the file.
fn components(rows: &[Components]) -> Figure {
    type RowValue = fn(&Components) -> Option<f64>;
    let bytes: RowValue = |row| Some(row.bytes as f64);
    // Coefficients are decoded when a file is read, so the time is the same for all precisions.
    let time: RowValue = |row| {
        let decoded = matches!(row.coding, Coding::Linear | Coding::Log);
        decoded.then_some(row.cpu_seconds)
    };
    let colour: RowValue = |row| row.delta_e.map(|e| e[1]);
    let rmse: RowValue = |row| Some(row.rmse[1]);
    let panel = |title: &str,
                 quantity: Quantity,
                 (x, cost): (&str, RowValue),
                 (y, error): (&str, RowValue)| {
        let coordinate = |row: &Components| Some((cost(row)?, error(row)?));
        let series = |(i, coding): (usize, Coding)| {
            let selected = rows.iter();
            let selected = selected.filter(|row| row.quantity == quantity && row.coding == coding);
            Series {
                style: Style::numbered(i),
                points: selected.filter_map(coordinate).collect(),
                // No line, because the errors of this variant follow the bound, not the bytes.
                joined: coding != Coding::LogNarrow,
            }
        };
        let labelled = rows.iter().filter(|row| row.quantity == quantity);
        let labels =
            labelled.filter_map(|row| Some((coordinate(row)?, row.components.to_string())));
        Panel {
            title: title.into(),
            x: x.into(),
            y: y.into(),
            series: Coding::ALL.into_iter().enumerate().map(series).collect(),
            labels: labels.collect(),
            ..Panel::default()
        }
    };
    let size = ("bytes of coefficients and basis", bytes);
    let (colour, rmse) = (("ΔE*ab", colour), ("RMSE", rmse));
    let time = ("CPU seconds to rebuild a spectrum", time);
    let [first, second] = Quantity::ALL;
    let mut legend: Vec<_> = Coding::ALL
        .into_iter()
        .enumerate()
        .map(|(i, coding)| {
            let precision = match coding {
                Coding::LogIntegers => "quantised to 16 bits",
                Coding::LogNarrow => "quantised to 8 bits where ΔE*ab stays below 2.3",
                other => other.precision(),
            };
            let text = format!("{} basis, {precision}", coding.basis().name());
            (Symbol::Series(Style::numbered(i)), text)
        })
        .collect();
    let remarks = [
        "numbers are components; errors are those of the worst curve",
        "linear, f32: the compression of Varsa 2025",
    ];
    legend.extend(remarks.map(|text| (Symbol::None, text.into())));
    Figure {
        panels: vec![
            panel("Transmittance: colour and size", first, size, colour),
            panel("Reflectance: colour and size", second, size, colour),
            panel("Transmittance: RMSE and size", first, size, rmse),
            panel("Reflectance: RMSE and size", second, size, rmse),
            panel("Transmittance: colour and time", first, time, colour),
        ],
        legend,
    }
}
