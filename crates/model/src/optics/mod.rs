//! Optical properties of ice, water and absorbers, and reflection and refraction at
//! interfaces (docs/methods.md; Varsa 2025, appendix A).
mod absorber;
mod carbon;
mod index;
mod interface;
mod species;

pub use absorber::{
    Absorber, AbsorptionLaw, IMPURITY_NM, Impurity, MassAbsorption, ParticleScattering, Particles,
};
pub use carbon::{Carbon, CarbonLaw, Densities, ImpurityMass};
pub use index::{
    DataFile, IceTable, Index, MODEL_RANGE_NM, OpticsError, Water, WaterTable, data_files,
    ice_density_kg_m3,
};
pub use interface::{Incidences, Interface, Interfaces, reflect};
pub use species::{SPECIES, Species};

/// Density of liquid water, kg/m3.
pub const WATER_DENSITY_KG_M3: f64 = 1000.0;
