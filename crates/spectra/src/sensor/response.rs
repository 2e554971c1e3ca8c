//! The spectral response of a band: relative, over the wavelength in nm.
use crate::spectrum::Table;

/// Half width of a Gaussian response in standard deviations; beyond, it counts as 0.
const GAUSSIAN_SD: f64 = 3.0;
/// Longest wavelength of a response, nm.
const LONGEST_NM: f64 = 1e6;
/// Points of a Gaussian response, between which it is linear.
const GAUSSIAN_POINTS: usize = 121;

/// The response of a band to light, relative to the largest: linear between its wavelengths and 0
/// outside them.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralResponse {
    name: String,
    table: Table,
}

impl SpectralResponse {
    /// A response at `wavelengths_nm`, nm.
    ///
    /// # Errors
    /// The defect, if the wavelengths are not within 0 to 1e6 nm and strictly increasing, a response
    /// is negative or not finite, all are 0, or the name is empty or has control characters.
    pub fn new(name: &str, wavelengths_nm: &[f64], response: &[f64]) -> Result<Self, String> {
        let refuse = |reason: &str| Err(format!("the band `{name}` {reason}"));
        if let Some(wrong) = response.iter().find(|r| !(r.is_finite() && **r >= 0.0)) {
            return refuse(&format!("has a response of {wrong}; allowed is 0 or more"));
        }
        if name.is_empty() || name.contains(char::is_control) {
            return refuse("needs a name without control characters");
        }
        // one 0 at either end is kept, to which the response falls linearly
        let is_used = |r: &f64| *r > 0.0;
        let (Some(first), Some(last)) = (
            response.iter().position(is_used),
            response.iter().rposition(is_used),
        ) else {
            return refuse("has no response above 0");
        };
        let used = first.saturating_sub(1)..(last + 2).min(response.len());
        let nm = wavelengths_nm.get(used.clone()).unwrap_or_default();
        let largest = response.iter().copied().fold(0.0, f64::max);
        let response: Vec<f64> = response[used].iter().map(|r| r / largest).collect();
        let inside = nm
            .iter()
            .all(|nm| (f64::MIN_POSITIVE..=LONGEST_NM).contains(nm));
        match Table::from_column(nm, &response) {
            Some(table) if inside => Ok(Self {
                name: name.to_owned(),
                table,
            }),
            _ => {
                refuse("needs at least two wavelengths, above 0 nm, at most 1e6 nm and increasing")
            }
        }
    }

    /// A Gaussian with its largest value at `centre_nm` and half of it `fwhm_nm` apart, cut at
    /// three standard deviations.
    ///
    /// # Errors
    /// The defect, if the width is not above 0 or it reaches below 0 nm.
    pub fn gaussian(name: &str, centre_nm: f64, fwhm_nm: f64) -> Result<Self, String> {
        let sd_nm = fwhm_nm / (8.0 * std::f64::consts::LN_2).sqrt();
        let at = |i: usize| GAUSSIAN_SD * (2.0 * i as f64 / (GAUSSIAN_POINTS - 1) as f64 - 1.0);
        let points = (0..GAUSSIAN_POINTS).map(at);
        let nm: Vec<f64> = points.clone().map(|x| centre_nm + sd_nm * x).collect();
        let response: Vec<f64> = points.map(|x| libm::exp(-0.5 * x * x)).collect();
        Self::new(name, &nm, &response)
    }

    /// The response 1 from `from_nm` to `to_nm`.
    ///
    /// # Errors
    /// The defect, if the limits are not positive and increasing.
    pub fn rectangle(name: &str, from_nm: f64, to_nm: f64) -> Result<Self, String> {
        Self::new(name, &[from_nm, to_nm], &[1.0, 1.0])
    }

    /// Name of the band.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// First and last wavelength, nm, with a response.
    #[must_use]
    pub fn range_nm(&self) -> (f64, f64) {
        self.table.range()
    }

    /// Mean wavelength, nm, weighted with the response.
    #[must_use]
    pub fn centre_nm(&self) -> f64 {
        let (mut sum, mut moment) = (0.0, 0.0);
        let (nm, response) = (self.table.abscissae(), self.table.column(0));
        for (nm, r) in nm.windows(2).zip(response.windows(2)) {
            let (a, b, step) = (nm[0], nm[1], nm[1] - nm[0]);
            sum += step * (r[0] + r[1]) / 2.0;
            moment += step * (r[0] * (2.0 * a + b) + r[1] * (a + 2.0 * b)) / 6.0;
        }
        moment / sum
    }

    pub(super) fn table(&self) -> &Table {
        &self.table
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn forms_by_hand() {
        let g = SpectralResponse::gaussian("g", 1000.0, 10.0).unwrap();
        assert!((g.centre_nm() - 1000.0).abs() < 1e-9);
        let half = g.table().linear(0, 1005.0).unwrap();
        assert!((half - 0.5).abs() < 1e-3, "{half}");
        // a triangle from 0 to 1: two thirds of the way
        let t = SpectralResponse::new(
            "t",
            &[10.0, 20.0, 50.0, 60.0, 70.0],
            &[0.0, 0.0, 3.0, 0.0, 0.0],
        );
        let t = t.unwrap();
        assert_eq!(t.range_nm(), (20.0, 60.0));
        assert!((t.centre_nm() - 130.0 / 3.0).abs() < 1e-9);
        let r = SpectralResponse::rectangle("r", 700.0, 900.0).unwrap();
        assert!((r.centre_nm() - 800.0).abs() < 1e-9);
    }

    #[test]
    fn impossible_responses_are_refused() {
        for (nm, response, part) in [
            (vec![400.0, 500.0], vec![0.0, 0.0], "no response above 0"),
            (vec![400.0, 500.0], vec![1.0, -0.1], "a response of -0.1"),
            (vec![500.0, 400.0], vec![1.0, 1.0], "increasing"),
            (vec![-5.0, 400.0], vec![1.0, 1.0], "above 0 nm"),
            (vec![400.0], vec![1.0], "at least two"),
            (vec![400.0, 2e6], vec![1.0, 1.0], "at most 1e6 nm"),
            (vec![400.0, f64::NAN], vec![1.0, 1.0], "at least two"),
        ] {
            let error = SpectralResponse::new("b", &nm, &response).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        assert!(SpectralResponse::gaussian("b", 500.0, 0.0).is_err());
        assert!(SpectralResponse::gaussian("b", 500.0, f64::NAN).is_err());
        assert!(SpectralResponse::rectangle("b", 500.0, 400.0).is_err());
    }
}
