//! Optical properties of ice, water and carbon, and reflection and refraction at
//! interfaces (docs/methods.md; Varsa 2025, appendix A).
mod carbon;
mod index;
mod interface;

pub use carbon::{Carbon, CarbonLaw, Densities, IMPURITY_NM, Impurity, ImpurityMass};
pub use index::{
    DataFile, IceTable, Index, MODEL_RANGE_NM, OpticsError, Water, WaterTable, data_files,
    ice_density_kg_m3,
};
pub use interface::{Incidences, Interface, Interfaces, reflect};

/// Density of liquid water, kg/m3.
pub const WATER_DENSITY_KG_M3: f64 = 1000.0;
