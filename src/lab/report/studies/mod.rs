//! Pictures and tables of studies.
mod axis;
mod brdf;
mod disc;
mod polar;
mod spectra;

use std::path::{Path, PathBuf};

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, DrawResult, Drawing};
use super::style::{GREY, INK, SCALE, Style, font, number, write};
use super::{ReportError, save};
use crate::config::study::StudyFile;
use crate::lab::study::Studied;

/// Height of the heading of a picture as shown, pixels.
const HEAD: i32 = 66;
/// Height of the first line of a legend entry.
const LINE: i32 = 22;
/// Height of each further line of the entry.
const NEXT: i32 = 16;
/// Largest number of letters in a line of a legend beside a panel.
const LETTERS: usize = 19;
/// Approximate number of markers on a curve.
const MARKERS: usize = 9;

/// Writes picture (SVG and PNG) and table (CSV) of a study to the folder `dir`, which is
/// created if it does not exist. Each file is written atomically. Returns the paths.
///
/// # Errors
/// [`ReportError`] if the picture cannot be drawn or a file cannot be written.
pub fn write_study(dir: &Path, studied: &Studied<'_>) -> Result<Vec<PathBuf>, ReportError> {
    let failed = |reason| ReportError::Drawing {
        chart: "the study",
        reason,
    };
    let (study, drawing, csv) = match studied {
        Studied::Spectra(spectra) => (
            spectra.study,
            spectra::drawing(spectra),
            spectra::csv(spectra)?,
        ),
        Studied::Brdfs(brdfs) => {
            let drawing = if brdfs.draw.hemisphere {
                disc::drawing(brdfs)
            } else {
                polar::drawing(brdfs)
            };
            (brdfs.study, drawing, brdf::csv(brdfs)?)
        }
    };
    let drawing = drawing.map_err(failed)?;
    let file = |extension: &str, bytes| (format!("{}.{extension}", study.name), bytes);
    let files = [
        ("csv", csv),
        ("svg", drawing.svg.into_bytes()),
        ("png", drawing.png),
    ];
    save(
        dir,
        files
            .map(|(extension, bytes)| file(extension, bytes))
            .into(),
    )
}

/// The main results of every variant, as text.
#[must_use]
pub fn study_table(studied: &Studied<'_>) -> String {
    match studied {
        Studied::Spectra(spectra) => spectra::table(spectra),
        Studied::Brdfs(brdfs) => brdf::table(brdfs),
    }
}

/// The items by group, with the groups in the order in which they first occur.
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

/// A picture with the title and the expected result of `study`, above a drawing of this width
/// and height (pixels as shown).
fn titled(
    study: &StudyFile,
    (width, height): (i32, i32),
    draw: impl Fn(&Area) -> DrawResult,
) -> Result<Drawing, String> {
    let lines: Vec<String> = wrapped(&study.expected, width as usize / 7).collect();
    let head = HEAD + NEXT * (lines.len() as i32 - 1);
    Drawing::new((width, head + height), |area| {
        let (above, below) = area.split_vertically(head * SCALE);
        let middle = width * SCALE / 2;
        let title = (middle, 22 * SCALE);
        write(&above, &study.title, title, font(16, &INK), HPos::Center)?;
        for (line, i) in lines.iter().zip(0..) {
            let start = (middle, (46 + NEXT * i) * SCALE);
            write(&above, line, start, font(12, &GREY), HPos::Center)?;
        }
        draw(&below)
    })
}

/// Draws a legend entry at `(x, y)`: the marker of `style`, on a line if the entry is for a
/// curve, and `text` in lines of at most `letters`. Returns the `y` of the next entry.
fn draw_entry(
    area: &Area,
    (x, mut y): (i32, i32),
    (style, is_curve): (Style, bool),
    text: &str,
    letters: usize,
) -> DrawResult<i32> {
    let (from, to) = (x + 6 * SCALE, x + 34 * SCALE);
    if is_curve {
        let stroke = style.colour.stroke_width(2 * SCALE as u32);
        area.draw(&PathElement::new([(from, y), (to, y)], stroke))?;
    }
    style.mark(area, ((from + to) / 2, y))?;
    for line in wrapped(text, letters) {
        write(area, &line, (to + 8 * SCALE, y), font(12, &INK), HPos::Left)?;
        y += NEXT * SCALE;
    }
    Ok(y + (LINE - NEXT) * SCALE)
}

/// Indices of the points with markers on curve number `i` of `curves`, which has `points`
/// points. The markers of different curves are offset, so that they remain visible on curves
/// that coincide.
fn marker_positions(points: usize, i: usize, curves: usize) -> impl Iterator<Item = usize> {
    let apart = points.div_ceil(MARKERS).max(1);
    (apart * (2 * i + 1) / (2 * curves)..points).step_by(apart)
}

/// The label of a value on an axis.
fn tick(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    number(value)
}

/// `text` in lines of at most `letters`, except for longer words.
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
