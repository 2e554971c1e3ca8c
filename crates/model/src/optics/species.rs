//! Absorbers with published mass absorption efficiencies, m2/g: Caponi et al. 2017 (dust), Dadic et
//! al. 2013 (ash, to 2131.8 nm) and Varsa 2025 (carbon). Power laws of dust were measured at
//! 375-850 nm (docs/absorbers.md).
use std::sync::{Arc, LazyLock};

use splitsnow_spectra::spectrum::Table;

use super::{Carbon, MassAbsorption};

/// An absorber whose mass absorption efficiency is known by name.
#[derive(Debug, Clone, Copy)]
pub struct Species {
    /// Its name in config files.
    pub name: &'static str,
    /// Where the numbers come from.
    pub source: &'static str,
    kind: Kind,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Carbon(fn(f64) -> Carbon),
    /// Efficiency in m2/g at 400 nm, and Angstrom exponent.
    Dust(f64, f64),
    Table(&'static LazyLock<Arc<Table>>),
}

const VARSA: &str = "Varsa 2025, section 4.3";
const CAPONI: &str = "Caponi et al. 2017, doi:10.5194/acp-17-7175-2017, particles up to 10.6 um";
const DADIC: &str = "Dadic et al. 2013, doi:10.1002/jgrf.20098, figure 12";

const fn dust(name: &'static str, m2_g: f64, angstrom_exponent: f64) -> Species {
    Species {
        name,
        source: CAPONI,
        kind: Kind::Dust(m2_g, angstrom_exponent),
    }
}

static ASH: LazyLock<Arc<Table>> = LazyLock::new(|| {
    let text = include_str!("../../data/mac_volcanic_ash_dadic_2013.csv");
    #[allow(clippy::expect_used)] // compiled in; a test parses it
    let table = Table::parse("ash", text, &["wavelength_nm", "mac_m2_g"]).expect("shipped table");
    Arc::new(table)
});

/// All species.
pub static SPECIES: [Species; 12] = [
    Species {
        name: "black_carbon",
        source: VARSA,
        kind: Kind::Carbon(Carbon::black),
    },
    Species {
        name: "brown_carbon",
        source: VARSA,
        kind: Kind::Carbon(Carbon::brown),
    },
    dust("dust_libya", 0.077, 3.2),
    dust("dust_algeria", 0.082, 2.5),
    dust("dust_bodele", 0.027, 3.3),
    dust("dust_saudi_arabia", 0.081, 4.1),
    dust("dust_namibia", 0.050, 4.7),
    dust("dust_china", 0.059, 3.0),
    dust("dust_arizona", 0.103, 3.1),
    dust("dust_patagonia", 0.083, 2.9),
    dust("dust_australia", 0.124, 2.9),
    Species {
        name: "volcanic_ash",
        source: DADIC,
        kind: Kind::Table(&ASH),
    },
];

impl Species {
    /// The species with this name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        SPECIES.iter().find(|species| species.name == name)
    }

    /// Its mass absorption efficiency.
    #[must_use]
    pub fn mass_absorption(&self) -> MassAbsorption {
        match self.kind {
            Kind::Carbon(kind) => {
                let carbon = kind(0.0);
                MassAbsorption::Power {
                    m2_g: carbon.mass_absorption_efficiency_m2_g,
                    reference_nm: carbon.reference_wavelength_nm,
                    angstrom_exponent: carbon.angstrom_exponent,
                }
            }
            Kind::Dust(m2_g, angstrom_exponent) => MassAbsorption::Power {
                m2_g,
                reference_nm: 400.0,
                angstrom_exponent,
            },
            Kind::Table(table) => MassAbsorption::Table(LazyLock::force(table).clone()),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// 0.0603 m2/g at 548.0 nm is a row of the table.
    #[test]
    fn the_shipped_table_is_read() {
        let MassAbsorption::Table(ash) = Species::find("volcanic_ash").unwrap().mass_absorption()
        else {
            panic!("a table");
        };
        assert_eq!(ash.range(), (350.0, 2131.8));
        assert_eq!(ash.linear(0, 548.0), Some(0.0603));
        assert!(ash.column(0).windows(2).all(|pair| pair[0] >= pair[1]));
    }
}
