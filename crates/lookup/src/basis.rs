//! The variable that the components reconstruct: the spectrum or its logarithm
//! (docs/methods.md).
use splitsnow_spectra::Quantity;

/// Smallest transmittance whose logarithm is taken, far below any visible value.
const LEAST_TRANSMITTANCE: f64 = 1e-30;
/// Smallest 1 - reflectance whose logarithm is taken.
const LEAST_FROM_ONE: f64 = 1e-9;

/// What a row of coefficients times basis^T represents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Basis {
    /// The spectrum itself.
    #[default]
    Linear,
    /// y, where transmittance is exp(-y) and reflectance 1 - exp(-y). A sum below 0
    /// counts as y = 0, so spectra stay within 0 to 1.
    Log,
}

impl Basis {
    /// All variants.
    pub const ALL: [Self; 2] = [Self::Linear, Self::Log];

    /// The name used on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Log => "log",
        }
    }

    /// The number projected onto the basis for the `value` of a spectrum: the value itself
    /// for [`Basis::Linear`], y for [`Basis::Log`], limited to 0 to 69 (transmittance) or
    /// 0 to 21 (reflectance).
    #[must_use]
    pub fn projected(self, quantity: Quantity, value: f64) -> f64 {
        match (self, quantity) {
            (Self::Linear, _) => value,
            (Self::Log, Quantity::Transmittance) => {
                (-libm::log(value.max(LEAST_TRANSMITTANCE))).max(0.0)
            }
            (Self::Log, Quantity::Reflectance) => {
                (-libm::log((1.0 - value).max(LEAST_FROM_ONE))).max(0.0)
            }
        }
    }

    /// The value of a spectrum from the `sum` of its components.
    #[must_use]
    pub fn value(self, quantity: Quantity, sum: f64) -> f64 {
        match (self, quantity) {
            (Self::Linear, _) => sum,
            (Self::Log, Quantity::Transmittance) => libm::exp(-sum.max(0.0)),
            (Self::Log, Quantity::Reflectance) => -libm::expm1(-sum.max(0.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_round_trip() {
        for basis in Basis::ALL {
            for quantity in Quantity::ALL {
                for value in [0.0, 1e-20, 1e-5, 0.3, 0.999_999, 1.0] {
                    let y = basis.projected(quantity, value);
                    let back = basis.value(quantity, y);
                    assert!((back - value).abs() < 1e-8, "{basis:?} {value} {back}");
                }
            }
        }
        let small = Basis::Log.projected(Quantity::Transmittance, 1e-20);
        let back = Basis::Log.value(Quantity::Transmittance, small);
        assert!((back / 1e-20 - 1.0).abs() < 1e-13, "{back}");
    }

    #[test]
    fn values_without_a_logarithm_are_limited() {
        let y = |quantity, value| Basis::Log.projected(quantity, value);
        for quantity in Quantity::ALL {
            for value in [-1.0, 0.0, 1.0, 2.0] {
                assert!((0.0..70.0).contains(&y(quantity, value)));
            }
            for sum in [-1e300, 1e300] {
                let value = Basis::Log.value(quantity, sum);
                assert!((0.0..=1.0).contains(&value), "{value}");
            }
        }
    }
}
