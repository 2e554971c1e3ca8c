//! Index nodes: the few refractive indices at which walks are done.
//!
//! Paths depend on the refractive indices, so walks are done at a few *index
//! nodes*. These are the indices at some of the requested wavelengths (the
//! outermost ones are moved somewhat outward), chosen so that every other
//! wavelength lies close to the straight line between its two nodes in the plane
//! of (n, k) of ice (and of water, in wet snow). Each wavelength has its own
//! absorption; its result is interpolated linearly between those of its two
//! nodes. The remaining error is due to the curvature of R and T over one interval, see
//! [`Spacing`]. It grows with the square of the interval, so with fewer walks, whose noise is
//! larger anyway, intervals may be longer.
use crate::optics::Index;

/// How close nodes are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spacing {
    /// Largest distance of two neighbouring nodes in refractive index.
    pub(super) distance: f64,
    /// Largest distance of a wavelength's indices from the line between its nodes.
    deviation: f64,
}

impl Spacing {
    /// For R and T: the error is below 0.1 % of transmittance, as `tests/engines.rs` verifies with
    /// walks at every wavelength's own index.
    pub(super) const FINE: Self = Self {
        distance: 0.0135,
        deviation: 5e-4,
    };
    /// For the shares of directions in R and T, where noise is larger: 5 nodes instead of 13 at
    /// 400-2500 nm. The error is up to .6 % (docs/performance.md).
    pub(super) const COARSE: Self = Self {
        distance: 0.027,
        deviation: 4e-3,
    };
    /// Number of walks of `hybrid` from which on nodes are [`Self::FINE`].
    const FINE_WALKS: u64 = 16_384;
    /// Number of walks whose noise goes with the error of [`Self::FINE`].
    const EQUAL_WALKS: f64 = 65_536.0;
    /// Largest factor of the error of [`Self::FINE`].
    const MOST_ERROR: f64 = 9.0;

    /// For R and T by `hybrid` with `walks` walks: the error grows as the noise does when there are
    /// fewer than [`Self::FINE_WALKS`].
    pub(super) fn of_walks(walks: u64) -> Self {
        if walks >= Self::FINE_WALKS {
            return Self::FINE;
        }
        let error = (Self::EQUAL_WALKS / walks as f64).sqrt();
        let error = error.min(Self::MOST_ERROR);
        Self {
            distance: Self::FINE.distance * error.sqrt(),
            deviation: Self::FINE.deviation * error,
        }
    }
}

/// Distance by which the outermost nodes are moved outward, as a fraction of the
/// distance to the neighbouring node.
const OUTWARD_SHIFT: f64 = 0.2;
/// Weight of k relative to n in these distances: k changes the mean internal
/// reflectance of ice by about 3.7 per unit, n by about 1.
const K_WEIGHT: f64 = 4.0;

/// Coordinates of a pair of indices in the space where distances are measured; the
/// water coordinates are 0 in dry snow.
fn coordinates(&(ice, water): &(Index, Index), wet: bool) -> [f64; 4] {
    let wet = if wet { 1.0 } else { 0.0 };
    [
        ice.n,
        K_WEIGHT * ice.k,
        wet * water.n,
        wet * K_WEIGHT * water.k,
    ]
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn minus(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Projects `p` on the line from `a` to `b`: fraction of the way from `a`, [0, 1],
/// and squared distance from the line.
fn project(p: [f64; 4], a: [f64; 4], b: [f64; 4]) -> (f64, f64) {
    let (ab, ap) = (minus(b, a), minus(p, a));
    let length_sq = dot(ab, ab);
    let t = if length_sq > 0.0 {
        (dot(ap, ab) / length_sq).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let offset: [f64; 4] = std::array::from_fn(|i| ap[i] - t * ab[i]);
    (t, dot(offset, offset))
}

/// Positions of the nodes in the wavelength list, increasing. They include the
/// first and the last wavelength.
pub(super) fn nodes(indices: &[(Index, Index)], wet: bool, spacing: Spacing) -> Vec<usize> {
    let Spacing {
        distance,
        deviation,
    } = spacing;
    let points: Vec<_> = indices.iter().map(|i| coordinates(i, wet)).collect();
    let mut nodes = vec![0];
    let mut from = 0;
    while from + 1 < points.len() {
        let is_close = |to: &usize| {
            let ab = minus(points[*to], points[from]);
            dot(ab, ab) <= distance * distance
                && points[from..=*to]
                    .iter()
                    .all(|p| project(*p, points[from], points[*to]).1 <= deviation * deviation)
        };
        // neighbouring wavelengths are always a valid pair: nothing lies between them
        let to = (from + 2..points.len())
            .take_while(|to| is_close(to))
            .last()
            .unwrap_or(from + 1);
        nodes.push(to);
        from = to;
    }
    nodes
}

/// Refractive indices at the nodes: those of their wavelengths. If there are
/// wavelengths between the first node and the second, the first is moved outward
/// by [`OUTWARD_SHIFT`] of their distance; likewise the last. The variance of a mix
/// of two independent values is smallest halfway between them, so this saves walks.
fn node_indices(nodes: &[usize], indices: &[(Index, Index)]) -> Vec<(Index, Index)> {
    let beyond = |a: Index, b: Index| Index {
        n: a.n + OUTWARD_SHIFT * (a.n - b.n),
        k: (a.k + OUTWARD_SHIFT * (a.k - b.k)).max(0.0),
    };
    let moved = |node: usize, neighbour: usize| {
        let (a, b) = (indices[node], indices[neighbour]);
        if node.abs_diff(neighbour) > 1 {
            (beyond(a.0, b.0), beyond(a.1, b.1))
        } else {
            a
        }
    };
    let mut node_indices: Vec<_> = nodes.iter().map(|&node| indices[node]).collect();
    if let [first, second, ..] = nodes {
        node_indices[0] = moved(*first, *second);
    }
    if let [.., before, last] = nodes {
        node_indices[nodes.len() - 1] = moved(*last, *before);
    }
    node_indices
}

/// The two nodes between which a wavelength is interpolated, and their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mix {
    /// Positions in the list of nodes; the same twice for a single node.
    pub(super) nodes: [usize; 2],
    /// Weight of the second node, [0, 1].
    pub(super) share: f64,
}

impl Mix {
    /// Selects the items of this mix's nodes from `items`, one item per node, with
    /// their weights. A node of weight 0 is skipped.
    pub(super) fn select<T>(self, items: &[T]) -> impl Iterator<Item = (&T, f64)> {
        let shares = self.nodes.into_iter().zip([1.0 - self.share, self.share]);
        let shares = shares.filter(|(_, share)| *share > 0.0);
        shares.map(|(node, share)| (&items[node], share))
    }
}

/// Refractive indices of the nodes, and the mix of nodes for each wavelength.
pub(super) fn mixes(
    indices: &[(Index, Index)],
    wet: bool,
    spacing: Spacing,
) -> (Vec<(Index, Index)>, Vec<Mix>) {
    let nodes = nodes(indices, wet, spacing);
    let node_indices = node_indices(&nodes, indices);
    let mixes = mix_of_nodes(&nodes, &node_indices, indices, wet);
    (node_indices, mixes)
}

fn mix_of_nodes(
    nodes: &[usize],
    node_indices: &[(Index, Index)],
    indices: &[(Index, Index)],
    wet: bool,
) -> Vec<Mix> {
    let mix = |(l, index): (usize, &(Index, Index))| {
        // between nodes i - 1 and i, or twice the same if there is only one node
        let i = nodes
            .partition_point(|&node| node < l)
            .max(1)
            .min(nodes.len() - 1);
        let j = i.saturating_sub(1);
        let [p, a, b] = [*index, node_indices[j], node_indices[i]].map(|i| coordinates(&i, wet));
        Mix {
            nodes: [j, i],
            share: project(p, a, b).0,
        }
    };
    indices.iter().enumerate().map(mix).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_walks_have_fewer_nodes() {
        let water = Index { n: 1.33, k: 0.0 };
        let ice = |i: u32| Index {
            n: 1.32 - 0.001 * f64::from(i),
            k: 0.0,
        };
        let indices: Vec<_> = (0..=100).map(|i| (ice(i), water)).collect();
        let count = |walks| nodes(&indices, false, Spacing::of_walks(walks)).len();
        // intervals of at most .0135, of twice and of three times that
        let many = nodes(&indices, false, Spacing::FINE).len();
        assert_eq!([u64::MAX, 16_384].map(count), [many; 2]);
        assert_eq!([many, count(4096), count(1)], [9, 5, 4]);
    }
}
