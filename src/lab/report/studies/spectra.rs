//! Spectra over wavelength, and means over thickness.
use std::fmt::Write;
use std::ops::Range;

use plotters::prelude::*;

use super::super::ReportError;
use super::super::canvas::{Area, DrawResult, Drawing};
use super::super::figure::{Figure, Symbol};
use super::super::panel::{Panel, Series};
use super::super::residuals::axis_end;
use super::super::style::{GRID, INK, SCALE, Style, font};
use super::{LETTERS, draw_entry, grouped, marker_positions, titled, wrapped};
use crate::comparison::Band;
use crate::config::study::Published;
use crate::lab::study::{Spectra, mean};
use crate::measurement::Measured;

/// Width of a picture as shown, pixels.
const WIDTH: i32 = 900;
/// Height of a row of panels; each panel has its legend beside it.
const ROW: i32 = 330;

/// The label of a curve, and its points.
type Curve<'a> = (&'a str, Vec<(f64, f64)>);

/// The picture of a study.
pub(super) fn drawing(studied: &Spectra<'_>) -> Result<Drawing, String> {
    if studied.is_spectral() {
        curves(studied)
    } else {
        thicknesses(studied).drawing()
    }
}

/// Mean visible values against thickness on logarithmic axes, a line for each group.
fn thicknesses(studied: &Spectra<'_>) -> Figure {
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
            y: format!("{}, mean over 400-700 nm", studied.draw.quantity.name()),
            series,
            ..Panel::default()
        }],
        legend,
    }
}

/// Spectra, with a panel for each group.
fn curves(studied: &Spectra<'_>) -> Result<Drawing, String> {
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
    titled(studied.study, (width, down * row), |area| {
        let cells = area.split_evenly((down as usize, across as usize));
        for ((group, curves), cell) in groups.iter().zip(&cells) {
            panel(cell, studied, group, curves)?;
        }
        Ok(())
    })
}

/// Draws curves over wavelength and their legend.
fn panel(area: &Area, studied: &Spectra<'_>, title: &str, curves: &[Curve<'_>]) -> DrawResult {
    let (study, draw) = (studied.study, studied.draw);
    let points = || curves.iter().flat_map(|(_, points)| points.iter().copied());
    let marks = published(&study.published);
    let marked = study.published.iter();
    let top = marked.flat_map(|p| [p.value, p.range.map_or(p.value, |[_, max]| max)]);
    let highest = points().map(|(_, y)| y).chain(top).fold(0.0, f64::max);
    let ys = draw.from..axis_end(highest).max(draw.from + 0.01);
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
        .set_all_tick_mark_size(4 * SCALE)
        .x_desc("wavelength, nm")
        .y_desc(draw.quantity.name())
        .axis_desc_style(font(13, &INK))
        .draw()?;
    let base = plot.get_base_pixel();
    let pixel = |(nm, y): (f64, f64)| {
        let (x, y) = chart.backend_coord(&(nm, y.clamp(ys.start, ys.end)));
        (x - base.0, y - base.1)
    };
    for (i, (_, points)) in curves.iter().enumerate() {
        let style = Style::numbered(i);
        let path: Vec<_> = points.iter().copied().map(pixel).collect();
        let stroke = style.colour.stroke_width(2 * SCALE as u32);
        plot.draw(&PathElement::new(path.clone(), stroke))?;
        for position in marker_positions(path.len(), i, curves.len()) {
            style.mark(&plot, path[position])?;
        }
    }
    for (style, values) in &marks {
        for p in values {
            if let Some(ends) = p.range {
                let bar = ends.map(|y| pixel((p.wavelength_nm, y)));
                plot.draw(&PathElement::new(
                    bar.to_vec(),
                    style.colour.stroke_width(SCALE as u32),
                ))?;
            }
            style.mark(&plot, pixel((p.wavelength_nm, p.value)))?;
        }
    }
    let names = curves.iter().enumerate();
    let names = names.map(|(i, (label, _))| (Style::numbered(i), *label));
    let published_names = marks
        .iter()
        .filter_map(|(style, values)| Some((*style, values.first()?.label.as_str())));
    let mut y = if title.is_empty() { 16 } else { 40 } * SCALE;
    for (i, (style, name)) in names.chain(published_names).enumerate() {
        y = draw_entry(&legend, (0, y), (style, i < curves.len()), name, LETTERS)?;
    }
    Ok(())
}

/// Published values by label, each label with its style.
fn published(values: &[Published]) -> Vec<(Style, Vec<&Published>)> {
    let labelled = values.iter().map(|value| (value.label.as_str(), value));
    let groups = grouped(labelled).into_iter().enumerate();
    let looks = groups.map(|(i, (_, group))| {
        let style = match i {
            0 => Style::BASELINE,
            i => Style::numbered(i),
        };
        (style, group)
    });
    looks.collect()
}

/// The drawn values as CSV (docs/formats.md).
pub(super) fn csv(studied: &Spectra<'_>) -> Result<Vec<u8>, ReportError> {
    let quantity = studied.draw.quantity.name();
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

/// Means over bands for every variant, as text.
pub(super) fn table(studied: &Spectra<'_>) -> String {
    let study = studied.study;
    let mut out = format!("{}: mean {}\n", study.title, studied.draw.quantity.name());
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
