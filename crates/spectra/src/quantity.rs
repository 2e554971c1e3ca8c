/// A stored quantity of a slab: the fraction of light that leaves it at the bottom or top.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Directional-hemispherical transmittance (Varsa 2025, eq. 6.3).
    Transmittance,
    /// Directional-hemispherical reflectance (Varsa 2025, eq. 6.2).
    Reflectance,
}

impl Quantity {
    /// All variants, in the order of files.
    pub const ALL: [Self; 2] = [Self::Transmittance, Self::Reflectance];

    /// The name used on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Transmittance => "transmittance",
            Self::Reflectance => "reflectance",
        }
    }
}
