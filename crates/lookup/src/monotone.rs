//! Slopes at the nodes along the thickness, limited so that the cubic Hermite curve
//! through the nodes is monotone where the nodes are (Fritsch and Carlson 1980).
//!
//! `x` holds the coordinates of the nodes and `values` their values `[h][i]`, for
//! component or wavelength `i`. Node values may increase or decrease (R does over bright ground);
//! where they turn, the slope is 0. Functions treat all `i` of a node, so that loops vectorise.

/// Largest ratio of a slope to the smaller of the two neighbouring secants.
const LIMIT: f32 = 3.0;

/// Writes the slopes of the lines between nodes `h` and `h + 1`, `[h][i]`; 0 if they coincide.
#[inline(always)]
pub(super) fn secants(x: &[f32], values: &[Vec<f32>], secants: &mut [Vec<f32>]) {
    let nodes = x.windows(2).zip(values.windows(2));
    for (secants, (x, values)) in secants.iter_mut().zip(nodes) {
        let step = x[1] - x[0];
        if step <= 0.0 {
            secants.fill(0.0);
            continue;
        }
        for ((secant, before), after) in secants.iter_mut().zip(&values[0]).zip(&values[1]) {
            *secant = (after - before) / step;
        }
    }
}

/// Writes the slopes at node `h` of the parabolas through the node and its two neighbours.
#[inline(always)]
pub(super) fn slopes(x: &[f32], secants: &[Vec<f32>], h: usize, slopes: &mut [f32]) {
    let last = x.len() - 1;
    if last == 1 {
        return slopes.copy_from_slice(&secants[0]);
    }
    let middle = h.clamp(1, last - 1);
    let [before, after] = [x[middle] - x[middle - 1], x[middle + 1] - x[middle]];
    let sum = before + after;
    let pairs = secants[middle - 1].iter().zip(&secants[middle]);
    for (slope, (left, right)) in slopes.iter_mut().zip(pairs) {
        let at_middle = match sum > 0.0 {
            true => (left * after + right * before) / sum,
            false => 0.0,
        };
        *slope = match h {
            0 => 2.0 * left - at_middle,
            h if h == last => 2.0 * right - at_middle,
            _ => at_middle,
        };
    }
}

/// Writes the fractions (0 to 1) of the `slopes` at node `h` of `nodes` that keep the curves
/// monotone.
#[inline(always)]
pub(super) fn shares(
    (h, nodes): (usize, usize),
    secants: &[Vec<f32>],
    slopes: &[f32],
    shares: &mut [f32],
) {
    let [left, right] = [h.max(1) - 1, h.min(nodes - 2)].map(|h| &secants[h]);
    let sides = left.iter().zip(right);
    for ((share, slope), (left, right)) in shares.iter_mut().zip(slopes).zip(sides) {
        // without branches, so that the loop vectorises
        let upward = if left.max(*right) < 0.0 { -1.0 } else { 1.0 };
        let most = LIMIT * (upward * left).min(upward * right);
        let slope = upward * slope;
        let limited = if most > 0.0 { most / slope } else { 0.0 };
        let kept = if slope >= 0.0 { 1.0 } else { 0.0 };
        *share = if slope <= most { kept } else { limited };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cubics through the nodes `values` at `x`: 100 points between every two nodes.
    fn cubic(x: &[f32], values: &[f32]) -> Vec<Vec<f32>> {
        let columns: Vec<Vec<f32>> = values.iter().map(|y| vec![*y]).collect();
        let mut lines = vec![vec![0.0]; x.len() - 1];
        secants(x, &columns, &mut lines);
        let limited = |h| {
            let [mut slope, mut share] = [[0.0]; 2];
            slopes(x, &lines, h, &mut slope);
            shares((h, x.len()), &lines, &slope, &mut share);
            assert!((0.0..=1.0).contains(&share[0]), "{h}: {share:?}");
            share[0] * slope[0]
        };
        let slopes: Vec<f32> = (0..x.len()).map(limited).collect();
        let between = |h: usize| {
            let step = x[h + 1] - x[h];
            let point = |i: u8| {
                let t = f32::from(i) / 100.0;
                let left = 1.0 - t;
                (1.0 + 2.0 * t) * left * left * values[h]
                    + t * left * left * step * slopes[h]
                    + t * t * (3.0 - 2.0 * t) * values[h + 1]
                    - t * t * left * step * slopes[h + 1]
            };
            (0..=100).map(point).collect()
        };
        (0..x.len() - 1).map(between).collect()
    }

    /// Steps next to plateaus, where unlimited slopes would overshoot, upward and downward, and
    /// nodes that turn.
    #[test]
    fn cubics_are_monotone_between_nodes() {
        let x = [0.0, 1.0, 1.5, 3.0, 4.0, 4.2];
        let up = [0.0, 0.1, 5.0, 5.1, 5.1, 9.0];
        let down = up.map(|y| -y);
        // slopes of parabolas between those of unlike lines
        let curved = [9.0, 3.0, 2.0, 1.5, 1.4, 1.39];
        let turning = [0.0, 4.0, 1.0, 2.0, -1.0, -0.9];
        for values in [up, down, curved, curved.map(|y| -y), turning] {
            for (h, points) in cubic(&x, &values).iter().enumerate() {
                let sign = (values[h + 1] - values[h]).signum();
                for pair in points.windows(2) {
                    let rise = sign * (pair[1] - pair[0]);
                    assert!(rise >= -1e-5, "{values:?} {h}: {pair:?}");
                }
            }
        }
    }
}
