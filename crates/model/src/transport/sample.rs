//! What a walk needs to know about the snow and the light.
use crate::grain::{GrainType, mean_free_distance_m};
use crate::optics::{
    Carbon, CarbonLaw, Densities, IceTable, Impurity, ImpurityMass, WATER_DENSITY_KG_M3,
    WaterTable, ice_density_kg_m3,
};
use crate::transport::Joining;

/// One type of grain of a mixture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Its share of the ice volume; the shares of a snow sum to 1.
    pub fraction: f64,
    /// Its grains.
    pub grain: GrainType,
}

/// Homogeneous snow, without its thickness.
#[derive(Debug, Clone, PartialEq)]
pub struct Snow {
    /// The types of grain, at least one.
    pub grains: Vec<Component>,
    /// Density of the dry snow, kg/m3, in [0, ice density).
    pub density_kg_m3: f64,
    /// Temperature, Celsius, in [-40, 0].
    pub temperature_c: f64,
    /// Fraction of the pore space that is water, in [0, 0.5].
    pub water_saturation: f64,
    /// Black carbon in it.
    pub black_carbon: Option<Carbon>,
    /// Brown carbon in it.
    pub brown_carbon: Option<Carbon>,
}

impl Snow {
    /// Clean, dry snow of one type of grain.
    #[must_use]
    pub fn dry(grain: GrainType, density_kg_m3: f64, temperature_c: f64) -> Self {
        Self {
            grains: vec![Component {
                fraction: 1.0,
                grain,
            }],
            density_kg_m3,
            temperature_c,
            water_saturation: 0.0,
            black_carbon: None,
            brown_carbon: None,
        }
    }

    /// Mean free distances between the grains of each type, m (Varsa 2025,
    /// eq. B.10): infinite for a type that there is nothing of.
    pub fn distances_m(&self) -> impl Iterator<Item = f64> {
        let distance = |Component { fraction, grain }: &Component| {
            mean_free_distance_m(grain, self.density_kg_m3, self.temperature_c) / fraction
        };
        self.grains.iter().map(distance)
    }

    /// Mean free distance between grains of any type, m: what candidates at
    /// the distances of the types make, of which a ray meets the nearest.
    #[must_use]
    pub fn mean_free_distance_m(&self) -> f64 {
        match self.grains.as_slice() {
            [_] => self.distances_m().sum(),
            _ => {
                1.0 / self
                    .distances_m()
                    .map(|distance| 1.0 / distance)
                    .sum::<f64>()
            }
        }
    }

    /// Probability of each type that the next grain met is of it.
    #[must_use]
    pub fn meeting_shares(&self) -> Vec<f64> {
        let all = self.mean_free_distance_m();
        match self.grains.len() {
            1 => vec![1.0],
            _ => self.distances_m().map(|distance| all / distance).collect(),
        }
    }

    /// Lengths of the smallest and largest grain, m.
    #[must_use]
    pub fn sizes_m(&self) -> [f64; 2] {
        let sizes = || self.grains.iter().map(|component| component.grain.size);
        [
            sizes()
                .map(|size| size.min_m())
                .fold(f64::INFINITY, f64::min),
            sizes().map(|size| size.max_m()).fold(0.0, f64::max),
        ]
    }

    /// The carbon in it that absorbs.
    pub fn carbon(&self) -> impl Iterator<Item = &Carbon> {
        let all = [&self.black_carbon, &self.brown_carbon];
        all.into_iter()
            .flatten()
            .filter(|c| c.concentration_ng_g > 0.0)
    }

    /// What that adds to the absorption of ice and pores.
    pub fn impurities(&self, model: &Model) -> impl Iterator<Item = Impurity> {
        let (law, mass, densities) = (model.carbon_law, model.impurity_mass, self.densities());
        self.carbon()
            .map(move |carbon| carbon.impurity(law, mass, &densities))
    }

    /// Its densities.
    #[must_use]
    pub fn densities(&self) -> Densities {
        let ice_kg_m3 = ice_density_kg_m3(self.temperature_c);
        let pores = 1.0 - self.density_kg_m3 / ice_kg_m3;
        Densities {
            dry_kg_m3: self.density_kg_m3,
            wet_kg_m3: self.density_kg_m3 + WATER_DENSITY_KG_M3 * pores * self.water_saturation,
            ice_kg_m3,
        }
    }
}

/// Where on a grain's facing side the ray enters it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Entry {
    /// Uniform over the surface area that faces the ray (Varsa 2025).
    #[default]
    Uniform,
    /// Uniform over the projected area: exact for randomly placed grains.
    Projected,
}

impl Entry {
    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Projected => "projected",
        }
    }
}

/// Choices within the model and its tables.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Model {
    /// Law of the entry point.
    pub entry: Entry,
    /// How layers are joined.
    pub joining: Joining,
    /// How the absorption of carbon depends on wavelength.
    pub carbon_law: CarbonLaw,
    /// How the mass of carbon is spread over the phases.
    pub impurity_mass: ImpurityMass,
    /// Refractive index of ice.
    pub ice: IceTable,
    /// Refractive index of water in the pores.
    pub water: WaterTable,
}

/// How light falls on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Illumination {
    /// Parallel rays at a polar angle from the normal, radians, in [0, pi/2).
    Collimated {
        /// Angle between the rays and the surface normal.
        polar_angle_rad: f64,
    },
    /// Isotropic radiance over the upper hemisphere. What of it is more grazing
    /// than [`FIRST_FLIGHT`] allows, some 1e-6, falls at that limit.
    Diffuse,
}

/// Least depth of a ray's first flight, cosine times mean free distance, in
/// largest grains. At depth X a grain fits under the surface in some 2 X of
/// trials, so 10,000 trials fail with exp(-20,000 X): 1e-9 at this limit.
pub const FIRST_FLIGHT: f64 = 1e-3;

/// How much more room than [`super::FIRST_FLIGHT`] grains need that are met
/// uniformly over their projected area: at X largest grains under a plane they
/// fit in some 1.7 X^1.5 of trials, not 2 X.
const PROJECTED_ROOM: f64 = 12.0;

/// Cosine from the normal of a ray of isotropic radiance, for `u` uniform in
/// [0, 1): directions carry the weight of their cosine.
#[must_use]
pub fn diffuse_cosine(
    u: f64,
    entry: Entry,
    mean_free_distance_m: f64,
    longest_grain_m: f64,
) -> f64 {
    let room = match entry {
        Entry::Uniform => 1.0,
        Entry::Projected => PROJECTED_ROOM,
    };
    let least = room * FIRST_FLIGHT * longest_grain_m / mean_free_distance_m;
    (1.0 - u).sqrt().max(least).min(1.0)
}
