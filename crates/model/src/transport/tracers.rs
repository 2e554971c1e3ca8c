//! The sums along a ray's path from which the absorption by all impurities follows.
//!
//! Absorption by the impurities at a wavelength is a sum over *places*, the ice and the pores of
//! each layer, of the path in the place times a coefficient that depends on place and
//! wavelength. A walk need not keep the path in every place. It keeps at most [`TRACERS`] sums,
//! each with a factor that depends on the wavelength alone:
//!
//! - one per law of absorption, such as an Angstrom exponent, for any number of layers; or
//! - if there are more laws: one per place with its own mixture of impurities, for any number
//!   of substances; or
//! - if there are more places too: one per wavelength, for at most [`TRACERS`] wavelengths. An
//!   engine divides a longer list.
use super::{Model, Snow, Snowpack};
use crate::optics::{AbsorptionLaw, Impurity};

/// Largest number of sums that a walk keeps.
pub const TRACERS: usize = 4;

/// A mixture of impurities: their laws, each with its coefficient.
type Mixture = Vec<(AbsorptionLaw, f64)>;

/// The sums that walks in a snowpack keep.
#[derive(Debug, Clone, PartialEq)]
pub enum Tracers {
    /// The depth of the impurities of each law, power laws first, by increasing exponent.
    Laws(Vec<AbsorptionLaw>),
    /// The path, m, in the places with each mixture.
    Places(Vec<Mixture>),
    /// The depth of all impurities at each wavelength, nm.
    Wavelengths(Vec<f64>),
}

/// The mixtures in the ice and in the pores of `snow`.
fn mixtures(snow: &Snow, model: &Model) -> [Mixture; 2] {
    let mixture = |per_m: fn(&Impurity) -> f64| {
        let parts = snow.impurities(model);
        let parts = parts.map(|impurity| (impurity.law.clone(), per_m(&impurity)));
        parts.filter(|(_, per_m)| *per_m > 0.0).collect()
    };
    [
        mixture(|impurity| impurity.ice_per_m),
        mixture(|impurity| impurity.pores_per_m),
    ]
}

/// The factor of a law; NaN outside its table.
fn factor(law: &AbsorptionLaw, wavelength_nm: f64) -> f64 {
    law.factor(wavelength_nm).unwrap_or(f64::NAN)
}

/// Appends `value` unless it is already there.
fn add<T: PartialEq>(all: &mut Vec<T>, value: T) {
    if !all.contains(&value) {
        all.push(value);
    }
}

impl Tracers {
    /// The sums for `snowpack` at `wavelengths_nm`. They are more than [`TRACERS`] if laws,
    /// places and wavelengths are.
    #[must_use]
    pub fn of(snowpack: &Snowpack, model: &Model, wavelengths_nm: &[f64]) -> Self {
        let mut laws = Vec::new();
        for impurity in snowpack.snows().flat_map(|snow| snow.impurities(model)) {
            add(&mut laws, impurity.law);
        }
        laws.sort_by(|a, b| {
            let exponent = |law: &AbsorptionLaw| match law {
                AbsorptionLaw::Power(exponent) => *exponent,
                AbsorptionLaw::Table(_) => f64::INFINITY,
            };
            exponent(a).total_cmp(&exponent(b))
        });
        if laws.len() > TRACERS {
            let mut places = Vec::new();
            for mixture in snowpack.snows().flat_map(|snow| mixtures(snow, model)) {
                if !mixture.is_empty() {
                    add(&mut places, mixture);
                }
            }
            if places.len() <= TRACERS {
                return Self::Places(places);
            }
            if wavelengths_nm.len() <= TRACERS {
                return Self::Wavelengths(wavelengths_nm.to_vec());
            }
        }
        Self::Laws(laws)
    }

    /// Number of sums.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Laws(laws) => laws.len(),
            Self::Places(places) => places.len(),
            Self::Wavelengths(wavelengths_nm) => wavelengths_nm.len(),
        }
    }

    /// Whether nothing but ice and water absorbs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The factor of each sum at a wavelength. NaN outside the table of a law, which
    /// [`crate::engine::Engine::check`] refuses.
    #[must_use]
    pub fn factors(&self, wavelength_nm: f64) -> [f64; TRACERS] {
        let factor = |law: &AbsorptionLaw| factor(law, wavelength_nm);
        let mut factors = [0.0; TRACERS];
        match self {
            Self::Laws(laws) => {
                let factors = factors.iter_mut().zip(laws);
                factors.for_each(|(sum, law)| *sum = factor(law));
            }
            Self::Places(places) => {
                for (sum, mixture) in factors.iter_mut().zip(places) {
                    let parts = mixture.iter();
                    *sum = parts.map(|(law, per_m)| per_m * factor(law)).sum();
                }
            }
            Self::Wavelengths(wavelengths_nm) => {
                let factors = factors.iter_mut().zip(wavelengths_nm);
                factors.for_each(|(sum, nm)| *sum = f64::from(u8::from(*nm == wavelength_nm)));
            }
        }
        factors
    }

    /// What a metre in the ice and a metre in the pores of `snow` add to each sum.
    #[must_use]
    pub fn per_m(&self, snow: &Snow, model: &Model) -> [[f64; TRACERS]; 2] {
        let mut sums = [[0.0; TRACERS]; 2];
        match self {
            Self::Laws(laws) => {
                for impurity in snow.impurities(model) {
                    let position = laws.iter().take(TRACERS).position(|l| *l == impurity.law);
                    if let Some(i) = position {
                        sums[0][i] += impurity.ice_per_m;
                        sums[1][i] += impurity.pores_per_m;
                    }
                }
            }
            Self::Places(places) => {
                for (sums, mixture) in sums.iter_mut().zip(mixtures(snow, model)) {
                    let position = places.iter().take(TRACERS).position(|p| *p == mixture);
                    if let Some(i) = position {
                        sums[i] = 1.0;
                    }
                }
            }
            Self::Wavelengths(wavelengths_nm) => {
                for impurity in snow.impurities(model) {
                    for (i, nm) in wavelengths_nm.iter().take(TRACERS).enumerate() {
                        let factor = factor(&impurity.law, *nm);
                        sums[0][i] += impurity.ice_per_m * factor;
                        sums[1][i] += impurity.pores_per_m * factor;
                    }
                }
            }
        }
        sums
    }
}
