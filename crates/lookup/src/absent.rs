//! Curves that do not exist, and the look-ups that would need them.
use crate::{Axes, LookupError, Parameter, Point, nodes};

/// A curve that a look-up needs and that does not exist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MissingCurve {
    /// Grain-size node without the curve, um.
    node_um: f64,
    /// The thinnest thickness with a curve at that grain size, cm; `None` if there is none.
    least_cm: Option<f64>,
}

fn sizes_and_thicknesses(axes: &Axes) -> [&[f64]; 2] {
    [Parameter::GrainSize, Parameter::Thickness].map(|parameter| axes.values(parameter))
}

impl MissingCurve {
    /// The missing curve at the grain size with index `size`.
    pub(super) fn at_size(size: usize, absent: &[usize], axes: &Axes) -> Self {
        let [sizes, thicknesses] = sizes_and_thicknesses(axes);
        let first = absent.get(size).copied().unwrap_or_default();
        Self {
            node_um: sizes.get(size).copied().unwrap_or(f64::NAN),
            least_cm: thicknesses.get(first).copied(),
        }
    }
}

/// The first curve that the method `smooth` needs at this grain size and thickness and
/// that does not exist. The method needs the nodes on both sides of the grain size and of
/// the thickness, or the node alone where the coordinate is on a node. Thinner than the
/// first thickness node it needs that node; thicker than the last, the last two.
pub(super) fn missing_curve(
    absent: &[usize],
    axes: &Axes,
    grain_size_um: f64,
    thickness_cm: f64,
) -> Option<MissingCurve> {
    if absent.is_empty() {
        return None;
    }
    let [sizes, thicknesses] = sizes_and_thicknesses(axes);
    // the thinnest node with a non-zero weight
    let above = thicknesses.partition_point(|node| *node <= thickness_cm);
    let lowest = match thicknesses
        .iter()
        .position(|node| nodes::is_on(*node, thickness_cm))
    {
        Some(node) => node,
        None if above == thicknesses.len() => above.saturating_sub(2),
        None => above.saturating_sub(1),
    };
    let above = sizes.partition_point(|node| *node <= grain_size_um);
    let (first, last) = match sizes
        .iter()
        .position(|node| nodes::is_on(*node, grain_size_um))
    {
        Some(node) => (node, node),
        None => (
            above.saturating_sub(1),
            above.min(sizes.len().saturating_sub(1)),
        ),
    };
    let missing = |size: &usize| absent.get(*size).is_some_and(|thinnest| lowest < *thinnest);
    let size = (first..=last).find(missing)?;
    Some(MissingCurve::at_size(size, absent, axes))
}

/// The error of a missing curve for a look-up at `point`.
#[cold]
pub(super) fn absent_error(missing: MissingCurve, point: Point) -> LookupError {
    LookupError::Absent {
        grain_size_um: point[Parameter::GrainSize],
        thickness_cm: point[Parameter::Thickness],
        node_um: missing.node_um,
        least_cm: missing.least_cm,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use ndarray::Array2;

    use crate::{Axes, Database, Lookup, LookupError, Parameter, Point, Quantity};

    fn axes(thickness_cm: &[f64]) -> Axes {
        Axes::from([
            (Parameter::Facetness, vec![0.3]),
            (Parameter::GrainSize, vec![100.0, 1000.0]),
            (Parameter::Density, vec![200.0, 300.0]),
            (Parameter::Thickness, thickness_cm.to_vec()),
            (Parameter::Incidence, vec![0.0, 60.0]),
        ])
    }

    /// Smooth values in [0, 1] at two wavelengths; NaN where there is no curve.
    fn file(thickness_cm: &[f64], absent: &[usize], black_substrate: bool) -> Database {
        let (n, axes) = (thickness_cm.len(), axes(thickness_cm));
        let curves = Array2::from_shape_fn((2 * 2 * n * 2, 2), |(row, l)| {
            let [size, density, h, angle] =
                [row / (4 * n), row / (2 * n) % 2, row / 2 % n, row % 2];
            if h < absent.get(size).copied().unwrap_or(0) {
                return f64::NAN;
            }
            let scale = [2.0, 9.0][size] * [1.0, 0.7][density] * [1.0, 0.8][angle];
            (-thickness_cm[h] / scale).exp() * [1.0, 0.9][l] + 1e-4
        });
        Database::from_curves(black_substrate, &axes, &[500.0, 600.0], Some(&curves), None)
            .with_absent(absent)
    }

    fn at(grain_size_um: f64, thickness_cm: f64) -> Point {
        Point::from([
            (Parameter::Facetness, 0.3),
            (Parameter::GrainSize, grain_size_um),
            (Parameter::Density, 260.0),
            (Parameter::Thickness, thickness_cm),
            (Parameter::Incidence, 25.0),
        ])
    }

    fn ask(database: &Database, point: Point) -> Result<Vec<f32>, LookupError> {
        let mut spectrum = vec![0.0; 2];
        Lookup::new(database, Quantity::Transmittance)?.spectrum(point, &mut spectrum)?;
        Ok(spectrum)
    }

    /// Existing nodes give the same spectra as in a file without the missing nodes.
    #[test]
    fn missing_curves_do_not_change_the_rest_of_a_column() {
        let all = [1.0, 2.0, 4.0, 8.0, 16.0];
        let whole = file(&all, &[0, 2], true);
        let rest = file(&all[2..], &[], false);
        for thickness in [4.0, 4.3, 6.0, 8.0, 11.0, 16.0, 40.0] {
            assert_eq!(
                ask(&whole, at(1000.0, thickness)).unwrap(),
                ask(&rest, at(1000.0, thickness)).unwrap(),
                "{thickness}"
            );
        }
        // the other size has all its nodes
        let none = file(&all, &[], true);
        for thickness in [0.3, 1.0, 1.7, 30.0] {
            let point = at(100.0, thickness);
            assert_eq!(ask(&whole, point).unwrap(), ask(&none, point).unwrap());
        }
        let material = Lookup::new(&whole, Quantity::Transmittance).unwrap();
        let material = material.material(at(500.0, 5.0)).unwrap();
        let mut found = vec![0.0; 2];
        material.spectrum(at(500.0, 5.0), &mut found).unwrap();
        let direct = ask(&whole, at(500.0, 5.0)).unwrap();
        assert!(found.iter().zip(&direct).all(|(a, b)| (a - b).abs() < 1e-6));
        assert!(material.spectrum(at(500.0, 3.0), &mut found).is_err());
    }

    #[test]
    fn look_ups_that_need_a_missing_curve_are_refused() {
        let all = [1.0, 2.0, 4.0];
        let cases: [(&[usize], f64, f64, bool); 12] = [
            (&[0, 1], 100.0, 0.5, true),
            (&[0, 1], 101.0, 0.5, false),
            (&[0, 1], 1000.0, 0.5, false),
            (&[0, 1], 1000.0, 1.0, false),
            (&[0, 1], 1000.0, 1.9, false),
            (&[0, 1], 1000.0, 2.0, true),
            (&[0, 1], 300.0, 2.5, true),
            (&[0, 2], 300.0, 3.9, false),
            (&[0, 2], 300.0, 4.0, true),
            // thicker than the last node: the last two nodes are needed
            (&[0, 2], 300.0, 4.1, false),
            (&[0, 1], 300.0, 4.1, true),
            (&[0, 3], 1000.0, 4.0, false),
        ];
        for (absent, size, thickness, answered) in cases {
            let database = file(&all, absent, true);
            let found = ask(&database, at(size, thickness));
            assert_eq!(found.is_ok(), answered, "{absent:?} {size} {thickness}");
            assert_eq!(database.covers(size, thickness), answered);
            if let Err(error) = found {
                assert!(
                    matches!(
                        error,
                        LookupError::Absent {
                            node_um: 1000.0,
                            ..
                        }
                    ),
                    "{error}"
                );
            }
        }
        let error = ask(&file(&all, &[0, 1], true), at(500.0, 1.5)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the file has no spectrum for grains of 500 um in 1.5 cm of snow: grains of the node 1000 um do not fit into a slab thinner than 2 cm; use thicker snow or smaller grains"
        );
    }
}
