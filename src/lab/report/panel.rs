//! A chart with two logarithmic axes.
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, DrawResult};
use super::style::{GREY, GRID, INK, SCALE, SHADE, Style, font, number, write};

/// Points that share a style.
#[derive(Debug, Clone)]
pub(super) struct Series {
    pub(super) style: Style,
    /// Coordinates (x, y); points that are not finite and above 0 are left out.
    pub(super) points: Vec<(f64, f64)>,
    /// Whether a line joins the points in this order.
    pub(super) joined: bool,
}

/// The contents of a chart.
#[derive(Debug, Clone, Default)]
pub(super) struct Panel {
    /// Title above the chart.
    pub(super) title: String,
    /// Label of the horizontal axis.
    pub(super) x: String,
    /// Label of the vertical axis.
    pub(super) y: String,
    pub(super) series: Vec<Series>,
    /// Points of the Pareto front, joined by a dashed line.
    pub(super) front: Vec<(f64, f64)>,
    /// Errors below this value are shaded.
    pub(super) floor: Option<f64>,
    /// Texts at points; a text that does not fit is left out.
    pub(super) labels: Vec<((f64, f64), String)>,
}

/// Coordinates of a pixel.
type Pixel = (i32, i32);

/// Whether a point can be drawn on logarithmic axes.
fn drawable(&(x, y): &(f64, f64)) -> bool {
    x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()
}

/// A range around `values` with a margin on both sides, of at least a decade.
fn range(values: impl Iterator<Item = f64> + Clone) -> std::ops::Range<f64> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(0.0, f64::max);
    if low > high {
        return 0.1..1.0;
    }
    let missing = (10.0 * low / high).max(1.0).sqrt();
    let room = (high / low).powf(0.06).max(1.3);
    low / missing / room..high * missing * room
}

/// Positions of the labels on an axis over `range`: 1, 2, 5 of each decade for fewer than three
/// decades, else powers of ten, about eight in all.
fn ticks(range: &std::ops::Range<f64>) -> Vec<f64> {
    let (first, last) = (range.start.log10().floor(), range.end.log10().ceil());
    let decades = (range.end / range.start).log10();
    let (digits, step): (&[f64], f64) = match decades {
        ..3.0 => (&[1.0, 2.0, 5.0], 1.0),
        _ => (&[1.0], (decades / 8.0).ceil()),
    };
    let count = ((last - first) / step) as i32 + 1;
    (0..count)
        .flat_map(|i| {
            let decade = 10_f64.powf(first + step * f64::from(i));
            digits.iter().map(move |digit| digit * decade)
        })
        .filter(|tick| range.contains(tick))
        .collect()
}

impl Panel {
    /// Draws the chart on the whole of `area`.
    pub(super) fn draw(&self, area: &Area) -> DrawResult {
        let drawn_points = || {
            let points = self.series.iter().flat_map(|series| &series.points);
            points.copied().filter(drawable)
        };
        let floor = self.floor.filter(|floor| *floor > 0.0);
        let (xs, ys) = (
            range(drawn_points().map(|(x, _)| x)),
            range(drawn_points().map(|(_, y)| y).chain(floor)),
        );
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, font(15, &INK))
            .margin(8 * SCALE)
            .margin_right(18 * SCALE)
            .x_label_area_size(44 * SCALE)
            .y_label_area_size(60 * SCALE)
            .build_cartesian_2d(
                xs.clone().log_scale().with_key_points(ticks(&xs)),
                ys.clone().log_scale().with_key_points(ticks(&ys)),
            )?;
        // Converts the library's coordinates to pixels of `area`.
        let base = area.get_base_pixel();
        let relative = |(x, y): Pixel| (x - base.0, y - base.1);
        let corner = relative(chart.backend_coord(&(xs.start, ys.start)));
        let end = relative(chart.backend_coord(&(xs.end, ys.end)));
        if let Some(floor) = floor {
            let top = relative(chart.backend_coord(&(xs.start, floor)));
            area.draw(&Rectangle::new([top, (end.0, corner.1)], SHADE.filled()))?;
        }
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(SCALE as u32))
            .axis_style(INK.stroke_width(SCALE as u32))
            .x_label_formatter(&|x| number(*x))
            .y_label_formatter(&|y| number(*y))
            .label_style(font(12, &INK))
            .set_all_tick_mark_size(4 * SCALE)
            .x_desc(&self.x)
            .y_desc(&self.y)
            .axis_desc_style(font(13, &INK))
            .draw()?;
        let pixel = |point: &(f64, f64)| relative(chart.backend_coord(point));
        let mut taken: Vec<(Pixel, Pixel)> = Vec::new();
        if let Some(floor) = floor {
            let (left, right) = (pixel(&(xs.start, floor)), pixel(&(xs.end, floor)));
            area.draw(&PathElement::new(
                [left, right],
                GREY.stroke_width(SCALE as u32),
            ))?;
        }
        if self.front.len() > 1 {
            let path: Vec<_> = self
                .front
                .iter()
                .filter(|p| drawable(p))
                .map(pixel)
                .collect();
            let style = INK.stroke_width(SCALE as u32);
            area.draw(&DashedPathElement::new(path, 6 * SCALE, 4 * SCALE, style))?;
        }
        for series in &self.series {
            let points = series.points.iter().filter(|point| drawable(point));
            let points: Vec<Pixel> = points.map(pixel).collect();
            if series.joined {
                let stroke = series.style.colour.stroke_width(2 * SCALE as u32);
                area.draw(&PathElement::new(points.clone(), stroke))?;
            }
            for &point in &points {
                series.style.mark(area, point)?;
                taken.push(around(point, 6 * SCALE, 6 * SCALE));
            }
        }
        for (point, text) in self.labels.iter().filter(|(point, _)| drawable(point)) {
            let point = pixel(point);
            if let Some((start, align, box_)) = place(point, text, (corner, end), &taken) {
                write(area, text, start, font(11, &INK), align)?;
                taken.push(box_);
            }
        }
        Ok(())
    }
}

/// The box that extends by `dx` and `dy` from a pixel.
fn around((x, y): Pixel, dx: i32, dy: i32) -> (Pixel, Pixel) {
    ((x - dx, y - dy), (x + dx, y + dy))
}

/// The position of `text` beside `point`: right, left, above or below it, inside the axes from
/// `corner` to `end`, without overlap with the boxes in `taken`. Returns the pixel, the
/// alignment and the box of the text; `None` if the text does not fit.
fn place(
    point: Pixel,
    text: &str,
    (corner, end): (Pixel, Pixel),
    taken: &[(Pixel, Pixel)],
) -> Option<(Pixel, HPos, (Pixel, Pixel))> {
    let (half, gap) = (7 * SCALE, 10 * SCALE);
    // Digits of DejaVu Sans are 0.64 of the font size wide.
    let width = text.chars().count() as i32 * 7 * SCALE;
    let (x, y) = point;
    let candidates = [
        ((x + gap, y), HPos::Left, x + gap),
        ((x - gap, y), HPos::Right, x - gap - width),
        ((x, y - gap - half / 2), HPos::Center, x - width / 2),
        ((x, y + gap + half / 2), HPos::Center, x - width / 2),
        ((x + gap, y - gap), HPos::Left, x + gap),
        ((x - gap, y + gap), HPos::Right, x - gap - width),
    ];
    candidates.into_iter().find_map(|(pixel, align, left)| {
        let (low, high) = ((left, pixel.1 - half), (left + width, pixel.1 + half));
        let inside = low.0 > corner.0 && high.0 < end.0 && low.1 > end.1 && high.1 < corner.1;
        let free = taken
            .iter()
            .all(|(a, b)| high.0 < a.0 || low.0 > b.0 || high.1 < a.1 || low.1 > b.1);
        (inside && free).then_some((pixel, align, (low, high)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_contain_their_values() {
        let holds = |values: &[f64]| {
            let found = range(values.iter().copied());
            assert!(found.end / found.start >= 10.0, "{found:?}");
            assert!(values.iter().all(|value| found.contains(value)));
        };
        holds(&[]);
        holds(&[1.0]);
        holds(&[1e-3, 5e3]);
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(ticks(&(0.9..25.0)), [1.0, 2.0, 5.0, 10.0, 20.0]);
        let wide = ticks(&(3e-12..2e4));
        assert!((4..=9).contains(&wide.len()), "{wide:?}");
        let power = |tick: &f64| (tick.log10() - tick.log10().round()).abs() < 1e-12;
        assert!(wide.iter().all(power), "{wide:?}");
    }

    #[test]
    fn labels_keep_off_each_other_and_the_axes() {
        let axes = ((0, 1000), (1000, 0));
        let point = (500, 500);
        let (_, _, first) = place(point, "4096", axes, &[]).unwrap_or_default();
        let second = place(point, "4096", axes, &[first]);
        assert!(second.is_some_and(|(_, _, second)| second.1.0 <= first.0.0));
        assert!(place(point, "4096", axes, &[(axes.0, axes.1)]).is_some());
        assert!(place(point, "4096", axes, &[((0, 0), (1000, 1000))]).is_none());
        assert!(place(point, &"long".repeat(100), axes, &[]).is_none());
    }
}
