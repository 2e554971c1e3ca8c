//! Optical properties of ice and water, and what happens at their surfaces
//! (docs/methods.md; Varsa 2025, appendix A).
mod index;
mod interface;

pub use index::{
    DataFile, IceTable, Index, MODEL_RANGE_NM, OpticsError, Water, WaterTable, data_files,
    ice_density_kg_m3,
};
pub use interface::{Incidences, Interface, Interfaces, reflect};
