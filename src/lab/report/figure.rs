//! Figures: panels side by side with one legend.
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{Area, DrawResult, Drawing};
use super::panel::Panel;
use super::style::{GREY, INK, SCALE, SHADE, Style, font, write};

/// Width of a figure as shown, pixels.
const WIDTH: i32 = 1200;
/// Height of a row of panels as shown, pixels.
const ROW: i32 = 440;
/// Height of a line of the legend as shown, pixels.
const LINE: i32 = 24;

/// The symbol at the beginning of a line of the legend.
#[derive(Debug, Clone, Copy)]
pub(super) enum Symbol {
    /// The marker of a series.
    Series(Style),
    /// The dashed line.
    Front,
    /// The shaded range.
    Floor,
    /// No symbol; the line is a remark.
    None,
}

/// Panels in two columns. The legend follows the last panel, or has its own row if the columns
/// are full.
#[derive(Debug)]
pub(super) struct Figure {
    pub(super) panels: Vec<Panel>,
    pub(super) legend: Vec<(Symbol, String)>,
}

impl Figure {
    /// The drawing of the figure.
    pub(super) fn drawing(&self) -> Result<Drawing, String> {
        let rows = self.panels.len().div_ceil(2) as i32;
        let has_free_cell = self.panels.len() % 2 == 1;
        let legend_height = if has_free_cell {
            0
        } else {
            LINE * (self.legend.len() as i32 + 1)
        };
        Drawing::new((WIDTH, rows * ROW + legend_height), |area| {
            self.draw(area, rows)
        })
    }

    /// Draws the panels in `rows` rows, and the legend.
    fn draw(&self, area: &Area, rows: i32) -> DrawResult {
        let (above, below) = area.split_vertically(rows * ROW * SCALE);
        let cells = above.split_evenly((rows as usize, 2));
        for (panel, cell) in self.panels.iter().zip(&cells) {
            panel.draw(cell)?;
        }
        self.draw_legend(cells.get(self.panels.len()).unwrap_or(&below))
    }

    /// Draws the legend.
    fn draw_legend(&self, area: &Area) -> DrawResult {
        let left = 70 * SCALE;
        for ((symbol, text), line) in self.legend.iter().zip(1..) {
            let y = line * LINE * SCALE;
            let (from, to) = ((left, y), (left + 36 * SCALE, y));
            let middle = (left + 18 * SCALE, y);
            match symbol {
                Symbol::Series(style) => style.mark(area, middle)?,
                Symbol::Front => {
                    let style = INK.stroke_width(SCALE as u32);
                    let (dash, gap) = (6 * SCALE, 4 * SCALE);
                    area.draw(&DashedPathElement::new([from, to], dash, gap, style))?;
                }
                Symbol::Floor => {
                    let box_ = [(from.0, y), (to.0, y + 9 * SCALE)];
                    area.draw(&Rectangle::new(box_, SHADE.filled()))?;
                    let style = GREY.stroke_width(SCALE as u32);
                    area.draw(&PathElement::new([from, to], style))?;
                }
                Symbol::None => {}
            }
            let start = (to.0 + 14 * SCALE, y);
            write(area, text, start, font(13, &INK), HPos::Left)?;
        }
        Ok(())
    }
}
