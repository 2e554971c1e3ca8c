//! The scale of a BRDF, as radius or as colour.

/// From the centre of a plot to its rim, or from one end of a colour scale to the other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    /// Values that are labelled; the first and the last are its ends.
    pub(super) ticks: Vec<f64>,
    logarithmic: bool,
}

/// Most steps between ticks of a linear axis.
const STEPS: f64 = 5.0;

impl Axis {
    /// One that holds `values`, which are positive, and with `zero` begins there.
    pub(super) fn linear(values: impl Iterator<Item = f64>, zero: bool) -> Self {
        let (low, high) = ends(values);
        let low = if zero { 0.0 } else { low };
        // nearly equal values need no microscope
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

    /// One that holds `values`, which are positive, between powers of ten and 2 or 5
    /// times these; the first is a step below them all.
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

    /// Where `value` lies between the ends, which are 0 and 1.
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

/// Least and largest of `values` that are positive.
fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let positive = values.filter(|value| *value > 0.0);
    let ends = positive.fold(None, |ends: Option<(f64, f64)>, value| {
        let (low, high) = ends.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    });
    // snow that sends nothing back
    ends.unwrap_or((1e-6, 1e-6))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(axis: &Axis, ticks: &[f64]) -> bool {
        let pairs = axis.ticks.iter().zip(ticks);
        let near = pairs.fold(true, |near, (a, b)| near && (a - b).abs() < 1e-12);
        near && axis.ticks.len() == ticks.len()
    }

    #[test]
    fn axes_hold_their_values_between_round_ends() {
        let values = || [0.27, 0.31, 0.48].into_iter();
        let from_zero = Axis::linear(values(), true);
        assert!(
            near(&from_zero, &[0.0, 0.1, 0.2, 0.3, 0.4, 0.5]),
            "{from_zero:?}"
        );
        assert!((from_zero.share(0.25) - 0.5).abs() < 1e-12);
        let close = Axis::linear(values(), false);
        assert!(
            near(&close, &[0.25, 0.3, 0.35, 0.4, 0.45, 0.5]),
            "{close:?}"
        );
        let wide = Axis::logarithmic([0.26, 19.0].into_iter());
        assert!(
            near(&wide, &[0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]),
            "{wide:?}"
        );
        assert!((wide.share(2.0) - 0.5).abs() < 1e-12);
        assert_eq!([wide.share(0.0), wide.share(30.0)], [0.0, 1.0]);
        for none in [
            Axis::linear([0.0].into_iter(), true),
            Axis::logarithmic([].into_iter()),
        ] {
            assert!(none.ticks.len() > 1 && none.share(0.0) == 0.0, "{none:?}");
        }
    }
}
