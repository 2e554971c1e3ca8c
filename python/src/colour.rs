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

/// An illuminant as passed from Python.
#[derive(FromPyObject, Debug, Clone, PartialEq)]
pub(crate) enum PyIlluminant {
    Name(String),
    /// Wavelengths, nm, and relative power.
    Table(Vec<f64>, Vec<f64>),
}

impl PyIlluminant {
    fn illuminant(&self) -> Result<Illuminant, String> {
        match self {
            Self::Name(name) => name.parse(),
            Self::Table(nm, power) => {
                let table = PowerTable::new("the illuminant table", nm, power);
                let table = table.map_err(|error| error.to_string())?;
                Ok(Illuminant::Table(Arc::new(table)))
            }
        }
    }
}

/// Wavelengths and power of the table in a file, and a line about how it was read.
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
            let message = format!(
                "`{}` is the name of an illuminant, not a file",
                named.name()
            );
            Err(PyValueError::new_err(message))
        }
    }
}

/// Converts spectra at fixed wavelengths to one colour space.
pub(crate) struct ColourConverter {
    colorimeter: Colorimeter,
    space: Space,
}

impl ColourConverter {
    /// A converter for spectra at these wavelengths; `viewing` is a colour space and an
    /// illuminant.
    pub(crate) fn new(wavelengths_nm: &[f64], viewing: &(String, PyIlluminant)) -> PyResult<Self> {
        let (space, illuminant) = viewing;
        let refuse = |message: String| PyValueError::new_err(message);
        let space = match space.as_str() {
            "xyz" => Space::Xyz,
            "lab" => Space::Lab,
            "linear_srgb" => Space::LinearSrgb,
            "srgb" => Space::Srgb,
            other => return Err(refuse(format!("no colour space is named `{other}`"))),
        };
        let illuminant = illuminant.illuminant().map_err(refuse)?;
        let conditions = Viewing {
            illuminants: vec![illuminant],
            ..Viewing::default()
        };
        let colorimeter = Colorimeter::piecewise_linear(wavelengths_nm, &conditions);
        let colorimeter = colorimeter.map_err(|e| refuse(e.to_string()))?;
        let no_colour = || {
            refuse(
                "spectra at these wavelengths have no colour: they must cover part of 380-650 nm"
                    .to_owned(),
            )
        };
        Ok(Self {
            colorimeter: colorimeter.ok_or_else(no_colour)?,
            space,
        })
    }

    /// The colour of a spectrum with one value per wavelength.
    pub(crate) fn colour(&self, spectrum: &[f64]) -> [f64; 3] {
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

/// Writes the colours of `spectra`, `[n, l]`, to `out`, `[n, 3]`.
#[pyfunction]
pub(crate) fn colours(
    spectra: PyReadonlyArray2<f64>,
    wavelengths_nm: Vec<f64>,
    viewing: (String, PyIlluminant),
    mut out: PyReadwriteArray2<f64>,
) -> PyResult<()> {
    let converter = ColourConverter::new(&wavelengths_nm, &viewing)?;
    let (spectra, mut out) = (spectra.as_array(), out.as_array_mut());
    if spectra.ncols() != wavelengths_nm.len() || out.dim() != (spectra.nrows(), 3) {
        let (found, expected) = (spectra.ncols(), wavelengths_nm.len());
        let message =
            format!("a spectrum has {found} values; expected {expected}, one per wavelength");
        return Err(PyValueError::new_err(message));
    }
    for (spectrum, mut row) in spectra.rows().into_iter().zip(out.rows_mut()) {
        let colour = converter.colour(&spectrum.to_vec());
        row.iter_mut().zip(colour).for_each(|(value, c)| *value = c);
    }
    Ok(())
}
