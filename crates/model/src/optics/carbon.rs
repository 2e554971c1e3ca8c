//! Absorption by black and brown carbon in snow (docs/methods.md; Varsa 2025,
//! eqs. 4.10-4.12).
//!
//! alpha(lambda) = M (lambda_0 / lambda)^A D C. The thesis prints
//! M lambda_0 / lambda^A (eq. 4.12), which has the wrong units unless A is 1;
//! [`CarbonLaw::Varsa2025`] is that form with wavelengths in nm.

use super::absorber::{AbsorptionLaw, IMPURITY_NM, Impurity};

/// Light-absorbing carbon in snow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Carbon {
    /// Mass of carbon per mass of snow C, ng/g.
    pub concentration_ng_g: f64,
    /// Share X of the carbon that is in the ice, [0, 1]; the rest is in the pores.
    pub sedimentation: f64,
    /// Mass absorption efficiency M at the reference wavelength, m2/g.
    pub mass_absorption_efficiency_m2_g: f64,
    /// Reference wavelength lambda_0, nm.
    pub reference_wavelength_nm: f64,
    /// Angstrom exponent A.
    pub angstrom_exponent: f64,
    /// Whether C is per mass of wet snow (with its liquid water) instead of dry snow.
    pub per_wet_mass: bool,
}

/// How the absorption of carbon depends on wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CarbonLaw {
    /// M (lambda_0 / lambda)^A.
    #[default]
    Power,
    /// M lambda_0 / lambda^A with wavelengths in nm, as printed in Varsa 2025, eq. 4.12.
    Varsa2025,
}

impl CarbonLaw {
    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Power => "power",
            Self::Varsa2025 => "varsa2025",
        }
    }
}

/// How the mass of carbon is distributed over the phases of the snow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ImpurityMass {
    /// Each phase absorbs as if it filled the snow (Varsa 2025).
    #[default]
    Varsa2025,
    /// The mass of carbon per volume of snow is that given by the concentration,
    /// whichever phase it is in.
    Conserved,
}

impl ImpurityMass {
    /// The name used in configs and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Varsa2025 => "varsa2025",
            Self::Conserved => "conserved",
        }
    }
}

/// Densities of snow that determine the absorption by carbon, kg/m3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Densities {
    /// Density of the dry snow.
    pub dry_kg_m3: f64,
    /// Density of the snow with its liquid water.
    pub wet_kg_m3: f64,
    /// Density of ice.
    pub ice_kg_m3: f64,
}

impl Densities {
    /// Density of the snow with its liquid water, or without.
    pub(super) fn of(&self, wet: bool) -> f64 {
        if wet { self.wet_kg_m3 } else { self.dry_kg_m3 }
    }
}

impl Carbon {
    /// Black carbon with the defaults of Varsa 2025: M = 16.619 m2/g at 880 nm and
    /// exponent 1, all in the ice.
    #[must_use]
    pub fn black(concentration_ng_g: f64) -> Self {
        Self {
            concentration_ng_g,
            sedimentation: 1.0,
            mass_absorption_efficiency_m2_g: 16.619,
            reference_wavelength_nm: 880.0,
            angstrom_exponent: 1.0,
            per_wet_mass: false,
        }
    }

    /// Brown carbon: like [`Carbon::black`], with exponent 2.
    #[must_use]
    pub fn brown(concentration_ng_g: f64) -> Self {
        Self {
            angstrom_exponent: 2.0,
            ..Self::black(concentration_ng_g)
        }
    }

    /// Absorption coefficient of all the carbon in snow of `density_kg_m3`, 1/m
    /// (eq. 4.12).
    #[must_use]
    pub fn absorption_per_m(&self, law: CarbonLaw, density_kg_m3: f64, wavelength_nm: f64) -> f64 {
        let (reference, exponent) = (self.reference_wavelength_nm, self.angstrom_exponent);
        let spectral = match law {
            CarbonLaw::Power => libm::pow(reference / wavelength_nm, exponent),
            CarbonLaw::Varsa2025 => reference / libm::pow(wavelength_nm, exponent),
        };
        // kg/m3 are 1e3 g/m3, ng/g are 1e-9
        let mass_g_m3 = density_kg_m3 * self.concentration_ng_g * 1e-6;
        self.mass_absorption_efficiency_m2_g * spectral * mass_g_m3
    }

    /// Absorption that the carbon adds to ice and pores (eqs. 4.10, 4.11).
    #[must_use]
    pub fn impurity(&self, law: CarbonLaw, mass: ImpurityMass, densities: &Densities) -> Impurity {
        let density_kg_m3 = densities.of(self.per_wet_mass);
        let total_per_m = self.absorption_per_m(law, density_kg_m3, IMPURITY_NM);
        Impurity::new(
            AbsorptionLaw::Power(self.angstrom_exponent),
            (total_per_m, self.sedimentation),
            mass,
            densities,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SNOW: Densities = Densities {
        dry_kg_m3: 275.0,
        wet_kg_m3: 310.0,
        ice_kg_m3: 916.0,
    };

    /// 500 ng/g in 275 kg/m3 are 0.1375 g/m3; times 16.619 m2/g and 880/400 = 2.2.
    #[test]
    fn coefficients_by_hand() {
        let (black, brown) = (Carbon::black(500.0), Carbon::brown(500.0));
        let at_400 = |carbon: Carbon, law| carbon.absorption_per_m(law, 275.0, 400.0);
        let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        close(at_400(black, CarbonLaw::Power), 16.619 * 0.1375 * 2.2);
        close(at_400(brown, CarbonLaw::Power), 16.619 * 0.1375 * 4.84);
        close(at_400(black, CarbonLaw::Varsa2025), 16.619 * 0.1375 * 2.2);
        let printed = 16.619 * 0.1375 * 880.0 / 160_000.0;
        close(at_400(brown, CarbonLaw::Varsa2025), printed);
    }

    #[test]
    fn an_impurity_is_the_carbon_at_every_wavelength() {
        for law in [CarbonLaw::Power, CarbonLaw::Varsa2025] {
            let carbon = Carbon {
                sedimentation: 0.25,
                ..Carbon::brown(120.0)
            };
            let impurity = carbon.impurity(law, ImpurityMass::Varsa2025, &SNOW);
            for nm in [350.0, 880.0, 2500.0] {
                let all = carbon.absorption_per_m(law, 275.0, nm);
                let factor = impurity.law.factor(nm).unwrap_or(f64::NAN);
                assert!((impurity.ice_per_m * factor / (0.25 * all) - 1.0).abs() < 1e-12);
                assert!((impurity.pores_per_m * factor / (0.75 * all) - 1.0).abs() < 1e-12);
            }
        }
    }

    /// Volume shares of the phases times their coefficients give the total.
    #[test]
    fn mass_is_conserved_on_request() {
        let carbon = Carbon {
            sedimentation: 0.3,
            per_wet_mass: true,
            ..Carbon::black(80.0)
        };
        let found = carbon.impurity(CarbonLaw::Power, ImpurityMass::Conserved, &SNOW);
        let ice = 275.0 / 916.0;
        let all = carbon.absorption_per_m(CarbonLaw::Power, 310.0, IMPURITY_NM);
        assert!((found.ice_per_m * ice / (0.3 * all) - 1.0).abs() < 1e-12);
        assert!((found.pores_per_m * (1.0 - ice) / (0.7 * all) - 1.0).abs() < 1e-12);
    }
}
