//! Picture of a retrieval: measured and fitted spectra, residuals, and the distribution of the
//! unknowns as a corner plot.
use std::ops::Range;
use std::path::Path;

use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::ReportError;
use super::canvas::{self, Area, DrawResult};
use super::residuals::{Picture, axis_end};
use super::style::{GREY, GRID, INK, SCALE, SHADE, Style, font, write};
use crate::retrieve::{FittedSpectrum, FittedValue, PosteriorMethod, Retrieval, short};

/// Width as shown, pixels.
const WIDTH: i32 = 960;
/// Height of the title.
const HEAD: i32 = 60;
/// Height of the panel of spectra.
const SPECTRA: i32 = 320;
/// Height of the panel of residuals.
const RESIDUALS: i32 = 190;
/// Largest height of a row of the corner plot.
const CELL: i32 = 230;
/// Largest number of points that are marked one by one.
const FEW: usize = 60;
/// Largest number of bins of a distribution.
const BINS: usize = 36;
/// Share of the mass that the axes of the corner plot leave out at each end.
const CUT: f64 = 0.0015;

/// The picture of a retrieval.
#[derive(Debug, Clone, Copy)]
pub struct RetrievalPicture<'a>(pub &'a Retrieval);

impl RetrievalPicture<'_> {
    /// Writes the picture atomically: as PNG if `path` ends with .png, else as SVG.
    ///
    /// # Errors
    /// [`ReportError`] if it cannot be drawn or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let size = (WIDTH, HEAD + SPECTRA + RESIDUALS + self.corner_height());
        Picture::write(path, "the retrieval", size, |area| self.draw(area))
    }

    fn unknowns(&self) -> i32 {
        self.0.best.len() as i32
    }

    fn corner_height(&self) -> i32 {
        self.unknowns() * CELL.min(900 / self.unknowns())
    }

    fn draw(&self, area: &Area) -> DrawResult {
        let (head, rest) = area.split_vertically(HEAD * SCALE);
        let (spectra, rest) = rest.split_vertically(SPECTRA * SCALE);
        let (residuals, corner) = rest.split_vertically(RESIDUALS * SCALE);
        self.head(&head)?;
        let values = || self.0.spectra.iter().flat_map(|s| &s.values);
        let most = values()
            .map(|v| v.measured.max(v.fitted))
            .fold(0.0, f64::max);
        let least = values()
            .map(|v| v.measured.min(v.fitted))
            .fold(0.0, f64::min);
        self.panel(&spectra, "measured, fitted", least..axis_end(most), false)?;
        let largest = values().map(|v| v.residual().abs()).fold(2.0, f64::max);
        let label = "(fitted - measured) / error";
        self.panel(&residuals, label, -1.1 * largest..1.1 * largest, true)?;
        self.corner(&corner)
    }

    fn head(&self, area: &Area) -> DrawResult {
        let firsts = self.0.estimates.iter().take(3).map(|estimate| {
            let [low, high] = estimate.interval.p68;
            format!("{} {} to {}", estimate.name, short(low), short(high))
        });
        let title = format!(
            "68 %: {}; chi-square {:.1} for {:.1}",
            firsts.collect::<Vec<_>>().join(", "),
            self.0.goodness.chi_square,
            self.0.goodness.degrees_of_freedom
        );
        let middle = WIDTH * SCALE / 2;
        let at = |y: i32| (middle, y * SCALE);
        write(area, &title, at(20), font(14, &INK), HPos::Center)?;
        let mut x = 70;
        for (i, spectrum) in self.0.spectra.iter().take(6).enumerate() {
            let style = Style::numbered(i);
            style.mark(area, (x * SCALE, 45 * SCALE))?;
            let name = Path::new(&spectrum.name).file_name();
            let name = name.map(|name| name.to_string_lossy().into_owned());
            let known = match spectrum.known.as_str() {
                "" => String::new(),
                known => format!(", {known}"),
            };
            let text = format!("{}{known}", name.unwrap_or_default());
            let start = ((x + 12) * SCALE, 45 * SCALE);
            write(area, &text, start, font(11, &INK), HPos::Left)?;
            x += 30 + 7 * text.chars().count() as i32;
        }
        Ok(())
    }

    /// Draws the spectra, or their residuals, over wavelength.
    fn panel(&self, area: &Area, label: &str, ys: Range<f64>, residuals: bool) -> DrawResult {
        let spectra = &self.0.spectra;
        let nm = || spectra.iter().flat_map(|s| s.values.iter().map(|v| v.nm));
        let (first, last) = (nm().fold(f64::INFINITY, f64::min), nm().fold(0.0, f64::max));
        let margin = 0.02 * (last - first);
        let xs = first - margin..last + margin;
        let mut chart = ChartBuilder::on(area)
            .margin(4 * SCALE)
            .margin_right(22 * SCALE)
            .x_label_area_size(38 * SCALE)
            .y_label_area_size(62 * SCALE)
            .build_cartesian_2d(xs.clone(), ys.clone())?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(SCALE as u32))
            .axis_style(INK.stroke_width(SCALE as u32))
            .label_style(font(11, &INK))
            .set_all_tick_mark_size(4 * SCALE)
            .x_label_formatter(&|nm| format!("{nm:.0}"))
            .x_desc("wavelength, nm")
            .y_desc(label)
            .axis_desc_style(font(12, &INK))
            .draw()?;
        let base = area.get_base_pixel();
        let pixel = |(nm, y): (f64, f64)| {
            let (x, y) = chart.backend_coord(&(nm, y.clamp(ys.start, ys.end)));
            (x - base.0, y - base.1)
        };
        if residuals {
            let style = GREY.stroke_width(SCALE as u32);
            for y in [-1.0, 1.0] {
                let ends = [pixel((xs.start, y)), pixel((xs.end, y))];
                area.draw(&DashedPathElement::new(ends, 6 * SCALE, 4 * SCALE, style))?;
            }
        }
        for (i, spectrum) in spectra.iter().enumerate() {
            let style = Style::numbered(i);
            let line = style.colour.stroke_width(2 * SCALE as u32);
            let path = |y: &dyn Fn(&FittedValue) -> f64| -> Vec<_> {
                spectrum
                    .values
                    .iter()
                    .map(|v| pixel((v.nm, y(v))))
                    .collect()
            };
            if residuals {
                area.draw(&PathElement::new(path(&FittedValue::residual), line))?;
                self.mark(area, spectrum, path(&FittedValue::residual), style)?;
                continue;
            }
            let mut band = path(&|v| v.fitted + v.fitted_sd);
            band.extend(path(&|v| v.fitted - v.fitted_sd).into_iter().rev());
            area.draw(&Polygon::new(band, style.colour.mix(0.25).filled()))?;
            area.draw(&PathElement::new(path(&|v| v.fitted), line))?;
            let bars = path(&|v| v.measured - v.sigma).into_iter();
            let bars = bars.zip(path(&|v| v.measured + v.sigma));
            for (low, high) in bars.take_while(|_| spectrum.values.len() <= FEW) {
                let thin = style.colour.stroke_width(SCALE as u32);
                area.draw(&PathElement::new([low, high], thin))?;
            }
            self.mark(area, spectrum, path(&|v| v.measured), style)?;
        }
        Ok(())
    }

    /// Draws the measured points: markers, or dots if there are many.
    fn mark(
        &self,
        area: &Area,
        spectrum: &FittedSpectrum,
        points: Vec<(i32, i32)>,
        style: Style,
    ) -> DrawResult {
        for at in points {
            match spectrum.values.len() <= FEW {
                true => style.mark(area, at)?,
                false => area.draw(&Circle::new(at, 2 * SCALE, style.colour.filled()))?,
            }
        }
        Ok(())
    }

    /// Draws the distributions: of each unknown on the diagonal, of each pair below it.
    fn corner(&self, area: &Area) -> DrawResult {
        let n = self.0.best.len();
        let bins: Vec<Bins> = (0..n).map(|i| Bins::new(self.0, i)).collect();
        let cells = area.split_evenly((n, n));
        for row in 0..n {
            for column in 0..=row {
                let cell = &cells[row * n + column];
                match row == column {
                    true => self.marginal(cell, row, &bins[row])?,
                    false => self.pair(cell, [column, row], [&bins[column], &bins[row]])?,
                }
            }
        }
        self.legend(area)
    }

    /// Explains the shades in the free corner.
    fn legend(&self, area: &Area) -> DrawResult {
        if self.unknowns() < 2 {
            return Ok(());
        }
        let right = (WIDTH - 240) * SCALE;
        for (k, (shade, text)) in [(DARK, "68 % of the mass"), (PALE, "95 %")]
            .iter()
            .enumerate()
        {
            let y = (24 + 22 * k as i32) * SCALE;
            let corners = [(right, y - 7 * SCALE), (right + 24 * SCALE, y + 7 * SCALE)];
            area.draw(&Rectangle::new(corners, shade.filled()))?;
            write(
                area,
                text,
                (right + 32 * SCALE, y),
                font(12, &INK),
                HPos::Left,
            )?;
        }
        let y = 68 * SCALE;
        cross(area, (right + 12 * SCALE, y))?;
        write(
            area,
            "most probable",
            (right + 32 * SCALE, y),
            font(12, &INK),
            HPos::Left,
        )
    }

    fn chart<'a, 'b>(
        &self,
        area: &'a Area<'b>,
        axes: [Option<usize>; 2],
        ranges: [Range<f64>; 2],
    ) -> DrawResult<
        ChartContext<
            'a,
            canvas::Canvas<'b>,
            Cartesian2d<
                plotters::coord::types::RangedCoordf64,
                plotters::coord::types::RangedCoordf64,
            >,
        >,
    > {
        let [xs, ys] = ranges;
        let mut chart = ChartBuilder::on(area)
            .margin(6 * SCALE)
            .margin_right(14 * SCALE)
            .x_label_area_size(38 * SCALE)
            .y_label_area_size(56 * SCALE)
            .build_cartesian_2d(xs, ys)?;
        let label = |axis: Option<usize>, u: f64| {
            axis.map_or(String::new(), |i| {
                short(self.0.scales[i].value(shown(self.0, i, u)))
            })
        };
        let name = |axis: Option<usize>| axis.map_or("", |i| self.0.scales[i].name);
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(INK.stroke_width(SCALE as u32))
            .label_style(font(10, &INK))
            .set_all_tick_mark_size(3 * SCALE)
            .x_labels(4)
            .y_labels(if axes[1].is_some() { 4 } else { 1 })
            .x_label_formatter(&|u| label(axes[0], *u))
            .y_label_formatter(&|u| label(axes[1], *u))
            .x_desc(name(axes[0]))
            .y_desc(name(axes[1]))
            .axis_desc_style(font(11, &INK))
            .draw()?;
        Ok(chart)
    }

    /// Draws the distribution of one unknown, with its 68 and 95 % shaded.
    fn marginal(&self, area: &Area, i: usize, bins: &Bins) -> DrawResult {
        let mut mass = vec![0.0; bins.count];
        for (u, weight) in self
            .0
            .posterior
            .points
            .iter()
            .zip(&self.0.posterior.weights)
        {
            if let Some(bin) = bins.of(shown(self.0, i, u[i])) {
                mass[bin] += weight;
            }
        }
        let most = mass.iter().copied().fold(0.0, f64::max);
        let ranges = [bins.range(), 0.0..1.1 * most];
        let mut chart = self.chart(area, [Some(i), None], ranges)?;
        let shades = shades(&mass);
        let bar = |(k, mass): (usize, &f64)| {
            let [low, high] = bins.ends(k);
            Rectangle::new(
                [(low, 0.0), (high, *mass)],
                shades[k].unwrap_or(SHADE).filled(),
            )
        };
        chart.draw_series(mass.iter().enumerate().map(bar))?;
        let best = shown(self.0, i, self.0.best[i]);
        let line = [(best, 0.0), (best, 1.1 * most)];
        let style = INK.stroke_width(SCALE as u32);
        chart.draw_series([PathElement::new(line, style)])?;
        Ok(())
    }

    /// Draws the distribution of two unknowns.
    fn pair(&self, area: &Area, [x, y]: [usize; 2], [xs, ys]: [&Bins; 2]) -> DrawResult {
        let mut mass = vec![0.0; xs.count * ys.count];
        for (u, weight) in self
            .0
            .posterior
            .points
            .iter()
            .zip(&self.0.posterior.weights)
        {
            if let (Some(i), Some(j)) =
                (xs.of(shown(self.0, x, u[x])), ys.of(shown(self.0, y, u[y])))
            {
                mass[j * xs.count + i] += weight;
            }
        }
        let mut chart = self.chart(area, [Some(x), Some(y)], [xs.range(), ys.range()])?;
        let shades = shades(&mass);
        let cells = shades.iter().enumerate().filter_map(|(k, shade)| {
            let ([left, right], [low, high]) = (xs.ends(k % xs.count), ys.ends(k / xs.count));
            Some(Rectangle::new(
                [(left, low), (right, high)],
                (*shade)?.filled(),
            ))
        });
        chart.draw_series(cells)?;
        let base = area.get_base_pixel();
        let best = |i: usize| shown(self.0, i, self.0.best[i]);
        let (px, py) = chart.backend_coord(&(best(x), best(y)));
        cross(area, (px - base.0, py - base.1))
    }
}

/// Where a place is drawn: values increase to the right and up.
fn shown(retrieval: &Retrieval, i: usize, u: f64) -> f64 {
    let values = &retrieval.scales[i].values;
    match values.first() <= values.last() {
        true => u,
        false => 1.0 - u,
    }
}

/// Colour of the cells with 68 % of the mass.
const DARK: RGBColor = RGBColor(86, 150, 200);
/// Colour of the cells with 95 % of the mass.
const PALE: RGBColor = RGBColor(196, 220, 238);

/// The shade of each cell: the densest cells with 68 % of the mass, and those with 95 %.
fn shades(mass: &[f64]) -> Vec<Option<RGBColor>> {
    let mut order: Vec<usize> = (0..mass.len()).collect();
    order.sort_by(|a, b| mass[*b].total_cmp(&mass[*a]));
    let total: f64 = mass.iter().sum();
    let mut shades = vec![None; mass.len()];
    let mut sum = 0.0;
    for cell in order.into_iter().take_while(|cell| mass[*cell] > 0.0) {
        shades[cell] = match sum / total {
            ..0.68 => Some(DARK),
            ..0.95 => Some(PALE),
            _ => break,
        };
        sum += mass[cell];
    }
    shades
}

/// Draws a small cross.
fn cross(area: &Area, (x, y): (i32, i32)) -> DrawResult {
    let (r, style) = (5 * SCALE, INK.stroke_width(2 * SCALE as u32));
    area.draw(&PathElement::new([(x - r, y), (x + r, y)], style))?;
    area.draw(&PathElement::new([(x, y - r), (x, y + r)], style))
}

/// Bins of the places of one unknown, aligned with the cells of a grid.
#[derive(Debug)]
struct Bins {
    first: f64,
    width: f64,
    count: usize,
}

impl Bins {
    fn new(retrieval: &Retrieval, i: usize) -> Self {
        let posterior = &retrieval.posterior;
        let mut pairs: Vec<(f64, f64)> = posterior
            .points
            .iter()
            .zip(&posterior.weights)
            .map(|(u, weight)| (shown(retrieval, i, u[i]), *weight))
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut sum, mut ends) = (0.0, [f64::NAN; 2]);
        for (u, weight) in pairs {
            sum += weight;
            if ends[0].is_nan() && sum > CUT {
                ends[0] = u;
            }
            if sum < 1.0 - CUT || ends[1].is_nan() {
                ends[1] = u;
            }
        }
        let side = match posterior.method {
            PosteriorMethod::Grid { sides, .. } => sides[i],
            PosteriorMethod::Sampler { .. } => (ends[1] - ends[0]).max(1e-6) / BINS as f64,
        };
        let first = (ends[0] / side).floor() * side;
        let cells = ((ends[1] - first) / side).floor() + 1.0;
        let per_bin = (cells / BINS as f64).ceil().max(1.0);
        Self {
            first,
            width: per_bin * side,
            count: (cells / per_bin).ceil() as usize,
        }
    }

    fn range(&self) -> Range<f64> {
        self.first..self.first + self.width * self.count as f64
    }

    fn ends(&self, bin: usize) -> [f64; 2] {
        [0, 1].map(|end| self.first + self.width * (bin + end) as f64)
    }

    fn of(&self, u: f64) -> Option<usize> {
        let bin = ((u - self.first) / self.width).floor();
        (bin >= 0.0 && bin < self.count as f64).then_some(bin as usize)
    }
}
