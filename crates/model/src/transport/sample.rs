//! The snow and light that a walk needs to know about.
use crate::grain::{Facets, GrainType, mean_free_distance_m};
use crate::optics::{
    Absorber, Carbon, CarbonLaw, Densities, IceTable, Impurity, ImpurityMass, Particles,
    WATER_DENSITY_KG_M3, WaterTable, ice_density_kg_m3,
};
use crate::transport::Joining;

/// One type of grain of a mixture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Its share of the ice volume. The shares in a snow sum to 1.
    pub fraction: f64,
    /// The type of grain.
    pub grain: GrainType,
}

/// Homogeneous snow of unspecified thickness.
#[derive(Debug, Clone, PartialEq)]
pub struct Snow {
    /// The grain types, at least one.
    pub grains: Vec<Component>,
    /// Density of the dry snow, kg/m3, in [0, ice density).
    pub density_kg_m3: f64,
    /// Temperature, Celsius, in [-40, 0].
    pub temperature_c: f64,
    /// Fraction of the pore volume that is water, in [0, 0.5].
    pub water_saturation: f64,
    /// Black carbon, if any.
    pub black_carbon: Option<Carbon>,
    /// Brown carbon, if any.
    pub brown_carbon: Option<Carbon>,
    /// Other light-absorbing substances.
    pub absorbers: Vec<Absorber>,
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
            absorbers: Vec::new(),
        }
    }

    /// Mean free distance between grains of each type, m (Varsa 2025, eq. B.10);
    /// infinite for a type with fraction 0.
    pub fn distances_m(&self) -> impl Iterator<Item = f64> {
        let distance = |Component { fraction, grain }: &Component| {
            mean_free_distance_m(grain, self.density_kg_m3, self.temperature_c) / fraction
        };
        self.grains.iter().map(distance)
    }

    /// Mean free distance between events, m: grains of any type, and scattering particles in the
    /// pores. Each proposes an event at its own distance and the ray meets the nearest, so the rates
    /// add.
    #[must_use]
    pub fn mean_free_distance_m(&self) -> f64 {
        let rates = || self.distances_m().map(|distance| 1.0 / distance);
        match (self.grains.as_slice(), self.particles()) {
            ([_], None) => self.distances_m().sum(),
            (_, None) => 1.0 / rates().sum::<f64>(),
            (_, Some(particles)) => 1.0 / (rates().sum::<f64>() + particles.per_m),
        }
    }

    /// For each type of grain, and then for [`Self::particles`] if there are any, the probability
    /// that the next event is of that type.
    #[must_use]
    pub fn meeting_shares(&self) -> Vec<f64> {
        let mean_distance_m = self.mean_free_distance_m();
        let particles = self.particles();
        if self.grains.len() == 1 && particles.is_none() {
            return vec![1.0];
        }
        let grains = self
            .distances_m()
            .map(|distance| mean_distance_m / distance);
        let particles = particles.map(|particles| mean_distance_m * particles.per_m);
        grains.chain(particles).collect()
    }

    /// Scattering by all particles in the pores.
    #[must_use]
    pub fn particles(&self) -> Option<Particles> {
        let densities = self.densities();
        Particles::of_all(self.absorbers().filter_map(|a| a.particles(&densities)))
    }

    /// In the order of [`Self::meeting_shares`], the lengths of the smallest and largest grain of each
    /// type, m; 0 for particles, which are points.
    pub fn sizes_by_type_m(&self) -> impl Iterator<Item = [f64; 2]> {
        let sizes = self.grains.iter().map(|component| component.grain.size);
        let grains = sizes.map(|size| [size.min_m(), size.max_m()]);
        grains.chain(self.particles().map(|_| [0.0; 2]))
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

    /// The carbon that absorbs, i.e. of nonzero concentration.
    pub fn carbon(&self) -> impl Iterator<Item = &Carbon> {
        let kinds = [&self.black_carbon, &self.brown_carbon];
        kinds
            .into_iter()
            .flatten()
            .filter(|c| c.concentration_ng_g > 0.0)
    }

    /// The other substances that absorb.
    pub fn absorbers(&self) -> impl Iterator<Item = &Absorber> {
        let all = self.absorbers.iter();
        all.filter(|absorber| absorber.concentration_ng_g > 0.0)
    }

    /// The absorption that all these substances add to ice and pores.
    pub fn impurities(&self, model: &Model) -> impl Iterator<Item = Impurity> {
        let (law, mass, densities) = (model.carbon_law, model.impurity_mass, self.densities());
        let carbon = self
            .carbon()
            .map(move |carbon| carbon.impurity(law, mass, &densities));
        let others = self.absorbers();
        carbon.chain(others.map(move |absorber| absorber.impurity(mass, &densities)))
    }

    /// Densities of the dry snow, the wet snow and the ice.
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

/// Where on its side facing the ray a grain is entered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Entry {
    /// Uniform over the surface area that faces the ray (Varsa 2025).
    #[default]
    Uniform,
    /// Uniform over the projected area, with the attitude of the grain weighted by this
    /// area: exact for randomly placed grains.
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
    /// Distribution of the entry point.
    pub entry: Entry,
    /// Which facets of a grain a ray meets.
    pub facets: Facets,
    /// How layers are joined.
    pub joining: Joining,
    /// How the absorption of carbon depends on wavelength.
    pub carbon_law: CarbonLaw,
    /// How the mass of carbon is distributed between ice and pores.
    pub impurity_mass: ImpurityMass,
    /// Refractive-index table of ice.
    pub ice: IceTable,
    /// Refractive-index table of water in the pores.
    pub water: WaterTable,
}

/// Illumination of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Illumination {
    /// Parallel rays at a polar angle from the normal, radians, in [0, pi/2).
    Collimated {
        /// Angle between the rays and the surface normal.
        polar_angle_rad: f64,
    },
    /// Isotropic radiance over the upper hemisphere. Directions more grazing than
    /// [`FIRST_FLIGHT`] allows, about 1e-6 of the light, are moved to that limit.
    Diffuse,
}

/// Smallest mean depth of a ray's first flight (cosine times mean free distance), in
/// units of the largest grain. At depth X a grain fits under the surface in about 2 X
/// of the trials, so 10,000 trials fail with probability exp(-20,000 X): 1e-9 at this
/// limit.
pub const FIRST_FLIGHT: f64 = 1e-3;

/// Factor on [`super::FIRST_FLIGHT`] for grains met uniformly over their projected
/// area: at a depth of X largest grains, they fit in about 1.7 X^1.5 of the trials
/// instead of 2 X.
const PROJECTED_ROOM: f64 = 12.0;

/// Cosine of the incidence angle of a ray of isotropic radiance, for `u` uniform in
/// [0, 1). Directions are weighted by their cosine.
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
