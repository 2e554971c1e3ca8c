//! Reflectance and transmittance factors toward a view, from two compact files.
use splitsnow_spectra::Quantity;

use crate::{Anisotropy, Database, Lookup, LookupError, Parameter, Point};

/// A quantity of the light that leaves the snow toward a view. Names are those of
/// Schaepman-Strub et al. (2006).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DirectionalQuantity {
    /// pi times the radiance toward the view over the irradiance, of reflected light: the
    /// bidirectional reflectance factor (BRF), or under diffuse light the
    /// hemispherical-directional reflectance factor (HDRF).
    ReflectanceFactor,
    /// The reflectance factor over the reflectance.
    AnisotropyFactor,
    /// The same as the reflectance factor, of the light that leaves into the substrate (BTF or
    /// HDTF).
    TransmittanceFactor,
}

impl DirectionalQuantity {
    /// All quantities.
    pub const ALL: [Self; 3] = [
        Self::ReflectanceFactor,
        Self::AnisotropyFactor,
        Self::TransmittanceFactor,
    ];

    /// The quantity whose light it is: transmitted or reflected.
    #[must_use]
    pub const fn side(self) -> Quantity {
        match self {
            Self::TransmittanceFactor => Quantity::Transmittance,
            _ => Quantity::Reflectance,
        }
    }

    /// The short name under collimated or `diffuse` light: `brf`, `btf`, `hdrf`, `hdtf` or
    /// `anisotropy_factor`.
    #[must_use]
    pub const fn name(self, diffuse: bool) -> &'static str {
        match (self, diffuse) {
            (Self::ReflectanceFactor, false) => "brf",
            (Self::ReflectanceFactor, true) => "hdrf",
            (Self::AnisotropyFactor, _) => "anisotropy_factor",
            (Self::TransmittanceFactor, false) => "btf",
            (Self::TransmittanceFactor, true) => "hdtf",
        }
    }
}

/// The light of one kind of sky toward any view: a file of reflectance and transmittance, and
/// the file of their anisotropy factors.
///
/// ```no_run
/// use splitsnow_lookup::{Database, DirectionalQuantity, Directions, Parameter, Point, VIEWS};
///
/// # fn main() -> Result<(), splitsnow_lookup::LookupError> {
/// let dir = std::path::Path::new("out/brdf");
/// let directions = Directions::new(&Database::open(dir)?, &Database::open(dir.join(VIEWS))?)?;
/// let point = Point::from([
///     (Parameter::Facetness, 0.3),
///     (Parameter::GrainSize, 250.0),
///     (Parameter::Density, 275.0),
///     (Parameter::Thickness, 30.0),
///     (Parameter::Incidence, 55.0),
///     (Parameter::View, 40.0),
///     (Parameter::RelativeAzimuth, 0.0), // forward
/// ]);
/// let mut brf = vec![0.0; directions.wavelengths()];
/// directions.spectrum(DirectionalQuantity::ReflectanceFactor, point, &mut brf)?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct Directions {
    reflected: Option<(Lookup, Anisotropy)>,
    transmitted: Option<(Lookup, Anisotropy)>,
    wavelengths: usize,
}

impl Directions {
    /// Checks that the files belong together. `database` has reflectance and transmittance,
    /// `anisotropy` their anisotropy factors.
    ///
    /// # Errors
    /// [`LookupError::Content`] if one of the files is of the other kind;
    /// [`LookupError::Mismatch`] if their axes differ.
    pub fn check(database: &Database, anisotropy: &Database) -> Result<(), LookupError> {
        database.require_content(false)?;
        anisotropy.require_content(true)?;
        let mismatch = |difference| Err(LookupError::Mismatch { difference });
        if database.wavelengths_nm() != anisotropy.wavelengths_nm() {
            return mismatch(crate::format::WAVELENGTH);
        }
        for parameter in Parameter::ALL.into_iter().filter(|p| !p.is_view()) {
            if database.axes().values(parameter) != anisotropy.axes().values(parameter) {
                return mismatch(parameter.key());
            }
        }
        Ok(())
    }

    /// Prepares the quantities that both files hold.
    ///
    /// # Errors
    /// The errors of [`Directions::check`], [`Lookup::new`] and [`Anisotropy::new`].
    pub fn new(database: &Database, anisotropy: &Database) -> Result<Self, LookupError> {
        Self::check(database, anisotropy)?;
        let pair = |quantity| -> Result<_, LookupError> {
            if !(database.has(quantity) && anisotropy.has(quantity)) {
                return Ok(None);
            }
            let lookup = Lookup::new(database, quantity)?;
            Ok(Some((lookup, Anisotropy::new(anisotropy, quantity)?)))
        };
        Ok(Self {
            reflected: pair(Quantity::Reflectance)?,
            transmitted: pair(Quantity::Transmittance)?,
            wavelengths: database.wavelengths_nm().len(),
        })
    }

    /// The light of one `snow`, as [`Lookup::material`] and [`Anisotropy::material`].
    ///
    /// # Errors
    /// [`LookupError::Outside`] if a coordinate is outside its axis.
    pub fn material(&self, snow: Point) -> Result<Self, LookupError> {
        let one = |side: &Option<(Lookup, Anisotropy)>| -> Result<_, LookupError> {
            let Some((lookup, anisotropy)) = side else {
                return Ok(None);
            };
            Ok(Some((lookup.material(snow)?, anisotropy.material(snow)?)))
        };
        Ok(Self {
            reflected: one(&self.reflected)?,
            transmitted: one(&self.transmitted)?,
            wavelengths: self.wavelengths,
        })
    }

    /// Number of wavelengths of a spectrum, l.
    #[must_use]
    pub fn wavelengths(&self) -> usize {
        self.wavelengths
    }

    /// Writes `quantity` at `point` at each wavelength to `spectrum` (`[l]`). `point` has a
    /// view and the coordinates of [`Lookup::spectrum`]; the incidence angle is 0 for diffuse
    /// light.
    ///
    /// # Errors
    /// Those of [`Lookup::spectrum`] and [`Anisotropy::spectrum`]; [`LookupError::NoQuantity`] if
    /// one of the files lacks the quantity.
    pub fn spectrum(
        &self,
        quantity: DirectionalQuantity,
        point: Point,
        spectrum: &mut [f32],
    ) -> Result<(), LookupError> {
        let (side, missing, stored) = match quantity.side() {
            missing @ Quantity::Transmittance => {
                (&self.transmitted, missing, Quantity::Reflectance)
            }
            missing @ Quantity::Reflectance => (&self.reflected, missing, Quantity::Transmittance),
        };
        let Some((lookup, anisotropy)) = side else {
            return Err(LookupError::NoQuantity { missing, stored });
        };
        let is_factor = quantity == DirectionalQuantity::AnisotropyFactor;
        anisotropy.times((!is_factor).then_some(lookup), point, spectrum)
    }
}
