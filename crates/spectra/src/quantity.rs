/// A stored quantity of a slab: what leaves it at the bottom, or at the top.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Directional-hemispherical transmittance (Varsa 2025, eq. 6.3).
    Transmittance,
    /// Directional-hemispherical reflectance (Varsa 2025, eq. 6.2).
    Reflectance,
}

impl Quantity {
    /// Both, in the order files hold them.
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
