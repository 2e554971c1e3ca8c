//! Points of the chart: each combines the results of one setting on all samples.
use std::collections::BTreeSet;

use super::{Metrics, Row, RowKind, Setting, SpectralDomain};
use crate::measurement::Quantity;

/// The results of one setting, quantity and band on all samples.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartPoint {
    /// The setting.
    pub setting: Setting,
    /// Whether the setting was run, rather than extrapolated.
    pub measured: bool,
    /// Band of wavelengths.
    pub band: SpectralDomain,
    /// Quantity that was compared.
    pub quantity: Quantity,
    /// CPU seconds of one run of the band, mean over the samples.
    pub cpu_seconds: f64,
    /// Errors, the largest over the samples.
    pub error: Metrics,
    /// Standard errors of the truths, the largest over the samples.
    pub floor: Metrics,
}

/// The points of `rows`, in their order. A setting that does not have a row for each of
/// `samples` samples is left out, because its error cannot be compared with the others.
#[must_use]
pub fn points(rows: &[Row], samples: usize) -> Vec<ChartPoint> {
    let mut points: Vec<ChartPoint> = Vec::new();
    for row in rows {
        let same = |other: &&Row| {
            (other.setting, other.kind) == (row.setting, row.kind)
                && (other.band, other.quantity) == (row.band, row.quantity)
        };
        let measured = row.kind == RowKind::Measured;
        let is_known = |point: &ChartPoint| {
            (point.setting, point.measured) == (row.setting, measured)
                && (point.band, point.quantity) == (row.band, row.quantity)
        };
        if points.iter().any(is_known) {
            continue;
        }
        let group: Vec<&Row> = rows.iter().filter(same).collect();
        let names: BTreeSet<&str> = group.iter().map(|row| row.sample.as_str()).collect();
        if names.len() < samples {
            continue;
        }
        let largest = |part: fn(&Row) -> Metrics| {
            let metrics = group.iter().map(|row| part(row));
            metrics.reduce(Metrics::max).unwrap_or_default()
        };
        let seconds: f64 = group.iter().map(|row| row.cpu_seconds[0]).sum();
        points.push(ChartPoint {
            setting: row.setting,
            measured,
            band: row.band,
            quantity: row.quantity,
            cpu_seconds: seconds / group.len() as f64,
            error: largest(|row| row.error),
            floor: largest(|row| row.floor),
        });
    }
    points
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::engine::{Engine, Resolution};

    fn row(sample: &str, rays: u64, cpu: f64, rmse: f64, quantity: Quantity) -> Row {
        let metrics = |rmse| Metrics {
            rmse,
            max_abs: 2.0 * rmse,
            delta_e: None,
        };
        Row {
            sample: sample.into(),
            setting: Setting {
                engine: Engine::Reference,
                rays,
                resolution: Resolution::default(),
            },
            kind: RowKind::Measured,
            seeds: 1,
            band: SpectralDomain::NearInfrared,
            quantity,
            cpu_seconds: [cpu, 0.0, 100.0],
            table_seconds: 0.0,
            error: metrics(rmse),
            floor: metrics(rmse / 10.0),
            truth_rays: 1,
        }
    }

    #[test]
    fn mean_cost_and_worst_error_of_complete_settings() {
        let t = Quantity::Transmittance;
        let rows = [
            row("a", 4, 1.0, 0.25, t),
            row("b", 4, 3.0, 0.125, t),
            row("a", 16, 4.0, 0.125, t),
            row("a", 4, 1.0, 0.5, Quantity::Reflectance),
        ];
        let found = points(&rows, 2);
        assert_eq!(found.len(), 1);
        let point = &found[0];
        assert_eq!((point.setting.rays, point.quantity), (4, t));
        assert_eq!(point.cpu_seconds, 2.0);
        assert_eq!(point.error, rows[0].error);
        assert_eq!(point.floor, rows[0].floor);
        assert_eq!(points(&rows[..1], 1)[0].error.max_abs, 0.5);
    }
}
