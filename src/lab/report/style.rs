//! Colours, markers and text.
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::canvas::{Area, DrawResult};
use crate::engine::Engine;

/// Factor by which drawings are larger than their size as shown, because the library rounds to
/// whole pixels, and so that edges in PNG files are smooth.
pub(super) const SCALE: i32 = 4;
/// Colour of text, axes and dark lines.
pub(super) const INK: RGBColor = RGBColor(40, 40, 40);
/// Colour of secondary text and lines.
pub(super) const GREY: RGBColor = RGBColor(120, 120, 120);
/// Colour of grid lines.
pub(super) const GRID: RGBColor = RGBColor(228, 228, 228);
/// Colour of ranges that cannot be resolved or are not counted.
pub(super) const SHADE: RGBColor = RGBColor(240, 238, 228);

/// Colours of the series: Okabe and Ito's palette without black and yellow.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
/// Markers of the series.
const MARKERS: [Marker; 6] = [
    Marker::Circle,
    Marker::Square,
    Marker::Triangle,
    Marker::Diamond,
    Marker::Plus,
    Marker::Inverted,
];

/// The shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    Plus,
    Inverted,
    Star,
}

/// The look of a series: colour and marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Style {
    pub(super) colour: RGBColor,
    marker: Marker,
}

impl Style {
    /// The style of series number `i`.
    pub(super) fn numbered(i: usize) -> Self {
        Self {
            colour: COLOURS[i % COLOURS.len()],
            marker: MARKERS[i % MARKERS.len()],
        }
    }

    /// The style of an engine, the same in all charts.
    pub(super) fn of(engine: Engine) -> Self {
        let engines = Engine::ALL.into_iter();
        Self::numbered(engines.take_while(|other| *other != engine).count())
    }

    /// The style of the baseline.
    pub(super) const BASELINE: Self = Self {
        colour: RGBColor(0, 0, 0),
        marker: Marker::Star,
    };

    /// Draws the marker at a pixel of `area`.
    pub(super) fn mark(self, area: &Area, (x, y): (i32, i32)) -> DrawResult {
        // radius, and what corners reach beyond it
        let (r, e) = (5 * SCALE, SCALE);
        let fill = self.colour.filled();
        let polygon = |corners: &[(i32, i32)]| {
            let corners: Vec<_> = corners.iter().map(|(i, j)| (x + i, y + j)).collect();
            area.draw(&Polygon::new(corners, fill))
        };
        match self.marker {
            Marker::Circle => area.draw(&Circle::new((x, y), r, fill)),
            Marker::Square => polygon(&[(-r, -r), (r, -r), (r, r), (-r, r)]),
            Marker::Triangle => polygon(&[(0, -r - e), (r + e, r), (-r - e, r)]),
            Marker::Inverted => polygon(&[(0, r + e), (r + e, -r), (-r - e, -r)]),
            Marker::Diamond => polygon(&[
                (0, -r - 2 * e),
                (r + 2 * e, 0),
                (0, r + 2 * e),
                (-r - 2 * e, 0),
            ]),
            Marker::Plus => {
                let (a, b) = (r + e, (r - e) / 2);
                polygon(&[(-a, -b), (a, -b), (a, b), (-a, b)])?;
                polygon(&[(-b, -a), (b, -a), (b, a), (-b, a)])
            }
            Marker::Star => {
                let corner = |i: i32| {
                    let length = f64::from(if i % 2 == 0 { 2 * r } else { r * 4 / 5 });
                    let angle = f64::from(i) * std::f64::consts::PI / 5.0;
                    let (sin, cos) = angle.sin_cos();
                    ((length * sin) as i32, (-length * cos) as i32)
                };
                polygon(&(0..10).map(corner).collect::<Vec<_>>())
            }
        }
    }
}

/// The font for text of `size` pixels as shown.
pub(super) fn font(size: i32, colour: &RGBColor) -> TextStyle<'static> {
    ("sans-serif", size * SCALE).into_font().color(colour)
}

/// Writes `text` at a pixel of `area`, vertically centred and horizontally aligned by `align`.
pub(super) fn write(
    area: &Area,
    text: &str,
    pixel: (i32, i32),
    style: TextStyle,
    align: HPos,
) -> DrawResult {
    let style = style.pos(Pos::new(align, VPos::Center));
    area.draw(&Text::new(text.to_owned(), pixel, style))
}

/// A number as text for labels: 0.001 to 9999 as a decimal, others with a power of ten.
pub(super) fn number(value: f64) -> String {
    if (1e-3..1e4).contains(&value) {
        return format!("{}", (value * 1e6).round() / 1e6);
    }
    let exponent = value.log10().floor() as i32;
    let mut digits = (value / 10_f64.powi(exponent) * 10.0).round() / 10.0;
    let mut exponent = exponent;
    if digits >= 10.0 {
        (digits, exponent) = (1.0, exponent + 1);
    }
    let raised: String = exponent
        .to_string()
        .chars()
        .map(|c| match c.to_digit(10) {
            Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
            None => '⁻',
        })
        .collect();
    if digits == 1.0 {
        format!("10{raised}")
    } else {
        format!("{digits}·10{raised}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_labels() {
        let texts = [1.0, 0.01, 0.005, 2e-5, 1e4, 31.0, 1e-12, 2.3, 9.99e-4].map(number);
        let expected = [
            "1",
            "0.01",
            "0.005",
            "2·10⁻⁵",
            "10⁴",
            "31",
            "10⁻¹²",
            "2.3",
            "10⁻³",
        ];
        assert_eq!(texts, expected);
    }

    #[test]
    fn engines_have_different_styles() {
        let styles = Engine::ALL.map(Style::of);
        for (i, style) in styles.iter().enumerate() {
            assert!(!styles[..i].contains(style) && *style != Style::BASELINE);
            assert!(styles[..i].iter().all(|other| other.colour != style.colour));
        }
    }
}
