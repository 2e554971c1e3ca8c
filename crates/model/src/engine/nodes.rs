//! Index nodes: the few refractive indices at which walks are done.
//!
//! Paths depend on the refractive indices, so walks are done at a few *index
//! nodes*, at (or, outermost, somewhat beyond) some of the wavelengths asked
//! for, chosen so that every other one lies close to the straight line between
//! its two nodes in the plane of (n, k) of ice (and of water, in wet snow).
//! Each wavelength's result is the linear mix of what its two nodes give it
//! with its own absorption. What remains is the curvature of R and T over one
//! interval of at most [`SPACING`] in index: below 0.1 % of transmittance, as
//! `tests/engines.rs` measures against walks at every wavelength's own index.
use crate::optics::Index;

/// Largest distance of two neighbouring nodes in refractive index.
pub(super) const SPACING: f64 = 0.0135;
/// How far the outermost nodes lie outside, in parts of the way to the next.
const STRETCH: f64 = 0.2;
/// Largest distance of a wavelength's indices from the line between its nodes.
const DEVIATION: f64 = 5e-4;
/// Weight of k against n in those distances: k changes the mean internal
/// reflectance of ice by about 3.7 per unit, n by about 1.
const K_WEIGHT: f64 = 4.0;

/// Coordinates in which nodes are placed; vacuum stands for absent water.
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

/// Where `p` lies between `a` and `b`: fraction of the way, squared distance from the line.
fn project(p: [f64; 4], a: [f64; 4], b: [f64; 4]) -> (f64, f64) {
    let (ab, ap) = (minus(b, a), minus(p, a));
    let length_sq = dot(ab, ab);
    let t = if length_sq > 0.0 {
        (dot(ap, ab) / length_sq).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off: [f64; 4] = std::array::from_fn(|i| ap[i] - t * ab[i]);
    (t, dot(off, off))
}

/// Positions in the wavelength list at which walks are done, increasing; the
/// first and last wavelength are always among them.
pub(super) fn nodes(indices: &[(Index, Index)], wet: bool) -> Vec<usize> {
    let points: Vec<_> = indices.iter().map(|i| coordinates(i, wet)).collect();
    let mut nodes = vec![0];
    let mut from = 0;
    while from + 1 < points.len() {
        let holds = |to: &usize| {
            let ab = minus(points[*to], points[from]);
            dot(ab, ab) <= SPACING * SPACING
                && points[from..=*to]
                    .iter()
                    .all(|p| project(*p, points[from], points[*to]).1 <= DEVIATION * DEVIATION)
        };
        // neighbours are always a valid pair: both are nodes and nothing lies between
        let to = (from + 2..points.len())
            .take_while(|to| holds(to))
            .last()
            .unwrap_or(from + 1);
        nodes.push(to);
        from = to;
    }
    nodes
}

/// Refractive indices at the nodes: those of their wavelengths, but the first
/// and last are moved outward by [`STRETCH`] of the way to their neighbour if
/// there are wavelengths in between. Two independent values weigh least in the
/// variance of their mix halfway between them, so this saves walks.
fn node_indices(nodes: &[usize], indices: &[(Index, Index)]) -> Vec<(Index, Index)> {
    let beyond = |a: Index, b: Index| Index {
        n: a.n + STRETCH * (a.n - b.n),
        k: (a.k + STRETCH * (a.k - b.k)).max(0.0),
    };
    let moved = |node: usize, neighbour: usize| {
        let (a, b) = (indices[node], indices[neighbour]);
        if node.abs_diff(neighbour) > 1 {
            (beyond(a.0, b.0), beyond(a.1, b.1))
        } else {
            a
        }
    };
    let mut at: Vec<_> = nodes.iter().map(|&node| indices[node]).collect();
    if let [first, second, ..] = nodes {
        at[0] = moved(*first, *second);
    }
    if let [.., before, last] = nodes {
        at[nodes.len() - 1] = moved(*last, *before);
    }
    at
}

/// Which nodes a wavelength lies between.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mix {
    /// Positions in the list of nodes; the same twice for a single node.
    pub(super) nodes: [usize; 2],
    /// Share of the second.
    pub(super) share: f64,
}

impl Mix {
    /// Its nodes among `all` and their shares; a node without one is left out.
    pub(super) fn of<T>(self, all: &[T]) -> impl Iterator<Item = (&T, f64)> {
        let shares = self.nodes.into_iter().zip([1.0 - self.share, self.share]);
        let shares = shares.filter(|(_, share)| *share > 0.0);
        shares.map(|(node, share)| (&all[node], share))
    }
}

/// Refractive indices of the nodes, and what nodes each wavelength mixes.
pub(super) fn mixes(indices: &[(Index, Index)], wet: bool) -> (Vec<(Index, Index)>, Vec<Mix>) {
    let nodes = nodes(indices, wet);
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
        // between nodes i - 1 and i; a single node stands alone
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
