//! Colours of spectra.
use numpy::{PyReadonlyArray2, PyReadwriteArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::Path;
use std::sync::Arc;

use splitsnow::colour::{Colorimeter, Illuminant, PowerTable, Viewing, encoded_srgb};

#[derive(Clone, Copy)]
enum Space {
    Xyz,
    Lab,
    LinearSrgb,
    Srgb,
}

/// An illuminant as Python gives it.
#[derive(FromPyObject, Debug, Clone, PartialEq)]
pub(crate) enum Light {
    Name(String),
    /// Wavelengths, nm, and the power there.
    Table(Vec<f64>, Vec<f64>),
}

impl Light {
    fn illuminant(&self) -> Result<Illuminant, String> {
        match self {
            Self::Name(name) => name.parse(),
            Self::Table(nm, power) => {
                let table = PowerTable::new("the illuminant's table", nm, power);
                let table = table.map_err(|error| error.to_string())?;
                Ok(Illuminant::Table(Arc::new(table)))
            }
        }
    }
}

/// Wavelengths and power of the table in a file, and a line that says how it was read.
#[pyfunction]
pub(crate) fn illuminant(path: &str) -> PyResult<(Vec<f64>, Vec<f64>, String)> {
    let found = Illuminant::find(path, Path::new(""));
    match found.map_err(|error| PyValueError::new_err(error.to_string()))? {
        (Illuminant::Table(table), Some(report)) => Ok((
            table.wavelengths_nm().to_vec(),
            table.power().to_vec(),
            report.to_string(),
        )),
        (named, _) => {
            let message = format!("`{}` is a name, not a file", named.name());
            Err(PyValueError::new_err(message))
        }
    }
}

/// Sees spectra at fixed wavelengths in one colour space.
pub(crate) struct Eye {
    colorimeter: Colorimeter,
    space: Space,
}

impl Eye {
    /// For spectra at these wavelengths; `seen` are a colour space and an illuminant.
    pub(crate) fn new(wavelengths_nm: &[f64], seen: &(String, Light)) -> PyResult<Self> {
        let (space, illuminant) = seen;
        let refuse = |message: String| PyValueError::new_err(message);
        let space = match space.as_str() {
            "xyz" => Space::Xyz,
            "lab" => Space::Lab,
            "linear_srgb" => Space::LinearSrgb,
            "srgb" => Space::Srgb,
            other => return Err(refuse(format!("no colour space is named `{other}`"))),
        };
        let illuminant = illuminant.illuminant().map_err(refuse)?;
        let viewing = Viewing {
            illuminants: vec![illuminant],
            ..Viewing::default()
        };
        let colorimeter = Colorimeter::of_lines(wavelengths_nm, &viewing);
        let colorimeter = colorimeter.map_err(|e| refuse(e.to_string()))?;
        let without = || {
            refuse(
                "spectra at these wavelengths have no colour: they must span some of 380-650 nm"
                    .to_owned(),
            )
        };
        Ok(Self {
            colorimeter: colorimeter.ok_or_else(without)?,
            space,
        })
    }

    /// The colour of a spectrum, one value per wavelength.
    pub(crate) fn sees(&self, spectrum: &[f64]) -> [f64; 3] {
        match self.space {
            Space::Xyz => self.colorimeter.xyz(spectrum),
            Space::Lab => {
                let lab = self.colorimeter.lab(spectrum);
                [lab.l, lab.a, lab.b]
            }
            Space::LinearSrgb => self.colorimeter.linear_srgb(spectrum),
            Space::Srgb => encoded_srgb(self.colorimeter.linear_srgb(spectrum)),
        }
    }
}

/// Colours of `spectra`, `[n, l]`, into `out`, `[n, 3]`.
#[pyfunction]
pub(crate) fn colours(
    spectra: PyReadonlyArray2<f64>,
    wavelengths_nm: Vec<f64>,
    seen: (String, Light),
    mut out: PyReadwriteArray2<f64>,
) -> PyResult<()> {
    let eye = Eye::new(&wavelengths_nm, &seen)?;
    let (spectra, mut out) = (spectra.as_array(), out.as_array_mut());
    if spectra.ncols() != wavelengths_nm.len() || out.dim() != (spectra.nrows(), 3) {
        let (found, expected) = (spectra.ncols(), wavelengths_nm.len());
        let message = format!("a spectrum has {found} values, there are {expected} wavelengths");
        return Err(PyValueError::new_err(message));
    }
    for (spectrum, mut row) in spectra.rows().into_iter().zip(out.rows_mut()) {
        let colour = eye.sees(&spectrum.to_vec());
        row.iter_mut().zip(colour).for_each(|(value, c)| *value = c);
    }
    Ok(())
}
