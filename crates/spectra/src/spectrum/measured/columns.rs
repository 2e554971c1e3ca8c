//! What the columns of a table are: by their names, else by where they stand.
use super::error::{Problem, quoted};
use super::layout::Layout;
use super::report::{By, Format};
use super::{Column, Content, Request, Scale, Unit};

/// Words of a name, in small letters.
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
        || matches!(words(name).as_slice(), [one] if ["nm", "um", "\u{b5}m", "\u{3bc}m", "x"].contains(&one.as_str()))
}

fn is_wavenumber(name: &str) -> bool {
    has_part(name, &["wavenumber", "wave number"])
        || ["cm-1", "cm^-1", "1/cm"].contains(&name.trim().to_lowercase().as_str())
}

fn is_uncertainty(name: &str) -> bool {
    has_part(name, &["uncert", "std", "stderr", "error"])
        || has_word(name, &["se", "sd", "sigma", "u"])
}

/// What a name says that the column is of.
fn content(name: &str) -> Option<Content> {
    let of = |parts: &[&str]| has_part(name, parts);
    match () {
        () if of(&["refl", "albedo", "hdrf", "hcrf", "brf"]) => Some(Content::Reflectance),
        () if of(&["transm"]) => Some(Content::Transmittance),
        () if of(&["spd", "power", "radiance", "intensity"]) => Some(Content::Power),
        () => None,
    }
}

/// The unit that a name or a line such as `X Units: Wavelength (micrometers)` states.
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

/// The scale that a name or a line such as `Y Units: Reflectance (percent)` states.
pub(super) fn scale(text: &str) -> Option<Scale> {
    match () {
        () if has_part(text, &["%", "percent", "0-100", "0 - 100"]) || has_word(text, &["pct"]) => {
            Some(Scale::Percent)
        }
        () if has_part(text, &["[1.0]", "fraction", "0-1", "unitless"]) => Some(Scale::Fraction),
        () => None,
    }
}

/// What is known of a table before its numbers are looked at.
#[derive(Debug)]
pub(super) struct Columns {
    pub(super) wavelength: usize,
    pub(super) value: usize,
    pub(super) uncertainty: Option<usize>,
    pub(super) content: (Content, By),
    pub(super) unit: Option<(Unit, By)>,
    pub(super) scale: Option<(Scale, By)>,
    pub(super) value_by: By,
    /// Further columns that the value could have come from.
    pub(super) others: usize,
}

/// `names` are those of the columns, empty where they have none; `lines` those before
/// the first row.
///
/// # Errors
/// [`Problem::NoColumn`], [`Problem::OtherContent`], [`Problem::Wavenumber`].
pub(super) fn columns(
    names: &[String],
    layout: &Layout,
    format: Format,
    preamble: &[&str],
    request: &Request,
) -> Result<Columns, Problem> {
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
        return Err(Problem::Wavenumber(quoted(name(wavelength))));
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
    let of = |column: usize| content(name(column)).or_else(|| y_units.and_then(content));
    let fits = |column: &usize| match (of(*column), request.content) {
        (Some(found), Some(asked)) => found == asked,
        (Some(found), None) => found != Content::Power,
        (None, _) => false,
    };
    let values: Vec<usize> = rest
        .iter()
        .copied()
        .filter(|column| !is_uncertainty(name(*column)))
        .collect();
    let (value, value_by, others) = match &request.column {
        Some(asked) => (named(asked, names, width)?, By::Asked, 0),
        None => {
            let fitting: Vec<usize> = values.iter().copied().filter(fits).collect();
            let unknown: Vec<usize> = values
                .iter()
                .copied()
                .filter(|c| of(*c).is_none())
                .collect();
            let (from, by) = match fitting.is_empty() {
                false => (fitting, By::Name),
                true => (unknown, By::Place),
            };
            match (from.first(), values.first()) {
                (Some(first), _) => (*first, by, from.len() - 1),
                // Each is something else, which is said below; or all are uncertainties.
                (None, Some(first)) => (*first, by, 0),
                (None, None) => {
                    let column = rest.first().copied();
                    (column.unwrap_or(wavelength + 1), By::Place, 0)
                }
            }
        }
    };
    let content = match (of(value), request.content) {
        (Some(found), Some(asked)) if found != asked && request.column.is_none() => {
            return Err(Problem::OtherContent {
                column: quoted(name(value)),
                found: found.name(),
                asked: asked.name(),
            });
        }
        (_, Some(asked)) => (asked, By::Asked),
        (Some(Content::Power), None) if request.column.is_none() => {
            return Err(Problem::OtherContent {
                column: quoted(name(value)),
                found: Content::Power.name(),
                asked: "reflectance or transmittance",
            });
        }
        (Some(Content::Power) | None, None) => (Content::Reflectance, By::Default),
        (Some(found), None) => (found, By::Name),
    };
    let first_known = |asked: Option<Unit>, stated: Option<Unit>| {
        asked
            .map(|unit| (unit, By::Asked))
            .or(stated.map(|unit| (unit, By::Name)))
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
            Some(asked) => Some((asked, By::Asked)),
            None => scale_of().map(|scale| (scale, By::Name)),
        },
        value_by,
        others,
    })
}

/// The column that is asked for: its name, whatever the case, or part of one name
/// alone, or its number from 1.
fn named(asked: &Column, names: &[String], width: usize) -> Result<usize, Problem> {
    let text = asked.0.trim().to_lowercase();
    let lower: Vec<String> = names.iter().map(|name| name.to_lowercase()).collect();
    if let Some(column) = lower.iter().position(|name| *name == text) {
        return Ok(column);
    }
    let number = text.parse::<usize>().ok();
    if let Some(column) = number.filter(|n| (1..=width).contains(n)) {
        return Ok(column - 1);
    }
    let parts: Vec<usize> = (0..lower.len())
        .filter(|c| !text.is_empty() && number.is_none() && lower[*c].contains(&text))
        .collect();
    match parts[..] {
        [column] => Ok(column),
        _ => Err(Problem::NoColumn {
            asked: quoted(&asked.0),
            names: listed(names, width),
        }),
    }
}

/// `1 Wavelength, 2 S1, 3 S2`, and how many more there are.
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
        assert_eq!(scale("Reflect. [1.0]"), Some(Scale::Fraction));
        assert_eq!(scale("reflectance_pct"), Some(Scale::Percent));
    }
}
