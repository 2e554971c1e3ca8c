//! The grains of a compact file: optical radius and specific surface area.
use crate::config;
use crate::grain::{GrainType, SizeMeasure, SizeRange, TruncatedNormal, specific_surface_m2_kg};
use crate::grid::Grid;
use crate::lookup::Database;
use crate::optics::ice_density_kg_m3;
use crate::parameter::{Parameter, Point};
use crate::units::um_to_m;

/// The grid of which a compact file was made.
#[derive(Debug, Clone)]
pub struct FileGrains {
    grid: Grid,
}

impl FileGrains {
    /// The grains of `database`; `None` if it does not state its grid, as files of `tailor`.
    #[must_use]
    pub fn of(database: &Database) -> Option<Self> {
        let metadata = database.metadata();
        let provenance = metadata.get("provenance");
        let provenance: Option<serde_json::Value> =
            provenance.and_then(|text| serde_json::from_str(text).ok());
        let config = provenance.as_ref()?.get("config")?.as_str()?;
        let grid = config::grid::parse("the compact file", config).ok()?.grid;
        Some(Self { grid })
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The measure of the grains at `point`: their specific surface area, m2/kg, or their optical
    /// radius, um. NaN if the snow at `point` does not exist.
    #[must_use]
    pub fn measure(&self, measure: SizeMeasure, point: &Point) -> f64 {
        let Ok(fixed) = self.grid.fixed.at(&point.optional(), &self.grid.spread) else {
            return f64::NAN;
        };
        let (size_um, half_um) = (
            point[Parameter::GrainSize],
            self.grid.spread.grain_size_half_width_um,
        );
        let ends = [size_um - half_um, size_um + half_um].map(um_to_m);
        let (Ok(size), Ok(any)) = (
            SizeRange::new(ends[0], ends[1]),
            TruncatedNormal::new(0.0, 0.0, 0.0, 0.0),
        ) else {
            return f64::NAN;
        };
        let grain = GrainType {
            size: size.with_law(self.grid.spread.size_law),
            // the surface does not depend on facets
            facetness: any,
            shape: fixed.shape,
            proportion: fixed.proportion,
        };
        let ssa = specific_surface_m2_kg(&grain, fixed.temperature_c);
        match measure {
            SizeMeasure::SpecificSurface => ssa,
            SizeMeasure::OpticalRadius => 3e6 / (ssa * ice_density_kg_m3(fixed.temperature_c)),
        }
    }

    /// The grain size, um, within `range`, at which the measure is `value`; the nearest end if
    /// there is none. `snow` has the other values that the measure depends on.
    #[must_use]
    pub fn size_um(&self, measure: SizeMeasure, value: f64, range: [f64; 2], snow: &Point) -> f64 {
        let [mut low, mut high] = range;
        let rises = measure == SizeMeasure::OpticalRadius;
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            let found = self.measure(measure, &snow.with(Parameter::GrainSize, middle));
            match (found < value) == rises {
                true => low = middle,
                false => high = middle,
            }
        }
        (low * high).sqrt()
    }
}
