//! BRDFs in the plane of incidence, as half discs on the surface.
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::super::style::{Area, Drawn, GREY, GRID, INK, SCALE, Style, font, write};
use super::axis::Axis;
use super::{LINE, entry, grouped, markers, sheet, tick};
use crate::lab::study::{Brdfs, incidence_deg};
use crate::measurement::Measured;

/// Radius of the only panel, and of two beside each other, as shown, pixels.
const ALONE: i32 = 300;
const BESIDE: i32 = 220;
/// Beyond the rim: where angles are written, where arrows of light end and begin, and
/// where panels end.
const ANGLES: f64 = 17.0;
const ARROW: [f64; 2] = [34.0, 66.0];
const MARGIN: i32 = 84;
/// Heights of a panel's title, and of the words below the surface.
const TITLE: i32 = 34;
const WORDS: i32 = 62;
/// Letters of a line of the legend.
const LETTERS: usize = 60;

/// A curve: its name and look, the light's angle from the normal, and its points; degrees.
struct Curve<'a> {
    name: &'a str,
    style: Style,
    incidence_deg: f64,
    points: Vec<(f64, Measured)>,
}

/// Half discs, one for each group.
pub(super) fn svg(studied: &Brdfs<'_>) -> Result<String, String> {
    let mut names: Vec<&str> = Vec::new();
    let curves = studied.variants().map(|(variant, exits)| {
        // the same look in all panels
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
    // room for the highest arrow
    let all = || groups.iter().flat_map(|(_, curves)| curves);
    let arrow = |curve: &Curve| {
        let height = (f64::from(radius) + ARROW[1]) * curve.incidence_deg.to_radians().cos();
        height as i32 + 24 - radius
    };
    let top = TITLE + all().map(arrow).fold(30, i32::max);
    let entries = groups.iter().map(|(_, curves)| curves.len()).max();
    let height = top + radius + WORDS + LINE * (entries.unwrap_or(0) as i32 + 1);
    let size = (across as i32 * 2 * (radius + MARGIN), down as i32 * height);
    sheet(studied.study, size, |area| {
        let cells = area.split_evenly((down, across));
        for ((group, curves), cell) in groups.iter().zip(&cells) {
            let values = curves.iter().flat_map(|curve| &curve.points);
            let values = values.map(|(_, brdf)| brdf.value);
            let axis = if studied.draw.logarithmic {
                Axis::logarithmic(values)
            } else {
                Axis::linear(values, true)
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

/// The half of a disc above the surface.
struct HalfDisc<'a, 'b> {
    area: &'a Area<'b>,
    centre: (i32, i32),
    radius: f64,
    axis: Axis,
}

impl HalfDisc<'_, '_> {
    /// The pixel `length` from the centre, at `degrees` from the normal, positive forward.
    fn pixel(&self, degrees: f64, length: f64) -> (i32, i32) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let place = |at: i32, by: f64| (f64::from(at) + by).round() as i32;
        let (x, y) = self.centre;
        (place(x, length * sin), place(y, -length * cos))
    }

    /// The pixel of a value.
    fn at(&self, degrees: f64, value: f64) -> (i32, i32) {
        self.pixel(degrees, self.radius * self.axis.share(value))
    }

    /// The pixel `beyond` the rim, in pixels as shown.
    fn beyond(&self, degrees: f64, beyond: f64) -> (i32, i32) {
        self.pixel(degrees, self.radius + beyond * f64::from(SCALE))
    }

    fn draw(&self, title: &str, curves: &[Curve]) -> Drawn {
        let middle = (self.centre.0, 14 * SCALE);
        write(self.area, title, middle, font(14, &INK), HPos::Center)?;
        self.grid()?;
        self.light(curves)?;
        for (i, curve) in curves.iter().enumerate() {
            let style = curve.style;
            let thin = style.colour.stroke_width(SCALE as u32);
            for (degrees, brdf) in &curve.points {
                let ends = [brdf.value - brdf.se, brdf.value + brdf.se];
                let bar = ends.map(|value| self.at(*degrees, value));
                self.area.draw(&PathElement::new(bar, thin))?;
            }
            let points = curve.points.iter();
            let path: Vec<_> = points
                .map(|(degrees, f)| self.at(*degrees, f.value))
                .collect();
            let stroke = style.colour.stroke_width(2 * SCALE as u32);
            self.area.draw(&PathElement::new(path.clone(), stroke))?;
            for place in markers(path.len(), i, curves.len()) {
                style.mark(self.area, path[place])?;
            }
        }
        let left = self.centre.0 - self.radius as i32;
        let mut y = self.centre.1 + WORDS * SCALE;
        for curve in curves {
            let look = (curve.style, true);
            y = entry(self.area, (left, y), look, curve.name, LETTERS)?;
        }
        Ok(())
    }

    /// Arcs of equal BRDF, rays of equal angle, the surface, and their labels.
    fn grid(&self) -> Drawn {
        let thin = |colour: RGBColor| colour.stroke_width(SCALE as u32);
        for value in &self.axis.ticks {
            let is_rim = Some(value) == self.axis.ticks.last();
            let arc = (-45..=45).map(|step| self.at(f64::from(2 * step), *value));
            let look = thin(if is_rim { GREY } else { GRID });
            self.area
                .draw(&PathElement::new(arc.collect::<Vec<_>>(), look))?;
            let (x, y) = self.at(90.0, *value);
            let at = (x, y + 13 * SCALE);
            write(self.area, &tick(*value), at, font(11, &INK), HPos::Center)?;
        }
        for degrees in (-90..=90).step_by(30).map(f64::from) {
            let ray = [self.centre, self.pixel(degrees, self.radius)];
            self.area.draw(&PathElement::new(ray, thin(GRID)))?;
            let words = format!("{}°", degrees.abs());
            let at = self.beyond(degrees, ANGLES);
            write(self.area, &words, at, font(12, &INK), HPos::Center)?;
        }
        let surface = [-90.0, 90.0].map(|degrees| self.pixel(degrees, self.radius));
        self.area.draw(&PathElement::new(surface, thin(INK)))?;
        let (x, y) = self.centre;
        let radius = self.radius as i32;
        for (words, at, across) in [
            ("BRDF, 1/sr", (x - radius / 2, y + 13 * SCALE), HPos::Center),
            ("← backward", (x - radius, y + 34 * SCALE), HPos::Left),
            ("snow", (x, y + 34 * SCALE), HPos::Center),
            ("forward →", (x + radius, y + 34 * SCALE), HPos::Right),
        ] {
            write(self.area, words, at, font(12, &GREY), across)?;
        }
        Ok(())
    }

    /// Arrows from where light comes: in the colour of their curve, if there are several.
    fn light(&self, curves: &[Curve]) -> Drawn {
        let angles = curves.iter().map(|curve| curve.incidence_deg);
        let angles: Vec<f64> = angles.collect();
        let same = angles.iter().all(|angle| *angle == angles[0]);
        for (i, angle) in angles.iter().enumerate() {
            if angles[..i].contains(angle) {
                continue;
            }
            let colour = if same { INK } else { curves[i].style.colour };
            let at = |beyond: f64| self.beyond(-angle, beyond);
            let (head, neck, tail) = (at(ARROW[0]), at(ARROW[0] + 10.0), at(ARROW[1]));
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
