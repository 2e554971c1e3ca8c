//! Search for the node of an axis.
use crate::LookupError;

/// Largest distance of a coordinate from a node that still counts as the node, relative
/// to the value of the node (absolute for a node at 0). Look-ups use single precision.
const TOLERANCE: f64 = 1e-6;

/// Whether `value` is on `node`: within the tolerance, or equal in single precision.
/// (The shortest decimal of a subnormal f32 differs from it by more than the tolerance.)
pub(super) fn is_on(node: f64, value: f64) -> bool {
    if value as f32 == node as f32 {
        return true;
    }
    let scale = if node == 0.0 { 1.0 } else { node.abs() };
    (node - value).abs() <= TOLERANCE * scale
}

/// The node that `value` is on, if any, and the number of nodes below `value`; `nodes` are
/// strictly increasing.
#[inline(always)]
pub(super) fn locate(nodes: &[f64], value: f64) -> (Option<usize>, usize) {
    let above = nodes.partition_point(|&node| node < value);
    let below = above.checked_sub(1);
    let distance = |index: usize| nodes.get(index).map(|node| (node - value).abs());
    let is_on = |index: &usize| nodes.get(*index).is_some_and(|node| is_on(*node, value));
    // Two nodes may both be within the tolerance: take the nearer one.
    let nearer = match below {
        Some(below) if distance(above).is_none_or(|d| distance(below).is_some_and(|b| b < d)) => {
            below
        }
        _ => above,
    };
    (Some(nearer).filter(is_on), above)
}

/// Index of the node that `value` is on; `nodes` are strictly increasing and not empty.
pub(super) fn find(axis: &'static str, nodes: &[f64], value: f64) -> Result<usize, LookupError> {
    let (on, above) = locate(nodes, value);
    if let Some(index) = on {
        return Ok(index);
    }
    let below = above.checked_sub(1);
    match (below.and_then(|b| nodes.get(b)), nodes.get(above)) {
        // NaN is neither above nor below any node: all comparisons are false.
        (Some(&below), Some(&above)) => Err(LookupError::BetweenNodes {
            axis,
            value,
            below,
            above,
        }),
        _ => Err(LookupError::Outside {
            axis,
            value,
            first: nodes.first().copied().unwrap_or(f64::NAN),
            last: nodes.last().copied().unwrap_or(f64::NAN),
        }),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const NODES: [f64; 4] = [0.0, 0.1, 0.3, 0.5];

    #[test]
    fn decimals_are_on_f32_nodes() {
        for (index, value) in [0.0, 0.1, 0.3, 0.5].into_iter().enumerate() {
            assert_eq!(find("facetness", &NODES, value).unwrap(), index);
            let near = value * (1.0 + 5e-7);
            assert_eq!(find("facetness", &NODES, near).unwrap(), index);
        }
        assert_eq!(find("facetness", &NODES, -1e-7).unwrap(), 0);
        let close = [1.0, 1.000_000_119];
        assert_eq!(find("x", &close, 1.0).unwrap(), 0);
        assert_eq!(find("x", &close, close[1]).unwrap(), 1);
        let subnormal = [1e-45_f32, 9.04e-41, 100.0].map(f64::from);
        for (index, decimal) in [1e-45, 9.04e-41].into_iter().enumerate() {
            assert_eq!(find("x", &subnormal, decimal).unwrap(), index);
        }
    }

    #[test]
    fn other_values_are_refused_with_their_neighbours() {
        let error = find("facetness", &NODES, 0.2).unwrap_err();
        assert_eq!(
            error.to_string(),
            "facetness = 0.2 lies between the nodes 0.1 and 0.3 of the database; this look-up answers at nodes only; use the method `smooth` to interpolate"
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
