//! Spectra of a compact file at any point of its box, also between the nodes of optional axes.
use splitsnow_lookup::{Database, Lookup, LookupError, Parameter, Point};
use splitsnow_spectra::Quantity;

/// Largest y = -ln T that is distinguished: T is 0 in single precision beyond.
const DARKEST: f64 = 80.0;

/// One quantity of a compact file. The optional axes that `fixed` leaves open are interpolated
/// linearly in y = -ln T or -ln(1 - R) and in the coordinate of the axis, as
/// [`Database::at`] does, between a prepared look-up at each of their nodes.
#[derive(Debug, Clone)]
pub struct Emulator {
    quantity: Quantity,
    /// The open optional axes with the coordinates of their nodes, slowest first.
    open: Vec<(Parameter, Vec<f64>)>,
    lookups: Vec<Lookup>,
    wavelengths_nm: Vec<f64>,
    /// Weights `[band][wavelength]`; none if the values are those of wavelengths.
    bands: Vec<Vec<f64>>,
}

impl Emulator {
    /// Prepares `quantity` of `database`. `fixed` holds the values of those optional axes that
    /// never change; its other values are ignored.
    ///
    /// # Errors
    /// Those of [`Database::at`] and [`Lookup::new`].
    pub fn new(database: &Database, quantity: Quantity, fixed: Point) -> Result<Self, LookupError> {
        let optional = database.axes().optional();
        let is_open = |(p, nodes): &(Parameter, &[f64])| nodes.len() > 1 && fixed.get(*p).is_none();
        let open: Vec<(Parameter, &[f64])> = optional.iter().filter(is_open).collect();
        let given: Point = fixed
            .iter()
            .filter(|(parameter, _)| optional.has(*parameter))
            .collect();
        let mut points = vec![given];
        for (parameter, nodes) in &open {
            let split = |point: Point| nodes.iter().map(move |node| point.with(*parameter, *node));
            points = points.into_iter().flat_map(split).collect();
        }
        let lookup = |point| Lookup::new(&database.at(point)?, quantity);
        let lookups: Result<Vec<Lookup>, LookupError> = points.into_iter().map(lookup).collect();
        let places = |(parameter, nodes): (Parameter, &[f64])| {
            let scale = parameter.record().scale;
            (parameter, nodes.iter().map(|x| scale.place(*x)).collect())
        };
        Ok(Self {
            quantity,
            open: open.into_iter().map(places).collect(),
            lookups: lookups?,
            wavelengths_nm: database.wavelengths_nm().to_vec(),
            bands: Vec::new(),
        })
    }

    /// The same, averaged over bands: their `weights`, `[band][wavelength]`, and their wavelengths
    /// `centres_nm`, nm, which take the place of those of the file.
    #[must_use]
    pub fn over_bands(self, weights: &[Vec<f64>], centres_nm: &[f64]) -> Self {
        Self {
            wavelengths_nm: centres_nm.to_vec(),
            bands: weights.to_vec(),
            ..self
        }
    }

    /// The quantity.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Wavelengths of a spectrum, nm; of bands, their mean wavelengths.
    #[must_use]
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// Writes the spectrum at `point` to `spectrum`, `[l]`; `single` is working memory.
    ///
    /// # Errors
    /// Those of [`Lookup::spectrum`]. A missing value on an open axis, or one outside it, is
    /// taken as the nearest node.
    pub fn spectrum(
        &self,
        point: Point,
        single: &mut Vec<f32>,
        spectrum: &mut Vec<f64>,
    ) -> Result<(), LookupError> {
        self.whole(point, single, spectrum)?;
        if !self.bands.is_empty() {
            let average = |weights: &Vec<f64>| {
                let both = weights.iter().zip(spectrum.iter());
                both.map(|(weight, value)| weight * value).sum()
            };
            *spectrum = self.bands.iter().map(average).collect();
        }
        Ok(())
    }

    /// The spectrum at the wavelengths of the file.
    fn whole(
        &self,
        point: Point,
        single: &mut Vec<f32>,
        spectrum: &mut Vec<f64>,
    ) -> Result<(), LookupError> {
        let wavelengths = self.lookups.first().map_or(0, Lookup::wavelengths);
        single.resize(wavelengths, 0.0);
        spectrum.clear();
        if let [only] = self.lookups.as_slice() {
            only.spectrum(point, single)?;
            spectrum.extend(single.iter().copied().map(f64::from));
            return Ok(());
        }
        spectrum.resize(wavelengths, 0.0);
        for (lookup, weight) in self.corners(point) {
            self.lookups[lookup].spectrum(point, single)?;
            for (sum, value) in spectrum.iter_mut().zip(single.iter()) {
                *sum += weight * self.depth(f64::from(*value));
            }
        }
        let reflects = self.quantity == Quantity::Reflectance;
        for value in spectrum {
            let dark = libm::exp(-*value);
            *value = if reflects { 1.0 - dark } else { dark };
        }
        Ok(())
    }

    /// y of a reflectance or transmittance.
    fn depth(&self, value: f64) -> f64 {
        let dark = match self.quantity {
            Quantity::Reflectance => 1.0 - value,
            Quantity::Transmittance => value,
        };
        -libm::log(dark.max(libm::exp(-DARKEST)))
    }

    /// The look-ups around `point` on the open axes, with their weights above 0.
    fn corners(&self, point: Point) -> Vec<(usize, f64)> {
        let mut corners = vec![(0, 1.0)];
        for (parameter, places) in &self.open {
            let last = places.len() - 1;
            let place = parameter.record().scale.place(point[*parameter]);
            let below = places.partition_point(|node| *node <= place);
            let below = below.saturating_sub(1).min(last - 1);
            let share = (place - places[below]) / (places[below + 1] - places[below]);
            let share = if share.is_nan() {
                0.0
            } else {
                share.clamp(0.0, 1.0)
            };
            let split = |(at, weight): (usize, f64)| {
                let both = [(below, 1.0 - share), (below + 1, share)];
                both.map(|(node, part)| (at * places.len() + node, weight * part))
            };
            corners = corners.into_iter().flat_map(split).collect();
            corners.retain(|(_, weight)| *weight > 0.0);
        }
        corners
    }
}
