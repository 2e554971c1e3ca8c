//! BRDFs in the plane of incidence, drawn as half discs above the surface.
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::super::canvas::{Area, DrawResult, Drawing};
use super::super::style::{GREY, GRID, INK, SCALE, Style, font, write};
use super::axis::ChartAxis;
use super::{LINE, draw_entry, grouped, marker_positions, tick, titled};
use crate::lab::study::{Brdfs, incidence_deg};
use crate::measurement::Measured;

/// Radius of a single panel as shown, pixels.
const ALONE: i32 = 300;
/// Radius of each of two panels side by side.
const BESIDE: i32 = 220;
/// Distance of the labels of angles from the rim.
const ANGLES: f64 = 17.0;
/// Distances of the head and the tail of a light arrow from the rim.
const ARROW: [f64; 2] = [34.0, 66.0];
/// Width of the margin outside the rim.
const MARGIN: i32 = 84;
/// Height of a panel's title.
const TITLE: i32 = 34;
/// Height of the text below the surface.
const WORDS: i32 = 62;
/// Largest number of letters in a line of the legend.
const LETTERS: usize = 60;

/// A curve with its name and style, the incidence angle (degrees), and its points: angle from the
/// normal (degrees) and BRDF.
struct Curve<'a> {
    name: &'a str,
    style: Style,
    incidence_deg: f64,
    points: Vec<(f64, Measured)>,
}

/// The picture, with one half disc for each group.
pub(super) fn drawing(studied: &Brdfs<'_>) -> Result<Drawing, String> {
    let mut names: Vec<&str> = Vec::new();
    let curves = studied.variants().map(|(variant, exits)| {
        // A label has the same style in all panels.
        let name = variant.label.as_str();
        let number = names.iter().position(|other| *other == name);
        let number = number.unwrap_or(names.len());
        if number == names.len() {
            names.push(name);
        }
        let curve = Curve {
            name,
            style: Style::numbered(number),
            incidence_deg: incidence_deg(variant).unwrap_or(0.0),
            points: studied.plane(exits),
        };
        (variant.group.as_str(), curve)
    });
    let groups = grouped(curves);
    let (across, down) = (groups.len().min(2), groups.len().div_ceil(2));
    let radius = if across == 1 { ALONE } else { BESIDE };
    // The top margin leaves room for the highest arrow.
    let all_curves = || groups.iter().flat_map(|(_, curves)| curves);
    let arrow = |curve: &Curve| {
        let height = (f64::from(radius) + ARROW[1]) * curve.incidence_deg.to_radians().cos();
        height as i32 + 24 - radius
    };
    let top = TITLE + all_curves().map(arrow).fold(30, i32::max);
    let entries = groups.iter().map(|(_, curves)| curves.len()).max();
    let height = top + radius + WORDS + LINE * (entries.unwrap_or(0) as i32 + 1);
    let size = (across as i32 * 2 * (radius + MARGIN), down as i32 * height);
    titled(studied.study, size, |area| {
        let cells = area.split_evenly((down, across));
        for ((group, curves), cell) in groups.iter().zip(&cells) {
            let values = curves.iter().flat_map(|curve| &curve.points);
            let values = values.map(|(_, brdf)| brdf.value);
            let axis = if studied.draw.logarithmic {
                ChartAxis::logarithmic(values)
            } else {
                ChartAxis::linear(values, true)
            };
            let disc = HalfDisc {
                area: cell,
                centre: ((radius + MARGIN) * SCALE, (top + radius) * SCALE),
                radius: f64::from(radius * SCALE),
                axis,
            };
            disc.draw(group, curves)?;
        }
        Ok(())
    })
}

/// A half disc above the surface.
struct HalfDisc<'a, 'b> {
    area: &'a Area<'b>,
    centre: (i32, i32),
    radius: f64,
    axis: ChartAxis,
}

impl HalfDisc<'_, '_> {
    /// The pixel `length` from the centre, at `degrees` from the normal, positive forward.
    fn pixel(&self, degrees: f64, length: f64) -> (i32, i32) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let offset = |start: i32, by: f64| (f64::from(start) + by).round() as i32;
        let (x, y) = self.centre;
        (offset(x, length * sin), offset(y, -length * cos))
    }

    /// The pixel of `value` at `degrees` from the normal.
    fn value_pixel(&self, degrees: f64, value: f64) -> (i32, i32) {
        self.pixel(degrees, self.radius * self.axis.share(value))
    }

    /// The pixel at `degrees` whose distance from the rim is `beyond` pixels as shown.
    fn beyond(&self, degrees: f64, beyond: f64) -> (i32, i32) {
        self.pixel(degrees, self.radius + beyond * f64::from(SCALE))
    }

    /// Draws grid, light arrows, curves and legend.
    fn draw(&self, title: &str, curves: &[Curve]) -> DrawResult {
        let middle = (self.centre.0, 14 * SCALE);
        write(self.area, title, middle, font(14, &INK), HPos::Center)?;
        self.grid()?;
        self.light(curves)?;
        for (i, curve) in curves.iter().enumerate() {
            let style = curve.style;
            let thin = style.colour.stroke_width(SCALE as u32);
            for (degrees, brdf) in &curve.points {
                let ends = [brdf.value - brdf.se, brdf.value + brdf.se];
                let bar = ends.map(|value| self.value_pixel(*degrees, value));
                self.area.draw(&PathElement::new(bar, thin))?;
            }
            let points = curve.points.iter();
            let path: Vec<_> = points
                .map(|(degrees, f)| self.value_pixel(*degrees, f.value))
                .collect();
            let stroke = style.colour.stroke_width(2 * SCALE as u32);
            self.area.draw(&PathElement::new(path.clone(), stroke))?;
            for position in marker_positions(path.len(), i, curves.len()) {
                style.mark(self.area, path[position])?;
            }
        }
        let left = self.centre.0 - self.radius as i32;
        let mut y = self.centre.1 + WORDS * SCALE;
        for curve in curves {
            let look = (curve.style, true);
            y = draw_entry(self.area, (left, y), look, curve.name, LETTERS)?;
        }
        Ok(())
    }

    /// Draws arcs of equal BRDF, rays of equal angle, the surface, and their labels.
    fn grid(&self) -> DrawResult {
        let thin = |colour: RGBColor| colour.stroke_width(SCALE as u32);
        for value in &self.axis.ticks {
            let is_rim = Some(value) == self.axis.ticks.last();
            let arc = (-45..=45).map(|step| self.value_pixel(f64::from(2 * step), *value));
            let look = thin(if is_rim { GREY } else { GRID });
            self.area
                .draw(&PathElement::new(arc.collect::<Vec<_>>(), look))?;
            let (x, y) = self.value_pixel(90.0, *value);
            let below = (x, y + 13 * SCALE);
            write(
                self.area,
                &tick(*value),
                below,
                font(11, &INK),
                HPos::Center,
            )?;
        }
        for degrees in (-90..=90).step_by(30).map(f64::from) {
            let ray = [self.centre, self.pixel(degrees, self.radius)];
            self.area.draw(&PathElement::new(ray, thin(GRID)))?;
            let text = format!("{}°", degrees.abs());
            let outside = self.beyond(degrees, ANGLES);
            write(self.area, &text, outside, font(12, &INK), HPos::Center)?;
        }
        let surface = [-90.0, 90.0].map(|degrees| self.pixel(degrees, self.radius));
        self.area.draw(&PathElement::new(surface, thin(INK)))?;
        let (x, y) = self.centre;
        let radius = self.radius as i32;
        for (text, pixel, align) in [
            ("BRDF, 1/sr", (x - radius / 2, y + 13 * SCALE), HPos::Center),
            ("← backward", (x - radius, y + 34 * SCALE), HPos::Left),
            ("snow", (x, y + 34 * SCALE), HPos::Center),
            ("forward →", (x + radius, y + 34 * SCALE), HPos::Right),
        ] {
            write(self.area, text, pixel, font(12, &GREY), align)?;
        }
        Ok(())
    }

    /// Draws arrows along the incident light: one per incidence angle, in the colour of its
    /// curve if there are several angles.
    fn light(&self, curves: &[Curve]) -> DrawResult {
        let angles = curves.iter().map(|curve| curve.incidence_deg);
        let angles: Vec<f64> = angles.collect();
        let same = angles.iter().all(|angle| *angle == angles[0]);
        for (i, angle) in angles.iter().enumerate() {
            if angles[..i].contains(angle) {
                continue;
            }
            let colour = if same { INK } else { curves[i].style.colour };
            let pixel = |beyond: f64| self.beyond(-angle, beyond);
            let (head, neck, tail) = (pixel(ARROW[0]), pixel(ARROW[0] + 10.0), pixel(ARROW[1]));
            let stroke = colour.stroke_width(2 * SCALE as u32);
            self.area.draw(&PathElement::new([tail, neck], stroke))?;
            let (dx, dy) = ((neck.0 - head.0) / 2, (neck.1 - head.1) / 2);
            let corners = [head, (neck.0 - dy, neck.1 + dx), (neck.0 + dy, neck.1 - dx)];
            self.area
                .draw(&Polygon::new(corners.to_vec(), colour.filled()))?;
            let above = (tail.0, tail.1 - 9 * SCALE);
            write(self.area, "light", above, font(12, &colour), HPos::Center)?;
        }
        Ok(())
    }
}
