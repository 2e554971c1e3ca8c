//! Resampling of spectra to other wavelengths.

/// Linear interpolation between the wavelengths of a spectrum, as in renderers; constant
/// beyond its ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampling {
    /// Number of input wavelengths.
    from: usize,
    /// For each output wavelength: the index of the input wavelength below it, and the weight
    /// of the next.
    places: Vec<(usize, f64)>,
}

impl Resampling {
    /// Resampling from `from_nm`, strictly increasing, to `to_nm`, both in nm. The value at
    /// a wavelength in both lists is kept bit for bit.
    ///
    /// # Panics
    /// If `from_nm` is empty.
    #[must_use]
    pub fn new(from_nm: &[f64], to_nm: &[f64]) -> Self {
        assert!(
            !from_nm.is_empty(),
            "a spectrum has at least one wavelength"
        );
        let place = |nm: &f64| {
            let above = from_nm.partition_point(|from| from <= nm);
            match (above.checked_sub(1), from_nm.get(above)) {
                (None, _) => (0, 0.0),
                (Some(below), None) => (below, 0.0),
                (Some(below), Some(&next)) => {
                    let here = from_nm[below];
                    (below, (nm - here) / (next - here))
                }
            }
        };
        Self {
            from: from_nm.len(),
            places: to_nm.iter().map(place).collect(),
        }
    }

    /// `spectrum` at the output wavelengths.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per input wavelength.
    #[must_use]
    pub fn apply(&self, spectrum: &[f64]) -> Vec<f64> {
        assert_eq!(spectrum.len(), self.from, "one value per wavelength");
        let value = |&(below, share): &(usize, f64)| match share {
            0.0 => spectrum[below],
            _ => spectrum[below] + share * (spectrum[below + 1] - spectrum[below]),
        };
        self.places.iter().map(value).collect()
    }

    /// Writes `spectrum` at the output wavelengths to `resampled`, in single precision.
    ///
    /// # Panics
    /// If `spectrum` does not have one value per input wavelength, or `resampled` one per
    /// output wavelength.
    pub fn write(&self, spectrum: &[f32], resampled: &mut [f32]) {
        assert_eq!(spectrum.len(), self.from, "one value per wavelength");
        assert_eq!(
            resampled.len(),
            self.places.len(),
            "one value per wavelength"
        );
        for (value, &(below, share)) in resampled.iter_mut().zip(&self.places) {
            *value = spectrum[below];
            if share > 0.0 {
                *value += share as f32 * (spectrum[below + 1] - spectrum[below]);
            }
        }
    }

    /// Weights at the input wavelengths that give the same weighted sum as `weights` at the
    /// output wavelengths: the transpose of the resampling.
    ///
    /// # Panics
    /// If there is not one weight per output wavelength.
    #[must_use]
    pub fn folded(&self, weights: &[f64]) -> Vec<f64> {
        assert_eq!(
            weights.len(),
            self.places.len(),
            "one weight per wavelength"
        );
        let mut folded = vec![0.0; self.from];
        for (&(below, share), weight) in self.places.iter().zip(weights) {
            folded[below] += (1.0 - share) * weight;
            if share > 0.0 {
                folded[below + 1] += share * weight;
            }
        }
        folded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_between_and_constant_beyond() {
        let by = Resampling::new(
            &[400.0, 500.0, 700.0],
            &[390.0, 400.0, 425.0, 500.0, 650.0, 700.0, 800.0],
        );
        let found = by.apply(&[1.0, 3.0, -1.0]);
        assert_eq!(found, [1.0, 1.0, 1.5, 3.0, 0.0, -1.0, -1.0]);
        let mut single = [f32::NAN; 7];
        by.write(&[1.0, 3.0, -1.0], &mut single);
        assert_eq!(single.map(f64::from)[..], found);
        assert_eq!(
            Resampling::new(&[550.0], &[400.0, 550.0]).apply(&[0.3]),
            [0.3, 0.3]
        );
    }

    #[test]
    fn equal_lists_keep_every_bit() {
        let nm = [400.1, 533.3, 700.7];
        let by = Resampling::new(&nm, &nm);
        let spectrum = [0.1, f64::NAN, 1e-30];
        assert_eq!(
            by.apply(&spectrum)[..]
                .iter()
                .map(|v| v.to_bits())
                .collect::<Vec<_>>(),
            spectrum.map(f64::to_bits)
        );
    }

    #[test]
    fn folded_weights_by_hand() {
        let by = Resampling::new(&[400.0, 500.0, 700.0], &[400.0, 425.0, 500.0, 650.0, 800.0]);
        let weights = [1.0, 4.0, 2.0, 8.0, 0.5];
        assert_eq!(by.folded(&weights), [1.0 + 3.0, 1.0 + 2.0 + 2.0, 6.0 + 0.5]);
    }
}
