//! Pictures and tables of studies.
mod axis;
mod brdf;
mod disc;
mod polar;
mod spectra;

use std::path::{Path, PathBuf};

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::figure::{self, png};
use super::style::{Area, Drawn, GREY, INK, SCALE, Style, font, number, write};
use super::{ReportError, save};
use crate::config::study::StudyFile;
use crate::lab::study::Studied;

/// Height of the heading of a picture as shown, pixels.
const HEAD: i32 = 66;
/// Height of a line of a legend, and of another of the same entry.
const LINE: i32 = 22;
const NEXT: i32 = 16;
/// Letters of a line of a legend beside a panel.
const LETTERS: usize = 19;
/// Markers on a curve.
const MARKERS: usize = 9;

/// Writes picture (SVG and PNG) and table (CSV) of a study to the folder `dir`, which is
/// made if need be; each file as a whole or not at all. Gives their paths.
///
/// # Errors
/// See [`ReportError`].
pub fn write_study(dir: &Path, studied: &Studied<'_>) -> Result<Vec<PathBuf>, ReportError> {
    let failed = |reason| ReportError::Drawing {
        chart: "the study",
        reason,
    };
    let (study, svg, csv) = match studied {
        Studied::Spectra(of) => (of.study, spectra::svg(of), spectra::csv(of)?),
        Studied::Brdfs(of) => {
            let svg = if of.draw.hemisphere {
                disc::svg(of)
            } else {
                polar::svg(of)
            };
            (of.study, svg, brdf::csv(of)?)
        }
    };
    let svg = svg.map_err(failed)?;
    let picture = png(&svg).map_err(failed)?;
    let file = |extension: &str, bytes| (format!("{}.{extension}", study.name), bytes);
    let files = [("csv", csv), ("svg", svg.into_bytes()), ("png", picture)];
    save(
        dir,
        files
            .map(|(extension, bytes)| file(extension, bytes))
            .into(),
    )
}

/// What stands out of every variant, for people.
#[must_use]
pub fn study_table(studied: &Studied<'_>) -> String {
    match studied {
        Studied::Spectra(of) => spectra::table(of),
        Studied::Brdfs(of) => brdf::table(of),
    }
}

/// The groups of a study in the order they begin, each with its items.
fn grouped<'a, T>(items: impl Iterator<Item = (&'a str, T)>) -> Vec<(&'a str, Vec<T>)> {
    let mut groups: Vec<(&str, Vec<T>)> = Vec::new();
    for (name, item) in items {
        match groups.iter_mut().find(|(other, _)| *other == name) {
            Some((_, group)) => group.push(item),
            None => groups.push((name, vec![item])),
        }
    }
    groups
}

/// A picture `width` wide: title and expectation of `study`, below them what `draw` draws
/// in `height`; all in pixels as shown.
fn sheet(
    study: &StudyFile,
    (width, height): (i32, i32),
    draw: impl FnOnce(&Area) -> Drawn,
) -> Result<String, String> {
    let lines: Vec<String> = wrapped(&study.expected, width as usize / 7).collect();
    let head = HEAD + NEXT * (lines.len() as i32 - 1);
    figure::svg((width, head + height), |area| {
        let (above, below) = area.split_vertically(head * SCALE);
        let middle = width * SCALE / 2;
        let at = (middle, 22 * SCALE);
        write(&above, &study.title, at, font(16, &INK), HPos::Center)?;
        for (line, i) in lines.iter().zip(0..) {
            let at = (middle, (46 + NEXT * i) * SCALE);
            write(&above, line, at, font(12, &GREY), HPos::Center)?;
        }
        draw(&below)
    })
}

/// A legend's entry at `(x, y)` with the marker of `style`, on a line if it is of a curve.
/// Gives where the next begins.
fn entry(
    area: &Area,
    (x, mut y): (i32, i32),
    (style, curve): (Style, bool),
    words: &str,
    letters: usize,
) -> Result<i32, DrawingAreaErrorKind<std::io::Error>> {
    let (from, to) = (x + 6 * SCALE, x + 34 * SCALE);
    if curve {
        let stroke = style.colour.stroke_width(2 * SCALE as u32);
        area.draw(&PathElement::new([(from, y), (to, y)], stroke))?;
    }
    style.mark(area, ((from + to) / 2, y))?;
    for line in wrapped(words, letters) {
        write(area, &line, (to + 8 * SCALE, y), font(12, &INK), HPos::Left)?;
        y += NEXT * SCALE;
    }
    Ok(y + (LINE - NEXT) * SCALE)
}

/// Places on a curve of `points` points where markers go: those of curve `i` of `curves`,
/// so that curves on each other still show all their markers.
fn markers(points: usize, i: usize, curves: usize) -> impl Iterator<Item = usize> {
    let apart = points.div_ceil(MARKERS).max(1);
    (apart * (2 * i + 1) / (2 * curves)..points).step_by(apart)
}

/// What a labelled value of an axis is called.
fn tick(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    number(value)
}

/// Words in lines of at most `letters`, where a word is no longer.
fn wrapped(text: &str, letters: usize) -> impl Iterator<Item = String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let length = |line: &String| line.chars().count();
        let fits = |line: &&mut String| length(line) + 1 + word.chars().count() <= letters;
        match lines
            .last_mut()
            .filter(|line| line.is_empty() || fits(line))
        {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) => {
                line.push(' ');
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_wrapped() {
        let lines = |text, letters| wrapped(text, letters).collect::<Vec<_>>();
        assert_eq!(lines("a bb ccc", 4), ["a bb", "ccc"]);
        assert_eq!(lines("longer than", 3), ["longer", "than"]);
        assert_eq!(lines("", 3), [""]);
    }

    #[test]
    fn groups_keep_their_order() {
        let items = [("b", 1), ("a", 2), ("b", 3)];
        assert_eq!(
            grouped(items.into_iter()),
            [("b", vec![1, 3]), ("a", vec![2])]
        );
    }
}
