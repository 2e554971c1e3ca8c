//! The Pareto front of cost and error.

/// Indices of the points (cost, error) on the Pareto front: no other point is better in one
/// coordinate without being worse in the other. The front has increasing cost and strictly
/// decreasing error. Of equal points only the first is on the front; points that are not finite
/// are left out.
#[must_use]
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].0.is_finite() && points[i].1.is_finite())
        .collect();
    order.sort_by(|&i, &j| {
        let ((a, x), (b, y)) = (points[i], points[j]);
        a.total_cmp(&b).then(x.total_cmp(&y))
    });
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < least;
        least = least.min(points[i].1);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::front;

    #[test]
    fn by_hand() {
        let points = [(3.0, 1.0), (1.0, 5.0), (2.0, 6.0), (2.5, 2.0), (4.0, 1.0)];
        assert_eq!(front(&points), [1, 3, 0]);
        assert_eq!(front(&[]), [0; 0]);
        assert_eq!(front(&[(1.0, 1.0), (1.0, 1.0), (1.0, 2.0)]), [0]);
        let odd = [(f64::NAN, 1.0), (1.0, f64::INFINITY), (2.0, 3.0)];
        assert_eq!(front(&odd), [2]);
    }

    proptest! {
        #[test]
        fn no_point_beats_the_front_and_the_front_beats_the_rest(
            points in proptest::collection::vec((0_u8..20, 0_u8..20), 0..40)
        ) {
            let points: Vec<(f64, f64)> =
                points.iter().map(|&(x, y)| (f64::from(x), f64::from(y))).collect();
            let found = front(&points);
            prop_assert_eq!(found.is_empty(), points.is_empty());
            let beats = |a: (f64, f64), b: (f64, f64)| a != b && a.0 <= b.0 && a.1 <= b.1;
            for (i, &point) in points.iter().enumerate() {
                if found.contains(&i) {
                    prop_assert!(!points.iter().any(|&other| beats(other, point)));
                } else {
                    let covered = |&f: &usize| points[f] == point || beats(points[f], point);
                    prop_assert!(found.iter().any(covered));
                }
            }
            for pair in found.windows(2) {
                let (a, b) = (points[pair[0]], points[pair[1]]);
                prop_assert!(a.0 < b.0 && a.1 > b.1);
            }
        }
    }
}
