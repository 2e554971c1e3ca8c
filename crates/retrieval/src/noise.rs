//! The errors of a measured spectrum (Gaussian, of reflectance or transmittance, 0 to 1), and
//! residuals in units of them. Wavelengths are in nm.
use nalgebra::{Cholesky, DMatrix};

/// The errors of the values of one spectrum that are not stated with them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseModel {
    /// Standard deviation of each value, independent of the others.
    pub value: f64,
    /// Relative standard deviation of the level, the same factor at all wavelengths.
    pub level: f64,
    /// Standard deviation of an error that is correlated between wavelengths.
    pub correlated: f64,
    /// Distance, nm, over which that correlation falls to 1/e.
    pub length_nm: f64,
}

impl Default for NoiseModel {
    /// A field spectrometer: .005 for each value, 2 % for the level, and .01 over 100 nm.
    fn default() -> Self {
        Self {
            value: 0.005,
            level: 0.02,
            correlated: 0.01,
            length_nm: 100.0,
        }
    }
}

/// Converts residuals to independent ones of variance 1: the inverse of the Cholesky factor of
/// the covariance without the level, and the level.
#[derive(Debug, Clone)]
pub struct Whitening {
    inverse: DMatrix<f64>,
    level: f64,
}

impl Whitening {
    /// For values at `wavelengths_nm` (at least one) with the standard deviations `values` of
    /// each of them, and `emulator` of an error of the model, which is correlated as that of
    /// `noise`. `None` if the covariance is not positive definite: give each value an error.
    #[must_use]
    pub fn new(
        wavelengths_nm: &[f64],
        values: &[f64],
        emulator: &[f64],
        noise: &NoiseModel,
    ) -> Option<Self> {
        let n = wavelengths_nm.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let distance = (wavelengths_nm[i] - wavelengths_nm[j]).abs();
            let shared = noise.correlated * noise.correlated + emulator[i] * emulator[j];
            let own = if i == j { values[i] * values[i] } else { 0.0 };
            own + shared * libm::exp(-distance / noise.length_nm)
        });
        let factor = Cholesky::new(covariance)?.unpack();
        let inverse = factor.solve_lower_triangular(&DMatrix::identity(n, n))?;
        let finite = inverse.iter().all(|value| value.is_finite());
        finite.then_some(Self {
            inverse,
            level: noise.level,
        })
    }

    /// Number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        self.inverse.nrows()
    }

    /// Whether there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes the whitened `values`, without the level, to `out`, `[n]`.
    pub(crate) fn apply(&self, values: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let columns = self.inverse.as_slice().chunks_exact(self.len());
        for ((j, column), value) in columns.enumerate().zip(values) {
            let pairs = out[j..].iter_mut().zip(&column[j..]);
            pairs.for_each(|(sum, factor)| *sum += factor * value);
        }
    }

    /// The part of the whitened direction `measured` that the level takes from residuals: they
    /// are whitened by r - part (measured . r) measured.
    pub(crate) fn level_part(&self, measured: &[f64]) -> f64 {
        let square: f64 = measured.iter().map(|value| value * value).sum();
        let scaled = self.level * self.level * square;
        if scaled == 0.0 {
            return 0.0;
        }
        (1.0 - 1.0 / (1.0 + scaled).sqrt()) / square
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Whitened residuals have the same sum of squares as with the inverse covariance.
    #[test]
    fn squares_are_those_of_the_covariance() {
        let nm = [400.0, 450.0, 700.0, 1000.0];
        let (sigma, extra) = ([0.01, 0.02, 0.01, 0.03], [0.0, 0.004, 0.003, 0.01]);
        let (measured, r) = ([0.9, 0.8, 0.7, 0.4], [0.01, -0.02, 0.03, 0.005]);
        let noise = NoiseModel::default();
        let covariance = DMatrix::from_fn(4, 4, |i, j| {
            let near = f64::exp(-f64::abs(nm[i] - nm[j]) / 100.0);
            let own = if i == j { sigma[i] * sigma[i] } else { 0.0 };
            own + near * (1e-4 + extra[i] * extra[j]) + 4e-4 * measured[i] * measured[j]
        });
        let r_column = nalgebra::DVector::from_row_slice(&r);
        let expected = r_column.dot(&covariance.try_inverse().unwrap().mul_column(&r_column));
        let whitening = Whitening::new(&nm, &sigma, &extra, &noise).unwrap();
        let (mut y, mut white) = ([0.0; 4], [0.0; 4]);
        whitening.apply(&measured, &mut y);
        whitening.apply(&r, &mut white);
        let part = whitening.level_part(&y);
        let along: f64 = y.iter().zip(&white).map(|(a, b)| a * b).sum();
        let found: f64 = white
            .iter()
            .zip(&y)
            .map(|(r, y)| (r - part * along * y).powi(2))
            .sum();
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        assert!(
            Whitening::new(
                &nm,
                &[0.0; 4],
                &[0.0; 4],
                &NoiseModel {
                    correlated: 0.0,
                    ..noise
                }
            )
            .is_none()
        );
    }

    trait MulColumn {
        fn mul_column(&self, column: &nalgebra::DVector<f64>) -> nalgebra::DVector<f64>;
    }

    impl MulColumn for DMatrix<f64> {
        fn mul_column(&self, column: &nalgebra::DVector<f64>) -> nalgebra::DVector<f64> {
            self * column
        }
    }
}
