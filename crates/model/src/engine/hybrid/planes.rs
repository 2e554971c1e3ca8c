//! Planes between layers inside a snowpack.
//!
//! Grains carry light across these planes, larger grains further, so light does not
//! cross them as it would between points: fine snow under coarse snow is brighter
//! than adding the two layers predicts. The snow next to such a plane is therefore
//! walked, from every stream above and below, and added like a bulk segment.
use crate::engine::tables::Section;
use crate::transport::Snow;

/// A part of the inside of a snowpack.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Segment<W> {
    /// A section of one layer in which grains act like points.
    Bulk(Section),
    /// The snow next to one or several planes, which is walked.
    Walked(W),
}

/// Whether transport differs on the two sides of the plane between `a` and `b`.
fn differ(a: &Snow, b: &Snow) -> bool {
    let properties = |snow: &Snow| [snow.density_kg_m3, snow.water_saturation];
    a.grains != b.grains || a.particles() != b.particles() || properties(a) != properties(b)
}

/// Distance from the plane to `other` within which `snow` is walked, m. Fluxes with
/// half of this distance were within 0.0002 of those with four times as much, with
/// standard errors of 0.0001.
fn depth_m(snow: &Snow, other: &Snow) -> f64 {
    let reaches_m = [snow.sizes_m()[1], other.sizes_m()[1]];
    reaches_m
        .into_iter()
        .fold(snow.mean_free_distance_m(), f64::max)
}

/// Divides `inside`, given downward, into segments.
pub(super) fn segments(inside: &[Section], snows: &[&Snow]) -> Vec<Segment<Vec<Section>>> {
    let walked_m = |i: usize, other: Option<&Section>| {
        let (snow, other) = (snows[inside[i].layer], snows[other?.layer]);
        differ(snow, other).then(|| depth_m(snow, other))
    };
    let mut segments = Vec::new();
    let mut walked: Vec<Section> = Vec::new();
    for (i, section) in inside.iter().enumerate() {
        let part = |thickness_m: f64| Section {
            thickness_m,
            ..*section
        };
        let above = i.checked_sub(1).and_then(|above| inside.get(above));
        let [above_m, below_m] = [above, inside.get(i + 1)].map(|other| walked_m(i, other));
        if let (Some(above_m), Some(below_m)) = (above_m, below_m)
            && above_m + below_m >= section.thickness_m
        {
            walked.push(*section);
            continue;
        }
        let above_m = above_m.unwrap_or(0.0).min(section.thickness_m);
        if above_m > 0.0 {
            walked.push(part(above_m));
            segments.push(Segment::Walked(std::mem::take(&mut walked)));
        }
        let rest_m = section.thickness_m - above_m;
        let below_m = below_m.unwrap_or(0.0).min(rest_m);
        if rest_m > below_m {
            segments.push(Segment::Bulk(part(rest_m - below_m)));
        }
        if below_m > 0.0 {
            walked.push(part(below_m));
        }
    }
    segments
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
            proportion: TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap(),
        };
        Snow::dry(grain, 275.0, -1.0)
    }

    /// Walked segments reach `depth_m` on either side of a plane. Layers thinner than
    /// that are walked as a whole. Nothing is walked between equal snows.
    #[test]
    fn snow_near_planes_is_walked() {
        let (fine, coarse) = (snow(100.0), snow(1000.0));
        let snows = [&fine, &coarse, &coarse];
        let section = |layer: usize, thickness_m: f64| Section { layer, thickness_m };
        let reach_m = depth_m(&coarse, &fine);
        assert!(reach_m >= 1e-3 && depth_m(&fine, &coarse) == 1e-3);

        let whole = [section(0, 0.02), section(1, 0.03), section(2, 0.04)];
        let expected = [
            Segment::Bulk(section(0, 0.02 - 1e-3)),
            Segment::Walked(vec![section(0, 1e-3), section(1, reach_m)]),
            Segment::Bulk(section(1, 0.03 - reach_m)),
            Segment::Bulk(section(2, 0.04)),
        ];
        assert_eq!(segments(&whole, &snows), expected);

        let thin = [section(1, 0.03), section(0, 1.5e-3), section(1, 5e-4)];
        let walked = vec![section(1, reach_m), section(0, 1.5e-3), section(1, 5e-4)];
        let expected = [
            Segment::Bulk(section(1, 0.03 - reach_m)),
            Segment::Walked(walked),
        ];
        assert_eq!(segments(&thin, &snows), expected);
        assert_eq!(segments(&thin[..1], &snows), [Segment::Bulk(thin[0])]);
        assert_eq!(segments(&[], &snows), []);
    }
}
