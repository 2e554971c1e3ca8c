//! The views of a grid: directions toward which the light of every curve is computed too.
use crate::measurement::{Measured, ViewError, ViewFactors, Views};
use crate::parameter::{Axes, Parameter};
use crate::transport::Illumination;

/// Views toward which the light of every curve is computed too.
#[derive(Debug, Clone, PartialEq)]
pub struct GridViews {
    /// The axes of the view ([`Parameter::VIEWS`]).
    pub axes: Axes,
    /// Number of walks per curve.
    pub rays: u64,
}

impl GridViews {
    /// Default number of walks per curve.
    pub const RAYS: u64 = 16_384;

    /// Number of views under collimated light.
    #[must_use]
    pub fn count(&self) -> usize {
        self.axes.count() as usize
    }

    /// The views, in storage order.
    ///
    /// # Errors
    /// [`ViewError`] if there is none or an angle is out of range.
    pub fn views(&self) -> Result<Views, ViewError> {
        let points = (0..self.axes.count()).map(|view| self.axes.point(view));
        let angles: Vec<_> = points
            .map(|point| Parameter::VIEWS.map(|axis| point[axis]))
            .collect();
        Views::new(&angles)
    }

    /// Number of views under `light`: diffuse light has no azimuth.
    #[must_use]
    pub fn count_under(&self, light: &Illumination) -> usize {
        match light {
            Illumination::Collimated { .. } => self.count(),
            Illumination::Diffuse => self.axes.values(Parameter::View).len(),
        }
    }

    /// The `factors` of all views as they are stored: those under diffuse light, which differ
    /// between azimuths by noise alone, are averaged over the azimuths. Their errors are not
    /// independent, so that the mean of the errors is that of the mean.
    #[must_use]
    pub fn stored_under(
        &self,
        light: &Illumination,
        factors: ViewFactors,
        wavelengths: usize,
    ) -> ViewFactors {
        if matches!(light, Illumination::Collimated { .. }) {
            return factors;
        }
        let azimuths = self.axes.values(Parameter::RelativeAzimuth).len();
        let mean = |values: Vec<Measured>| -> Vec<Measured> {
            let views = values.chunks(azimuths * wavelengths);
            let of_view = |view: &'_ [Measured]| -> Vec<Measured> {
                let of_wavelength = |l: usize| {
                    let rows = view.iter().skip(l).step_by(wavelengths);
                    let sum = rows.fold([0.0; 2], |[value, se], row| {
                        [value + row.value, se + row.se]
                    });
                    let [value, se] = sum.map(|sum| sum / azimuths as f64);
                    Measured { value, se }
                };
                (0..wavelengths).map(of_wavelength).collect()
            };
            views.flat_map(of_view).collect()
        };
        ViewFactors {
            reflected: mean(factors.reflected),
            transmitted: mean(factors.transmitted),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, with 2 view angles, 2 azimuths and 2 wavelengths.
    #[test]
    fn factors_under_diffuse_light_are_means_over_azimuths() {
        let views = GridViews {
            axes: Parameter::VIEWS.map(|axis| (axis, vec![0.0, 60.0])).into(),
            rays: 1,
        };
        let measured = |value: f64| Measured {
            value,
            se: 0.5 * value,
        };
        let factors = ViewFactors {
            reflected: [1.0, 2.0, 3.0, 6.0, 10.0, 20.0, 30.0, 60.0]
                .map(measured)
                .into(),
            transmitted: vec![measured(7.0); 8],
        };
        let beam = Illumination::Collimated {
            polar_angle_rad: 0.0,
        };
        let stored = |light: &Illumination| views.stored_under(light, factors.clone(), 2);
        assert_eq!(stored(&beam), factors);
        let diffuse = stored(&Illumination::Diffuse);
        assert_eq!(diffuse.reflected, [2.0, 4.0, 20.0, 40.0].map(measured));
        assert_eq!(diffuse.transmitted, vec![measured(7.0); 4]);
        let counts = [beam, Illumination::Diffuse].map(|light| views.count_under(&light));
        assert_eq!(counts, [4, 2]);
    }
}
