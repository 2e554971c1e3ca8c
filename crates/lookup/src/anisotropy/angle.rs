//! Cubic Hermite curves through the nodes of an angle.

/// The nodes of an angle, degrees, and their mirror images beyond the ends.
#[derive(Debug, Clone)]
pub(super) struct AngleAxis {
    /// The first node and the last.
    pub(super) ends: [f64; 2],
    /// Number of nodes.
    pub(super) count: usize,
    places: Vec<f64>,
    /// Node of each place, and whether it is on the other side of the normal.
    nodes: Vec<(usize, bool)>,
}

/// Up to four nodes with their weights.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stencil {
    nodes: [(usize, bool); 4],
    weights: [f64; 4],
    count: usize,
}

impl Stencil {
    /// Each node, whether it is on the other side of the normal, and its weight.
    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = ((usize, bool), f64)> {
        let pairs = self.nodes.iter().zip(&self.weights);
        pairs
            .take(self.count)
            .map(|(node, weight)| (*node, *weight))
    }
}

impl AngleAxis {
    /// The axis of these values. It goes on beyond its first value with its mirror image
    /// if `mirrored[0]`, and likewise beyond its last.
    pub(super) fn new(values: &[f64], mirrored: [bool; 2], other_side: bool) -> Self {
        let own = values.iter().enumerate();
        let mut places: Vec<(f64, (usize, bool))> =
            own.map(|(node, value)| (*value, (node, false))).collect();
        if let (Some([first, second]), true) = (values.first_chunk(), mirrored[0]) {
            places.insert(0, (2.0 * first - second, (1, other_side)));
        }
        if let (Some([before, last]), true) = (values.last_chunk(), mirrored[1]) {
            places.push((2.0 * last - before, (values.len() - 2, other_side)));
        }
        let (places, nodes) = places.into_iter().unzip();
        Self {
            ends: [values[0], values[values.len() - 1]],
            count: values.len(),
            places,
            nodes,
        }
    }

    /// The nodes around `x`, which is within the axis, and their weights in a cubic Hermite
    /// curve.
    pub(super) fn stencil(&self, x: f64) -> Stencil {
        let (places, n) = (&self.places, self.places.len());
        let mut stencil = Stencil::default();
        let above = places.partition_point(|place| *place <= x);
        let cell = above.saturating_sub(1).min(n.saturating_sub(2));
        if n < 2 || places[cell] == x {
            stencil.nodes[0] = self.nodes[cell];
            stencil.weights[0] = 1.0;
            stencil.count = 1;
            return stencil;
        }
        let first = cell.saturating_sub(1);
        stencil.count = (cell + 3).min(n) - first;
        let step = places[cell + 1] - places[cell];
        let t = (x - places[cell]) / step;
        let mut add = |place: usize, weight: f64| stencil.weights[place - first] += weight;
        // values, then slopes
        let far = t * t * (3.0 - 2.0 * t);
        add(cell, 1.0 - far);
        add(cell + 1, far);
        let slopes = [t * (1.0 - t) * (1.0 - t), -t * t * (1.0 - t)];
        for (place, share) in [cell, cell + 1].into_iter().zip(slopes) {
            let share = share * step;
            let secant = |from: usize| places[from + 1] - places[from];
            // the slope at an end is that of the parabola through the last three places
            let (before, weights) = match place {
                _ if n == 2 => (0, [1.0, 0.0]),
                0 => {
                    let part = secant(0) / (secant(0) + secant(1));
                    (0, [1.0 + part, -part])
                }
                _ if place == n - 1 => {
                    let part = secant(n - 2) / (secant(n - 3) + secant(n - 2));
                    (n - 3, [-part, 1.0 + part])
                }
                _ => {
                    let part = secant(place) / (secant(place - 1) + secant(place));
                    (place - 1, [part, 1.0 - part])
                }
            };
            for (from, weight) in (before..n - 1).zip(weights) {
                if weight != 0.0 {
                    let weight = weight * share / secant(from);
                    add(from + 1, weight);
                    add(from, -weight);
                }
            }
        }
        for (node, place) in stencil.nodes.iter_mut().zip(&self.nodes[first..]) {
            *node = *place;
        }
        stencil
    }
}
