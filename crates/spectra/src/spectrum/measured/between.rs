//! A spectrum at other wavelengths than those of its rows.
use thiserror::Error;

use super::{Curve, Sample};

/// Longest stretch over which a straight line stands for rows that were left out, nm.
/// Absorption bands of ice, plants and minerals are some 100 nm wide.
pub const MAX_BRIDGE_NM: f64 = 30.0;

/// A wavelength at which a spectrum says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Gap {
    /// Before its first row or after its last.
    #[error(
        "covers {} to {} nm, but the wavelengths run from {} to {} nm", .covered.0, .covered.1, .needed.0, .needed.1
    )]
    Short {
        /// First and last wavelength with a value, nm.
        covered: (f64, f64),
        /// First and last wavelength that is asked for, nm.
        needed: (f64, f64),
    },
    /// Where rows were left out.
    #[error(
        "has no value that can be used between {from} and {to} nm, where one is needed at {nm} nm"
    )]
    Hole {
        /// Last wavelength with a value before it, nm.
        from: f64,
        /// First one after it, nm.
        to: f64,
        /// The wavelength, nm.
        nm: f64,
    },
}

impl Curve {
    /// The values at `wavelengths_nm` (increasing): on straight lines between rows,
    /// which may be any distance apart, but where rows between them were left out at
    /// most [`MAX_BRIDGE_NM`].
    ///
    /// # Errors
    /// The first [`Gap`].
    pub fn at(&self, wavelengths_nm: &[f64]) -> Result<Vec<f64>, Gap> {
        let (Some(first), Some(last)) = (self.samples.first(), self.samples.last()) else {
            return Ok(Vec::new());
        };
        if let (Some(&low), Some(&high)) = (wavelengths_nm.first(), wavelengths_nm.last())
            && !(first.nm <= low && high <= last.nm)
        {
            return Err(Gap::Short {
                covered: (first.nm, last.nm),
                needed: (low, high),
            });
        }
        wavelengths_nm.iter().map(|&nm| self.one(nm)).collect()
    }

    /// The value at `nm`, within the rows.
    fn one(&self, nm: f64) -> Result<f64, Gap> {
        let above = self.samples.partition_point(|row| row.nm < nm);
        let b = &self.samples[above.min(self.samples.len() - 1)];
        if b.nm == nm || above == 0 {
            return Ok(b.value);
        }
        let a: &Sample = &self.samples[above - 1];
        let mut left_out = self
            .report
            .masked
            .iter()
            .filter_map(|row| row.wavelength_nm);
        if b.nm - a.nm > MAX_BRIDGE_NM && left_out.any(|out| a.nm < out && out < b.nm) {
            let (from, to) = (a.nm, b.nm);
            return Err(Gap::Hole { from, to, nm });
        }
        let t = (nm - a.nm) / (b.nm - a.nm);
        Ok(a.value + t * (b.value - a.value))
    }
}
