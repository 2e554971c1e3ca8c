//! Light that crosses horizontal planes inside a snowpack (docs/methods.md).
//!
//! A ray's way is a line of straight legs: its flights through the pores and, through each
//! grain, the line from where it enters to where it leaves. A leg that crosses a plane counts
//! with the ray's weight there. Absorption is spread evenly along a leg.
use super::{Path, TRACERS};

/// Distance by which planes at the surface and the base are moved inward, m, so that rays that
/// start or end there cross them.
const INSIDE_M: f64 = 1e-9;
/// Cosine below which a crossing scores as one at half of it. The score of the actinic flux,
/// 1 / cosine, would have an infinite variance. The expected score is the same if the radiance
/// is the same at all such small cosines. (The surface flux of MCNP is scored in this way.)
const GRAZING: f64 = 0.05;

/// Number of scores of a crossing.
pub const CROSSING_SCORES: usize = 3;

/// Downward, upward and actinic flux.
pub type PlaneFluxes = [f64; CROSSING_SCORES];

/// Horizontal planes at which light is counted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Planes {
    depths_m: Vec<f64>,
}

/// A straight part of a ray's way.
#[derive(Debug, Clone, Copy)]
pub struct Leg {
    /// Depths of its ends, m.
    pub z_m: [f64; 2],
    /// Cosine of its angle from the vertical, above 0.
    pub cosine: f64,
    /// Paths of the ray at its ends.
    pub paths: [Path; 2],
    /// Whether all rays of the illumination begin with a leg of this direction.
    pub is_beam: bool,
}

/// A crossing of a plane.
#[derive(Debug, Clone, Copy)]
pub struct Crossing {
    /// Position of the plane.
    pub plane: usize,
    /// The ray's path there.
    pub path: Path,
    /// Downward, upward and actinic flux of a ray of weight 1.
    pub scores: PlaneFluxes,
}

impl Planes {
    /// Planes at `depths_m`, m, increasing, in a snowpack of `thickness_m`.
    #[must_use]
    pub fn new(depths_m: &[f64], thickness_m: f64) -> Self {
        let inside = |z_m: &f64| z_m.clamp(INSIDE_M, thickness_m - INSIDE_M);
        Self {
            depths_m: depths_m.iter().map(inside).collect(),
        }
    }

    /// Number of planes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.depths_m.len()
    }

    /// Whether there is no plane.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.depths_m.is_empty()
    }

    /// The crossings of `leg`, in no particular order.
    pub fn crossings(&self, leg: &Leg) -> impl Iterator<Item = Crossing> {
        let [from_m, to_m] = leg.z_m;
        let down = to_m > from_m;
        let (high_m, low_m) = if down { (from_m, to_m) } else { (to_m, from_m) };
        let position = |z_m: f64| self.depths_m.partition_point(|plane_m| *plane_m <= z_m);
        let actinic = if leg.is_beam || leg.cosine > GRAZING {
            1.0 / leg.cosine
        } else {
            2.0 / GRAZING
        };
        let downward = f64::from(u8::from(down));
        let [before, after] = leg.paths;
        (position(high_m)..position(low_m)).map(move |plane| {
            let share = (self.depths_m[plane] - from_m) / (to_m - from_m);
            Crossing {
                plane,
                path: before.between(&after, share),
                scores: [downward, 1.0 - downward, actinic],
            }
        })
    }
}

impl Path {
    /// The absorbing path at `share` of the way from `self` to `other`.
    fn between(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let mut impurities = [0.0; TRACERS];
        let pairs = self.impurities.iter().zip(other.impurities);
        for (mixed, (a, b)) in impurities.iter_mut().zip(pairs) {
            *mixed = mix(*a, b);
        }
        Self {
            ice_m: mix(self.ice_m, other.ice_m),
            water_m: mix(self.water_m, other.water_m),
            impurities,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leg(z_m: [f64; 2], cosine: f64) -> Leg {
        let path = |ice_m| Path {
            ice_m,
            ..Path::default()
        };
        Leg {
            z_m,
            cosine,
            paths: [path(1.0), path(3.0)],
            is_beam: false,
        }
    }

    /// A leg crosses the planes between its ends, each once, and has there the share of its path.
    #[test]
    fn legs_cross_the_planes_between_their_ends() {
        let planes = Planes::new(&[0.0, 0.5, 1.0], 1.0);
        let of = |leg: &Leg| -> Vec<(usize, f64, [f64; 3])> {
            let all = planes.crossings(leg);
            all.map(|c| (c.plane, c.path.ice_m, c.scores)).collect()
        };
        let down = of(&leg([0.0, 1.0], 0.25));
        let positions: Vec<usize> = down.iter().map(|c| c.0).collect();
        assert_eq!(positions, [0, 1, 2], "both outer planes are crossed");
        assert_eq!(down[1], (1, 2.0, [1.0, 0.0, 4.0]));
        assert_eq!(of(&leg([0.9, 0.1], 0.5)), [(1, 2.0, [0.0, 1.0, 2.0])]);
        assert_eq!(of(&leg([0.1, 0.4], 0.5)), []);
        assert_eq!(of(&leg([0.1, 0.1], 0.5)), []);
        // two legs that meet in a plane cross it once
        let two = of(&leg([0.1, 0.5], 0.5)).len() + of(&leg([0.5, 0.7], 0.5)).len();
        assert_eq!(two, 1);
    }

    /// The actinic flux of radiance that does not depend on the cosine: the mean of the scores
    /// over crossings, whose number is proportional to the cosine, is 2.
    #[test]
    fn grazing_crossings_score_the_right_mean() {
        let planes = Planes::new(&[0.5], 1.0);
        const N: u32 = 100_000;
        let scores = (0..N).map(|i| {
            let cosine = (f64::from(i) + 0.5) / f64::from(N);
            let score: f64 = planes
                .crossings(&leg([0.0, 1.0], cosine))
                .map(|c| c.scores[2])
                .sum();
            2.0 * cosine * score
        });
        let mean = scores.sum::<f64>() / f64::from(N);
        assert!((mean - 2.0).abs() < 1e-4, "{mean}");
    }
}
