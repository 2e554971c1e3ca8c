//! Conversions between measures of water content and density of snow (docs/methods.md;
//! Varsa 2025, eqs. 4.9, C.16, C.17). Densities are in kg/m3. The saturation S is the
//! fraction of the pore space that is water, the water fraction W the fraction of the
//! total volume.

use crate::optics::WATER_DENSITY_KG_M3;

/// Saturation S = W D_ice / (D_ice - D) of snow of dry density D.
#[must_use]
pub fn saturation(water_fraction: f64, density_kg_m3: f64, ice_density_kg_m3: f64) -> f64 {
    water_fraction * ice_density_kg_m3 / (ice_density_kg_m3 - density_kg_m3)
}

/// Water fraction W = S (1 - D / D_ice): the inverse of [`saturation`].
#[must_use]
pub fn water_fraction(saturation: f64, density_kg_m3: f64, ice_density_kg_m3: f64) -> f64 {
    saturation * (1.0 - density_kg_m3 / ice_density_kg_m3)
}

/// Wet density D + (1 - D / D_ice) D_water S.
#[must_use]
pub fn wet_density_kg_m3(density_kg_m3: f64, saturation: f64, ice_density_kg_m3: f64) -> f64 {
    let fraction = water_fraction(saturation, density_kg_m3, ice_density_kg_m3);
    density_kg_m3 + WATER_DENSITY_KG_M3 * fraction
}

/// Dry density (D_wet - D_water S) / (1 - D_water S / D_ice): the inverse of
/// [`wet_density_kg_m3`] at the same saturation, for S < D_ice / D_water.
#[must_use]
pub fn dry_density_kg_m3(wet_density_kg_m3: f64, saturation: f64, ice_density_kg_m3: f64) -> f64 {
    let water = WATER_DENSITY_KG_M3 * saturation;
    (wet_density_kg_m3 - water) / (1.0 - water / ice_density_kg_m3)
}

/// Dry density D_wet - D_water W, from the water fraction.
#[must_use]
pub fn dry_density_from_fraction_kg_m3(wet_density_kg_m3: f64, water_fraction: f64) -> f64 {
    wet_density_kg_m3 - WATER_DENSITY_KG_M3 * water_fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn by_hand() {
        // 300 kg/m3 in ice of 900: porosity 2/3; S = 0.3 is W = 0.2, 200 kg/m3 of water.
        assert!((saturation(0.2, 300.0, 900.0) - 0.3).abs() < 1e-15);
        assert!((wet_density_kg_m3(300.0, 0.3, 900.0) - 500.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn inverses(density in 50.0..550.0, s in 0.0..=0.5, ice in 916.0..923.0) {
            let w = water_fraction(s, density, ice);
            prop_assert!((saturation(w, density, ice) - s).abs() < 1e-14);
            let wet = wet_density_kg_m3(density, s, ice);
            prop_assert!((dry_density_kg_m3(wet, s, ice) - density).abs() < 1e-11);
            prop_assert!((dry_density_from_fraction_kg_m3(wet, w) - density).abs() < 1e-11);
        }
    }
}
