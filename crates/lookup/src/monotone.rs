//! Slopes at the nodes along the thickness, limited so that the cubic Hermite curve
//! through the nodes is monotone where the nodes are (Fritsch and Carlson 1980).
//!
//! `x` holds the coordinates of the nodes and `values` their values `[h][i]`, for
//! component or wavelength `i`. Where the node values decrease, the slope is 0 and the
//! curve decreases with them.

/// Largest ratio of a slope to the smaller of the two neighbouring secants.
const LIMIT: f32 = 3.0;

/// Slope of the line between nodes `h` and `h + 1`; 0 if they coincide.
fn secant(x: &[f32], values: &[Vec<f32>], h: usize, i: usize) -> f32 {
    let step = x[h + 1] - x[h];
    if step > 0.0 {
        (values[h + 1][i] - values[h][i]) / step
    } else {
        0.0
    }
}

/// Slope at node `h` of the parabola through the node and its two neighbours.
pub(super) fn slope(x: &[f32], values: &[Vec<f32>], h: usize, i: usize) -> f32 {
    let last = x.len() - 1;
    if last == 1 {
        return secant(x, values, 0, i);
    }
    let middle = h.clamp(1, last - 1);
    let [left, right] = [middle - 1, middle].map(|h| secant(x, values, h, i));
    let [before, after] = [x[middle] - x[middle - 1], x[middle + 1] - x[middle]];
    let at_middle = match before + after > 0.0 {
        true => (left * after + right * before) / (before + after),
        false => 0.0,
    };
    match h {
        0 => 2.0 * left - at_middle,
        h if h == last => 2.0 * right - at_middle,
        _ => at_middle,
    }
}

/// Fraction (0 to 1) of the slope at node `h` that keeps the curve monotone.
pub(super) fn share(x: &[f32], values: &[Vec<f32>], h: usize, i: usize) -> f32 {
    let last = x.len() - 1;
    let beside = [h.max(1) - 1, h.min(last - 1)].map(|h| secant(x, values, h, i));
    let most = LIMIT * beside[0].min(beside[1]);
    let slope = slope(x, values, h, i);
    if slope <= most {
        return if slope >= 0.0 { 1.0 } else { 0.0 };
    }
    (most / slope).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps next to plateaus, where unlimited slopes would overshoot.
    #[test]
    fn a_cubic_through_a_step_is_monotone() {
        let x = [0.0, 1.0, 1.5, 3.0, 4.0, 4.2];
        let values: Vec<Vec<f32>> = [0.0, 0.1, 5.0, 5.1, 5.1, 9.0].map(|y| vec![y]).into();
        let slopes: Vec<f32> = (0..6)
            .map(|h| share(&x, &values, h, 0) * slope(&x, &values, h, 0))
            .collect();
        for h in 0..5 {
            let (step, mut before) = (x[h + 1] - x[h], values[h][0]);
            for i in 1..=100 {
                let t = i as f32 / 100.0;
                let left = 1.0 - t;
                let y = (1.0 + 2.0 * t) * left * left * values[h][0]
                    + t * left * left * step * slopes[h]
                    + t * t * (3.0 - 2.0 * t) * values[h + 1][0]
                    - t * t * left * step * slopes[h + 1];
                assert!(y >= before - 1e-5, "{h} {t}: {before} {y}");
                before = y;
            }
        }
    }
}
