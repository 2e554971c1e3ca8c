//! The average effect of a grain event: the scattering kernel at any absorption, and
//! the displacement of the ray by a grain.
use serde::{Deserialize, Serialize};

use crate::math::{DEGREES, legendre};
use crate::table::{Histogram, Outcome};
use crate::transport::{Coefficients, Path};

/// Number of scores before the moments: displacement along the incoming ray, along the
/// outgoing ray, and its square.
const DISPLACEMENTS: usize = 3;
/// Nodes and weights of the mean over grain sizes: Gauss-Legendre quadrature on (0, 1),
/// exact for polynomials of degree 11.
const SIZE_QUADRATURE: [[f64; 2]; 6] = [
    [0.033_765_242_898_423_99, 0.085_662_246_189_585_17],
    [0.169_395_306_766_867_74, 0.180_380_786_524_069_3],
    [0.380_690_406_958_401_55, 0.233_956_967_286_345_52],
    [0.619_309_593_041_598_5, 0.233_956_967_286_345_52],
    [0.830_604_693_233_132_3, 0.180_380_786_524_069_3],
    [0.966_234_757_101_576, 0.085_662_246_189_585_17],
];

/// Sums over outcomes, binned by the path in ice.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Kernel {
    sums: Histogram,
    moments: usize,
    count: f64,
}

/// The average grain event, with each ray weighted by exp(-alpha L).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Event {
    /// E[exp(-alpha L) P_l(cos Theta)]; the first is the single-scattering albedo.
    pub moments: Vec<f64>,
    /// Mean displacement along the incoming and along the outgoing ray, m.
    pub displacement_m: [f64; 2],
    /// Mean squared displacement, m2.
    pub displacement_sq_m2: f64,
}

impl Kernel {
    /// Bytes on the heap.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.sums.bytes()
    }

    /// Sums over `outcomes`, with the first `moments` (at most 64) Legendre moments.
    #[must_use]
    pub fn new(outcomes: &[Outcome], moments: usize) -> Self {
        let moments = moments.min(DEGREES);
        let mut sums = Histogram::new(1.0, 0, DISPLACEMENTS + moments);
        let mut scores = vec![0.0; DISPLACEMENTS + moments];
        for outcome in outcomes.iter().filter(|o| o.ice.is_finite()) {
            let (cos, sin) = (f64::from(outcome.cos), f64::from(outcome.sin));
            let [x, y, along] = outcome.displacement.map(f64::from);
            scores[0] = along;
            scores[1] = along * cos + x * sin;
            scores[2] = x * x + y * y + along * along;
            legendre(cos, &mut scores[DISPLACEMENTS..]);
            let path = Path {
                ice_m: f64::from(outcome.ice),
                ..Path::default()
            };
            sums.add(&path, &scores);
        }
        Self {
            sums,
            moments,
            count: outcomes.len() as f64,
        }
    }

    /// Adds the sums of another kernel with the same number of moments.
    pub fn merge(&mut self, other: &Self) {
        self.sums.merge(&other.sums);
        self.count += other.count;
    }

    /// The mean over grains of lengths uniform in `size_m`, in ice with the absorption
    /// coefficient `ice_per_m`.
    #[must_use]
    pub fn event(&self, size_m: [f64; 2], ice_per_m: f64) -> Event {
        let mut means = vec![0.0; DISPLACEMENTS + self.moments];
        let mut sums = means.clone();
        let [min, max] = size_m;
        for [u, weight] in SIZE_QUADRATURE {
            let size = min + (max - min) * u;
            let coefficients = Coefficients {
                ice_per_m: ice_per_m * size,
                ..Coefficients::default()
            };
            self.sums.weighted(&coefficients, &mut sums);
            for (column, (mean, sum)) in means.iter_mut().zip(&sums).enumerate() {
                let scale = match column {
                    0 | 1 => size,
                    2 => size * size,
                    _ => 1.0,
                };
                *mean += weight * scale * sum / self.count;
            }
        }
        Event {
            moments: means.split_off(DISPLACEMENTS),
            displacement_m: [means[0], means[1]],
            displacement_sq_m2: means[2],
        }
    }
}

impl Event {
    /// A mixture: `1 - share` of this event and `share` of `other`.
    #[must_use]
    pub fn mix(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| (1.0 - share) * a + share * b;
        let pairs = self.moments.iter().zip(&other.moments);
        Self {
            moments: pairs.map(|(a, b)| mix(*a, *b)).collect(),
            displacement_m: [0, 1].map(|i| mix(self.displacement_m[i], other.displacement_m[i])),
            displacement_sq_m2: mix(self.displacement_sq_m2, other.displacement_sq_m2),
        }
    }

    /// This event with the scattered light attenuated by the factor `survival`.
    #[must_use]
    pub fn attenuated(&self, survival: f64) -> Self {
        Self {
            moments: self.moments.iter().map(|m| survival * m).collect(),
            displacement_m: self.displacement_m.map(|d| survival * d),
            displacement_sq_m2: survival * self.displacement_sq_m2,
        }
    }

    /// Mean free path, m, of point scatterers that scatter alike and spread light as far
    /// as these grains do, after flights of mean length d and mean square 2 q^2, where
    /// `flight_m` = [d, q]. With the displacement delta in a grain, a = E(delta.u_in),
    /// b = E(delta.u_out) and g = E(cos Theta), the square of the mean free path is
    /// g d^2 + (1 - g) (q^2 + E(|delta|^2) / 2) + d (a + b) + a b.
    ///
    /// Mean displacements are over all rays, with 0 for absorbed ones: where grains absorb,
    /// unscattered light, which no grain displaces, contributes more.
    #[must_use]
    pub fn effective_mean_free_path_m(&self, flight_m: [f64; 2]) -> f64 {
        let albedo = self.moments[0].max(f64::MIN_POSITIVE);
        let g = self.moments.get(1).copied().unwrap_or(0.0) / albedo;
        let [a, b] = self.displacement_m;
        let [d, q] = flight_m;
        let apart = (1.0 - g) * (q * q + self.displacement_sq_m2 / 2.0);
        (g * d * d + apart + d * (a + b) + a * b).sqrt()
    }
}
