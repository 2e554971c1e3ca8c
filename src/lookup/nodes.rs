//! Points of the database and the nodes of its axes.
use std::fmt;

use super::LookupError;

/// How far from a node a coordinate may be and still be that node, as a share
/// of the node's value (as such for a node at 0): axes are f32, users type decimals.
const TOLERANCE: f64 = 1e-6;

/// One point of the five axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Mean facetness.
    pub facetness: f64,
    /// Mean grain size, um.
    pub grain_size_um: f64,
    /// Dry density, kg/m3.
    pub density_kg_m3: f64,
    /// Thickness, cm.
    pub thickness_cm: f64,
    /// Polar angle of incidence, degrees from the normal.
    pub angle_deg: f64,
}

impl Point {
    /// In the order of [`crate::compress::AXES`].
    #[must_use]
    pub fn coordinates(self) -> [f64; 5] {
        [
            self.facetness,
            self.grain_size_um,
            self.density_kg_m3,
            self.thickness_cm,
            self.angle_deg,
        ]
    }

    /// [`Point::coordinates`] inverted.
    #[must_use]
    pub fn from_coordinates(coordinates: [f64; 5]) -> Self {
        let [
            facetness,
            grain_size_um,
            density_kg_m3,
            thickness_cm,
            angle_deg,
        ] = coordinates;
        Self {
            facetness,
            grain_size_um,
            density_kg_m3,
            thickness_cm,
            angle_deg,
        }
    }
}

/// For messages: to the digits of the f32 that files hold.
impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [facetness, size, density, thickness, angle] = self.coordinates().map(|v| v as f32);
        write!(
            f,
            "facetness {facetness}, grain size {size} um, density {density} kg/m3, thickness {thickness} cm, angle {angle} degrees"
        )
    }
}

/// Whether `value` is the node `node`: near it, or a decimal of it. The shortest
/// decimal of a subnormal number is farther from it than the tolerance.
pub(super) fn on(node: f32, value: f64) -> bool {
    if value as f32 == node {
        return true;
    }
    let node = f64::from(node);
    let scale = if node == 0.0 { 1.0 } else { node.abs() };
    (node - value).abs() <= TOLERANCE * scale
}

/// Index of the node of `nodes` (f32, strictly increasing, not empty) that
/// `value` is on.
pub(super) fn find(axis: &'static str, nodes: &[f32], value: f64) -> Result<usize, LookupError> {
    let above = nodes.partition_point(|&node| f64::from(node) < value);
    let below = above.checked_sub(1);
    let distance = |index: usize| {
        nodes
            .get(index)
            .map(|&node| (f64::from(node) - value).abs())
    };
    let on = |index: &usize| nodes.get(*index).is_some_and(|node| on(*node, value));
    // Two nodes may both be within the tolerance: the nearer is meant.
    let nearer = match below {
        Some(below) if distance(above).is_none_or(|d| distance(below).is_some_and(|b| b < d)) => {
            below
        }
        _ => above,
    };
    if let Some(index) = Some(nearer).filter(on) {
        return Ok(index);
    }
    match (below.and_then(|b| nodes.get(b)), nodes.get(above)) {
        // NaN is below no node and above none: it compares false with all.
        (Some(&below), Some(&above)) => Err(LookupError::BetweenNodes {
            axis,
            value,
            below,
            above,
        }),
        _ => Err(LookupError::Outside {
            axis,
            value,
            first: nodes.first().copied().unwrap_or(f32::NAN),
            last: nodes.last().copied().unwrap_or(f32::NAN),
        }),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const NODES: [f32; 4] = [0.0, 0.1, 0.3, 0.5];

    #[test]
    fn decimals_are_on_f32_nodes() {
        for (index, value) in [0.0, 0.1, 0.3, 0.5].into_iter().enumerate() {
            assert_eq!(find("facetness", &NODES, value).unwrap(), index);
            let near = value * (1.0 + 5e-7);
            assert_eq!(find("facetness", &NODES, near).unwrap(), index);
        }
        assert_eq!(find("facetness", &NODES, -1e-7).unwrap(), 0);
        let close: [f32; 2] = [1.0, 1.000_000_1];
        assert_eq!(find("x", &close, 1.0).unwrap(), 0);
        assert_eq!(find("x", &close, f64::from(close[1])).unwrap(), 1);
        let subnormal: [f32; 3] = [1e-45, 9.04e-41, 100.0];
        for (index, decimal) in [1e-45, 9.04e-41].into_iter().enumerate() {
            assert_eq!(find("x", &subnormal, decimal).unwrap(), index);
        }
    }

    #[test]
    fn other_values_are_refused_with_their_neighbours() {
        let error = find("facetness", &NODES, 0.2).unwrap_err();
        assert_eq!(
            error.to_string(),
            "facetness = 0.2 lies between the nodes 0.1 and 0.3 of the database, and this look-up knows nodes only; the method `smooth` interpolates"
        );
        for outside in [-0.1, 0.6, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            let error = find("facetness", &NODES, outside).unwrap_err();
            assert!(
                matches!(
                    error,
                    LookupError::Outside {
                        first: 0.0,
                        last: 0.5,
                        ..
                    }
                ),
                "{error}"
            );
        }
        assert!(find("facetness", &NODES, 0.1 * (1.0 + 3e-6)).is_err());
    }
}
