//! Light-absorbing substances in snow: how much they absorb at each wavelength (m2/g), and what they
//! add to the absorption of ice and pores (1/m). Their particles in the pores may scatter, the same
//! at all wavelengths, by the phase function of Henyey and Greenstein (1941, Astrophys. J. 93, 70)
//! (docs/absorbers.md). They are points: shadows, diffraction and scattering inside the ice are left out.
use std::sync::Arc;

use splitsnow_spectra::spectrum::Table;

use super::{Densities, ImpurityMass};

/// Wavelength at which the strength of an [`Impurity`] with a power law is given, nm.
pub const IMPURITY_NM: f64 = 550.0;

/// How absorption depends on wavelength.
#[derive(Debug, Clone, PartialEq)]
pub enum AbsorptionLaw {
    /// ([`IMPURITY_NM`] / lambda)^A, with the Angstrom exponent A.
    Power(f64),
    /// The mass absorption efficiency, m2/g, in the first column of a table over wavelength in
    /// nm, linear between its rows.
    Table(Arc<Table>),
}

impl AbsorptionLaw {
    /// Factor by which the coefficients of an [`Impurity`] are multiplied at a wavelength;
    /// `None` outside the table.
    #[must_use]
    pub fn factor(&self, wavelength_nm: f64) -> Option<f64> {
        match self {
            Self::Power(exponent) => Some(libm::pow(IMPURITY_NM / wavelength_nm, *exponent)),
            Self::Table(table) => table.linear(0, wavelength_nm),
        }
    }
}

/// What an absorber adds to the absorption coefficients of ice and pores. Both are multiplied
/// by the factor of the law at a wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct Impurity {
    /// Added to that of ice: 1/m at [`IMPURITY_NM`] with a power law, g/m3 with a table.
    pub ice_per_m: f64,
    /// Added to that of the pore space, water or air, in the same unit.
    pub pores_per_m: f64,
    /// How it depends on wavelength.
    pub law: AbsorptionLaw,
}

impl Impurity {
    /// Divides the coefficient `total` of all the substance, of which the share
    /// `sedimentation` is in the ice, between ice and pores (Varsa 2025, eqs. 4.10, 4.11).
    pub(super) fn new(
        law: AbsorptionLaw,
        (total, sedimentation): (f64, f64),
        mass: ImpurityMass,
        densities: &Densities,
    ) -> Self {
        let ice_share = densities.dry_kg_m3 / densities.ice_kg_m3;
        let (ice, pores) = match mass {
            ImpurityMass::Varsa2025 => (1.0, 1.0),
            ImpurityMass::Conserved => (1.0 / ice_share, 1.0 / (1.0 - ice_share)),
        };
        Self {
            ice_per_m: sedimentation * total * ice,
            pores_per_m: (1.0 - sedimentation) * total * pores,
            law,
        }
    }
}

/// Mass absorption efficiency over wavelength.
#[derive(Debug, Clone, PartialEq)]
pub enum MassAbsorption {
    /// M (lambda_0 / lambda)^A.
    Power {
        /// M, m2/g.
        m2_g: f64,
        /// lambda_0, nm.
        reference_nm: f64,
        /// Angstrom exponent A.
        angstrom_exponent: f64,
    },
    /// Values in m2/g in the first column of a table over wavelength in nm.
    Table(Arc<Table>),
}

/// Scattering by the particles of an absorber that are in the pores, the same at all wavelengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleScattering {
    /// Mass scattering efficiency, m2/g.
    pub m2_g: f64,
    /// Asymmetry parameter g of their phase function (Henyey and Greenstein 1941), in (-1, 1).
    pub asymmetry: f64,
}

/// Scattering by all particles in the pores of a snow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particles {
    /// Scattering coefficient of the pore space, 1/m.
    pub per_m: f64,
    /// Asymmetry parameter of the mean phase function.
    pub asymmetry: f64,
}

impl Particles {
    /// The particles of all `parts`; `None` if they do not scatter.
    pub(crate) fn of_all(parts: impl Iterator<Item = Self>) -> Option<Self> {
        let mut sum = Self {
            per_m: 0.0,
            asymmetry: 0.0,
        };
        for part in parts {
            sum.per_m += part.per_m;
            sum.asymmetry += part.per_m * part.asymmetry;
        }
        (sum.per_m > 0.0).then(|| Self {
            asymmetry: sum.asymmetry / sum.per_m,
            ..sum
        })
    }

    /// The cosine of the deflection below which it is with probability `u`, in [0, 1], by the
    /// phase function of Henyey and Greenstein (1941).
    #[inline(always)]
    #[must_use]
    pub fn deflection(&self, u: f64) -> f64 {
        let (g, x) = (self.asymmetry, 2.0 * u - 1.0);
        let y = 1.0 + g * x;
        // (1 + g^2 - ((1 - g^2) / y)^2) / 2g, which loses digits at small g, multiplied out
        let polynomial = 2.0 * x + g * (3.0 + x * x + g * (2.0 * x + g * (x * x - 1.0)));
        (polynomial / (2.0 * y * y)).clamp(-1.0, 1.0)
    }
}

/// A light-absorbing substance in snow, such as mineral dust.
#[derive(Debug, Clone, PartialEq)]
pub struct Absorber {
    /// What it is called in messages and files.
    pub name: String,
    /// Its mass per mass of snow, ng/g.
    pub concentration_ng_g: f64,
    /// Share that is in the ice, [0, 1]; the rest is in the pores.
    pub sedimentation: f64,
    /// How much it absorbs.
    pub mass_absorption: MassAbsorption,
    /// Whether the concentration is per mass of wet snow (with its liquid water) instead of
    /// dry snow.
    pub per_wet_mass: bool,
    /// How much the particles in the pores scatter; `None` if they do not.
    pub scattering: Option<ParticleScattering>,
}

impl Absorber {
    /// Mass per volume of snow, g/m3.
    fn mass_g_m3(&self, densities: &Densities) -> f64 {
        // kg/m3 are 1e3 g/m3, ng/g are 1e-9
        densities.of(self.per_wet_mass) * self.concentration_ng_g * 1e-6
    }

    /// Scattering by its particles in the pores. Their mass is conserved, whatever
    /// [`ImpurityMass`] says of absorption.
    pub(crate) fn particles(&self, densities: &Densities) -> Option<Particles> {
        let ParticleScattering { m2_g, asymmetry } = self.scattering?;
        let pores = 1.0 - densities.dry_kg_m3 / densities.ice_kg_m3;
        let g_m3 = (1.0 - self.sedimentation) * self.mass_g_m3(densities) / pores;
        Some(Particles {
            per_m: m2_g * g_m3,
            asymmetry,
        })
    }

    /// Absorption that it adds to ice and pores.
    #[must_use]
    pub fn impurity(&self, mass: ImpurityMass, densities: &Densities) -> Impurity {
        let g_m3 = self.mass_g_m3(densities);
        let (law, total) = match &self.mass_absorption {
            MassAbsorption::Power {
                m2_g,
                reference_nm,
                angstrom_exponent,
            } => {
                let factor = libm::pow(reference_nm / IMPURITY_NM, *angstrom_exponent);
                (
                    AbsorptionLaw::Power(*angstrom_exponent),
                    m2_g * factor * g_m3,
                )
            }
            MassAbsorption::Table(table) => (AbsorptionLaw::Table(table.clone()), g_m3),
        };
        Impurity::new(law, (total, self.sedimentation), mass, densities)
    }

    /// First and last wavelength at which its absorption is known, nm.
    #[must_use]
    pub fn range_nm(&self) -> (f64, f64) {
        match &self.mass_absorption {
            MassAbsorption::Power { .. } => (0.0, f64::INFINITY),
            MassAbsorption::Table(table) => table.range(),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::optics::{Carbon, CarbonLaw};

    const SNOW: Densities = Densities {
        dry_kg_m3: 275.0,
        wet_kg_m3: 310.0,
        ice_kg_m3: 916.0,
    };

    fn dust(mass_absorption: MassAbsorption) -> Absorber {
        Absorber {
            name: "dust".into(),
            concentration_ng_g: 500.0,
            sedimentation: 0.25,
            mass_absorption,
            per_wet_mass: false,
            scattering: None,
        }
    }

    /// 500 ng/g in 275 kg/m3 are 0.1375 g/m3, a quarter of it in the ice.
    #[test]
    fn coefficients_by_hand() {
        let table = Table::from_column(&[400.0, 600.0], &[2.0, 1.0]).unwrap();
        let found = dust(MassAbsorption::Table(Arc::new(table)));
        assert_eq!(found.range_nm(), (400.0, 600.0));
        let found = found.impurity(ImpurityMass::Varsa2025, &SNOW);
        let at_500 = found.law.factor(500.0).unwrap();
        assert!((found.ice_per_m * at_500 / (1.5 * 0.25 * 0.1375) - 1.0).abs() < 1e-12);
        assert!((found.pores_per_m * at_500 / (1.5 * 0.75 * 0.1375) - 1.0).abs() < 1e-12);
        assert_eq!(found.law.factor(399.0), None);
    }

    #[test]
    fn black_carbon_is_an_absorber_with_a_power_law() {
        let carbon = Carbon {
            sedimentation: 0.25,
            ..Carbon::black(500.0)
        };
        let law = MassAbsorption::Power {
            m2_g: carbon.mass_absorption_efficiency_m2_g,
            reference_nm: carbon.reference_wavelength_nm,
            angstrom_exponent: carbon.angstrom_exponent,
        };
        for mass in [ImpurityMass::Varsa2025, ImpurityMass::Conserved] {
            let expected = carbon.impurity(CarbonLaw::Power, mass, &SNOW);
            assert_eq!(dust(law.clone()).impurity(mass, &SNOW), expected);
        }
    }
}
