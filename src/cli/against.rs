//! `simulate --against`: compares the simulation with a measured spectrum.
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{anyhow, bail};
use serde_json::{Value, json};

use super::common;
use crate::comparison::{
    Band, Comparison, Exclusion, GOOD_RMSE, Hints, Matched, MeasuredError, MeasuredSpectrum,
    ResidualPoint, ResidualStatistics, listed, longest_nm,
};
#[cfg(feature = "charts")]
use crate::lab::report;
use crate::measurement::{Quantity, Spectrum};
use crate::optics::MODEL_RANGE_NM;
use crate::spectrum::measured::{Column, ReadProblem, Unit, ValueScale};

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Comparison with a measured spectrum")]
pub(super) struct Args {
    /// Measured spectrum: a text table (CSV, ECOSTRESS, .sed, .sig) in a format of
    /// docs/formats.md; a note on standard error says how it was read
    #[arg(long, value_name = "FILE", conflicts_with_all = ["goniometer", "radial_profile"])]
    against: Option<PathBuf>,
    /// Column of the file to compare: its name, a part of its name, or its number from 1
    /// [default: the first column whose name fits, else the first]
    #[arg(long, requires = "against", value_name = "NAME|N")]
    column: Option<Column>,
    /// Unit of the file's wavelengths [default: the unit that the file states, else guessed]
    #[arg(long, requires = "against", value_parser = common::name_parser(Unit::ALL, Unit::name))]
    unit: Option<Unit>,
    /// Scale of the file's values [default: the scale that the file states, else guessed]
    #[arg(long, requires = "against", value_parser = common::name_parser(ValueScale::ALL, ValueScale::name))]
    scale: Option<ValueScale>,
    /// Quantity in the column [default: from the name of the column, else reflectance]
    #[arg(long, requires = "against",
          value_parser = common::name_parser(Quantity::ALL, Quantity::name))]
    quantity: Option<Quantity>,
    /// Band in nm, ends included, that is printed but left out of the statistics; may be given
    /// several times, or once as `none` [default: 1750-2000 and 2350-2500, where water vapour
    /// absorbs; with a sample that goes beyond 2500, 2350-3350 and 4150-4500]
    #[arg(long, requires = "against", value_name = "FROM-TO")]
    exclude: Vec<Exclude>,
    /// Write a picture of both spectra and the residuals to FILE, which must end with .svg or
    /// .png
    #[cfg(feature = "charts")]
    #[arg(long, requires = "against", value_name = "FILE", value_parser = picture)]
    plot: Option<PathBuf>,
}

/// A value of `--exclude`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Exclude {
    None,
    Band(Exclusion),
}

impl FromStr for Exclude {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            band => band.parse().map(Self::Band),
        }
    }
}

/// The bands that the values of `--exclude` name; those of field measurements that are used up to
/// `longest_nm` if there are none.
pub(super) fn exclusions(given: &[Exclude], longest_nm: f64) -> anyhow::Result<Vec<Exclusion>> {
    match given {
        [] => return Ok(Exclusion::field(longest_nm).into()),
        [Exclude::None] => return Ok(Vec::new()),
        _ => {}
    }
    let bands = given.iter().map(|exclude| match exclude {
        Exclude::Band(band) => Ok(*band),
        Exclude::None => {
            bail!("--exclude none cannot be combined with another --exclude; remove one of them")
        }
    });
    bands.collect()
}

/// Notes how the file was read, and how rows beyond the range that is used are included.
pub(super) fn note_read(path: &Path, measured: &MeasuredSpectrum, beyond: &str) {
    let (file, longest) = (common::one_line(path), measured.range_nm().1);
    let how = match measured.goes_on() {
        true => format!("; used up to {longest} nm: {beyond} to use more"),
        false => String::new(),
    };
    common::note(&format!("read {file}: {}{how}", measured.report()));
}

/// The error of reading a file, with help for one whose rows are all beyond the range that is
/// used but within that of the model.
pub(super) fn reach(error: MeasuredError, beyond: &str) -> anyhow::Error {
    if let MeasuredError::Spectrum(spectrum) = &error
        && let ReadProblem::Empty {
            high,
            outside_nm: Some((first, last)),
            ..
        } = *spectrum.problem
        && first <= MODEL_RANGE_NM.1
        && last > high
        && high < MODEL_RANGE_NM.1
    {
        let text = error.to_string();
        return anyhow!(text.replace("\n  help: ", &format!("\n  help: {beyond}, or ")));
    }
    error.into()
}

/// Parses the path of a picture, which must end with .svg or .png.
#[cfg(feature = "charts")]
pub(super) fn picture(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match report::Picture::of(&path) {
        Some(_) => Ok(path),
        None => Err("the name of the picture must end with .svg or .png".into()),
    }
}

/// The measured spectrum, matched to the wavelengths of the sample.
pub(super) struct Target {
    measured: MeasuredSpectrum,
    matched: Vec<Matched>,
    /// Number of wavelengths of the sample.
    wavelengths: usize,
}

/// A measured spectrum and its comparison with the simulation.
pub(super) struct Compared {
    measured: MeasuredSpectrum,
    comparison: Comparison,
    /// Number of wavelengths of the sample without a measured value.
    unmatched: usize,
}

impl Args {
    /// Reads the measured spectrum, if `--against` is given, and notes how it was read.
    ///
    /// # Errors
    /// If the file cannot be read or has no values near the wavelengths of the sample.
    pub(super) fn target(&self, wavelengths_nm: &[f64]) -> anyhow::Result<Option<Target>> {
        let Some(path) = &self.against else {
            return Ok(None);
        };
        let longest = longest_nm(wavelengths_nm);
        let hints = Hints {
            quantity: self.quantity,
            column: self.column.clone(),
            unit: self.unit,
            scale: self.scale,
            longest_nm: Some(longest),
        };
        let exclusions = exclusions(&self.exclude, longest)?;
        const BEYOND: &str = "give the sample [wavelengths] beyond it";
        let measured = MeasuredSpectrum::read(path, &hints, &exclusions);
        let measured = measured.map_err(|error| reach(error, BEYOND))?;
        note_read(path, &measured, BEYOND);
        Ok(Some(Target {
            matched: measured.at(wavelengths_nm)?,
            measured,
            wavelengths: wavelengths_nm.len(),
        }))
    }

    /// Checks that the picture can be written, if `--plot` is given.
    #[cfg(feature = "charts")]
    pub(super) fn check_plot(&self) -> anyhow::Result<()> {
        self.plot.as_deref().map_or(Ok(()), common::check_output)
    }

    /// Writes the picture, if `--plot` is given.
    #[cfg(feature = "charts")]
    pub(super) fn plot(&self, compared: &Compared) -> anyhow::Result<()> {
        let Some(path) = &self.plot else {
            return Ok(());
        };
        let Compared {
            measured,
            comparison,
            ..
        } = compared;
        let drawing = report::Residuals {
            measured,
            comparison,
        };
        Ok(drawing.write(path)?)
    }
}

impl Target {
    /// Compares the simulated `spectrum` with the measured one.
    pub(super) fn compare(self, spectrum: &Spectrum) -> Compared {
        let simulated = spectrum.of(self.measured.quantity());
        Compared {
            comparison: Comparison::new(&self.matched, simulated),
            unmatched: self.wavelengths - self.matched.len(),
            measured: self.measured,
        }
    }
}

impl Compared {
    /// Comment lines that start with #, then one CSV row per wavelength.
    pub(super) fn csv(&self) -> String {
        let Self {
            measured,
            comparison,
            unmatched,
        } = self;
        let (quantity, used, ignored) = (
            measured.quantity().name(),
            measured.rows(),
            measured.ignored(),
        );
        let file = common::one_line(Path::new(measured.file()));
        let (first, last) = measured.range_nm();
        let mut out = format!(
            "# against: {file}, {quantity}, {used} rows used, {ignored} outside {first}-{last} nm\n\
             # not_compared: {unmatched} wavelengths of the sample without rows near them\n\
             # excluded_nm: {}\n",
            listed(measured.exclusions())
        );
        if let Some(overall) = comparison.overall() {
            let _ = writeln!(out, "# overall: {}", statistics_text(&overall));
        }
        for band in Band::ALL {
            let ((from, to), name) = (band.range_nm(), band.name());
            let figures = comparison.band(band);
            let figures =
                figures.map_or("points 0".to_owned(), |figures| statistics_text(&figures));
            let _ = writeln!(out, "# {name} {from}-{to} nm: {figures}");
        }
        if let Some(figures) = comparison.beyond_bands() {
            let (after, text) = (Band::IrB.range_nm().1, statistics_text(&figures));
            let _ = writeln!(out, "# beyond {after} nm: {text}");
        }
        let good = if self.good() { "yes" } else { "no" };
        let _ = writeln!(
            out,
            "# good: {good} (Varsa 2025: an RMSE below {GOOD_RMSE})\n\
             wavelength_nm,simulated,simulated_se,measured,residual,excluded"
        );
        for point in &comparison.points {
            let Matched {
                nm,
                value,
                excluded,
                ..
            } = point.matched;
            let (residual, simulated) = (point.residual(), point.simulated);
            let _ = writeln!(
                out,
                "{nm},{:?},{:?},{value:?},{residual:?},{excluded}",
                simulated.value, simulated.se
            );
        }
        out
    }

    /// The content of [`Self::csv`] as JSON.
    pub(super) fn json(&self) -> Value {
        let Self {
            measured,
            comparison,
            unmatched,
        } = self;
        let list = |part: &dyn Fn(&ResidualPoint) -> Value| -> Value {
            comparison.points.iter().map(part).collect()
        };
        let exclusions = measured.exclusions().iter();
        let excluded: Vec<_> = exclusions.map(|band| (band.from_nm, band.to_nm)).collect();
        let bands = Band::ALL.map(|band| {
            let mut value = figures(comparison.band(band));
            value["name"] = json!(band.name());
            value["range_nm"] = json!(band.range_nm());
            value
        });
        let mut value = json!({
            "file": measured.file(),
            "quantity": measured.quantity().name(),
            "rows_used": measured.rows(),
            "rows_outside": measured.ignored(),
            "read": measured.report(),
            "not_compared": unmatched,
            "excluded_nm": excluded,
            "overall": figures(comparison.overall()),
            "bands": bands,
            "good": self.good(),
            "wavelength_nm": list(&|point| json!(point.matched.nm)),
            "simulated": list(&|point| json!(point.simulated.value)),
            "simulated_se": list(&|point| json!(point.simulated.se)),
            "measured": list(&|point| json!(point.matched.value)),
            "uncertainty": list(&|point| json!(point.matched.uncertainty)),
            "residual": list(&|point| json!(point.residual())),
            "excluded": list(&|point| json!(point.matched.excluded)),
        });
        if let Some(beyond) = comparison.beyond_bands() {
            value["beyond_bands"] = figures(Some(beyond));
        }
        value
    }

    /// Whether the overall RMSE is below [`GOOD_RMSE`].
    fn good(&self) -> bool {
        let overall = self.comparison.overall();
        overall.is_some_and(|figures| figures.rmse < GOOD_RMSE)
    }
}

/// The statistics as text, with five decimals, or three digits for values below 1e-4.
fn statistics_text(figures: &ResidualStatistics) -> String {
    let digits = |value: f64| match value.abs() {
        size if size >= 1e-4 || size == 0.0 => format!("{value:.5}"),
        _ => format!("{value:.2e}"),
    };
    let mut text = format!(
        "rmse {}, bias {}, mean simulated_se {}, points {}",
        digits(figures.rmse),
        digits(figures.bias),
        digits(figures.mean_simulated_se),
        figures.points
    );
    if let Some(uncertainty) = figures.mean_uncertainty {
        let _ = write!(
            text,
            ", mean uncertainty of the measurement {}",
            digits(uncertainty)
        );
    }
    text
}

/// The statistics as JSON, with null for those that do not exist.
fn figures(statistics: Option<ResidualStatistics>) -> Value {
    json!({
        "points": statistics.map_or(0, |figures| figures.points),
        "rmse": statistics.map(|figures| figures.rmse),
        "bias": statistics.map(|figures| figures.bias),
        "mean_simulated_se": statistics.map(|figures| figures.mean_simulated_se),
        "mean_uncertainty": statistics.and_then(|figures| figures.mean_uncertainty),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_figures_keep_their_digits() {
        let figures = ResidualStatistics {
            points: 3,
            rmse: 0.0177,
            bias: -2.5e-7,
            mean_simulated_se: 0.0,
            mean_uncertainty: None,
        };
        assert_eq!(
            statistics_text(&figures),
            "rmse 0.01770, bias -2.50e-7, mean simulated_se 0.00000, points 3"
        );
    }
}
