//! Pictures and tables of studies.
use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::figure::{self, Figure, Symbol, png};
use super::panel::{Panel, Series};
use super::residuals::above;
use super::style::{Area, Drawn, GREY, GRID, INK, SCALE, Style, font, write};
use super::{ReportError, save};
use crate::comparison::Band;
use crate::config::study::Published;
use crate::measurement::Measured;
use crate::study::{Studied, mean};

/// Size of a picture as shown, pixels: heading, a row of panels, the legend beside each.
const WIDTH: i32 = 900;
const HEAD: i32 = 66;
const ROW: i32 = 330;
const LINE: i32 = 22;
/// Letters of a line of the legend.
const LETTERS: usize = 19;
/// Markers on a curve.
const MARKERS: usize = 9;

/// The name of a curve, and its points.
type Curve<'a> = (&'a str, Vec<(f64, f64)>);

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
    let svg = if studied.is_spectral() {
        spectra(studied)
    } else {
        thicknesses(studied).svg()
    };
    let svg = svg.map_err(failed)?;
    let picture = png(&svg).map_err(failed)?;
    let file = |extension: &str, bytes| (format!("{}.{extension}", studied.study.name), bytes);
    let files = [
        ("csv", csv(studied)?),
        ("svg", svg.into_bytes()),
        ("png", picture),
    ];
    save(
        dir,
        files
            .map(|(extension, bytes)| file(extension, bytes))
            .into(),
    )
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

/// Mean visible values against thickness on logarithmic axes, a line for each group.
fn thicknesses(studied: &Studied<'_>) -> Figure {
    let points = studied.against_thickness();
    let points = points.iter().map(|(variant, thickness_m, mean)| {
        (variant.group.as_str(), (thickness_m * 100.0, mean.value))
    });
    let mut legend = Vec::new();
    let mut series = Vec::new();
    for (i, (group, points)) in grouped(points).into_iter().enumerate() {
        let style = Style::numbered(i);
        legend.push((Symbol::Series(style), group.to_owned()));
        series.push(Series {
            style,
            points,
            joined: true,
        });
    }
    legend.extend(wrapped(&studied.study.expected, 66).map(|line| (Symbol::None, line)));
    Figure {
        panels: vec![Panel {
            title: studied.study.title.clone(),
            x: "thickness, cm".into(),
            y: format!("{}, mean over 400-700 nm", studied.study.quantity.name()),
            series,
            ..Panel::default()
        }],
        legend,
    }
}

/// Spectra, a panel for each group.
fn spectra(studied: &Studied<'_>) -> Result<String, String> {
    let curves = studied.curves().map(|(variant, nm, values)| {
        let points = nm.iter().zip(values).map(|(nm, m)| (*nm, m.value));
        let curve = (variant.label.as_str(), points.collect::<Vec<_>>());
        (variant.group.as_str(), curve)
    });
    let groups = grouped(curves);
    let across = groups.len().min(2) as i32;
    let down = groups.len().div_ceil(2) as i32;
    let row = if across == 1 { ROW + 70 } else { ROW };
    // Two panels beside each other need room for two legends.
    let width = if across == 1 { WIDTH } else { WIDTH * 5 / 4 };
    let lines: Vec<String> = wrapped(&studied.study.expected, width as usize / 7).collect();
    let head = HEAD + 16 * (lines.len() as i32 - 1);
    figure::svg((width, head + down * row), |area| {
        let (above, below) = area.split_vertically(head * SCALE);
        let middle = width * SCALE / 2;
        let title = &studied.study.title;
        write(
            &above,
            title,
            (middle, 22 * SCALE),
            font(16, &INK),
            HPos::Center,
        )?;
        for (line, i) in lines.iter().zip(0..) {
            let at = (middle, (46 + 16 * i) * SCALE);
            write(&above, line, at, font(12, &GREY), HPos::Center)?;
        }
        let cells = below.split_evenly((down as usize, across as usize));
        for ((group, curves), cell) in groups.iter().zip(&cells) {
            panel(cell, studied, group, curves)?;
        }
        Ok(())
    })
}

/// Curves over wavelength, and their legend.
fn panel(area: &Area, studied: &Studied<'_>, title: &str, curves: &[Curve<'_>]) -> Drawn {
    let study = studied.study;
    let points = || curves.iter().flat_map(|(_, points)| points.iter().copied());
    let marks = published(&study.published);
    let marked = study.published.iter();
    let top = marked.flat_map(|p| [p.value, p.range.map_or(p.value, |[_, max]| max)]);
    let highest = points().map(|(_, y)| y).chain(top).fold(0.0, f64::max);
    let ys = study.from..above(highest).max(study.from + 0.01);
    let xs = points().fold(f64::INFINITY..f64::NEG_INFINITY, |range, (x, _)| Range {
        start: range.start.min(x),
        end: range.end.max(x),
    });
    let width = area.dim_in_pixel().0 as i32;
    let labels = curves.iter().map(|(label, _)| *label);
    let labels = labels.chain(study.published.iter().map(|p| p.label.as_str()));
    let longest = labels.map(|label| label.chars().count().min(LETTERS)).max();
    let legend = 56 + 7 * longest.unwrap_or(0) as i32;
    let (plot, legend) = area.split_horizontally(width - legend * SCALE);
    let mut chart = ChartBuilder::on(&plot)
        .caption(title, font(14, &INK))
        .margin(6 * SCALE)
        .x_label_area_size(38 * SCALE)
        .y_label_area_size(58 * SCALE)
        .build_cartesian_2d(xs, ys.clone())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID.stroke_width(SCALE as u32))
        .axis_style(INK.stroke_width(SCALE as u32))
        .x_labels(8)
        .y_labels(8)
        .x_label_formatter(&|nm| format!("{nm}"))
        .y_label_formatter(&|y| format!("{}", (y * 1e6).round() / 1e6))
        .label_style(font(12, &INK))
        .x_desc("wavelength, nm")
        .y_desc(study.quantity.name())
        .axis_desc_style(font(13, &INK))
        .draw()?;
    let base = plot.get_base_pixel();
    let at = |(nm, y): (f64, f64)| {
        let (x, y) = chart.backend_coord(&(nm, y.clamp(ys.start, ys.end)));
        (x - base.0, y - base.1)
    };
    for (i, (_, points)) in curves.iter().enumerate() {
        let style = Style::numbered(i);
        let path: Vec<_> = points.iter().copied().map(at).collect();
        let stroke = style.colour.stroke_width(2 * SCALE as u32);
        plot.draw(&PathElement::new(path.clone(), stroke))?;
        let apart = path.len().div_ceil(MARKERS).max(1);
        // curves on each other still show all their markers
        let first = apart * (2 * i + 1) / (2 * curves.len());
        for &pixel in path.iter().skip(first).step_by(apart) {
            style.mark(&plot, pixel)?;
        }
    }
    for (style, of) in &marks {
        for p in of {
            if let Some(ends) = p.range {
                let bar = ends.map(|y| at((p.wavelength_nm, y)));
                plot.draw(&PathElement::new(
                    bar.to_vec(),
                    style.colour.stroke_width(2),
                ))?;
            }
            style.mark(&plot, at((p.wavelength_nm, p.value)))?;
        }
    }
    let names = curves.iter().enumerate();
    let names = names.map(|(i, (label, _))| (Style::numbered(i), *label));
    let named = marks
        .iter()
        .filter_map(|(style, of)| Some((*style, of.first()?.label.as_str())));
    let mut y = if title.is_empty() { 16 } else { 40 } * SCALE;
    for (i, (style, words)) in names.chain(named).enumerate() {
        let (from, to) = (6 * SCALE, 34 * SCALE);
        if i < curves.len() {
            let stroke = style.colour.stroke_width(2 * SCALE as u32);
            legend.draw(&PathElement::new([(from, y), (to, y)], stroke))?;
        }
        style.mark(&legend, ((from + to) / 2, y))?;
        for line in wrapped(words, LETTERS) {
            let place = (to + 8 * SCALE, y);
            write(&legend, &line, place, font(12, &INK), HPos::Left)?;
            y += 16 * SCALE;
        }
        y += (LINE - 16) * SCALE;
    }
    Ok(())
}

/// Published values by label, each with its look.
fn published(values: &[Published]) -> Vec<(Style, Vec<&Published>)> {
    let all = values.iter().map(|value| (value.label.as_str(), value));
    let groups = grouped(all).into_iter().enumerate();
    let looks = groups.map(|(i, (_, group))| {
        let style = match i {
            0 => Style::BASELINE,
            i => Style::numbered(i),
        };
        (style, group)
    });
    looks.collect()
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

/// What is drawn as CSV (docs/formats.md).
fn csv(studied: &Studied<'_>) -> Result<Vec<u8>, ReportError> {
    let quantity = studied.study.quantity.name();
    let axis = if studied.is_spectral() {
        "wavelength_nm"
    } else {
        "thickness_cm"
    };
    let mut out = ::csv::Writer::from_writer(Vec::new());
    out.write_record([
        "group",
        "variant",
        axis,
        quantity,
        &format!("{quantity}_se"),
    ])?;
    let mut row = |group: &str, label: &str, x: f64, m: Measured| {
        let (x, value, se) = (
            format!("{x}"),
            format!("{:.6}", m.value),
            format!("{:.1e}", m.se),
        );
        out.write_record([group, label, &x, &value, &se])
    };
    if studied.is_spectral() {
        for (variant, nm, values) in studied.curves() {
            for (nm, value) in nm.iter().zip(values) {
                row(&variant.group, &variant.label, *nm, *value)?;
            }
        }
    } else {
        for (variant, thickness_m, mean) in studied.against_thickness() {
            let cm = (thickness_m * 1e8).round() / 1e6;
            row(&variant.group, &variant.label, cm, mean)?;
        }
    }
    let bytes = out.into_inner().map_err(|error| error.into_error());
    Ok(bytes.map_err(::csv::Error::from)?)
}

/// Means over bands of every variant, for people.
#[must_use]
pub fn study_table(studied: &Studied<'_>) -> String {
    let study = studied.study;
    let mut out = format!("{}: mean {}\n", study.title, study.quantity.name());
    for (variant, nm, values) in studied.curves() {
        let name = format!("{} {}", variant.group, variant.label);
        let _ = write!(out, "  {:<34}", name.trim());
        for band in [Band::Visible, Band::IrA, Band::IrB] {
            if let Some(mean) = mean(nm, values, |nm| band.holds(nm)) {
                let name = band.name();
                let _ = write!(out, " {name} {:.4} ({:.4})", mean.value, mean.se);
            }
        }
        out.push('\n');
    }
    out
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
