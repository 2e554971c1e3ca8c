//! Colours, markers, text.
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::engine::Engine;

/// Drawings are made this many times larger than they are shown, since the
/// library rounds to whole pixels.
pub(super) const SCALE: i32 = 2;
pub(super) const INK: RGBColor = RGBColor(40, 40, 40);
pub(super) const GREY: RGBColor = RGBColor(120, 120, 120);
pub(super) const GRID: RGBColor = RGBColor(228, 228, 228);
/// What cannot be resolved.
pub(super) const SHADE: RGBColor = RGBColor(240, 238, 228);

/// Okabe and Ito's palette without black and yellow.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
const SHAPES: [Shape; 6] = [
    Shape::Circle,
    Shape::Square,
    Shape::Triangle,
    Shape::Diamond,
    Shape::Plus,
    Shape::Inverted,
];

/// The area of an SVG drawing.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// What the library says when it fails.
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    Circle,
    Square,
    Triangle,
    Diamond,
    Plus,
    Inverted,
    Star,
}

/// How a series looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Style {
    pub(super) colour: RGBColor,
    shape: Shape,
}

impl Style {
    /// That of series number `i`.
    pub(super) fn numbered(i: usize) -> Self {
        Self {
            colour: COLOURS[i % COLOURS.len()],
            shape: SHAPES[i % SHAPES.len()],
        }
    }

    /// That of an engine, the same in all charts.
    pub(super) fn of(engine: Engine) -> Self {
        let all = Engine::ALL.into_iter();
        Self::numbered(all.take_while(|other| *other != engine).count())
    }

    /// That of the baseline.
    pub(super) const BASELINE: Self = Self {
        colour: RGBColor(0, 0, 0),
        shape: Shape::Star,
    };

    /// Draws the marker at a pixel of `area`.
    pub(super) fn mark(self, area: &Area, (x, y): (i32, i32)) -> Drawn {
        let r = 5 * SCALE;
        let fill = self.colour.filled();
        let polygon = |corners: &[(i32, i32)]| {
            let corners: Vec<_> = corners.iter().map(|(i, j)| (x + i, y + j)).collect();
            area.draw(&Polygon::new(corners, fill))
        };
        match self.shape {
            Shape::Circle => area.draw(&Circle::new((x, y), r, fill)),
            Shape::Square => polygon(&[(-r, -r), (r, -r), (r, r), (-r, r)]),
            Shape::Triangle => polygon(&[(0, -r - 2), (r + 2, r), (-r - 2, r)]),
            Shape::Inverted => polygon(&[(0, r + 2), (r + 2, -r), (-r - 2, -r)]),
            Shape::Diamond => polygon(&[(0, -r - 4), (r + 4, 0), (0, r + 4), (-r - 4, 0)]),
            Shape::Plus => {
                let (a, b) = (r + 2, r / 2 - 1);
                polygon(&[(-a, -b), (a, -b), (a, b), (-a, b)])?;
                polygon(&[(-b, -a), (b, -a), (b, a), (-b, a)])
            }
            Shape::Star => {
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

/// Text of `size` shown pixels.
pub(super) fn font(size: i32, colour: &RGBColor) -> TextStyle<'static> {
    ("sans-serif", size * SCALE).into_font().color(colour)
}

/// Writes at a pixel of `area`, which is the middle of the text's height.
pub(super) fn write(
    area: &Area,
    words: &str,
    at: (i32, i32),
    style: TextStyle,
    across: HPos,
) -> Drawn {
    let style = style.pos(Pos::new(across, VPos::Center));
    area.draw(&Text::new(words.to_owned(), at, style))
}

/// A number as labels show it: 0.001 to 9999 as they are, others with powers of ten.
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
    fn engines_are_told_apart() {
        let styles = Engine::ALL.map(Style::of);
        for (i, style) in styles.iter().enumerate() {
            assert!(!styles[..i].contains(style) && *style != Style::BASELINE);
            assert!(styles[..i].iter().all(|other| other.colour != style.colour));
        }
    }
}
