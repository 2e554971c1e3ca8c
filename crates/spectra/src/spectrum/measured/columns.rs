//! Identifies the columns of a table by their names, else by their position.
use super::error::{ReadProblem, quoted};
use super::layout::TextLayout;
use super::report::{Format, KnownFrom};
use super::{Column, Content, ReadOptions, Unit, ValueScale};

/// Words of a name, in lower case.
fn words(name: &str) -> Vec<String> {
    let name = name.to_lowercase();
    let words = name.split(|c: char| !c.is_alphanumeric());
    words
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn has_word(name: &str, any: &[&str]) -> bool {
    words(name).iter().any(|word| any.contains(&word.as_str()))
}

fn has_part(name: &str, any: &[&str]) -> bool {
    let name = name.to_lowercase();
    any.iter().any(|part| name.contains(part))
}

pub(super) fn is_wavelength(name: &str) -> bool {
    has_part(name, &["wavel", "lambda"])
        || has_word(name, &["wvl", "wl", "wave", "waves", "\u{3bb}"])
        || matches!(words(name).as_slice(), [word] if ["nm", "um", "\u{b5}m", "\u{3bc}m", "x"].contains(&word.as_str()))
}

fn is_wavenumber(name: &str) -> bool {
    has_part(name, &["wavenumber", "wave number"])
        || ["cm-1", "cm^-1", "1/cm"].contains(&name.trim().to_lowercase().as_str())
}

pub(super) fn is_uncertainty(name: &str) -> bool {
    has_part(name, &["uncert", "std", "stderr", "error"])
        || has_word(name, &["se", "sd", "sigma", "u"])
}

/// Whether the name says that a column is neither reflectance nor transmittance, nor power.
fn is_other(name: &str) -> bool {
    has_part(name, &["absorb", "absorp", "emiss", "extinction"])
}

/// The content of a column according to its name.
fn content(name: &str) -> Option<Content> {
    let has = |parts: &[&str]| has_part(name, parts);
    match () {
        () if has(&["refl", "albedo", "hdrf", "hcrf", "brf"]) => Some(Content::Reflectance),
        () if has(&["transm"]) => Some(Content::Transmittance),
        () if has(&["spd", "power", "radiance", "intensity"]) => Some(Content::Power),
        () => None,
    }
}

/// The unit stated by a name or by a line such as `X Units: Wavelength (micrometers)`.
pub(super) fn unit(text: &str) -> Option<Unit> {
    match () {
        () if has_part(text, &["nanom"]) || has_word(text, &["nm"]) => Some(Unit::Nm),
        () if has_part(text, &["microm", "micron"])
            || has_word(text, &["um", "\u{b5}m", "\u{3bc}m"]) =>
        {
            Some(Unit::Um)
        }
        () => None,
    }
}

/// The scale stated by a name or by a line such as `Y Units: Reflectance (percent)`.
pub(super) fn scale(text: &str) -> Option<ValueScale> {
    match () {
        () if has_part(text, &["%", "percent", "0-100", "0 - 100"]) || has_word(text, &["pct"]) => {
            Some(ValueScale::Percent)
        }
        () if has_part(text, &["[1.0]", "fraction", "0-1", "unitless"]) => {
            Some(ValueScale::Fraction)
        }
        () => None,
    }
}

/// The columns of a table, their content and units, as known before the numbers are read.
/// Columns are indices from 0.
#[derive(Debug)]
pub(super) struct Columns {
    pub(super) wavelength: usize,
    pub(super) value: usize,
    pub(super) uncertainty: Option<usize>,
    pub(super) content: (Content, KnownFrom),
    pub(super) unit: Option<(Unit, KnownFrom)>,
    pub(super) scale: Option<(ValueScale, KnownFrom)>,
    pub(super) value_by: KnownFrom,
    /// Number of further columns that could be the value.
    pub(super) others: usize,
}

/// Identifies the columns. `names` are the names of the columns, empty where they have none;
/// `preamble` is the lines before the first row.
///
/// # Errors
/// [`ReadProblem::NoColumn`] if the requested column does not exist, [`ReadProblem::OtherContent`] if
/// the column has another quantity than requested, [`ReadProblem::Wavenumber`] if the table has
/// wavenumbers instead of wavelengths, [`ReadProblem::NeitherQuantity`] if the only column is named
/// after another quantity.
pub(super) fn columns(
    names: &[String],
    layout: &TextLayout,
    format: Format,
    preamble: &[&str],
    request: &ReadOptions,
) -> Result<Columns, ReadProblem> {
    let name = |column: usize| names.get(column).map_or("", String::as_str);
    let width = layout.numeric.len().max(names.len());
    let numeric = |column: &usize| {
        layout
            .numeric
            .get(*column)
            .is_some_and(|share| *share > 0.5)
    };
    let wavelength = (0..width).find(|c| numeric(c) && is_wavelength(name(*c)));
    let wavelength = wavelength.or_else(|| (0..width).find(numeric)).unwrap_or(0);
    if is_wavenumber(name(wavelength)) {
        return Err(ReadProblem::Wavenumber(quoted(name(wavelength))));
    }
    let rest: Vec<usize> = (0..width)
        .filter(|c| *c != wavelength && numeric(c) && !is_wavenumber(name(*c)))
        .collect();

    let metadata = |key: &str| {
        let line = preamble.iter().find(|line| {
            let start = line.trim_start().get(..key.len());
            start.is_some_and(|start| start.eq_ignore_ascii_case(key))
        });
        line.copied().filter(|_| format == Format::Ecostress)
    };
    let (x_units, y_units) = (metadata("X Units:"), metadata("Y Units:"));
    let content_of = |column: usize| content(name(column)).or_else(|| y_units.and_then(content));
    let fits = |column: &usize| match (content_of(*column), request.content) {
        (Some(found), Some(requested)) => found == requested,
        (Some(found), None) => found != Content::Power,
        (None, _) => false,
    };
    let values: Vec<usize> = rest
        .iter()
        .copied()
        .filter(|column| !is_uncertainty(name(*column)) && !is_other(name(*column)))
        .collect();
    let (value, value_by, others) = match &request.column {
        Some(requested) => (find_column(requested, names, width)?, KnownFrom::Asked, 0),
        None => {
            let fitting: Vec<usize> = values.iter().copied().filter(fits).collect();
            let unknown: Vec<usize> = values
                .iter()
                .copied()
                .filter(|c| content_of(*c).is_none())
                .collect();
            let (candidates, by) = match fitting.is_empty() {
                false => (fitting, KnownFrom::Name),
                true => (unknown, KnownFrom::Place),
            };
            match (candidates.first(), values.first()) {
                (Some(first), _) => (*first, by, candidates.len() - 1),
                // Every column is another quantity (an error below), or an uncertainty.
                (None, Some(first)) => (*first, by, 0),
                (None, None) => {
                    let column = rest.first().copied();
                    (column.unwrap_or(wavelength + 1), KnownFrom::Place, 0)
                }
            }
        }
    };
    let content = match (content_of(value), request.content) {
        (Some(found), Some(requested)) if found != requested && request.column.is_none() => {
            return Err(ReadProblem::OtherContent {
                column: quoted(name(value)),
                found: found.name(),
                requested: requested.name(),
            });
        }
        (_, Some(requested)) => (requested, KnownFrom::Asked),
        (Some(Content::Power), None) if request.column.is_none() => {
            return Err(ReadProblem::OtherContent {
                column: quoted(name(value)),
                found: Content::Power.name(),
                requested: "reflectance or transmittance",
            });
        }
        (None, None) if is_other(name(value)) => {
            return Err(ReadProblem::NeitherQuantity(quoted(name(value))));
        }
        (Some(Content::Power) | None, None) => (Content::Reflectance, KnownFrom::Default),
        (Some(found), None) => (found, KnownFrom::Name),
    };
    let first_known = |requested: Option<Unit>, stated: Option<Unit>| {
        requested
            .map(|unit| (unit, KnownFrom::Asked))
            .or(stated.map(|unit| (unit, KnownFrom::Name)))
    };
    let scale_of = || scale(name(value)).or_else(|| y_units.and_then(scale));
    let uncertain: Vec<usize> = rest
        .iter()
        .copied()
        .filter(|column| *column != value && is_uncertainty(name(*column)))
        .collect();
    let next = uncertain.iter().find(|column| **column == value + 1);
    Ok(Columns {
        wavelength,
        value,
        uncertainty: match (next, &uncertain[..]) {
            (Some(next), _) => Some(*next),
            (None, [only]) => Some(*only),
            _ => None,
        },
        content,
        unit: first_known(
            request.unit,
            unit(name(wavelength)).or_else(|| x_units.and_then(unit)),
        ),
        scale: match request.scale {
            Some(requested) => Some((requested, KnownFrom::Asked)),
            None => scale_of().map(|scale| (scale, KnownFrom::Name)),
        },
        value_by,
        others,
    })
}

/// The index of the requested column, given by its name (in any case), by a part of exactly
/// one name, or by its number from 1; `#2` is a number even if a column has the name `2`.
fn find_column(requested: &Column, names: &[String], width: usize) -> Result<usize, ReadProblem> {
    let text = requested.0.trim().to_lowercase();
    let lower: Vec<String> = names.iter().map(|name| name.to_lowercase()).collect();
    if let Some(column) = lower.iter().position(|name| *name == text) {
        return Ok(column);
    }
    let number = text.strip_prefix('#').unwrap_or(&text);
    let number = number.parse::<usize>().ok();
    if let Some(column) = number.filter(|n| (1..=width).contains(n)) {
        return Ok(column - 1);
    }
    let parts: Vec<usize> = (0..lower.len())
        .filter(|c| !text.is_empty() && number.is_none() && lower[*c].contains(&text))
        .collect();
    match parts[..] {
        [column] => Ok(column),
        _ => Err(ReadProblem::NoColumn {
            requested: quoted(&requested.0),
            names: listed(names, width),
        }),
    }
}

/// `1 Wavelength, 2 S1, 3 S2`, and the number of further columns.
fn listed(names: &[String], width: usize) -> String {
    const SHOWN: usize = 12;
    let name = |column: usize| match names.get(column) {
        Some(name) if !name.is_empty() => format!("{} `{}`", column + 1, quoted(name)),
        _ => (column + 1).to_string(),
    };
    let shown: Vec<String> = (0..width.min(SHOWN)).map(name).collect();
    match width.checked_sub(SHOWN) {
        None | Some(0) => shown.join(", "),
        Some(more) => format!("{} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_columns_are() {
        for name in ["wavelength_nm", "Wvl", "WL (um)", "nm", "lambda", "\u{3bb}"] {
            assert!(is_wavelength(name), "{name}");
        }
        assert!(!is_wavelength("Norm. DN (Ref.)") && !is_wavelength("13_7_S1"));
        assert_eq!(content("Reflect. %"), Some(Content::Reflectance));
        assert_eq!(content("Norm. DN (Ref.)"), None);
        assert_eq!(content("Transmission"), Some(Content::Transmittance));
        assert!(is_uncertainty("reflectance_se") && !is_uncertainty("sensor"));
        assert_eq!(unit("Wavelength (\u{b5}m)"), Some(Unit::Um));
        assert_eq!(unit("wavelength_nm"), Some(Unit::Nm));
        assert_eq!(unit("spectrum"), None);
        assert_eq!(scale("Reflect. [1.0]"), Some(ValueScale::Fraction));
        assert_eq!(scale("reflectance_pct"), Some(ValueScale::Percent));
    }
}
