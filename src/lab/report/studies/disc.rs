//! BRDFs over the hemisphere, drawn as discs seen from above.
use std::f64::consts::FRAC_PI_2;

use plotters::prelude::*;
use plotters::style::colors::colormaps::ViridisRGB;
use plotters::style::text_anchor::HPos;

use super::super::canvas::{Area, DrawResult, Drawing};
use super::super::style::{GREY, INK, SCALE, font, write};
use super::axis::ChartAxis;
use super::{grouped, tick, titled};
use crate::config::study::StudyVariant;
use crate::engine::exits::Exits;
use crate::lab::study::{Brdfs, incidence_deg};

/// Radius of a disc as shown, pixels.
const RADIUS: i32 = 160;
/// Width left and right of a disc.
const MARGIN: i32 = 26;
/// Height above a disc.
const ABOVE: i32 = 58;
/// Height below a disc.
const BELOW: i32 = 52;
/// Width of a colour bar with its labels.
const SCALES: i32 = 110;
/// Width of a colour bar.
const BAR: i32 = 20;
/// Height of the remark at the bottom.
const REMARK: i32 = 30;
/// Number of colour steps of the bar.
const SHADES: i32 = 160;

/// The picture, with a row of discs and a colour scale for each group.
pub(super) fn drawing(studied: &Brdfs<'_>) -> Result<Drawing, String> {
    let variants = studied.variants();
    let groups =
        grouped(variants.map(|(variant, exits)| (variant.group.as_str(), (variant, exits))));
    let most = groups.iter().map(|(_, discs)| discs.len()).max();
    let (cell, row) = (2 * (RADIUS + MARGIN), ABOVE + 2 * RADIUS + BELOW);
    let width = most.unwrap_or(0) as i32 * cell + SCALES;
    let below = groups.len() as i32 * row;
    titled(studied.study, (width, below + REMARK), |area| {
        for ((group, discs), i) in groups.iter().zip(0..) {
            let values = discs.iter().flat_map(|(_, exits)| &exits.reflected);
            let values = values.map(|brdf| brdf.value);
            let axis = if studied.draw.logarithmic {
                ChartAxis::logarithmic(values)
            } else {
                ChartAxis::linear(values, false)
            };
            let top = i * row;
            let middle = discs.len() as i32 * cell / 2;
            let heading = (middle * SCALE, (top + 14) * SCALE);
            write(area, group, heading, font(14, &INK), HPos::Center)?;
            for ((variant, exits), j) in discs.iter().zip(0..) {
                let disc = Disc {
                    area,
                    centre: (
                        (j * cell + RADIUS + MARGIN) * SCALE,
                        (top + ABOVE + RADIUS) * SCALE,
                    ),
                    axis: &axis,
                };
                disc.draw(studied, variant, exits)?;
            }
            let left = discs.len() as i32 * cell + 6;
            color_bar(area, (left * SCALE, (top + ABOVE) * SCALE), &axis)?;
        }
        let remark =
            "○ where light comes from; the angle from the normal grows from the middle to the rim";
        let bottom = (width * SCALE / 2, (below + REMARK / 2) * SCALE);
        write(area, remark, bottom, font(12, &GREY), HPos::Center)
    })
}

/// The colour at a position on the scale, from 0 to 1.
fn colour(share: f64) -> ShapeStyle {
    ViridisRGB::get_color(share).filled()
}

/// Draws the colour bar with its upper left corner at `(x, y)`.
fn color_bar(area: &Area, (x, y): (i32, i32), axis: &ChartAxis) -> DrawResult {
    let height = 2 * RADIUS * SCALE;
    let row = |share: f64| y + height - (share * f64::from(height)).round() as i32;
    for shade in 0..SHADES {
        let share = |shade: i32| f64::from(shade) / f64::from(SHADES);
        let corners = [
            (x, row(share(shade + 1))),
            (x + BAR * SCALE, row(share(shade))),
        ];
        let middle = 0.5 * (share(shade) + share(shade + 1));
        area.draw(&Rectangle::new(corners, colour(middle)))?;
    }
    for value in &axis.ticks {
        let y = row(axis.share(*value));
        let (from, to) = (x + BAR * SCALE, x + (BAR + 5) * SCALE);
        let stroke = INK.stroke_width(SCALE as u32);
        area.draw(&PathElement::new([(from, y), (to, y)], stroke))?;
        let label = (to + 4 * SCALE, y);
        write(area, &tick(*value), label, font(12, &INK), HPos::Left)?;
    }
    write(
        area,
        "BRDF, 1/sr",
        (x, y - 18 * SCALE),
        font(12, &INK),
        HPos::Left,
    )
}

/// A hemisphere seen from above. The distance from the centre is the angle from the normal;
/// azimuth 0, the direction in which the light travels, is on the right.
struct Disc<'a, 'b> {
    area: &'a Area<'b>,
    centre: (i32, i32),
    axis: &'a ChartAxis,
}

impl Disc<'_, '_> {
    /// The pixel of a direction.
    fn pixel(&self, polar_rad: f64, azimuth_rad: f64) -> (i32, i32) {
        let length = f64::from(RADIUS * SCALE) * polar_rad / FRAC_PI_2;
        let (sin, cos) = azimuth_rad.sin_cos();
        let offset = |start: i32, by: f64| (f64::from(start) + by).round() as i32;
        (
            offset(self.centre.0, length * cos),
            offset(self.centre.1, -length * sin),
        )
    }

    /// Draws the disc with its title, axes and the direction of the light.
    fn draw(&self, studied: &Brdfs<'_>, variant: &StudyVariant, exits: &Exits) -> DrawResult {
        let (x, y) = self.centre;
        let radius = RADIUS * SCALE;
        let title = (x, y - radius - 16 * SCALE);
        write(
            self.area,
            &variant.label,
            title,
            font(13, &INK),
            HPos::Center,
        )?;
        // Cells are drawn from the rim inward, each as a sector to the centre that inner cells
        // paint over, so that no gaps remain between them.
        for (sensor, brdf) in exits.reflected.iter().enumerate().rev() {
            let [[_, polar], [from, to]] = studied.sensors.cell_rad(sensor);
            let from = from - 0.01;
            let steps = ((to - from) / 0.1).ceil();
            let arc = (0..=steps as i32).map(|step| {
                let azimuth = from + (to - from) * f64::from(step) / steps;
                self.pixel(polar, azimuth)
            });
            let sector: Vec<_> = [self.centre].into_iter().chain(arc).collect();
            let colour = colour(self.axis.share(brdf.value));
            self.area.draw(&Polygon::new(sector, colour))?;
        }
        let thin = INK.stroke_width(SCALE as u32);
        for degrees in [0, 30, 60, 90] {
            let reach = radius * degrees / 90;
            if degrees > 0 {
                let look = if degrees == 90 {
                    thin
                } else {
                    GREY.stroke_width(SCALE as u32 / 2)
                };
                self.area.draw(&Circle::new(self.centre, reach, look))?;
            }
            let tick = [
                (x + reach, y + radius + 5 * SCALE),
                (x + reach, y + radius + 9 * SCALE),
            ];
            self.area.draw(&PathElement::new(tick, thin))?;
            let label = (x + reach, y + radius + 18 * SCALE);
            write(
                self.area,
                &format!("{degrees}°"),
                label,
                font(11, &INK),
                HPos::Center,
            )?;
        }
        let axis = [x, x + radius].map(|x| (x, y + radius + 5 * SCALE));
        self.area.draw(&PathElement::new(axis, thin))?;
        for (text, x, align) in [
            ("← backward", x - radius, HPos::Left),
            ("forward →", x + radius, HPos::Right),
        ] {
            let label = (x, y + radius + 36 * SCALE);
            write(self.area, text, label, font(12, &GREY), align)?;
        }
        let light = incidence_deg(variant).unwrap_or(0.0).to_radians();
        let source = self.pixel(light, std::f64::consts::PI);
        self.area
            .draw(&Circle::new(source, 6 * SCALE, WHITE.filled()))?;
        self.area.draw(&Circle::new(source, 6 * SCALE, thin))
    }
}
