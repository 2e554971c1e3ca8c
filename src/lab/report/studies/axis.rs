//! The scale of a BRDF, drawn as radius or as colour.

/// The scale from the centre of a plot to its rim, or from one end of a colour bar to the other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChartAxis {
    /// The labelled values, increasing; the first and the last are the ends of the scale.
    pub(super) ticks: Vec<f64>,
    logarithmic: bool,
}

/// Largest number of steps between the ticks of a linear axis.
const STEPS: f64 = 5.0;

impl ChartAxis {
    /// A linear axis that contains `values` (positive) and starts at 0 if `zero`.
    pub(super) fn linear(values: impl Iterator<Item = f64>, zero: bool) -> Self {
        let (low, high) = ends(values);
        let low = if zero { 0.0 } else { low };
        // The axis spans at least a tenth of the largest value.
        let span = (high - low).max(0.1 * high);
        let decade = 10_f64.powf((span / STEPS).log10().floor());
        let steps = [1.0, 2.0, 2.5, 5.0, 10.0].map(|digit| digit * decade);
        let step = steps.into_iter().find(|step| span / step <= STEPS);
        let step = step.unwrap_or(10.0 * decade);
        let places = (low / step).floor() as i64..=(high / step).ceil() as i64;
        Self {
            ticks: places.map(|place| place as f64 * step).collect(),
            logarithmic: false,
        }
    }

    /// A logarithmic axis that contains `values` (positive). Its ticks are 1, 2 and 5 times
    /// powers of ten; the first tick is below all values.
    pub(super) fn logarithmic(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = ends(values);
        let decades = low.log10().floor() as i32 - 1..=high.log10().ceil() as i32;
        let round = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|d| d * 10_f64.powi(decade)));
        let round: Vec<f64> = round.collect();
        let first = round.iter().rposition(|tick| *tick < low).unwrap_or(0);
        let last = round.iter().position(|tick| *tick >= high);
        Self {
            ticks: round[first..=last.unwrap_or(round.len() - 1)].to_vec(),
            logarithmic: true,
        }
    }

    /// The position of `value` on the axis, from 0 (first tick) to 1 (last tick).
    pub(super) fn share(&self, value: f64) -> f64 {
        let [Some(first), Some(last)] = [self.ticks.first(), self.ticks.last()] else {
            return 0.0;
        };
        let share = if self.logarithmic {
            (value / first).ln() / (last / first).ln()
        } else {
            (value - first) / (last - first)
        };
        share.clamp(0.0, 1.0)
    }
}

/// Smallest and largest of the positive `values`.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let positive = values.filter(|value| *value > 0.0);
    let ends = positive.fold(None, |ends: Option<(f64, f64)>, value| {
        let (low, high) = ends.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    });
    // Snow that reflects nothing has no positive value.
    ends.unwrap_or((1e-6, 1e-6))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(axis: &ChartAxis, ticks: &[f64]) -> bool {
        let pairs = axis.ticks.iter().zip(ticks);
        let near = pairs.fold(true, |near, (a, b)| near && (a - b).abs() < 1e-12);
        near && axis.ticks.len() == ticks.len()
    }

    #[test]
    fn axes_contain_their_values_and_end_at_round_numbers() {
        let values = || [0.27, 0.31, 0.48].into_iter();
        let from_zero = ChartAxis::linear(values(), true);
        assert!(
            near(&from_zero, &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5]),
            "{from_zero:?}"
        );
        assert!((from_zero.share(0.25) - 0.5).abs() < 1e-12);
        let close = ChartAxis::linear(values(), false);
        assert!(
            near(&close, &[0.25, 0.3, 0.35, 0.4, 0.45, 0.5]),
            "{close:?}"
        );
        let wide = ChartAxis::logarithmic([0.26, 19.0].into_iter());
        assert!(
            near(&wide, &[0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]),
            "{wide:?}"
        );
        assert!((wide.share(2.0) - 0.5).abs() < 1e-12);
        assert_eq!([wide.share(0.0), wide.share(30.0)], [0.0, 1.0]);
        for none in [
            ChartAxis::linear([0.0].into_iter(), true),
            ChartAxis::logarithmic([].into_iter()),
        ] {
            assert!(none.ticks.len() > 1 && none.share(0.0) == 0.0, "{none:?}");
        }
    }
}
