//! Results of `tradeoff` as text and as JSON.
use std::fmt::Write;

use serde_json::{Value, json};

use crate::engine::Engine;
use crate::lab::tradeoff::{
    Bound, Candidate, ChartPoint, Metrics, Recommendation, Results, Row, SpectralDomain, front,
    points, recommend,
};
use crate::measurement::Quantity;

/// A line of the table: both quantities of one setting.
struct TableLine<'a> {
    transmitted: &'a ChartPoint,
    reflected: &'a ChartPoint,
}

/// The lines of the table for one band.
fn lines(points: &[ChartPoint], band: SpectralDomain) -> Vec<TableLine<'_>> {
    let points_of = |quantity| {
        let matches = move |p: &&ChartPoint| (p.band, p.quantity) == (band, quantity);
        points.iter().filter(matches)
    };
    points_of(Quantity::Transmittance)
        .filter_map(|transmitted| {
            let same = |p: &&ChartPoint| {
                (p.setting, p.measured) == (transmitted.setting, transmitted.measured)
            };
            Some(TableLine {
                transmitted,
                reflected: points_of(Quantity::Reflectance).find(same)?,
            })
        })
        .collect()
}

/// The recommendations for all bounds.
fn recommendations(points: &[ChartPoint]) -> Vec<Recommendation> {
    let bounds = Bound::all().into_iter();
    bounds.map(|bound| recommend(bound, points)).collect()
}

/// The table of all settings, and the recommended engine for each bound.
#[must_use]
pub fn table(results: &Results) -> String {
    let points = points(&results.rows, results.samples.len());
    let seeds = results.rows.iter().map(|row| row.seeds).max().unwrap_or(0);
    let mut out = format!(
        "Errors: root mean square over {seeds} seeds, on the worst of {} sample{}. CPU time: one run of\n\
         one sample on one thread, mean over the samples.\n",
        results.samples.len(),
        if results.samples.len() == 1 { "" } else { "s" }
    );
    for engine in Engine::ALL
        .into_iter()
        .filter(|engine| engine.uses_tables())
    {
        let is_engine = |row: &&Row| row.setting.engine == engine;
        let table_seconds = results
            .rows
            .iter()
            .filter(is_engine)
            .map(|row| row.table_seconds);
        if let Some(seconds) = table_seconds.reduce(f64::max) {
            let (name, seconds) = (engine.name(), short(seconds));
            let _ = writeln!(
                out,
                "{name}: the grain tables, computed beforehand once per grain shape, took up to {seconds} CPU s."
            );
        }
    }
    for band in SpectralDomain::ALL {
        band_table(&mut out, &lines(&points, band), band, results.truth_rays);
    }
    if points.iter().any(|point| !point.measured) {
        out.push_str(
            "\n+ The operating point of Varsa 2025, not run: the error is binomial, and the cost is that of one\n  batch of rays times the number of batches.\n",
        );
    }
    if !results.refusals.is_empty() {
        out.push_str("Settings that an engine refused on some sample are left out:\n");
        for refusal in &results.refusals {
            let (setting, sample) = (&refusal.setting, &refusal.sample);
            let _ = writeln!(out, "  {setting} on {sample}: {}", refusal.reason);
        }
    }
    out.push_str(
        "\nThe cheapest measured setting that keeps the bound for both quantities on all samples\n\n",
    );
    let header = ["bound", "setting", "CPU s", "error"];
    let [bound, setting, cpu, error] = header;
    let _ = writeln!(out, "{bound:<32}{setting:<28}{cpu:>9}  {error:>9}");
    for recommendation in recommendations(&points) {
        let _ = writeln!(out, "{}", recommendation_line(&recommendation));
    }
    out
}

/// `value` with three digits, or with two digits and a power of ten.
fn short(value: f64) -> String {
    match value {
        0.001..1e5 => {
            let digits = 2 - value.log10().floor() as i32;
            format!("{value:.*}", digits.clamp(0, 5) as usize)
        }
        _ => format!("{value:.1e}"),
    }
}

/// The cells of a line: RMSE, largest error, Delta-E.
fn cells(metrics: &Metrics) -> String {
    let colour = metrics.delta_e.map_or(String::new(), short);
    let (rmse, max) = (short(metrics.rmse), short(metrics.max_abs));
    format!("{rmse:>9}{max:>9}{colour:>9}")
}

/// Writes the table of one band.
fn band_table(out: &mut String, lines: &[TableLine], band: SpectralDomain, truth_rays: u64) {
    let nm = band.wavelengths_nm();
    let (first, last) = (nm.first().copied(), nm.last().copied());
    let colour = if band == SpectralDomain::Visible {
        "Delta-E"
    } else {
        ""
    };
    let _ = writeln!(
        out,
        "\n{}-{} nm, {} wavelengths{:>30}{:>27}",
        first.unwrap_or_default(),
        last.unwrap_or_default(),
        nm.len(),
        "transmittance",
        "reflectance"
    );
    let columns = format!("{:>9}{:>9}{colour:>9}", "RMSE", "max");
    let header = format!("{:<28}{:>9}{columns}{columns}", "setting", "CPU s");
    let _ = writeln!(out, "{}", header.trim_end());
    // The Pareto front in CPU time and the larger RMSE of both quantities is marked.
    let worse = |line: &TableLine| line.transmitted.error.rmse.max(line.reflected.error.rmse);
    let coordinates: Vec<_> = lines
        .iter()
        .map(|line| {
            let seconds = line.transmitted.cpu_seconds;
            let measured = line.transmitted.measured;
            (if measured { seconds } else { f64::NAN }, worse(line))
        })
        .collect();
    let front = front(&coordinates);
    for (i, line) in lines.iter().enumerate() {
        let mark = match line.transmitted.measured {
            false => " +",
            true if front.contains(&i) => " *",
            true => "",
        };
        let setting = format!("{}{mark}", line.transmitted.setting);
        let row = format!(
            "{setting:<28}{:>9}{}{}",
            short(line.transmitted.cpu_seconds),
            cells(&line.transmitted.error),
            cells(&line.reflected.error)
        );
        let _ = writeln!(out, "{}", row.trim_end());
    }
    let floor = |part: fn(&TableLine) -> Metrics| lines.iter().map(part).reduce(Metrics::max);
    if let (Some(t), Some(r)) = (
        floor(|line| line.transmitted.floor),
        floor(|line| line.reflected.floor),
    ) {
        let label = format!("standard error of the truth, {truth_rays} rays");
        let row = format!("{label:<37}{}{}", cells(&t), cells(&r));
        let _ = writeln!(out, "{}", row.trim_end());
    }
    out.push_str("* no other setting is better in both CPU time and RMSE\n");
}

/// The line of the table for one bound.
fn recommendation_line(recommendation: &Recommendation) -> String {
    let Bound {
        measure,
        band,
        value,
    } = recommendation.bound;
    let band = band.name().replace('_', " ");
    let bound = format!("{} {value}, {band}", measure.name());
    let row = |c: &Candidate, setting: &str| {
        let (seconds, error) = (short(c.cpu_seconds), short(c.error));
        format!("{bound:<32}{setting:<28}{seconds:>9}  {error:>9}")
    };
    match (&recommendation.best, &recommendation.nearest) {
        (Some(best), _) => row(best, &best.setting),
        (None, Some(nearest)) => {
            let mut text = row(nearest, &format!("none; nearest {}", nearest.setting));
            if nearest.floor > value / 2.0 {
                let _ = write!(
                    text,
                    "  (the standard error of the truth is {})",
                    short(nearest.floor)
                );
            }
            text
        }
        (None, None) => format!("{bound:<32}no setting was measured"),
    }
}

/// The results as JSON.
#[must_use]
pub fn json(results: &Results) -> Value {
    let points = points(&results.rows, results.samples.len());
    let setting = |point: &ChartPoint| {
        json!({
            "engine": point.setting.engine.name(),
            "rays": point.setting.rays,
            "table": point.setting.resolution.table,
            "streams": point.setting.resolution.streams,
            "measured": point.measured,
            "band": point.band.name(),
            "quantity": point.quantity.name(),
            "cpu_seconds": point.cpu_seconds,
            "error": point.error,
            "truth_se": point.floor,
        })
    };
    let candidate = |candidate: &Option<Candidate>| {
        candidate.as_ref().map(|c| {
            json!({
                "engine": c.engine,
                "setting": c.setting,
                "cpu_seconds": c.cpu_seconds,
                "error": c.error,
                "truth_se": c.floor,
            })
        })
    };
    let recommendation = |r: &Recommendation| {
        json!({
            "measure": r.bound.measure,
            "band": r.bound.band.name(),
            "bound": r.bound.value,
            "recommended": candidate(&r.best),
            "nearest": candidate(&r.nearest),
        })
    };
    let refused = results.refusals.iter().map(|refusal| {
        json!({
            "sample": refusal.sample,
            "setting": refusal.setting.to_string(),
            "band": refusal.band.name(),
            "reason": refusal.reason,
        })
    });
    json!({
        "samples": results.samples,
        "truth_rays": results.truth_rays,
        "settings": points.iter().map(setting).collect::<Vec<_>>(),
        "recommendations": recommendations(&points).iter().map(recommendation).collect::<Vec<_>>(),
        "refused": refused.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn three_digits() {
        let texts = [0.0123456, 1.0, 23.46, 146.2, 0.001, 1e-4, 0.0].map(short);
        let expected = [
            "0.0123", "1.00", "23.5", "146", "0.00100", "1.0e-4", "0.0e0",
        ];
        assert_eq!(texts, expected);
    }
}
