//! Slopes of a column of nodes along the thickness, limited so that a cubic
//! (Hermite) through them does not turn where the nodes do not (Fritsch and
//! Carlson 1980). `x` are the places of the nodes, `values` theirs, `[h][i]`, of
//! which component or wavelength `i` is meant. Where nodes themselves fall, the
//! slope is 0 and the curve falls with them.

/// Most by which a slope may exceed the smaller secant beside it.
const LIMIT: f32 = 3.0;

/// Slope of the line between nodes `h` and `h + 1`; 0 where they fall together.
fn secant(x: &[f32], values: &[Vec<f32>], h: usize, i: usize) -> f32 {
    let step = x[h + 1] - x[h];
    if step > 0.0 {
        (values[h + 1][i] - values[h][i]) / step
    } else {
        0.0
    }
}

/// Slope at node `h` of the parabola through it and its neighbours.
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

/// Share of the slope at node `h` that keeps its curve from turning.
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

    /// Steps beside level stretches: unlimited slopes would overshoot.
    #[test]
    fn a_cubic_through_a_step_does_not_turn() {
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
