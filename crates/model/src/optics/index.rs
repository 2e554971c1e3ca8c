//! Complex refractive indices n + i k (k >= 0) of ice and water from published
//! tables: n linear and k log-log in wavelength (docs/methods.md).
use std::borrow::Cow;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::LazyLock;

use thiserror::Error;

use splitsnow_spectra::spectrum::{Table, TableError};

/// Wavelengths that the program accepts, nm. Beyond 2500 nm see "Wavelengths beyond 2500 nm"
/// in docs/methods.md.
pub const MODEL_RANGE_NM: (f64, f64) = (350.0, 5000.0);

const NK: [&str; 3] = ["wavelength_nm", "n", "k"];

/// Error of an optical table.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum OpticsError {
    /// A user's table cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A user's table has values that are not a refractive index.
    #[error(
        "water table {name}: at {wavelength_nm} nm n = {n} and k = {k}, but n must lie in [1, 2] and k in [0, 1]"
    )]
    Values {
        /// Path of the file.
        name: String,
        /// Wavelength of the row, nm.
        wavelength_nm: f64,
        /// Value of n in the row.
        n: f64,
        /// Value of k in the row.
        k: f64,
    },
    /// The table does not cover a wavelength.
    #[error("the optical table {table} covers {min_nm}-{max_nm} nm, not {wavelength_nm} nm")]
    Outside {
        /// Name of the table.
        table: String,
        /// The requested wavelength, nm.
        wavelength_nm: f64,
        /// First wavelength of the table, nm.
        min_nm: f64,
        /// Last wavelength of the table, nm.
        max_nm: f64,
    },
}

/// Complex refractive index n + i k, dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// Real part.
    pub n: f64,
    /// Imaginary part, >= 0.
    pub k: f64,
}

impl Index {
    /// Absorption coefficient 4 pi k / lambda, 1/m (Varsa 2025, eq. 4.7).
    #[must_use]
    pub fn absorption_per_m(self, wavelength_nm: f64) -> f64 {
        4.0 * std::f64::consts::PI * self.k / splitsnow_spectra::units::nm_to_m(wavelength_nm)
    }
}

/// Complex refractive index of ice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum IceTable {
    /// S. G. Warren and R. E. Brandt 2008.
    #[default]
    WarrenBrandt2008,
    /// G. Picard et al. 2016 for k at 320-600 nm; otherwise Warren and Brandt 2008.
    Picard2016,
}

/// Complex refractive index of liquid water.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub enum WaterTable {
    /// D. J. Segelstein 1981.
    #[default]
    Segelstein1981,
    /// P. M. Rowe et al. 2020 at 0 C, from 667 nm.
    Rowe2020,
    /// G. M. Hale and M. R. Querry 1973, up to 1000 nm; beyond, its grid is too coarse
    /// for k.
    HaleQuerry1973,
    /// A user's CSV file with the columns `wavelength_nm,n,k`.
    Csv(PathBuf),
}

/// A table that is compiled into the program.
struct Shipped {
    file: &'static str,
    text: &'static str,
    table: LazyLock<Table>,
}

impl Shipped {
    fn data_file(&self) -> DataFile {
        DataFile {
            name: self.file.into(),
            bytes: Cow::Borrowed(self.text.as_bytes()),
        }
    }
}

impl Deref for Shipped {
    type Target = Table;

    fn deref(&self) -> &Table {
        &self.table
    }
}

macro_rules! shipped {
    ($name:ident, $file:literal, $header:expr) => {
        static $name: Shipped = Shipped {
            file: $file,
            text: include_str!(concat!("../../data/", $file)),
            table: LazyLock::new(|| {
                #[allow(clippy::expect_used)] // compiled in; the tests parse every table
                Table::parse($file, $name.text, $header).expect("shipped table")
            }),
        };
    };
}
shipped!(WARREN_BRANDT_2008, "ice_warren_brandt_2008.csv", &NK);
shipped!(PICARD_2016, "ice_picard_2016.csv", &["wavelength_nm", "k"]);
shipped!(SEGELSTEIN_1981, "water_segelstein_1981.csv", &NK);
shipped!(ROWE_2020, "water_rowe_2020_273k.csv", &NK);
shipped!(HALE_QUERRY_1973, "water_hale_querry_1973.csv", &NK);
// Rows beyond those of the first files, which results below 2.6 um depend on.
shipped!(ICE_BEYOND, "ice_warren_brandt_2008_to_5um.csv", &NK);
shipped!(SEGELSTEIN_BEYOND, "water_segelstein_1981_to_5um.csv", &NK);
shipped!(ROWE_BEYOND, "water_rowe_2020_273k_to_5um.csv", &NK);
shipped!(
    ICE_DENSITY,
    "ice_density_iapws06.csv",
    &["temperature_c", "density_kg_m3"]
);

/// Table of ice up to 5 um.
static ICE: LazyLock<Table> = LazyLock::new(|| WARREN_BRANDT_2008.followed_by(&ICE_BEYOND));

/// The data files of a table, the second of which has the rows beyond the first one.
fn files_up_to(longest_nm: f64, [first, beyond]: [&Shipped; 2]) -> Vec<DataFile> {
    let mut files = vec![first.data_file()];
    if longest_nm > first.range().1 {
        files.push(beyond.data_file());
    }
    files
}

/// A data file on which results depend.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DataFile {
    /// Name of the file; `water` for a user's table, so that a result does not depend
    /// on the path of that table.
    pub name: String,
    /// Content of the file.
    pub bytes: Cow<'static, [u8]>,
}

/// The data files of the tables in use up to a wavelength; `water` is `None` in dry snow.
///
/// # Errors
/// [`OpticsError::Table`] if a user's table cannot be read.
pub fn data_files(
    ice: IceTable,
    water: Option<&WaterTable>,
    longest_nm: f64,
) -> Result<Vec<DataFile>, OpticsError> {
    let mut files = vec![ICE_DENSITY.data_file()];
    files.extend(files_up_to(longest_nm, [&WARREN_BRANDT_2008, &ICE_BEYOND]));
    if ice == IceTable::Picard2016 {
        files.push(PICARD_2016.data_file());
    }
    if let Some(water) = water {
        files.extend(water.data_files(longest_nm)?);
    }
    Ok(files)
}

/// Density of ice Ih, kg/m3 (IAPWS R10-06), interpolated linearly in temperature (in
/// degrees Celsius). Temperatures are clamped to the table's range [-40, 0].
#[must_use]
pub fn ice_density_kg_m3(temperature_c: f64) -> f64 {
    let (min, max) = ICE_DENSITY.range();
    ICE_DENSITY
        .linear(0, temperature_c.clamp(min, max))
        .unwrap_or(f64::NAN)
}

impl IceTable {
    /// The name used in configs and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WarrenBrandt2008 => "warren_brandt_2008",
            Self::Picard2016 => "picard_2016",
        }
    }

    /// First and last wavelength of the table, nm.
    #[must_use]
    pub fn range_nm(self) -> (f64, f64) {
        match self {
            Self::WarrenBrandt2008 => ICE.range(),
            Self::Picard2016 => (PICARD_2016.range().0, ICE.range().1),
        }
    }

    /// Refractive index at a wavelength.
    ///
    /// # Errors
    /// [`OpticsError::Outside`] if the table does not cover the wavelength.
    pub fn at(self, wavelength_nm: f64) -> Result<Index, OpticsError> {
        let outside = || {
            let (min_nm, max_nm) = self.range_nm();
            OpticsError::Outside {
                table: self.name().into(),
                wavelength_nm,
                min_nm,
                max_nm,
            }
        };
        let k = match self {
            Self::Picard2016 if wavelength_nm < 600.0 => PICARD_2016.log_log(0, wavelength_nm),
            _ => ICE.log_log(1, wavelength_nm),
        };
        Ok(Index {
            n: ICE.linear(0, wavelength_nm).ok_or_else(outside)?,
            k: k.ok_or_else(outside)?,
        })
    }
}

impl WaterTable {
    /// The name used in configs and files: the path for a CSV file.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Segelstein1981 => "segelstein_1981".into(),
            Self::Rowe2020 => "rowe_2020".into(),
            Self::HaleQuerry1973 => "hale_querry_1973".into(),
            Self::Csv(path) => path.display().to_string(),
        }
    }

    fn data_files(&self, longest_nm: f64) -> Result<Vec<DataFile>, OpticsError> {
        match self {
            Self::Segelstein1981 => Ok(files_up_to(
                longest_nm,
                [&SEGELSTEIN_1981, &SEGELSTEIN_BEYOND],
            )),
            Self::Rowe2020 => Ok(files_up_to(longest_nm, [&ROWE_2020, &ROWE_BEYOND])),
            Self::HaleQuerry1973 => Ok(vec![HALE_QUERRY_1973.data_file()]),
            Self::Csv(path) => {
                let bytes = std::fs::read(path).map_err(|error| TableError::Read {
                    name: self.name(),
                    reason: error.to_string(),
                })?;
                Ok(vec![DataFile {
                    name: "water".into(),
                    bytes: Cow::Owned(bytes),
                }])
            }
        }
    }

    /// Loads the table; a user's table is read from disk.
    ///
    /// # Errors
    /// [`OpticsError::Table`] if a user's table cannot be read, and
    /// [`OpticsError::Values`] if it has values that are not a refractive index.
    pub fn load(&self) -> Result<Water, OpticsError> {
        let (table, max_nm) = match self {
            Self::Segelstein1981 => (
                SEGELSTEIN_1981.followed_by(&SEGELSTEIN_BEYOND),
                f64::INFINITY,
            ),
            Self::Rowe2020 => (ROWE_2020.followed_by(&ROWE_BEYOND), f64::INFINITY),
            Self::HaleQuerry1973 => (HALE_QUERRY_1973.table.clone(), 1000.0),
            Self::Csv(path) => {
                let table = Table::read(path, &NK)?;
                for (i, &wavelength_nm) in table.abscissae().iter().enumerate() {
                    let (n, k) = (table.column(0)[i], table.column(1)[i]);
                    if !((1.0..=2.0).contains(&n) && (0.0..=1.0).contains(&k)) {
                        let name = self.name();
                        return Err(OpticsError::Values {
                            name,
                            wavelength_nm,
                            n,
                            k,
                        });
                    }
                }
                (table, f64::INFINITY)
            }
        };
        let (min_nm, last) = table.range();
        Ok(Water {
            name: self.name(),
            range_nm: (min_nm, last.min(max_nm)),
            table,
        })
    }
}

/// A loaded water table.
#[derive(Debug, Clone)]
pub struct Water {
    name: String,
    range_nm: (f64, f64),
    table: Table,
}

impl Water {
    /// First and last wavelength of the table, nm.
    #[must_use]
    pub fn range_nm(&self) -> (f64, f64) {
        self.range_nm
    }

    /// Refractive index at a wavelength.
    ///
    /// # Errors
    /// [`OpticsError::Outside`] if the table does not cover the wavelength.
    pub fn at(&self, wavelength_nm: f64) -> Result<Index, OpticsError> {
        let (min_nm, max_nm) = self.range_nm;
        let outside = || OpticsError::Outside {
            table: self.name.clone(),
            wavelength_nm,
            min_nm,
            max_nm,
        };
        if !(min_nm <= wavelength_nm && wavelength_nm <= max_nm) {
            return Err(outside());
        }
        Ok(Index {
            n: self.table.linear(0, wavelength_nm).ok_or_else(outside)?,
            k: self.table.log_log(1, wavelength_nm).ok_or_else(outside)?,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn shipped_tables_give_their_own_rows() {
        let ice = IceTable::WarrenBrandt2008.at(400.0).unwrap();
        assert_eq!(ice.n, 1.3194);
        assert!((ice.k / 2.365e-11 - 1.0).abs() < 1e-12);
        let dirty = IceTable::Picard2016.at(400.0).unwrap();
        assert!((dirty.k / 5.81501987e-10 - 1.0).abs() < 1e-12);
        assert_eq!(
            IceTable::Picard2016.at(700.0),
            IceTable::WarrenBrandt2008.at(700.0)
        );
        for table in [
            WaterTable::Segelstein1981,
            WaterTable::Rowe2020,
            WaterTable::HaleQuerry1973,
        ] {
            let water = table.load().unwrap();
            let n = water.at(800.0).unwrap().n;
            assert!((1.32..1.34).contains(&n), "{}: {n}", table.name());
        }
    }

    #[test]
    fn absorption_coefficient_by_hand() {
        // 4 pi 1e-6 / 1000 nm = 12.566370614 / m
        let alpha = Index { n: 1.3, k: 1e-6 }.absorption_per_m(1000.0);
        assert!((alpha - 12.566_370_614_359_172).abs() < 1e-9);
    }

    #[test]
    fn wavelengths_outside_a_table_are_refused() {
        let water = WaterTable::HaleQuerry1973.load().unwrap();
        assert!(water.at(1000.0).is_ok());
        let error = water.at(1001.0).unwrap_err().to_string();
        assert!(
            error.contains("table hale_querry_1973 covers 300-1000 nm"),
            "{error}"
        );
        assert!(IceTable::Picard2016.at(319.0).is_err());
        assert!(WaterTable::Rowe2020.load().unwrap().at(600.0).is_err());
    }

    #[test]
    fn the_files_in_use_are_named() {
        let names = |ice, water: Option<&WaterTable>| -> Vec<String> {
            let files = data_files(ice, water, 2500.0).unwrap();
            files.into_iter().map(|file| file.name).collect()
        };
        let dry = ["ice_density_iapws06.csv", "ice_warren_brandt_2008.csv"];
        assert_eq!(names(IceTable::WarrenBrandt2008, None), dry);
        let wet = names(IceTable::Picard2016, Some(&WaterTable::Rowe2020));
        assert_eq!(
            wet[2..],
            ["ice_picard_2016.csv", "water_rowe_2020_273k.csv"]
        );
        let folder = tempfile::tempdir().unwrap();
        let mine = WaterTable::Csv(folder.path().join("mine.csv"));
        assert!(data_files(IceTable::Picard2016, Some(&mine), 2500.0).is_err());
        std::fs::write(folder.path().join("mine.csv"), "x").unwrap();
        let files = data_files(IceTable::WarrenBrandt2008, Some(&mine), 2500.0).unwrap();
        assert_eq!(
            (files[2].name.as_str(), &files[2].bytes[..]),
            ("water", &b"x"[..])
        );
    }

    /// Rows of both files, the wavelength between them, and the files named for it.
    #[test]
    fn tables_go_on_to_5_um() {
        let ice = |nm| IceTable::WarrenBrandt2008.at(nm).unwrap();
        assert_eq!(
            [ice(2675.0).n, ice(2700.0).n, ice(2725.0).n],
            [1.1776, 1.16415, 1.1507]
        );
        assert!(ice(5000.0).k > 0.01 && IceTable::Picard2016.at(5001.0).is_err());
        for table in [WaterTable::Segelstein1981, WaterTable::Rowe2020] {
            let water = table.load().unwrap();
            let [before, within, after] =
                [2690.0, 2700.0, 2710.0].map(|nm| water.at(nm).unwrap().n);
            assert!(before > within && within > after && water.at(5000.0).is_ok());
            let files = |nm| {
                data_files(IceTable::Picard2016, Some(&table), nm)
                    .unwrap()
                    .len()
            };
            assert_eq!([files(2675.0), files(2676.0), files(3000.0)], [4, 5, 6]);
        }
    }

    #[test]
    fn ice_density_is_the_table() {
        assert_eq!(ice_density_kg_m3(0.0), 916.722);
        assert!((ice_density_kg_m3(-1.0) - (916.722 + 0.2 * (917.449 - 916.722))).abs() < 1e-9);
        assert_eq!(ice_density_kg_m3(-60.0), ice_density_kg_m3(-40.0));
    }
}
