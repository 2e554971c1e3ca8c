//! Planes between layers inside a snowpack.
//!
//! Grains carry light across them, the larger ones further, so that light does not
//! cross as it would between points: fine snow under coarse is brighter than the two
//! by themselves would be. What is next to such a plane is walked, from every stream
//! above and below, and added like a stretch.
use crate::engine::tables::Stretch;
use crate::transport::Snow;

/// A part of the inside of a snowpack.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Piece<W> {
    /// Homogeneous, where grains act like points.
    Points(Stretch),
    /// Next to one or several planes.
    Walked(W),
}

/// Whether grains meet others at the plane between the two.
fn differ(a: &Snow, b: &Snow) -> bool {
    let of = |snow: &Snow| [snow.density_kg_m3, snow.water_saturation];
    a.grains != b.grains || of(a) != of(b)
}

/// How far the plane to `other` is felt in `snow`, m: half of it gave fluxes within
/// .0002 of those of four times as much, with standard errors of .0001.
fn depth_m(snow: &Snow, other: &Snow) -> f64 {
    let reaches_m = [snow.sizes_m()[1], other.sizes_m()[1]];
    reaches_m
        .into_iter()
        .fold(snow.mean_free_distance_m(), f64::max)
}

/// `inside`, downward, in parts.
pub(super) fn pieces(inside: &[Stretch], snows: &[&Snow]) -> Vec<Piece<Vec<Stretch>>> {
    let felt_m = |i: usize, other: Option<&Stretch>| {
        let (snow, other) = (snows[inside[i].snow], snows[other?.snow]);
        differ(snow, other).then(|| depth_m(snow, other))
    };
    let mut pieces = Vec::new();
    let mut walked: Vec<Stretch> = Vec::new();
    for (i, stretch) in inside.iter().enumerate() {
        let part = |thickness_m: f64| Stretch {
            thickness_m,
            ..*stretch
        };
        let above = i.checked_sub(1).and_then(|above| inside.get(above));
        let [above_m, below_m] = [above, inside.get(i + 1)].map(|other| felt_m(i, other));
        if let (Some(above_m), Some(below_m)) = (above_m, below_m)
            && above_m + below_m >= stretch.thickness_m
        {
            walked.push(*stretch);
            continue;
        }
        let above_m = above_m.unwrap_or(0.0).min(stretch.thickness_m);
        if above_m > 0.0 {
            walked.push(part(above_m));
            pieces.push(Piece::Walked(std::mem::take(&mut walked)));
        }
        let rest_m = stretch.thickness_m - above_m;
        let below_m = below_m.unwrap_or(0.0).min(rest_m);
        if rest_m > below_m {
            pieces.push(Piece::Points(part(rest_m - below_m)));
        }
        if below_m > 0.0 {
            walked.push(part(below_m));
        }
    }
    pieces
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::grain::{GrainType, Shape, SizeRange, TruncatedNormal};

    fn snow(size_um: f64) -> Snow {
        let grain = GrainType {
            size: SizeRange::new(size_um * 1e-6, size_um * 1e-6).unwrap(),
            facetness: TruncatedNormal::new(0.2, 0.4, 0.3, 0.072).unwrap(),
            shape: Shape::Spheroid,
            sphericity: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        };
        Snow::dry(grain, 275.0, -1.0)
    }

    /// What is walked reaches as far as either snow feels the plane; layers thinner
    /// than that are walked as a whole; between equal snows nothing is.
    #[test]
    fn planes_are_walked_as_far_as_they_are_felt() {
        let (fine, coarse) = (snow(100.0), snow(1000.0));
        let snows = [&fine, &coarse, &coarse];
        let of = |snow: usize, thickness_m: f64| Stretch { snow, thickness_m };
        let reach_m = depth_m(&coarse, &fine);
        assert!(reach_m >= 1e-3 && depth_m(&fine, &coarse) == 1e-3);

        let whole = [of(0, 0.02), of(1, 0.03), of(2, 0.04)];
        let found = pieces(&whole, &snows);
        let expected = [
            Piece::Points(of(0, 0.02 - 1e-3)),
            Piece::Walked(vec![of(0, 1e-3), of(1, reach_m)]),
            Piece::Points(of(1, 0.03 - reach_m)),
            Piece::Points(of(2, 0.04)),
        ];
        assert_eq!(found, expected);

        let thin = [of(1, 0.03), of(0, 1.5e-3), of(1, 5e-4)];
        let found = pieces(&thin, &snows);
        let expected = [
            Piece::Points(of(1, 0.03 - reach_m)),
            Piece::Walked(vec![of(1, reach_m), of(0, 1.5e-3), of(1, 5e-4)]),
        ];
        assert_eq!(found, expected);
        assert_eq!(pieces(&thin[..1], &snows), [Piece::Points(thin[0])]);
        assert_eq!(pieces(&[], &snows), []);
    }
}
