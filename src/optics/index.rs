//! Which published tables the complex refractive indices come from.

/// Complex refractive index of ice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum IceTable {
    /// S. G. Warren and R. E. Brandt 2008, 350-2500 nm here.
    #[default]
    WarrenBrandt2008,
    /// G. Picard et al. 2016 for k at 320-600 nm, Warren and Brandt 2008 for all else.
    Picard2016,
}

/// Complex refractive index of liquid water.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum WaterTable {
    /// D. J. Segelstein 1981.
    #[default]
    Segelstein1981,
    /// P. M. Rowe et al. 2020 at 0 C, from 667 nm.
    Rowe2020,
    /// G. M. Hale and M. R. Querry 1973, up to 1000 nm.
    HaleQuerry1973,
    /// A CSV file `wavelength_nm,n,k` of the user's.
    Csv(std::path::PathBuf),
}
