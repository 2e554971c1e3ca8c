//! Grain sizes from the optical radius or the specific surface area.
//!
//! The grains that a walk meets have the specific surface area SSA = 4 K1 K2 / ice density
//! ([`super::specific_surface_m2_kg`]). The optical radius is the radius of spheres with
//! the same specific surface area, 3 / (SSA ice density) = 3 / (4 K1 K2). K2 is known from
//! the shape, so either measure gives K1, and K1 with the width of the size distribution
//! gives the mean size.
use crate::grain::{Shape, SizeLaw, SizeRange, TruncatedNormal, shape_factor, size_factor_per_m};
use crate::optics::ice_density_kg_m3;
use splitsnow_spectra::units::{m_to_um, um_to_m};

/// A measure that can replace the grain size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SizeMeasure {
    /// Optical (effective) radius, um.
    OpticalRadius,
    /// Specific surface area, m2/kg.
    SpecificSurface,
}

/// The properties of grains that convert a measure to a size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeConversion {
    /// Half the width of the size distribution, which is uniform about the mean, um.
    pub half_width_um: f64,
    /// How often grains of different sizes are met.
    pub size_law: SizeLaw,
    /// Shape.
    pub shape: Shape,
    /// Distribution of the proportion.
    pub proportion: TruncatedNormal,
    /// Temperature, Celsius.
    pub temperature_c: f64,
}

impl SizeMeasure {
    /// Both measures.
    pub const ALL: [Self; 2] = [Self::OpticalRadius, Self::SpecificSurface];

    /// Its name in files, with the unit as suffix.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OpticalRadius => "optical_radius_um",
            Self::SpecificSurface => "ssa_m2_kg",
        }
    }

    /// Its description and its unit.
    #[must_use]
    pub const fn about(self) -> (&'static str, &'static str) {
        match self {
            Self::OpticalRadius => (
                "optical radius of the grains, 3 / (SSA ice density), with the SSA = 4 K1 K2 / ice density that the walk's extinction implies",
                "um",
            ),
            Self::SpecificSurface => (
                "specific surface area of the grains, 4 K1 K2 / ice density, that the walk's extinction implies",
                "m2 kg-1",
            ),
        }
    }

    /// Mean size, um, of grains for which this measure is `value`, above 0.
    #[must_use]
    pub fn size_um(self, value: f64, conversion: &SizeConversion) -> f64 {
        let shape = shape_factor(
            conversion.shape,
            &conversion.proportion,
            conversion.size_law,
        );
        let k1_per_m = match self {
            Self::OpticalRadius => 3.0 / (4.0 * shape * um_to_m(value)),
            Self::SpecificSurface => {
                value * ice_density_kg_m3(conversion.temperature_c) / (4.0 * shape)
            }
        };
        let single_um = m_to_um(1.0 / k1_per_m);
        let width_um = conversion.half_width_um;
        if width_um == 0.0 || conversion.size_law == SizeLaw::Consistent {
            return single_um;
        }
        // K1 falls with the mean m, and m - width < 1 / K1 < m
        let (mut low, mut high) = (single_um.max(width_um), single_um + width_um);
        for _ in 0..100 {
            let mean = 0.5 * (low + high);
            let range = SizeRange::new(um_to_m(mean - width_um), um_to_m(mean + width_um));
            match range {
                Ok(range) if size_factor_per_m(&range) <= k1_per_m => high = mean,
                _ => low = mean,
            }
        }
        0.5 * (low + high)
    }

    /// Mean sizes, um, of grains with these increasing values of the measure. The sizes
    /// increase too, so those of specific surface areas are in reverse order.
    #[must_use]
    pub fn sizes_um(self, values: &[f64], conversion: &SizeConversion) -> Vec<f64> {
        let sizes = values.iter().map(|value| self.size_um(*value, conversion));
        let mut sizes: Vec<f64> = sizes.collect();
        if self == Self::SpecificSurface {
            sizes.reverse();
        }
        sizes
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::grain::{GrainType, specific_surface_m2_kg};

    /// Grains of the size found have the given measure, for any width, size law and
    /// sphericity.
    #[test]
    fn sizes_reproduce_the_given_measure() {
        let usual = TruncatedNormal::new(0.6, 0.95, 0.798, 0.064).unwrap();
        let sphere = TruncatedNormal::new(1.0, 1.0, 1.0, 0.0).unwrap();
        for (sphericity, size_law) in [
            (usual, SizeLaw::Varsa2025),
            (usual, SizeLaw::Consistent),
            (sphere, SizeLaw::Varsa2025),
        ] {
            for half_width_um in [0.0, 10.0, 50.0] {
                let conversion = SizeConversion {
                    half_width_um,
                    size_law,
                    shape: Shape::Spheroid,
                    proportion: sphericity,
                    temperature_c: -5.0,
                };
                for radius_um in [30.0, 82.0, 500.0, 2000.0] {
                    let ssa = 3.0 / (radius_um * 1e-6 * ice_density_kg_m3(-5.0));
                    let mean_um = SizeMeasure::OpticalRadius.size_um(radius_um, &conversion);
                    let other = SizeMeasure::SpecificSurface.size_um(ssa, &conversion);
                    assert!((mean_um / other - 1.0).abs() < 1e-12, "{mean_um} {other}");
                    let ends = [mean_um - half_width_um, mean_um + half_width_um];
                    let size = SizeRange::new(um_to_m(ends[0]), um_to_m(ends[1])).unwrap();
                    let grain = GrainType {
                        size: size.with_law(size_law),
                        facetness: sphere,
                        shape: Shape::Spheroid,
                        proportion: sphericity,
                    };
                    let found = specific_surface_m2_kg(&grain, -5.0);
                    assert!(
                        (found / ssa - 1.0).abs() < 1e-9,
                        "{radius_um}: {found} {ssa}"
                    );
                }
            }
        }
        let conversion = SizeConversion {
            half_width_um: 0.0,
            size_law: SizeLaw::Varsa2025,
            shape: Shape::Spheroid,
            proportion: usual,
            temperature_c: -1.0,
        };
        // a sphere is as long as it is wide; the usual grains are 1 / .351 radii long
        let sphere = SizeConversion {
            proportion: sphere,
            ..conversion
        };
        assert!((SizeMeasure::OpticalRadius.size_um(82.0, &sphere) - 164.0).abs() < 1e-9);
        assert!(
            (82.0 / SizeMeasure::OpticalRadius.size_um(82.0, &conversion) - 0.351).abs() < 5e-4
        );
        let sizes = SizeMeasure::SpecificSurface.sizes_um(&[5.0, 20.0, 60.0], &conversion);
        assert!(sizes[0] < sizes[1] && sizes[1] < sizes[2]);
        assert_eq!(
            sizes[2],
            SizeMeasure::SpecificSurface.size_um(5.0, &conversion)
        );
    }
}
