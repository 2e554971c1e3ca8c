//! Draws the map and the curves, as SVG.
use std::error::Error;
use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::judge::{Answer, Verdict};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(225, 225, 225);
/// Okabe and Ito's palette, which is safe for colour-blind readers.
pub(crate) const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

fn text(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Draws the map: one row per case and one column per engine. Colour and word give the
/// verdict, the number gives the largest difference from `spectral`.
pub(crate) fn map(path: &Path, rows: &[(String, Vec<Answer>)]) -> Result<()> {
    let (left, top, width, height) = (230, 50, 170, 22);
    let columns = rows.first().map_or(0, |(_, answers)| answers.len());
    let size = (
        left + columns as i32 * width + 20,
        top + rows.len() as i32 * height + 20,
    );
    let root = SVGBackend::new(path, (size.0 as u32, size.1 as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    let middle = Pos::new(HPos::Center, VPos::Center);
    for (row, (name, answers)) in (0..).zip(rows) {
        let y = top + row * height;
        let style = text(14).pos(Pos::new(HPos::Right, VPos::Center));
        root.draw(&Text::new(name.clone(), (left - 10, y + height / 2), style))?;
        for (column, answer) in (0..).zip(answers) {
            let x = left + column * width;
            if row == 0 {
                root.draw(&Text::new(
                    answer.engine.name(),
                    (x + width / 2, top - 18),
                    text(16).pos(middle),
                ))?;
            }
            // from pale to dark, so that the map can be read in greyscale
            let (fill, ink) = match answer.verdict {
                Verdict::Holds => (RGBColor(190, 222, 242), INK),
                Verdict::Refused => (RGBColor(215, 215, 215), INK),
                Verdict::Inexact => (RGBColor(230, 159, 0), INK),
                Verdict::Impossible => (RGBColor(150, 50, 0), WHITE),
            };
            root.draw(&Rectangle::new(
                [(x + 1, y + 1), (x + width - 1, y + height - 1)],
                fill.filled(),
            ))?;
            let number = answer.largest.map_or(String::new(), |d| format!(" {d:.4}"));
            let words = format!("{}{number}", answer.verdict.name());
            root.draw(&Text::new(
                words,
                (x + width / 2, y + height / 2),
                text(13).color(&ink).pos(middle),
            ))?;
        }
    }
    root.present()?;
    Ok(())
}

/// One curve: its name, and x, y and the standard error of y.
pub(crate) struct Curve {
    pub(crate) name: String,
    pub(crate) points: Vec<[f64; 3]>,
}

/// Draws curves of |y| on a logarithmic axis from 1e-5 to 0.1 against x on a logarithmic
/// axis, with bars of two standard errors. `level` is drawn as a horizontal line.
pub(crate) fn curves(
    path: &Path,
    [title, across, up]: [&str; 3],
    curves: &[Curve],
    level: f64,
) -> Result<()> {
    const LOWEST: f64 = 1e-5;
    let xs = || curves.iter().flat_map(|c| c.points.iter().map(|p| p[0]));
    let (low, high) = (xs().fold(f64::INFINITY, f64::min), xs().fold(0.0, f64::max));
    let root = SVGBackend::new(path, (900, 560)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, text(20))
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(70)
        .build_cartesian_2d((low..high).log_scale(), (LOWEST..0.1).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(INK)
        .x_label_formatter(&|x| short(*x))
        .y_label_formatter(&|y| short(*y))
        .label_style(text(14))
        .x_desc(across)
        .y_desc(up)
        .axis_desc_style(text(16))
        .draw()?;
    let line = [(low, level), (high, level)];
    chart.draw_series(LineSeries::new(line, INK.stroke_width(1)))?;
    for (curve, colour) in curves.iter().zip(COLOURS) {
        let bars = curve.points.iter().map(|[x, y, se]| {
            let ends = [y.abs() - 2.0 * se, y.abs() + 2.0 * se].map(|y| (*x, y.max(LOWEST)));
            PathElement::new(ends.to_vec(), colour.mix(0.5))
        });
        chart.draw_series(bars)?;
        let points = || {
            curve
                .points
                .iter()
                .map(|[x, y, _]| (*x, y.abs().max(LOWEST)))
        };
        chart
            .draw_series(LineSeries::new(points(), colour.stroke_width(2)))?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 24, y)], colour.stroke_width(3)));
        // filled circles where the difference is positive, open ones elsewhere
        chart.draw_series(curve.points.iter().map(|[x, y, _]| {
            let style = if *y > 0.0 {
                colour.filled()
            } else {
                colour.stroke_width(1)
            };
            Circle::new((*x, y.abs().max(LOWEST)), 4, style)
        }))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .label_font(text(14))
        .draw()?;
    root.present()?;
    Ok(())
}

fn short(x: f64) -> String {
    if (0.01..10_000.0).contains(&x) {
        format!("{x}")
    } else {
        format!("{x:.0e}")
    }
}
