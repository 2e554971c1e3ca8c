//! Rings about the point where light enters, for radial profiles of the light that
//! leaves.
use std::f64::consts::PI;

/// A disc and rings about it, whose radii grow by a constant factor.
#[derive(Debug, Clone, PartialEq)]
pub struct Radii {
    /// Outer radii, m, increasing. One more bin contains everything beyond the last.
    edges_m: Vec<f64>,
}

impl Radii {
    /// A disc of radius `first_m` and `count` - 1 rings (`count` at least 1) out to
    /// `last_m`, which must be larger than `first_m`; and one bin for everything beyond.
    #[must_use]
    pub fn new(count: usize, first_m: f64, last_m: f64) -> Self {
        let steps = (count.max(2) - 1) as f64;
        let edge = |i| first_m * libm::pow(last_m / first_m, i as f64 / steps);
        Self {
            edges_m: (0..count.max(1)).map(edge).collect(),
        }
    }

    /// Number of bins, including the one beyond the last radius.
    #[must_use]
    pub fn len(&self) -> usize {
        self.edges_m.len() + 1
    }

    /// Always false: there are at least two bins.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        false
    }

    /// The bin of a point at the offset `[x, y]`, m, from where the light entered.
    #[must_use]
    pub fn index(&self, [x, y]: [f64; 2]) -> usize {
        let radius_m = (x * x + y * y).sqrt();
        self.edges_m.partition_point(|edge| *edge <= radius_m)
    }

    /// Inner and outer radius of a bin, m; the outer radius of the last is infinite.
    #[must_use]
    pub fn bounds_m(&self, bin: usize) -> [f64; 2] {
        let edge = |i: usize| self.edges_m.get(i).copied().unwrap_or(f64::INFINITY);
        [if bin == 0 { 0.0 } else { edge(bin - 1) }, edge(bin)]
    }

    /// Area of a bin, m2; infinite beyond the last radius.
    #[must_use]
    pub fn area_m2(&self, bin: usize) -> f64 {
        let [inner, outer] = self.bounds_m(bin);
        PI * (outer * outer - inner * inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_grow_by_equal_factors_and_take_every_radius() {
        let radii = Radii::new(4, 1e-3, 1.0);
        assert_eq!(radii.len(), 5);
        for (bin, radius) in [
            (0, 0.0),
            (0, 9e-4),
            (1, 1.1e-3),
            (2, 0.05),
            (3, 0.5),
            (4, 2.0),
        ] {
            assert_eq!(radii.index([0.6 * radius, -0.8 * radius]), bin, "{radius}");
        }
        let [inner, outer] = radii.bounds_m(2);
        assert!((inner - 0.01).abs() < 1e-12 && (outer - 0.1).abs() < 1e-12);
        let area: f64 = (0..4).map(|bin| radii.area_m2(bin)).sum();
        assert!((area - PI).abs() < 1e-12);
        assert_eq!(radii.area_m2(4), f64::INFINITY);
    }
}
