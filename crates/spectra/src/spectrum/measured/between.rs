//! Interpolation of a measured spectrum to given wavelengths.
use thiserror::Error;

use super::{Curve, MeasuredValue};

/// Longest distance over which masked rows are bridged by linear interpolation, nm.
/// Absorption bands of ice, plants and minerals are about 100 nm wide.
pub const MAX_BRIDGE_NM: f64 = 30.0;

/// A wavelength at which a spectrum has no value.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum CoverageGap {
    /// Before the first row or after the last.
    #[error(
        "covers {} to {} nm, but the wavelengths run from {} to {} nm", .covered.0, .covered.1, .needed.0, .needed.1
    )]
    Short {
        /// First and last wavelength with a value, nm.
        covered: (f64, f64),
        /// First and last requested wavelength, nm.
        needed: (f64, f64),
    },
    /// Between rows that are too far apart because others were masked.
    #[error("has no usable value between {from} and {to} nm, but one is needed at {nm} nm")]
    Hole {
        /// Last wavelength with a value before the hole, nm.
        from: f64,
        /// First wavelength with a value after the hole, nm.
        to: f64,
        /// The requested wavelength, nm.
        nm: f64,
    },
}

impl Curve {
    /// The values at `wavelengths_nm` (increasing), by linear interpolation between rows.
    /// Rows may be any distance apart, but at most [`MAX_BRIDGE_NM`] if rows between them
    /// were masked.
    ///
    /// # Errors
    /// The first [`CoverageGap`].
    pub fn values_at(&self, wavelengths_nm: &[f64]) -> Result<Vec<f64>, CoverageGap> {
        let (Some(first), Some(last)) = (self.samples.first(), self.samples.last()) else {
            return Ok(Vec::new());
        };
        if let (Some(&low), Some(&high)) = (wavelengths_nm.first(), wavelengths_nm.last())
            && !(first.nm <= low && high <= last.nm)
        {
            return Err(CoverageGap::Short {
                covered: (first.nm, last.nm),
                needed: (low, high),
            });
        }
        wavelengths_nm.iter().map(|&nm| self.value_at(nm)).collect()
    }

    /// The value at `nm`, which must be between the first and last row.
    fn value_at(&self, nm: f64) -> Result<f64, CoverageGap> {
        let above = self.samples.partition_point(|row| row.nm < nm);
        let b = &self.samples[above.min(self.samples.len() - 1)];
        if b.nm == nm || above == 0 {
            return Ok(b.value);
        }
        let a: &MeasuredValue = &self.samples[above - 1];
        let mut masked = self
            .report
            .masked
            .iter()
            .filter_map(|row| row.wavelength_nm);
        if b.nm - a.nm > MAX_BRIDGE_NM && masked.any(|nm| a.nm < nm && nm < b.nm) {
            let (from, to) = (a.nm, b.nm);
            return Err(CoverageGap::Hole { from, to, nm });
        }
        let t = (nm - a.nm) / (b.nm - a.nm);
        Ok(a.value + t * (b.value - a.value))
    }
}
