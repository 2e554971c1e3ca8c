//! Chart of a simulated and a measured spectrum with their difference.
use std::ops::Range;
use std::path::Path;

use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::ReportError;
use super::canvas::{self, Area, DrawResult};
use super::style::{GREY, GRID, INK, SCALE, SHADE, Style, font, write};
use crate::atomic;
use crate::comparison::{Comparison, GOOD_RMSE, MeasuredSpectrum, ResidualPoint, listed};

/// Width as shown, pixels.
const WIDTH: i32 = 900;
/// Height of the title with the legend.
const HEAD: i32 = 78;
/// Height of the upper panel, with both spectra.
const UPPER: i32 = 380;
/// Height of the lower panel, with the difference.
const LOWER: i32 = 230;
/// Largest number of points that are marked individually.
const FEW: usize = 60;

/// The format of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Picture {
    /// Scalable vector graphics.
    Svg,
    /// PNG, pixels.
    Png,
}

impl Picture {
    /// The format for the extension of `path`; `None` for an unknown extension.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        match () {
            () if extension.eq_ignore_ascii_case("svg") => Some(Self::Svg),
            () if extension.eq_ignore_ascii_case("png") => Some(Self::Png),
            () => None,
        }
    }

    /// Writes what `draw` draws at this size (width and height as shown, pixels) atomically: as PNG
    /// if `path` ends with .png, else as SVG. `chart` names it in errors.
    pub(super) fn write(
        path: &Path,
        chart: &'static str,
        size: (i32, i32),
        draw: impl Fn(&Area) -> DrawResult,
    ) -> Result<(), ReportError> {
        let bytes = match Self::of(path) {
            Some(Self::Png) => canvas::png(size, draw),
            _ => canvas::svg(size, draw).map(String::into_bytes),
        };
        let bytes = bytes.map_err(|reason| ReportError::Drawing { chart, reason })?;
        atomic::write(path, &bytes).map_err(|source| ReportError::Io {
            path: path.to_owned(),
            source,
        })
    }
}

/// The chart of a comparison.
#[derive(Debug, Clone, Copy)]
pub struct Residuals<'a> {
    /// The measured spectrum.
    pub measured: &'a MeasuredSpectrum,
    /// The comparison with the simulation.
    pub comparison: &'a Comparison,
}

/// The value of a point that a panel draws.
type PointValue<'f> = &'f dyn Fn(&ResidualPoint) -> f64;

impl Residuals<'_> {
    /// Writes the chart atomically: as PNG if `path` ends with .png, else as SVG.
    ///
    /// # Errors
    /// [`ReportError`] if the chart cannot be drawn or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let size = (WIDTH, HEAD + UPPER + LOWER);
        Picture::write(path, "the comparison", size, |area| self.draw(area))
    }

    /// Draws the title, the legend and both panels.
    fn draw(&self, area: &Area) -> DrawResult {
        let (head, rest) = area.split_vertically(HEAD * SCALE);
        let (upper, lower) = rest.split_vertically(UPPER * SCALE);
        let (simulated, measured) = (Style::numbered(0), Style::numbered(1));
        self.head(&head, simulated, measured)?;
        let value: PointValue = &|point| point.matched.value;
        let counted = || {
            self.comparison
                .points
                .iter()
                .filter(|p| !p.matched.excluded)
        };
        let values = counted().flat_map(|p| [p.matched.value, p.simulated.value]);
        let ys = values.clone().fold(0.0, f64::min)..axis_end(values.fold(0.0, f64::max));
        let curves = [
            (measured, value),
            (simulated, &|p: &ResidualPoint| p.simulated.value),
        ];
        self.panel(&upper, self.measured.quantity().name(), ys, &curves, &[])?;
        let largest = counted().fold(GOOD_RMSE, |most, p| most.max(p.residual().abs()));
        let ys = -1.1 * largest..1.1 * largest;
        let limits = [-GOOD_RMSE, GOOD_RMSE];
        let residual: PointValue = &ResidualPoint::residual;
        let label = "simulated - measured";
        self.panel(&lower, label, ys, &[(simulated, residual)], &limits)
    }

    /// Draws the title and the legend.
    fn head(&self, area: &Area, simulated: Style, measured: Style) -> DrawResult {
        let quantity = self.measured.quantity().name();
        let title = match self.comparison.overall() {
            Some(overall) => format!(
                "Simulated and measured {quantity}: RMSE {:.4}, mean difference {:+.4}, {} wavelengths",
                overall.rmse, overall.bias, overall.points
            ),
            None => format!("Simulated and measured {quantity}"),
        };
        let middle = WIDTH * SCALE / 2;
        write(
            area,
            &title,
            (middle, 24 * SCALE),
            font(15, &INK),
            HPos::Center,
        )?;
        let y = 56 * SCALE;
        let entry = |x: i32| ((x * SCALE, y), ((x + 30) * SCALE, y));
        let write_text = |x: i32, text: &str| {
            write(
                area,
                text,
                ((x + 38) * SCALE, y),
                font(12, &INK),
                HPos::Left,
            )
        };
        for (x, style, name) in [(74, simulated, "simulated"), (194, measured, "measured")] {
            let (from, to) = entry(x);
            area.draw(&PathElement::new(
                [from, to],
                style.colour.stroke_width(2 * SCALE as u32),
            ))?;
            write_text(x, name)?;
        }
        let (from, to) = entry(314);
        dashed(area, [from, to])?;
        write_text(314, &format!("± {GOOD_RMSE}"))?;
        let exclusions = self.measured.exclusions();
        if !exclusions.is_empty() {
            let ((left, _), (right, _)) = entry(424);
            let swatch = [(left, y - 7 * SCALE), (right, y + 7 * SCALE)];
            area.draw(&Rectangle::new(swatch, SHADE.filled()))?;
            let mut bands = listed(exclusions);
            if bands.chars().count() > 40 {
                bands = format!("{} bands", exclusions.len());
            }
            write_text(424, &format!("not counted: {bands} nm"))?;
        }
        Ok(())
    }

    /// Draws curves over wavelength in the range `ys`, and dashed lines at `limits`.
    fn panel(
        &self,
        area: &Area,
        label: &str,
        ys: Range<f64>,
        curves: &[(Style, PointValue)],
        limits: &[f64],
    ) -> DrawResult {
        let points = &self.comparison.points;
        let nm = |point: Option<&ResidualPoint>| point.map_or(0.0, |point| point.matched.nm);
        let xs = nm(points.first())..nm(points.last());
        let mut chart = ChartBuilder::on(area)
            .margin(4 * SCALE)
            .margin_right(22 * SCALE)
            .x_label_area_size(40 * SCALE)
            .y_label_area_size(66 * SCALE)
            .build_cartesian_2d(xs.clone(), ys.clone())?;
        for band in self.measured.exclusions() {
            let (from, to) = (band.from_nm.max(xs.start), band.to_nm.min(xs.end));
            if from < to {
                let corners = [(from, ys.start), (to, ys.end)];
                chart.draw_series([Rectangle::new(corners, SHADE.filled())])?;
            }
        }
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(SCALE as u32))
            .axis_style(INK.stroke_width(SCALE as u32))
            .x_label_formatter(&|nm| format!("{}", (nm * 1e3).round() / 1e3))
            .label_style(font(12, &INK))
            .set_all_tick_mark_size(4 * SCALE)
            .x_desc("wavelength, nm")
            .y_desc(label)
            .axis_desc_style(font(13, &INK))
            .draw()?;
        // Pixels of `area`. Values beyond the axis are noise in excluded bands and are clamped.
        let base = area.get_base_pixel();
        let pixel = |(nm, y): (f64, f64)| {
            let (x, y) = chart.backend_coord(&(nm, y.clamp(ys.start, ys.end)));
            (x - base.0, y - base.1)
        };
        for &y in limits {
            dashed(area, [pixel((xs.start, y)), pixel((xs.end, y))])?;
        }
        for &(style, value) in curves {
            let path = |points: &[ResidualPoint]| -> Vec<_> {
                let pairs = points.iter().map(|point| (point.matched.nm, value(point)));
                pairs.map(pixel).collect()
            };
            let line = |points: &[ResidualPoint], width: i32| {
                let stroke = style.colour.stroke_width((width * SCALE) as u32);
                area.draw(&PathElement::new(path(points), stroke))
            };
            // Lines are interrupted at wavelengths without a measured value.
            for joined in points.chunk_by(|a, b| b.matched.index == a.matched.index + 1) {
                line(joined, 1)?;
                for part in joined.chunk_by(|a, b| a.matched.excluded == b.matched.excluded) {
                    if part.iter().all(|point| !point.matched.excluded) {
                        line(part, 2)?;
                    }
                }
                if points.len() <= FEW || joined.len() == 1 {
                    for marker in path(joined) {
                        style.mark(area, marker)?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Draws a dashed line.
fn dashed(area: &Area, ends: [(i32, i32); 2]) -> DrawResult {
    let (dash, gap, style) = (6 * SCALE, 4 * SCALE, GREY.stroke_width(SCALE as u32));
    area.draw(&DashedPathElement::new(ends, dash, gap, style))
}

/// The end of an axis that starts at 0 and contains `value`: 1, 2, 5 or 10 times a power of
/// ten, at most 1; 1.2 for values above 1.
pub(super) fn axis_end(value: f64) -> f64 {
    if value > 1.0 {
        return 1.2;
    }
    let decade = 10_f64.powf(value.max(1e-12).log10().floor());
    let ends = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * decade);
    ends.into_iter().find(|end| *end >= value).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_above_their_values() {
        let cases = [
            (0.98, 1.0),
            (1.0, 1.0),
            (1.07, 1.2),
            (0.3, 0.5),
            (0.011, 0.02),
            (0.0, 1e-12),
        ];
        for (value, end) in cases {
            assert!((axis_end(value) / end - 1.0).abs() < 1e-9, "{value}");
        }
    }

    #[test]
    fn formats_by_extension() {
        let kind = |name: &str| Picture::of(Path::new(name));
        assert_eq!(kind("a/b.svg"), Some(Picture::Svg));
        assert_eq!(kind("b.PNG"), Some(Picture::Png));
        assert_eq!([kind("b.pdf"), kind("svg"), kind(".png")], [None; 3]);
    }
}
